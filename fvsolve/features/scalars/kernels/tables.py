"""Tables of scalars, reactions and heat, behind the same handle as those of the model."""

import functools
from collections import namedtuple

import numpy as np

from fvsolve.core.kernels import table_handle
from fvsolve.core.kernels.dtypes import f8, i8, record
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 2

SCALAR = record(
    # offset in y of its amounts per length [kg/m], pipe by pipe, then of those in nodes with storage
    y=i8,
    places=i8,  # offset in `integers`, by node: offset of its amount in y, or schedule of its value
    # offset in `floats` of the wall mass of each pipe, and of a 0 for places without walls [kg/m]
    wall_masses=i8,
    diffusivity=f8,  # along pipes and in cells [m2/s]
    decay=f8,  # [1/s]
    ambient=f8,  # value to which it decays
    loss=i8,  # first of its rows in the ledger of decay
    # Number of these rows: 0 without decay, 1, or a row for each state if steps are implicit, because rows of the
    # Jacobian must depend on few states.
    losses=i8,
    initial=f8,  # inflow value if no other is given
    least=f8,  # bounds of all possible values
    greatest=f8,  # see `least`
    molar=f8,  # amount of substance per volume of the value 1 [mol/m3]; 1 if it is no amount
    specific_heat=f8,  # of a temperature that heat changes [J/kg/K]; 0 for other scalars
    zero=f8,  # absolute temperature at which its value is 0 [K]
    # numbers a and b of Walther's equation of the viscosity, see `viscosity`; b is 0 without it
    walther_a=f8,
    walther_b=f8,  # see `walther_a`
    # 1 if the heat of friction has a row in the ledger for each cell, 0 for a row for each pipe
    by_cell=i8,
)

HEAT_SOURCE = record(  # restriction whose dissipated power heats the fluid where its flow leaves
    valve=i8,  # row of the restriction
    device=i8,  # device whose further dissipation is included; -1 for none
)

EXCHANGER = record(  # heat exchanger between a fluid place and a thermal node of a network
    node=i8,  # row of its place in the fluid
    conductance=f8,  # [W/K]
    effectiveness=f8,  # heat out of the fluid over m cp (T - T_to), m the mixed inflow [-]
    slowness=f8,  # 1 / heat capacity of the thermal node, 0 for an ambient [K/J]
)

REACTION = record(
    program=i8,  # header row of the formula of its rate in `pieces`; -1 for mass action
    scalars=i8,  # offset of the numbers of its scalars in `integers`
    count=i8,  # number of these
    # offset in `floats` of three numbers of each scalar: both orders, and its change in its own unit
    data=i8,
    extent=i8,  # first of its rows in the ledger of reactions
    extents=i8,  # number of these rows: 1, or a row for each place, see SCALAR
    limits=i8,  # 1 if its rate limits steps
    forward=f8,  # constants of mass action [(mol/m3)^(1 - order)/s]
    reverse=f8,  # of the reverse reaction, in the unit of its order
    thermal=f8,  # R T [J/mol]
)
FORWARD_ORDER, REVERSE_ORDER, CHANGE = 0, 1, 2
MOLAR_RATE, CHEMICAL_POWER, AFFINITY = 0, 1, 2  # values of a reaction

RECORDS = {
    "scalars": SCALAR,
    "heat_sources": HEAT_SOURCE,
    "exchangers": EXCHANGER,
    "reactions": REACTION,
}
ScalarTables = namedtuple("ScalarTables", tuple(RECORDS))
EMPTY = ScalarTables(*(np.zeros(0, kind) for kind in RECORDS.values()))


@functools.cache
def scalar_types() -> ScalarTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    return ScalarTables(*(types.Array(from_dtype(kind), 1, "C") for kind in RECORDS.values()))


if COMPILING:

    @Intrinsic
    def open_scalars(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of scalars."""
        return table_handle.open_with("ScalarTables", scalar_types, SLOT, handle)
else:

    def open_scalars(handle):
        """Tables of a handle as `open_tables`, and those of scalars."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
