"""Viscosity of the fluid by its temperature (Walther, ASTM D341), and the friction of pipes that follows it.

log10(log10(nu + 0.7)) = a - b log10(T), with kinematic viscosity nu [mm2/s] and temperature T [K]. Friction is that of
a steady flow at the present temperature of each cell. The rates of waves contain friction at the temperature of the
start; `viscous_friction` adds the difference.
"""

from math import log10

from fvsolve.core.kernels.dtypes import FRICTION_ROUGH, LAW_LINEAR
from fvsolve.core.kernels.pipes import GAUSS
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.features.scalars.kernels.scalar_transport import heated_scalar
from fvsolve.features.scalars.kernels.tables import open_scalars
from fvsolve.jit import njit

SAME = 1e-14  # relative difference of temperatures that is rounding
COLDEST = 1.0  # least temperature [K]; iterations may leave the range of the law
DRY = 1e-8  # least mass per length, over that of a full pipe


@njit(forceinline=True)
def walther_viscosity(a, b, temperature):
    """Kinematic viscosity [mm2/s] at a temperature [K]."""
    return 10.0 ** (10.0 ** (a - b * log10(max(temperature, COLDEST)))) - 0.7


@njit
def cell_reynolds(y, tables, q, p, i):
    """Reynolds number per mass flow [s/kg] in cell i of pipe p, at the present temperature of the cell.

    q : number of the scalar that is this temperature
    """
    scalar, pipe = tables.scalars[q], tables.pipes[p]
    if scalar["walther_b"] == 0.0 or pipe["friction"] != FRICTION_ROUGH:
        return pipe["reynolds"]
    n = pipe["cells"]
    mass = (
        tables.profile[pipe["center"] + i]
        + (y[pipe["y"] + i] + y[pipe["y"] + n + i]) / pipe["speed"]
    )
    mass += tables.floats[scalar["wall_masses"] + p]
    temperature = y[scalar["y"] + pipe["cell"] + i] / mass + scalar["zero"]
    # Rounding of the temperature must not disturb a steady flow.
    if abs(temperature - pipe["temperature"]) <= SAME * pipe["temperature"]:
        return pipe["reynolds"]
    start = walther_viscosity(scalar["walther_a"], scalar["walther_b"], pipe["temperature"])
    return pipe["reynolds"] * (
        start / walther_viscosity(scalar["walther_a"], scalar["walther_b"], temperature)
    )


@njit
def write_reynolds(t, y, dydt, out, handle, power):
    """Write the Reynolds numbers per mass flow in the cells of pipes to `work`, for the powers of friction."""
    tables = open_scalars(handle)
    q = heated_scalar(tables)
    for p in range(tables.pipes.size):
        at = tables.pipes[p]["present"]
        for i in range(tables.pipes[p]["cells"] if at >= 0 else 0):
            tables.work[at + i] = cell_reynolds(y, tables, q, p, i)


@njit
def viscous_friction(t, y, dydt, out, handle):
    """Subtract from the rates of waves what friction gains by the change of temperature, unless `dydt` is empty.

    It is averaged over the two Gauss points of `pipes.subtract_friction`; with cavities it is that at the centre.
    """
    tables = open_scalars(handle)
    st = tables.settings[0]
    q = heated_scalar(tables)
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
            now = cell_reynolds(y, tables, q, p, i)
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
