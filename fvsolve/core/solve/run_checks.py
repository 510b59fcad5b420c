"""Checks of a run: limits and errors of given steps, growth of states, sloshing, balances that do not close.

Step doubling repeats a given step occasionally as two half steps, to estimate the error of the run. A step that is too
long need not be unstable: the nonlinear law of a valve bounds the growth, so that vessels oscillate between two wrong
pressures, and implicit methods are stable at any step. Let e be the difference between the state after a step and the
state after two half steps, and r the fraction of an error that remains after one more step. The errors of n steps add
up to e (1 - r^n) / (1 - r). For a draining vessel r is near 1 and all errors remain; with a small r only the last
errors remain.
"""

import numpy as np

from fvsolve.core.assembly.features import coordinate_of, frames_of
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.solve.energy_watch import EnergyWatch
from fvsolve.core.solve.run_loop import STATUS_FAILURES
from fvsolve.core.step_limits.growing_modes import forcing_sizes, state_ranges, states_outside_cells
from fvsolve.core.step_limits.step_notices import (
    DOUBTFUL,
    WRONG,
    exceeds_limit_of_cells,
    first_step,
    initial_step_limits,
    step_limits,
)
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import Notice

# largest state, in units of its forcing range: beyond it the state has grown by instability
GROWTH_LIMIT = 1e6
# in the same units: waves that add up may reach it, so a smaller state is no sign of growth
NO_GROWTH = 10.0
LEDGER_TOLERANCE = 1e-8  # greatest remainder of a ledger, relative to its largest term


class RunChecks:
    """Checks during a run: wave rates of meshes, size of the states, height of sloshing modes.

    largest : float64[n]  allowed size of each state: 1e6 times its `forcing_sizes`. In cells these are the largest of
    the range of initial values, the range of the schedules, and the Joukowsky jump if the initial flows stop
    sound : time of the last checked state without growth [s]
    """

    def __init__(self, run_data, has_ranks: bool = False) -> None:
        self.run_data, self.model = run_data, run_data.model
        model = self.model
        self.energy = EnergyWatch(run_data, has_ranks)
        self.moving = model.meshed if model.case.numerics.step is not None else []
        self.rates: dict[str, float] = {}
        self.predicted = initial_step_limits(model, run_data)
        self.step_doubling = StepDoubling(run_data)
        self.sloshing = SloshingCheck(model)
        self.largest = GROWTH_LIMIT * forcing_sizes(model)
        self.grown: Notice | None = None
        self.sound = model.case.numerics.start

    @property
    def needs_frequent_checks(self) -> bool:
        """True if `check` must be called every few steps, for checks that the time loop does not make itself."""
        return bool(self.sloshing.tanks or (self.predicted and self.moving))

    @property
    def has_valid_counts(self) -> bool:
        """True if the restart data have counts and numbers of places that a run can have."""
        own = self.step_doubling.restart_data[:4]
        is_valid = bool(np.isfinite(own).all() and own.min() >= 0.0)
        return (
            is_valid
            and (self.step_doubling.states.size > 0 or own[0] == 0.0)
            and self.energy.has_valid_place
        )

    @property
    def largest_if_needed(self) -> np.ndarray:
        """Array `largest` if the step exceeds a predicted limit, so that the time loop checks growth; else empty."""
        return (
            np.array(np.broadcast_to(self.largest, self.model.y_size))
            if self.predicted
            else np.zeros(0)
        )

    def check(self, t: float, y: np.ndarray) -> str:
        """Check state y at time t [s], and update the wave rates of meshes; returns the reason to stop, or ""."""
        for part in self.moving:
            self.rates[part.name] = max(self.rates.get(part.name, 0.0), part.max_rate(y)[0])
        if reason := self.sloshing.check(t, y):
            return reason
        ratio = np.abs(y) / self.largest
        if np.all(ratio <= NO_GROWTH / GROWTH_LIMIT):
            self.sound = t
        if not np.any(ratio > 1.0):
            return ""
        worst = int(np.argmax(ratio))
        name, times = self.model.state_names[worst], GROWTH_LIMIT * float(ratio[worst])
        text = (
            f"{name} has grown to {times:.3g} times the range of its forcing at t = "
            f"{self.model.case.moment(t)}; the step is beyond the limit of the method: "
            "halve the step"
        )
        place = name.partition("[")[0]
        size = float(abs(y[worst]))
        limit = float(self.largest[worst])
        self.grown = Notice("growth", place, text, None, size, limit, False)
        return f"stopped: {text}"

    def warnings(self, ledgers: dict) -> list[Notice]:
        """Notices of all checks at the end of a run; ledgers : balances of mass and scalars by name."""
        notices = list(self.predicted)
        # repeat the prediction with the wave rates and step errors of the run
        doubling = self.step_doubling
        if doubling.over_limit or (
            self.model.case.numerics.step is not None and (notices or self.moving)
        ):
            error = np.inf if self.grown else doubling.worst()[1]
            notices = step_limits(
                self.model, self.rates, error, cell_error=doubling.worst_in_cells()
            )
        step_error = self.step_doubling.notice()
        notices += [] if step_error is None else [step_error]
        energy = self.energy.notice()
        notices += [] if energy is None else [energy]
        notices += [notice for own in self.run_data.features for notice in own.notices()]
        notices += self.sloshing.notices()
        notices += [] if self.grown is None else [self.grown]
        return notices + [
            notice for name, ledger in ledgers.items() for notice in ledger_notices(name, ledger)
        ]


def split_step_notices(numerics, counts: dict[str, int]) -> list[Notice]:
    """Notice if steps of given length were taken in parts; an empty list if not.

    counts : counts of the run, with the number of such steps under "parted"
    """
    if not counts.get("parted"):
        return []
    key = "step" if numerics.step is not None else "courant"
    text = (
        f"{counts['parted']} of {counts['steps']} steps were too long for Newton's method, for a disc that shuts "
        "on a rigid column, for a contact with an end-stop, or for a part with storage beside delay lines, and "
        "were taken in parts that end where the full step would have ended; give a smaller "
        f"numerics.{key}, or rtol instead"
    )
    return [Notice("step-limit", "numerics", text, key, float(counts["parted"]), 0.0, True)]


def ledger_notices(name: str, ledger: dict) -> list[Notice]:
    """Notice if the remainder of the balance `name` is larger than rounding; an empty list if not."""
    relative = ledger.get("relative", 0.0)
    if relative <= LEDGER_TOLERANCE:  # False for NaN: such a ledger does not close
        return []
    text = (
        f"{name} ledger: the remainder, 0 in an exact balance, is {ledger['remainder']:.6g}, {relative:.3g} of the "
        f"largest term; expected at most {LEDGER_TOLERANCE:g} of the largest term"
    )
    return [Notice("ledger", name, text, "remainder", float(relative), LEDGER_TOLERANCE, False)]


SMALL_WAVE = 0.2  # wave height up to which a wave is small, as a fraction of the depth
# change of the water's weight by the motion of its body that may be neglected in its waves, as a fraction
WEIGHT_CHANGE = 0.1
WEIGHT_ROUNDING = 1e-6  # fraction of the weight that counts as rounding
RISE, LOSS = slice(0, 2), slice(2, 4)


class SloshingCheck:
    """Record of the wave height of sloshing modes and of the change of the water's weight by the motion of its frame.

    Sloshing modes are computed under gravity, sloshing in cells under gravity and the motion of driven joints. Neither
    includes the acceleration of a body that moves freely.
    restart_data : float64[tanks, 4]  greatest rise as a fraction of the depth and its time [s], greatest change of
    weight as a fraction of the weight and its time [s]
    """

    def __init__(self, model) -> None:
        self.model, self.tanks = model, []
        case = model.case
        for name, mesh in {**case.meshes, **case.lumped}.items():
            from fvsolve.case.bodies import free_joints

            basin = case.nodes[name]
            modal = basin.on is not None and basin.sloshing == "modes"
            free = (
                basin.on is not None
                and basin.physics_type.has_modes
                and any(free_joints(basin.on, case.nodes))
            )
            if modal or (free and not basin.lumped):
                place = np.array(basin.place) + basin.rotation[:, :2] @ mesh.centroid
                about = frames_of(model).index(basin.on), place, basin.rotation[:, 2]
                self.tanks.append((name, modal, about, *(rises(model, name) if modal else ())))
        self.restart_data = np.zeros((len(self.tanks), 4))

    def check(self, t: float, y: np.ndarray) -> str:
        """Check state y at time t [s], and update the record; returns the reason to stop the run, or ""."""
        if not self.tanks:
            return ""
        out = self.model.evaluate(t, y)[1]
        for (name, modal, about, *lifting), record in zip(
            self.tanks, self.restart_data, strict=True
        ):
            if modal:
                keep_greatest(record[RISE], rise(y, *lifting), t)
            weight, reference = self.weight(out, *about, modal)
            if weight <= WEIGHT_ROUNDING * reference:
                when = f"t = {self.model.case.moment(t)}"
                return f"stopped: {STATUS_FAILURES[rec.NO_WEIGHT].format(name=name, when=when)}"
            keep_greatest(record[LOSS], abs(weight / reference - 1.0), t)
        return ""

    def weight(
        self, out: np.ndarray, i: int, place: np.ndarray, normal: np.ndarray, modal: bool
    ) -> tuple[float, float]:
        """(effective gravity along the normal of a basin's bed, gravity that its waves use) [m/s2].

        out : output array of the right-hand side; i : number of the body; place, normal : centre of the basin [m] and
        unit normal of its bed in the axes of the body; modal : True for sloshing modes
        """
        from fvsolve.core.kernels import moving_frames as frame
        from fvsolve.core.kernels.dtypes import BODY_OUT

        row = out[int(self.model.layout["body"]) + BODY_OUT * i :][:BODY_OUT]
        turn, gravity = row[frame.ATTITUDE :][:9].reshape(3, 3), self.model.case.gravity
        spin = row[frame.SPIN :][:3]
        arm = turn @ place
        up = turn @ normal
        down = np.cross(spin, np.cross(spin, arm)) + (0.0, 0.0, gravity)
        weight, reference = (
            up @ (row[a:][:3] + np.cross(row[b:][:3], arm) + down)
            for a, b in (
                (frame.ACCELERATION, frame.SPIN_RATE),
                (frame.BIAS, frame.SPIN_BIAS),
            )
        )
        return float(weight), gravity if modal else float(reference)

    def notices(self) -> list[Notice]:
        """Notices for waves that were not small, and for changes of weight that the waves neglect."""
        notices, moment = [], self.model.case.moment
        rows = zip(self.tanks, self.restart_data.tolist(), strict=True)
        for (name, *_), (height, rise_time, change, change_time) in rows:
            if height > SMALL_WAVE:
                text = f"{name}: at {moment(rise_time, 4)} its water rises by {height:.2g} of its depth, but "
                text += 'modes are linear; sloshing = "cells" computes high waves of shallow water'
                notices.append(
                    Notice("sloshing", f"nodes.{name}", text, "sloshing", height, SMALL_WAVE)
                )
            if change > WEIGHT_CHANGE:
                text = f"{name}: at {moment(change_time, 4)} the vertical acceleration of its body changes the "
                text += f"weight of its water by a fraction of {change:.2g}; the waves do not include this change"
                notices.append(Notice("weight", f"nodes.{name}", text, None, change, WEIGHT_CHANGE))
        return notices


def rises(model, name: str) -> tuple:
    """Arguments `at`, `start`, `lifts` and `is_round` of the function `rise` for the basin `name`."""
    from fvsolve.case import sloshing

    case = model.case
    basin, mesh = case.nodes[name], case.lumped[name]
    modes = sloshing.modes_of(basin, mesh, case.properties.density, case.gravity)
    rows = [coordinate_of(model, sloshing.mode_body_name(name, mode)) for mode in modes]
    lifts = np.zeros((2, len(modes)))
    lifts[[mode.along for mode in modes], range(len(modes))] = [mode.rise for mode in modes]
    at, start = [row.y for row in rows], np.array([row.position for row in rows])
    return (
        np.array(at),
        start,
        lifts / sloshing.depth_of(basin, mesh),
        sloshing.outline_of(mesh).is_round,
    )


def rise(
    y: np.ndarray, at: np.ndarray, start: np.ndarray, lifts: np.ndarray, is_round: bool
) -> float:
    """Greatest rise of the water at the wall of a basin, as a fraction of its depth.

    at : int64[modes]  indices of the amplitudes of the sloshing modes in the state y
    start : float64[modes]  initial amplitudes
    lifts : float64[2, modes]  rise per amplitude over the depth, of modes along and across the basin
    is_round : True for a round basin, where the rises in both directions add up as a vector
    """
    along, across = np.abs(lifts @ (start + y[at]))
    return float(np.hypot(along, across)) if is_round else float(along + across)


def keep_greatest(record: np.ndarray, value: float, t: float) -> None:
    """Store `value` and its time t [s] in `record` if it is greater than the value there."""
    if value > record[0]:
        record[:] = value, t


# number of checks in a run of explicit steps, of implicit steps
EXPLICIT_CHECKS, IMPLICIT_CHECKS = 32, 16
# Least number of explicit steps between two checks, which costs a twentieth; least number of checks in short runs.
STEPS_BETWEEN_CHECKS, FEWEST_CHECKS = 50.0, 8
LEAST_RANGE = 0.1  # least range of a state, in units of its small deviation
# fraction of a full step: steps that an event or a kink has shortened are not checked
FULL_STEP = 0.99
PEAK_SHARE = 0.1  # weight of the greatest error in cells beside the mean error
STEP_ROUNDING = 1e-10  # relative to ranges: a smaller error is too small to measure r


class StepDoubling:
    """Estimate of the error of a run with steps of given length.

    It checks states outside cells under an explicit method, where the Courant limit bounds the errors of cells, and all
    states under an implicit method, or if the steps exceed a limit of cells (`over_limit`); states of delay lines are
    left out. Without such states, or without a given step within the limits of cells, there is no check.

    restart_data : float64[4 + 6 k]  number of checks, step count of the next check, step count of the last check,
    fraction r of an error that a step leaves; then six arrays over the k checked states: error of the last checked
    step, accumulated error, sum of the accumulated errors over the checks, least value, greatest value, greatest
    accumulated error
    """

    def __init__(self, run_data) -> None:
        model, self.step = run_data.model, float(run_data.clock["step"])
        numerics = model.case.numerics
        method = method_named(automatic.first_method(numerics.method))
        # their states do not affect other states
        lines = model.tables.pipes["y"][model.tables.pipes["cells"] == 0]
        self.over_limit = exceeds_limit_of_cells(model)
        outside = states_outside_cells(model)
        all_states = self.over_limit or not method.explicit
        states = np.setdiff1d(np.arange(model.y_size), lines) if all_states else outside
        self.model, self.states = model, states[: None if self.step > 0.0 or self.over_limit else 0]
        self.in_cells = ~np.isin(self.states, outside) & self.over_limit
        self.restart_data = np.zeros(4 + 6 * self.states.size)
        rows = self.restart_data[4:].reshape(6, -1)
        self.error, self.accumulated_error, self.sums, self.least, self.greatest, self.peaks = rows
        self.least[:] = self.greatest[:] = model.start[self.states]
        self.restart_data[3], self.stepper, self.implicit = 1.0, None, not method.explicit
        if self.states.size:
            size = self.step or first_step(model)
            # no wave sets the first step: their number is not known
            dry = STEPS_BETWEEN_CHECKS * EXPLICIT_CHECKS
            steps = (numerics.end - numerics.start) / size if size > 0.0 else dry
            self.interval = max(1.0, steps // IMPLICIT_CHECKS)
            if method.explicit:
                self.interval = max(
                    1.0, steps // EXPLICIT_CHECKS, min(STEPS_BETWEEN_CHECKS, steps // FEWEST_CHECKS)
                )
            self.restart_data[1], self.small = (
                self.interval,
                state_ranges(model, LEAST_RANGE)[self.states],
            )

    def begin(self, steps: float) -> None:
        """Order a check of the first step of a segment if the method is implicit, or the steps exceed a limit of cells.

        An implicit method stays stable there, however great the change at the start of the segment. A segment of a run
        beyond the limit may have a single step.
        steps : number of steps at the start of the segment
        """
        if self.states.size and (self.implicit or self.over_limit):
            self.restart_data[1] = steps + 1.0

    def steps_left(self, steps: float) -> float:
        """Number of steps until the next check; steps : number of steps taken so far."""
        return max(1.0, self.restart_data[1] - steps) if self.states.size else np.inf

    def check(self, loop) -> None:
        """Repeat the last step as two half steps if a check is due; `loop` is a `RunLoop` at an accepted state."""
        memory = loop.state
        steps, h = memory["steps"], memory["last"]
        if not self.states.size or steps < self.restart_data[1]:
            return
        # check the next step if this step cannot be checked, unless most steps are divided
        divided = 0.0 < loop.control["dividing_rate"] < loop.out[rec.RATE]
        self.restart_data[1] = steps + (self.interval if divided else 1.0)
        end = loop.control["end"]
        # 0: any step is checked
        full_step = self.step if loop.t < end else min(self.step, end - memory["t_mark"])
        # A step in which a jump in a delay line corrected contents of storing nodes or flows of columns is not checked,
        # because half steps have no such correction. The mark is removed when the corrected state is recorded again.
        # Neither is a step that ends at an event, because half steps would follow the equations after it.
        corrected = any(own.corrected_at(loop.t) for own in loop.run_data.features)
        if h < FULL_STEP * full_step or corrected or loop.last_switch == loop.t:
            return
        before, now = loop.before[self.states], loop.now[self.states]
        t = loop.t - h
        middle = self.single_step(loop, t, loop.before, 0.5 * h, first=True)
        half_steps = self.single_step(loop, t + 0.5 * h, middle, 0.5 * h)
        if not np.all(np.isfinite(half_steps)):  # the half steps cannot be computed
            if self.over_limit:
                self.peaks[self.in_cells] = np.inf
            return
        for state in (before, now):
            np.fmin(self.least, state, out=self.least)
            np.fmax(self.greatest, state, out=self.greatest)
        with np.errstate(over="ignore", invalid="ignore"):  # states that grow may overflow
            self.accumulate(loop, h, steps - self.restart_data[2], half_steps - loop.now)
        self.restart_data[:3] = self.restart_data[0] + 1.0, steps + self.interval, steps

    def accumulate(self, loop, h: float, steps: float, error: np.ndarray) -> None:
        """Add the errors of the steps since the last check to the accumulated errors.

        loop : the `RunLoop`; h : length of the last step [s]; steps : number of steps since the last check
        error : float64[n]  error of the last step
        For each step between the two checks, the lesser of the errors at this check and at the last check is added.
        """
        widths, own = self.widths(), np.abs(error[self.states])
        size = float(np.linalg.norm(own / widths))
        if size > STEP_ROUNDING:
            moved = self.single_step(loop, loop.t - h, loop.before + error, h) - loop.now
            remaining = float(np.linalg.norm(moved[self.states] / widths)) / size
            self.restart_data[3] = remaining if remaining < 1.0 else 1.0
        remaining = self.restart_data[3]
        power = remaining ** (steps - 1.0)
        sum_of_powers = (
            steps - 1.0 if remaining > 1.0 - STEP_ROUNDING else (1.0 - power) / (1.0 - remaining)
        )
        self.accumulated_error[:] = (
            remaining * (power * self.accumulated_error + sum_of_powers * np.fmin(own, self.error))
            + own
        )
        self.error[:] = own
        self.sums += self.accumulated_error
        np.fmax(self.peaks, self.accumulated_error, out=self.peaks)

    def single_step(self, loop, t: float, y: np.ndarray, h: float, first=False) -> np.ndarray:
        """State after one step of length h [s] from state y at time t [s], with the method of the run.

        loop : the `RunLoop`; first : True to discard the stored Jacobian, for the first step from a new state
        """
        if self.stepper is None:
            model = self.model
            self.stepper = Integrator(
                loop.stepper.method,
                model.y_size,
                model.ledgers,
                lambda: model.structure,
                model.scale.copy(),
                model.damped,
            )
            self.stepper.out = model.new_out()
        if first:
            self.stepper.discard_history()
        self.stepper.control[0] = loop.control
        return self.stepper.single_step(
            loop.rhs, loop.run_data.handle, int(self.model.layout["supply"]), t, h, y
        )

    def widths(self) -> np.ndarray:
        """Greatest minus least value so far of each checked state, at least its `state_ranges` with the share 0.1."""
        return np.maximum(self.greatest - self.least, self.small)

    def worst(self) -> tuple[str, float]:
        """Name of the state with the greatest error, without its cell, and its mean error over the range of the state.

        The result is ("", 0) before the first check.
        """
        if not self.restart_data[0]:
            return "", 0.0
        share = self.sums / self.restart_data[0] / self.widths()
        share[np.isnan(share)] = np.inf
        share[self.in_cells] = 0.0
        at = int(np.argmax(share))
        return self.model.state_names[self.states[at]].partition("[")[0], float(share[at])

    def worst_in_cells(self) -> float | None:
        """Mean error of a state in cells over its range, if the steps exceed a limit of cells; otherwise None.

        A tenth of the greatest error counts where it is more than the mean: an event may be near the end of the run. A
        front that passes a cell gives a greatest error of 5 % and a small mean.
        """
        if not self.in_cells.any():
            return None
        mean = self.sums / max(1.0, self.restart_data[0])
        share = (np.fmax(mean, PEAK_SHARE * self.peaks) / self.widths())[self.in_cells]
        return float(np.nan_to_num(share, nan=np.inf).max())

    def notice(self) -> Notice | None:
        """Notice at the end of a run if the mean error is 0.5 % or more of the range of a state, otherwise None."""
        place, share = self.worst()
        # a state that is not finite has stopped the run
        if not DOUBTFUL <= share < np.inf or not self.step:
            return None
        ok = share < WRONG
        verdict = "the results may be wrong" if ok else "the numbers are not to be trusted"
        steps = self.model.case.step_amount(self.step)
        text = (
            f"{place}: steps of {steps} give a mean error of about {100 * share:.2g} % of its range, by "
            f"comparison with two half steps; {verdict}; halve the step"
        )
        key = "step" if self.model.case.numerics.step is not None else "courant"
        return Notice("step-error", place, text, key, share, WRONG, ok)
