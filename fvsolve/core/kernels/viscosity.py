"""Viscosity of the fluid by its temperature (Walther, ASTM D341), and the friction of pipes that follows it.

log10(log10(nu + 0.7)) = a - b log10(T), with kinematic viscosity nu [mm2/s] and temperature T [K]. Friction is that of
a steady flow at the present temperature of each cell. The rates of waves contain friction at the temperature of the
start; `viscous_friction` adds the difference.
"""

from math import log10

from fvsolve.core.kernels.dtypes import FRICTION_ROUGH, LAW_LINEAR
from fvsolve.core.kernels.pipes import GAUSS
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

SAME = 1e-14  # relative difference of temperatures that is rounding
COLDEST = 1.0  # least temperature [K]; iterations may leave the range of the law
DRY = 1e-8  # least mass per length, over that of a full pipe


@njit(forceinline=True)
def walther_viscosity(a, b, temperature):
    """Kinematic viscosity [mm2/s] at a temperature [K]."""
    return 10.0 ** (10.0 ** (a - b * log10(max(temperature, COLDEST)))) - 0.7


@njit
def cell_reynolds(y, tables, p, i):
    """Reynolds number per mass flow [s/kg] in cell i of pipe p, at the present temperature of the cell."""
    st, pipe = tables.settings[0], tables.pipes[p]
    if st["walther_b"] == 0.0 or pipe["friction"] != FRICTION_ROUGH:
        return pipe["reynolds"]
    k, n = st["temperature"], pipe["cells"]
    mass = (
        tables.profile[pipe["center"] + i]
        + (y[pipe["y"] + i] + y[pipe["y"] + n + i]) / pipe["speed"]
    )
    mass += tables.floats[tables.scalars[k]["wall_masses"] + p]
    temperature = y[tables.scalars[k]["y"] + pipe["cell"] + i] / mass + tables.scalars[k]["zero"]
    # Rounding of the temperature must not disturb a steady flow.
    if abs(temperature - pipe["temperature"]) <= SAME * pipe["temperature"]:
        return pipe["reynolds"]
    start = walther_viscosity(st["walther_a"], st["walther_b"], pipe["temperature"])
    return pipe["reynolds"] * (
        start / walther_viscosity(st["walther_a"], st["walther_b"], temperature)
    )


@njit
def viscous_friction(t, y, dydt, out, handle):
    """Subtract from the rates of waves what friction gains by the change of temperature, unless `dydt` is empty.

    It is averaged over the two Gauss points of `pipes.subtract_friction`; with cavities it is that at the centre.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    for p in range(tables.pipes.size if dydt.size > 0 else 0):
        pipe = tables.pipes[p]
        if pipe["friction"] != FRICTION_ROUGH:
            continue
        n = pipe["cells"]
        o = pipe["y"]
        spread = GAUSS * pipe["dx"] / pipe["speed"]
        spread, full = 0.0 if st["floor"] > 0.0 else spread, st["rho"] * pipe["area"]
        kind = FRICTION_ROUGH
        loss = 0.0
        rough = pipe["rough"]
        roughness = pipe["roughness"]
        before = pipe["reynolds"]
        for i in range(n):
            now = cell_reynolds(y, tables, p, i)
            # The rates of waves already contain the friction at this temperature.
            if now == before:
                continue
            flow = pipe["flow"] + (y[o + i] - y[o + n + i])
            d, excess = spread * (dydt[o + i] + dydt[o + n + i]), 0.0
            for sign in (-1.0, 1.0):
                excess += drag(kind, loss, rough, roughness, now, flow + sign * d)
                excess -= drag(kind, loss, rough, roughness, before, flow + sign * d)
            # A quarter: half of the friction for each wave, as the mean of two points.
            excess *= 0.25
            if st["law"] != LAW_LINEAR:
                mass = (
                    tables.profile[pipe["center"] + i] + (y[o + i] + y[o + n + i]) / pipe["speed"]
                )
                excess *= full / max(mass, DRY * full)
            dydt[o + i] -= excess
            dydt[o + n + i] += excess
