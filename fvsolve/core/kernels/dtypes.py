"""Record types of the tables of a model, and of the arrays that its runs write.

The `tables` of a model are arrays of parameters by name, `tables.nodes[i]["mass"]` in Python and in compiled code.
Compiled code also finds the arrays of a run among them, `tables.armed`. Their types are part of every compiled
signature, so they are fixed here once, and a new model compiles nothing.
"""

import functools
from collections import namedtuple

import numpy as np

# Codes of kinds, for kernels.
# node kinds: given pressure, storage, storage, no storage
FIXED, TANK, CHAMBER, JUNCTION = 0, 1, 2, 3
# storage with pressure known before nodes are solved: its volume changes; vessel of a device
MOVING, VESSEL = 4, 5
PATCH = 6  # patch of a basin, which sets its pressure and receives its flow
FRICTION_NONE, FRICTION_FACTOR, FRICTION_ROUGH, FRICTION_HAZEN = 0, 1, 2, 3
# scheme families; LINEAR: six weights, SHORT: upwind3
UPWIND, LINEAR, MUSCL, WENO5, SHORT = 0, 1, 2, 3, 4
# FLAT: no slope, for scalars in linearisation
MINMOD, VAN_LEER, MONOTONIZED_CENTRAL, FLAT = 0, 1, 2, 3
ALONE, SINGLE, CLUSTER = 0, 1, 2  # how a node without storage is solved
LAW_LINEAR, LAW_LOG, LAW_TABLE, LAW_MIXTURE = 0, 1, 2, 3

# Status codes, returned to Python, which makes the message.
OK, NO_SOLUTION, NOT_CONVERGED, NOT_FINITE, NO_VOLUME, NO_WIDTH, NO_WEIGHT = 0, 1, 2, 3, 4, 5, 6
AMENDED = 7  # no fault: a record function has corrected the accepted state; evaluate it again
ARRIVED = 8  # no fault: record functions must let the jumps arrive that end the step
NO_COOLANT = 9  # too little fluid flows through a junction for the heat of a part
NO_LIQUID = 10  # more is drawn from a junction than its pipes supply past a cavity

i8, f8 = "i8", "f8"


def record(**columns: str) -> np.dtype:
    """Aligned record type with these columns, in this order; a text such as "(3,)f8" gives the shape of a column."""
    return np.dtype(list(columns.items()), align=True)


SETTINGS = record(
    scheme=i8,  # family of the scheme: UPWIND, LINEAR, MUSCL, WENO5 or SHORT
    limiter=i8,  # MINMOD, VAN_LEER, MONOTONIZED_CENTRAL or FLAT, or the code of a limiter of a user
    degree=i8,  # degree of the polynomials next to an end
    # 1: friction of a cell from the waves that enter it, as by the method of characteristics
    from_arriving=i8,
    w0=f8,  # weights of cells i-3 .. i+2 in the value at face i, for forward waves
    w1=f8,  # of cell i-2
    w2=f8,  # of cell i-1
    w3=f8,  # of cell i
    w4=f8,  # of cell i+1
    w5=f8,  # of cell i+2
    # Linear schemes: weights in the difference F[i] - F[i+1], nearest cell first.
    inside="(6,)f8",  # of cells i-3 .. i+2
    # of the datum and five cells, for the three cells at the end where the wave enters
    enter="(3, 6)f8",
    leave="(2, 5)f8",  # of five cells, for the two cells at the end where it leaves
    rho=f8,  # reference density [kg/m3]
    viscosity=f8,  # dynamic [Pa s]
    ambient=f8,  # ambient pressure [Pa]
    start=f8,  # start of the run [s]
    # 1 if a feature reads values that only the solved nodes determine, before rates are computed
    reads_solved=i8,
    gravity=f8,  # [m/s2]
    datum=f8,  # elevation of zero height in energy studies [m]
    swept=i8,  # 1 if a feature changes volumes of nodes
    vapor=f8,  # vapour pressure [Pa]
    unmarked=f8,  # pressure below which a node stands for a flow that a patch does not have [Pa]
    rate=f8,  # greatest constant wave rate, speed / dx [1/s]
    stop_below=i8,  # 1: a pressure below vapour pressure ends the run
    law=i8,  # density law: LAW_LINEAR, LAW_LOG, LAW_TABLE or LAW_MIXTURE
    beta=f8,  # bulk modulus of the fluid [Pa]
    reference=f8,  # pressure at which the density is rho [Pa]
    table=i8,  # offset of the density table in `floats`, its length and pressure step
    table_size=i8,  # number of values of the density table
    table_start=f8,  # first pressure of the density table [Pa]
    table_step=f8,  # step of its pressures [Pa]
    floor=f8,  # mixture: pressure below that of the gas, vapour pressure or 0 [Pa]
    gas=f8,  # gas volume over liquid volume, times pressure to the power gas_power [Pa^gas_power]
    gas_power=f8,  # 1 / (gas exponent)
    tolerance=f8,  # rtol of error control; 0 without it
    arrivals=i8,  # 1 if a feature writes to out[ARRIVES]
    saturation=f8,  # gas pressure at which all gas is dissolved; infinite for no dissolution [Pa]
)

PIPE = record(  # columns read for waves come first, in as few cache lines as possible
    y=i8,  # offset of the forward wave in y; the backward wave follows it
    cell=i8,  # offset of its cells in per-cell arrays
    from_node=i8,  # row of the node at its start
    to_node=i8,  # row of the node at its end
    admittance=f8,  # area / speed [kg/s per Pa]
    end_admittance=f8,  # that at its end nodes: less where a feature couples them at once
    flow=f8,  # mass flow of the profile [kg/s]
    drag=f8,  # balances the pressure gradient of the profile; its friction if steady [kg/s2]
    # law of its friction, FRICTION_NONE, FRICTION_FACTOR, FRICTION_ROUGH or FRICTION_HAZEN
    friction=i8,
    loss=f8,  # dM/dt = -loss |M| M, the part with a fixed factor [1/kg]
    rough=f8,  # dM/dt = -rough f(Re) |M| M  [1/kg]
    cells=i8,  # 0 if a feature computes its waves
    dx=f8,  # length of a cell [m]
    speed=f8,  # wave speed [m/s]
    rate_factor=f8,  # factor on speed / dx for the ends of a short pipe
    area=f8,  # area of its bore [m2]
    diameter=f8,  # of its bore [m]
    roughness=f8,  # relative roughness
    reynolds=f8,  # Reynolds number per mass flow [s/kg]
    noise=f8,  # square of a negligible flow [kg2/s2]
    compliance=f8,  # of the wall, d ln(area) / dp [1/Pa]
    slope=f8,  # rise per length, 0 for a pipe with an elevation profile
    # offset in `profile` of rises above its `from` end at faces and centres [m]; -1: straight
    rise=i8,
    terms=i8,  # number of exponentials of unsteady friction; 0 for none
    term=i8,  # offset in `floats` of pairs: drag per lag of the flow [1/s], rate of the lag [1/s]
    memory=i8,  # offset in y of the lagged flows, a row of cells for each term [kg/s]
    elements=i8,  # number of Kelvin-Voigt elements of the wall; 0 for none
    # offset in `floats` of pairs: loss of both waves per lag of w [1/s], rate of the lag [1/s]
    element=i8,
    strain=i8,  # offset in y of the lagged w = r + l, a row of cells for each element [kg/s]
    face=i8,  # offset in `profile` of mass per length at faces
    flux=i8,  # offset in `profile` of momentum flux at faces
    # offset in `profile` of mass per length at centres; with scalars under the linear law too
    center=i8,
    from_base=f8,  # laws log and table: flow into the node, computed for the profile [kg/s]
    to_base=f8,  # likewise at `to` [kg/s]
    from_mass=f8,  # mass per length at the end, computed for the profile [kg/m]
    to_mass=f8,  # likewise at `to` [kg/m]
    forcing=i8,  # of its first cell among the forcings of stretches, see `LAYOUT`; -1 for none
    # of its fluid at the start, to which `reynolds` belongs; 0 if friction does not follow it [K]
    temperature=f8,
    # first row in the ledger of the heat of its friction; -1 if this does not heat the fluid
    heat=i8,
    # offset in `work` of the Reynolds number per mass flow in each cell, which a feature writes before the powers of
    # pipes are computed; -1: it is `reynolds`
    present=i8,
)

COUPLING = record(  # flow at once between two nodes, in addition to that of restrictions
    from_node=i8,  # row of the node that the flow leaves
    to_node=i8,  # row of the node that it enters
    conductance=f8,  # flow per pressure [kg/s per Pa]
)

NODE = record(
    kind=i8,  # FIXED, TANK, CHAMBER, JUNCTION, MOVING, VESSEL or PATCH
    y=i8,  # offset of the stored mass in y
    schedule=i8,  # pressure [Pa] of a fixed node, mass demand [kg/s] of a junction; -1 for none
    solve=i8,  # ALONE, SINGLE or CLUSTER
    pressure=f8,  # of the profile [Pa]
    elevation=f8,  # above datum [m]
    demand=f8,  # of the profile [kg/s]
    inflow=f8,  # link flows of the profile into it minus demand, rounding set to zero [kg/s]
    admittance=f8,  # sum of area / speed of its pipe ends [kg/s per Pa]
    stiffness=f8,  # chamber and prism: pressure per stored mass [Pa/kg]
    area=f8,  # tank [m2]
    level=f8,  # level of a tank in the profile [m]
    mass=f8,  # mass stored in the profile [kg]
    full=f8,  # stored mass above which a tank spills [kg]
    shape=i8,  # offset of a tank's table in `floats` (levels, areas, volumes); -1 for a prism
    shapes=i8,  # number of rows of that table
    volume=f8,  # volume of a chamber [m3]; of a moving chamber at the start
    row=i8,  # row in its cluster; number of a tank or moving chamber
    # at a node of rigid columns and valves only: offset of the valves in `integers`, else -1
    gates=i8,
    gate_count=i8,  # number of these valves
    columns=i8,  # number of these columns
    head_given=i8,  # laws log and table: 1 if the schedule is a head [m]
    density=f8,  # density in a tank [kg/m3]
    forcing=i8,  # among the forcings of stretches, see `LAYOUT`; -1 for none
)

VALVE = record(
    from_node=i8,  # row of the node at its start
    to_node=i8,  # row of the node at its end
    schedule=i8,  # schedule of its opening [-], or of the setting of its device; -1 for none
    characteristic=i8,  # 0 linear, 1 equal-percentage, else table
    # offset in `floats` of the table of its characteristic: openings, then relative areas
    table=i8,
    table_size=i8,  # number of these openings
    solve=i8,  # SINGLE, CLUSTER, or ALONE between two stored or given pressures
    # 1: in a cluster with quasi-steady pipes; the other links at its junctions limit its rate
    chained=i8,
    # 1: Newton starts from equal potentials at both ends, those of the end outside the cluster
    level_start=i8,
    # 1: nothing else joins a junction at its end, so its flow is given there and has no rate
    flow_given=i8,
    # BOTH_WAYS, or OUTWARD: only to its end `to`, a known pressure; OUTWARD_DEMAND: a demand flows so
    one_way=i8,
    begins=f8,  # drop below which an outward link has no flow [Pa]
    conductance=f8,  # 2 rho (Cd A)^2 at full opening: M |M| = conductance * dp
    # flow below which the law is laminar [kg/s]; 0 if pipes bound the slope of the root
    transition=f8,
    # drop below which the law is laminar at any opening [Pa]: too small for error control
    rounding_drop=f8,
    hooks=i8,  # row of `hooks`, the functions of its own law; -1 for the square-root law
    device=i8,  # device that sets its conductance; -1: its schedule sets it
    data=i8,  # offset of the numbers of its law in `floats`
    event=i8,  # offset of its flags in `armed`, for a law with kinks
    # offset in `integers` of what it may hold, see `node_clusters.hold_pressures`; -1 for nothing
    hold=i8,
    # schedule of the position of a spool, from which its own schedule follows; -1 for none
    command=i8,
    back=f8,  # square-root law: fraction of the conductance for flow from `to` to `from`
    drive=f8,  # relative speed of a pump in the profile
    open=f8,  # conductance of the profile; 0 if the flow does not obey its law
    flow=f8,  # of the profile [kg/s]
    drop=f8,  # of the profile [Pa]
)
BOTH_WAYS, OUTWARD, OUTWARD_DEMAND = range(3)
# held by a valve: pressure at its end `to`, or at `from`, or its flow
TO_HELD, FROM_HELD, FLOW_HELD = range(3)
NOT_HELD = 1e300  # in out[drive] of such a valve: it holds nothing at present

COLUMN = record(
    y=i8,  # offset in y of its mass flow, as deviation from `flow` [kg/s]
    from_node=i8,  # row of the node at its start
    to_node=i8,  # row of the node at its end
    area=f8,  # area of its bore [m2]
    length=f8,  # [m]
    friction=i8,  # law of its friction, as in PIPE
    loss=f8,  # dM/dt = -loss |M| M, the part with a fixed factor [1/kg]
    rough=f8,  # dM/dt = -rough f(Re) |M| M [1/kg]
    roughness=f8,  # relative roughness, below 0 for swamee-jain
    reynolds=f8,  # Reynolds number per mass flow [s/kg]
    flow=f8,  # mass flow of the profile [kg/s]
    drag=f8,  # friction term of the profile [kg/s2]
    offset=f8,  # driving pressure of the profile not balanced by friction [Pa]
    base=f8,  # laws log and table: driving pressure of the profile [Pa]
    forcing=i8,  # of its first stretch among the forcings of stretches, see `LAYOUT`; -1 for none
    forcings=i8,  # number of these stretches
)

DEVICE = record(
    hooks=i8,  # row of `hooks`, the functions of its law
    mode=i8,  # kind of device within its law, if several kinds share a law
    y=i8,  # offset in y of its states; -1 for none
    states=i8,  # number of its states
    valve=i8,  # restriction that it opens and closes, the first of several; -1 for none
    node=i8,  # vessel whose pressure it computes, or sensed node; -1 for none
    second=i8,  # second sensed node; -1 for none
    # weights of the pressures at both sensed nodes in the pressure that lifts its valve
    node_weight=f8,
    second_weight=f8,  # weight of the pressure at `second`
    event=i8,  # its first event function
    data=i8,  # offset of its numbers in `floats`
    schedule=i8,  # -1 for none
    row=i8,  # number of the vessel that it fills, among nodes of variable stiffness; -1 for none
    travel=i8,  # offset in y of a position and its velocity that it reads; -1 for none
    opens_by_event=i8,  # 1 if only events open it
    # offset in `armed` of the flag that it controls its rigid column; -1 if it never does
    controls_column=i8,
)

SCHEDULE = record(
    first=i8,  # its first row in `pieces`
    # number of its pieces; 0 for a schedule that follows a block of `controls`, -1 for a formula
    pieces=i8,
)
# Piece: start, kind (0 polynomial in t - origin, 1 power, 2 wave, 3 wave cut off below zero), origin, then
# a, b, c, d or v0, v1, duration, exponent or mean, amplitude, frequency [1/s], phase.
# Of a schedule that follows a block: start, kind (4 scale u + offset, 5 its positive part), number of the block, then
# scale, offset, output u of the block at the start
PIECE_COLUMNS = 7


CLUSTER_RECORD = record(
    first_node=i8,  # offset in `integers` of the rows of its nodes
    nodes=i8,  # number of its nodes
    first_valve=i8,  # offset in `integers` of the rows of its valves
    valves=i8,  # number of its valves
    first_couple=i8,  # offset in `integers` of the rows of its couplings
    couples=i8,  # number of its couplings
    # offset in `floats` of the inverse of its admittances, if no valve joins it; else -1
    inverse=i8,
    # offset in `integers` of the places and the elimination of its sparse matrix; -1: a full matrix
    order=i8,
    matrix=i8,  # numbers of its matrix: those of the sparse matrix, or of a full one
    senses=i8,  # 1 if a device senses pressures for one of its valves
    held=i8,  # numbers of the balances of nodes whose pressures its valves may hold
)

LAYOUT = record(
    pressure=i8,  # offsets in `out`
    supply=i8,  # flow into each node from outside, an entry of the ledger [kg/s]
    net=i8,  # net mass flow into each node [kg/s]
    # four waves of each pipe: into and out of it at `from`, out of and into it at `to` [kg/s]
    ends=i8,
    valve=i8,  # mass flow of each restriction [kg/s]
    column=i8,  # mass flow of each rigid column [kg/s]
    # of columns: 1 or -1 if valves control it at its `to` or `from` end, else 0
    valve_controlled=i8,
    stiffness=i8,  # of moving chambers: pressure per mass [Pa/kg]
    outflow_fraction=i8,  # of nodes that cells fill: fraction of the requested outflow for which there is water
    swept=i8,  # mass flow out of moving chambers by piston and leak [kg/s]
    net_force=i8,  # on what moves along a line [N]
    push=i8,  # forces of the elements between [N]
    conductance=i8,  # present conductances of valves, 0 if closed [kg2/s2/Pa]
    drive=i8,  # present relative speeds of pumps, an entry for each valve
    # rows of the ledger behind `supply`
    gain=i8,  # after `supply` in the ledger: inflow of each scalar through nodes [kg/s]
    loss=i8,  # then the negative decay of each scalar [kg/s]
    # then heat over specific heat: of restrictions, of friction in pipes, of heat exchangers [kg K/s]
    heat=i8,
    extent=i8,  # then the rates of reactions, times the mass that reacts [kg mol/m3/s]
    source=i8,  # then mass flows that do not pass nodes, see `Feature.sources` [kg/s]
    quickest=i8,  # greatest rate of change by reactions [1/s], an entry if there are reactions
    # what flows carry, at nodes and ends of pipes
    value=i8,  # of each scalar at all nodes
    edge=i8,  # values of scalars in pipes at both ends
    carried=i8,  # flow of scalars along pipes through both ends [kg/s]
    scalar_inflow=i8,  # flow of scalars from links into nodes [kg/s]
    # of each heat exchanger: value of the scalar at the thermal node, heat out of the fluid [W]
    exchange=i8,
    # forcing of stretches of fluid: change since the start of the work that a feature does [J/kg]
    forcing=i8,
    rates=i8,  # in `work`: rates, if `out` depends on them and they are not requested; else -1
    forces=i8,  # in `work`: rates from which forces on pipes are computed; else -1
    # frames that move, fluid on them, and the elements between
    tank=i8,  # inertia of fluid with a mesh on frames, see `kernels.moving_frames`
    wall=i8,  # outward force of the fluid on boundaries that move, minus that of the profile [N]
    travel=i8,  # of force elements: change of length since the start and its rate [m, m/s]
    along=i8,  # unit vectors of lines, between their points
    pin=i8,  # forces of constraints, three for each [N]
    body=i8,  # data of frames that move, see `kernels.moving_frames`
    isolated=i8,  # codes of nodes, see `isolated_nodes`
    shaft=i8,  # speeds of shafts that laws of devices read before the nodes are solved [rad/s]
    size=i8,  # size of `out`
    device_mark=i8,  # offset in `marks` of those of devices
    # number of rows of `power` that features fill, between those of networks and of devices
    feature_power=i8,
    feature_stored=i8,  # likewise of `stored`
    # number of rows of `power` that features fill behind those of devices
    last_power=i8,
    last_stored=i8,  # likewise of `stored`
)
BODY_OUT = 45  # numbers of each body in `out`
TANK_OUT = 24  # numbers in `out` of each basin on a body, see `kernels.moving_frames`
RATE, STATUS, WHERE, CLOSING, ARRIVES, LONGEST = 0, 1, 2, 3, 4, 5  # first entries of `out`
# Least slope [m2/s] of laws between levels in Newton's method; 0: it follows the flow. FIRM_SLOPE is that of limited
# steps, of the steady start, and of the density laws other than `linear`.
FIRM, FIRM_SLOPE = 6, 1e-9
# 1 in NEARBY before a call at a state that differs from the last accepted one by an increment of a difference quotient.
NEARBY = 7
# Time up to which output rows show the present state, although a jump arrives now [s]; NEVER without such a jump.
LAST_ROW = 8
OUT_HEAD = 9
# RATE before a call if the rate that limits the step is not needed, which holds at all stages of a step but the first.
# Functions that spend time on this rate leave the value; others raise it as always.
RATE_UNWANTED = -1.0
NEVER = -1e300  # in ARRIVES: no jump travels to a node that responds instantly

PROBE = record(
    kind=i8,  # a code of the probe kinds below
    index=i8,  # of the node, pipe, valve, column, mass, push, piston or basin
    # -1 and 1: ends of the pipe; 0: inside; CELL_FIELD: number of the field in its physics
    side=i8,
    cell=i8,  # first cell that is read; for a basin offset of the cell numbers in `integers`
    count=i8,  # number of these cells; of the edges of a spool valve
    weights=i8,  # offset of their weights in `floats`
    scale=f8,  # value of the probe = scale times the value read + offset
    offset=f8,  # in the unit of the probe, SI
    head=i8,  # laws log and table: 1 a head, 2 a velocity
    mass=f8,  # laws log and table: mass per length of the profile there [kg/m]
    scalar=i8,  # number of the scalar of a probe of a scalar
    mark=i8,  # pipe to be marked when this pressure is below vapour pressure; -1: none
)
# probe kinds
PRESSURE, LEVEL, PIPE_PRESSURE, PIPE_FLOW, VALVE_FLOW, COLUMN_FLOW, SPOOL_FLOW = 0, 1, 2, 3, 4, 5, 6
POSITION, VELOCITY, FORCE, PISTON_POSITION, PISTON_VELOCITY, DEVICE_VALUE = 7, 8, 9, 10, 11, 12
NODE_SCALAR, PIPE_SCALAR = 13, 14
CELL_FIELD, PATCH_FLOW, CELL_SCALAR = 15, 16, 17  # probes of parts with a mesh
GIVEN_FLOW = 18  # of a patch with given velocity
WALL_VALUE = 19  # of a moving wall
BODY_VALUE, POINT_VALUE, PIN_VALUE, BUSHING_VALUE = (
    20,
    21,
    22,
    23,
)  # quantity in `side`, see `features.motion.kernels.body_values`
SURFACE_VALUE = 24  # of a surface described by modes
PIPE_FORCE = 25  # on a whole pipe
SCHEDULE_VALUE = 28  # of schedule `index`
# of a reaction, by the code in `side`: molar flow, power, mean affinity over all places; affinity at a place, whose
# scalar probe has the kind in `head` and the index in `scalar`
REACTION_VALUE, LOCAL_AFFINITY = 29, 30
FEATURE_VALUE = 100  # plus the slot of a feature: its probes
# between nodes `index` and `cell`; floats[weights:] : fraction of the way, elevation there [m], and pressure because
# this place lies below the line between the nodes [Pa]
PRESSURE_BETWEEN = 31
PATCH_FROUDE = 32  # Froude number of the flow through driven patch `index`
SECTION_FLOW = 33  # through a section of basin `index`, by `count` marked faces

CLOCK = record(
    limit=f8,  # end of the segment: schedules take their left limit from here on [s]
    step=f8,  # fixed step; 0 for adaptive steps [s]
)

RECORDS = {
    "settings": SETTINGS,
    "layout": LAYOUT,
    "pipes": PIPE,
    "nodes": NODE,
    "valves": VALVE,
    "columns": COLUMN,
    "clusters": CLUSTER_RECORD,
    "schedules": SCHEDULE,
    "probes": PROBE,
    "devices": DEVICE,
    "couplings": COUPLING,
}
# `Tables`: of a model, read-only; `RunArrays`: written by a run; `HandleTables`: behind a handle, also addresses of
# functions: `calls`, a row for each job, and `hooks`, a row for each law of devices.
Tables = namedtuple(
    "Tables",
    (
        *RECORDS,
        "integers",  # rows of other tables, and other numbers, at the offsets that rows state
        "floats",  # numbers of laws, and tables of values, at the offsets that rows state
        "profile",  # numbers of cells and faces of pipes in the steady start
        "plane",  # numbers of cells and faces of basins
        "pieces",  # pieces of schedules, see PIECE_COLUMNS, and rows of formulas
    ),
)
RunArrays = namedtuple(
    "RunArrays",
    (
        "clock",  # end of the segment and the given step, see CLOCK
        "work",  # work array of features, at offsets that they reserve
        "armed",  # flag of each event: 1 while its condition holds
        "marks",  # first times at which the model does not hold [s]; nan until then
        "scratch",  # work array of the function that runs
        "spare",  # second array like `out`
        "seen",  # values that all functions but rates read in place of y, where the two differ; else empty
        "bands",  # for each mesh the first row, or cell, that this thread computes, and the one after its last
        "joint",  # exchange between threads, see `kernels.band_exchange`; empty for one thread
        "sums",  # sums of the stages of a step, see `kernels.stage_sums`
        "envelope",  # for each cell of pipes: least sum of both waves [kg/s], its time [s], greatest, its time
        "extremes",  # for each probe: least value, its time [s], greatest value, its time
        "applied",  # outputs of blocks after their limits
        "stack",  # values of a formula while it is computed
        "maxima",  # greatest values of cells of basins
        "accepted",  # pressures and flows of accepted states, from which iterations at nodes start
        "features",  # addresses of the tables of features
        "memory",  # addresses of arrays of features that may grow
    ),
)
HandleTables = namedtuple("HandleTables", (*Tables._fields, *RunArrays._fields, "calls", "hooks"))
# float64[:, :]; all others that are not records are float64[:]
MATRICES = ("pieces", "envelope", "extremes")
INTEGERS = (
    "integers",
    "bands",
    "joint",
    "sums",
    "features",
    "memory",
    "calls",
    "hooks",
)  # these are int64


@functools.cache
def table_types() -> HandleTables:
    """Numba types of all tables of a handle, by name of the table."""
    from numba import from_dtype, types

    def of(name):
        record = {**RECORDS, "clock": CLOCK}.get(name)
        values = (
            from_dtype(record) if record else types.int64 if name in INTEGERS else types.float64
        )
        return types.Array(values, 2 if name in (*MATRICES, "calls", "hooks") else 1, "C")

    return HandleTables(*map(of, HandleTables._fields))
