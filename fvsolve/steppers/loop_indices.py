"""Indices into the flat arrays of the time loop: its state, its controls, its progress within a step."""

# loop_state : float64[LOOP_STATE_SIZE], stored by a restart
T, STEP, T_MARK, N_MARK, ERROR_OLD, NEXT_OUTPUT, NEXT_FIELD, STEPS, REJECTIONS, CALLS, LAST, UNBOOKED = range(12)
JACOBIANS, FACTORS, NEWTON, NEWTON_FAILURES, WORST, RADIUS, SWITCH_COUNT, SWITCHES = range(12, 20)
# Rest of a given step that is taken in parts [s], and the number of such steps.
SPLIT_REMAINDER, SPLIT_STEPS = range(20, 22)
LOOP_STATE_SIZE = 22
COUNTS = {
    "steps": STEPS, "rejections": REJECTIONS, "rhs": CALLS, "jacobians": JACOBIANS, "factorisations": FACTORS,
    "newton": NEWTON, "newton_failures": NEWTON_FAILURES,
    "parted": SPLIT_STEPS,
}  # fmt: skip
# controls : float64[CONTROLS_SIZE], set before each call
START, END, EVERY, FIELD_EVERY, CONTROL, SIZE, STEP_MAX, BUDGET, FIELD_COUNT, STOP_AT, ALLOW_FUSED = range(11)
# Power of h of the error estimate; 1 where the last stage is the first stage of the next step; kind of step; 1 for the
# stiffness test, and the cost of an implicit step in explicit steps; source of rows with and without error control.
ORDER, FSAL, KIND, WATCH, PRICE, END_AT_ROWS, SEPARATE_ROWS = range(11, 18)
CONTROLS_SIZE = 18
# Values of SEPARATE_ROWS: rows within a given step come from its polynomial; from separate steps within the first two
# steps after a start; always from separate steps.
NEVER_SEPARATE, SEPARATE_AT_START, ALWAYS_SEPARATE = 0, 1, 2
GROWTH_CHECK_STEPS = 16.0  # steps between two checks for growth
GROWTH_FOUND = -1.0  # in controls[BUDGET]: a state has grown beyond its largest value, so the call returns
EXPLICIT, NEWTON_SOLVED, LINEARLY_IMPLICIT = 0, 1, 2  # values of KIND
COURANT, FIXED_STEP, TOLERANCE = 0, 1, 2  # values of CONTROL
# Reasons for which a call returns.
DONE, BUDGET_SPENT, ROWS_FULL, FIELD, BAD_VALUE, TINY_STEP, BAD_STATUS, STOPPED, NEWTON_STUCK, SWITCHED, CHATTERING = (
    range(11)
)
# progress : int64[6], kept between calls while rows remain to be written: phase, 1 after a step, buffers of the present
# and the last state, number of rows, 1 if the rhs switches at the end of the last step
PHASE, HAS_LAST_STEP, NOW, OLD, ROWS, SWITCH_PENDING = range(6)
FRESH, FUSED, EMIT, READY = range(4)

RATE, STATUS, PLACE, CLOSING_RATE, JUMP_TIME = 0, 1, 2, 3, 4  # entries of `out` that the loop reads
NO_JUMP = -1e300  # in JUMP_TIME: no jump will arrive
CORRECTED, ARRIVED = 7, 8  # in STATUS: the record has corrected the accepted state; the record lets a jump arrive now
NOT_FINITE = 3  # a value of out[STATUS]
STOP_HERE = -2.0  # in out[PLACE]: the record requests the end of the run
NEWTON_FAILED = -1.0  # in place of an error: the stages could not be solved with this step

# Header of `work`: 1 with a Jacobian; step at which it was computed; number of earlier steps known (2: or more); step
# of the present stages; shift of the last factors (0: none; negative: a resumed run has to factor again); greatest
# ratio of successive increments of a step; last ratio / (1 - ratio); last step with damping; size of a factor.
(
    HAS_JACOBIAN,
    JACOBIAN_STEP,
    KNOWN_STEPS,
    STAGES_STEP,
    SHIFT,
    INCREMENT_RATIO,
    CONVERGENCE_FACTOR,
    DAMPED_STEP,
    FACTOR_SIZE,
) = range(9)
HEADER = 9
