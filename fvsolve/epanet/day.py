"""Translation of an EPANET network over a day: patterns as signals, controls and rules as blocks, no waves."""

import math
from typing import Any

from fvsolve.epanet import part_tables
from fvsolve.epanet.network_file import HourState
from fvsolve.epanet.switching import Statement, Untranslatable, clause_of, opposite, relay_keys, schedule_keys
from fvsolve.epanet.translating import US_UNITS, Translation

DAY = 86400.0  # length of the run [s]
DAY_LOSS = 1e-4  # loss coefficient of a valve that opens and shuts a link without loss in EPANET
STEP_WIDTH = 1e-3  # difference of levels over which the area of a tank changes at a point of its volume curve [m]
OPEN, CLOSED = 1.0, 0.0
RULE_TOLERANCE, FOOT = 1e-3, 0.3048  # of levels in EPANET's rules, in the length unit of the file; foot [m]


class DayTranslation(Translation):
    """Nodes, links, signals and controls of a case over a day, and notes on differences from EPANET.

    network : network of WNTR; hour : EPANET's solution at hour 0
    signals, controls : name -> table of the case file
    """

    def __init__(self, network: Any, hour: HourState) -> None:
        self.signals: dict[str, part_tables.Part] = {}
        self.controls: dict[str, part_tables.Part] = {}
        # relays with outputs 0 and 1: (tank, level at which it turns on, and off, state at the start) -> name
        self.relays: dict[tuple[str, float, float, bool], str] = {}
        self.inlets: dict[str, str] = {}  # EPANET's name of a tank -> junction before its altitude valve
        self.step = float(network.options.time.pattern_timestep)
        self.read_statements(network)
        super().__init__(network, hour, 0.0, 0.0)
        for tank, inlet in self.inlets.items():
            self.altitude_valve(tank, inlet)

    # patterns -----------------------------------------------------------------------------------------------

    def times(self) -> list[float]:
        """Times in the day at which patterns change, and its start [s]."""
        first = self.step - self.clock % self.step
        return [0.0, *(first + k * self.step for k in range(math.ceil((DAY - first) / self.step)))]

    def scheduled(self, series: Any, unit: str, multiplier: float = 1.0) -> Any:
        """Text or table of a schedule for a time series of EPANET: its base value times its pattern.

        unit : "l/s", "m" or "" ; multiplier : factor on all values
        """

        def text(value):
            return part_tables.quantity_text(value, unit) if unit else part_tables.rounded_number(value)

        base, pattern = multiplier * series.base_value, series.pattern
        if pattern is None or not base:
            return text(base)
        values = [float(pattern.at(t + self.clock)) for t in self.times()]
        if len(set(values)) == 1:
            return text(base * values[0])
        name = f"pattern-{self.pattern_name(series.pattern_name)}"
        self.signals[name] = step_table(self.times(), values)
        return {"signal": name, "factor": text(base)}

    def pattern_name(self, name: str) -> str:
        """Name of a pattern with the letters that a case file allows."""
        return "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in name)

    # nodes --------------------------------------------------------------------------------------------------

    def junction(self, name: str, node: Any) -> part_tables.Part:
        part = super().junction(name, node)
        parts = [item for item in node.demand_timeseries_list if item.base_value]
        part.pop("demand", None)
        if len(parts) == 1:
            demand = self.scheduled(parts[0], "l/s", self.multiplier)
        else:
            values = [node.demand_timeseries_list.at(t + self.clock, multiplier=self.multiplier) for t in self.times()]
            demand = part_tables.quantity_text(values[0], "l/s")
            if len(set(values)) > 1:
                texts = [part_tables.quantity_text(value, "l/s") for value in values]
                demand = step_table(self.times(), texts)
        if parts:
            self.demands[self.node_names.given[name]] = sum(item.base_value for item in parts)
            part["demand"] = demand
        return part

    def reservoir(self, name: str, node: Any) -> part_tables.Part:
        return super().reservoir(name, node) | {"head": self.scheduled(node.head_timeseries, "m")}

    def tank(self, name: str, node: Any) -> part_tables.Part:
        part = super().tank(name, node)
        if node.vol_curve is not None:
            part["area"] = area_table(node.vol_curve.points)
            self.notes_by_text.pop("volume curve: replaced by the area at the initial level", None)
        if getattr(node, "overflow", False):
            return part
        del part["height"]
        self.inlets[name] = self.node_names.new(f"{self.node_names.given[name]}-inlet")
        self.nodes[self.inlets[name]] = part_tables.junction(self.elevation[name], 0.0, self.position(node))
        return part

    def altitude_valve(self, name: str, inlet: str) -> None:
        """Add the valve that shuts a tank when it is full or empty; inlet : junction before it"""
        node, place = self.network.get_node(name), self.node_names.given[name]
        pipes = [self.network.get_link(link) for link in self.network.get_links_for_node(name)]
        diameter = max((pipe.diameter for pipe in pipes if pipe.link_type == "Pipe"), default=0.3)
        valve = part_tables.valve((inlet, place), diameter, DAY_LOSS) | {"type": "altitude-valve"}
        valve["full_level"] = part_tables.quantity_text(node.max_level, "m")
        if node.min_level > 0.0:
            valve["empty_level"] = part_tables.quantity_text(node.min_level, "m")
        self.links[self.link_names.new(f"{place}-altitude")] = valve

    # links --------------------------------------------------------------------------------------------------

    def ends(self, link: Any) -> tuple[str, str]:
        names = (link.start_node_name, link.end_node_name)
        return tuple(self.inlets.get(end, self.node_names.given[end]) for end in names)

    def pipe(self, name: str, link: Any) -> part_tables.Part:
        ends, ours = self.ends(link), self.link_names.given[name]
        if link.check_valve:
            place, last = self.node_before_end(name, link)
            self.links[self.link_names.new(f"{ours}-check")] = (
                part_tables.check_valve((place, last), link.diameter) | {"loss_coefficient": DAY_LOSS}
            )  # fmt: skip
            self.note("check valve: imported as a pipe with a check valve at its end", name)
            ends = (ends[0], place)
        elif (opening := self.opening(name, link)) != OPEN:
            ends = (ends[0], self.shut_off(name, link, link.diameter, opening))
        law = part_tables.friction(self.formula, link.roughness)
        length = self.lengths[name] = self.length(link)
        if length > link.length:
            law = self.spread(name, link, length)
            self.note(f"lengthened to {length:.4g} m; the friction loss is that of the original length", name)
        part = part_tables.pipe(ends, length, link.diameter, law, link.minor_loss, 1.0)
        del part["wave_speed"]
        return part

    def pump(self, name: str, link: Any) -> part_tables.Part:
        opening = self.opening(name, link)
        if opening == CLOSED:
            self.note("pump is always off: imported as a shut valve", name)
            return part_tables.valve(self.ends(link), self.bore(link), 0.0, opening=0.0)
        ends, given = self.ends(link), link.pump_type == "POWER"
        if opening != OPEN:
            ends = (ends[0], self.shut_off(name, link, self.bore(link), opening))
        law = part_tables.power(self.gravity * link.power) if given else part_tables.curve(link.get_pump_curve().points)
        part = part_tables.pump(ends, law, 1.0)
        own = self.statements.get(name, [])
        speeds = [item for item in own if item.speed]
        if not speeds:
            return part | {"speed": self.scheduled(link.speed_timeseries, "")}
        try:
            values = sorted({item.value for item in speeds} | {link.base_speed})
            if len(values) > 2:
                raise Untranslatable("sets more than two speeds of a pump")
            on = [(item.clause, item.value == values[-1]) for item in speeds]
            speed = self.two_states(name, "speed", on, link.base_speed == values[-1], (values[0], values[-1]))
        except Untranslatable as reason:
            self.leave_out(speeds, str(reason))
            speed = part_tables.rounded_number(link.base_speed)
        return part | {"speed": speed}

    def valve(self, name: str, link: Any) -> part_tables.Part:
        own = self.statements.get(name, [])
        status = [item for item in own if not item.speed]
        self.leave_out([item for item in own if item.speed], "sets a valve")
        part = super().valve(name, link)
        if link.valve_type in ("PBV", "GPV"):
            self.note(f"{link.valve_type}: its loss coefficient is that of hour 0 all day", name)
        if not status:
            return part
        if part["type"] != "valve":
            self.leave_out(status, "opens or shuts a regulating valve")
            return part
        opening = self.opening(name, link)
        return part if opening == OPEN else part | {"opening": opening}

    def node_before_end(self, name: str, link: Any) -> tuple[str, str]:
        """(new junction before the end of a link, node at this end), by their names in the case."""
        return self.junction_before_end(name, link), self.ends(link)[1]

    def shut_off(self, name: str, link: Any, diameter: float, opening: Any) -> str:
        """Add a valve at the end of a link that opens and shuts it; return the junction before the valve."""
        place, last = self.node_before_end(name, link)
        valve = part_tables.valve((place, last), diameter, DAY_LOSS)
        self.links[self.link_names.new(f"{self.link_names.given[name]}-shut")] = valve | {"opening": opening}
        self.note("opens and shuts by a valve at its end" if opening != CLOSED else "always shut, by a valve", name)
        return place

    # controls and rules ---------------------------------------------------------------------------------------

    def read_statements(self, network: Any) -> None:
        """Read what controls and rules do: statements for each link, by EPANET's name, in EPANET's order."""
        self.statements: dict[str, list[Statement]] = {}
        self.refused: list[tuple[str, str]] = []  # reason, name of the control or rule
        clock = float(network.options.time.start_clocktime)
        tolerance = RULE_TOLERANCE * (FOOT if network.options.hydraulic.inpfile_units in US_UNITS else 1.0)
        for number, (_, control) in enumerate(network.controls(), start=1):
            is_rule = type(control).__name__ == "Rule"
            label = f"rule {control.name}" if is_rule else f"control {number}"
            try:
                clause = clause_of(control.condition, clock, DAY, tolerance if is_rule else 0.0)
                actions = [(action, clause) for action in control._then_actions]
                actions += [(action, opposite(clause)) for action in control._else_actions]
            except Untranslatable as reason:
                self.refused.append((str(reason), label))
                continue
            for action, when in actions:
                link, attribute, value = action._target_obj, action._attribute, float(action._value)
                speed = attribute in ("base_speed", "setting")
                if speed and link.link_type == "Pump" and value == 0.0:
                    speed = False
                item = Statement(label, when, value, speed)
                self.statements.setdefault(link.name, []).append(item)

    def leave_out(self, statements: list[Statement], reason: str) -> None:
        """Note controls and rules that are not imported."""
        for item in statements:
            self.note(f"not imported, because it {reason}", item.label)

    def opening(self, name: str, link: Any) -> Any:
        """Opening of a link over the day: 1, 0, a schedule, or a table that names a block."""
        own = [item for item in self.statements.get(name, []) if not item.speed]
        begins = str(link.initial_status) != "Closed"
        if not own:
            return OPEN if begins else CLOSED
        return self.two_states(name, "opening", [(item.clause, item.value != 0.0) for item in own], begins, (0.0, 1.0))

    def two_states(self, name: str, key: str, actions: list, begins: bool, values: tuple[float, float]) -> Any:
        """Value of a key that actions switch between two values: number, schedule, or table that names a block.

        actions : pairs (clause, True if it sets the second value); begins : True if EPANET starts with the second value
        """
        state = begins
        for clause, on in actions:
            state = on if clause.at_start(self.network) else state
        output = [part_tables.rounded_number(value) for value in values]
        if all(clause.intervals is not None for clause, _ in actions):
            times, states = schedule_keys(actions, begins, DAY)
            if len(times) == 1:
                return output[states[0]]
            return {"time": times, "value": [output[k] for k in states], "kind": "step"}
        ours = self.link_names.given[name] + ("" if key == "opening" else f"-{key}")
        probes = {tank: f"nodes.{place}.level" for tank, place in self.node_names.given.items()}
        keys = relay_keys(actions)
        if keys is not None:
            tank, on, off = keys
            if (other := self.relays.get((tank, off, on, not state))) is not None and output == [0, 1]:
                self.controls[ours] = {
                    "type": "function",
                    "inputs": {"other": f"controls.{other}"},
                    "formula": "1 - other",
                }
                return {"control": ours}  # both switch at one time
            if output == [0, 1]:
                other = self.relays.setdefault((tank, on, off, state), ours)
                if other != ours:
                    return {"control": other}
            block = {"type": "relay", "input": probes[tank], "on": part_tables.quantity_text(on, "m"),
                     "off": part_tables.quantity_text(off, "m")}  # fmt: skip
        else:
            block = {"type": "latch"}
            for side, word in ((True, "set"), (False, "reset")):
                clauses = [clause for clause, on in actions if on is side]
                block[word] = f"controls.{ours}-{word}"
                self.controls[f"{ours}-{word}"] = function_table(clauses, probes)
        block["initial"] = int(state)
        if output != [0, 1]:
            block["output"] = output
        self.controls[ours] = block
        return {"control": ours}

    @property
    def notes(self) -> list[tuple[str, list[str]]]:
        for reason, label in self.refused:
            self.note(f"not imported, because it {reason}", label)
        return super().notes

    def options(self, hydraulic: Any) -> None:
        super().options(hydraulic)
        if self.pressure_driven:
            self.note("demands that depend on pressure follow it at once", "PDA")


def step_table(times: list[float], values: list[Any]) -> part_tables.Part:
    """Table of a schedule of steps, without entries at which nothing changes; times [s]."""
    changes = [k for k in range(len(times)) if k == 0 or values[k] != values[k - 1]]
    numbers = [values[k] if isinstance(values[k], str) else part_tables.rounded_number(values[k]) for k in changes]
    return {"time": [part_tables.rounded_number(times[k]) for k in changes], "value": numbers, "kind": "step"}


def area_table(points: list[tuple[float, float]]) -> part_tables.Part:
    """Area of the surface over the level from the points (level [m], volume [m3]) of a volume curve.

    EPANET's area is constant between points; here it changes within `STEP_WIDTH` at each point.
    """
    areas = [(v1 - v0) / (z1 - z0) for (z0, v0), (z1, v1) in zip(points[:-1], points[1:], strict=True)]
    level, area = [0.0], [areas[0]]
    for (z, _), before, after in zip(points[1:-1], areas[:-1], areas[1:], strict=True):
        level += [z - 0.5 * STEP_WIDTH, z + 0.5 * STEP_WIDTH]
        area += [before, after]
    return {"level": [part_tables.rounded_number(z) for z in level],
            "area": [part_tables.rounded_number(a) for a in area]}  # fmt: skip


def function_table(clauses: list, probes: dict[str, str]) -> part_tables.Part:
    """Table of a `function` that is 1 where one of the clauses holds, else 0; probes : tank -> probe of its level"""
    inputs = list(dict.fromkeys(tank for clause in clauses for tank in clause.tanks))
    names = {tank: f"level_{k + 1}" for k, tank in enumerate(inputs)}
    texts = [clause.text(names) for clause in clauses] or ["0"]
    formula = texts[0] if len(texts) == 1 else f"1 - {'*'.join(f'(1 - {text})' for text in texts)}"
    table = {"type": "function", "formula": formula}
    return table | ({"inputs": {names[tank]: probes[tank] for tank in inputs}} if inputs else {})
