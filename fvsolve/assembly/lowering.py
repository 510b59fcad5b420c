"""Conversion of parts to rows of the model's tables, one class for each kind of part."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

from fvsolve.kernels import calls
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.restrictions import step_at
from fvsolve.steady import Edge

if TYPE_CHECKING:
    from fvsolve.assembly.inputs import Input

TYPICAL_DROP = 1e5  # a typical pressure drop [Pa]
LAMINAR_REYNOLDS = 10.0  # Reynolds number below which a restriction is made laminar, to bound its slope at zero drop


class Lowering:
    """Conversion of parts of one kind to table rows: their numbers, start, inputs and probes.

    table : for links, the table of their rows: "pipe", "column", "valve", "brace", "stop" or "piston"; "" for nodes
    rows : number of rows of each part; rank : rows of kinds with greater rank come after those with lesser rank
    law : module of its compiled law, whose functions are named as in `kernels.calls.HOOKS`; if it has a `step`, that
    function gives the flow through its restriction, in place of the square-root law
    events : meaning of a zero of each event function, "" if it is not reported
    is_device : True if it is also a device, see `assembly.device_lowering`
    ledger_name : for a node, name of the energy it supplies in the energy ledger ("" for none); for a link, category of
    its row in the ledger
    """

    kinds: ClassVar[dict[str, Lowering]] = {}
    table: ClassVar[str] = ""
    rows: ClassVar[int] = 1
    rank: ClassVar[int] = 0
    law: ClassVar[ModuleType | None] = None
    events: ClassVar[tuple[str, ...]] = ()
    is_device: ClassVar[bool] = False
    ledger_name: ClassVar[str] = ""

    def __init_subclass__(cls, kind: str = "") -> None:
        if kind:
            Lowering.kinds[kind] = cls()

    def of(self, part: Any) -> Lowering:
        """Conversion of this part; a different object if keys of the part need other states."""
        return self

    def numbers(self, draft, name: str, part: Any) -> list[float]:
        """Numbers of a part, in the order in which its law reads them from offset `data` of its row."""
        return []

    def resize(self, draft, name: str, before: Any, part: Any, row) -> bool:
        """Update the row of a part to a part that replaces `before`; False if that is not possible."""
        return False

    def inputs(self, model, name: str, part: Any) -> dict[str, Input]:
        """Schedules of a part that can be held at a value : key -> input."""
        return {}

    def probe(self, draft, name: str, probe: Any, row) -> None:
        """Fill the PROBE row of a probe of this part."""
        row["kind"], row["index"] = rec.PRESSURE, draft.node_index[name]

    # places ---------------------------------------------------------------------------------------------------

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a fluid node."""

    def pressure_at_start(self, start, i: int, node: Any, row) -> float | None:
        """Pressure [Pa] that node i keeps in the steady start; None if the flows determine it."""
        return None

    def motion_text(self, name: str, node: Any, row, inflow: float, flow: float, amount: Callable[..., str]) -> str:
        """Text of the change that a net inflow causes at the start; "" for none.

        inflow, flow : the net inflow [kg/s], and as volume flow [m3/s]; amount : formats numbers in the units of
        `[output]`
        """
        return f"junction {name}: {amount(flow, 'flow')} more flow in than out"

    # links ----------------------------------------------------------------------------------------------------

    def fill(self, draft, name: str, link: Any, rows) -> None:
        """Fill the table rows of a link."""

    def row_names(self, name: str) -> list[str]:
        """Names of the rows of a link in the energy ledger."""
        return [name]


class Restriction(Lowering):
    """Links with one row in the valve table, with the square-root law M |M| = G dp or a law of their own.

    M : mass flow [kg/s]; G : conductance [kg2/s2/Pa]; dp : pressure drop [Pa]
    """

    table = "valve"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.ends(link, row)
        row["schedule"] = -1
        self.restriction(draft, name, link, row)
        if self.steps:
            row["hooks"] = draft.hooks(self)
        if row["schedule"] < 0 and (self.law is None or calls.hook_of(self.law, "set") is None):
            row["schedule"] = draft.schedules.add_constant(1.0)
        if self.law is None:
            return
        if not self.is_device:
            row["data"], row["event"] = len(draft.floats), draft.flags(name, self.events)
            draft.floats += self.numbers(draft, name, link)

    def probe(self, draft, name: str, probe: Any, row) -> None:
        row["kind"], row["index"] = rec.VALVE_FLOW, draft.valve_names.index(name)

    @property
    def steps(self) -> bool:
        """True if the part has a flow law of its own."""
        return self.law is not None and calls.hook_of(self.law, "step") is not None

    def restriction(self, draft, name: str, link: Any, row) -> None:
        """Fill the fields of the VALVE row that the part's own law does not set."""
        draft.restriction(name, link, row)

    def edge(self, start, k: int) -> Edge | None:
        """Edge of VALVE row k in the steady flow problem; None for the square-root law, which the caller treats.

        Otherwise it sets `open` of the row to the conductance at the start.
        """
        if not self.steps:
            return None
        row, (density_ratio, drive_ratio) = start.valves[k], start.density_ratios.get(k, (1.0, 1.0))
        row["open"] = g = start.conductance(k)
        i, j = int(row["from_node"]), int(row["to_node"])
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        per, step = math.sqrt(TYPICAL_DROP / (g * density_ratio)), self.stepper(start, k, g, density_ratio)

        def newton(flow, present):
            a, s = step(flow, present * drive_ratio)
            return per, per * s * drive_ratio, per * a

        return Edge(i, j, newton, math.sqrt(g * density_ratio * TYPICAL_DROP))

    def stepper(self, start, k: int, g: float, density_ratio: float):
        """Function (flow [kg/s], drop [Pa]) -> (a, s) of the part's own law, with the event flags as before any event.

        The next Newton step of this law changes the flow by a + s d(drop), with the change d(drop) of the drop.
        g : conductance [kg2/s2/Pa]; density_ratio : upstream density over reference density
        """
        hook = calls.function_address(self.law.step, calls.HOOKS["step"][0])
        return lambda flow, drop: step_at(hook, start.out, start.handle, k, g, float(flow), float(drop), density_ratio)

    def follow(self, start, k: int) -> None:
        """Set the steady drop of valve k to the drop that belongs to its flow by its own law.

        If the drop found in the steady problem does not agree with the flow, the restriction counts as not open. Under
        density laws other than `linear` the drop is unchanged.
        """
        row, (drop, density_ratio) = start.valves[k], start.valve_drive(k)
        if row["open"] <= 0.0:
            return
        flow, step = float(row["flow"]), self.stepper(start, k, float(row["open"]), density_ratio)
        a, s = step(flow, drop)
        if abs(a) > 1e-6 * (start.flow_scale * 1e-6 + abs(flow)):
            row["open"] = 0.0
        elif start.case.law.linear:
            for _ in range(NEWTON_STEPS):
                if s <= 0.0 or a == 0.0:
                    break
                drop -= a / s
                a, s = step(flow, drop)
            row["drop"] = drop


NEWTON_STEPS = 5  # Newton steps from a drop that is accurate to 1e-6


@functools.cache
def lowering_of(part: type) -> Lowering:
    """Conversion of a kind of part, from the module `lower` in the package of its declaration.

    It is `NO_ROWS` if the kind has none.
    """
    package = part.__module__.rpartition(".")[0]
    if find_spec(f"{package}.lower") is not None:
        import_module(f"{package}.lower")
    return Lowering.kinds.get(part.kind, NO_ROWS)


NO_ROWS = Lowering()  # for parts without rows


def links_by_table(case) -> dict[str, list[tuple[str, Any, Lowering]]]:
    """Links with rows in each table : table -> list of (name, link, conversion), in the order of rows."""
    tables: dict[str, list[tuple[str, Any, Lowering]]] = {}
    for name, link in case.conduits.items():
        lowering = lowering_of(type(link)).of(link)
        tables.setdefault(lowering.table, []).append((name, link, lowering))
    return {table: sorted(rows, key=lambda entry: entry[2].rank) for table, rows in tables.items()}


def rows_in(case, table: str) -> list[tuple[str, Any, Lowering]]:
    """Links with rows in one table, in the order of rows : list of (name, link, its `Lowering`)."""
    return links_by_table(case).get(table, [])
