"""How parts with a law of their own become rows of tables. Knows scenes while they are built; knows no rhs."""

from __future__ import annotations

import functools
import math
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from fvsolve.kernels import limits
from fvsolve.kernels import records as rec
from fvsolve.kernels.valves import flow_at_drop, transition_of


class Device:
    """Parts of one kind: their rows, their numbers, how they start, what their events mean.

    law : module of its compiled law, whose functions are named as `kernels.calls.HOOKS`; mode : what that knows it as
    sudden : whether events alone open it; leads : which of its events lets it lead a rigid column, -1 for none
    states : names of what each holds
    quantities : probes, in the order in which `device_value` numbers them
    events : what it means that each event function falls to zero; remedy : what to try where they go to and fro
    """

    kinds: ClassVar[dict[str, Device]] = {}
    law: ClassVar[ModuleType]
    mode: ClassVar[int] = 0
    sudden: ClassVar[bool] = False
    leads: ClassVar[int] = -1
    states: ClassVar[tuple[str, ...]] = ()
    quantities: ClassVar[tuple[str, ...]] = ()
    events: ClassVar[tuple[str, ...]] = ()
    remedy: ClassVar[str] = "give it a time_constant"
    vessel: ClassVar[bool] = False  # a place whose pressure it computes

    def __init_subclass__(cls, kind: str) -> None:
        if kind:
            Device.kinds[kind] = cls()

    def of(self, part: Any) -> Device:
        """What lowers this part: itself, but where its keys ask for other states."""
        return self

    def restriction(self, draft, name: str, link: Any, row) -> None:
        """Fill the VALVE row of a link."""
        draft.restriction(name, link, row)

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a vessel."""

    def gate(self, name: str) -> str | None:
        """The link that a vessel opens and shuts beside."""
        return None

    def numbers(self, draft, name: str, part: Any) -> list[float]:
        """Its numbers, in the order in which its kernel reads them; those of the start come with `begin`."""
        return []

    def states_of(self, draft, name: str, part: Any) -> tuple[str, ...]:
        """Names of what one holds."""
        return self.states

    def scales(self, draft, name: str, part: Any) -> list[float]:
        """What counts as a small deviation of each of its states."""
        return []

    def edge(self, start, k: int):
        """Its edge in the steady problem, k its VALVE row; None for that of a valve, open as `start.shut` has it."""
        return None

    def revise(self, start, part: Any, row) -> bool:
        """Whether a steady solution asks for another state of it, which is then set."""
        return False

    def begin(self, start, part: Any, row) -> list[str]:
        """Fill in what depends on the profile; returns what moves, in words."""
        return []

    def resists(self, part: Any) -> bool:
        """Whether its restriction dissipates drop times flow; else that is energy supplied."""
        return True

    def settle(self, slate, row, y: np.ndarray, scale: np.ndarray) -> None:
        """Put into y what an event of its own does at once, and into `scale` what is a small deviation from now on."""

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
    """Fill the table of devices of a scene, with their states, numbers and event functions."""
    parts = [*draft.case.places.items(), *draft.case.conduits.items()]
    draft.devices = [(name, part, device.of(part)) for name, part in parts if (device := device_of(type(part)))]
    table = draft.device_table = np.zeros(len(draft.devices), rec.DEVICE)
    table["valve"] = table["node"] = table["schedule"] = table["y"] = table["row"] = -1
    laws = list(laws_of(draft.devices))
    for k, ((name, part, device), row) in enumerate(zip(draft.devices, table, strict=True)):
        states = device.states_of(draft, name, part)
        row["hooks"], row["mode"], row["states"] = laws.index(device.law.__name__), device.mode, len(states)
        row["sudden"] = device.sudden
        if name in draft.valve_names:
            row["valve"] = draft.valve_names.index(name)
            draft.valve_table["device"][row["valve"]] = k
        elif name in draft.node_index:
            row["node"] = draft.node_index[name]
            row["row"] = draft.node_table[row["node"]]["row"]
        if (gate := device.gate(name)) is not None:
            row["valve"] = draft.valve_names.index(gate)
            draft.valve_table["device"][row["valve"]] = k
        row["data"] = len(draft.floats)
        draft.floats += device.numbers(draft, name, part)
        for state, scale in zip(states, device.scales(draft, name, part), strict=True):
            at = draft.states([f"{name}.{state}"], scale)
            row["y"] = at if row["y"] < 0 else row["y"]
        row["event"] = limits.EVENTS * draft.tanks + len(draft.events)
        row["leads"] = row["event"] + device.leads if device.leads >= 0 else -1
        draft.events += [(name.removesuffix(".inside"), text) for text in device.events]


def laws_of(devices: list[tuple]) -> tuple[str, ...]:
    """The modules of the laws of devices, as rows of `hooks` lie."""
    return tuple(dict.fromkeys(device.law.__name__ for _, _, device in devices))


@functools.cache
def device_of(part: type) -> Device | None:
    """What lowers parts of a kind that have a law of their own: of the module `lower` beside theirs; None of others."""
    home = part.__module__.rpartition(".")[0]
    if find_spec(f"{home}.lower") is not None:
        import_module(f"{home}.lower")
    return Device.kinds.get(part.kind)


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
