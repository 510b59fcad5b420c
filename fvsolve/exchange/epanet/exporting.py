"""Conversion of a case to the text of an EPANET file, for the parts that EPANET has."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.case import Case
from fvsolve.errors import FvsolveError
from fvsolve.exchange.epanet.part_tables import (
    GRAVITY,
    WATER_VISCOSITY,
    WEIGHT,
    manning_share,
    rounded_number,
)
from fvsolve.parts.pipe.part import Pipe
from fvsolve.parts.pump.parallel import combined_pump

LONGEST_NAME = 31  # of EPANET, in characters
SHORT_PIPE = 0.01  # length of the pipe that stands for a check valve [m]
SMOOTH = {"H-W": 150.0, "C-M": 0.009, "D-W": 1e-6}  # roughness of that pipe; EPANET refuses 0
FORMULAS = {
    "hazen-williams": "H-W",
    "chezy-manning": "C-M",
    "quasi-steady": "D-W",
    "steady": "D-W",
    "swamee-jain": "D-W",
}
REGULATING = {"pressure-reducing": "PRV", "pressure-sustaining": "PSV", "flow-control": "FCV"}
# formula of a block that does the opposite of a relay, as the import writes it
NEGATION = "1 - other"
GENERAL_DIAMETER = 100.0  # of a valve whose loss follows a curve [mm]
HIGH_LEVEL = 1000.0  # greatest level of a tank that has none [m]


def network_text(case: Case) -> tuple[str, list[str]]:
    """(text of the EPANET file, notes on what EPANET has not) of a case.

    Raises FvsolveError with all parts that EPANET cannot express.
    """
    export = _Export(case)
    if export.faults:
        count = len(export.faults)
        head = f"{count} part{'' if count == 1 else 's'} that EPANET cannot express"
        raise FvsolveError("\n".join([head, *(f"  {fault}" for fault in export.faults)]))
    return export.text(), export.notes


class _Export:
    """Sections of an EPANET file in l/s, m and mm, made from a case.

    sections : name -> lines; faults : parts that EPANET cannot express; notes : what is left out
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.sections: dict[str, list[str]] = {}
        self.faults: list[str] = []
        self.notes: list[str] = []
        self.patterns: dict[tuple[float, ...], str] = {}
        self.curves: dict[tuple[tuple[float, float], ...], str] = {}
        self.step = self.pattern_step()
        self.formula = self.loss_formula()
        self.gravity = case.properties.density * case.gravity / WEIGHT
        self.minor = GRAVITY / case.gravity  # EPANET divides minor losses by its own gravity
        self.exponents: set[float] = set()
        self.pressures: set[tuple[float, float, float]] = set()
        writers = {
            "junction": self.junction,
            "reservoir": self.reservoir,
            "tank": self.tank,
            "inflow": self.inflow,
        }
        for name, node in case.nodes.items():
            self.check_name(name, "nodes")
            self.part(name, "nodes", node, writers)
        writers = {
            "pipe": self.pipe,
            "valve": self.valve,
            "orifice": self.valve,
            "altitude-valve": self.altitude_valve,
        }
        writers |= {"check-valve": self.check_valve, "loss-curve": self.loss_curve}
        writers |= dict.fromkeys(REGULATING, self.regulating)
        writers |= {"pump": self.pump, "leak": self.leak}
        for name, link in case.links.items():
            self.check_name(name, "links")
            self.part(name, "links", link, writers)
        for name, block in case.controls.items():
            self.control(name, block)
        if len(self.exponents) > 1:
            self.faults.append(
                f"links: leaks have different exponents, {sorted(self.exponents)}; EPANET has one exponent"
            )
        if len(self.pressures) > 1:
            self.faults.append(
                "nodes: demands depend on pressure by different keys; EPANET has one set for all junctions"
            )

    def part(self, name: str, group: str, part: Any, writers: dict[str, Callable]) -> None:
        """Write a part, or report that EPANET has none of its kind."""
        kind = "pipe" if isinstance(part, Pipe) else part.kind  # of any pipe model
        if kind not in writers:
            kinds = ", ".join(writers)
            self.faults.append(
                f"{group}.{name}: EPANET has no {kind}; expected {kinds}; leave it out of the case"
            )
            return
        writers[kind](name, part)

    def check_name(self, name: str, group: str) -> None:
        if len(name) > LONGEST_NAME:
            text = f"the name has {len(name)} characters; expected at most {LONGEST_NAME}, which EPANET reads"
            self.faults.append(f"{group}.{name}: {text}")

    def add(self, section: str, *words: Any) -> None:
        """Add a line to a section; numbers with ten digits."""
        texts = [
            word if isinstance(word, str) else str(rounded_number(float(word))) for word in words
        ]
        self.sections.setdefault(section, []).append(" ".join(texts))

    # schedules ------------------------------------------------------------------------------------------------

    def pattern_step(self) -> float:
        """Longest step [s] at which all step schedules of the case change; 1 h without any."""
        times = set()
        for part in (*self.case.nodes.values(), *self.case.links.values()):
            for key in ("demand", "head", "flow", "speed"):
                schedule = getattr(part, key, None)
                if getattr(schedule, "kind", "") == "step":
                    times |= {float(t) for t in schedule.time if t > 0.0}
        if not times:
            return 3600.0
        seconds = [round(t) for t in times]
        return float(math.gcd(*seconds)) if all(abs(t - round(t)) < 1e-6 for t in times) else 60.0

    def scheduled(self, where: str, schedule: Any, factor: float) -> tuple[float, str]:
        """(base value in the unit of the file, name of its pattern or "") of a schedule; factor : to that unit"""
        if schedule.kind == "constant":
            return schedule.first * factor, ""
        if schedule.kind != "step":
            text = (
                f"a schedule of kind {schedule.kind} has no pattern; expected steps, or a constant"
            )
            self.notes.append(f"{where}: {text}: its first value is written")
            return schedule.first * factor, ""
        count = max(1, math.ceil(self.case.numerics.end / self.step))
        at = np.searchsorted(schedule.time, np.arange(count) * self.step + 1e-9, side="right") - 1
        values = schedule.value[np.maximum(at, 0)]
        base = float(np.abs(values).max()) or 1.0
        shape = tuple(float(f"{value:.10g}") for value in values / base)
        name = self.patterns.setdefault(shape, f"pattern{len(self.patterns) + 1}")
        return base * factor, name

    # nodes ----------------------------------------------------------------------------------------------------

    def position(self, name: str, node: Any) -> None:
        if getattr(node, "position", None) is not None:
            self.add("COORDINATES", name, *node.position[:2])

    def elevation(self, name: str) -> float:
        return float(self.case.elevation(name) or 0.0)

    def junction(self, name: str, node: Any) -> None:
        base, pattern = self.scheduled(f"nodes.{name}.demand", node.demand, 1e3)
        self.add("JUNCTIONS", name, self.elevation(name), base, pattern)
        self.position(name, node)
        if node.required_pressure is not None:
            weight, ambient = WEIGHT, self.case.ambient_pressure
            least = (
                0.0 if node.minimum_pressure is None else (node.minimum_pressure - ambient) / weight
            )
            self.pressures.add(
                (least, (node.required_pressure - ambient) / weight, node.demand_exponent)
            )

    def inflow(self, name: str, node: Any) -> None:
        base, pattern = self.scheduled(f"nodes.{name}.flow", node.flow, -1e3)
        self.add("JUNCTIONS", name, self.elevation(name), base, pattern)
        self.position(name, node)

    def reservoir(self, name: str, node: Any) -> None:
        if node.head is None:
            weight = self.case.properties.density * self.case.gravity
            first = (node.pressure.first - self.case.ambient_pressure) / weight + self.elevation(
                name
            )
            self.add("RESERVOIRS", name, first)
        else:
            base, pattern = self.scheduled(f"nodes.{name}.head", node.head, 1.0)
            self.add("RESERVOIRS", name, base, pattern)
        self.position(name, node)

    def tank(self, name: str, node: Any) -> None:
        valves = [
            link
            for link in self.case.links.values()
            if link.kind == "altitude-valve" and link.to == name
        ]
        full = min(
            (valve.full_level for valve in valves if valve.full_level is not None),
            default=node.height,
        )
        least = max(
            (valve.empty_level for valve in valves if valve.empty_level is not None), default=0.0
        )
        full, curve = full or HIGH_LEVEL, ""
        if hasattr(node.area, "area"):
            curve = self.volume_curve(node.area, full)
        diameter = math.sqrt(4.0 / math.pi * float(np.min(getattr(node.area, "area", node.area))))
        spills = ["YES"] if node.height is not None and not valves else []
        tail = [curve or "*", *spills] if curve or spills else []
        self.add("TANKS", name, self.elevation(name), node.level, least, full, diameter, 0.0, *tail)
        self.position(name, node)

    def volume_curve(self, table: Any, full: float) -> str:
        """Name of the volume curve of an area that depends on the level."""
        level, area = np.asarray(table.level), np.asarray(table.area)
        volume = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(level) * (area[1:] + area[:-1]))))
        points = [*zip(level.tolist(), volume.tolist(), strict=True)]
        if level[-1] < full:
            points.append((full, float(volume[-1] + area[-1] * (full - level[-1]))))
        return self.curve(points)

    def curve(self, points: list[tuple[float, float]]) -> str:
        return self.curves.setdefault(tuple(points), f"curve{len(self.curves) + 1}")

    # links ----------------------------------------------------------------------------------------------------

    def loss_formula(self) -> str:
        """Formula of the head loss of all pipes."""
        models = [link.friction for link in self.pipes() if link.friction is not None]
        found = {
            FORMULAS[item.model]
            for item in models
            if item.model in FORMULAS and item.factor is None
        }
        if len(found) > 1:
            text = f"pipes have the formulas {', '.join(sorted(found))}; EPANET has one formula for all pipes"
            self.faults.append(f"links: {text}")
        if any(item.roughness is not None and item.model != "swamee-jain" for item in models):
            text = "EPANET has the Darcy factor of Swamee and Jain, within about 3 % of Colebrook's"
            self.notes.append(f'links: {text}; friction model = "swamee-jain" has the same')
        return next(iter(sorted(found)), "H-W")

    def pipes(self) -> list[Any]:
        return [link for link in self.case.links.values() if isinstance(link, Pipe)]

    def pipe(self, name: str, link: Any) -> None:
        friction = link.friction
        stated = friction is not None and (
            friction.roughness is not None or friction.coefficient is not None
        )
        if not stated or FORMULAS.get(friction.model) != self.formula:
            text = "EPANET needs hazen-williams, chezy-manning, or a roughness"
            self.faults.append(f"links.{name}.friction: {text}; expected one of these models")
            return
        is_darcy = self.formula == "D-W"
        rough = max(1e3 * friction.roughness, SMOOTH["D-W"]) if is_darcy else friction.coefficient
        if self.formula == "C-M":
            rough /= manning_share(link.diameter)
        ends, minor = (link.from_, link.to), self.minor * (link.minor_loss or 0.0)
        self.add("PIPES", name, *ends, link.length, 1e3 * link.diameter, rough, minor, "Open")

    def size(self, link: Any) -> tuple[float, float]:
        """(diameter [mm], loss coefficient at full opening by EPANET's gravity) of a restriction."""
        area = link.flow_area(self.case.properties.density)
        if link.diameter is not None and link.loss_coefficient is not None:
            return 1e3 * link.diameter, self.minor * link.loss_coefficient
        return 1e3 * math.sqrt(4.0 / math.pi * area), self.minor

    def valve(self, name: str, link: Any) -> None:
        diameter, loss = self.size(link)
        opening = link.opening
        if opening.kind == "control":
            first = 1.0
        elif opening.kind not in ("constant", "step"):
            self.notes.append(
                f"links.{name}.opening: a schedule of kind {opening.kind} is left out: its first value counts"
            )
            first = opening.first
        else:
            first = opening.first
        if link.characteristic != "linear":
            self.notes.append(
                f"links.{name}.characteristic: EPANET has none; the loss is that of a linear characteristic"
            )
        self.add(
            "VALVES",
            name,
            link.from_,
            link.to,
            diameter,
            "TCV",
            self.throttled(loss, first or 1.0),
            0.0,
        )
        if first == 0.0:
            self.add("STATUS", name, "CLOSED")
        if opening.kind == "step":
            for time, value in zip(opening.time[1:], opening.value[1:], strict=True):
                action = self.throttled(loss, value) if value > 0.0 else "CLOSED"
                self.add("CONTROLS", "LINK", name, action, "AT TIME", time / 3600.0)

    def throttled(self, loss: float, opening: float) -> float:
        return loss / opening**2

    def altitude_valve(self, name: str, link: Any) -> None:
        diameter, loss = self.size(link)
        self.add("VALVES", name, link.from_, link.to, diameter, "TCV", loss, 0.0)

    def check_valve(self, name: str, link: Any) -> None:
        diameter, loss = self.size(link)
        ends = (link.from_, link.to)
        self.add("PIPES", name, *ends, SHORT_PIPE, diameter, SMOOTH[self.formula], loss, "CV")

    def loss_curve(self, name: str, link: Any) -> None:
        """Write a general purpose valve by its curve; its diameter has no effect."""
        weight = self.case.properties.density * self.case.gravity
        per_metre = 1.0 if link.loss.quantity == "head" else weight
        points = [
            (1e3 * q, loss / per_metre)
            for q, loss in zip(link.loss.flow, link.loss.value, strict=True)
        ]
        points = [(0.0, 0.0), *points] if points[0][0] > 0.0 else points
        self.add(
            "VALVES", name, link.from_, link.to, GENERAL_DIAMETER, "GPV", self.curve(points), 0.0
        )

    def regulating(self, name: str, link: Any) -> None:
        kind = REGULATING[link.kind]
        diameter, loss = self.size(link)
        key = "set_flow" if kind == "FCV" else "set_pressure"
        schedule = getattr(link, key)
        if schedule.kind != "constant":
            self.notes.append(f"links.{name}.{key}: a schedule is left out: its first value counts")
        weight = WEIGHT
        setting = (
            1e3 * schedule.first
            if kind == "FCV"
            else (schedule.first - self.case.ambient_pressure) / weight
        )
        self.add("VALVES", name, link.from_, link.to, diameter, kind, setting, loss)

    def pump(self, name: str, link: Any) -> None:
        base, pattern = 1.0, ""
        if link.count > 1:
            self.notes.append(
                f"links.{name}.count: {link.count} pumps are written as one pump with the flow of all"
            )
            link = combined_pump(link)
        if link.speed.kind != "control":
            base, pattern = self.scheduled(f"links.{name}.speed", link.speed, 1.0)
        if link.power is not None:
            law = ["POWER", link.power * 1e-3 / self.gravity]
        elif link.curve is not None and link.curve.flow:
            points = [(1e3 * q, h) for q, h in zip(link.curve.flow, link.curve.value, strict=True)]
            law = ["HEAD", self.curve(points)]
        else:
            text = "EPANET has a curve by points, or a power; give `curve` with points"
            self.faults.append(f"links.{name}: {text}")
            return
        tail = ["PATTERN", pattern] if pattern else ["SPEED", base]
        if pattern and base != 1.0:
            self.notes.append(
                f"links.{name}.speed: EPANET's pattern replaces the speed; its values are those of the schedule"
            )
            scaled = tuple(float(f"{base * value:.10g}") for value in self.shape(pattern))
            tail = ["PATTERN", self.patterns.setdefault(scaled, f"pattern{len(self.patterns) + 1}")]
        self.add("PUMPS", name, link.from_, link.to, *law, *tail)
        if not link.check_valve:
            self.notes.append(
                f"links.{name}: EPANET's pumps have a check valve, this pump has none"
            )

    def shape(self, pattern: str) -> tuple[float, ...]:
        return next(shape for shape, name in self.patterns.items() if name == pattern)

    def leak(self, name: str, link: Any) -> None:
        self.exponents.add(link.exponent)
        per_metre = link.coefficient * (WEIGHT) ** link.exponent
        self.add("EMITTERS", link.from_, 1e3 * per_metre)

    # controls -------------------------------------------------------------------------------------------------

    def control(self, name: str, block: Any) -> None:
        """Write a relay on the level of a tank as two controls; note other blocks that drive a valve or pump."""
        driven = self.driven_by(name)
        negated = (
            block.control.kind == "function"
            and block.control.formula == NEGATION
            and len(block.blocks_read) == 1
        )
        relay = self.case.controls[block.blocks_read[0]] if negated else block
        probe = relay.inputs[0] if relay.inputs else None
        of_tank = (
            getattr(probe, "quantity", "") == "level" and self.case.nodes[probe.name].kind == "tank"
        )
        if relay.control.kind != "relay" or not of_tank:
            if driven:
                self.notes.append(
                    f"controls.{name}: a block of type {block.control.kind} is left out"
                )
            return
        off, on = relay.control.output
        if negated:
            off, on = 1.0 - off, 1.0 - on
        for link in driven:
            for value, level in ((on, relay.control.on), (off, relay.control.off)):
                side = (
                    "BELOW"
                    if (level == relay.control.on) == (relay.control.on < relay.control.off)
                    else "ABOVE"
                )
                self.add(
                    "CONTROLS",
                    "LINK",
                    link,
                    self.action(link, value),
                    "IF NODE",
                    probe.name,
                    side,
                    level,
                )
            if (on if relay.control.initial else off) == 0.0:
                self.add("STATUS", link, "CLOSED")

    def action(self, name: str, value: float) -> Any:
        """Action of a control that gives a valve an opening, or a pump a speed."""
        link = self.case.links[name]
        if value == 0.0:
            return "CLOSED"
        return value if link.kind == "pump" else self.throttled(self.size(link)[1], value)

    def driven_by(self, name: str) -> list[str]:
        """Names of valves and pumps whose opening or speed follows a block."""
        links = self.case.links.items()
        keys = {"valve": "opening", "pump": "speed"}
        schedules = [
            (own, getattr(link, keys[link.kind])) for own, link in links if link.kind in keys
        ]
        return [
            own
            for own, schedule in schedules
            if schedule.kind == "control" and schedule.origin == {"control": name}
        ]

    # text -----------------------------------------------------------------------------------------------------

    def text(self) -> str:
        """Text of the file."""
        case = self.case
        for shape, name in self.patterns.items():
            for k in range(0, len(shape), 12):
                self.add("PATTERNS", name, *shape[k : k + 12])
        for points, name in self.curves.items():
            for x, y in points:
                self.add("CURVES", name, x, y)
        clock = _clock(self.step)
        for words in (
            ("DURATION", _clock(case.numerics.end)),
            ("HYDRAULIC TIMESTEP", clock),
            ("PATTERN TIMESTEP", clock),
        ):
            self.add("TIMES", *words)
        options: list[tuple[Any, ...]] = [
            ("UNITS", "LPS"),
            ("HEADLOSS", self.formula),
            ("ACCURACY", 1e-6),
            ("TRIALS", 200),
        ]
        if abs(self.gravity - 1.0) > 1e-6:
            options.append(("SPECIFIC GRAVITY", self.gravity))
        if self.formula == "D-W":
            options.append(
                ("VISCOSITY", case.properties.viscosity / case.properties.density / WATER_VISCOSITY)
            )
        if self.exponents:
            options.append(("EMITTER EXPONENT", *self.exponents))
        for least, required, exponent in self.pressures:
            options += [
                ("DEMAND MODEL", "PDA"),
                ("MINIMUM PRESSURE", least),
                ("REQUIRED PRESSURE", required),
                ("PRESSURE EXPONENT", exponent),
            ]
        for words in options:
            self.add("OPTIONS", *words)
        title = case.title or "fvsolve"
        order = (
            "JUNCTIONS",
            "RESERVOIRS",
            "TANKS",
            "PIPES",
            "PUMPS",
            "VALVES",
            "EMITTERS",
            "PATTERNS",
            "CURVES",
            "STATUS",
            "CONTROLS",
            "TIMES",
            "OPTIONS",
            "COORDINATES",
        )
        lines = ["[TITLE]", title, "by fvsolve export"]
        for section in order:
            if section in self.sections:
                lines += ["", f"[{section}]", *self.sections[section]]
        return "\n".join([*lines, "", "[END]"]) + "\n"


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
