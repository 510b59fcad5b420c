"""Class `Case`: names, parts and numbers of a case file in SI."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fvsolve import units
from fvsolve.case import case_notices, text
from fvsolve.case.claims import Compare, DesignLimit, Expect
from fvsolve.case.pipe_routes import Route
from fvsolve.case.probe import Probe, of_profiles
from fvsolve.case.reading import followers
from fvsolve.case.sections import (
    CAVITY_SCHEMES,
    DEFAULT_CELLS,
    ExactSpec,
    FluidSpec,
    Numerics,
    Output,
)
from fvsolve.core.fluid import Fluid, law_named
from fvsolve.core.fluid.laws import Law
from fvsolve.core.schemes import SCHEMES
from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError, Notice, did_you_mean, listing
from fvsolve.parts import Link, Node, Pipe, Scalar
from fvsolve.parts.date_keys import moment_text
from fvsolve.parts.nodes_and_links import NETWORK_DOMAINS
from fvsolve.parts.pipe.pipe_wall import OF_WALL, elastic_compliance, heat_retardation
from fvsolve.parts.table_model import plain_value
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.case import bodies
    from fvsolve.case.controls import Block
    from fvsolve.parts.pump.energy_use import EnergyUse
    from fvsolve.parts.reaction import Reaction

REPORT_KEYS = ("title", "expect", "compare", "validation")
# of [numerics], which a continued run may change
STEP_KEYS = ("courant", "step", "rtol", "below_vapor")


@dataclass(frozen=True, eq=False, repr=False)
class Case(Displayable):
    """Case as read, immutable; SI units, pressures absolute [Pa]. Cases are equal if their tables are equal.

    properties : properties of the fluid at its reference state
    nodes, links : name -> part, in the order of the file
    copies : name of a file in the text of `resolved()` -> path of this file, such as a schedule or a mesh
    """

    name: str
    path: Path | None
    title: str
    description: str
    source: str
    schema: int
    ambient_pressure: float
    gravity: float
    fluid: FluidSpec
    properties: Fluid
    nodes: dict[str, Node]
    links: dict[str, Link]
    signals: dict[str, Any]
    scalars: dict[str, Scalar]
    numerics: Numerics
    output: Output
    expect: dict[str, Expect]
    compare: dict[str, Compare]
    routes: dict[str, Route]
    limits: dict[str, DesignLimit]
    controls: dict[str, Block]
    reactions: dict[str, Reaction]
    exact: ExactSpec | None
    energy: EnergyUse | None
    copies: dict[str, Path]
    raw: dict[str, Any] = field(repr=False)  # tables of the file, with overrides
    folder: Path | None = field(repr=False)
    meshes: dict[str, Any] = field(default_factory=dict, repr=False)  # of basins
    # meshes of basins with water as lumped masses
    lumped: dict[str, Any] = field(default_factory=dict, repr=False)
    # place -> (raw value, value as read)
    read: dict[tuple, tuple] = field(default_factory=dict, repr=False)
    # bodies and masses in equilibrium
    equilibrium_nodes: dict[str, Node] = field(default_factory=dict, repr=False)
    validation: Any = None  # `Validation`, or None
    # tables of other folders by name, see `declared_tables`
    declared: dict[str, Any] = field(default_factory=dict)

    picture = "fvsolve.report.draw.object_pictures:case_figure"

    def summary_line(self) -> str:
        basins = f", {len(self.meshes)} basins" if self.meshes else ""
        return (
            f"{self.name!r}: {len(self.nodes)} nodes, {len(self.links)} links{basins}, {self.fluid.name} under law "
            f"{self.fluid.law}, {self.numerics.start:g} to {self.numerics.end:g} s"
        )

    def table_columns(self) -> dict[str, list]:
        parts = {
            **{("node", name): part for name, part in self.nodes.items()},
            **{("link", name): part for name, part in self.links.items()},
        }
        joins = [
            ", ".join(map(str, getattr(part, "ports", {}).values())) for part in parts.values()
        ]
        kinds = [part.kind for part in parts.values()]
        return {
            "part": [name for _, name in parts],
            "is": [group for group, _ in parts],
            "type": kinds,
            "joins": joins,
        }

    @property
    def files(self) -> list[Path]:
        """Paths of the files that the case used, such as schedules, measurements, meshes and tableaus."""
        return list(self.copies.values())

    @cached_property
    def probes(self) -> list[Probe]:
        """Probes to record: the probes of `[output]`, then further probes that `[expect]` and `[compare]` name."""
        named = [*self.output.probes]
        named += [
            claim.probe
            for claim in [*self.expect.values(), *self.compare.values()]
            if claim.probe is not None
        ]
        rows = self.validation.compare if self.validation else ()
        named += [row.measure.probe for row in rows if row.measure.probe is not None]
        return list({probe.text: probe for probe in named}.values())

    @cached_property
    def extreme_probes(self) -> list[Probe]:
        """Probes of which only the extremes are recorded: at points of pipe profiles, for limits and expectations."""
        named = [*of_profiles(self.links)]
        extents = [
            claim.extent
            for claim in [*self.limits.values(), *self.expect.values()]
            if claim.extent is not None
        ]
        rows = self.validation.compare if self.validation else ()
        extents += [row.measure.extent for row in rows if row.measure.extent is not None]
        for extent in extents:
            named += extent.probes(self.links)
        if self.energy is not None:
            from fvsolve.parts.pump.energy_use import watched_powers

            powers = watched_powers(self.links)
            named += [Probe(text, "links", *place, None, "power") for text, place in powers.items()]
        return list({probe.text: probe for probe in named}.values())

    @cached_property
    def links_with_force_probe(self) -> set[str]:
        """Names of links whose force a probe reads."""
        probes = [*self.probes, *self.extreme_probes]
        return {
            probe.name for probe in probes if (probe.part, probe.quantity) == ("links", "force")
        }

    @property
    def schemes(self) -> tuple[str, ...]:
        """Names of the schemes that this case may use: with cavitation only those that can compute cavities."""
        air = self.properties.air
        return CAVITY_SCHEMES if air is not None and air.cavitation else tuple(SCHEMES)

    @cached_property
    def law(self) -> Law:
        """Density law with the properties of the fluid."""
        return law_named(self.fluid.law)(self.properties, self.ambient_pressure, self.gravity)

    @cached_property
    def places(self) -> dict[str, Node]:
        """Hydraulic nodes, also inside parts, patches of basins, chambers of cylinders, by full name, at the start."""
        result = {}
        for name, node in self.nodes.items():
            if name in self.meshes:
                from fvsolve.case import basins

                pose = self.poses.get(node.on)
                result |= basins.places(
                    name, node, self.meshes[name], pose, self.patches_with_faces
                )
            elif node.domain == "hydraulic":
                result |= self.at_start(node).inner(name)[0]
        for name, link in self.links.items():
            result |= link.inner(name)[0]
            if "A" in link.owns:
                x = self.separation(link.ports["case"], link.ports["rod"]) - link.closed_length
                result |= {
                    f"{name}.{place}": chamber for place, chamber in link.chambers(x).items()
                }
        return result

    @cached_property
    def poses(self) -> dict[str, Any]:
        """Poses of bodies at the start, name -> `bodies.Pose`; each body comes after its carrier."""
        nodes = self.nodes_with_water
        if not any(node.kind == "body" for node in nodes.values()):
            return {}
        from fvsolve.case import bodies

        return bodies.poses(nodes, self.numerics.start)

    def at_start(self, node: Node) -> Node:
        """Node with its elevation at the start, if it is on a body."""
        if not self.poses:
            return node
        from fvsolve.case import bodies

        return bodies.with_elevation(node, self.poses)

    def body_point(self, place: str) -> tuple[str, Any]:
        """Name of the body ("" for the world) and position in its axes [m] of a place, see `bodies.body_point`."""
        from fvsolve.case import bodies

        return bodies.body_point(self.nodes, place)

    def pose_of(self, name: str) -> bodies.Pose:
        """Pose of a body at the start; the pose at rest for the world and for other nodes."""
        from fvsolve.case import bodies

        return self.poses.get(name, bodies.AT_REST)

    @cached_property
    def nodes_with_water(self) -> dict[str, Node]:
        """Nodes at the start, with lumped water as added mass of bodies and sloshing modes as extra bodies."""
        nodes = {**self.nodes, **self.equilibrium_nodes} if self.equilibrium_nodes else self.nodes
        if not self.lumped:
            return nodes
        from fvsolve.case import sloshing

        return sloshing.nodes_with_water(
            nodes, self.lumped, self.properties.density, self.gravity, self.numerics.start
        )

    @cached_property
    def as_stated(self) -> Case:
        """Copy of the case that starts at the positions in the file, not at those of the equilibrium.

        At these positions bushings are not twisted, and springs have their preload.
        """
        return replace(self, equilibrium_nodes={}) if self.equilibrium_nodes else self

    @cached_property
    def network_places(self) -> frozenset[str]:
        """Nodes of rotation, electricity and heat, and other places that links between such nodes join."""
        own = [name for name, node in self.nodes.items() if node.domain in NETWORK_DOMAINS]
        return frozenset(
            [*own, *(place for link in self.links.values() for place in link.network_places)]
        )

    @property
    def needs_equilibrium(self) -> bool:
        """True if the case starts in equilibrium and at least one body or mass is free to move."""
        joints = [node.joint for node in self.nodes.values() if node.kind == "body"]
        free = any(joint.kind != "fixed" and joint.drive_schedule is None for joint in joints)
        free = free or any(node.kind == "mass" for node in self.nodes.values())
        return free and self.numerics.initial == "equilibrium"

    def separation(self, first: str, second: str) -> float:
        """Distance [m] from the node or point `first` to `second` at the start; see `bodies.separation`.

        Between masses on their common axis it is positive if `second` has the greater coordinate, else negative.
        """
        from fvsolve.case import bodies

        return bodies.separation(self.nodes_with_water, self.poses, first, second)

    @cached_property
    def conduits(self) -> dict[str, Link]:
        """Links that the model computes: links of the file, and links inside parts, such as the inlet of a tank."""
        result = {}
        for name, part in [*self.nodes.items(), *self.links.items()]:
            result |= part.inner(name)[1]
        if not self.meshes:
            return result
        from fvsolve.case import basins

        return result | basins.face_links(self.nodes, self.meshes, self.patches_with_faces)

    @cached_property
    def patches_with_faces(self) -> frozenset[str]:
        """Patches through whose faces the flow of their links passes, see `basins.patches_with_faces`."""
        if not self.meshes:
            return frozenset()
        from fvsolve.case import basins

        return basins.patches_with_faces(self.nodes, self.links, self.meshes)

    @cached_property
    def unread_blocks(self) -> set[str]:
        """Names of the blocks of `controls` that no key follows and no other block reads."""
        read = {
            other
            for name, block in self.controls.items()
            for other in block.blocks_read
            if other != name
        }
        followed = {name for name, _ in followers(self.raw, "control")}
        return self.controls.keys() - read - followed

    @cached_property
    def notices(self) -> list[Notice]:
        """Notices of values outside usual ranges, of schedules after the end of the run, and of blocks without use."""
        found = (
            case_notices.range_notices(self),
            case_notices.end_notices(self),
            case_notices.unread_notices(self),
        )
        result = [notice for notices in found for notice in notices]
        if self.numerics.start_time is not None:
            from fvsolve.case.dated_notices import outside_notices

            result += outside_notices(self)
        return result

    @cached_property
    def elevations_stated(self) -> bool:
        """True if a hydraulic node, patch or chamber has an elevation, stated or from its body or a profile."""
        return any(place.elevation is not None for place in self.places.values())

    def elevation(self, name: str) -> float:
        """Elevation of a hydraulic node, patch or chamber above datum [m]; 0 if the case states no elevations.

        A reservoir given by head may lack an elevation although other nodes have one. It then has that of the first
        node with an elevation that a link joins to it, since only its head drives the flow. Raises FvsolveError for an
        unknown name.
        """
        if (
            neighbour := getattr(
                self._known(name, self.places, "place of the fluid"), "level_of", None
            )
        ) is not None:
            return self.elevation(neighbour)
        stated = self.places[name].elevation
        if stated is not None or not self.elevations_stated:
            return stated or 0.0
        for link in self.links.values():
            ends = list(link.ports.values())
            for other in ends if name in ends else []:
                if self.places[other].elevation is not None:
                    return self.places[other].elevation
        return 0.0

    @cached_property
    def elevations(self) -> dict[str, float]:
        """Elevations of all hydraulic nodes, patches and chambers above datum [m], by full name."""
        return {name: self.elevation(name) for name in self.places}

    def axis_elevation(self, name: str, fraction: Any) -> Any:
        """Elevation of the axis of a pipe at fractions of its length [m]."""
        link = self.links[name]
        low, high = (self.elevations[end] for end in (link.from_, link.to))
        return (
            low + fraction * (high - low)
            if link.profile is None
            else link.profile.at(fraction * link.length)
        )

    def unit_of(self, dimension: str) -> str:
        """Unit of a dimension in `[output]`, such as "bar" for "pressure"; the SI unit if `[output]` states none.

        A dimension with a `base`, such as "level" with "length", has the unit of its base if none is stated for itself.
        """
        known, stated = units.DIMENSIONS[dimension], self.output.units
        return stated.get(dimension) or stated.get(known.base) or known.si

    def amount(
        self, value: float, dimension: str, digits: int = 4, span: bool = False, silent: str = ""
    ) -> str:
        """Text of the value [SI] of a quantity, in its unit in `[output]`.

        digits : number of significant digits; silent : unit that is used in place of the SI unit
        span : True for a difference, for which the zero of the unit has no effect
        """
        unit = self.unit_of(dimension)
        unit = silent if silent and unit == units.DIMENSIONS[dimension].si else unit
        if span:
            return f"{units.find(units.span(unit), dimension).number(value):.{digits}g} {units.span(unit)}"
        return f"{units.convert(value, dimension, unit, self.ambient_pressure):.{digits}g} {unit}"

    def moment(self, t: float, digits: int = 6) -> str:
        """Text of the time t [s] in the unit of `[output]`, with its date if the case has a start time."""
        return moment_text(self.amount(t, "time", digits), t, self.numerics.start_time)

    def step_amount(self, step: float, digits: int = 6) -> str:
        """Text of a time step [s], in the unit of times in `[output]`, or in s if that unit is longer than 1 s."""
        longer = units.find(self.unit_of("time"), "time").si(1.0) > 1.0
        return f"{step:.{digits}g} s" if longer else self.amount(step, "time", digits)

    def wave_speed(self, name: str) -> float:
        """Wave speed of a pipe [m/s]: as stated, or sqrt(K / rho).

        1/K = 1/beta + c D / (E e), with bulk modulus beta and density rho of the fluid, diameter D, restraint factor
        c, wall thickness e and modulus E; a lining adds to E e. Raises FvsolveError if `name` is not that of a pipe.
        """
        link = self.links.get(name) if isinstance(name, str) else None
        if link is None or link.kind != "pipe":
            link = self._known(
                name, {key: pipe for key, pipe in self.links.items() if pipe.kind == "pipe"}, "pipe"
            )
        return wave_speed(link, self.properties)

    def retardation(self, name: str, scalar: str) -> float:
        """Retardation factor of a scalar in a pipe: what fluid and wall store, over what the fluid stores."""
        factor = self.links[name].retardation.get(scalar, 1.0)
        if factor != OF_WALL:
            return factor
        return heat_retardation(
            self.links[name], self.properties.density, self.scalars[scalar].specific_heat
        )

    def _known(self, name: str, known: dict[str, Any], noun: str) -> Any:
        if not isinstance(name, str) or name not in known:
            text = f"unknown {noun} {show(name)}{did_you_mean(str(name), known)}"
            raise FvsolveError(
                f"{text}; {f'expected {listing(known)}' if known else f'the case has no {noun}'}"
            )
        return known[name]

    def resolved(self) -> str:
        """TOML text of the case in SI with all defaults filled in; with its files beside it, it gives an equal case.

        Properties that follow from the fluid's name are comments, because as keys they would override the properties
        at another temperature.
        """
        fluid = self.properties.plain()
        came = [
            f"# {key} = {text.inline(value)}" for key, value in fluid.items() if value is not None
        ]
        return text.write(self.table()).replace(
            "\n[fluid]\n", "\n".join(["", "[fluid]", *came[1:], ""]), 1
        )

    def table(self) -> dict[str, Any]:
        """Nested dicts of the case, shaped like a case file, in SI with every default filled in."""
        result = {
            "schema": self.schema,
            "title": self.title,
            "description": self.description,
            "source": self.source,
            "ambient_pressure": self.ambient_pressure,
            "gravity": self.gravity,
            "fluid": self.fluid.table(),
            "nodes": {
                name: {"type": node.kind, **node.table()}
                for name, node in self.nodes.items()
                if not node.added
            },
            "links": {
                name: {"type": link.type_in_file or link.kind, **link.table()}
                for name, link in self.links.items()
            },
            "signals": {name: plain_value(signal) for name, signal in self.signals.items()},
            "controls": {
                name: {"type": block.control.kind, **block.control.table()}
                for name, block in self.controls.items()
            },
            "scalars": {name: item.table() for name, item in self.scalars.items()},
            "reactions": {name: item.table() for name, item in self.reactions.items()},
            "numerics": self.numerics.table(),
            "output": self.output.table(),
            "expect": {name: item.table() for name, item in self.expect.items()},
            "compare": {name: item.table() for name, item in self.compare.items()},
            "routes": {name: item.table() for name, item in self.routes.items()},
            "limits": {name: item.table() for name, item in self.limits.items()},
            "energy": self.energy.table() if self.energy is not None else {},
            "exact": self.exact.table() if self.exact else {},
            "validation": self.raw.get("validation", {}),
            **{name: item.table() for name, item in self.declared.items()},
        }
        return {key: value for key, value in result.items() if value not in ("", {})}

    @cached_property
    def identity_text(self) -> str:
        """JSON of `table` without the end time, `STEP_KEYS`, and the keys that change the report of a run only."""
        table = {key: value for key, value in self.table().items() if key not in self.report_keys}
        table["numerics"] = {
            key: x for key, x in table["numerics"].items() if key not in ("end", *STEP_KEYS)
        }
        return json.dumps(table, sort_keys=True, default=str)

    @property
    def report_keys(self) -> set[str]:
        """Names of the tables and texts of the case that change no number of a run, only its report."""
        declared = {name for name, item in self.declared.items() if not item.changes_results}
        return {*REPORT_KEYS, *declared}

    @cached_property
    def step_keys(self) -> dict[str, Any]:
        """Values of `STEP_KEYS`; they change the numbers of a run, but not the meaning of its state."""
        return {key: value for key, value in self.numerics.table().items() if key in STEP_KEYS}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Case):
            return NotImplemented
        return self.table() == other.table()

    __hash__ = None


def wave_speed(pipe: Pipe, fluid: Any) -> float:
    """Wave speed in a pipe filled with a fluid [m/s]: as stated, or from the stiffness of fluid and wall."""
    if pipe.wave_speed is not None:
        return pipe.wave_speed
    return math.sqrt(1.0 / (1.0 / fluid.bulk_modulus + elastic_compliance(pipe)) / fluid.density)


def default_cells(pipes: dict[str, Pipe], fluid: Any, cell_time: float | None) -> dict[str, int]:
    """Number of cells of each pipe: as stated, else the travel time of a wave divided by `cell_time` [s], at least 1.

    If `cell_time` is None, the longest travel time of a pipe divided by `DEFAULT_CELLS` is used. A number above 10^18
    is replaced by 10^18; the caller refuses it.
    """
    travel = {name: pipe.length / wave_speed(pipe, fluid) for name, pipe in pipes.items()}
    if cell_time is None:
        cell_time = max(travel.values(), default=0.0) / DEFAULT_CELLS
    counts = {}
    for name, pipe in pipes.items():
        ratio = travel[name] / cell_time if cell_time > 0 else math.inf
        counts[name] = max(1, round(min(ratio, 1e18))) if pipe.cells is None else pipe.cells
    return counts
