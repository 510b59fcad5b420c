"""Flow over a weir, 2/3 C sqrt(2 g) b h^1.5, times Villemonte's factor (1 - r^1.5)^0.385 where it is drowned.

h is the depth of the higher level above the crest, r that of the lower level over h, b the width and C the coefficient.
The scheduled setting is the crest. Its only number is 2/3 C sqrt(2 g) b [m^1.5/s].
Source: Villemonte 1947, Submerged-weir discharge studies, Engineering News-Record 139.
"""

from fvsolve.core.kernels import structures
from fvsolve.core.kernels.structures import weir_flow
from fvsolve.jit import njit, specialise

SIZE = 0  # index of its number


@njit
def rule(floats, at, setting, ahead, z, fall):
    """(flow [m3/s], regime) over a weir; arguments as in `kernels.structures`."""
    return weir_flow(floats[at + SIZE], z - setting, fall)


set = structures.set_structure
flow = weir_law_flow = specialise(
    structures.flow_template, "weir_law_flow", RULE=rule, __name__=__name__
)
slopes = weir_law_slopes = specialise(
    structures.slopes_template, "weir_law_slopes", FLOW=flow, __name__=__name__
)
chord = weir_law_chord = specialise(
    structures.chord_template, "weir_law_chord", FLOW=flow, __name__=__name__
)
line = weir_law_line = specialise(
    structures.line_template,
    "weir_law_line",
    FLOW=flow,
    SLOPES=slopes,
    CHORD=chord,
    __name__=__name__,
)
step = weir_law_step = specialise(
    structures.step_template, "weir_law_step", FLOW=flow, LINE=line, __name__=__name__
)
lift = weir_law_lift = specialise(
    structures.lift_template, "weir_law_lift", SLOPES=slopes, __name__=__name__
)
slope = weir_law_slope = specialise(
    structures.slope_template, "weir_law_slope", SLOPES=slopes, __name__=__name__
)
value = weir_law_value = specialise(
    structures.regime_template, "weir_law_value", FLOW=flow, __name__=__name__
)
