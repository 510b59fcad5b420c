"""A case about a state as A, B, C, D (9), (10), named, in SI. Knows models and differences; steps nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fvsolve.doors import FLAG, NAMES, NUMBER, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.kernels.schedules import value_until
from fvsolve.model.inputs import PRESSURE, Input, inputs_of
from fvsolve.schemes import SCHEMES
from fvsolve.solve.advance import hold
from fvsolve.studies.linear.frozen import Frozen, frozen, has_limiter
from fvsolve.studies.linear.matrices import output_matrix, responses, state_matrix
from fvsolve.studies.linear.slopes import COARSE, SMOOTH, longest, one_sided, two_sided
from fvsolve.units import DIMENSIONS

EPS = ("eps_x", "eps_y", "eps_z")
STATE_UNITS = {
    "mass": "kg", "excess": "kg", "air": "kg", "forward": "kg/s", "backward": "kg/s", "memory": "kg/s", "flow": "kg/s",
    "creep": "kg/s", "position": "m", "velocity": "m/s", "speed": "-", "opening": "-",
    "angle": "rad", "rate": "rad/s", "travel": "m", "travel_rate": "m/s", **dict.fromkeys(("eta", *EPS), "-"),
    **{f"spin_{axis}": "rad/s" for axis in "xyz"}, **{f"centre_{axis}": "m" for axis in "xyz"},
    **{f"centre_v{axis}": "m/s" for axis in "xyz"},
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Linear:
    """dx/dt = A x + B u, y = C x + D u for deviations x, u, y from a state (9), (10); SI.

    a : float64[n, n], or scipy csc where n > 1000; b : float64[n, inputs]; c : float64[outputs, n];
    d : float64[outputs, inputs]; at : what was linearised; rate : float64[n]  dx/dt there, zero if it stands still
    error : of each of A, B, C, D, by how much two steps of the differences disagree, relative to the sum of what all
    columns (each by its small deviation) do to a row, the worst entry
    """

    at: Frozen
    a: Any
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    input_values: tuple[float, ...]
    output_values: tuple[float, ...]
    error: dict[str, float]

    @property
    def states(self) -> list[str]:
        """Names of x: deviations from the profile."""
        return list(self.at.model.state_names)

    @property
    def state_units(self) -> list[str]:
        """Units of x."""
        names, basins = set(self.states), {basin.name: basin.part.own.states for basin in self.at.model.basins}
        return [
            basins[part].get(quantity.split("[")[0], "-") if part in basins
            else state_unit(name, f"{part}.opening" in names)
            for name in self.states for part, quantity in [name.rsplit(".", 1)]
        ]  # fmt: skip

    @property
    def sparse(self) -> bool:
        """Whether A is a scipy sparse array."""
        return not isinstance(self.a, np.ndarray)

    def plain(self) -> dict:
        """As JSON says it; a sparse A by rows, columns and values."""
        a = self.a
        if self.sparse:
            entries = a.tocoo()
            a = {"row": entries.row, "column": entries.col, "value": entries.data}
        return {
            "case": self.at.model.case.name, "at": self.at.t, "when": self.at.when,
            "scheme": self.at.model.case.numerics.scheme if self.at.model.cells or self.at.model.basins else None,
            "states": self.states, "state_units": self.state_units, "inputs": self.inputs,
            "input_units": self.input_units, "input_values": self.input_values, "outputs": self.outputs,
            "output_units": self.output_units, "output_values": self.output_values,
            "A": a, "B": self.b, "C": self.c, "D": self.d, "error": self.error,
            "state": self.at.y, "rate": self.at.rate,
        }  # fmt: skip


def state_unit(name: str, opens: bool) -> str:
    """SI unit of a state; the speed of what opens and shuts is that of its opening."""
    quantity = name.rsplit(".", 1)[1].rstrip("0123456789[]")
    amount = "kg/m" if name.endswith("]") else "kg"  # of a scalar, times its own unit
    return "1/s" if quantity == "speed" and opens else STATE_UNITS.get(quantity, amount)


@door(inputs=NAMES, outputs=NAMES, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def linearise(
    case, inputs=(), outputs=None, at: float | None = None, before: bool = False, scheme: str | None = None, set=None,
) -> Linear:  # fmt: skip
    """A case linearised by central differences at its start, or at the time `at` [s], schedules held.

    inputs : names such as "valve.opening", "lake.pressure"; outputs : probes, those of the case if None
    before : at a kink or jump of a schedule hold its value before it; scheme : linear one in place of the case's
    An input at the end of its range is moved to one side only. Raises CaseError, and FvsolveError for a name that is
    none, a state without a derivative (a limited scheme, a valve at a drop of zero, a kink), a case without states.
    """
    set = dict(set or {}) | ({} if scheme is None else {"numerics.scheme": scheme})
    found = frozen(case, set, at, before, outputs or ())
    return linearised(found, inputs, len(outputs) if outputs is not None else len(found.model.probes))


def linearised(at: Frozen, inputs=(), outputs: int = 0) -> Linear:
    """The same about a frozen state, with the first of its probes as outputs."""
    model, inputs = at.model, tuple(dict.fromkeys(inputs))
    known = inputs_of(model)
    for name in inputs:
        if name not in known:
            near = did_you_mean(name, known) or f"; inputs are {listing(known)}"
            raise FvsolveError(f'no input named "{name}"{near}')
    refuse_limiter(model)
    a, size, error_a, steps = state_matrix(at)
    c, error_c = output_matrix(at, outputs, steps)
    values = [input_value(at, name, known[name]) for name in inputs]
    columns = [input_column(at, name, known[name], value, size, outputs, steps)
               for (name, value) in zip(inputs, values, strict=True)]  # fmt: skip
    n, both = model.y_size, np.array([column for column, _ in columns]).reshape(len(inputs), model.y_size + outputs).T
    error = max((error for _, error in columns), default=0.0)
    probes = model.case.probes[:outputs]
    return Linear(
        at, a, both[:n].copy(), c, both[n:].copy(), inputs, tuple(one.text for one in probes),
        tuple(known[name].sort.unit for name in inputs),
        tuple(one.unit or DIMENSIONS[one.dimension].si for one in probes),
        tuple(values), tuple(responses(at, at.y, outputs)[n:].tolist()), {"A": error_a, "C": error_c, "BD": error},
    )  # fmt: skip


def refuse_limiter(model) -> None:
    """Raise where a limited scheme is at work."""
    scheme, able = model.case.numerics.scheme, model.case.schemes
    if has_limiter(model):
        smooth = "upwind"
        if model.basins and all(basin.is_grid for basin in model.basins):
            smooth = "upwind or upwind5"
        elif "upwind5" in able and not model.basins:
            smooth = f"{SCHEMES[scheme].twin} (what {scheme} is where all is smooth), upwind or upwind5"
        raise FvsolveError(
            f"numerics.scheme = {scheme} is limited: it has no derivative where the state is constant, however small "
            f"the deviation; linearise with a linear scheme, --scheme {smooth}"
        )


def input_value(at: Frozen, name: str, one: Input) -> float:
    """Value of an input at the state [SI]."""
    model = at.model
    if one.node >= 0:
        pressure = float(model.tables.nodes[one.node]["pressure"]
                         + model.evaluate(at.t, at.y)[1][model.layout["pressure"] + one.node])  # fmt: skip
        place = model.node_names[one.node]
        return pressure if one.sort is PRESSURE else float(model.head(pressure, model.elevation[place]))
    value = value_until(model.tables.schedules, model.tables.pieces, one.schedule, at.t, np.inf)
    if one.other >= 0:
        value -= value_until(model.tables.schedules, model.tables.pieces, one.other, at.t, np.inf)
    return float((value - one.offset) / one.scale)


def input_width(at: Frozen, one: Input, value: float) -> float:
    """What counts as a small change of an input [SI]."""
    usual = one.sort.small / (one.scale or 1e4) if one.node >= 0 else one.sort.small
    return usual if one.sort.bounded or one.sort is PRESSURE else max(usual, abs(value))


def input_column(at, name, one, value, size, outputs, steps) -> tuple[np.ndarray, float]:
    """(column of B over that of D, error) of one input; one-sided where it is at the end of its range."""
    model = at.model
    width = np.array([input_width(at, one, value)])
    low, high = one.sort.least, one.sort.greatest
    scheme = two_sided
    if one.sort.bounded:
        steps = np.concatenate([COARSE, steps])
    if value <= low or value >= high:
        scheme, width = one_sided, width if value <= low else -width
    elif one.sort.bounded:
        width = np.minimum(width, min(value - low, high - value))

    def at_input(u: np.ndarray) -> np.ndarray:
        held = replace(at, model=hold(model, {name: float(u[0])}))
        return responses(held, at.y, outputs)

    x = np.array([value])
    sides = scheme(at_input, x, width, at_input(x), steps)
    found, error, kink = longest(*sides, np.concatenate([size, np.zeros(outputs)]), steps)
    if max(np.max(error), np.max(kink)) > SMOOTH:
        why = "from side to side" if np.max(kink) > SMOOTH else "with every step"
        raise FvsolveError(f"{name} = {value:g} is no place to linearise: its effect differs {why} there; hold it "
                           "elsewhere with --set, or choose another time with --at")  # fmt: skip
    return found / width[0], float(np.max(error))
