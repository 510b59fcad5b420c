"""The one fixed record type of each table of a model, and of what its runs write. Knows layouts; knows no laws.

A model's `tables` are these arrays by name, `tables.nodes[i]["mass"]` in Python as in compiled code, which finds beside
them what the run writes, `tables.armed`. Their types are part of every compiled signature, so they are fixed here once
and a new scene compiles nothing.
"""

import functools
from collections import namedtuple

import numpy as np

# Codes of kinds, as the kernels see them.
FIXED, TANK, CHAMBER, JUNCTION = 0, 1, 2, 3  # node kinds: a given pressure, storage, storage, none
MOVING, VESSEL = 4, 5  # stores whose pressure is there before nodes are closed: of a piston, of a device
PATCH = 6  # of a basin, which sets its pressure and takes its flow
FRICTION_NONE, FRICTION_FACTOR, FRICTION_ROUGH, FRICTION_HAZEN = 0, 1, 2, 3
UPWIND, LINEAR, MUSCL, WENO5, SHORT = (
    0,
    1,
    2,
    3,
    4,
)  # scheme families; LINEAR ones are six weights, SHORT upwind3
MINMOD, VAN_LEER, MONOTONIZED_CENTRAL, FLAT = 0, 1, 2, 3  # FLAT: no slope, of scalars that are linearised
ALONE, SINGLE, CLUSTER = 0, 1, 2  # how a node without storage is solved
LAW_LINEAR, LAW_LOG, LAW_TABLE, LAW_MIXTURE = 0, 1, 2, 3

# Status codes that travel up; the message is made in Python.
OK, NO_SOLUTION, NOT_CONVERGED, NOT_FINITE, NO_VOLUME, NO_ROOM, NO_WEIGHT = 0, 1, 2, 3, 4, 5, 6
AMENDED = 7  # no fault: what notes an accepted state has put it right, and it is to be looked at again
ARRIVED = 8  # no fault: what notes an accepted state is to let jumps arrive that end the step

SETTINGS = np.dtype(
    [
        ("scheme", "i8"),
        ("limiter", "i8"),
        ("degree", "i8"),  # of the polynomials next to an end
        ("w0", "f8"),  # weights of cells i-3 .. i+2 in the value at face i, for waves that run forward
        ("w1", "f8"),
        ("w2", "f8"),
        ("w3", "f8"),
        ("w4", "f8"),
        ("w5", "f8"),
        (
            "inside",
            "f8",
            (6,),
        ),  # linear schemes: weights of cells i-3 .. i+2 in the difference F[i] - F[i+1], and
        (
            "enter",
            "f8",
            (3, 6),
        ),  # of the datum and five cells in the three cells next to where a wave enters,
        ("leave", "f8", (2, 5)),  # of five cells in the two next to where it leaves; nearest first
        ("rho", "f8"),  # reference density [kg/m3]
        ("viscosity", "f8"),  # dynamic [Pa s]
        ("ambient", "f8"),  # ambient pressure [Pa]
        ("gravity", "f8"),
        ("datum", "f8"),  # elevation from which energy studies count heights [m]
        ("vapor", "f8"),  # vapour pressure [Pa]
        ("rate", "f8"),  # greatest wave rate that does not change, speed / dx [1/s]
        ("stop_below", "i8"),  # 1: a pressure below vapour pressure ends the run
        ("law", "i8"),
        ("beta", "f8"),  # bulk modulus of the fluid [Pa]
        ("reference", "f8"),  # pressure at which rho holds [Pa]
        ("table", "i8"),  # offset of the density table in `floats`, its length and pressure step
        ("table_size", "i8"),
        ("table_start", "f8"),
        ("table_step", "f8"),
        ("floor", "f8"),  # mixture: what the pressure of the gas adds to, vapour pressure or 0 [Pa]
        ("gas", "f8"),  # its volume over the liquid's, times pressure to the power below [Pa^gas_power]
        ("gas_power", "f8"),  # 1 / (gas exponent)
        ("weights", "i8"),  # offset in `floats` of the method's b, its c follow, and how many these are
        ("stages", "i8"),
        ("jumps", "f8"),  # share of the greatest wave from which on a jump in a delay line is kept as one
        ("saturation", "f8"),  # gas pressure at which all of it is dissolved; infinite for none [Pa]
    ],
    align=True,
)

PIPE = np.dtype(  # what delay lines read comes first, in as few cache lines as it takes
    [
        ("y", "i8"),  # offset of the forward wave in y; the backward wave follows it
        ("cell", "i8"),  # offset of its cells in per-cell arrays
        ("from_node", "i8"),
        ("to_node", "i8"),
        ("admittance", "f8"),  # area / speed [kg/s per Pa]
        ("flow", "f8"),  # mass flow of the profile [kg/s]
        ("drag", "f8"),  # what holds the profile's pressure gradient, its friction where that is steady [kg/s2]
        ("friction", "i8"),
        ("loss", "f8"),  # dM/dt = -loss |M| M, the part with a fixed factor [1/kg]
        ("rough", "f8"),  # dM/dt = -rough f(Re) |M| M  [1/kg]
        ("cells", "i8"),
        ("dx", "f8"),
        ("speed", "f8"),  # wave speed [m/s]
        ("quicker", "f8"),  # factor on speed / dx that the ends of a short pipe ask for
        ("area", "f8"),
        ("diameter", "f8"),
        ("roughness", "f8"),  # relative roughness
        ("reynolds", "f8"),  # Reynolds number per mass flow [s/kg]
        ("noise", "f8"),  # a flow too small to mean anything, squared [kg2/s2]
        ("compliance", "f8"),  # of the wall, d ln(area) / dp [1/Pa]
        ("slope", "f8"),  # rise per length, 0 of one with a profile
        ("rise", "i8"),  # offset in `profile` of its rise from its `from` end at faces and centres [m]; -1: straight
        ("terms", "i8"),  # exponentials of its unsteady friction; 0 for none
        ("term", "i8"),  # offset in `floats` of pairs: drag per flow that is yet to follow [1/s], rate of following
        ("memory", "i8"),  # offset in y of the flows that follow, a row of cells for each term [kg/s]
        ("elements", "i8"),  # Kelvin-Voigt elements of its wall; 0 for none
        (
            "element",
            "i8",
        ),  # offset in `floats` of pairs: what both waves lose per w yet to follow, rate [1/s]
        ("strain", "i8"),  # offset in y of what follows w, the sum of both waves, a row of cells an element [kg/s]
        (
            "face",
            "i8",
        ),  # offsets in `profile`: mass per length at faces, momentum flux there, mass at centres
        ("flux", "i8"),
        ("center", "i8"),  # the last with scalars under the linear law too
        ("from_base", "f8"),  # laws log and table: flow into the node that the profile computes to
        ("to_base", "f8"),
        ("from_mass", "f8"),  # and the mass per length at the end that it computes to [kg/m]
        ("to_mass", "f8"),
        ("ride", "i8"),  # of its first cell in `rides`; -1 where it stands still
        ("delay", "i8"),  # of `delays`, where it has no cells; else -1
    ],
    align=True,
)

DELAY = np.dtype(  # a pipe as a delay line: stretches of equal travel time, friction in the middle of each
    [
        ("pipe", "i8"),
        ("stretch", "i8"),  # its first
        ("stretches", "i8"),
        ("tau", "f8"),  # travel time of a stretch [s]
        ("hold", "f8"),  # what is read was sent so long ago: tau, or of a shorter one the longest step [s]
        ("now", "f8"),  # share of a shorter one that arrives at once, 1 - tau / hold; 0 of others
        ("ring", "i8"),  # entries of its past before its own, and how many of each stretch, see `kernels.delay.history`
        ("room", "i8"),
        ("passes", "f8"),  # share of a small change of flow that friction in the middle of a stretch lets pass
        ("places", "i8"),  # at which fields and envelopes are told
        ("couple", "f8"),  # of a shorter one, flow between its ends per pressure [kg/s per Pa]
        ("acts", "i8"),  # ends whose nodes act at once: 1 `from`, 2 `to`, 3 both
    ],
    align=True,
)

NODE = np.dtype(
    [
        ("kind", "i8"),
        ("y", "i8"),  # offset of the stored mass in y
        ("schedule", "i8"),  # pressure [Pa] of a fixed node, mass demand [kg/s] of a junction; -1 for none
        ("solve", "i8"),  # ALONE, SINGLE or CLUSTER
        ("pressure", "f8"),  # of the profile [Pa]
        ("elevation", "f8"),
        ("demand", "f8"),  # of the profile [kg/s]
        ("inflow", "f8"),  # sum of the profile's link flows into it less demand, snapped to zero [kg/s]
        ("admittance", "f8"),  # sum over its pipe ends [kg/s per Pa]
        ("stiffness", "f8"),  # chamber and prism: pressure per stored mass [Pa/kg]
        ("area", "f8"),  # tank [m2]
        ("level", "f8"),  # tank, of the profile [m]
        ("mass", "f8"),  # stored in the profile [kg]
        ("full", "f8"),  # stored mass above which a tank spills [kg]
        (
            "shape",
            "i8",
        ),  # offset of a shaped tank's table in `floats` (levels, areas, volumes); -1 for a prism
        ("shapes", "i8"),  # rows of that table
        ("volume", "f8"),  # chamber [m3]; of a moving one, at the start
        ("row", "i8"),  # row in its cluster; of a tank or moving chamber, its number
        ("gates", "i8"),  # where rigid columns and valves alone meet: offset of the valves in `integers`, else -1
        ("gate_count", "i8"),
        ("columns", "i8"),  # how many columns these are
        ("head_given", "i8"),  # laws log and table: the schedule is a head [m]
        ("density", "f8"),  # of what a tank holds [kg/m3]
        ("ride", "i8"),  # in `rides`; -1 where it stands still
        ("lines", "i8"),  # offset in `integers` of ends of delay lines that touch it, twice the line plus side
        ("line_count", "i8"),
    ],
    align=True,
)

VALVE = np.dtype(
    [
        ("from_node", "i8"),
        ("to_node", "i8"),
        ("schedule", "i8"),
        ("characteristic", "i8"),  # 0 linear, 1 equal-percentage, else table
        ("table", "i8"),
        ("table_size", "i8"),
        ("solve", "i8"),  # SINGLE, CLUSTER, or ALONE between two stored or given pressures
        ("conductance", "f8"),  # 2 rho (Cd A)^2 at full opening: M |M| = conductance * dp
        ("transition", "f8"),  # flow below which the law is laminar [kg/s]; 0 where pipes soften the root
        ("unseen", "f8"),  # drop below which it is so at any opening [Pa]: error control sees none as small
        ("hooks", "i8"),  # row of `hooks`: the functions of its own law; -1 for the root
        ("device", "i8"),  # which device sets its conductance; -1: its schedule does
        ("data", "i8"),  # offset of a law's own numbers in `floats`
        ("event", "i8"),  # place of its own flags in `armed`, of a law with bends
        ("back", "f8"),  # of a root: share of the conductance that holds for flow from `to` to `from`
        ("drive", "f8"),  # of a pump: relative speed of the profile
        ("open", "f8"),  # conductance of the profile; 0 where its flow does not obey it
        ("flow", "f8"),  # of the profile [kg/s]
        ("drop", "f8"),  # of the profile [Pa]
    ],
    align=True,
)

COLUMN = np.dtype(
    [
        ("y", "i8"),
        ("from_node", "i8"),
        ("to_node", "i8"),
        ("area", "f8"),
        ("length", "f8"),
        ("friction", "i8"),
        ("loss", "f8"),
        ("rough", "f8"),
        ("roughness", "f8"),
        ("reynolds", "f8"),
        ("flow", "f8"),
        ("drag", "f8"),
        ("offset", "f8"),  # driving pressure of the profile that friction does not balance [Pa]
        ("base", "f8"),  # laws log and table: driving pressure of the profile [Pa]
        ("ride", "i8"),  # of its first stretch in `rides`; -1 where it stands still
        ("rides", "i8"),  # how many these are
    ],
    align=True,
)

BODY = np.dtype(  # axes of its own, its origin at its joint
    [
        ("parent", "i8"),  # row of the body that it is joined to, a lesser one; -1 for the world
        ("root", "i8"),  # row of the first body of its tree
        ("joint", "i8"),  # REVOLUTE ...
        ("y", "i8"),  # offsets of its coordinates and of its velocities, both as deviations; -1 for none
        ("rate", "i8"),
        ("freedom", "i8"),  # first of its rows of `freedoms`
        ("freedoms", "i8"),  # how many it has
        ("schedule", "i8"),  # of a driven joint, its angle [rad] or travel [m]; -1 for none
        ("at", "f8", (3,)),  # place of the joint in the parent's axes [m]
        ("attitude", "f8", (9,)),  # of the joint's axes in the parent's, by rows
        ("axis", "f8", (3,)),  # in the joint's axes and its own
        ("mass", "f8"),
        ("centre", "f8", (3,)),  # of mass [m]
        ("inertia", "f8", (9,)),  # about it [kg m2]
        ("damping", "f8"),  # of its joint [N m s] or [N s/m]
        ("stiffness", "f8"),  # and [N m/rad] or [N/m]
        ("start", "f8", (7,)),  # coordinates at the start
        ("speed", "f8", (6,)),  # velocities at the start
        ("height", "f8"),  # of its centre of mass at the start [m], and
        ("energy", "f8"),  # its kinetic energy [J]
    ],
    align=True,
)
REVOLUTE, PRISMATIC, BALL, FREE, WELD = 0, 1, 2, 3, 4  # joints

FREEDOM = np.dtype(
    [
        ("depth", "i8"),  # how many freedoms its own hangs on
        ("path", "i8"),  # offset in `integers` of these, from the root on, and of itself
        ("row", "i8"),  # offset of its row of the mass matrix, of those on its path
        ("balance", "f8"),  # force of the start that is rounding [N] or [N m]
    ],
    align=True,
)

POINT = np.dtype([("body", "i8"), ("place", "f8", (3,))], align=True)  # body -1: the world; in axes of the body

LINE = np.dtype(  # a push on points of bodies
    [
        ("push", "i8"),
        ("from_point", "i8"),  # -1 for none
        ("to_point", "i8"),
        ("acts", "i8"),  # ALONG the line between both, TOWARD a direction of the world, ABOUT an axis of `to`
        ("direction", "f8", (3,)),
        ("length", "f8"),  # at the start [m]
    ],
    align=True,
)
ALONG, TOWARD, ABOUT = 0, 1, 2

PIN = np.dtype(
    [
        ("from_point", "i8"),
        ("to_point", "i8"),
        ("rows", "i8"),  # in how many directions it holds
        ("directions", "f8", (9,)),  # in axes of the body of `from`
        ("pull", "f8"),  # [1/s]
        ("gap", "f8", (3,)),  # along each at the start [m], and
        ("force", "f8", (3,)),  # its force there [N]
    ],
    align=True,
)

BUSHING = np.dtype(
    [
        ("from_point", "i8"),
        ("to_point", "i8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("turn_stiffness", "f8"),
        ("turn_damping", "f8"),
        ("attitude", "f8", (9,)),  # of the body of `to` in axes of that of `from` at the start
        ("energy", "f8"),  # stored at the start [J]
    ],
    align=True,
)

RIDE = np.dtype(  # a stretch of a pipe, a column or what a place holds, on a body and in its axes
    [
        ("body", "i8"),
        ("start", "f8", (3,)),  # where it begins [m]; of a place, that
        ("end", "f8", (3,)),  # where it ends; of a tank, what is above a bottom is along z
        ("swept", "f8", (3,)),  # integral of r x dr along it [m2]
        ("rest", "f8"),  # what gravity does along it at the start [J/kg]
        ("heavy", "i8"),  # 1 where that body feels it: forces move it; 2 where someone asks what its joint holds
    ],
    align=True,
)

MASS = np.dtype(
    [
        ("y", "i8"),  # offset of its position, velocity follows; both as deviations; -1 for a frame
        ("lightness", "f8"),  # 1 / mass, 0 for a frame [1/kg]
        ("position", "f8"),  # at the start [m]
        ("velocity", "f8"),  # at the start [m/s]
        ("force", "f8"),  # sum of all at the start, snapped to zero [N]
    ],
    align=True,
)

BRACE = np.dtype(  # springs, dampers and forces: push = force + (schedule - given) - stiffness dx - damping (v - speed)
    [
        ("from_mass", "i8"),
        ("to_mass", "i8"),
        ("schedule", "i8"),  # -1 for none
        ("given", "f8"),  # value of the schedule at the start [N]
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("speed", "f8"),  # v_to - v_from at the start [m/s]
        ("force", "f8"),  # push at the start [N]
        ("line", "i8"),  # its row of `lines` where it joins points of bodies; -1 on the axis of masses
    ],
    align=True,
)

STOP = np.dtype(
    [
        ("from_mass", "i8"),
        ("to_mass", "i8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("below", "f8"),  # room at the start before it pushes forward, infinite for none [m]
        ("above", "f8"),  # and before it holds back
        ("force", "f8"),
        ("line", "i8"),  # its row of `lines` where it joins points of bodies; -1 on the axis of masses
    ],
    align=True,
)

PISTON = np.dtype(
    [
        ("case", "i8"),  # masses
        ("rod", "i8"),
        ("a", "i8"),  # nodes
        ("b", "i8"),
        ("area_a", "f8"),
        ("area_b", "f8"),
        ("sweep_a", "f8"),  # mass in A per travel at the density of the start, its change is no excess [kg/m]
        ("sweep_b", "f8"),  # likewise in B, negative
        ("position", "f8"),  # x at the start [m]
        ("stroke", "f8"),
        ("leakage", "f8"),  # [m3/s/Pa]
        ("leak", "f8"),  # mass flow from A to B in the profile [kg/s]
        ("damping", "f8"),
        ("speed", "f8"),
        ("force", "f8"),
        ("line", "i8"),  # its row of `lines` where it joins points of bodies; -1 on the axis of masses
    ],
    align=True,
)

DEVICE = np.dtype(
    [
        ("hooks", "i8"),  # row of `hooks`: the functions of its law
        ("mode", "i8"),  # what its law knows it as, of several kinds that share one
        ("y", "i8"),  # offset of its own states; -1 for none
        ("states", "i8"),
        ("valve", "i8"),  # the restriction that it opens and shuts; -1 for none
        ("node", "i8"),  # the vessel whose pressure it computes, or the place that it senses; -1 for none
        ("event", "i8"),  # its first event function
        ("data", "i8"),  # offset of its numbers in `floats`
        ("schedule", "i8"),  # -1 for none
        ("row", "i8"),  # of the vessel that it fills: its number among all whose stiffness changes; -1 for none
        ("sudden", "i8"),  # 1 where events alone open it
        ("leads", "i8"),  # flag in `armed` that it leads the rigid column which it alone holds; -1 where it never does
    ],
    align=True,
)

SCHEDULE = np.dtype([("first", "i8"), ("pieces", "i8")], align=True)
# Piece: start, kind (0 polynomial in t - origin, 1 power, 2 wave, 3 what of a wave is above zero), origin, then
# a, b, c, d or v0, v1, duration, exponent or mean, amplitude, frequency [1/s], phase
PIECE_COLUMNS = 7

CLUSTER_RECORD = np.dtype(
    [
        ("first_node", "i8"),
        ("nodes", "i8"),
        ("first_valve", "i8"),
        ("valves", "i8"),
        ("first_couple", "i8"),
        ("couples", "i8"),
        ("inverse", "i8"),
    ],
    align=True,
)

LAYOUT = np.dtype(
    [
        ("pressure", "i8"),  # offsets in `out`
        ("supply", "i8"),
        ("net", "i8"),
        ("ends", "i8"),
        ("valve", "i8"),
        ("column", "i8"),
        ("led", "i8"),  # of columns, 1 or -1 where valves lead it at its `to` or `from` end
        ("stiffness", "i8"),  # of moving chambers, pressure per mass [Pa/kg]
        ("had", "i8"),  # of patches, share of the outflow asked for that there is water for
        ("swept", "i8"),  # mass flow that the piston and its leak take from moving chambers [kg/s]
        ("net_force", "i8"),  # on masses [N]
        ("push", "i8"),  # of braces, then of stops, then of pistons [N]
        ("conductance", "i8"),  # of valves now, 0 where they are shut [kg2/s2/Pa]
        ("drive", "i8"),  # relative speeds of pumps now, one a valve
        ("gain", "i8"),  # behind `supply` in the ledger: amounts of each scalar that enter by nodes [kg/s]
        ("loss", "i8"),  # and, negative, what decays of it
        ("value", "i8"),  # of each scalar at all nodes
        ("edge", "i8"),  # values that the water of pipes has at both ends
        ("carried", "i8"),  # amounts through both ends of pipes, along them [kg/s]
        ("brought", "i8"),  # amounts that links bring into nodes [kg/s]
        ("ride", "i8"),  # what drives stretches on bodies since the start [J/kg]
        ("rates", "i8"),  # in `work`: room for rates where `out` alone is asked for and hangs on them; else -1
        ("forces", "i8"),  # in `work`: room for the rates that forces on pipes are read off; else -1
        ("tank", "i8"),  # of basins that ride on bodies, what their mass is along their normal
        ("wall", "i8"),  # force of the water on walls that move, outward, less that of the profile [N]
        ("travel", "i8"),  # of pushes, change of length since the start and its rate, of each [m, m/s]
        ("along", "i8"),  # of lines, from the one point to the other, of length 1
        ("pin", "i8"),  # forces of pins, three each [N]
        ("body", "i8"),  # of bodies, as `kernels.mechanism.room` says
        ("size", "i8"),
    ],
    align=True,
)
BODY_OUT = 45  # numbers of each body in `out`
GN = 14  # place of g_n among the numbers of a frame, see `basins.frames`
TANK_OUT = 24  # numbers in `out` of what rides on bodies, see `mechanism.tanks`
RATE, STATUS, WHERE, CLOSING, ARRIVES = 0, 1, 2, 3, 4  # first entries of `out`
OUT_HEAD = 5
NEVER = -1e300  # in ARRIVES: no jump is on its way to where something acts at once
FELT, ASKED = 1, 2  # how heavy a stretch is: its body feels it; and someone asks what joints hold

PROBE = np.dtype(
    [
        ("kind", "i8"),
        ("index", "i8"),  # of the node, pipe, valve, column, mass, push, piston or basin
        ("side", "i8"),  # -1 and 1: the pipe's ends; 0: inside; CELL_FIELD: which, as its physics numbers them
        ("cell", "i8"),  # first of the cells that are read; of a basin, offset of their numbers in `integers`
        ("count", "i8"),  # how many
        ("weights", "i8"),  # offset of their weights in `floats`
        ("scale", "f8"),
        ("offset", "f8"),
        ("head", "i8"),  # laws log and table: 1 a head, 2 a velocity
        ("mass", "f8"),  # laws log and table: mass per length of the profile there [kg/m]
        ("scalar", "i8"),
        ("mark", "i8"),  # the pipe that boils where this pressure is below vapour pressure; -1: none
    ],
    align=True,
)
PRESSURE, LEVEL, PIPE_PRESSURE, PIPE_FLOW, VALVE_FLOW, COLUMN_FLOW, SPOOL_FLOW = 0, 1, 2, 3, 4, 5, 6  # probe kinds
POSITION, VELOCITY, FORCE, PISTON_POSITION, PISTON_VELOCITY, DEVICE_VALUE = 7, 8, 9, 10, 11, 12
NODE_SCALAR, PIPE_SCALAR = 13, 14
CELL_FIELD, PATCH_FLOW, CELL_SCALAR = 15, 16, 17  # of basins
GIVEN_FLOW = 18  # of a patch that a given velocity passes
WALL_VALUE = 19  # of a wall that moves
BODY_VALUE, POINT_VALUE, PIN_VALUE, BUSHING_VALUE = 20, 21, 22, 23  # `side` says which, see `mechanism.observe`
SURFACE_VALUE = 24  # of water in modes
PIPE_FORCE = 25  # on a whole pipe

BASIN = np.dtype(
    [
        ("kind", "i8"),  # code of its physics, see `basins.kinds`
        ("deep", "i8"),  # 1: its first quantity is a depth over that in `plan`, in which amounts of scalars are spread
        ("given", "i8"),  # 1: flows through its faces are those of a given velocity, in `plane`; others are in `work`
        ("scheme", "i8"),
        ("limiter", "i8"),  # on rectangles
        ("wide", "f8"),  # on any mesh: how far values at sides of cells may go beyond those around
        ("n", "i8"),  # cells
        ("nx", "i8"),  # of a rectangle's columns and rows; 0 on any other mesh
        ("ny", "i8"),
        ("faces", "i8"),  # of a mesh, the last ones the boundary's
        ("outer", "i8"),  # how many of them these are
        ("y", "i8"),  # first state: of one quantity after the other, a row of cells
        ("spacing", "i8"),  # offsets in `plane`: 1 / widths of columns, then of rows [1/m]
        ("plan", "i8"),  # what is fixed, rows of cells
        ("area", "i8"),  # of cells [m2]
        ("reflect", "i8"),  # what comes back of waves, a value for each face of the boundary
        ("outer_given", "i8"),  # how many values these are: 0 for walls everywhere
        ("through", "i8"),  # flows inward through faces of the boundary; -1 where none is open; see `plane.behind`
        ("unused", "i8"),  # offsets in `work`: rates that only tell what passes it
        ("mesh", "i8"),  # numbers of a mesh, in `plane` and
        ("links", "i8"),  # in `integers`
        ("work", "i8"),  # of `work`
        ("thickness", "f8"),  # [m]
        ("speed", "f8"),  # of waves in a liquid at rest [m/s]
        ("density", "f8"),  # of a liquid at rest [kg/m3]
        ("table", "i8"),  # of its waves under law table, in `plane`
        ("small", "f8"),  # what is too small to mean anything, squared
        ("carried", "i8"),  # first state of scalars, depth times value, one after the other; -1 for none
        ("lost", "i8"),  # first of its cells among the losses of a scalar
        ("flows", "i8"),  # through faces: of columns, then of rows, or of a mesh; -1 where nobody asks
        ("outside", "i8"),  # in `work`: of each scalar, values beyond the boundary
        ("toil", "i8"),  # and what scalars are carried in
        ("fastest", "f8"),  # rate of a given velocity [1/s]
        ("period", "f8"),  # of its turning back [s]; 0 for none
        ("friction", "i8"),  # NO_DRAG, MANNING or DARCY
        ("roughness", "f8"),  # Manning's n, or a factor
        ("held", "f8"),  # bound of the rate of friction [1/s]; infinity where steps need not follow it
        ("damped", "i8"),  # 1 where steps are divided by friction, and so need not follow it
        ("unsplit", "f8"),  # what counts as rate of its cells over that of the kernels
        ("rest", "f8"),  # p - p_ambient + rho g z of the profile, the same in all cells [Pa]
        ("wall", "i8"),  # first of its walls that move, and
        ("walls", "i8"),  # how many these are; with any, its states are contents, see `basins.walls`
        ("drawn", "i8"),  # offsets in `plane`: areas of cells as drawn; else those of cells now
        ("stretch", "i8"),  # area of cells over that as drawn; of a grid then of its columns or rows
        ("lines", "i8"),  # speeds of lines, of a mesh of its corners [m/s]
        ("thrust", "i8"),  # and in `work`: on faces of the boundary, see `free_surface.grid`
        ("turn", "i8"),  # 0 where lines along x move, 1 where those along y do
        ("body", "i8"),  # that it rides on; -1 for none
        ("heavy", "i8"),  # 1 where that body feels it: forces move it, or someone asks what its joint holds
        ("frame", "i8"),  # in `plane`: where and how it stands there, and how its axes move; see `basins.frames`
        ("corners", "i8"),  # of a mesh: how many, and offsets in `plane`:
        ("places", "i8"),  # of these, then centres of cells, see `moving_meshes`
        ("sides", "i8"),  # speeds of sides along their normals, by block, side of four and cell [m/s]
        ("ends", "i8"),  # and in `integers`: corners of sides and cells, see `moving_meshes`
    ],
    align=True,
)
NO_DRAG, MANNING, DARCY = 0, 1, 2
PATCHES = np.dtype(
    [
        ("basin", "i8"),
        ("node", "i8"),
        ("first", "i8"),  # of its cells in `integers`
        ("count", "i8"),
        ("sizes", "i8"),  # in `plane`: area of these [m2] and length of its faces [m], now
        (
            "ring",
            "i8",
        ),  # of its faces' numbers in `integers`, as the boundary has them; of cells behind these after them
        ("faces", "i8"),  # how many these are
        ("normals", "i8"),  # in `plane`: outward normals along x, along y, and length over area of cells, of each; with
        # walls that move these as drawn besides
        ("open", "i8"),  # 1 where it is no wall and no link joins: what passes is the boundary's
        ("moves", "i8"),  # 1 where it is a wall that moves
        ("values", "i8"),  # of schedules of what comes in, in `integers`, one a scalar; -1: its initial value
    ],
    align=True,
)

WALL = np.dtype(
    [
        ("basin", "i8"),
        ("node", "i8"),  # its patch as a place
        ("y", "i8"),  # offset of its travel since the start [m]
        ("mass", "i8"),  # that it goes with, or
        ("body", "i8"),  # whose prismatic joint takes it along, or
        ("toward", "f8"),  # 1 where that travels as the wall does, -1 where the other way
        ("schedule", "i8"),  # of its travel; -1 for none
        ("weights", "i8"),  # in `plane`: how far lines go with it, then by how much cells stretch per travel [1/m]
        ("faces", "i8"),  # in `integers`: its faces' numbers, as the boundary has them
        ("count", "i8"),  # how many these are
        ("lengths", "i8"),  # in `plane`: of these [m]
        ("outward", "f8"),  # 1 where its travel counts outward, -1 inward
        ("rest", "f8"),  # force that the profile puts on it [N]
    ],
    align=True,
)

SCALAR = np.dtype(
    [
        ("y", "i8"),  # offset in y of its amounts per length [kg/m], pipe by pipe, then of those in nodes that store
        ("places", "i8"),  # offset in `integers`, one a node: where its amount is in y, or the schedule of its value
        ("diffusivity", "f8"),
        ("decay", "f8"),  # [1/s]
        ("ambient", "f8"),  # what it decays to
        ("loss", "i8"),  # first of its rows in the ledger of what decays, and how many: none without decay, one, or
        ("losses", "i8"),  # one a state, where steps are implicit: their Jacobian wants rows that hang on few states
        ("initial", "f8"),  # what flows in where nothing else is said
        ("least", "f8"),  # bounds of all values that there can be
        ("greatest", "f8"),
    ],
    align=True,
)

CLOCK = np.dtype(
    [
        ("limit", "f8"),  # end of the segment: schedules take their left limit from here on [s]
        ("step", "f8"),  # that is given; 0 where steps follow what they meet [s]
    ],
    align=True,
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
    "bodies": BODY,
    "freedoms": FREEDOM,
    "points": POINT,
    "lines": LINE,
    "pins": PIN,
    "bushings": BUSHING,
    "rides": RIDE,
    "masses": MASS,
    "braces": BRACE,
    "stops": STOP,
    "pistons": PISTON,
    "devices": DEVICE,
    "basins": BASIN,
    "patches": PATCHES,
    "scalars": SCALAR,
    "walls": WALL,
    "delays": DELAY,
}
# Of a model, which nobody writes; of one run, which writes them; behind a handle, with addresses of functions: of
# pieces, a row a job, and of devices, a row a law.
Tables = namedtuple("Tables", (*RECORDS, "integers", "floats", "profile", "plane", "pieces"))
Written = namedtuple(
    "Written",
    (
        "clock", "work", "armed", "marks", "scratch", "spare", "seen", "bands", "joint", "sums", "envelope", "extremes",
        "past", "sharp",
    ),
)  # fmt: skip
Called = namedtuple("Called", (*Tables._fields, *Written._fields, "calls", "hooks"))
MATRICES = ("pieces", "envelope", "extremes")  # float64[:, :]; all others that are no records float64[:]
INTEGERS = ("integers", "bands", "joint", "sums", "sharp", "calls", "hooks")  # but int64


@functools.cache
def table_types() -> Called:
    """Numba's types of the tables behind a handle."""
    from numba import from_dtype, types

    def of(name):
        record = {**RECORDS, "clock": CLOCK}.get(name)
        values = from_dtype(record) if record else types.int64 if name in INTEGERS else types.float64
        return types.Array(values, 2 if name in (*MATRICES, "calls", "hooks") else 1, "C")

    return Called(*map(of, Called._fields))
