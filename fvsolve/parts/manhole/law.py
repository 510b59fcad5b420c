"""Flow through the lid of a manhole, down from the street or up from the shaft.

Down: the lesser of a weir along the perimeter and an orifice. Up: an orifice, from a shaft with a level above the lid.
Sources: Rubinato, Lee, Martins, Shucksmith 2018 (doi 10.1007/s11269-018-1971-z); coefficients of Itzi for an open lid.
"""

from math import sqrt

from fvsolve.core.kernels import structures
from fvsolve.core.kernels.structures import DROWNED, FREE, LINEAR_FALL, NONE, weir_flow
from fvsolve.jit import njit, specialise

# Numbers: height [m], 2/3 Cw P sqrt(2 g) [m^1.5/s], Co A sqrt(2 g) [m^2.5/s], 1 if the street is at `from`, else 0
CREST, WEIR, ORIFICE, STREET_FIRST = range(4)


@njit
def rule(floats, at, setting, ahead, z, fall):
    """(flow [m3/s], regime) of a manhole; arguments as in `kernels.structures`."""
    h, drive = z - floats[at + CREST], min(fall, z - floats[at + CREST])
    if h <= 0.0:
        return 0.0, NONE
    orifice = floats[at + ORIFICE] * (
        sqrt(drive) if drive >= LINEAR_FALL else drive / sqrt(LINEAR_FALL)
    )
    if ahead == (floats[at + STREET_FIRST] == 1.0):
        weir, regime = weir_flow(floats[at + WEIR], h, fall)
        if weir <= orifice:
            return weir, regime
    return orifice, DROWNED if fall < h else FREE


set = structures.set_structure
flow = manhole_law_flow = specialise(
    structures.flow_template, "manhole_law_flow", RULE=rule, __name__=__name__
)
slopes = manhole_law_slopes = specialise(
    structures.slopes_template, "manhole_law_slopes", FLOW=flow, __name__=__name__
)
chord = manhole_law_chord = specialise(
    structures.chord_template, "manhole_law_chord", FLOW=flow, __name__=__name__
)
line = manhole_law_line = specialise(
    structures.line_template,
    "manhole_law_line",
    FLOW=flow,
    SLOPES=slopes,
    CHORD=chord,
    __name__=__name__,
)
step = manhole_law_step = specialise(
    structures.step_template, "manhole_law_step", FLOW=flow, LINE=line, __name__=__name__
)
lift = manhole_law_lift = specialise(
    structures.lift_template, "manhole_law_lift", SLOPES=slopes, __name__=__name__
)
slope = manhole_law_slope = specialise(
    structures.slope_template, "manhole_law_slope", SLOPES=slopes, __name__=__name__
)
value = manhole_law_value = specialise(
    structures.regime_template, "manhole_law_value", FLOW=flow, __name__=__name__
)
