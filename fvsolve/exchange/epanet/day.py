"""Translation of an EPANET network over a day: patterns as signals, controls and rules as blocks, no waves."""

import math
from collections.abc import Callable
from typing import Any

from fvsolve.errors import listing
from fvsolve.exchange.epanet import part_tables, switching
from fvsolve.exchange.epanet.network_file import (
    EpanetLink,
    EpanetNetwork,
    EpanetNode,
    EpanetSolution,
)
from fvsolve.exchange.epanet.switching import DAY, Clause, Source, Statement
from fvsolve.exchange.epanet.translating import NARROW, STALL_FLOW, Translation, initial_action

# difference of levels over which the area of a tank changes at a point of its volume curve [m]
STEP_WIDTH = 1e-3
OPEN, CLOSED = 1.0, 0.0
MOST_SPEED = 3.0  # relative speed above which a setting is probably a power or a percentage
# time constant with which a block reads a head or a flow, which would follow its own action at once
FILTER = "10 s"
# Least time between two switches of a link by actions that hold on both sides of one level; in EPANET the time of rules
REST = "1 min"
# Set points of a regulating valve that a control holds open: heads of water [m], and a flow [m3/s]
HELD_OPEN = {"PRV": 1e4, "PSV": -9.0, "FCV": 1e3}
RULES_AT_START = (
    "a rule that holds at the start acts at once, in EPANET after its first rule time step"
)
UNITS = {"PRV": "barg", "PSV": "barg", "FCV": "l/s"}

Action = tuple[Any, ...]


class DayTranslation(Translation):
    """Nodes, links, signals and controls of a case over a day, and notes on differences from EPANET.

    solution : EPANET's solution at hour 0; end : of the run [s]
    signals, controls : name -> table of the case file; energy : table with prices and efficiencies of pumps
    """

    def __init__(self, network: EpanetNetwork, solution: EpanetSolution, end: float = DAY) -> None:
        self.network = network
        self.signals: dict[str, part_tables.Part] = {}
        self.controls: dict[str, part_tables.Part] = {}
        self.energy: part_tables.Part = {}
        self.end = end
        # relays with outputs 0 and 1: (tank, level at which it turns on, and off, state at the start) -> name
        self.relays: dict[tuple[str, float, float, bool], str] = {}
        # -> name of the block that subtracts the source from it
        self.margins: dict[switching.ThresholdSteps, str] = {}
        # (tank, link) -> junction before its altitude valve
        self.inlets: dict[tuple[str, str], str] = {}
        self.openings: dict[str, Any] = {}  # EPANET's name of a link -> value of its key `opening`
        self.step = float(network.times["pattern_step"])
        found, self.refused = switching.statements(network, end)
        self.statements: dict[str, list[Statement]] = {}
        for item in found:
            self.statements.setdefault(item.link, []).append(item)
        self.start_values = switching.values_at_start(network, solution)
        for name, link in network.links.items():
            if link.kind == "pump" and link.pattern > 0:
                self.statements[name] = self.pattern_statements(link)
            self.start_values["open", name] = float(initial_action(link)[0] != "closed")
        super().__init__(network, solution, 0.0, 0.0)
        self.energy = self.energy_table()

    # patterns -----------------------------------------------------------------------------------------------

    def times(self) -> list[float]:
        """Times in the run at which patterns change, and its start [s]."""
        first = self.step - self.network.times["pattern_start"] % self.step
        return [
            0.0,
            *(first + k * self.step for k in range(math.ceil((self.end - first) / self.step))),
        ]

    def scheduled(self, base: float, pattern: int, unit: str) -> Any:
        """Text or table of a schedule for a base value times a pattern.

        pattern : its index, 0 for none; unit : "l/s", "m" or ""
        """
        text = quantity(unit)
        if pattern <= 0 or not base:
            return text(base)
        values = [self.network.pattern_at(pattern, at) for at in self.times()]
        if len(set(values)) == 1:
            return text(base * values[0])
        return {"signal": self.pattern_signal(pattern, values), "factor": text(base)}

    def pattern_signal(self, pattern: int, values: list[float] | None = None) -> str:
        """Name of the signal of a pattern, which is added if it is new; values : those at `times`"""
        name = "".join(
            letter if letter.isascii() and (letter.isalnum() or letter in "_-") else "_"
            for letter in self.network.patterns[pattern - 1][0]
        )
        name = f"pattern-{name}"
        if name not in self.signals:
            times = self.times()
            self.signals[name] = step_table(
                times, values or [self.network.pattern_at(pattern, at) for at in times]
            )
        return name

    def pattern_statements(self, pump: EpanetLink) -> list[Statement]:
        """Actions on a pump whose speed has a pattern: EPANET sets status and speed by it again at each step.

        So the status at the start of the file does not count, and a control or rule lasts for one step only.
        """
        replaced = (
            "lasts for one step: EPANET sets a pump by the pattern of its speed again at the next"
        )
        self.refused += [
            (replaced, item.label)
            for item in self.statements.get(pump.name, [])
            if item.clause.intervals != ()
        ]
        times, found = self.times(), []
        for begin, stop in zip(times, [*times[1:], math.inf], strict=True):
            speed = self.network.pattern_at(pump.pattern, begin)
            clause = switching.interval_clause([(begin, stop)])
            found.append(
                Statement(
                    "pattern", clause, pump.name, ("setting", speed) if speed else ("closed",)
                )
            )
        return found

    # nodes --------------------------------------------------------------------------------------------------

    def junction(self, node: EpanetNode) -> part_tables.Part:
        part = part_tables.junction(self.elevation[node.name], 0.0, node.position)
        network = self.network
        amounts = [(base, network.demand_pattern(index)) for base, index in node.demands if base]
        if not amounts:
            return part
        bases: dict[int, float] = {}
        for base, index in amounts:
            bases[index] = bases.get(index, 0.0) + base * self.option["multiplier"]
        parts = [self.scheduled(base, index, "l/s") for index, base in bases.items()]
        changing = any(isinstance(item, dict) for item in parts)
        constant = part_tables.quantity_text(network.demand_at(node, 0.0), "l/s")
        part["demand"] = (
            constant if not changing else parts[0] if len(parts) == 1 else {"sum": parts}
        )
        self.demands[self.node_names.given[node.name]] = sum(base for base, _ in amounts)
        return part | self.pressure_keys(node, max(base for base, _ in amounts) > 0.0)

    def reservoir(self, node: EpanetNode) -> part_tables.Part:
        return super().reservoir(node) | {"head": self.scheduled(node.elevation, node.pattern, "m")}

    def tank(self, node: EpanetNode) -> part_tables.Part:
        part = super().tank(node)
        if node.volume is not None:
            part["area"] = area_table(node.volume)
            self.notes_by_text.pop("volume curve: replaced by the area at the initial level", None)
        if not node.overflow:
            del part["height"]
        name = self.node_names.given[node.name]
        for link in self.network.links_at[node.name]:
            inlet = self.inlets[node.name, link.name] = self.node_names.new(f"{name}-inlet")
            other = link.start if link.end == node.name else link.end
            low = min(
                self.elevation[node.name], self.elevation.get(other, math.inf)
            )  # so that a dry tank has no vacuum
            self.nodes[inlet] = part_tables.junction(low, 0.0, node.position)
            self.links[self.link_names.new(f"{name}-altitude")] = self.altitude_valve(
                node, link, (inlet, name)
            )
        return part

    def altitude_valve(
        self, node: EpanetNode, link: EpanetLink, ends: tuple[str, str]
    ) -> part_tables.Part:
        """Table of the valve that shuts a link at a full or an empty tank, as EPANET does for each link by itself."""
        diameter = link.diameter if link.kind == "pipe" else self.bore(link)
        valve = part_tables.valve(ends, diameter, 0.0) | {"type": "altitude-valve"}
        if not node.overflow:
            valve["full_level"] = part_tables.quantity_text(node.maximum, "m")
        return valve | {"empty_level": part_tables.quantity_text(node.minimum, "m")}

    # links --------------------------------------------------------------------------------------------------

    def ends(self, link: EpanetLink) -> tuple[str, str]:
        return tuple(
            self.inlets.get((end, link.name), self.node_names.given[end])
            for end in (link.start, link.end)
        )

    def pipe(self, link: EpanetLink) -> part_tables.Part:
        ends, ours = self.ends(link), self.link_names.given[link.name]
        if link.check_valve:
            place = self.junction_before_end(link)
            self.links[self.link_names.new(f"{ours}-check")] = part_tables.check_valve(
                (place, ends[1]), link.diameter
            )
            self.note("check valve: imported as a pipe with a check valve at its end", link.name)
            ends = (ends[0], place)
        elif link.diameter < NARROW and self.opening(link.name) == CLOSED:
            return self.narrow(link, ends)
        elif (opening := self.opening(link.name)) != OPEN:
            ends = (ends[0], self.shut_off(link, link.diameter, opening))
        part = self.pipe_table(link, ends)
        del part["wave_speed"]
        return part

    def pump(self, link: EpanetLink) -> part_tables.Part:
        opening, ends = self.opening(link.name), self.ends(link)
        if opening == CLOSED:
            self.note("pump is always off: imported as a shut valve", link.name)
            return part_tables.valve(ends, self.bore(link), 0.0, opening=0.0)
        if (
            opening == OPEN
            and link.power is not None
            and abs(self.solution.flow[link.name]) < STALL_FLOW
        ):
            return self.stalled(link, ends)
        if opening != OPEN and not link.pattern:
            ends = (ends[0], self.shut_off(link, self.bore(link), opening))
        part = part_tables.pump(ends, self.head_law(link), 1.0) | self.energy_keys(link)
        if link.pattern > 0:
            return part | {"speed": self.scheduled(1.0, link.pattern, "")}
        begins = initial_action(link)
        speeds = [
            speed
            for item in self.statements.get(link.name, [])
            if (speed := speed_of(item.action)) is not None
        ]
        if max(speeds, default=1.0) > MOST_SPEED:
            text = f"a control sets a relative speed above {MOST_SPEED:g}, and EPANET takes it: heads have no meaning"
            self.note(text, link.name, True)
        return part | {
            "speed": self.switched(link.name, "speed", "", speed_of, speed_of(begins) or 1.0)
        }

    def energy_table(self) -> part_tables.Part:
        """Table `[energy]` with EPANET's global values; empty if the file states no price and no efficiency curve."""
        pumps = [link for link in self.network.links.values() if link.kind == "pump"]
        option = self.option
        stated = (
            option["price"]
            or option["demand_charge"]
            or any(pump.price or pump.efficiency_curve for pump in pumps)
        )
        if not pumps or not stated:
            return {}
        table: part_tables.Part = {
            "overall_efficiency": part_tables.rounded_number(0.01 * option["efficiency"])
        }
        if option["price"]:
            table["price"] = self.scheduled(option["price"], option["price_pattern"], "")
        if option["demand_charge"]:
            table["demand_charge"] = part_tables.rounded_number(option["demand_charge"])
        return table

    def energy_keys(self, link: EpanetLink) -> part_tables.Part:
        """Keys of a pump with its own efficiency curve and price; the global values replace what is missing."""
        keys: part_tables.Part = {}
        flow, share = zip(*(link.efficiency_curve or [(0.0, 0.0)]), strict=True)
        if link.efficiency_curve and max(flow) <= 0.0:  # EPANET holds the last value
            keys["overall_efficiency"] = part_tables.rounded_number(
                max(share[-1], part_tables.LEAST_EFFICIENCY)
            )
        elif link.efficiency_curve:
            keys["overall_efficiency"] = {
                "flow": [part_tables.quantity_text(q, "l/s") for q in flow],
                "efficiency": [part_tables.rounded_number(e) for e in share],
            }
        price = link.price or self.option["price"]
        pattern = link.price_pattern or self.option["price_pattern"]
        own = link.price or (link.price_pattern and price)
        return keys | {"price": self.scheduled(price, pattern, "")} if own else keys

    def valve(self, link: EpanetLink) -> part_tables.Part:
        kind = link.kind
        begins = initial_action(link)
        own = self.statements.get(link.name, [])
        settings = {action for item in own if (action := item.action)[0] != "closed"} - {begins}
        settings -= {("open",)} if kind == "GPV" else set()  # it keeps its curve
        opening, ends = self.opening(link.name), self.ends(link)
        if not settings or kind in ("PBV", "GPV"):
            self.leave_out(
                [item for item in own if item.action in settings], "sets a valve of this kind"
            )
            if opening == CLOSED or begins[0] == "closed":
                begins = ("closed",) if opening == CLOSED else self.open_state(link)
            if opening not in (OPEN, CLOSED):
                ends = (ends[0], self.shut_off(link, self.valve_diameter(link), opening))
            return self.valve_table(link, ends, begins)
        if opening != OPEN:
            ends = (ends[0], self.shut_off(link, self.valve_diameter(link), opening))
        return self.set_valve(link, ends, begins)

    def regulating(
        self, link: EpanetLink, ends: tuple[str, str], diameter: float, setting: float
    ) -> part_tables.Part:
        """Table of a regulating valve that acts at once, as in EPANET, unless another one is next to it.

        A PSV that alone supplies the nodes behind it would leave their demands without supply. EPANET opens it instead.
        """
        if link.kind == "PSV" and link.end not in self.network.supplied(
            lambda other: other is not link
        ):
            text = "PSV alone supplies the nodes behind it, so EPANET opens it where it would act"
            self.note(f"{text}: imported as a check valve", link.name)
            return part_tables.check_valve(ends, diameter, link.minor_loss)
        near = (other for end in (link.start, link.end) for other in self.network.links_at[end])
        if any(other.kind in part_tables.REGULATING and other.name != link.name for other in near):
            return super().regulating(link, ends, diameter, setting)
        set_point = self.set_point(link, setting)
        return part_tables.regulating(link.kind, ends, diameter, set_point, link.minor_loss, "0 s")

    def may_run(self, link: EpanetLink) -> bool:
        """True unless a pump is off all day."""
        return self.opening(link.name) != CLOSED

    def full_open_loss(self, link: EpanetLink, diameter: float) -> float:
        """Loss coefficient of a regulating valve at full opening: EPANET's, since it may open fully over the day."""
        return link.minor_loss

    def open_state(self, link: EpanetLink) -> Action:
        """State of a valve that begins closed, after an action opens it: active with its setting, or fixed open."""
        opens = {
            item.action for item in self.statements.get(link.name, []) if item.action[0] != "closed"
        }
        opens -= {("open",)} if link.kind == "GPV" else set()
        return ("open",) if ("open",) in opens else ("setting", link.setting)

    def set_valve(
        self, link: EpanetLink, ends: tuple[str, str], begins: Action
    ) -> part_tables.Part:
        """Table of a valve whose setting follows controls or rules."""
        kind = link.kind
        if kind in part_tables.REGULATING:

            def value_of(action: Action) -> float | None:
                if action[0] == "closed":
                    return None
                return (
                    self.set_point(link, action[1]) if action[0] == "setting" else HELD_OPEN[kind]
                )

            first = begins if begins[0] != "closed" else self.open_state(link)
            part = self.valve_table(link, ends, ("setting", link.setting))
            if part["type"] in ("valve", "check-valve"):
                self.leave_out(
                    self.statements[link.name], "sets a valve that does not regulate here"
                )
                return part
            key = "set_flow" if kind == "FCV" else "set_pressure"
            return part | {
                key: self.switched(link.name, key, UNITS[kind], value_of, value_of(first))
            }

        def opening_of(action: Action) -> float | None:
            """Opening that gives the loss coefficient of a TCV, or the area of a PCV, over that at full opening."""
            if action[0] == "closed":
                return None
            if kind == "PCV":
                return 1.0 if action[0] == "open" else self.position_share(link, action[1])
            return math.sqrt(least / max(loss_of(action), least))

        def loss_of(action: Action) -> float:
            """Loss coefficient of a TCV: its setting, which replaces the minor loss, and may be below it."""
            return action[1] if action[0] == "setting" else link.minor_loss

        first = begins if begins[0] != "closed" else self.open_state(link)
        actions = [
            first,
            *(item.action for item in self.statements[link.name] if item.action[0] != "closed"),
        ]
        least = max(min(map(loss_of, actions)), part_tables.NO_LOSS)
        part = part_tables.valve(ends, link.diameter, least if kind == "TCV" else link.minor_loss)
        return part | {
            "opening": self.switched(link.name, "setting", "", opening_of, opening_of(first))
        }

    def shut_off(self, link: EpanetLink, diameter: float, opening: Any) -> str:
        """Add a valve at the end of a link that opens and shuts it; return the junction before the valve."""
        last = self.ends(link)[1]
        place = self.junction_before_end(link)
        valve = part_tables.valve((place, last), diameter, 0.0)
        self.links[self.link_names.new(f"{self.link_names.given[link.name]}-shut")] = valve | {
            "opening": opening
        }
        self.note(
            "opens and shuts by a valve at its end"
            if opening != CLOSED
            else "always shut, by a valve",
            link.name,
        )
        return place

    # controls and rules ---------------------------------------------------------------------------------------

    def leave_out(self, statements: list[Statement], reason: str) -> None:
        """Note controls and rules that are not imported."""
        for item in statements:
            self.note(f"not imported, because it {reason}", item.label, True)

    def opening(self, name: str) -> Any:
        """Opening of a link over the day: 1, 0, a schedule, or a table that names a block."""
        if name not in self.openings:
            begins = self.start_values["open", name]
            # what a rule on its own state reads
            self.openings[name] = {"control": self.link_names.given[name]}
            self.openings[name] = self.switched(
                name, "opening", "", lambda action: float(action[0] != "closed"), begins
            )
        return self.openings[name]

    def switched(
        self,
        name: str,
        key: str,
        unit: str,
        value_of: Callable[[Action], float | None],
        begins: float,
    ) -> Any:
        """Value of a key that controls and rules switch: number or text, schedule, or table that names a block.

        value_of : action -> value in SI, None if the action leaves the key as it is; begins : value before hour 0 [SI]
        """
        stated = [
            (item.clause, value)
            for item in self.statements.get(name, ())
            if (value := value_of(item.action)) is not None
        ]
        actions = switching.simplified(stated)
        text, value = quantity(unit), begins
        values = {value for _, value in actions} | {begins}
        if len(values) == 1:
            return text(begins)
        for clause, result in actions:
            value = result if clause.holds(self.start_values) else value
        self.note_rules_at_start(name, value_of, begins, value)
        if not any(clause.sources for clause, _ in actions):
            times, found = switching.schedule_keys(actions, begins, self.end)
            return (
                step_table(times, [text(item) for item in found])
                if len(times) > 1
                else text(found[0])
            )
        ours = self.link_names.given[name] + ("" if key == "opening" else f"-{key}")
        if key == "opening":
            self.start_values["open", name] = value
        if len(values) == 2:
            rests = switching.lacks_dead_band(stated)
            if rests:
                text = "actions on both sides of one level would switch without end: the link rests after each switch"
                self.note(f"{text} for {REST}, in EPANET for its rule time step", name, True)
            return self.two_states(ours, actions, value, sorted(values), text, rests)
        return self.several_states(ours, actions, value, sorted(values), text)

    def note_rules_at_start(
        self, name: str, value_of: Callable[[Action], float | None], begins: float, value: float
    ) -> None:
        """Note a link that has another state at the start because of rules; value : that at the start, as `begins`"""
        before = begins
        for item in self.statements.get(name, ()):
            result = value_of(item.action)
            if not item.of_rule and result is not None and item.clause.holds(self.start_values):
                before = result
        if before != value:
            self.note(RULES_AT_START, name)

    def two_states(
        self,
        ours: str,
        actions: list[tuple[Clause, float]],
        value: float,
        values: list[float],
        text: Callable[[float], Any],
        rests: bool,
    ) -> part_tables.Part:
        """Table that names a relay or latch between two values.

        ours : name of the block; value : that at the start; rests : as for `latch`
        """
        state, plain = value == values[1], values == [0.0, 1.0]
        keys = switching.relay_keys(actions, values[1])
        if keys is not None:
            tank, on, off = keys
            if plain and (other := self.relays.get((tank, off, on, not state))) is not None:
                table = {
                    "type": "function",
                    "inputs": {"other": f"controls.{other}"},
                    "formula": "1 - other",
                }
                self.controls[ours] = table
                return {"control": ours}  # both switch at one time
            if plain:
                other = self.relays.setdefault((tank, on, off, state), ours)
                if other != ours:
                    return {"control": other}
            block = {
                "type": "relay",
                "input": self.probe(("level", tank)),
                "on": part_tables.quantity_text(on, "m"),
                "off": part_tables.quantity_text(off, "m"),
            }
        elif rests and not plain:  # a timer reads 0 and 1, so the latch has these outputs
            state_name = f"{ours}-state"
            self.controls[state_name] = self.latch(state_name, actions, values[1], True) | {
                "initial": int(state)
            }
            low, high = (in_si(item, text) for item in values)
            table = {
                "type": "function",
                "inputs": {"state": f"controls.{state_name}"},
                "formula": f"{low!r} + {high - low!r}*state",
            }
            self.controls[ours] = table | limits(values, text)
            return {"control": ours}
        else:
            block = self.latch(ours, actions, values[1], rests)
        block["initial"] = int(state)
        if not plain:
            block["output"] = [text(item) for item in values]
        self.controls[ours] = block | limits(values, text)
        return {"control": ours}

    def several_states(
        self,
        ours: str,
        actions: list[tuple[Clause, float]],
        value: float,
        values: list[float],
        text: Callable[[float], Any],
    ) -> part_tables.Part:
        """Table that names a function of latches, one for each value; exactly one latch is on."""
        names = {item: f"{ours}-{k + 1}" for k, item in enumerate(values)}
        for item, latch in names.items():
            self.controls[latch] = self.latch(latch, actions, item) | {
                "initial": int(item == value)
            }
        inputs = {f"on_{k + 1}": f"controls.{latch}" for k, latch in enumerate(names.values())}
        terms = [f"{in_si(item, text)!r}*{own}" for item, own in zip(values, inputs, strict=True)]
        table = {"type": "function", "inputs": inputs, "formula": " + ".join(terms)}
        self.controls[ours] = table | limits(values, text)
        return {"control": ours}

    def latch(
        self, ours: str, actions: list[tuple[Clause, float]], value: float, rests: bool = False
    ) -> part_tables.Part:
        """Table of a latch that is on from an action that sets a value until one that sets another value.

        rests : True if it may switch back only after the time REST; a timer has then followed it
        """
        sources = list(dict.fromkeys(source for clause, _ in actions for source in clause.sources))
        names = {source: f"{source[0]}_{k + 1}" for k, source in enumerate(sources)}
        formulas = switching.prevailing(actions, names)
        others = [formula for item, formula in formulas.items() if item != value]
        off = (
            others[0]
            if len(others) == 1
            else f"1 - {'*'.join(f'(1 - ({item}))' for item in others) or '1'}"
        )
        block: part_tables.Part = {"type": "latch"}
        for word, formula in (("set", formulas.get(value, "0")), ("reset", off)):
            block[word] = f"controls.{ours}-{word}"
            timed = (
                f"({formula})*{'(1 - rested)' if word == 'set' else 'rested'}" if rests else formula
            )
            self.controls[f"{ours}-{word}"] = table = self.function(timed, names)
            if rests:
                table["inputs"] = table.get("inputs", {}) | {"rested": f"controls.{ours}-rest"}
        if rests:
            timer = {
                "type": "timer",
                "input": f"controls.{ours}",
                "on_delay": REST,
                "off_delay": REST,
            }
            self.controls[f"{ours}-rest"] = timer
        return block

    def function(self, formula: str, names: dict[Source, str]) -> part_tables.Part:
        """Table of a `function` block; names : source -> its name in the formula"""
        read = {source: name for source, name in names.items() if name in formula}
        table: part_tables.Part = {"type": "function", "formula": formula}
        if read:
            table["inputs"] = {name: self.probe(source) for source, name in read.items()}
        if any(source[0] in ("head", "flow") for source in read):
            table["filter"] = FILTER
        return table

    def probe(self, source: Source) -> str:
        """Probe of a source of a condition."""
        kind, name = source
        if kind == "margin":
            return f"controls.{self.margin(name)}"
        if kind == "open":
            return self.opening_probe(name)
        if kind == "flow":
            return f"links.{self.link_names.given[name]}.flow"
        return f"nodes.{self.node_names.given[name]}.{kind}"

    def margin(self, steps: switching.ThresholdSteps) -> str:
        """Name of the block with a threshold that changes with the time minus its source, which is added if new."""
        if steps not in self.margins:
            name = self.margins[steps] = self.link_names.new(
                f"{self.node_names.given[steps.source[1]]}-margin"
            )
            texts = [part_tables.quantity_text(value, "m") for value in steps.value]
            block = {
                "type": "pi",
                "input": self.probe(steps.source),
                "setpoint": step_table([*steps.time], texts),
            }
            filtered = {"filter": FILTER} if steps.source[0] == "head" else {}
            self.controls[name] = block | {"gain": 1} | filtered
        return self.margins[steps]

    def opening_probe(self, name: str) -> str:
        """Name of a block whose output is the opening of a link, which is added for a constant or a schedule."""
        opening = self.opening(name)
        if isinstance(opening, dict) and "control" in opening:
            return f"controls.{opening['control']}"
        block = f"{self.link_names.given[name]}-open"
        if isinstance(opening, dict):
            times, values = [*opening["time"], 2.0 * self.end + 1.0], opening["value"]
            spans = [(times[k], times[k + 1]) for k, value in enumerate(values) if value]
            formula = switching.interval_text(switching.clipped(spans, self.end))
        else:
            formula = f"{opening:g} + 0*t"
        self.controls[block] = {"type": "function", "formula": formula}
        return f"controls.{block}"

    @property
    def start_causes(self) -> list[str]:
        """Notes on what makes heads or flows differ from EPANET at the start alone."""
        return [
            f"{text} ({listing(names)})" for text, names in self.notes if text == RULES_AT_START
        ]

    @property
    def notes(self) -> list[tuple[str, list[str]]]:
        for reason, label in self.refused:
            self.note(f"not imported, because it {reason}", label, True)
        return super().notes

    def note_omissions(self) -> None:
        super().note_omissions()
        if self.pressure_driven:
            self.note("demands that depend on pressure follow it at once", "PDA")


def speed_of(action: Action) -> float | None:
    """Relative speed that an action gives a pump: EPANET opens a pump with speed 1; None if the action stops it."""
    if action[0] == "setting":
        return action[1] or None
    return 1.0 if action[0] == "open" else None


def quantity(unit: str) -> Callable[[float], Any]:
    """Function (value [SI]) -> its text in a unit, or its number without unit; heads of water [m] in "barg"."""
    if unit == "barg":
        return part_tables.gauge_pressure
    return (
        (lambda value: part_tables.quantity_text(value, unit))
        if unit
        else part_tables.rounded_number
    )


def limits(values: list[float], text: Callable[[float], Any]) -> part_tables.Part:
    """Key `limits` of a block with given values, which a case requires for a pressure."""
    return (
        {"limits": [text(values[0]), text(values[-1])]}
        if text is part_tables.gauge_pressure
        else {}
    )


def in_si(value: float, text: Callable[[float], Any]) -> float:
    """Number of a value in a formula, in SI: an absolute pressure for a head of water in "barg"."""
    if text is part_tables.gauge_pressure:
        return part_tables.AMBIENT + part_tables.WEIGHT * value
    return value


def step_table(times: list[float], values: list[Any]) -> part_tables.Part:
    """Table of a schedule of steps, without entries at which nothing changes; times [s]."""
    changes = [k for k in range(len(times)) if k == 0 or values[k] != values[k - 1]]
    numbers = [
        values[k] if isinstance(values[k], str) else part_tables.rounded_number(values[k])
        for k in changes
    ]
    return {
        "time": [part_tables.rounded_number(times[k]) for k in changes],
        "value": numbers,
        "kind": "step",
    }


def area_table(points: list[tuple[float, float]]) -> part_tables.Part:
    """Area of the surface over the level from the points (level [m], volume [m3]) of a volume curve.

    EPANET's area is constant between points; here it changes within `STEP_WIDTH` at each point.
    """
    areas = [
        (v1 - v0) / (z1 - z0) for (z0, v0), (z1, v1) in zip(points[:-1], points[1:], strict=True)
    ]
    level, area = [0.0], [areas[0]]
    for (z, _), before, after in zip(points[1:-1], areas[:-1], areas[1:], strict=True):
        level += [z - 0.5 * STEP_WIDTH, z + 0.5 * STEP_WIDTH]
        area += [before, after]
    return {
        "level": [part_tables.rounded_number(z) for z in level],
        "area": [part_tables.rounded_number(a) for a in area],
    }
