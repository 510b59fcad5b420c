"""Spool valves in the tables of a model: a row for each metering edge, and a device if the spool is not given."""

import math

from fvsolve.core.assembly.lowering import POSITION, Device, Input, Restriction
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import Notice
from fvsolve.parts.spool_valve import law
from fvsolve.parts.spool_valve.part import EDGES, PORTS

MOTION_EVENTS = (
    "reaches its upper stop",
    "leaves its upper stop",
    "reaches its lower stop",
    "leaves its lower stop",
    "moves forward at its greatest speed",
    "is slower again",
    "moves backward at its greatest speed",
    "is slower again",
    "",
    "",
    "",
    "",
    "",
    "",
    "",
    "",
)


class SpoolValveRows(Restriction, kind="spool-valve"):
    """Conversion to table rows of spool valves: a row for each metering edge.

    The openings of edges follow schedules. Edges that open alike have one schedule.
    """

    rank = 1

    def __init__(self, ways: str = "4/3") -> None:
        self.edges, self.ports, self.rows = EDGES[ways], PORTS[ways], len(EDGES[ways])

    def of(self, part) -> Restriction:
        # at its stop 0, where the position does not follow its schedule
        stops = part.ways_of == "2/2"
        if part.natural_frequency is not None or part.dead_band or stops:
            return CommandedRows(part)
        return SpoolValveRows(part.ways_of)

    def fill(self, draft, name, link, rows) -> None:
        raw, openings = draft.schedules.add(link.schedule), {}
        for edge, row in zip(self.edges, rows, strict=True):
            line = link.opening_line(edge)
            if line not in openings:
                openings[line] = draft.schedules.add_part(link.schedule, *line)
            row["schedule"], row["command"] = openings[line], raw
            self.fill_edge(draft, name, link, edge, row)

    def fill_edge(self, draft, name, link, edge, row) -> None:
        """Fill the row of an edge, except its opening."""
        row["from_node"], row["to_node"] = (draft.node_index[link.ports[port]] for port in edge[:2])
        self.restriction(draft, name, link, row)

    def row_names(self, name) -> list[str]:
        return [f"{name}.{start}-{end}" for start, end, _ in self.edges]

    def probe(self, draft, name, probe, row) -> None:
        first, port = draft.valve_names.index(name), probe.quantity.removeprefix("flow_")
        if port in self.ports:  # its flow is that of the edges there
            row["index"], row["kind"], row["count"] = first, rec.SPOOL_FLOW, self.rows
            row["weights"] = len(draft.floats)
            draft.floats += [float((port == start) - (port == end)) for start, end, _ in self.edges]
        else:
            self.position_probe(draft, name, probe, row)

    def position_probe(self, draft, name, probe, row) -> None:
        """Fill the row of the probe `position`."""
        row["index"] = draft.valve_table[draft.valve_names.index(name)]["command"]
        row["kind"], row["scale"] = rec.SCHEDULE_VALUE, 1.0

    def inputs(self, model, name, part):
        first = model.tables.valves[(k := model.valve_names.index(name)) : k + self.rows]
        parts = {
            int(row["schedule"]): part.opening_line(edge)
            for edge, row in zip(self.edges, first, strict=True)
        }
        parts = tuple((schedule, *line) for schedule, line in parts.items())
        return {part.input_key: Input(POSITION, int(first[0]["command"]), parts=parts)}


class CommandedRows(SpoolValveRows, Device, kind=""):
    """Conversion to table rows of spool valves whose spool follows a command, or has a stop at 0."""

    law = law
    quantities = ("position",)
    remedy = "give the spool valve a greater dead_band or damping_ratio"

    def __init__(self, part) -> None:
        super().__init__(part.ways_of)
        self.moves = part.natural_frequency is not None
        self.states = ("position", "speed") if self.moves else ()
        self.follows_at_once = not self.moves
        places = {edge: edge[2] * part.overlap_of(edge) for edge in self.edges}
        self.positions = sorted(set(places.values()))  # at which an edge opens
        self.flags = [law.EDGE + 2 * self.positions.index(place) for place in places.values()]
        self.events = (*MOTION_EVENTS, *[""] * (2 * len(self.positions)))

    def fill(self, draft, name, link, rows) -> None:
        for edge, row in zip(self.edges, rows, strict=True):
            row["schedule"] = -1
            self.fill_edge(draft, name, link, edge, row)

    def numbers(self, draft, name, part) -> list[float]:
        draft.device_table["schedule"][draft.device_names.index(name)] = draft.schedules.add(
            part.schedule
        )
        lines = [
            [*part.opening_line(edge), flag]
            for edge, flag in zip(self.edges, self.flags, strict=True)
        ]
        lines = [float(number) for line in lines for number in line]
        fastest = 0.0 if part.stroke_time is None else 1.0 / part.stroke_time
        frequency = 2.0 * math.pi * (part.natural_frequency or 0.0)
        damping = part.damping_ratio or 0.0
        return [
            0.0,
            self.least,
            frequency,
            damping,
            fastest,
            0.5 * (part.hysteresis or 0.0),
            part.dead_band or 0.0,
            float(self.rows),
            float(law.FIRST_EDGE + len(lines)),
            *lines,
            float(len(self.positions)),
            *self.positions,
        ]

    @property
    def least(self) -> float:
        """Position of the lower stop."""
        return 0.0 if self.rows == 1 else -1.0

    def scales(self, draft, name, part) -> list[float]:
        return [0.1, 0.1 * 2.0 * math.pi * part.natural_frequency] if self.moves else []

    def position_probe(self, draft, name, probe, row) -> None:
        Device.probe(self, draft, name, probe, row)

    def position_at_start(self, start, part, row) -> float:
        """Position of the spool at the start; row : that of its device."""
        position = part.after_dead_band(start.schedule_value(row["schedule"]))
        return max(position, self.least)

    def opening_at_start(self, start, part, row, k) -> float:
        a, b = part.opening_line(self.edges[k - int(row["valve"])])
        return max(a * self.position_at_start(start, part, row) + b, 0.0)

    def begin(self, start, part, row) -> list[str]:
        start.draft.tables.floats[row["data"] + law.START] = self.position_at_start(
            start, part, row
        )
        name, k = start.draft.valve_names[row["valve"]], int(row["valve"])
        ends = {
            int(valve[end])
            for valve in start.valves[k : k + self.rows]
            for end in ("from_node", "to_node")
        }
        if max(map(part.overlap_of, self.edges)) >= 0.0 and any(
            start.nodes["gates"][i] >= 0 for i in ends
        ):
            text = (
                f"{name}: a rigid column ends at a port that its spool shuts: steps become very short there; make "
                "the column a pipe, put a chamber between them, or give the edges an underlap"
            )
            start.draft.warnings.append(Notice("range", f"links.{name}", text))
        return []

    def apply_event(self, run_data, row, t, y, scale) -> None:
        armed = run_data.armed
        at = int(row["event"])
        o = int(row["y"])
        if not self.moves:
            return
        floats, data = run_data.model.tables.floats, int(row["data"])
        for flag, stop in ((law.UPPER, 1.0), (law.LOWER, self.least)):
            if armed[at + flag] > 0.0:
                y[o], y[o + 1] = stop - floats[data + law.START], 0.0
                return
        for flag, side in ((law.FORWARD, 1.0), (law.BACKWARD, -1.0)):
            if armed[at + flag] > 0.0:
                y[o + 1] = side * floats[data + law.FASTEST]

    def inputs(self, model, name, part):
        return {part.input_key: Input(POSITION, int(self.row_of(model, name)["schedule"]))}
