"""What the time loop is told and what it remembers: places in two flat arrays. Knows no numbers."""

# What the loop remembers, in one flat array of floats that a restart stores.
T, STEP, T_MARK, N_MARK, ERROR_OLD, NEXT_OUTPUT, NEXT_FIELD, STEPS, REJECTIONS, CALLS, LAST, UNBOOKED = range(12)
JACOBIANS, FACTORS, NEWTON, NEWTON_FAILURES, WORST, RADIUS, CASES, SWITCHES = range(12, 20)
# What is left of a given step that is taken in parts [s], and how many there were.
LEFT, PARTED = range(20, 22)
MEMORY = 22
COUNTS = {
    "steps": STEPS, "rejections": REJECTIONS, "rhs": CALLS, "jacobians": JACOBIANS, "factorisations": FACTORS,
    "newton": NEWTON, "newton_failures": NEWTON_FAILURES,
    "parted": PARTED,
}  # fmt: skip
# What a call is told.
START, END, EVERY, FIELD_EVERY, CONTROL, SIZE, STEP_MAX, BUDGET, FIELD_COUNT, STOP_AT, LEAPS = range(11)
# Power of h of the error estimate; whether the last stage is the next first; the kind of step; whether stiffness is
# watched, and then the price of an implicit step in explicit ones; where rows come from, by error control and else.
ORDER, FSAL, KIND, WATCH, PRICE, LANDS, APART = range(11, 18)
ORDERS = 18
# Values of APART: rows within a given step come from its polynomial; from steps of their own in the first two steps
# behind a start; from steps of their own.
NEVER_APART, APART_AT_FIRST, ALWAYS_APART = 0, 1, 2
CHECKED = 16.0  # steps between two looks for growth
EXCEEDED = -1.0  # in orders[BUDGET]: a state has grown, come back
EXPLICIT, NEWTON_SOLVED, LINEARLY_IMPLICIT = 0, 1, 2  # values of KIND
COURANT, FIXED_STEP, TOLERANCE = 0, 1, 2  # values of CONTROL
# Why a call came back.
DONE, CHUNK, ROWS_FULL, FIELD, BAD_VALUE, TINY_STEP, BAD_STATUS, STOPPED, NEWTON_STUCK, SWITCHED, CHATTERS = range(11)
# What passes between calls while rows are still to be written: phase, whether a step lies behind, buffers, rows, and
# whether the rule of the rhs changes at its end.
PHASE, BEHIND, NOW, OLD, ROWS, BENT = range(6)
FRESH, LEAPT, EMIT, READY = range(4)

RATE, STATUS, WHERE, CLOSING, ARRIVES = 0, 1, 2, 3, 4  # the entries of `out` that the loop reads
NEVER = -1e300  # in ARRIVES: no jump is on its way
AMENDED, ARRIVED = 7, 8  # in STATUS: the state was put right as it was noted; a jump is to arrive now
NOT_FINITE = 3  # a value of out[STATUS]
STOP_HERE = -2.0  # in out[WHERE]: the record asks for an end
NEWTON_FAILED = -1.0  # in place of an error: the stages could not be solved with this step

# The header of `work`: whether there is a Jacobian, the step it was made at, how many steps before are known (2: or
# more), the step that the present stages belong to, the shift factored last (0: none; below 0: one that a resumed run
# has to factor again), the worst ratio of two increments of a step, the last such ratio / (1 - ratio), the last step
# that was damped, the size of a factor.
HAS, MADE, KNOWN, SEEN, SHIFT, RATIO, SURE, DAMPED, STORE = range(9)
HEADER = 9
