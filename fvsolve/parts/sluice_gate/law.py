"""Flow under a sluice gate with contraction to the depth y = Cc a behind it, a its opening and Cc its contraction.

Free: energy from the depth h to y. Drowned: energy from h to the depth Y above the jet, momentum from there to the
lower depth. Energy and momentum have two solutions for lower depths between the fold, where the drowned flow begins,
and the sequent depth of y. There the flow is a straight line from the free flow at the fold to the drowned flow at the
sequent depth, so that it is continuous. The flow is never more than that over a weir of the same width and sill. Depths
are above the sill. The scheduled setting is the opening a.
"""

from math import sqrt

from fvsolve.core.kernels import structures
from fvsolve.core.kernels.structures import DROWNED, FREE, weir_flow
from fvsolve.jit import njit, specialise

# Numbers: width [m], sill [m], contraction Cc, 2/3 C sqrt(2 g) b of the weir [m^1.5/s], gravity [m/s2]
WIDTH, SILL, CONTRACTION, WEIR, GRAVITY = range(5)
NEWTON_STEPS = 30


@njit
def drowned_square(h, y, lower):
    """q^2 / g of the drowned flow q per width [m3] at the depths h and `lower` on both sides and y of the jet [m].

    Energy and momentum give A^2 Q^2 - (2 h A - B) Q + h^2 - lower^2 = 0 for Q = q^2 / g; this is the smaller root.
    """
    a, b = 0.5 * (1.0 / (y * y) - 1.0 / (h * h)), 2.0 / y - 2.0 / lower
    p, rest = 2.0 * h * a - b, (h - lower) * (h + lower)
    return 2.0 * rest / (p + sqrt(max(p * p - 4.0 * a * a * rest, 0.0)))


@njit
def fold_depth(h, y, sequent):
    """Lower depth [m] at which both roots of the drowned flow coincide, the greatest one below the sequent depth [m].

    Newton's method for a convex function, from the right. h, y : as for `drowned_square`
    """
    a, x = 0.5 * (1.0 / (y * y) - 1.0 / (h * h)), sequent
    for _ in range(NEWTON_STEPS):
        root = sqrt((h - x) * (h + x))
        slope = x / root - 1.0 / (a * x * x)
        if slope <= 0.0:
            break
        change = (h - 1.0 / (y * a) + 1.0 / (a * x) - root) / slope
        x -= change
        if change <= 1e-15 * x:
            break
    return x


@njit
def gate_flow(h, y, lower, gravity):
    """(flow per width [m2/s], regime) under a gate, h above y; arguments as for `drowned_square`."""
    free = y * h * sqrt(2.0 * gravity / (h + y))
    if lower <= y:
        return free, FREE
    sequent = 0.5 * y * (sqrt(1.0 + 8.0 * free * free / (gravity * y * y * y)) - 1.0)
    drowned = sqrt(gravity * drowned_square(h, y, max(lower, sequent)))
    if lower >= sequent:
        return drowned, DROWNED
    fold = fold_depth(h, y, sequent)
    if lower <= fold:
        return free, FREE
    return free + (drowned - free) * (lower - fold) / (sequent - fold), DROWNED


@njit
def rule(floats, at, setting, ahead, z, fall):
    """(flow [m3/s], regime) under a gate; arguments as in `kernels.structures`."""
    h, y = z - floats[at + SILL], floats[at + CONTRACTION] * setting
    over = weir_flow(floats[at + WEIR], h, fall)
    if h <= y:
        return over
    if y <= 0.0:
        return 0.0, structures.NONE
    flow, regime = gate_flow(h, y, h - fall, floats[at + GRAVITY])
    flow *= floats[at + WIDTH]
    return (flow, regime) if flow < over[0] else over


set = structures.set_structure
flow = gate_law_flow = specialise(
    structures.flow_template, "gate_law_flow", RULE=rule, __name__=__name__
)
slopes = gate_law_slopes = specialise(
    structures.slopes_template, "gate_law_slopes", FLOW=flow, __name__=__name__
)
chord = gate_law_chord = specialise(
    structures.chord_template, "gate_law_chord", FLOW=flow, __name__=__name__
)
line = gate_law_line = specialise(
    structures.line_template,
    "gate_law_line",
    FLOW=flow,
    SLOPES=slopes,
    CHORD=chord,
    __name__=__name__,
)
step = gate_law_step = specialise(
    structures.step_template, "gate_law_step", FLOW=flow, LINE=line, __name__=__name__
)
lift = gate_law_lift = specialise(
    structures.lift_template, "gate_law_lift", SLOPES=slopes, __name__=__name__
)
slope = gate_law_slope = specialise(
    structures.slope_template, "gate_law_slope", SLOPES=slopes, __name__=__name__
)
value = gate_law_value = specialise(
    structures.regime_template, "gate_law_value", FLOW=flow, __name__=__name__
)
