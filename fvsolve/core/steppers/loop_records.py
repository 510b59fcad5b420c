"""Records and codes of the time loop: its state, its settings, its progress within a step, data of Newton iterations.

Compiled functions read a record once, before a loop over states: stores to arrays may change a record as far as the
compiler knows, so that a loop that reads a field is not vectorised.
"""

import numpy as np


def _record(integers: str, floats: str) -> np.dtype:
    """Record with integer fields, then float64 fields, given by their names."""
    fields = [(name, "i8") for name in integers.split()] + [(name, "f8") for name in floats.split()]
    return np.dtype(fields, align=True)


# Stored for a restart: time; given or next step; start of the present given steps and their number; error of the last
# step; numbers of output rows and fields; counts of work; length of the last step; step that is not yet in the ledger;
# state in which Newton iterations failed; spectral radius [1/s]; steps in favour of the other kind of method, and the
# number of changes of the method; rest of a given step that is taken in parts [s], and the number of such steps; steps
# since both sums of `hidden_stiffness` were compared.
STATE = _record(
    "",
    "t step t_mark n_mark error_old next_output next_field steps rejections calls last unbooked jacobians "
    "factorisations newton newton_failures worst radius switch_count switches split_remainder split_steps "
    "window",
)
COUNTS = {
    "steps": "steps",
    "rejections": "rejections",
    "rhs": "calls",
    "jacobians": "jacobians",
    "factorisations": "factorisations",
    "newton": "newton",
    "newton_failures": "newton_failures",
    "parted": "split_steps",
}
# Set before each call. mode : COURANT, FIXED_STEP or TOLERANCE, with the number `size`; kind : EXPLICIT and so on
# fsal : 1 where the last stage is the first stage of the next step; watch : 1 for the stiffness test
# stage_slope : 1 where the slope of the last stage is used as that of the end, because a new evaluation of f
# would amplify the Newton residual
# end_at_rows, separate_rows : source of rows with and without error control; ledger_offset : first ledger rate in `out`
# dense_steps : 1 where states within every step are needed, not only those of rows
# dividing_rate : rate above which a given step is divided into parts of its time constant [1/s]; 0 for none
# watch_at : count of steps at which the next state is watched, see `run_handle.WATCH`; 0 for none
# has_jumps : 1 where waves of delay lines arrive, so that event functions may jump
# keeps_step : 1 where a step after a switch begins with the length of that before, because nothing is fast
# price : cost of an implicit step in explicit steps; order : power of h of the error estimate; budget : steps left
CONTROL = _record(
    "mode kind allow_fused fsal stage_slope watch end_at_rows separate_rows ledger_offset dense_steps has_jumps "
    "keeps_step",
    "start end every field_every size step_max budget field_count stop_at order price dividing_rate watch_at",
)
# Kept between calls while rows remain to be written: phase; 1 after a step; rows of y with the present and the last
# state; number of rows; 1 if the rhs switches at the end of the last step. Kept from a step to the next within a call:
# 1 if the last stage is the first stage of the next step; 1 if `g_new` belongs to the end of the last step; 1 if
# compensated sums have changed the new state; 1 if the next step is not solved in sweeps; status of the first stage of
# the last step whose rates are not valid, 0 if all are, and the place of this fault; end of the step, start of the last
# accepted step [s].
PROGRESS = _record(
    "phase has_last_step now old rows switch_pending reuse event_known changed no_sweeps stage_status stage_where",
    "t_new t_old",
)
# 1 with a Jacobian; step at which it was computed; number of earlier steps known (2: or more); step of the present
# stages; shift of the last factors (0: none; negative: a resumed run has to factor again); greatest ratio of successive
# increments of a step; last ratio / (1 - ratio); last step with damping; size of a factor.
NEWTON = _record(
    "",
    "has_jacobian jacobian_step known_steps stages_step shift increment_ratio convergence_factor damped_step "
    "factor_size",
)

# Values of `separate_rows`: rows within a given step come from its polynomial; from separate steps within the first two
# steps after a start; always from separate steps.
NEVER_SEPARATE, SEPARATE_AT_START, ALWAYS_SEPARATE = 0, 1, 2
GROWTH_CHECK_STEPS = 16.0  # steps between two checks for growth
GROWTH_FOUND = -1.0  # in `budget`: a state has grown beyond its largest value, so the call returns
EXPLICIT, NEWTON_SOLVED, LINEARLY_IMPLICIT = 0, 1, 2  # values of `kind`
COURANT, FIXED_STEP, TOLERANCE = 0, 1, 2  # values of `mode`
# Reasons for which a call returns.
(
    DONE,
    BUDGET_SPENT,
    ROWS_FULL,
    FIELD,
    BAD_VALUE,
    TINY_STEP,
    BAD_STATUS,
    STOPPED,
    NEWTON_STUCK,
    SWITCHED,
    CHATTERING,
) = range(11)
REPEAT = -1  # in place of a reason: compute the rates of the present state again
FRESH, FUSED, EMIT, READY = range(4)  # values of `phase`

LEAST_TOLERANCE = 1e-13  # least relative tolerance: below it rounding errors dominate
UNKNOWN_PACE = 1e100  # in the array `pace`: no step with this event function has been taken
LEAST_STEP = 4e-16  # least step, relative to the time

# Entries of `out` that the loop reads; LONGEST_STEP limits the next step under error control [s], 0 for no limit.
# NEARBY : 1 before a call at a state next to the last accepted one, see `newton.renew_at_start`
# LAST_ROW : time up to which output rows show the present state, although a jump arrives now [s]
RATE, STATUS, PLACE, CLOSING_RATE, JUMP_TIME, LONGEST_STEP = range(6)
NEARBY, LAST_ROW = 7, 8
OUT_HEAD = 9
NO_JUMP = -1e300  # in JUMP_TIME and LAST_ROW: no jump will arrive
# in STATUS: the record has corrected the accepted state; the record lets a jump arrive now
CORRECTED, ARRIVED = 7, 8
NOT_FINITE = 3  # a value of out[STATUS]
STOP_HERE = -2.0  # in out[PLACE]: the record requests the end of the run
UNKNOWN_DEFECT = 1e300  # in place of a defect: the rates on the dense output are not valid
NEWTON_FAILED = -1.0  # in place of an error: the stages could not be solved with this step
