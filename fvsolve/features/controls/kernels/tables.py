"""Tables of blocks of `controls`, behind the same handle as those of the model, and functions of the laws of blocks."""

import functools
from collections import namedtuple

from fvsolve.core.kernels import calls, table_handle
from fvsolve.core.kernels.dtypes import FEATURE_VALUE, PROBE, f8, i8, record, table_types
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 1
# probe kind; `side` is 0 for the output, 1 for the input, 2 for the error
BLOCK_VALUE = FEATURE_VALUE + SLOT

# block of `controls`, in an order in which each block comes after those that it reads at once
CONTROL = record(
    hooks=i8,  # row of `hooks`, the functions of its law
    y=i8,  # offset in y of its states: filtered inputs first; -1 for none
    filters=i8,  # number of filtered inputs
    filter_rate=f8,  # 1 / time constant of the filters [1/s]
    data=i8,  # offset of the numbers of its law in `floats`
    # offset in `integers` of its inputs: number of a sensor, or -1 - number of another block
    inputs=i8,
    input_count=i8,  # number of its inputs
    starts=i8,  # offset in `floats` of the values of its inputs at the start
    setpoint=i8,  # schedule of its setpoint; -1 for none
    setpoint_start=f8,  # value of the setpoint at the start
    at_once=i8,  # 1 if its output depends on the present values of its inputs
    late=i8,  # 1 if its output is computed after the nodes are solved, 0 if before
    least=f8,  # limits of its output
    greatest=f8,  # see `least`
    flag=i8,  # first of four event flags of its limits; -1 for none
    # Offset in `discrete` of numbers that change at events and samples only, -1 for none. Of a block that acts at
    # samples: its output, the number of its next sample, then numbers of its law.
    memory=i8,
    period=f8,  # time between samples [s]; 0 for a block that acts at all times
    offset=f8,  # time of the first sample after the start of the run [s]
    start=f8,  # output at the start
    held=f8,  # output at which a study holds it; nan if it follows its law
    delay=f8,  # time by which it follows its input [s]; 0 for other blocks
    history=i8,  # number of the history of its input, see `kernels.input_histories`; -1 for none
    # Offset in `integers` of the blocks on which the input of a delay depends, not through other delays: first those on
    # whose present outputs it depends, `source_count`, then `later_count` that it follows through states.
    sources=i8,
    source_count=i8,  # see `sources`
    later_count=i8,  # see `sources`
)

DRIVEN = record(  # row of a table that a block drives before the nodes are solved
    kind=i8,  # DRIVEN_VALVE, DRIVEN_DEVICE or DRIVEN_NODE
    index=i8,  # its row
)
DRIVEN_VALVE, DRIVEN_DEVICE, DRIVEN_NODE = 0, 1, 2

BLOCK_SETTINGS = record(
    late=i8,  # 1 if a block decides after the nodes are solved
    late_sensors=i8,  # 1 if a sensor reads what only the solved nodes determine
    outputs=i8,  # offset in `out`: of each block its output, and its first input after its filter
)
# discrete : numbers of blocks that change at events and samples only; histories : see `input_histories`
# readings : values of sensors; sensing : handle of the view "sensing", in which sensors replace probes
# block_hooks : addresses of functions of laws, a row for each law, with the columns of HOOKS
BlockTables = namedtuple(
    "BlockTables",
    (
        "controls",
        "sensors",
        "driven",
        "block_settings",
        "block_hooks",
        "discrete",
        "histories",
        "readings",
        "sensing",
    ),
)

# functions of the law of a block: types of arguments and of the result, see `kernels.calls.HOOKS`
HOOKS = {
    "decide": ("tVBC", "t"),  # t, y, tables, control: its output before its limits
    # t, y, dydt, tables, control, v, u: rates of its states; v, u : output before and after its limits
    "adapt": ("tVVBCtt", ""),
    "switch": ("tVBCV", ""),  # t, y, tables, control, g: its event functions
    # t, y, tables, control: output before its limits at a sample; changes the numbers of the block in `discrete`
    "sample": ("tVBC", "t"),
}
DECIDE, ADAPT, SWITCH, SAMPLE = range(len(HOOKS))


@functools.cache
def block_types() -> BlockTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    records = [
        types.Array(from_dtype(kind), 1, "C") for kind in (CONTROL, PROBE, DRIVEN, BLOCK_SETTINGS)
    ]
    floats, integers = types.Array(types.float64, 1, "C"), types.Array(types.int64, 1, "C")
    return BlockTables(*records, types.Array(types.int64, 2, "C"), floats, floats, floats, integers)


def open_type():
    """Numba type of the tables that `open_blocks` returns."""
    from fvsolve.compile.code_generation import Tables

    return Tables("BlockTables", table_types, block_types, SLOT)


calls.add_kind("B", open_type)
calls.add_kind("C", lambda: block_types().controls.dtype)
call_decide = calls.call_at_address("call_decide", *HOOKS["decide"], home=__name__)
call_adapt = calls.call_at_address("call_adapt", *HOOKS["adapt"], home=__name__)
call_switch = calls.call_at_address("call_switch", *HOOKS["switch"], home=__name__)
call_sample = calls.call_at_address("call_sample", *HOOKS["sample"], home=__name__)

if COMPILING:

    @Intrinsic
    def open_blocks(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of blocks."""
        return table_handle.open_with("BlockTables", block_types, SLOT, handle)
else:

    def open_blocks(handle):
        """Tables of a handle as `open_tables`, and those of blocks."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
