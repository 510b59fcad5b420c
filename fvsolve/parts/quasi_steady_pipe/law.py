"""Flow through a pipe that follows its losses at once.

The drop of p + rho g z is L / A times the drag [kg/s2] of the mass flow M, see `kernels.steady_friction.drag`, over the
upstream density relative to the reference density. Below the flow `LEAST` losses without a laminar part are an odd
cubic with equal value and slope at that flow, so that the slope of the flow is bounded at no flow.
`floats` holds the numbers in the order of the constants below.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import FRICTION_ROUGH
from fvsolve.core.kernels.steady_friction import drag, drag_slope
from fvsolve.jit import njit

# columns of a pipe, its first numbers
DRAG = ("friction", "loss", "rough", "roughness", "reynolds")
KIND, LOSS, ROUGH, ROUGHNESS, REYNOLDS, PER, LEAST = range(7)  # PER : L / A [1/m]; LEAST : [kg/s]
NEAR = 1e-3  # share of the drop below which the tangent replaces the chord
SWEEPS = 50


@njit
def loss_and_slope(floats, at, flow):
    """(drop [Pa], d drop / d flow [Pa s/kg]) of a mass flow [kg/s] at the reference density."""
    kind = int(floats[at + KIND])
    loss = floats[at + LOSS]
    rough = floats[at + ROUGH]
    roughness = floats[at + ROUGHNESS]
    reynolds = floats[at + REYNOLDS]
    per = floats[at + PER]
    least = floats[at + LEAST]
    if kind == FRICTION_ROUGH or abs(flow) >= least:
        slope = drag_slope(kind, loss, rough, roughness, reynolds, flow)
        return per * drag(kind, loss, rough, roughness, reynolds, flow), per * slope
    value = per * drag(kind, loss, rough, roughness, reynolds, least)
    slope = per * drag_slope(kind, loss, rough, roughness, reynolds, least) * least
    x, cubic = flow / least, 0.5 * (slope - value)
    return x * (value + cubic * (x * x - 1.0)), (value + cubic * (3.0 * x * x - 1.0)) / least


@njit
def flow_at_loss(floats, at, drop, flow):
    """Mass flow [kg/s] at a drop [Pa], to within `NEAR` of the drop; flow : first estimate of the flow [kg/s]."""
    flow = abs(flow) if drop >= 0.0 else -abs(flow)
    for _ in range(SWEEPS):
        lost, slope = loss_and_slope(floats, at, flow)
        if abs(drop - lost) <= NEAR * abs(drop):
            break
        if lost / drop > 4.0:  # far above: by the square root
            flow *= sqrt(drop / lost)
        else:
            flow += (drop - lost) / slope
    return flow


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of the next Newton step dM = a + s d(drop) [kg/s, kg/s/Pa]; arguments as for `restriction_step`.

    The chord between the present flow and the flow at the drop replaces the slope of the losses, where both differ.
    """
    floats, at = tables.floats, tables.valves[k]["data"]
    lost, slope = loss_and_slope(floats, at, m)
    drop *= denser
    rest = drop - lost
    if abs(rest) > 2.0 * NEAR * abs(drop) and drop != 0.0:
        guess = sqrt(g * abs(drop))
        flow = flow_at_loss(floats, at, drop, max(abs(m), guess) if m * drop > 0.0 else guess)
        if flow != m:
            slope = max(rest / (flow - m), 0.5 * loss_and_slope(floats, at, 0.0)[1])
    return rest / slope, denser / slope


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa] at the present flow."""
    floats, at = tables.floats, tables.valves[k]["data"]
    return 1.0 / loss_and_slope(floats, at, out[tables.layout[0]["valve"] + k])[1]
