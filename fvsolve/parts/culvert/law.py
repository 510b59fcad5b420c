"""Flow through a culvert: the lesser of inlet control and outlet control of HDS-5 (FHWA-HIF-12-026).

Inlet control: headwater HW above the upstream invert, D the height, A the full area, S the slope of the barrel,
x = Ku Q / (A sqrt(D)), Ku = 1.811, Ks = -0.5, or 0.7 for mitred inlets:
form 1: HW / D = Hc / D + K x^M + Ks S, Hc the specific head of critical flow; form 2: HW / D = K x^M;
submerged: HW / D = c x^2 + Y + Ks S. Between HW = 0.95 D and x = 4 the flow is linear in HW. Below HW = D / 4 the
slope term is reduced in proportion to HW, so that an inlet without water has no flow.
Outlet control: the higher level is the outlet's head plus (ke + kx + 19.63 n^2 L / R^(4/3)) V^2 / (2 g). From HW = D
on the barrel is full, with an outlet's head of at least the mean of critical depth and D. Up to 0.75 D the outlet's
head is at least critical depth, and area and hydraulic radius are those at the mean of the depths at both ends. Between
both headwaters the flow is interpolated.
"""

from math import acos, sin, sqrt

from fvsolve.core.kernels import structures
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.core.kernels.structures import DROWNED, FREE, LINEAR_FALL, NONE, higher_level
from fvsolve.jit import njit, specialise

# Numbers: constants of the inlet, with Ks; width (0 for a circle) and height of the barrel, its full area; gravity;
# sum of loss coefficients; 19.63 n^2 L [m^(4/3)]; number of open barrels; length; inverts at `from` and `to`; flows at
# HW = 0.95 D into both ends [m3/s]
(
    FORM,
    K,
    M,
    C,
    Y,
    KS,
    WIDTH,
    HEIGHT,
    AREA,
    GRAVITY,
    LOSS,
    FRICTION,
    BARRELS,
    LENGTH,
    FROM,
    TO,
    FLOW_FROM,
    FLOW_TO,
) = range(18)
KU = 1.811
WEIR_END, ORIFICE_START = 0.95, 4.0  # HW / D and x between which the inlet control is interpolated
PARTLY, FULL_FROM = 0.75, 1.0  # HW / D between which partly full and full barrels are interpolated
FADING = 0.25  # HW / D below which the slope term is reduced
INLET, PARTLY_FULL, FULL = 0, 1, 2  # balances of `excess`
DRY, INLET_WEIR, INLET_ORIFICE, OUTLET = 0, 1, 2, 3  # controls
SWEEPS = 60


@njit
def section(floats, at, depth):
    """(area [m2], width of the surface, wetted perimeter [m]) of a barrel filled to a depth [m]."""
    height, width = floats[at + HEIGHT], floats[at + WIDTH]
    depth = min(max(depth, 0.0), height)
    if width > 0.0:
        return (
            width * depth,
            width,
            width + 2.0 * depth if depth < height else 2.0 * (width + height),
        )
    angle = 2.0 * acos(1.0 - 2.0 * depth / height)
    return (
        0.125 * height * height * (angle - sin(angle)),
        2.0 * sqrt(depth * (height - depth)),
        0.5 * height * angle,
    )


@njit
def critical_flow(floats, at, depth):
    """(critical flow [m3/s], its specific head [m]) at a depth [m]."""
    area, top, _ = section(floats, at, depth)
    if area <= 0.0:
        return 0.0, 0.0
    mean = area / max(top, 1e-12 * floats[at + HEIGHT])
    return area * sqrt(floats[at + GRAVITY] * mean), depth + 0.5 * mean


@njit
def relative_flow(floats, at, flow):
    """x = Ku Q / (A sqrt(D)) of a flow Q [m3/s]."""
    return KU * flow / (floats[at + AREA] * sqrt(floats[at + HEIGHT]))


@njit
def loss_factor(floats, at, area, perimeter):
    """Loss of head over the square of the flow [s2/m5] in a barrel with an area and a wetted perimeter."""
    losses = floats[at + LOSS] + floats[at + FRICTION] * (perimeter / area) ** (4.0 / 3.0)
    return losses / (2.0 * floats[at + GRAVITY] * area * area)


@njit
def excess(floats, at, balance, depth, given, head):
    """Head needed for critical flow at a depth, above the given head [m]: at the inlet, or with losses to the outlet.

    balance : INLET, PARTLY_FULL or FULL; depth : critical depth [m]
    given : depth at the inlet of a partly full barrel; head : above the invert of the inlet, or of the outlet [m]
    """
    height = floats[at + HEIGHT]
    flow, specific = critical_flow(floats, at, depth)
    if balance == INLET:
        return (
            specific
            + height * floats[at + K] * relative_flow(floats, at, flow) ** floats[at + M]
            - head
        )
    if balance == FULL:
        return (
            0.5 * (depth + height)
            + loss_factor(floats, at, *section(floats, at, height)[::2]) * flow * flow
            - head
        )
    area, _, perimeter = section(floats, at, 0.5 * (given + depth))
    return depth + loss_factor(floats, at, area, perimeter) * flow * flow - head


@njit
def critical_depth(floats, at, balance, low, high, given, head):
    """Depth between `low` and `high` at which `excess` is zero, by the method of Ridders; the bound next to it if none.

    Other arguments as for `excess`
    """
    below = excess(floats, at, balance, low, given, head)
    above = excess(floats, at, balance, high, given, head)
    if below >= 0.0:
        return low
    if above <= 0.0:
        return high
    last = low
    for _ in range(SWEEPS):
        middle = 0.5 * (low + high)
        at_middle = excess(floats, at, balance, middle, given, head)
        if at_middle == 0.0:
            return middle
        new = middle - (middle - low) * at_middle / sqrt(at_middle * at_middle - below * above)
        new = min(max(new, low), high)
        found = excess(floats, at, balance, new, given, head)
        if found == 0.0 or abs(new - last) <= 1e-15 * high:
            return new
        last = new
        for depth, value in ((middle, at_middle), (new, found)):
            if value < 0.0 and depth > low:
                low, below = depth, value
            elif value > 0.0 and depth < high:
                high, above = depth, value
    return last


@njit
def inlet_weir_flow(floats, at, slope, headwater):
    """Flow [m3/s] under inlet control by the unsubmerged formula, at a headwater above 0 [m]."""
    height = floats[at + HEIGHT]
    if floats[at + FORM] == 2.0:
        x = (headwater / (height * floats[at + K])) ** (1.0 / floats[at + M])
        return x * floats[at + AREA] * sqrt(height) / KU
    head = headwater - floats[at + KS] * slope * min(height, headwater / FADING)
    if head <= 0.0:
        return 0.0
    return critical_flow(
        floats, at, critical_depth(floats, at, INLET, 0.0, min(head, height), 0.0, head)
    )[0]


@njit
def inlet_flow(floats, at, slope, headwater, joint):
    """Flow [m3/s] under inlet control; joint : flow at HW = 0.95 D"""
    height = floats[at + HEIGHT]
    if headwater <= WEIR_END * height:
        return inlet_weir_flow(floats, at, slope, headwater)
    constant, unit = floats[at + Y] + floats[at + KS] * slope, floats[at + AREA] * sqrt(height) / KU
    # headwater at x = 4
    start = max(floats[at + C] * ORIFICE_START**2 + constant, WEIR_END + 1e-3) * height
    if headwater < start:
        share = (headwater - WEIR_END * height) / (start - WEIR_END * height)
        return joint + share * (ORIFICE_START * unit - joint)
    return max(sqrt((headwater / height - constant) / floats[at + C]), ORIFICE_START) * unit


@njit
def outlet_flow(floats, at, balance, headwater, head, tail):
    """(flow [m3/s], regime) under outlet control of a full or partly full barrel.

    headwater : depth of the higher level at the inlet; head, tail : of both levels above the invert of the outlet [m]
    """
    height = floats[at + HEIGHT]
    # critical depth with an outlet's head equal to the tail
    given, at_critical = min(headwater, height), tail
    area, _, perimeter = section(floats, at, 0.5 * (given + min(max(tail, 0.0), height)))
    if balance == FULL:
        at_critical = 2.0 * tail - height
        area, _, perimeter = section(floats, at, height)
    most = critical_flow(floats, at, given)[0]
    drowned = sqrt(max(head - tail, 0.0) / loss_factor(floats, at, area, perimeter))
    if at_critical >= height or (
        at_critical > 0.0 and critical_flow(floats, at, at_critical)[0] >= drowned
    ):
        return (drowned, DROWNED) if balance == FULL or drowned < most else (most, FREE)
    high = height if balance == FULL else given
    depth = critical_depth(floats, at, balance, min(max(at_critical, 0.0), high), high, given, head)
    if balance == FULL and depth >= height:
        return sqrt(max(head - height, 0.0) / loss_factor(floats, at, area, perimeter)), FREE
    return critical_flow(floats, at, depth)[0], FREE


@njit
def controlled_flow(floats, at, ahead, z, fall):
    """(flow [m3/s], regime, control) of a culvert; arguments as in `kernels.structures`."""
    near, far = (
        (floats[at + FROM], floats[at + TO]) if ahead else (floats[at + TO], floats[at + FROM])
    )
    headwater, height = z - near, floats[at + HEIGHT]
    if headwater <= 0.0:
        return 0.0, NONE, DRY
    slope = (near - far) / floats[at + LENGTH]
    joint = floats[at + FLOW_FROM] if ahead else floats[at + FLOW_TO]
    inlet = inlet_flow(floats, at, slope, headwater, joint)
    share = min(max((headwater / height - PARTLY) / (FULL_FROM - PARTLY), 0.0), 1.0)
    flow, regime = 0.0, FREE
    if share < 1.0:
        outlet, found = outlet_flow(floats, at, PARTLY_FULL, headwater, z - far, z - far - fall)
        flow, regime = (1.0 - share) * min(inlet, outlet), found if outlet < inlet else FREE
    if share > 0.0:
        outlet, found = outlet_flow(floats, at, FULL, headwater, z - far, z - far - fall)
        flow = flow + share * min(inlet, outlet)
        regime = max(found, regime) if outlet < inlet else regime
    control = INLET_WEIR if headwater <= WEIR_END * height else INLET_ORIFICE
    if flow < (1.0 - 1e-9) * inlet:
        control = OUTLET
    return floats[at + BARRELS] * flow, regime if flow > 0.0 else NONE, control


@njit
def rule(floats, at, setting, ahead, z, fall):
    """(flow [m3/s], regime) of a culvert; arguments as in `kernels.structures`."""
    flow, regime, _ = controlled_flow(floats, at, ahead, z, fall)
    return flow, regime


set = structures.set_structure
flow = culvert_law_flow = specialise(
    structures.flow_template, "culvert_law_flow", RULE=rule, __name__=__name__
)
slopes = culvert_law_slopes = specialise(
    structures.slopes_template, "culvert_law_slopes", FLOW=flow, __name__=__name__
)
chord = culvert_law_chord = specialise(
    structures.chord_template, "culvert_law_chord", FLOW=flow, __name__=__name__
)
line = culvert_law_line = specialise(
    structures.line_template,
    "culvert_law_line",
    FLOW=flow,
    SLOPES=slopes,
    CHORD=chord,
    __name__=__name__,
)
step = culvert_law_step = specialise(
    structures.step_template, "culvert_law_step", FLOW=flow, LINE=line, __name__=__name__
)
lift = culvert_law_lift = specialise(
    structures.lift_template, "culvert_law_lift", SLOPES=slopes, __name__=__name__
)
slope = culvert_law_slope = specialise(
    structures.slope_template, "culvert_law_slope", SLOPES=slopes, __name__=__name__
)
regime_of = culvert_law_regime_of = specialise(
    structures.regime_template, "culvert_law_regime_of", FLOW=flow, __name__=__name__
)


@njit
def value(t, y, out, tables, device, quantity):
    """Regime of a culvert (quantity 0) or its control (1)."""
    if quantity == 0:
        return regime_of(t, y, out, tables, device, quantity)
    k = device["valve"]
    ahead, z, fall = higher_level(tables, out, k, head_drop(tables, out, k)[1])
    return float(
        controlled_flow(tables.floats, tables.valves[k]["data"], ahead, z, max(fall, LINEAR_FALL))[
            2
        ]
    )
