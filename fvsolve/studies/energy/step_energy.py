"""Energy of each accepted time step: sum of the powers at its stages with the weights of the method."""

import numpy as np

from fvsolve.kernels.delay_lines.wave_history import JUMPS_TRAVELLING, time_tolerance
from fvsolve.model.delay_lines import jump_times
from fvsolve.model.energy_accounts import Accounts
from fvsolve.solve.run_loop import RunLoop
from fvsolve.solve.solve import Run
from fvsolve.steppers import automatic, loop_records

TABLE_ROWS = 1000  # approximate number of rows of the table
QUADRATURE_TOLERANCE = 1e-3  # allowed quadrature error of the dissipated energy in a step, relative to its total
LEAST, MOST = 0.1, 8.0  # limits of the factor on the step for that tolerance
ACCEPTED_CODES = (  # status codes of the loop after an accepted step
    loop_records.BUDGET_SPENT, loop_records.DONE, loop_records.ROWS_FULL, loop_records.FIELD, loop_records.STOPPED,
)  # fmt: skip


class EnergyLoop(RunLoop):
    """Run loop that adds up the energies of all accounts over accepted steps, from the powers at their stages."""

    def watch(self, accounts: Accounts, on_step) -> None:
        """Start to add up the energies of `accounts`; on_step() is called after every accepted step."""
        self.accounts, self.on_step = accounts, on_step
        self.total, self.carry = np.zeros((2, len(accounts.accounts) + 1))  # ledger lines, then the Newton residual
        self.supplied, self.rates = accounts.of("supplied"), accounts.of("rate")
        self.dissipated_lines = accounts.of("dissipated")
        self.longest = float(self.control["step_max"])
        self.dydt, self.out_work = np.zeros(self.model.y_size), self.model.new_out()
        self.control["allow_fused"] = 0  # fused steps store no stages

    def run(self, budget: float) -> int:
        """Run `RunLoop.run` one step at a time, and add the energy of each accepted step.

        budget : greatest number of steps. Returns the status code of the loop.
        """
        code, left, armed = super().run(0.0), budget, self.armed
        while code == loop_records.BUDGET_SPENT and left > 0.0 and not automatic.is_change_due(self.stepper):
            t, y, rules = self.t, self.now.copy(), armed.copy()
            first_values = self.stepper.k[0].copy(), self.stepper.ledger_rates[0].copy()
            steps = self.state["steps"]
            code, left = super().run(1.0), left - 1.0
            if self.state["steps"] > steps and code in ACCEPTED_CODES:
                after = armed.copy()
                armed[:] = rules  # the flags of the right-hand side of this step
                self.add(self.released_stops(t, y, self.step_energy(t, y, *first_values)) + self.jump_correction(t, y))
                armed[:] = after
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
        a, (b, c) = (part.reshape(-1, s) for part in np.split(self.stepper.coefficients[: s * s + 2 * s], [s * s]))
        return a, b, c

    def step_energy(self, t: float, y: np.ndarray, first: np.ndarray, supply: np.ndarray) -> np.ndarray:
        """Energy [J] that the step from (t, y) adds to every account; the last entry is that of the Newton residual.

        first, supply : slope dy/dt and ledger rates, such as the supply of a node [kg/s], of the first stage at (t, y)
        The next step is limited by `limit_next`, except under Rosenbrock methods.
        """
        stepper, h = self.stepper, float(self.state["last"])
        (a, b, c), total = self.tableau(), np.zeros_like(self.total)
        k, supplies = np.vstack([first, stepper.k[1:]]), np.vstack([supply, stepper.ledger_rates[1:]])
        if stepper.method.kind == "linear":
            total[:-1] = b @ self.linearly_implicit(t, y, h, a, c, k)
            return h * total
        s = b.size
        by_error = self.control["mode"] == loop_records.TOLERANCE and stepper.method.kind != "full"
        error = stepper.coefficients[s * s + 2 * s : s * s + 3 * s] * by_error  # weights of the error estimate
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
        The error is to stay below a thousandth of `lost`. The limit is 0.1 to 8 times h, also without error control.
        The error control of states does not cover this error: for states that are parabolas in time, a method of order
        two is exact, but the integral of the power is not.
        """
        grow = MOST
        if off > 0.0:
            grow = min(MOST, 0.9 * (QUADRATURE_TOLERANCE * lost / off) ** (1.0 / self.control["order"]))
        self.control["step_max"] = min(self.longest, h * max(LEAST, grow))

    def jump_correction(self, t: float, y: np.ndarray) -> np.ndarray:
        """Correction [J] of the energies of the step from (t, y) for jumps of waves in delay lines within the step.

        The power at a stage is the power before or after a jump, so that the weights of the stages place the jump at a
        wrong time. Returns the correction for every energy account; the last entry is that for the Newton residual.
        """
        past, total, h = self.run_data.past, np.zeros_like(self.total), self.t - t
        if not past.size or past[JUMPS_TRAVELLING] == 0.0:
            return total
        (_, b, c), separation = self.tableau(), time_tolerance(past)
        if self.stepper.method.kind == "linear":
            b = self.power_weights()
        begin, end = t + min(0.0, float(c.min())) * h, t + max(1.0, float(c.max())) * h
        for jump_time in jump_times(past, self.model.tables.delays, begin, end):
            sides = jump_time - 2.0 * separation, jump_time + 2.0 * separation
            before, after = (self.power(time, y + (time - t) / h * (self.now - y)) for time in sides)
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
            return np.append(power, 0.0)
        position = int(self.model.layout["supply"])
        values[position : position + supply.size] = supply
        change = self.accounts.power_by(t, y, slope, values) - power
        for line_range in (self.supplied, self.rates):
            power[line_range] += change[line_range]
        return np.append(power, change[self.supplied].sum() - change[self.rates].sum())

    def rosenbrock_coefficients(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Further coefficients (C : float64[s, s], d : float64[s], gamma) of a Rosenbrock method with s stages.

        They are as in `steppers/ros.py`.
        """
        s = self.stepper.k.shape[0]
        coefficients = self.stepper.coefficients[s * s + 3 * s :]
        return coefficients[: s * s].reshape(s, s), coefficients[s * s : s * s + s], float(coefficients[s * s + s])

    def power_weights(self) -> np.ndarray:
        """Weights float64[s] with which the powers at the stages of a Rosenbrock step enter its energy."""
        (_, b, _), (big_c, _, gamma) = self.tableau(), self.rosenbrock_coefficients()
        return np.append(0.0, np.linalg.solve((np.eye(b.size - 1) - gamma * big_c[1:, 1:]).T, gamma * b[1:]))

    def linearly_implicit(self, t: float, y: np.ndarray, h: float, a, c, k) -> np.ndarray:
        """Stage values w of the energy accounts in a Rosenbrock step from (t, y) : float64[s, accounts] [W].

        The energies z of the accounts, with dz/dt = P(t, y) and P the powers, are integrated like further states:
        w_i = gamma (P(t + c_i h, U_i) + P_y h k_i + d_i h P_t + sum over j < i of C_ij w_j),
        with stage values U_i = y + h sum a_ij k_j and stage slopes k_i; w_0 of the start of the step is zero.
        a, c : coefficients and times of `tableau`; C, d, gamma : see `rosenbrock_coefficients`
        The derivatives P_y and P_t are computed by differences.
        """
        s, (big_c, late, gamma) = len(c), self.rosenbrock_coefficients()
        per, eps, slope = 1e-3 * h, 1e-3, 0.0
        if t + per > t:  # otherwise the step is so short that the term is negligible
            slope = (4.0 * self.power(t + per, y) - 3.0 * self.power(t, y) - self.power(t + 2.0 * per, y)) / (2.0 * per)
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
        tables, lines = self.model.tables, self.accounts.stops
        if not lines:
            return part
        travels = [stop_travels(self.model, *state) for state in ((t, y), (self.t, self.now))]
        for k, ((rate, loss), stop) in enumerate(zip(lines, tables.stops, strict=True)):
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
    out, tables = model.evaluate(t, y)[1], model.tables
    first = int(model.layout["travel"]) + 2 * len(tables.braces)
    return out[first : first + 2 * len(tables.stops)].reshape(-1, 2)


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
        self.impact_losses = np.zeros(len(model.column_names))  # energy lost by columns in impacts [J]
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
        self.impact_losses += 0.5 * (before - self.flows()) ** 2 * columns["length"] / (rho * columns["area"])

    def flows(self) -> np.ndarray:
        """Mass flows of rigid columns [kg/s]."""
        columns = self.model.tables.columns
        return columns["flow"] + self.loop.now[columns["y"]]
