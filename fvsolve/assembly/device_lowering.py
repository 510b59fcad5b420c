"""Table of devices: parts with a compiled law of their own."""

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from fvsolve.assembly.lowering import Lowering, Restriction, lowering_of
from fvsolve.errors import Notice
from fvsolve.kernels import calls
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.restrictions import flow_at_drop, transition_of


class Device(Restriction):
    """Conversion of a kind of device to table rows: its states, and its state in the steady start.

    mode : code of the kind in its law; quantities : names of its probes, in the order of codes in the law's `value`
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

    def place(self, draft, name: str, node: Any, row) -> None:
        """Fill the NODE row of a vessel."""
        row["kind"], row["row"] = rec.VESSEL, draft.stiff()

    def pressure_at_start(self, start, i: int, node: Any, row) -> float | None:
        """Stated pressure [Pa] of a vessel at the start; None if it has none."""
        return node.initial_pressure

    def motion_text(self, name: str, node: Any, row, inflow: float, flow: float, amount: Callable[..., str]) -> str:
        """Text of the rate of change of the pressure in a vessel that a net inflow causes at the start.

        Arguments as for `Lowering.motion_text`.
        """
        return f"{node.kind} {name}: pressure changes by {amount(row['stiffness'] * inflow, 'pressure', span=True)}/s"

    def gate(self, name: str) -> str | None:
        """Name of a further link that the device opens and closes; None for none."""
        return None

    def row_of(self, model, name: str):
        """DEVICE row of the part `name`."""
        return model.tables.devices[[device_name for device_name, _, _ in model.devices].index(name)]

    def probe(self, draft, name: str, probe: Any, row) -> None:
        """Fill the PROBE row of a probe of this part."""
        if probe.quantity in self.quantities:
            row["index"] = draft.device_names.index(draft.inside(name))
            row["kind"], row["side"] = rec.DEVICE_VALUE, self.quantities.index(probe.quantity)
        elif self.vessel:
            Lowering.probe(self, draft, name, probe, row)
        else:
            super().probe(draft, name, probe, row)

    def states_of(self, draft, name: str, part: Any) -> tuple[str, ...]:
        """Names of the states of this part."""
        return self.states

    def scales(self, draft, name: str, part: Any) -> list[float]:
        """Size of a small deviation of each state of this part."""
        return []

    def revise_state(self, start, part: Any, row) -> bool:
        """Set the state of the device, such as open or shut, that the steady solution implies; True if it changed."""
        return False

    def begin(self, start, part: Any, row) -> list[str]:
        """Fill in data that depend on the initial steady state; return texts of motions at the start."""
        return []

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

    def energy_rows(self, model, part: Any, row, y: np.ndarray, out: np.ndarray) -> list[dict[int, float]]:
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
    table["valve"] = table["node"] = table["schedule"] = table["y"] = table["row"] = -1
    for k, ((name, part, device), row) in enumerate(zip(draft.devices, table, strict=True)):
        states = device.states_of(draft, name, part)
        row["hooks"], row["mode"], row["states"] = draft.hooks(device), device.mode, len(states)
        row["data"], row["opens_by_event"], row["event"] = (
            len(draft.floats),
            device.events_only,
            draft.flags(name, device.events),
        )
        row["controls_column"] = row["event"] + device.controlling_event if device.controlling_event >= 0 else -1
        if name in draft.valve_names:
            row["valve"] = draft.valve_names.index(name)
            link_device(draft.valve_table[row["valve"]], device, k, row)
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


def link_device(valve, device: Device, k: int, row) -> None:
    """Write the offsets of flags and numbers of a device to its VALVE row, and its number if it sets the opening.

    A device sets the opening of the valve if its law has a function `set`.
    """
    valve["device"] = k if calls.hook_of(device.law, "set") is not None else -1
    valve["event"], valve["data"] = row["event"], row["data"] if valve["data"] < 0 else valve["data"]


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
