"""Steps whose energy is booked by their own weights, from the accepted stage values. Knows a run; judges nothing."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels.delay.history import LIVE, same_time
from fvsolve.model.energy_ledger import Accounts
from fvsolve.model.past import times_of_jumps
from fvsolve.solve.loop import Loop
from fvsolve.solve.solve import Run
from fvsolve.steppers import automatic, slots

ROWS = 1000  # of the table, about
SHARE = 1e-3  # of all that is dissipated: what its quadrature may err by in a step, where steps go by a tolerance
LEAST, MOST = 0.1, 8.0  # factors on the step for that
SOUND = (
    slots.CHUNK,
    slots.DONE,
    slots.ROWS_FULL,
    slots.FIELD,
    slots.STOPPED,
)  # answers of the loop after a step that counts


class Booked(Loop):
    """A loop that books the power of every accepted step by the step's own weights."""

    def watch(self, accounts: Accounts, on_step) -> None:
        """Book from here on; on_step() is called after every accepted step."""
        self.accounts, self.on_step = accounts, on_step
        self.total, self.carry = np.zeros((2, len(accounts.accounts) + 1))  # the lines, then what Newton leaves
        self.supplied, self.rates, self.lost = (accounts.of(what) for what in ("supplied", "rate", "dissipated"))
        self.longest = float(self.orders[slots.STEP_MAX])
        self.dydt, self.beside = np.zeros(self.model.y_size), self.model.new_out()
        self.orders[slots.LEAPS] = 0.0  # a leap leaves no stages behind

    def run(self, budget: float) -> int:
        """`Loop.run`, one step at a time."""
        code, left, armed = super().run(0.0), budget, self.armed
        while code == slots.CHUNK and left > 0.0 and not automatic.wants_change(self.stepper):
            t, y, rules = self.t, self.now.copy(), armed.copy()
            first = self.stepper.k[0].copy(), self.stepper.supply[0].copy()
            steps = self.memory[slots.STEPS]
            code, left = super().run(1.0), left - 1.0
            if self.memory[slots.STEPS] > steps and code in SOUND:
                after = armed.copy()
                armed[:] = rules  # those that the step was taken under
                self.add(self.released(t, y, self.booked(t, y, *first)) + self.jumped(t, y))
                armed[:] = after
                self.on_step()
        return code

    def power(self, t: float, y: np.ndarray) -> np.ndarray:
        """Power of every line of the ledger at a state [W]."""
        return self.accounts.power_at(t, y, self.dydt, self.beside)

    def tableau(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coefficients, weights and times of the stages of a step."""
        s = self.stepper.k.shape[0]
        a, (b, c) = (part.reshape(-1, s) for part in np.split(self.stepper.coefficients[: s * s + 2 * s], [s * s]))
        return a, b, c

    def booked(self, t: float, y: np.ndarray, first: np.ndarray, supply: np.ndarray) -> np.ndarray:
        """What the step from (t, y), with slope and supplies there, adds to every line and leaves to Newton [J]."""
        stepper, h = self.stepper, float(self.memory[slots.LAST])
        (a, b, c), total = self.tableau(), np.zeros_like(self.total)
        k, supplies = np.vstack([first, stepper.k[1:]]), np.vstack([supply, stepper.supply[1:]])
        if stepper.method.kind == "linear":
            total[:-1] = b @ self.linearly_implicit(t, y, h, a, c, k)
            return h * total
        s = b.size
        error = stepper.coefficients[s * s + 2 * s : s * s + 3 * s]  # weights of the error estimate
        error = error * (self.orders[slots.CONTROL] == slots.TOLERANCE and stepper.method.kind != "full")
        off = np.zeros_like(total)
        for i in np.flatnonzero((b != 0.0) | (error != 0.0)):
            power = self.stage(t + c[i] * h, y + h * (a[i] @ k), k[i], supplies[i])
            total += b[i] * power
            off += error[i] * power
        self.limit_next(h, h * np.abs(off[self.lost]).sum(), np.abs((self.total + h * total)[self.lost]).sum())
        return h * total

    def limit_next(self, h: float, off: float, lost: float) -> None:
        """Bound the next step where the quadrature of what is dissipated was `off` in this one, of `lost` so far [J].

        States that are parabolas in time have no error of order two, but their powers do.
        """
        grow = min(MOST, 0.9 * (SHARE * lost / off) ** (1.0 / self.orders[slots.ORDER])) if off > 0.0 else MOST
        self.orders[slots.STEP_MAX] = min(self.longest, h * max(LEAST, grow))

    def jumped(self, t: float, y: np.ndarray) -> np.ndarray:
        """What the weights of the step from (t, y) miss of what jumps in delay lines change within it [J].

        Stages before it know nothing of it, those behind it that it was always there; some lie outside the step.
        """
        past, total, h = self.slate.past, np.zeros_like(self.total), self.t - t
        if not past.size or past[LIVE] == 0.0:
            return total
        (_, b, c), apart = self.tableau(), same_time(past)
        if self.stepper.method.kind == "linear":
            b = self.weights_beside()
        begin, end = t + min(0.0, float(c.min())) * h, t + max(1.0, float(c.max())) * h
        for when in times_of_jumps(past, self.model.tables.delays, begin, end):
            before, behind = (
                self.power(at, y + (at - t) / h * (self.now - y)) for at in (when - 2.0 * apart, when + 2.0 * apart)
            )
            booked = h * float(b[t + c * h >= when - apart].sum())
            total[:-1] += (behind - before) * (min(h, max(0.0, self.t - when)) - booked)
        return total

    def stage(self, t: float, y: np.ndarray, slope: np.ndarray, supply: np.ndarray) -> np.ndarray:
        """Power of every line at a stage, and what Newton leaves there [W].

        Newton ends at f + J d and not at f(t, y): supply and storage are by what the state moves by, `slope` and
        `supply`; the rest is by f, and the difference, grad E . (f - slope) less the change of supply, is Newton's.
        """
        power, beside = self.power(t, y), self.beside
        if self.stepper.method.explicit:
            return np.append(power, 0.0)
        at = int(self.model.layout["supply"])
        beside[at : at + supply.size] = supply
        change = self.accounts.power_by(t, y, slope, beside) - power
        for lines in (self.supplied, self.rates):
            power[lines] += change[lines]
        return np.append(power, change[self.supplied].sum() - change[self.rates].sum())

    def beyond(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Of a Rosenbrock method what its tableau has beside coefficients, weights and times: C, d, gamma."""
        s = self.stepper.k.shape[0]
        beyond = self.stepper.coefficients[s * s + 3 * s :]
        return beyond[: s * s].reshape(s, s), beyond[s * s : s * s + s], float(beyond[s * s + s])

    def weights_beside(self) -> np.ndarray:
        """Weights of the powers at a Rosenbrock step's stages in what `linearly_implicit` adds up."""
        (_, b, _), (big_c, _, gamma) = self.tableau(), self.beyond()
        return np.append(0.0, np.linalg.solve((np.eye(b.size - 1) - gamma * big_c[1:, 1:]).T, gamma * b[1:]))

    def linearly_implicit(self, t: float, y: np.ndarray, h: float, a, c, k) -> np.ndarray:
        """Stages of the ledger of a Rosenbrock step, float64[s, lines]: one more equation z' = P(t, y) beside y.

        w_i = g (P(U_i) + P_y h k_i + d_i h P_t + sum of C_ij w_j), see `steppers/ros.py`; P_y and P_t by differences.
        """
        s, (big_c, late, gamma) = len(c), self.beyond()
        per, eps, slope = 1e-3 * h, 1e-3, 0.0
        if t + per > t:  # in a step of so few roundings it counts for nothing
            slope = (4.0 * self.power(t + per, y) - 3.0 * self.power(t, y) - self.power(t + 2.0 * per, y)) / (2.0 * per)
        w = np.zeros((s, len(self.total) - 1))
        for i in range(1, s):
            step = eps * h * k[i]
            along = (self.power(t, y + step) - self.power(t, y - step)) / (2.0 * eps)
            stage = self.power(t + c[i] * h, y + h * (a[i] @ k))
            w[i] = gamma * (stage + along + late[i] * h * slope + big_c[i, 1:i] @ w[1:i])
        return w

    def released(self, t: float, y: np.ndarray, part: np.ndarray) -> np.ndarray:
        """The same, but for stops that are left in this step: they lose what they have taken up and do not keep.

        Where a contact stops to push, the rate of what it holds has a kink that no stage sees.
        """
        tables, lines = self.model.tables, self.accounts.stops
        if not lines:
            return part
        travels = [stop_travels(self.model, *one) for one in ((t, y), (self.t, self.now))]
        for k, ((rate, loss), stop) in enumerate(zip(lines, tables.stops, strict=True)):
            was, leaves = pressed(stop, *travels[0][k])
            now, left = pressed(stop, *travels[1][k])
            if leaves or left:
                change = 0.5 * float(stop["stiffness"]) * (now - was) * (now + was)
                part[loss] += part[rate] - change
                part[rate] = change
        return part

    def add(self, part: np.ndarray) -> None:
        """Add to the totals, with what rounding took off before."""
        whole = part + self.carry
        new = self.total + whole
        self.carry = whole - (new - self.total)
        self.total = new


def stop_travels(model, t: float, y: np.ndarray) -> np.ndarray:
    """Travel [m] and its rate of every stop at a state : float64[stops, 2]."""
    out, tables = model.evaluate(t, y)[1], model.tables
    first = int(model.layout["travel"]) + 2 * len(tables.braces)
    return out[first : first + 2 * len(tables.stops)].reshape(-1, 2)


def pressed(stop, x: float, speed: float) -> tuple[float, bool]:
    """(how deep a stop is pressed [m], whether what presses it leaves quicker than it can follow)."""
    above, below = x - stop["above"], -stop["below"] - x
    deep, faster = (above, speed) if above > below else (below, -speed)
    leaves = faster < 0.0 and stop["stiffness"] * deep + stop["damping"] * faster <= 0.0
    return max(0.0, float(deep)), bool(leaves)


class EnergyRun(Run):
    """A run with its ledger of energy."""

    loop_type = Booked

    def __init__(self, model, state, sink, progress) -> None:
        super().__init__(model, state, sink, progress)
        self.accounts = Accounts(self.slate)
        self.loop.watch(self.accounts, self.on_step)
        self.times, self.totals, self.holdings = [self.loop.t], [self.loop.total.copy()], []
        self.first = self.holding()
        self.holdings.append(np.zeros_like(self.first))
        self.lost = np.zeros(len(model.column_names))  # of columns that stop dead [J]
        self.losses = [self.lost.copy()]
        self.every = (self.end - self.start) / ROWS
        self.step_times, self.step_totals = [self.loop.t], [self.loop.total.copy()]

    def holding(self) -> np.ndarray:
        return self.accounts.stored_at(self.loop.t, self.loop.now)

    def on_step(self) -> None:
        """Keep a row where one is due."""
        self.step_times.append(self.loop.t)
        self.step_totals.append(self.loop.total.copy())
        if self.loop.t >= self.times[-1] + self.every or self.loop.t >= self.end:
            self.keep()

    def keep(self) -> None:
        self.times.append(self.loop.t)
        self.totals.append(self.loop.total.copy())
        self.holdings.append(self.holding() - self.first)
        self.losses.append(self.lost.copy())

    def stop_columns(self) -> None:
        """What a column that stops dead had is dissipated; where columns meet, what the lost flows had (Carnot)."""
        before = self.flows()
        super().stop_columns()
        columns, rho = self.model.tables.columns, self.model.case.properties.density
        self.lost += 0.5 * (before - self.flows()) ** 2 * columns["length"] / (rho * columns["area"])

    def flows(self) -> np.ndarray:
        """Of rigid columns [kg/s]."""
        columns = self.model.tables.columns
        return columns["flow"] + self.loop.now[columns["y"]]
