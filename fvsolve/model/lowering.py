"""How parts become rows of tables: what each kind answers while a model is made. Knows drafts; knows no rhs."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

from fvsolve.kernels import calls
from fvsolve.kernels import records as rec
from fvsolve.kernels.restrictions import step_at
from fvsolve.parts.schedule import constant
from fvsolve.steady import Edge

if TYPE_CHECKING:
    from fvsolve.model.inputs import Input

SCALE = 1e5  # a typical drop [Pa]


class Lowering:
    """Parts of one kind: their rows, their numbers, how they start, what of them can be held.

    table : of links, where their rows are: "pipe", "column", "valve", "brace", "stop" or "piston"; of places none
    rows : how many each has there; rank : kinds of a greater one stand behind those of a lesser
    law : module of its compiled law, whose functions are named as `kernels.calls.HOOKS`; with a `step` it says what its
    restriction lets through, in place of the root
    events : what it means that each event function falls to zero, "" where that is nothing to a reader
    acts : whether it is a device as well, see `model.device`
    books : name of its line in the ledger of energy: of a place, what it supplies, "" for none; else what a row is
    """

    kinds: ClassVar[dict[str, Lowering]] = {}
    table: ClassVar[str] = ""
    rows: ClassVar[int] = 1
    rank: ClassVar[int] = 0
    law: ClassVar[ModuleType | None] = None
    events: ClassVar[tuple[str, ...]] = ()
    acts: ClassVar[bool] = False
    books: ClassVar[str] = ""

    def __init_subclass__(cls, kind: str = "") -> None:
        if kind:
            Lowering.kinds[kind] = cls()

    def of(self, part: Any) -> Lowering:
        """What lowers this part: itself, but where its keys ask for other states."""
        return self

    def numbers(self, draft, name: str, part: Any) -> list[float]:
        """Its numbers, in the order in which its law reads them from the place that its row names as `data`."""
        return []

    def resize(self, draft, name: str, before: Any, part: Any, row) -> bool:
        """Make its row, once packed, that of a part in place of that before; whether it can."""
        return False

    def inputs(self, model, name: str, part: Any) -> dict[str, Input]:
        """Key -> what of it can be held at a value."""
        return {}

    def probe(self, draft, name: str, probe: Any, row) -> None:
        """Fill the PROBE row of one of its quantities."""
        row["kind"], row["index"] = rec.PRESSURE, draft.node_index[name]

    # places ---------------------------------------------------------------------------------------------------

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a place of the fluid."""

    def pressure_at_start(self, start, i: int, node: Any, row) -> float | None:
        """Pressure [Pa] that a place holds in the steady problem, None where flows decide."""
        return None

    def moves(self, name: str, node: Any, row, inflow: float, flow: float, told: Callable[..., str]) -> str:
        """What a net flow [kg/s], [m3/s] into a place does at the start, in words; "" for nothing.

        told : as `Case.amount`, numbers in the units of `[output]`
        """
        return f"junction {name}: {told(flow, 'flow')} more flow in than out"

    # links ----------------------------------------------------------------------------------------------------

    def fill(self, draft, name: str, link: Any, rows) -> None:
        """Fill the rows of a link."""

    def row_names(self, name: str) -> list[str]:
        """What the ledger of energy calls each of them."""
        return [name]


class Restriction(Lowering):
    """Links of one row among the valves, by the root M |M| = G dp or a law of their own."""

    table = "valve"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.ends(link, row)
        row["schedule"] = -1
        self.restriction(draft, name, link, row)
        if self.steps:
            row["hooks"] = draft.hooks(self)
        if row["schedule"] < 0 and (self.law is None or calls.hook_of(self.law, "set") is None):
            row["schedule"] = draft.schedules.add(constant(1.0))
        if self.law is None:
            return
        if not self.acts:
            row["data"], row["event"] = len(draft.floats), draft.flags(name, self.events)
            draft.floats += self.numbers(draft, name, link)

    def probe(self, draft, name: str, probe: Any, row) -> None:
        row["kind"], row["index"] = rec.VALVE_FLOW, draft.valve_names.index(name)

    @property
    def steps(self) -> bool:
        """Whether a law of its own says what it lets through."""
        return self.law is not None and calls.hook_of(self.law, "step") is not None

    def restriction(self, draft, name: str, link: Any, row) -> None:
        """Fill its VALVE row with what its law does not say."""
        draft.restriction(name, link, row)

    def edge(self, start, k: int) -> Edge | None:
        """Its edge in the steady problem, k its VALVE row; None for that of a root, open as `start.shut` has it."""
        if not self.steps:
            return None
        row, (denser, wider) = start.valves[k], start.dense_of.get(k, (1.0, 1.0))
        row["open"] = g = start.conductance(k)
        i, j = int(row["from_node"]), int(row["to_node"])
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        per, step = math.sqrt(SCALE / (g * denser)), self.stepper(start, k, g, denser)

        def newton(flow, present):
            a, s = step(flow, present * wider)
            return per, per * s * wider, per * a

        return Edge(i, j, newton, math.sqrt(g * denser * SCALE))

    def stepper(self, start, k: int, g: float, denser: float):
        """(flow [kg/s], drop [Pa]) -> a, s of its law's `step`, before anything has happened."""
        hook = calls.addressed(self.law.step, calls.HOOKS["step"][0])
        return lambda flow, drop: step_at(hook, start.out, start.handle, k, g, float(flow), float(drop), denser)

    def follow(self, start, k: int) -> None:
        """Let the profile's drop be that at which it carries its flow; where that is another one, it is not open."""
        row, (drop, denser) = start.valves[k], start.drive_of(k)
        if row["open"] <= 0.0:
            return
        flow, step = float(row["flow"]), self.stepper(start, k, float(row["open"]), denser)
        a, s = step(flow, drop)
        if abs(a) > 1e-6 * (start.flow_scale * 1e-6 + abs(flow)):
            row["open"] = 0.0
        elif start.case.law.linear:
            for _ in range(ROUNDS):
                if s <= 0.0 or a == 0.0:
                    break
                drop -= a / s
                a, s = step(flow, drop)
            row["drop"] = drop


ROUNDS = 5  # of Newton from a drop that is right to 1e-6


@functools.cache
def lowering_of(part: type) -> Lowering:
    """What lowers parts of a kind: of the module `lower` beside their declaration."""
    home = part.__module__.rpartition(".")[0]
    if find_spec(f"{home}.lower") is not None:
        import_module(f"{home}.lower")
    return Lowering.kinds.get(part.kind, PLAIN)


PLAIN = Lowering()  # of what lies in no table


def lowered(case) -> dict[str, list[tuple[str, Any, Lowering]]]:
    """Table -> (name, link, what it is lowered by) of the links that have rows in it, in the order of these."""
    found: dict[str, list[tuple[str, Any, Lowering]]] = {}
    for name, link in case.conduits.items():
        lowering = lowering_of(type(link)).of(link)
        found.setdefault(lowering.table, []).append((name, link, lowering))
    return {table: sorted(rows, key=lambda one: one[2].rank) for table, rows in found.items()}


def rows_in(case, table: str) -> list[tuple[str, Any, Lowering]]:
    """Those of one table."""
    return lowered(case).get(table, [])
