"""Translation of an EPANET network into parts of a case."""

import math
import re
from typing import Any

from fvsolve.epanet import part_tables
from fvsolve.epanet.network_file import CLOSED, HourState

STALL_FLOW = 1e-7  # flow below which EPANET's pumps of constant power have stalled [m3/s]
MIN_REQUIRED = 0.1  # smallest required pressure of a full demand, in metres or psi as in the file
MAX_SLOPE = 0.99  # rise per length given to pipes for which the file has more than 1
SWITCHED_OFF, ACTIVE = 2, 4  # EPANET's codes of a link
PSI_OF_METRE = 0.4333 / 0.3048
US_UNITS = ("CFS", "GPM", "MGD", "IMGD", "AFD")
REGULATING_STATUS = 2  # WNTR's code of a valve that is neither fixed open nor fixed closed


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

    network : network of WNTR; hour : EPANET's solution at the imported hour
    wave_speed : wave speed of every pipe [m/s]; shortest : least length of a pipe [m]
    nodes, links : name -> table of the case file
    demands : name of a junction in the case -> its demand [m3/s]
    lengths : EPANET's name of a pipe -> its length in the case [m]
    notes : list of (text, EPANET's names)
    """

    def __init__(self, network: Any, hour: HourState, wave_speed: float, shortest: float) -> None:
        self.network, self.hour, self.speed, self.shortest = network, hour, wave_speed, shortest
        self.nodes: dict[str, part_tables.Part] = {}
        self.links: dict[str, part_tables.Part] = {}
        self.lengths: dict[str, float] = {}
        self.notes_by_text: dict[str, list[str]] = {}
        self.demands: dict[str, float] = {}
        self.node_names, self.link_names = FreeNames(), FreeNames()
        hydraulic = network.options.hydraulic
        self.formula, self.multiplier = hydraulic.headloss, hydraulic.demand_multiplier
        self.gravity = hydraulic.specific_gravity  # pressures in metres refer to water, heads to the fluid
        self.pressure_driven = hydraulic.demand_model in ("PDA", "PDD")
        self.clock = hour.seconds + network.options.time.pattern_start
        self.drawn = any(any(node.coordinates) for _, node in network.nodes())
        self.elevation = self.elevations()
        for name, node in network.nodes():
            ours = self.node_names.add(name)
            self.nodes[ours] = getattr(self, node.node_type.lower())(name, node)
        for name, link in network.links():
            ours = self.link_names.add(name)
            self.links[ours] = getattr(self, link.link_type.lower())(name, link)
        self.emitters()
        self.options(hydraulic)
        for names in (self.node_names, self.link_names):
            for name, ours in names.changed().items():
                self.note("has a different name in fvsolve", f"{name} is {ours}")

    def note(self, text: str, name: str) -> None:
        names = self.notes_by_text.setdefault(text, [])
        if name not in names:
            names.append(name)

    @property
    def notes(self) -> list[tuple[str, list[str]]]:
        """Differences from EPANET : list of (text, EPANET's names)."""
        return list(self.notes_by_text.items())

    # nodes ------------------------------------------------------------------------------------------------

    def elevations(self) -> dict[str, float]:
        """Elevation [m] of each junction and tank; one end of a pipe that is shorter than its rise is moved.

        EPANET accepts such pipes, for example 6 m long with a rise of 200 m. Heads and flows of a network do not depend
        on elevations, except where an outflow depends on pressure. A pipe at such a node is not moved but lengthened,
        see `length`.
        """
        result = {name: node.elevation for name, node in self.network.nodes() if node.node_type != "Reservoir"}
        pipes = [
            pipe for _, pipe in self.network.pipes() if {pipe.start_node_name, pipe.end_node_name} <= result.keys()
        ]
        moved = True
        while moved:
            moved = False
            for pipe in pipes:
                low, high = sorted((pipe.start_node_name, pipe.end_node_name), key=result.get)
                if result[high] - result[low] <= pipe.length:
                    continue
                if self.depends_on_pressure(low) or self.depends_on_pressure(high):
                    continue
                if self.network.get_node(low).node_type == "Junction":
                    name, result[low] = low, result[high] - MAX_SLOPE * pipe.length
                else:
                    name, result[high] = high, result[low] + MAX_SLOPE * pipe.length
                moved = True
                text = "elevation changed, because a pipe cannot be shorter than its rise"
                self.note(f"{text}; heads and flows do not change", name)
        return result

    def depends_on_pressure(self, name: str) -> bool:
        """True if the outflow of a node depends on its pressure, and so on its elevation."""
        node = self.network.get_node(name)
        return node.node_type == "Junction" and bool(
            node.emitter_coefficient or (self.pressure_driven and self.demand_at(node))
        )

    def demand_at(self, node: Any) -> float:
        """Demand [m3/s] of a junction at the imported hour, from its patterns."""
        return node.demand_timeseries_list.at(self.clock, multiplier=self.multiplier)

    def position(self, node: Any) -> Any:
        """Coordinates of a node; None if the file has none (WNTR then puts every node at the origin)."""
        return node.coordinates if self.drawn else None

    def junction(self, name: str, node: Any) -> part_tables.Part:
        demand = self.demand_at(node)
        part = part_tables.junction(self.elevation[name], demand, self.position(node))
        if demand:
            self.demands[self.node_names.given[name]] = demand
        if self.pressure_driven and demand > 0.0:
            hydraulic = self.network.options.hydraulic
            least = MIN_REQUIRED * (1.0 / PSI_OF_METRE if hydraulic.inpfile_units in US_UNITS else 1.0)
            required = max(hydraulic.required_pressure, least)
            part |= part_tables.pressure_demand(hydraulic.minimum_pressure, required, hydraulic.pressure_exponent)
        return part

    def reservoir(self, name: str, node: Any) -> part_tables.Part:
        text = "EPANET has no elevation of a reservoir; that of the other end of its pipe or pump is used"
        self.note(f"{text}: state `elevation` if vacuum near it matters", name)
        return part_tables.reservoir(node.head_timeseries.at(self.clock), self.position(node))

    def tank(self, name: str, node: Any) -> part_tables.Part:
        level = node.init_level if self.hour.seconds == 0.0 else self.hour.head[name] - node.elevation
        area = math.pi / 4.0 * node.diameter**2
        if node.vol_curve is not None:
            area = curve_slope(node.vol_curve.points, level)
            self.note("volume curve: replaced by the area at the initial level", name)
        level = min(round(level, 6), node.max_level)  # EPANET's level may exceed it by rounding
        return part_tables.tank(self.elevation[name], area, level, node.max_level, self.position(node))

    # links ------------------------------------------------------------------------------------------------

    def ends(self, link: Any) -> tuple[str, str]:
        return tuple(self.node_names.given[end] for end in (link.start_node_name, link.end_node_name))

    def junction_before_end(self, name: str, link: Any) -> str:
        """Add a junction without demand before the end of a pipe; return its name."""
        end = self.network.get_node(link.end_node_name)
        start = link.start_node_name if link.end_node_name not in self.elevation else link.end_node_name
        place = self.node_names.new(f"{self.link_names.given[name]}-end")
        self.nodes[place] = part_tables.junction(self.elevation.get(start, 0.0), 0.0, self.position(end))
        return place

    def shut(self, name: str) -> bool:
        return int(self.hour.status[name]) in CLOSED

    def pipe(self, name: str, link: Any) -> part_tables.Part:
        start, end = self.ends(link)
        if link.check_valve or self.shut(name):
            place = self.junction_before_end(name, link)
            ours = self.link_names.new(f"{self.link_names.given[name]}-{'check' if link.check_valve else 'shut'}")
            last = (place, end)
            shut = part_tables.valve(last, link.diameter, 0.0, opening=0.0)
            self.links[ours] = part_tables.check_valve(last, link.diameter) if link.check_valve else shut
            reason = "check valve" if link.check_valve else "shut at this hour"
            valve = "a check valve" if link.check_valve else "a shut valve"
            self.note(f"{reason}: imported as a pipe with {valve} at its end", name)
            end = place
        law = part_tables.friction(self.formula, link.roughness)
        length = self.lengths[name] = self.length(link)
        if length > link.length:
            law = self.spread(name, link, length)
            self.note(f"lengthened to {length:.4g} m; the friction loss is that of the original length", name)
        return part_tables.pipe((start, end), length, link.diameter, law, link.minor_loss, self.speed)

    def length(self, link: Any) -> float:
        """Length of a pipe in the case [m], at least `shortest`.

        A pipe that is shorter than its rise gets at least the length rise / MAX_SLOPE.
        """
        low, high = sorted(self.elevation.get(end, 0.0) for end in (link.start_node_name, link.end_node_name))
        inside = {link.start_node_name, link.end_node_name} <= self.elevation.keys()
        return max(link.length, self.shortest, (high - low) / MAX_SLOPE if inside and high - low > link.length else 0.0)

    def spread(self, name: str, link: Any, length: float) -> part_tables.Part:
        """Table of the friction of a lengthened pipe, which keeps the friction loss of its original length.

        name : EPANET's name; link : pipe of WNTR; length : length of the pipe in the case [m]
        With formula D-W the Darcy factor becomes constant, so the loss is equal only at the flow of this hour.
        """
        ratio = link.length / length
        if self.formula == "H-W":
            return part_tables.friction("H-W", link.roughness * ratio ** (-1.0 / 1.852))
        if self.formula == "C-M":
            return part_tables.friction("C-M", link.roughness * math.sqrt(ratio))
        return part_tables.darcy(ratio * self.hour.factor[name])

    def pump(self, name: str, link: Any) -> part_tables.Part:
        if int(self.hour.status[name]) == SWITCHED_OFF:
            self.note("pump is off at this hour: imported as a shut valve", name)
            return part_tables.valve(self.ends(link), self.bore(link), 0.0, opening=0.0)
        if link.pump_type == "POWER" and abs(self.hour.flow[name]) < STALL_FLOW:
            text = "pump of constant power has zero flow in EPANET, which contradicts its power"
            self.note(f"{text}: imported as a shut valve", name)
            return part_tables.valve(self.ends(link), self.bore(link), 0.0, opening=0.0)
        given = link.pump_type == "POWER"
        law = part_tables.power(self.gravity * link.power) if given else part_tables.curve(link.get_pump_curve().points)
        return part_tables.pump(self.ends(link), law, float(self.hour.setting[name]))

    def valve(self, name: str, link: Any) -> part_tables.Part:
        ends, kind, status = self.ends(link), link.valve_type, int(self.hour.status[name])
        diameter = self.size(link)
        if kind in ("PRV", "PSV") and link.initial_status == REGULATING_STATUS and self.set_too_high(name, link):
            state = "an open" if kind == "PRV" else "a shut"
            self.note(f"{kind} with a set head above every source: imported as {state} valve", name)
            return part_tables.valve(ends, diameter, link.minor_loss, opening=1.0 if kind == "PRV" else 0.0)
        if kind in part_tables.REGULATING and link.initial_status == REGULATING_STATUS:
            self.note(f"{kind}: EPANET states no time constant, {part_tables.TIME_CONSTANT} is used", name)
            return part_tables.regulating(kind, ends, diameter, self.setting(name, link), link.minor_loss)
        if status in CLOSED:
            self.note(f"{kind} is shut at this hour: imported as a shut valve", name)
            return part_tables.valve(ends, diameter, 0.0, opening=0.0)
        flow = self.hour.flow[name]
        drop = self.hour.head[link.start_node_name] - self.hour.head[link.end_node_name]
        if kind == "TCV" and status == ACTIVE:
            return part_tables.valve(ends, diameter, self.hour.setting[name])
        if kind in ("PBV", "GPV") and flow * drop < 0.0:
            text = f"{kind} raises the head along its flow, which a valve cannot do"
            self.note(f"{text}: imported as an open valve, so heads differ", name)
        elif kind in ("PBV", "GPV") and flow and drop:
            self.note(f"{kind}: imported as a valve with the constant loss coefficient of this hour", name)
            return part_tables.valve(ends, diameter, part_tables.loss_coefficient(abs(drop), flow, diameter))
        return part_tables.valve(ends, diameter, link.minor_loss)

    def bore(self, link: Any, otherwise: float = 0.1) -> float:
        """Diameter [m] of the widest pipe at the ends of a link; `otherwise` [m] if there is no pipe."""
        ends = (link.start_node_name, link.end_node_name)
        near = [self.network.get_link(other) for end in ends for other in self.network.get_links_for_node(end)]
        return max((pipe.diameter for pipe in near if pipe.link_type == "Pipe"), default=otherwise)

    def size(self, link: Any) -> float:
        """Diameter of a valve in the case [m].

        It is at most the diameter of the widest adjacent pipe, unless a loss coefficient or a curve refers to the
        diameter.
        """
        widest = self.bore(link, link.diameter)
        if link.minor_loss or link.valve_type in ("TCV", "GPV") or widest >= link.diameter:
            return link.diameter
        self.note("valve wider than every pipe next to it: imported with the diameter of the widest pipe", link.name)
        return widest

    def set_too_high(self, name: str, link: Any) -> bool:
        """True if the head set for a PRV or PSV exceeds the heads of all sources, in a network without pumps."""
        network, controlled = self.network, link.end_node_name if link.valve_type == "PRV" else link.start_node_name
        sources = [*network.reservoir_name_list, *network.tank_name_list]
        greatest = max(self.hour.head[source] for source in sources)
        head = self.hour.setting[name] / self.gravity + network.get_node(controlled).elevation
        return not network.num_pumps and head > greatest

    def setting(self, name: str, link: Any) -> float:
        """Set point of a valve: head of water above the controlled end [m], or flow [m3/s] of an FCV.

        The head is corrected if the import moves the elevation of that end.
        """
        controlled = link.end_node_name if link.valve_type == "PRV" else link.start_node_name
        if link.valve_type == "FCV" or controlled not in self.elevation:
            return self.hour.setting[name]
        moved = self.network.get_node(controlled).elevation - self.elevation[controlled]
        return self.hour.setting[name] + self.gravity * moved

    def emitters(self) -> None:
        """Add emitters as leaks.

        WNTR converts their coefficients from psi to metres as if the exponent were 0.5; this is corrected.
        """
        hydraulic = self.network.options.hydraulic
        exponent = hydraulic.emitter_exponent
        unit = PSI_OF_METRE ** (exponent - 0.5) if hydraulic.inpfile_units in US_UNITS else 1.0
        for name, node in self.network.junctions():
            if node.emitter_coefficient:
                place = self.node_names.given[name]
                leak = part_tables.leak(place, unit * node.emitter_coefficient, exponent)
                self.links[self.link_names.new(f"{place}-emitter")] = leak

    def options(self, hydraulic: Any) -> None:
        if self.formula == "D-W":
            self.note("Darcy factor by Colebrook, in EPANET by Swamee and Jain: both factors agree within 3 %", "D-W")


def curve_slope(points: list[tuple[float, float]], at: float) -> float:
    """Slope of a piecewise linear curve at abscissa `at`; beyond its points, the slope of the nearest section."""
    for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
        if at < x1 or (x1, y1) == tuple(points[-1]):
            return (y1 - y0) / (x1 - x0)
    raise ValueError("the curve has fewer than two points; expected at least two")
