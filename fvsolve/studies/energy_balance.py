"""Energy balance of a run: supplied, stored and dissipated energy in each step, and energy changed by the method."""

import functools
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fvsolve.argument_checks import FUNCTION, TABLE, TEXT, validated
from fvsolve.core.model.energy_accounts import Account, Accounts, available_energy, datum_of
from fvsolve.core.output.result_table import Column
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.solve.solve import Run
from fvsolve.core.steppers import automatic, loop_records
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, FvsolveError, did_you_mean
from fvsolve.features.delay_lines.feature import history_of, lines_of
from fvsolve.features.delay_lines.history import jump_times
from fvsolve.features.delay_lines.kernels.wave_history import JUMPS_TRAVELLING, time_tolerance
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.file_replacement import write_file
from fvsolve.studies.outcome import RowSink, end_if_interrupted, refusal_text, study_model
from fvsolve.studies.passivity import AUTO, check_names, method_names
from fvsolve.studies.result_cache import ResultCache

TABLE_ROWS = 1000  # approximate number of rows of the table
# allowed quadrature error of the dissipated energy in a step, relative to its total
QUADRATURE_TOLERANCE = 1e-3
LEAST, MOST = 0.1, 8.0  # limits of the factor on the step for that tolerance
LEAST_LIMIT = 1e-12  # least limit of the step, relative to the time
ACCEPTED_CODES = (  # status codes of the loop after an accepted step
    loop_records.BUDGET_SPENT,
    loop_records.DONE,
    loop_records.ROWS_FULL,
    loop_records.FIELD,
    loop_records.STOPPED,
)


class EnergyLoop(RunLoop):
    """Run loop that adds up the energies of all accounts over accepted steps, from the powers at their stages."""

    def watch(self, accounts: Accounts, on_step) -> None:
        """Start to add up the energies of `accounts`; on_step() is called after every accepted step."""
        self.accounts, self.on_step = accounts, on_step
        # ledger lines, then the Newton residual
        self.total, self.carry = np.zeros((2, len(accounts.accounts) + 1))
        lines = (
            np.array(accounts.of(category), dtype=int)
            for category in ("supplied", "rate", "dissipated")
        )
        self.supplied, self.rates, self.dissipated_lines = lines
        self.longest = float(self.control["step_max"])
        self.dydt, self.out_work = np.zeros(self.model.y_size), self.model.new_out()
        self.control["allow_fused"] = 0  # fused steps store no stages

    def run(self, budget: float) -> int:
        """Take up to `budget` steps, and add the energy of each accepted step; returns the status code of the loop."""
        code = super().run(0.0)
        left = budget
        armed = self.armed
        while (
            code == loop_records.BUDGET_SPENT
            and left > 0.0
            and not automatic.is_change_due(self.stepper)
        ):
            t = self.t
            y = self.now.copy()
            rules = armed.copy()
            first_values = self.stepper.k[0].copy(), self.stepper.ledger_rates[0].copy()
            steps = self.state["steps"]
            code, left = super().run(1.0), left - 1.0
            if self.state["steps"] > steps and code in ACCEPTED_CODES:
                after = armed.copy()
                self.run_data.use_flags(rules)  # those of the right-hand side of this step
                self.add(
                    self.released_stops(t, y, self.step_energy(t, y, *first_values))
                    + self.jump_correction(t, y)
                )
                self.run_data.use_flags(after)
                self.on_step()
        return code

    def power(self, t: float, y: np.ndarray) -> np.ndarray:
        """Power [W] of every energy account at (t, y) : float64[accounts]; also writes `dydt` and `out_work`."""
        return self.accounts.power_at(t, y, self.dydt, self.out_work)

    def tableau(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(coefficients : float64[s, s], weights : float64[s], times : float64[s]) of the s stages of a step.

        Times are fractions of the step. The first stage is the start of the step, for implicit methods too.
        """
        s = self.stepper.k.shape[0]
        a, b, c = (
            self.stepper.coefficients[i : i + n]
            for i, n in ((0, s * s), (s * s, s), (s * s + s, s))
        )
        return a.reshape(s, s), b, c

    def step_energy(
        self, t: float, y: np.ndarray, first: np.ndarray, supply: np.ndarray
    ) -> np.ndarray:
        """Energy [J] that the step from (t, y) adds to every account; the last entry is that of the Newton residual.

        first, supply : slope dy/dt and ledger rates, such as the supply of a node [kg/s], of the first stage at (t, y)
        The next step is limited by `limit_next`, except under Rosenbrock methods.
        """
        stepper, h = self.stepper, float(self.state["last"])
        (a, b, c), total = self.tableau(), np.zeros_like(self.total)
        k = np.vstack([first, stepper.k[1:]])
        supplies = np.vstack([supply, stepper.ledger_rates[1:]])
        if stepper.method.kind == "linear":
            total[:-1] = b @ self.linearly_implicit(t, y, h, a, c, k)
            return h * total
        s = b.size
        by_error = self.control["mode"] == loop_records.TOLERANCE and stepper.method.kind != "full"
        # weights of the error estimate
        error = stepper.coefficients[s * s + 2 * s : s * s + 3 * s] * by_error
        quadrature_error = np.zeros_like(total)
        for i in np.flatnonzero((b != 0.0) | (error != 0.0)):
            power = self.stage(t + c[i] * h, y + h * (a[i] @ k), k[i], supplies[i])
            total += b[i] * power
            quadrature_error += error[i] * power
        lost = np.abs((self.total + h * total)[self.dissipated_lines]).sum()
        self.limit_next(h, h * np.abs(quadrature_error[self.dissipated_lines]).sum(), lost)
        return h * total

    def limit_next(self, h: float, off: float, lost: float) -> None:
        """Limit the next step so that the quadrature error of the dissipated energy stays small.

        h : this step [s]; off : quadrature error in this step [J]; lost : dissipated energy so far [J]
        The error is to stay below a thousandth of `lost`. The limit is 0.1 to 8 times h, also without error control,
        and at least LEAST_LIMIT times the time: a step between two events may be one rounding error long.
        The error control of states does not cover this error: for states that are parabolas in time, a method of order
        two is exact, but the integral of the power is not.
        """
        grow = MOST
        if off > 0.0:
            grow = min(
                MOST, 0.9 * (QUADRATURE_TOLERANCE * lost / off) ** (1.0 / self.control["order"])
            )
        least = LEAST_LIMIT * max(abs(self.t), abs(float(self.control["end"])))
        self.control["step_max"] = min(self.longest, max(h * max(LEAST, grow), least))

    def jump_correction(self, t: float, y: np.ndarray) -> np.ndarray:
        """Correction [J] of the energies of the step from (t, y) for jumps of waves in delay lines within the step.

        The power at a stage is the power before or after a jump, so that the weights of the stages place the jump at a
        wrong time. Returns the correction for every energy account; the last entry is that for the Newton residual.
        """
        past = history_of(self.run_data)
        total = np.zeros_like(self.total)
        h = self.t - t
        if not past.size or past[JUMPS_TRAVELLING] == 0.0:
            return total
        (_, b, c), separation = self.tableau(), time_tolerance(past)
        if self.stepper.method.kind == "linear":
            # b: weights of the powers at the stages in the energy
            big_c, _, gamma = self.rosenbrock_coefficients()
            b = np.append(
                0.0, np.linalg.solve((np.eye(b.size - 1) - gamma * big_c[1:, 1:]).T, gamma * b[1:])
            )
        begin, end = t + min(0.0, float(c.min())) * h, t + max(1.0, float(c.max())) * h
        for jump_time in jump_times(past, lines_of(self.model), begin, end):
            sides = jump_time - 2.0 * separation, jump_time + 2.0 * separation
            before, after = (
                self.power(time, y + (time - t) / h * (self.now - y)) for time in sides
            )
            booked = h * float(b[t + c * h >= jump_time - separation].sum())
            total[:-1] += (after - before) * (min(h, max(0.0, self.t - jump_time)) - booked)
        return total

    def stage(self, t: float, y: np.ndarray, slope: np.ndarray, supply: np.ndarray) -> np.ndarray:
        """Power [W] of every energy account at a stage; the last entry is that of the Newton residual.

        t, y, slope, supply : time, state, slope dy/dt and ledger rates of the stage, such as supplies of nodes [kg/s]
        Newton iterations of an implicit method end at a slope near to the rates f(t, y). Supplied and stored powers use
        `slope` and `supply` of the stage, other accounts use f. The difference between supplied power and rate of
        storage that this causes is the power of the Newton residual.
        """
        power, values = self.power(t, y), self.out_work
        if self.stepper.method.explicit:
            return np.concatenate((power, (0.0,)))
        position = int(self.model.layout["supply"])
        values[position : position + supply.size] = supply
        change = self.accounts.power_by(t, y, slope, values) - power
        for line_range in (self.supplied, self.rates):
            power[line_range] += change[line_range]
        return np.concatenate((power, (change[self.supplied].sum() - change[self.rates].sum(),)))

    def rosenbrock_coefficients(self) -> tuple[np.ndarray, np.ndarray, float]:
        """(C : float64[s, s], d : float64[s], gamma) of a Rosenbrock method with s stages, see `steppers/ros.py`."""
        s = self.stepper.k.shape[0]
        coefficients = self.stepper.coefficients[s * s + 3 * s :]
        return (
            coefficients[: s * s].reshape(s, s),
            coefficients[s * s : s * s + s],
            float(coefficients[s * s + s]),
        )

    def linearly_implicit(self, t: float, y: np.ndarray, h: float, a, c, k) -> np.ndarray:
        """Stage values w of the energy accounts in a Rosenbrock step from (t, y) : float64[s, accounts] [W].

        The energies z of the accounts, with dz/dt = P(t, y) and P the powers, are integrated like further states:
        w_i = gamma (P(t + c_i h, U_i) + P_y h k_i + d_i h P_t + sum over j < i of C_ij w_j),
        with stage values U_i = y + h sum a_ij k_j and stage slopes k_i; w_0 of the start of the step is zero.
        a, c : coefficients and times of `tableau`; C, d, gamma : see `rosenbrock_coefficients`
        The derivatives P_y and P_t are computed by differences.
        """
        s, (big_c, late, gamma) = len(c), self.rosenbrock_coefficients()
        per = 1e-3 * h
        eps = 1e-3
        slope = 0.0
        if t + per > t:  # otherwise the step is so short that the term is negligible
            slope = (
                4.0 * self.power(t + per, y) - 3.0 * self.power(t, y) - self.power(t + 2.0 * per, y)
            ) / (2.0 * per)
        w = np.zeros((s, len(self.total) - 1))
        for i in range(1, s):
            step = eps * h * k[i]
            along = (self.power(t, y + step) - self.power(t, y - step)) / (2.0 * eps)
            stage = self.power(t + c[i] * h, y + h * (a[i] @ k))
            w[i] = gamma * (stage + along + late[i] * h * slope + big_c[i, 1:i] @ w[1:i])
        return w

    def released_stops(self, t: float, y: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Correct the energies `part` of the step from (t, y) for end stops whose contact opens within the step.

        Returns `part`, which is changed. The stored energy changes by the exact difference between the ends of the
        step; the remainder is dissipated. The rate of the stored energy has a kink where the contact force ends, which
        stage values do not resolve.
        """
        lines = self.accounts.contacts
        if not lines:
            return part
        travels = [stop_travels(self.model, *state) for state in ((t, y), (self.t, self.now))]
        for k, ((rate, loss), stop) in enumerate(
            zip(lines, motion_of(self.model).stop_table, strict=True)
        ):
            was, leaves_before = stop_compression(stop, *travels[0][k])
            now, leaves_after = stop_compression(stop, *travels[1][k])
            if leaves_before or leaves_after:
                change = 0.5 * float(stop["stiffness"]) * (now - was) * (now + was)
                part[loss] += part[rate] - change
                part[rate] = change
        return part

    def add(self, part: np.ndarray) -> None:
        """Add the energies `part` of a step to the totals, with compensated (Kahan) summation."""
        corrected = part + self.carry
        new = self.total + corrected
        self.carry = corrected - (new - self.total)
        self.total = new


def stop_travels(model, t: float, y: np.ndarray) -> np.ndarray:
    """Travel [m] and speed [m/s] of the body at every end stop, at the state (t, y) : float64[stops, 2]."""
    out, motion = model.evaluate(t, y)[1], motion_of(model)
    first = int(model.layout["travel"]) + 2 * len(motion.brace_table)
    return out[first : first + 2 * len(motion.stop_table)].reshape(-1, 2)


def stop_compression(stop, x: float, speed: float) -> tuple[float, bool]:
    """(compression of an end stop [m], at least 0; True if the body moves away from it without a contact force).

    stop : row of the table of stops; x : travel of the body [m]; speed : its speed [m/s]
    """
    above, below = x - stop["above"], -stop["below"] - x
    depth, faster = (above, speed) if above > below else (below, -speed)
    leaves = faster < 0.0 and stop["stiffness"] * depth + stop["damping"] * faster <= 0.0
    return max(0.0, float(depth)), bool(leaves)


class EnergyRun(Run):
    """Run that records the energies of all accounts after every step, and the rows of the table of energies."""

    loop_type = EnergyLoop

    def __init__(self, model, state, sink, progress) -> None:
        super().__init__(model, state, sink, progress)
        self.accounts = Accounts(self.run_data)
        self.loop.watch(self.accounts, self.on_step)
        self.times, self.totals, self.holdings = [self.loop.t], [self.loop.total.copy()], []
        self.first = self.stored_energy()
        self.holdings.append(np.zeros_like(self.first))
        # energy lost by columns in impacts [J]
        self.impact_losses = np.zeros(len(model.column_names))
        self.losses = [self.impact_losses.copy()]
        self.every = (self.end - self.start) / TABLE_ROWS
        self.step_times, self.step_totals = [self.loop.t], [self.loop.total.copy()]

    def stored_energy(self) -> np.ndarray:
        return self.accounts.stored_at(self.loop.t, self.loop.now)

    def on_step(self) -> None:
        """Record the energies since the start after a step, and a row of the table if one is due."""
        self.step_times.append(self.loop.t)
        self.step_totals.append(self.loop.total.copy())
        if self.loop.t >= self.times[-1] + self.every or self.loop.t >= self.end:
            self.add_row()

    def add_row(self) -> None:
        self.times.append(self.loop.t)
        self.totals.append(self.loop.total.copy())
        self.holdings.append(self.stored_energy() - self.first)
        self.losses.append(self.impact_losses.copy())

    def stop_columns(self) -> None:
        """Stop rigid columns that collide or can no longer flow; add the lost kinetic energy to the losses (Carnot)."""
        before = self.flows()
        super().stop_columns()
        columns, rho = self.model.tables.columns, self.model.case.properties.density
        self.impact_losses += (
            0.5 * (before - self.flows()) ** 2 * columns["length"] / (rho * columns["area"])
        )

    def flows(self) -> np.ndarray:
        """Mass flows of rigid columns [kg/s]."""
        columns = self.model.tables.columns
        return columns["flow"] + self.loop.now[columns["y"]]


ROUNDING = 1e-12  # fraction of the energy throughput below which a remainder is rounding
# kinds omitted in names of ledger lines
IMPLIED_KINDS = ("valve", "pump", "damper", "pipe", "chamber", "tank")


@dataclass(frozen=True)
class Port:
    """Passivity at a port: the network may not return more energy than it had at the start and received elsewhere.

    Condition (2) of docs/course.md: E0 + W + O >= 0 at the end of every step. E0 is the available energy at the start,
    W the energy supplied at the port, and O the energy supplied by other ports. Heights are measured from the port.
    W is the integral over time of p q under the density law `linear`, with the gauge pressure p and the flow q into the
    network. Under other density laws it is that of M (h - h_ambient), with the mass flow M and the enthalpy h.
    node : name of the port; at_start : E0 [J]
    work : least value of W [J], reached at `time` [s]
    margin : least value of E0 + W + O [J], reached at `t_margin` [s]; others : O at that time [J]
    passive : True if the condition holds up to rounding
    course, bound : float64[k]  W and -(E0 + O) [J] at the times `Energy.t`
    text : verdict as a sentence, in the units of `[output]`
    """

    node: str
    work: float
    time: float
    at_start: float
    others: float
    margin: float
    t_margin: float
    passive: bool
    course: np.ndarray
    bound: np.ndarray
    text: str = ""

    def plain(self) -> dict:
        """Plain values for JSON, without the arrays."""
        return {name: value for name, value in vars(self).items() if np.ndim(value) == 0}


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run: energies since the start of the run [J], at k times.

    reason : reason for the end of the run; ok : True if the run reached its end time
    t : float64[k]  start of the run, then ends of steps, at least a thousandth of the run apart except the last [s]
    supplied, stored, dissipated : {"PART" or "PART KIND": float64[k]}; stored energy is the change since the start
    scheme : {"PART": float64[k]}  energy removed by the discretisation of a pipe or basin in space, or by a delay line
    law : {"PART": float64[k]}  energy removed by a law of a part that conserves energy only approximately
    step : float64[k]  energy removed by the time steps; newton : float64[k]  energy of Newton residuals
    remainder : float64[k]  supplied - stored - dissipated, the sum of scheme, law, step and newton; positive if the
    numerical method dissipates energy, negative if it creates energy
    at_start : {"PART": available energy at the start [J]}; datum : elevation of zero height [m]
    settings : scheme, method, step control and number of cells of the run; steps : number of steps
    marks : texts on conditions outside the validity of the model, with the times from which on energies are not
    reliable
    port : passivity at a port, if checked
    energy_use : electric energy of pumps and its cost, as in the summary of a run; empty without `[energy]`
    """

    reason: str
    ok: bool
    t: np.ndarray
    supplied: dict[str, np.ndarray]
    stored: dict[str, np.ndarray]
    dissipated: dict[str, np.ndarray]
    scheme: dict[str, np.ndarray]
    law: dict[str, np.ndarray]
    step: np.ndarray
    newton: np.ndarray
    remainder: np.ndarray
    at_start: dict[str, float]
    datum: float
    settings: dict[str, object]
    steps: int
    marks: list[str]
    port: Port | None = None
    energy_use: dict[str, object] = field(default_factory=dict)

    @property
    def throughput(self) -> float:
        """Energy throughput [J]: greatest sum, at any time, of the energy supplied by ports and released by parts."""
        total = np.zeros(len(self.t))
        for values in self.supplied.values():
            total += np.maximum(values, 0.0)
        for values in self.stored.values():
            total += np.maximum(-values, 0.0)
        return float(total.max(initial=0.0))

    @property
    def numerical_remainder(self) -> np.ndarray:
        """Energy removed by scheme, law and time steps, without Newton residuals : float64[k] [J]."""
        return self.remainder - self.newton

    @property
    def relative(self) -> float:
        """Magnitude of `numerical_remainder` at the end of the run over `throughput` [-]; 0 without throughput."""
        return (
            0.0
            if self.throughput == 0.0
            else float(abs(self.numerical_remainder[-1]) / self.throughput)
        )

    @property
    def newton_counts(self) -> bool:
        """True if the energy of Newton residuals exceeds rounding errors at any time."""
        return bool(np.max(np.abs(self.newton)) > ROUNDING * self.throughput)

    @property
    def verdict(self) -> str:
        """Effect of the numerical method on the energy at the end of the run: dissipates, creates, or rounding only.

        Newton residuals do not count, because they are not a property of scheme and method.
        """
        if self.relative <= ROUNDING:
            return "rounding"
        return (
            "the numbers dissipate"
            if self.numerical_remainder[-1] > 0.0
            else "the numbers create energy"
        )

    def numerical(self) -> dict[str, np.ndarray]:
        """Remainder by cause, as float64[k] [J]: "scheme", "law", "step", "newton", and their sum "remainder".

        Causes that are always zero are left out, as is "newton" if it never exceeds rounding errors.
        """
        zeros = np.zeros(len(self.t))
        causes = {
            "scheme": sum(self.scheme.values(), zeros),
            "law": sum(self.law.values(), zeros),
            "step": self.step,
            "newton": self.newton if self.newton_counts else zeros,
        }
        return {name: values for name, values in causes.items() if values.any()} | {
            "remainder": self.remainder
        }

    def plain(self) -> dict:
        """Plain values for JSON: energies at the end of the run, verdict, settings, and passivity at the port."""
        lines = {
            json_name: {name: float(values[-1]) for name, values in getattr(self, kind).items()}
            for kind, json_name in JSON_NAMES.items()
        }
        port = None if self.port is None else self.port.plain()
        return {
            "reason": self.reason,
            "ok": self.ok,
            "t": float(self.t[-1]),
            "steps": self.steps,
            **self.settings,
            **lines,
            "step_loss": float(self.step[-1]),
            "newton_loss": float(self.newton[-1]),
            "remainder": float(self.remainder[-1]),
            "through": self.throughput,
            "relative": self.relative,
            "verdict": self.verdict,
            "datum": self.datum,
            "at_start": self.at_start,
            "marks": self.marks,
            "port": port,
            **({"energy_use": self.energy_use} if self.energy_use else {}),
        }


JSON_NAMES = {
    "supplied": "supplied",
    "stored": "stored",
    "dissipated": "dissipated",
    "scheme": "scheme_loss",
    "law": "law_loss",
}


@declared("study")
@validated(set=TABLE, port=TEXT, progress=FUNCTION)
def energy(case, set=None, port: str | None = None, progress=None) -> Energy:
    """Run a case with changed keys and compute its energy balance; `case` as for `run`, or a Model.

    port : a reservoir, inflow or junction, at which condition (2) of passivity is checked (see `Port`)
    set : key -> value, ignored for a Model; progress : called as progress(t, seconds, steps)
    A run that fails or is interrupted gives the balance up to its end. Raises CaseError for an invalid case, and
    FvsolveError for an unknown port and for a case whose energy is not computed (see `Accounts`).
    """
    model = study_model(case, set) if not hasattr(case, "tables") else case
    check_port(model.case, port)
    settings = model.tables.settings.copy()
    settings["datum"] = datum_of(model, port)
    model = replace(model, tables=model.tables._replace(settings=settings))
    run = EnergyRun(model, initial_state(model), RowSink(), progress)
    summary = run.go()
    if run.times[-1] < run.loop.t:
        run.add_row()
    return ledger(run, summary, port)


def ledger(run: EnergyRun, summary, port: str | None) -> Energy:
    """Energy balance of a finished run, from its recorded energies; summary : its `Summary`; port : as in `energy`."""
    accounts = run.accounts
    totals = np.array(run.totals)
    holdings = np.array(run.holdings)
    kinds = ("supplied", "dissipated", "scheme", "law")
    lines = {kind: lines_by_name(accounts.accounts, kind, totals) for kind in kinds}
    stored = lines_by_name(accounts.stored_accounts, "stored", holdings)
    impact_losses = np.array(run.losses)
    for name, column in zip(run.model.column_names, impact_losses.T, strict=True):
        if column.any():
            lines["dissipated"][f"{name} stopped dead"] = column
    zeros, stored_sum = np.zeros(len(run.times)), holdings.sum(axis=1)
    supplied, dissipated = (sum(lines[kind].values(), zeros) for kind in ("supplied", "dissipated"))
    numerics = run.model.case.numerics
    settings = {
        key: getattr(numerics, key) for key in ("scheme", "method", "courant", "step", "rtol")
    }
    reason = "interrupted" if summary.reason.startswith("interrupted") else summary.reason
    return Energy(
        reason,
        summary.finished,
        np.array(run.times),
        lines["supplied"],
        stored,
        lines["dissipated"],
        lines["scheme"],
        lines["law"],
        totals[:, accounts.of("rate")].sum(axis=1) - impact_losses.sum(axis=1) - stored_sum,
        totals[:, -1],
        supplied - stored_sum - dissipated,
        available_energy(run.model),
        float(run.model.tables.settings[0]["datum"]),
        settings | {"cells": run.model.cells},
        summary.steps,
        [
            f"{mark.text}: the energy balance from {run.model.case.moment(mark.time)} "
            "on is not to be trusted"
            for mark in summary.marks
        ],
        None if port is None else port_verdict(run, port),
        summary.energy_use,
    )


def lines_by_name(accounts: list[Account], kind: str, columns: np.ndarray) -> dict[str, np.ndarray]:
    """Energies [J] of the accounts of a category that are not always zero : "PART" or "PART KIND" -> float64[rows].

    The kind is stated for dissipated energy, except for the kinds that the part implies (`IMPLIED_KINDS`), and for flow
    over the rim. Energies of accounts with the same name are added.
    kind : category, such as "dissipated"; columns : float64[rows, accounts]  energies of all accounts [J]
    """
    lines = {}
    for k, account in enumerate(accounts):
        if account.category == kind and columns[:, k].any():
            several = (
                kind == "dissipated"
                and account.kind not in IMPLIED_KINDS
                or account.kind == "over the rim"
            )
            name = f"{account.place} {account.kind}" if several else account.place
            lines[name] = lines.get(name, 0.0) + columns[:, k]
    return lines


def check_port(case, port: str | None) -> None:
    """Raise FvsolveError if `port` is not a reservoir, inflow or junction of the case; None is accepted."""
    ports = [name for name, node in case.places.items() if node.driven is not None]
    if port is not None and port not in ports:
        hint = did_you_mean(port, ports) or f". Ports are {', '.join(ports)}"
        hint = hint if ports else "; the case has no such node"
        raise FvsolveError(
            f'no port named "{port}"; expected a reservoir, an inflow or a junction{hint}'
        )


def port_verdict(run: EnergyRun, port: str) -> Port:
    """Check condition (2) of passivity (see `Port`) at every step of a run; port : name of the node."""
    lines, totals = run.accounts.accounts, np.array(run.step_totals)
    own_lines = [
        k
        for k, account in enumerate(lines)
        if account.category == "supplied" and account.place == port
    ]
    supplied_lines = run.accounts.of("supplied")
    work = totals[:, own_lines].sum(axis=1)
    others = totals[:, supplied_lines].sum(axis=1) - work
    at_rows = np.searchsorted(run.step_times, run.times, side="right") - 1
    start = sum(available_energy(run.model).values())
    margin = start + work + others
    least, worst = int(np.argmin(work)), int(np.argmin(margin))
    size = start + np.max(np.abs(work)) + np.max(np.abs(others))
    t = run.step_times
    verdict = Port(
        port,
        float(work[least]),
        float(t[least]),
        start,
        float(others[worst]),
        float(margin[worst]),
        float(t[worst]),
        bool(margin[worst] >= -ROUNDING * size),
        work[at_rows],
        -(start + others)[at_rows],
    )
    return replace(verdict, text=port_text(verdict, run.model.case))


def port_text(port: Port, case) -> str:
    """Verdict on the passivity at a port as a sentence, in the units of `[output]` of the case."""
    energies = (
        port.work,
        0.0 - port.at_start,
        -(port.at_start + port.others),
        port.others,
        port.margin,
    )
    work, least, own_bound, others, margin = (case.amount(value, "energy", 6) for value in energies)
    if port.others:
        bound = f"-(E0 + others) = {own_bound} (E0: energy stored at the start; others: {others} from other ports)"
    else:
        bound = f"-E0 = {least} (E0: energy stored at the start)"
    verdict = (
        "passive over this run"
        if port.passive
        else "NOT passive: the network supplied more energy than it had"
    )
    time, margin_time = (case.moment(value) for value in (port.time, port.t_margin))
    return (
        f"port {port.node}: integral of p q falls to {work} at {time}, its bound is {bound}; "
        f"least margin {margin} at {margin_time}: {verdict}"
    )


def write_table(result: Energy, path: Path) -> None:
    """Write an energy balance to the file `path` as CSV: accounts, remainders and W at the port [J] at times [s]."""
    columns = {"t [s]": result.t}
    for kind in ("supplied", "stored", "dissipated", "scheme", "law"):
        columns |= {f"{kind} {name} [J]": values for name, values in getattr(result, kind).items()}
    if result.port is not None:
        columns |= {"integral of p q [J]": result.port.course, "bound [J]": result.port.bound}
    columns |= {
        "step [J]": result.step,
        "newton [J]": result.newton,
        "remainder [J]": result.remainder,
    }
    text = [",".join(columns)]
    text += [
        ",".join(repr(float(x)) for x in row) for row in np.column_stack(list(columns.values()))
    ]
    write_file(path, "\n".join(text) + "\n")


PAIR_COLUMNS = (  # columns of a row
    Column("scheme"),
    Column("method"),
    Column("remainder", words=".4g", head="remainder [J]"),
    Column("scheme_loss", words=".4g", head="by the scheme [J]"),
    Column("step_loss", words=".4g", head="by the step [J]"),
    Column("newton_loss", words=".4g", head="by Newton residuals [J]"),
    Column("least", words=".4g", head="least remainder [J]"),
    Column("relative", words=".4g", head="over throughput"),
    Column("creates", head="creates energy"),
    Column("margin", words=".4g", head="margin at the port [J]"),
    Column("reason", words=lambda row: row["reason"].partition(":")[0], head="run"),
)


def measure_pairs(
    case,
    schemes=None,
    methods=None,
    port: str | None = None,
    progress=None,
    points=None,
    watch=None,
) -> list[dict]:
    """Run a case with every pair of scheme and method; returns a row (dict) with the energy remainders of each pair.

    Entries of a row are those of `PAIR_COLUMNS`. remainder, scheme_loss, step_loss, newton_loss : energies at the end
    [J], see `Energy`; least : least value over time of the remainder without Newton residuals [J]
    creates : True if `least` is below zero by more than rounding, or if the run failed; None if it was refused
    margin : least margin of the passivity at the port [J], see `Port`; None without a port
    If the pair was refused, all entries except scheme, method and reason are None.

    schemes, methods : names (default those of the case); progress : called as progress(done, total, next)
    points : `ResultCache` of earlier rows; watch : called as watch(t, seconds, steps) during every run
    A pair that is refused or diverges gives a row with its reason. Raises FvsolveError for unknown names and for a case
    whose energy is not computed (see `Accounts`), and KeyboardInterrupt if a run is interrupted.
    """
    check_port(case, port)
    points = points or ResultCache()
    schemes = check_names(schemes or [case.numerics.scheme], list(SCHEMES), "scheme")
    methods = check_names(methods or [case.numerics.method], [*method_names(), AUTO], "method")
    rows, total = [], len(schemes) * len(methods)
    for scheme in schemes:
        for method in methods:
            if progress is not None:
                progress(len(rows), total, f"{scheme} with {method}")
            pair = {"scheme": scheme, "method": method}
            make = functools.partial(pair_result, case, scheme, method, port, watch)
            rows.append(pair | points.get(case, pair | {"study": "energy", "port": port}, make))
    return rows


def pair_result(case, scheme: str, method: str, port: str | None, watch=None) -> dict:
    """Row of a pair: energy remainders of a run of the case with this scheme and method, see `measure_pairs`."""
    missing = {
        column.key: None
        for column in PAIR_COLUMNS
        if column.key not in ("scheme", "method", "reason")
    }
    try:
        result = energy(case, {"numerics.scheme": scheme, "numerics.method": method}, port, watch)
    except CaseError as error:
        return missing | {"reason": refusal_text(error)}
    end_if_interrupted(result.reason)
    losses = [float(values[-1]) for values in result.scheme.values()]
    sound = result.ok and bool(np.all(np.isfinite(result.remainder)))
    least = float(np.min(result.numerical_remainder))
    return missing | {
        "remainder": float(result.remainder[-1]),
        "scheme_loss": sum(losses),
        "step_loss": float(result.step[-1]),
        "newton_loss": float(result.newton[-1]),
        "least": least,
        "relative": result.relative,
        "creates": not sound or least < -ROUNDING * result.throughput,
        "margin": None if result.port is None else result.port.margin,
        "reason": result.reason,
    }
