"""Conversion of parts to rows of the model's tables, one class for each kind of part; inputs and devices."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fvsolve.core.kernels import calls
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.restrictions import flow_at_drop, step_at, transition_of
from fvsolve.core.steady import Edge
from fvsolve.errors import Notice


class InputKind(NamedTuple):
    """Kind of an input: unit, expected value in words, range of values, and size of a small change [SI].

    For HEAD the small change is that of the pressure [Pa].
    """

    unit: str
    expected: str
    least: float = -math.inf
    greatest: float = math.inf
    small: float = 1.0

    @property
    def bounded(self) -> bool:
        return self.least > -math.inf or self.greatest < math.inf


OPENING = InputKind("-", "a number from 0, shut, to 1, open", 0.0, 1.0)
POSITION = InputKind("-", "a number from -1 to 1", -1.0, 1.0)
SPEED = InputKind("-", "a relative speed of at least 0", 0.0)
ANGULAR_SPEED = InputKind("rad/s", "a finite number [rad/s]")
PRESSURE = InputKind("Pa", "an absolute pressure above 0 [Pa]", small=1e5)
HEAD = InputKind("m", "a head whose pressure is above 0 Pa absolute [m]", small=1e5)  # [Pa]
SET_PRESSURE = InputKind("Pa", "an absolute pressure [Pa]")
FLOW = InputKind("m3/s", "a finite number [m3/s]", small=1e-3)
FORCE = InputKind("N", "a finite number [N]", small=1e3)
TORQUE = InputKind("N m", "a finite number [N m]")
VALUE = InputKind("-", "a finite number")
STAGE = InputKind("m", "a level above the elevation of the basin [m]", small=0.1)
CREST = InputKind("m", "a height above datum [m]")
GATE_OPENING = InputKind("m", "an opening of at least 0 [m]", 0.0)


class Input(NamedTuple):
    """Schedule that can be held at a value; kernels read scale * value + offset.

    Under density laws other than `linear`, kernels read the value itself for pressures and heads.
    sort : kind of the input; schedule : its index in the table of schedules
    """

    sort: InputKind
    schedule: int
    scale: float = 1.0
    offset: float = 0.0
    node: int = -1  # node, for a pressure or head
    # schedules with the values max(0, a * value + b), and a, b
    parts: tuple[tuple[int, float, float], ...] = ()
    # slot of a feature that keeps the value within bounds, and number of these, see `Feature.to_hold`
    bounds: tuple[int, int] | None = None
    # in place of a schedule: slot of a feature, and number of its value
    held: tuple[int, int] | None = None


def opening_input(model, name: str) -> dict[str, Input]:
    """Input "opening" of a restriction : key -> input."""
    return {
        "opening": Input(
            OPENING, int(model.tables.valves[model.valve_names.index(name)]["schedule"])
        )
    }


TYPICAL_DROP = 1e5  # a typical pressure drop [Pa]
# Reynolds number below which a restriction is made laminar, to bound its slope at zero drop
LAMINAR_REYNOLDS = 10.0


class Lowering:
    """Conversion of parts of one kind to table rows: their numbers, start, inputs and probes.

    table : for links, the table of their rows: "pipe", "column", "valve", "brace", "stop" or "piston"; "" for nodes
    rows : number of rows of each part; rank : rows of kinds with greater rank come after those with lesser rank
    law : module of its compiled law, whose functions are named as in `kernels.calls.HOOKS`; if it has a `step`, that
    function gives the flow through its restriction, in place of the square-root law
    events : meaning of a zero of each event function, "" if it is not reported
    is_device : True if it is also a device, see `Device`
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

    def varied(self, **data: Any) -> Self:
        """Copy of this conversion with other data, such as other states."""
        other = copy.copy(self)
        vars(other).update(data)
        return other

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

    def motion_text(
        self, name: str, node: Any, row, inflow: float, flow: float, amount: Callable[..., str]
    ) -> str:
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

    def turns_with(self, part: Any) -> str | None:
        """Place of a network of rotation whose speed its law reads before the nodes are solved; None for none."""
        return None


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

    smooths: ClassVar[bool] = False  # True if the part has a method `smooth`

    def smooth(self, draft, row, drop: float) -> None:
        """Make the law of a VALVE row smooth below a drop [Pa] which no error tolerance shows."""

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
        per = math.sqrt(TYPICAL_DROP / (g * density_ratio))
        step = self.stepper(start, k, g, density_ratio)

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
        return lambda flow, drop: step_at(
            hook, start.out, start.handle, k, g, float(flow), float(drop), density_ratio
        )

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

    It is `NO_ROWS` if the kind has none. Raises FvsolveError for a faulty conversion or law of another package.
    """
    package = part.__module__.rpartition(".")[0]
    has_module = find_spec(f"{package}.lower") is not None
    if has_module:
        import_module(f"{package}.lower")
    lowering = Lowering.kinds.get(part.kind, NO_ROWS)
    if not has_module or package.startswith("fvsolve."):
        return lowering
    from fvsolve.core.assembly.lowering_checks import checked

    return checked(part, lowering)


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


class Device(Restriction):
    """Conversion of a kind of device to table rows: its states, and its state in the steady start.

    mode : code of the kind in its law
    quantities : names of its probes, in the order of codes in the law's `value`; if a part of another package leaves
    them out, those that it adds to the quantities of its base class
    events_only : True if only events open it; states : names of its states; remedy : advice for events that alternate
    controlling_event : index of the event by which it starts to control a rigid column, -1 for none
    """

    is_device, rank = True, 2
    mode: ClassVar[int] = 0
    events_only: ClassVar[bool] = False
    controlling_event: ClassVar[int] = -1
    states: ClassVar[tuple[str, ...]] = ()
    quantities: ClassVar[tuple[str, ...]] = ()
    remedy: ClassVar[str] = "give the part a time_constant"
    vessel: ClassVar[bool] = False  # True for a node whose pressure it computes
    follows_at_once: bool = True  # False if only the rates of its states depend on its schedule
    # True if a flow law of its own is laminar near zero drop, see `regularise`
    regular: ClassVar[bool] = False

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a vessel."""
        row["kind"], row["row"] = rec.VESSEL, draft.stiff()

    def pressure_at_start(self, start, i: int, node: Any, row) -> float | None:
        """Stated pressure [Pa] of a vessel at the start; None if it has none."""
        return node.initial_pressure

    def motion_text(
        self, name: str, node: Any, row, inflow: float, flow: float, amount: Callable[..., str]
    ) -> str:
        """Text of the rate of change of the pressure in a vessel that a net inflow causes at the start.

        Arguments as for `Lowering.motion_text`.
        """
        return f"{node.kind} {name}: pressure changes by {amount(row['stiffness'] * inflow, 'pressure', span=True)}/s"

    def gate(self, name: str) -> str | None:
        """Name of a further link that the device opens and closes; None for none."""
        return None

    def held_end(self, part: Any) -> str | None:
        """End at which its valve may hold the pressure at once, "from" or "to"; "" for its flow, None for nothing."""
        return None

    def sensed(self, part: Any) -> tuple[tuple[str, float], ...]:
        """Places that the part only senses, at most two, each with its weight in the pressure that lifts its valve."""
        return ()

    def row_of(self, model, name: str):
        """DEVICE row of the part `name`."""
        return model.tables.devices[
            [device_name for device_name, _, _ in model.devices].index(name)
        ]

    def probe(self, draft, name: str, probe: Any, row) -> None:
        """Fill the PROBE row of a probe of this part."""
        if probe.quantity in self.quantities:
            row["index"] = draft.device_names.index(draft.inside(name))
            row["kind"], row["side"] = rec.DEVICE_VALUE, self.quantities.index(probe.quantity)
        elif self.vessel:
            Lowering.probe(self, draft, name, probe, row)
        else:
            super().probe(draft, name, probe, row)

    def opening_at_start(self, start, part: Any, row, k: int) -> float:
        """Opening of its restriction k in the steady start, unless it is shut."""
        return 1.0

    def shut_reason(self, start, k: int) -> str:
        """Reason why its restriction k is shut in the steady start, for faults; "" for none."""
        return ""

    def states_of(self, draft, name: str, part: Any) -> tuple[str, ...]:
        """Names of the states of this part."""
        return self.states

    def integrals(self, row) -> int:
        """Number of its last states that only add up rates, on which nothing else depends; row : of the device"""
        return 0

    def scales(self, draft, name: str, part: Any) -> list[float]:
        """Size of a small deviation of each state of this part."""
        return []

    def schedules_of_rates(self, row, valves, floats) -> list[int]:
        """Indices of further schedules that the rates of its states read; row : of the device"""
        return []

    def schedules_at_once(self, row, valves, floats) -> list[int]:
        """Indices of the schedules, of the device and of its restriction, that it follows at once, -1 for none.

        The rates of its states read the others; row : of the device
        """
        own = int(row["schedule"]) if self.follows_at_once else -1
        opening = int(valves[row["valve"]]["schedule"]) if row["valve"] >= 0 else -1
        return [own, -1 if opening in self.schedules_of_rates(row, valves, floats) else opening]

    def revise_state(self, start, part: Any, row) -> bool:
        """Set the state of the device, such as open or shut, that the steady solution implies; True if it changed."""
        return False

    def begin(self, start, part: Any, row) -> list[str]:
        """Fill in data that depend on the initial steady state; return texts of motions at the start."""
        return []

    def flags_at_start(self, start, part: Any, row) -> dict[int, bool]:
        """Event flags of its state in the steady start: flag -> True if it is set.

        Other flags follow from the state and its flows. A network in which a shut valve is open may have other flows,
        for which further valves shut.
        """
        return {}

    def source_at_start(self, start, part: Any, row, quantity: str, flow: float) -> float:
        """Value at the start of a quantity that a source of the network reads.

        flow : flow at the start of the element whose difference of potentials the state of the device integrates
        """
        raise NotImplementedError

    def passing_notice(self, model, name: str, part: Any, time: float) -> Notice:
        """Notice that the part was temporarily outside the range of its law, first at `time` [s].

        The function `outside` of the law then returns TEMPORARY.
        """
        raise NotImplementedError

    def apply_event(self, run_data, row, t: float, y: np.ndarray, scale: np.ndarray) -> None:
        """Apply sudden changes of states at an event of the device to y, and new small deviations to `scale`."""

    def dissipates(self, part: Any) -> bool:
        """True if drop times flow in its restriction is dissipated; otherwise it is energy supplied."""
        return True

    def energy_rows(
        self, model, part: Any, row, y: np.ndarray, out: np.ndarray
    ) -> list[dict[int, float]]:
        """Rows of the energy matrix L that this part adds, each state -> factor.

        |L d|^2 is the energy [J] that a small deviation d of the states from y stores in the part. For a vessel the
        energy is m^2 dp/dm / (2 rho), m the deviation of its mass [kg]. Other kinds that store energy override this
        function.
        """
        if not self.vessel:
            return []
        node = model.tables.nodes[row["node"]]
        stiffness = float(out[model.layout["stiffness"] + node["row"]])
        return [{int(node["y"]): float(np.sqrt(stiffness / (2.0 * model.case.properties.density)))}]

    def above(self, model, part: Any, row) -> float:
        """Energy of the device at the start [J], above its least possible energy; 0 if it stores none."""
        return 0.0


def lower_devices(draft) -> None:
    """Fill the table of devices of a draft, with their states, numbers and event functions."""
    parts = [*draft.case.places.items(), *draft.case.conduits.items()]
    lowered = [(name, part, lowering_of(type(part)).of(part)) for name, part in parts]
    draft.devices = [(name, part, device) for name, part, device in lowered if device.is_device]
    table = draft.device_table = np.zeros(len(draft.devices), rec.DEVICE)
    for column in ("valve", "node", "second", "schedule", "y", "row", "travel"):
        table[column] = -1
    if draft.devices:
        from fvsolve.core.assembly.lowering_checks import check_states
    for k, ((name, part, device), row) in enumerate(zip(draft.devices, table, strict=True)):
        states = device.states_of(draft, name, part)
        row["hooks"], row["mode"], row["states"] = draft.hooks(device), device.mode, len(states)
        row["data"], row["opens_by_event"] = len(draft.floats), device.events_only
        row["event"] = draft.flags(name, device.events)
        row["controls_column"] = (
            row["event"] + device.controlling_event if device.controlling_event >= 0 else -1
        )
        if name in draft.valve_names:
            row["valve"] = draft.valve_names.index(name)
            for valve in draft.valve_table[row["valve"] :][: device.rows]:
                # it sets the opening
                valve["device"] = k if calls.hook_of(device.law, "set") is not None else -1
                valve["event"] = row["event"] if device.events else -1
                valve["data"] = row["data"] if valve["data"] < 0 else valve["data"]
        elif name in draft.node_index:
            row["node"] = draft.node_index[name]
            row["row"] = draft.node_table[row["node"]]["row"]
        for column, (place, weight) in zip(("node", "second"), device.sensed(part), strict=False):
            row[column], row[f"{column}_weight"] = draft.node_index[place], weight
        if (gate := device.gate(name)) is not None:
            row["valve"] = draft.valve_names.index(gate)
            draft.valve_table["device"][row["valve"]] = k
        draft.floats += device.numbers(draft, name, part)
        scales = device.scales(draft, name, part)
        check_states(name, part, device, states, scales)
        for state, scale in zip(states, scales, strict=True):
            at = draft.states([f"{name}.{state}"], scale)
            row["y"] = at if row["y"] < 0 else row["y"]


def opening_of(start, k: int) -> float:
    """Opening x between 0 and 1 at which valve k passes its steady flow, M |M| = G x^2 dP.

    M [kg/s] : mass flow; G [kg2/s2/Pa] : conductance fully open; dP [Pa] : pressure drop
    Below the valve's transition flow or rounding drop the law of `flow_at_drop` applies instead. Without a flow, or
    without a positive drop, x is 0; a greater flow than the open valve passes gives 1.
    """
    valve = start.valves[k]
    conductance, drop = start.valve_law(k)
    flow = abs(float(valve["flow"]))
    if flow == 0.0 or not conductance * drop > 0.0:
        return 0.0
    if flow >= valve["transition"] and drop >= valve["rounding_drop"]:
        return min(flow / math.sqrt(conductance * drop), 1.0)
    low, high, x = 0.0, 1.0, 0.5
    for _ in range(60):
        g = conductance * x * x
        low, high = (x, high) if flow_at_drop(g, transition_of(valve, g), drop) < flow else (low, x)
        x = 0.5 * (low + high)
    return x
