"""Cases of parts that heat the fluid."""

from reference.scenes import RHO, scene

CP, ZERO = 1900.0, 273.15
METHODS = [
    {"method": "rk4", "step": 4.0},
    {"method": "dormand-prince", "rtol": 1e-10},
    {"method": "radau-iia-5", "rtol": 1e-10},
    {"method": "rodas-5p", "rtol": 1e-10},
    {"method": "auto", "rtol": 1e-10},
]
WARM = {"heat": True, "specific_heat": "1.9 kJ/kg/K", "unit": "degC", "initial": 40.0}
OIL = {"name": "user", "density": RHO, "bulk_modulus": 1.6e9, "viscosity": "46 cSt"}


def heated(nodes, links, end, heat_from=(), numerics=None, probes=(), fluid=None, **scalar) -> dict:
    """Case in which the parts `heat_from` heat the fluid; other arguments as for `scene`."""
    warm = {**WARM, "heat_from": heat_from if heat_from == "all" else list(heat_from), **scalar}
    return scene(
        nodes,
        links,
        end,
        numerics or METHODS[-1],
        probes,
        end / 40,
        scalars={"temperature": warm},
        fluid=fluid or OIL,
    )
