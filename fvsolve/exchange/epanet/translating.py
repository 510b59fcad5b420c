"""Translation of an EPANET network into parts of a case."""

import math
import re
from typing import Any

from fvsolve.errors import listing
from fvsolve.exchange.epanet import part_tables
from fvsolve.exchange.epanet.network_file import (
    EpanetLink,
    EpanetNetwork,
    EpanetNode,
    EpanetSolution,
)
from fvsolve.parts.pipe.part import QUASI_STEADY
from fvsolve.parts.tolerances import is_head_above, is_shorter_than_rise

STALL_FLOW = 1e-7  # flow below which EPANET's pumps of constant power have stalled [m3/s]
MAX_SLOPE = 0.99  # rise per length given to pipes for which the file has more than 1
MOST_PASSES = 50  # of the search for elevations
LEAST_ROUGHNESS = 1e-9
REGULATED_END = {"PRV": "end", "PSV": "start"}
RISE_TOLERANCE = 1e-9  # of the rise over the length of a pipe
SUSTAIN_TOLERANCE = 1e-2  # of the head before a PSV [m]
SET_TOLERANCE = 1e-6  # of set heads and heads of sources [m]
LOWEST_HEAD = -9.0  # least set pressure of a case: a head of water near vacuum [m]
# diameter below which a pipe stands for one to be designed: it carries hardly any water [m]
NARROW = 1e-3
STILL = 1e-6  # velocity below which a pipe counts as still [m/s]
GRAVITY = part_tables.GRAVITY


class FreeNames:
    """Unique names for a group of parts; characters that a case file does not allow are replaced.

    given : EPANET's name -> name in the case
    """

    def __init__(self) -> None:
        self.given: dict[str, str] = {}  # EPANET's name -> name in the case
        self.taken: set[str] = set()

    def add(self, name: str) -> str:
        """Add a name of EPANET; return the name of the part in the case."""
        self.given[name] = self.new(re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_") or "part")
        return self.given[name]

    def new(self, base: str) -> str:
        """Unused name: `base`, or `base` followed by a number."""
        name, number = base, 2
        while name in self.taken:
            name, number = f"{base}-{number}", number + 1
        self.taken.add(name)
        return name

    def changed(self) -> dict[str, str]:
        """EPANET's name -> name in the case, for all parts whose names differ."""
        return {name: ours for name, ours in self.given.items() if name != ours}


class Translation:
    """Nodes and links of a case made from an EPANET network, and notes on differences from EPANET.

    solution : EPANET's solution at the imported hour
    wave_speed : wave speed of every pipe [m/s]; shortest : least length of a pipe [m]
    nodes, links : name -> table of the case file
    demands : name of a junction in the case -> its demand [m3/s]
    lengths : EPANET's name of a pipe -> its length in the case [m]
    notes : list of (text, EPANET's names)
    """

    def __init__(
        self, network: EpanetNetwork, solution: EpanetSolution, wave_speed: float, shortest: float
    ) -> None:
        self.network, self.solution, self.speed, self.shortest = (
            network,
            solution,
            wave_speed,
            shortest,
        )
        self.nodes: dict[str, part_tables.Part] = {}
        self.links: dict[str, part_tables.Part] = {}
        self.lengths: dict[str, float] = {}
        self.notes_by_text: dict[str, list[str]] = {}
        self.reasons: list[str] = []  # texts of notes on what makes values differ from EPANET
        self.demands: dict[str, float] = {}
        self.node_names, self.link_names = FreeNames(), FreeNames()
        self.option = network.options
        self.formula, self.gravity = self.option["formula"], self.option["gravity"]
        self.pressure_driven = self.option["pressure_driven"]
        self.elevation = self.elevations()
        self.widest = max(
            (link.diameter for link in network.links.values() if link.kind == "pipe"), default=1.0
        )
        for name in network.nodes:
            self.node_names.add(name)
        for name in network.links:
            self.link_names.add(name)
        for name, node in network.nodes.items():
            self.nodes[self.node_names.given[name]] = getattr(self, node.kind)(node)
        for name, link in network.links.items():
            kind = link.kind if link.kind in ("pipe", "pump") else "valve"
            self.links[self.link_names.given[name]] = getattr(self, kind)(link)
        self.emitters()
        self.join_parts()
        self.note_omissions()
        for names in (self.node_names, self.link_names):
            for name, ours in names.changed().items():
                self.note("has a different name in fvsolve", f"{name} is {ours}")

    def note(self, text: str, name: str, differs: bool = False) -> None:
        """Add a name to a note; differs : True if heads or flows differ from EPANET for this reason"""
        names = self.notes_by_text.setdefault(text, [])
        if name not in names:
            names.append(name)
        if differs and text not in self.reasons:
            self.reasons.append(text)

    @property
    def causes(self) -> list[str]:
        """Notes on what makes heads or flows differ from EPANET, with EPANET's names."""
        return [f"{text} ({listing(names)})" for text, names in self.notes if text in self.reasons]

    @property
    def start_causes(self) -> list[str]:
        """Notes on what makes heads or flows differ from EPANET at the start alone."""
        return []

    @property
    def notes(self) -> list[tuple[str, list[str]]]:
        """Differences from EPANET : list of (text, EPANET's names)."""
        return list(self.notes_by_text.items())

    # nodes ------------------------------------------------------------------------------------------------

    def elevations(self) -> dict[str, float]:
        """Elevation [m] of each junction and tank; a junction at a pipe that is shorter than its rise is moved.

        EPANET accepts such pipes, for example 6 m long with a rise of 200 m. Heads and flows of a network do not depend
        on elevations of junctions, except where an outflow depends on pressure. A pipe for which no junction can be
        moved is lengthened, see `length`.
        """
        network = self.network
        result = {
            name: node.elevation for name, node in network.nodes.items() if node.kind != "reservoir"
        }
        pipes = [
            link
            for link in network.links.values()
            if link.kind == "pipe" and {link.start, link.end} <= result.keys()
        ]
        self.lowered = self.lower_regulated(result)
        for _ in range(MOST_PASSES):
            moved = [name for pipe in pipes if (name := self.move_junction(pipe, result))]
            for name in moved:
                text = "elevation changed, because a pipe cannot be shorter than its rise"
                self.note(f"{text}; heads and flows do not change", name)
            if not moved:
                break
        return result

    def lower_regulated(self, elevation: dict[str, float]) -> set[str]:
        """Lower junctions at which a valve would keep a pressure below vacuum; return their names.

        EPANET accepts a set pressure of -50 m; the set head stays as in the file.
        """
        lowered = set()
        for link in self.network.links.values():
            if link.kind not in REGULATED_END or not link.setting < LOWEST_HEAD:
                continue
            name = getattr(link, REGULATED_END[link.kind])
            if self.network.nodes[name].kind == "junction":
                elevation[name] += link.setting / self.gravity
                lowered.add(name)
                text = "elevation lowered, because a valve cannot keep a pressure below vacuum"
                self.note(f"{text}; heads and flows do not change", name)
        return lowered

    def move_junction(self, pipe: EpanetLink, elevation: dict[str, float]) -> str:
        """Move the lower end of a pipe that is shorter than its rise, else its higher end; return the name, or ""."""
        low, high = sorted((pipe.start, pipe.end), key=elevation.get)
        if not is_shorter_than_rise(pipe.length, elevation[low], elevation[high]):
            return ""
        if self.depends_on_pressure(low) or self.depends_on_pressure(high):
            return ""
        if self.network.nodes[low].kind == "junction" and low not in self.lowered:
            elevation[low] = elevation[high] - MAX_SLOPE * pipe.length
            return low
        if self.network.nodes[high].kind == "junction" and high not in self.lowered:
            elevation[high] = elevation[low] + MAX_SLOPE * pipe.length
            return high
        return ""

    def depends_on_pressure(self, name: str) -> bool:
        """True if the outflow of a node depends on its pressure, and so on its elevation."""
        node = self.network.nodes[name]
        demand = self.pressure_driven and any(base for base, _ in node.demands)
        return node.kind == "junction" and bool(node.emitter or demand)

    def junction(self, node: EpanetNode) -> part_tables.Part:
        demand = self.network.demand_at(node, self.solution.seconds)
        part = part_tables.junction(self.elevation[node.name], demand, node.position)
        if demand:
            self.demands[self.node_names.given[node.name]] = demand
        return part | self.pressure_keys(node, demand > 0.0)

    def pressure_keys(self, node: EpanetNode, draws: bool) -> part_tables.Part:
        """Keys of a demand that depends on pressure, if it does; draws : True for a demand above 0"""
        if not (self.pressure_driven and draws):
            return {}
        option = self.option
        return part_tables.pressure_demand(
            option["minimum_pressure"], option["required_pressure"], option["pressure_exponent"]
        )

    def reservoir(self, node: EpanetNode) -> part_tables.Part:
        text = "EPANET has no elevation of a reservoir; that of the other end of its pipe or pump is used"
        self.note(f"{text}: state `elevation` if vacuum near it matters", node.name)
        return part_tables.reservoir(self.solution.head[node.name], node.position)

    def tank(self, node: EpanetNode) -> part_tables.Part:
        level = (
            node.level
            if self.solution.seconds == 0.0
            else self.solution.head[node.name] - node.elevation
        )
        area = math.pi / 4.0 * node.diameter**2
        if node.volume is not None:
            area = curve_slope(node.volume, level)
            self.note("volume curve: replaced by the area at the initial level", node.name)
        level = min(round(level, 6), node.maximum)  # EPANET's level may exceed it by rounding
        return part_tables.tank(self.elevation[node.name], area, level, node.maximum, node.position)

    # links ------------------------------------------------------------------------------------------------

    def ends(self, link: EpanetLink) -> tuple[str, str]:
        return self.node_names.given[link.start], self.node_names.given[link.end]

    def junction_before_end(self, link: EpanetLink) -> str:
        """Add a junction without demand before the end of a pipe; return its name."""
        end = self.network.nodes[link.end]
        start = link.start if link.end not in self.elevation else link.end
        place = self.node_names.new(f"{self.link_names.given[link.name]}-end")
        self.nodes[place] = part_tables.junction(self.elevation.get(start, 0.0), 0.0, end.position)
        return place

    def is_shut(self, link: EpanetLink) -> bool:
        """True if a link is closed at the imported hour."""
        return not self.solution.open[link.name]

    def pipe(self, link: EpanetLink) -> part_tables.Part:
        start, end = self.ends(link)
        if link.diameter < NARROW and self.is_shut(link):
            return self.narrow(link, (start, end))
        if link.check_valve or self.is_shut(link):
            place = self.junction_before_end(link)
            ours = self.link_names.new(
                f"{self.link_names.given[link.name]}-{'check' if link.check_valve else 'shut'}"
            )
            last = (place, end)
            shut = part_tables.valve(last, link.diameter, 0.0, opening=0.0)
            self.links[ours] = (
                part_tables.check_valve(last, link.diameter) if link.check_valve else shut
            )
            reason = "check valve" if link.check_valve else "shut at this hour"
            valve = "a check valve" if link.check_valve else "a shut valve"
            self.note(f"{reason}: imported as a pipe with {valve} at its end", link.name)
            end = place
        return self.pipe_table(link, (start, end))

    def narrow(self, link: EpanetLink, ends: tuple[str, str]) -> part_tables.Part:
        """Table of a closed pipe that stands for a pipe to be designed, with a diameter of almost 0: a shut valve."""
        self.note(
            f"closed pipe narrower than {1e3 * NARROW:g} mm: imported as a shut valve", link.name
        )
        return part_tables.valve(ends, NARROW, 0.0, opening=0.0)

    def pipe_table(self, link: EpanetLink, ends: tuple[str, str]) -> part_tables.Part:
        """Table of a pipe between two nodes of the case, lengthened if it is too short."""
        law = part_tables.friction(self.formula, link.roughness, link.diameter)
        length = self.lengths[link.name] = self.length(link)
        if length > link.length:
            law = self.spread(link, length)
            self.note(
                f"lengthened to {length:.4g} m; the friction loss is that of the original length",
                link.name,
            )
        part = part_tables.pipe(ends, length, link.diameter, law, link.minor_loss, self.speed)
        if link.diameter < NARROW:
            text = f"narrower than {1e3 * NARROW:g} mm, it stands for a pipe to be designed"
            self.note(
                f"{text}: imported without waves, which its friction would damp at once", link.name
            )
            part["pipe_model"] = QUASI_STEADY
        return part

    def length(self, link: EpanetLink) -> float:
        """Length of a pipe in the case [m], at least `shortest`.

        A pipe that is shorter than its rise gets at least the length rise / MAX_SLOPE.
        """
        low, high = sorted(self.elevation.get(end, 0.0) for end in (link.start, link.end))
        inside = {link.start, link.end} <= self.elevation.keys()
        too_steep = inside and is_shorter_than_rise(link.length, low, high)
        return max(link.length, self.shortest, (high - low) / MAX_SLOPE if too_steep else 0.0)

    def spread(self, link: EpanetLink, length: float) -> part_tables.Part:
        """Table of the friction of a lengthened pipe, which keeps the friction loss of its original length.

        length : length of the pipe in the case [m]
        With formula D-W the Darcy factor becomes constant, so the loss is equal only at the flow of this hour.
        """
        ratio = link.length / length
        if self.formula == "H-W":
            return part_tables.friction(
                "H-W", link.roughness * ratio ** (-1.0 / 1.852), link.diameter
            )
        if self.formula == "C-M":
            return part_tables.friction("C-M", link.roughness * math.sqrt(ratio), link.diameter)
        return part_tables.darcy(ratio * self.darcy_factor(link))

    def darcy_factor(self, link: EpanetLink) -> float:
        """Darcy factor of a pipe from EPANET's loss at this hour; that of rough flow for a pipe without flow."""
        velocity = abs(self.solution.flow[link.name]) / (math.pi / 4.0 * link.diameter**2)
        loss = abs(self.solution.loss[link.name]) - link.minor_loss * velocity**2 / (2.0 * GRAVITY)
        if velocity > STILL and loss > 0.0:
            return loss * link.diameter * 2.0 * GRAVITY / (link.length * velocity**2)
        return (2.0 * math.log10(3.7 * link.diameter / max(link.roughness, LEAST_ROUGHNESS))) ** -2

    def pump(self, link: EpanetLink) -> part_tables.Part:
        if self.is_shut(link):
            self.note("pump is off at this hour: imported as a shut valve", link.name)
            return part_tables.valve(self.ends(link), self.bore(link), 0.0, opening=0.0)
        if link.power is not None and abs(self.solution.flow[link.name]) < STALL_FLOW:
            return self.stalled(link, self.ends(link))
        return part_tables.pump(
            self.ends(link), self.head_law(link), self.solution.setting[link.name]
        )

    def stalled(self, link: EpanetLink, ends: tuple[str, str]) -> part_tables.Part:
        """Table of a pump of constant power that has no flow in EPANET: a shut valve."""
        text = "pump of constant power has zero flow in EPANET, which contradicts its power"
        self.note(f"{text}: imported as a shut valve", link.name, True)
        return part_tables.valve(ends, self.bore(link), 0.0, opening=0.0)

    def head_law(self, link: EpanetLink) -> part_tables.Part:
        """Key with the head law of a pump at full speed."""
        if link.power is not None:
            return part_tables.power(self.gravity * link.power)
        return part_tables.curve(link.curve or [])

    def valve(self, link: EpanetLink) -> part_tables.Part:
        return self.valve_table(link, self.ends(link), self.valve_state(link))

    def valve_state(self, link: EpanetLink) -> tuple[Any, ...]:
        """State of a valve at the hour, as an action: ("closed",), ("open",) or ("setting", value)."""
        setting, begins = self.solution.setting[link.name], initial_action(link)
        if self.solution.seconds == 0.0 and not self.is_controlled(link):
            return begins
        if link.kind == "GPV":
            return ("closed",) if self.is_shut(link) else ("setting", link.setting)
        # EPANET states 0 for a fixed valve
        if setting == 0.0 and (begins[0] != "setting" or link.setting != 0.0):
            return ("closed",) if self.is_shut(link) else ("open",)
        return ("setting", setting)

    def is_controlled(self, link: EpanetLink) -> bool:
        """True if a control or rule acts on a link."""
        network = self.network
        acted = {control["link"] for control in network.controls}
        acted |= {name for rule in network.rules for name, _ in (*rule["then"], *rule["else"])}
        return link.name in acted

    def valve_table(
        self, link: EpanetLink, ends: tuple[str, str], state: tuple[Any, ...]
    ) -> part_tables.Part:
        """Table of a valve between two nodes of the case; state : as from `valve_state`"""
        kind = link.kind
        if kind == "GPV" and state[0] == "setting":
            return self.general_valve(link, ends)
        if kind == "PBV" and state[0] == "setting":
            return self.breaker(link, ends, state[1])
        diameter = self.valve_diameter(link)
        if state[0] == "closed":
            self.note(f"{kind} is shut: imported as a shut valve", link.name)
            return part_tables.valve(ends, diameter, 0.0, opening=0.0)
        if state[0] == "open":
            return part_tables.valve(ends, diameter, link.minor_loss)
        setting = state[1]
        if kind in ("PRV", "PSV") and self.is_set_too_high(link, setting):
            word = "an open check valve" if kind == "PRV" else "a shut valve"
            self.note(f"{kind} with a set head above every source: imported as {word}", link.name)
            if kind == "PRV":
                return part_tables.check_valve(ends, diameter, link.minor_loss)
            return part_tables.valve(ends, diameter, 0.0, opening=0.0)
        if kind == "PSV" and self.cannot_sustain(link, setting):
            text = "PSV cannot sustain its pressure, and EPANET lets flow pass (its warning 5)"
            self.note(f"{text}: imported as a check valve", link.name)
            return part_tables.check_valve(ends, diameter, link.minor_loss)
        if kind in part_tables.REGULATING:
            return self.regulating(link, ends, diameter, setting)
        if kind == "TCV":  # its setting replaces the minor loss, and may be below it
            return part_tables.valve(ends, link.diameter if setting else self.bore(link), setting)
        share = self.position_share(link, setting)
        return part_tables.valve(ends, diameter, link.minor_loss, opening=share)

    def position_share(self, link: EpanetLink, setting: float) -> float:
        """Share of the area of a PCV at a setting [%], by its curve."""
        return curve_value(link.curve or [[0.0, 0.0], [1.0, 1.0]], 0.01 * setting)

    def regulating(
        self, link: EpanetLink, ends: tuple[str, str], diameter: float, setting: float
    ) -> part_tables.Part:
        """Table of a regulating valve that moves with a time constant."""
        loss = self.full_open_loss(link, diameter)
        text = f"{link.kind}: EPANET states neither a time constant nor a stroke, {part_tables.TIME_CONSTANT} is used"
        if loss > link.minor_loss:
            text += f", and the loss coefficient by which it is {part_tables.OPENING:.0%} open at this hour"
        self.note(text, link.name)
        return part_tables.regulating(
            link.kind, ends, diameter, self.set_point(link, setting), loss
        )

    def full_open_loss(self, link: EpanetLink, diameter: float) -> float:
        """Loss coefficient of a regulating valve at full opening, by which it is partly open at this hour if it acts.

        EPANET's valve has no loss when it is open. It would regulate within a thousandth of its stroke, so it would
        act within microseconds, whatever its time constant.
        """
        flow = self.solution.flow[link.name]
        drop = self.solution.head[link.start] - self.solution.head[link.end]
        if self.solution.open[link.name] and flow > STALL_FLOW:
            least = part_tables.OPENING**2 * part_tables.loss_coefficient(
                max(drop, 0.0), flow, diameter
            )
            return max(link.minor_loss, least)
        return max(link.minor_loss, part_tables.CONTROL_VALVE_LOSS)

    def general_valve(self, link: EpanetLink, ends: tuple[str, str]) -> part_tables.Part:
        """Table of a GPV: a link by its curve; a valve if its curve falls."""
        points, negative = part_tables.general_losses(link.curve or [])
        if negative:
            text = "GPV: its curve states a negative loss at small flows, which a loss cannot be"
            self.note(f"{text}: imported without loss there", link.name, True)
        if points:
            return part_tables.loss_curve(ends, points)
        text = "GPV: the loss of its curve falls as the flow rises"
        self.note(
            f"{text}: imported as a valve with the constant loss coefficient of this hour",
            link.name,
            True,
        )
        flow = self.solution.flow[link.name]
        drop = self.solution.head[link.start] - self.solution.head[link.end]
        loss = (
            part_tables.loss_coefficient(drop, flow, link.diameter)
            if flow * drop > 0.0
            else link.minor_loss
        )
        return part_tables.valve(ends, link.diameter, abs(loss))

    def breaker(self, link: EpanetLink, ends: tuple[str, str], setting: float) -> part_tables.Part:
        """Table of a PBV with a setting: a link with constant loss, or with that of the open valve where it is greater.

        In EPANET it keeps its drop against its flow too.
        """
        uphill = setting > 0.0 and self.solution.flow[link.name] < -STALL_FLOW
        if uphill:
            text = "PBV raises the head along its flow, which a valve cannot do"
            self.note(f"{text}: imported as an open valve, so heads differ", link.name, True)
        if uphill or setting <= 0.0:
            return part_tables.valve(ends, self.valve_diameter(link), link.minor_loss)
        heads = self.solution.head.values()
        most = max(heads) - min(heads)
        points = part_tables.breaker_losses(
            setting / self.gravity, link.minor_loss, link.diameter, most
        )
        return part_tables.loss_curve(ends, points)

    def bore(self, link: EpanetLink) -> float:
        """Diameter [m] of the widest pipe at the ends of a link; of the network if there is no pipe."""
        near = (other for end in (link.start, link.end) for other in self.network.links_at[end])
        return max((other.diameter for other in near if other.kind == "pipe"), default=self.widest)

    def valve_diameter(self, link: EpanetLink) -> float:
        """Diameter of a valve in the case [m]: that of the widest adjacent pipe, unless it has a loss coefficient.

        In EPANET an open valve without loss coefficient has no loss, whatever its diameter.
        """
        if link.minor_loss:
            return link.diameter
        widest = self.bore(link)
        if abs(widest - link.diameter) > 1e-6 * widest:
            self.note(
                "valve without loss coefficient: imported with the diameter of the widest pipe next to it",
                link.name,
            )
        return widest

    def is_set_too_high(self, link: EpanetLink, setting: float) -> bool:
        """True if the head set for a PRV or PSV exceeds the heads of all sources, in a network without pumps."""
        network, controlled = self.network, getattr(link, REGULATED_END[link.kind])
        sources = [name for name, node in network.nodes.items() if node.kind != "junction"]
        greatest = max(self.solution.head[source] for source in sources)
        head = setting / self.gravity + network.nodes[controlled].elevation
        pumps = any(
            other.kind == "pump" and self.may_run(other) for other in network.links.values()
        )
        return not pumps and is_head_above(head, greatest)

    def may_run(self, link: EpanetLink) -> bool:
        """True if a pump runs in the case; others become shut valves."""
        return not self.is_shut(link)

    def cannot_sustain(self, link: EpanetLink, setting: float) -> bool:
        """True if a PSV passes flow in EPANET although the head before it is below its set head."""
        head = setting / self.gravity + self.network.nodes[link.start].elevation
        below = self.solution.head[link.start] < head - SUSTAIN_TOLERANCE
        return below and self.solution.flow[link.name] > STALL_FLOW

    def set_point(self, link: EpanetLink, setting: float) -> float:
        """Set point of a valve: head of water above the controlled end [m], or flow [m3/s] of an FCV.

        The head is corrected if the import moves the elevation of that end.
        """
        if link.kind == "FCV":
            return setting
        controlled = getattr(link, REGULATED_END[link.kind])
        if controlled not in self.elevation:
            return setting
        moved = self.network.nodes[controlled].elevation - self.elevation[controlled]
        return setting + self.gravity * moved

    def emitters(self) -> None:
        """Add emitters as leaks."""
        exponent, backflow = self.option["emitter_exponent"], self.option["emitter_backflow"]
        for name, node in self.network.nodes.items():
            if not node.emitter:
                continue
            place = self.node_names.given[name]
            self.links[self.link_names.new(f"{place}-emitter")] = part_tables.leak(
                place, node.emitter, exponent
            )
            if backflow and self.solution.head[name] < node.elevation:
                text = "emitter above its pressure: EPANET lets it feed the network, here it has no flow"
                self.note(
                    f"{text} (`BACKFLOW ALLOWED NO` in EPANET 2.3), so heads differ", name, True
                )

    def join_parts(self) -> None:
        """Join separate networks of the file by shut valves between their sources, since a case is one network."""
        network = self.network
        label = {name: name for name in network.nodes}

        def root(name: str) -> str:
            while label[name] != name:
                label[name] = name = label[label[name]]
            return name

        for link in network.links.values():
            label[root(link.start)] = root(link.end)
        sources: dict[str, str] = {}
        for name, node in network.nodes.items():
            if node.kind != "junction":
                sources.setdefault(root(name), name)
        first, *others = sources.values()
        for other in others:
            ends = self.node_names.given[first], self.node_names.given[other]
            self.links[self.link_names.new("separate")] = part_tables.valve(
                ends, self.widest, 0.0, opening=0.0
            )
            self.note("a separate network: joined to the first by a shut valve", other)

    def note_omissions(self) -> None:
        """Note what the file has and the case does not."""
        for link in self.network.links.values():
            if link.leak_area:
                self.note("leakage of the pipe ([LEAKAGE]) is not imported", link.name, True)
        if self.formula == "C-M":
            text = "EPANET rounds the constants of Manning's formula: each coefficient is changed to the same loss"
            self.note(text, "C-M")
        study = {"age": "`fvsolve quality`", "trace": "`fvsolve quality --trace NODE`"}.get(
            self.option["quality"]
        )
        if study:
            self.note(
                f"water {self.option['quality']} is computed from a run over a day by {study}",
                "[QUALITY]",
            )
        elif self.option["quality"] == "chemical":
            self.note("the chemical and its reactions are not imported", "[QUALITY]")
        if self.network.rewritten:
            self.note("pumps in the form of EPANET 1 are read as EPANET 2.2 reads them", "[PUMPS]")


def initial_action(link: EpanetLink) -> tuple[Any, ...]:
    """State of a link before hour 0, as an action: ("closed",), ("open",) or ("setting", value)."""
    if link.status == "closed" or (link.kind == "pump" and link.setting == 0.0):
        return ("closed",)
    if link.kind == "pump" or link.status == "active" or link.kind == "GPV":
        return ("setting", link.setting)
    return ("open",)


def curve_slope(points: list[list[float]], at: float) -> float:
    """Slope of a piecewise linear curve at abscissa `at`; beyond its points, the slope of the nearest section."""
    for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
        if at < x1 or [x1, y1] == list(points[-1]):
            return (y1 - y0) / (x1 - x0)
    raise ValueError("the curve has fewer than two points; expected at least two")


def curve_value(points: list[list[float]], at: float) -> float:
    """Value of a piecewise linear curve at abscissa `at`, held beyond its ends."""
    if at <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
        if at <= x1:
            return y0 + (y1 - y0) * (at - x0) / (x1 - x0)
    return points[-1][1]
