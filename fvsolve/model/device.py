"""How parts that act by a law of their own become rows of tables. Knows drafts; knows no rhs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels import calls
from fvsolve.kernels import records as rec
from fvsolve.kernels.valves import flow_at_drop, transition_of
from fvsolve.model.lowering import Lowering, Restriction, lowering_of


class Device(Restriction):
    """Parts of one kind with a row among the devices: what they hold, how they stand in a steady state.

    mode : what their law knows the row as; quantities : probes, in the order in which its `value` numbers them
    sudden : whether events alone open it; leads : which of its events lets it lead a rigid column, -1 for none
    states : names of what each holds; remedy : what to try where its events go to and fro
    """

    acts, rank = True, 2
    mode: ClassVar[int] = 0
    sudden: ClassVar[bool] = False
    leads: ClassVar[int] = -1
    states: ClassVar[tuple[str, ...]] = ()
    quantities: ClassVar[tuple[str, ...]] = ()
    remedy: ClassVar[str] = "give it a time_constant"
    vessel: ClassVar[bool] = False  # a place whose pressure it computes

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a vessel."""
        row["kind"], row["row"] = rec.VESSEL, draft.stiff()

    def pressure_at_start(self, start, i: int, node: Any, row) -> float | None:
        """As of `Lowering`: what a vessel is said to have at the start."""
        return node.initial_pressure

    def moves(self, name: str, node: Any, row, inflow: float, flow: float, told: Callable[..., str]) -> str:
        """As of `Lowering`."""
        return f"{node.kind} {name}: pressure changes by {told(row['stiffness'] * inflow, 'pressure', span=True)}/s"

    def gate(self, name: str) -> str | None:
        """The link that a vessel opens and shuts beside."""
        return None

    def row_of(self, model, name: str):
        """The DEVICE row of one."""
        return model.tables.devices[[one for one, _, _ in model.devices].index(name)]

    def probe(self, draft, name: str, probe: Any, row) -> None:
        """As of `Lowering`."""
        if probe.quantity in self.quantities:
            row["index"] = draft.device_names.index(draft.inside(name))
            row["kind"], row["side"] = rec.DEVICE_VALUE, self.quantities.index(probe.quantity)
        elif self.vessel:
            Lowering.probe(self, draft, name, probe, row)
        else:
            super().probe(draft, name, probe, row)

    def states_of(self, draft, name: str, part: Any) -> tuple[str, ...]:
        """Names of what one holds."""
        return self.states

    def scales(self, draft, name: str, part: Any) -> list[float]:
        """What counts as a small deviation of each of its states."""
        return []

    def revise(self, start, part: Any, row) -> bool:
        """Whether a steady solution asks for another state of it, which is then set."""
        return False

    def begin(self, start, part: Any, row) -> list[str]:
        """Fill in what depends on the profile; returns what moves, in words."""
        return []

    def passing(self, model, name: str, part: Any, time: float) -> Notice:
        """What is to be known where its law's `outside` said PASSING, at first at that time."""
        raise NotImplementedError

    def settle(self, slate, row, t: float, y: np.ndarray, scale: np.ndarray) -> None:
        """Put into y what an event of its own does at once, and into `scale` what is a small deviation from now on."""

    def resists(self, part: Any) -> bool:
        """Whether its restriction dissipates drop times flow; else that is energy supplied."""
        return True

    def squares(self, model, part: Any, row, y: np.ndarray, out: np.ndarray) -> list[dict[int, float]]:
        """Rows of L with |L dy|^2 the energy [J] that a small deviation dy from y stores in it, state -> factor.

        Of a vessel, m^2 dp/dm / (2 rho) of its mass; nothing of others.
        """
        if not self.vessel:
            return []
        node = model.tables.nodes[row["node"]]
        stiffness = float(out[model.layout["stiffness"] + node["row"]])
        return [{int(node["y"]): float(np.sqrt(stiffness / (2.0 * model.case.properties.density)))}]

    def above(self, model, part: Any, row) -> float:
        """Energy that it holds at the start above the least it can hold [J]."""
        return 0.0


def lower_devices(draft) -> None:
    """Fill the table of devices of a draft, with their states, numbers and event functions."""
    parts = [*draft.case.places.items(), *draft.case.conduits.items()]
    lowered = [(name, part, lowering_of(type(part)).of(part)) for name, part in parts]
    draft.devices = [(name, part, device) for name, part, device in lowered if device.acts]
    table = draft.device_table = np.zeros(len(draft.devices), rec.DEVICE)
    table["valve"] = table["node"] = table["schedule"] = table["y"] = table["row"] = -1
    for k, ((name, part, device), row) in enumerate(zip(draft.devices, table, strict=True)):
        states = device.states_of(draft, name, part)
        row["hooks"], row["mode"], row["states"] = draft.hooks(device), device.mode, len(states)
        row["data"], row["sudden"], row["event"] = len(draft.floats), device.sudden, draft.flags(name, device.events)
        row["leads"] = row["event"] + device.leads if device.leads >= 0 else -1
        if name in draft.valve_names:
            row["valve"] = draft.valve_names.index(name)
            sets_up(draft.valve_table[row["valve"]], device, k, row)
        elif name in draft.node_index:
            row["node"] = draft.node_index[name]
            row["row"] = draft.node_table[row["node"]]["row"]
        if (gate := device.gate(name)) is not None:
            row["valve"] = draft.valve_names.index(gate)
            draft.valve_table["device"][row["valve"]] = k
        draft.floats += device.numbers(draft, name, part)
        for state, scale in zip(states, device.scales(draft, name, part), strict=True):
            at = draft.states([f"{name}.{state}"], scale)
            row["y"] = at if row["y"] < 0 else row["y"]


def sets_up(valve, device: Device, k: int, row) -> None:
    """Let a VALVE row know its device: which opens it if its law has a `set`, and where its flags and numbers stand."""
    valve["device"] = k if calls.hook_of(device.law, "set") is not None else -1
    valve["event"], valve["data"] = row["event"], row["data"] if valve["data"] < 0 else valve["data"]


def opening_of(start, k: int) -> float:
    """Opening x between 0 and 1 at which valve k passes its flow of the profile, M |M| = G x^2 dP."""
    valve = start.valves[k]
    dense, drop = start.law_of(k)
    flow = abs(float(valve["flow"]))
    if flow == 0.0 or not dense * drop > 0.0:
        return 0.0
    if flow >= valve["transition"] and drop >= valve["unseen"]:
        return min(flow / math.sqrt(dense * drop), 1.0)
    low, high, x = 0.0, 1.0, 0.5
    for _ in range(60):
        g = dense * x * x
        low, high = (x, high) if flow_at_drop(g, transition_of(valve, g), drop) < flow else (low, x)
        x = 0.5 * (low + high)
    return x
