"""A case as read: names, parts and numbers in SI. Knows what was said; knows no file and no mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fvsolve import units
from fvsolve.case import basins, bodies, horizon, ranges, riding_networks, text
from fvsolve.case.claims import Compare, Expect
from fvsolve.case.extent import of_profiles
from fvsolve.case.limits import DesignLimit
from fvsolve.case.probe import Probe
from fvsolve.case.routes import Route
from fvsolve.case.sections import CAVITY_SCHEMES, DEFAULT_CELLS, ExactSpec, FluidSpec, Numerics, Output
from fvsolve.errors import FvsolveError, Notice, did_you_mean, listing
from fvsolve.fluid import LAWS, Fluid
from fvsolve.fluid.laws import Law
from fvsolve.parts import Link, Node, Pipe, Scalar
from fvsolve.parts.pipe.wall import softness
from fvsolve.parts.table import plain
from fvsolve.schemes import SCHEMES
from fvsolve.shown import Shown
from fvsolve.units import show


@dataclass(frozen=True, eq=False, repr=False)
class Case(Shown):
    """A hydraulic scene, frozen; SI, pressures absolute [Pa]. Two cases are equal if they say the same.

    properties : the fluid's numbers at its reference state
    nodes, links : name -> part, in the order of the file
    copies : name -> path of the files it used, under the names `resolved()` refers to
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
    exact: ExactSpec | None
    copies: dict[str, Path]
    raw: dict[str, Any] = field(repr=False)  # as the file says it, overrides included
    folder: Path | None = field(repr=False)
    meshes: dict[str, Any] = field(default_factory=dict, repr=False)  # of basins
    lumped: dict[str, Any] = field(default_factory=dict, repr=False)  # of those whose water is masses on its body
    read: dict[tuple, tuple] = field(default_factory=dict, repr=False)  # place -> (what stands there, the same read)
    found: dict[str, Node] = field(default_factory=dict, repr=False)  # bodies and masses where their forces balance

    picture = "fvsolve.draw.objects:case_figure"

    def said(self) -> str:
        basins = f", {len(self.meshes)} basins" if self.meshes else ""
        return (f"{self.name!r}: {len(self.nodes)} nodes, {len(self.links)} links{basins}, {self.fluid.name} under law "
                f"{self.fluid.law}, {self.numerics.start:g} to {self.numerics.end:g} s")  # fmt: skip

    def listed(self) -> dict[str, list]:
        parts = {**{("node", name): one for name, one in self.nodes.items()},
                 **{("link", name): one for name, one in self.links.items()}}  # fmt: skip
        joins = [", ".join(map(str, getattr(one, "ports", {}).values())) for one in parts.values()]
        kinds = [one.kind for one in parts.values()]
        return {"part": [name for _, name in parts], "is": [what for what, _ in parts], "type": kinds, "joins": joins}

    @property
    def files(self) -> list[Path]:
        """The schedule and compare files it used."""
        return list(self.copies.values())

    @property
    def probes(self) -> list[Probe]:
        """All that must be recorded: probes of the output, then those that only expect or compare name."""
        named = [*self.output.probes]
        named += [one.probe for one in [*self.expect.values(), *self.compare.values()] if one.probe is not None]
        return list({probe.text: probe for probe in named}.values())

    @cached_property
    def watched(self) -> list[Probe]:
        """What is followed beside the probes for its extremes alone: points of profiles, and what limits and claims
        extent."""
        named = [*of_profiles(self.links)]
        extents = [one.extent for one in [*self.limits.values(), *self.expect.values()] if one.extent is not None]
        for extent in extents:
            named += extent.probes(self.links)
        return list({probe.text: probe for probe in named}.values())

    @property
    def schemes(self) -> tuple[str, ...]:
        """Schemes that can follow what its fluid does."""
        air = self.properties.air
        return CAVITY_SCHEMES if air is not None and air.cavitation else tuple(SCHEMES)

    @cached_property
    def law(self) -> Law:
        """Its density law, with the fluid's numbers."""
        return LAWS[self.fluid.law](self.properties, self.ambient_pressure, self.gravity)

    @cached_property
    def places(self) -> dict[str, Node]:
        """Places of the fluid: hydraulic nodes, then the chambers that cylinders own, as they are at the start."""
        found = {}
        for name, node in self.nodes.items():
            if name in self.meshes:
                found |= basins.places(name, node, self.meshes[name], self.poses.get(node.on))
            elif node.domain == "hydraulic":
                found |= riding_networks.standing(node, self.poses).inner(name)[0]
        for name, link in self.links.items():
            found |= link.inner(name)[0]
            if "A" in link.owns:
                x = self.ahead(link.ports["case"], link.ports["rod"]) - link.closed_length
                found |= {f"{name}.{place}": chamber for place, chamber in link.chambers(x).items()}
        return found

    @cached_property
    def poses(self) -> dict[str, Any]:
        """Where bodies stand at the start, name -> `bodies.Pose`, each behind the one that it hangs on."""
        return bodies.poses(self.loaded, self.numerics.start)

    @cached_property
    def loaded(self) -> dict[str, Node]:
        """Nodes where they start, bodies with the mass of the water without cells that rides on them, and its modes as
        bodies."""
        from fvsolve.case.riding import loaded

        nodes = {**self.nodes, **self.found} if self.found else self.nodes
        if not self.lumped:
            return nodes
        return loaded(nodes, self.lumped, self.properties.density, self.gravity, self.numerics.start)

    @cached_property
    def stated(self) -> Case:
        """The same with bodies and masses where the file has them, from which bushings and preloads count."""
        return replace(self, found={}) if self.found else self

    @property
    def settles(self) -> bool:
        """Whether bodies and masses are to stand where their forces balance, and some may have to be moved for it."""
        joints = [node.joint for node in self.nodes.values() if node.kind == "body"]
        free = any(joint.kind != "fixed" and joint.driven is None for joint in joints)
        free = free or any(node.kind == "mass" for node in self.nodes.values())
        return free and self.numerics.initial == "equilibrium"

    def ahead(self, first: str, second: str) -> float:
        """How far place `second` lies ahead of `first` at the start [m]; of points their distance."""
        return bodies.ahead(self.loaded, self.poses, first, second)

    @cached_property
    def conduits(self) -> dict[str, Link]:
        """Links as they are solved: those of the file, and what parts own, such as the inlet of a tank."""
        found = {}
        for name, part in [*self.nodes.items(), *self.links.items()]:
            found |= part.inner(name)[1]
        return found

    @cached_property
    def notes(self) -> list[Notice]:
        """What it says beyond what practice knows, and beyond the end of the run."""
        return [*ranges.notices(self), *horizon.notices(self)]

    @cached_property
    def elevations_stated(self) -> bool:
        """Whether the places of the fluid state elevations."""
        return any(place.elevation is not None for place in self.places.values())

    def elevation(self, name: str) -> float:
        """Height of a place of the fluid above datum [m]: as stated; 0 where none is.

        A reservoir given by head may leave it out where others state theirs: it then lies level with the
        first node that one of its links leads to, since its head alone drives the flow.
        """
        if (beside := getattr(self._known(name, self.places, "place of the fluid"), "level_of", None)) is not None:
            return self.elevation(beside)
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
        """Heights of all places of the fluid above datum [m]."""
        return {name: self.elevation(name) for name in self.places}

    def unit_of(self, dimension: str) -> str:
        """The unit that `[output]` asks for, SI where it is silent."""
        known, asked = units.DIMENSIONS[dimension], self.output.units
        return asked.get(dimension) or asked.get(known.base) or known.si

    def amount(self, value: float, dimension: str, digits: int = 4, span: bool = False, silent: str = "") -> str:
        """A number [SI] with the unit that `[output]` asks for, as messages tell it.

        span : it is a difference, whose zero point does not matter; silent : the unit where `[output]` is
        """
        unit = self.unit_of(dimension)
        unit = silent if silent and unit == units.DIMENSIONS[dimension].si else unit
        if span:
            return f"{units.find(units.span(unit), dimension).number(value):.{digits}g} {units.span(unit)}"
        return f"{units.convert(value, dimension, unit, self.ambient_pressure):.{digits}g} {unit}"

    def step_amount(self, step: float, digits: int = 6) -> str:
        """A step [s] as messages tell it: in the unit of times, in s where that is longer."""
        longer = units.find(self.unit_of("time"), "time").si(1.0) > 1.0
        return f"{step:.{digits}g} s" if longer else self.amount(step, "time", digits)

    def wave_speed(self, name: str) -> float:
        """Wave speed of a pipe [m/s]: as stated, or sqrt(K / rho), 1/K = 1/beta + diameter / (E wall)."""
        link = self.links.get(name) if isinstance(name, str) else None
        if link is None or link.kind != "pipe":
            link = self._known(name, {one: pipe for one, pipe in self.links.items() if pipe.kind == "pipe"}, "pipe")
        return wave_speed(link, self.properties)

    def _known(self, name: str, known: dict[str, Any], what: str) -> Any:
        if not isinstance(name, str) or name not in known:
            said = f"no {what} {show(name)}{did_you_mean(str(name), known)}"
            raise FvsolveError(f"{said}; it has {listing(known) or 'none'}")
        return known[name]

    def resolved(self) -> str:
        """TOML text with every default filled in, in SI; it reads back as an equal case beside its files.

        What the fluid's name came to stands there as a comment: as keys it would hold at any other temperature.
        """
        fluid = self.properties.plain()
        came = [f"# {key} = {text.inline(value)}" for key, value in fluid.items() if value is not None]
        return text.write(self.table()).replace("\n[fluid]\n", "\n".join(["", "[fluid]", *came[1:], ""]), 1)

    def table(self) -> dict[str, Any]:
        """The same as nested dicts."""
        said = {
            "schema": self.schema,
            "title": self.title,
            "description": self.description,
            "source": self.source,
            "ambient_pressure": self.ambient_pressure,
            "gravity": self.gravity,
            "fluid": self.fluid.table(),
            "nodes": {name: {"type": node.kind, **node.table()} for name, node in self.nodes.items()},
            "links": {name: {"type": link.kind, **link.table()} for name, link in self.links.items()},
            "signals": {name: plain(signal) for name, signal in self.signals.items()},
            "scalars": {name: one.table() for name, one in self.scalars.items()},
            "numerics": self.numerics.table(),
            "output": self.output.table(),
            "expect": {name: one.table() for name, one in self.expect.items()},
            "compare": {name: one.table() for name, one in self.compare.items()},
            "routes": {name: one.table() for name, one in self.routes.items()},
            "limits": {name: one.table() for name, one in self.limits.items()},
            "exact": self.exact.table() if self.exact else {},
        }
        return {key: value for key, value in said.items() if value not in ("", {})}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Case):
            return NotImplemented
        return self.table() == other.table()

    __hash__ = None


def wave_speed(pipe: Pipe, fluid: Any) -> float:
    """Speed of waves in a pipe full of a fluid [m/s]."""
    if pipe.wave_speed is not None:
        return pipe.wave_speed
    return math.sqrt(1.0 / (1.0 / fluid.bulk_modulus + softness(pipe)) / fluid.density)


def default_cells(pipes: dict[str, Pipe], fluid: Any, cell_time: float | None) -> dict[str, int]:
    """Cells of the pipes that state none: as many as travel time / `cell_time` [s], one at least.

    `cell_time` defaults to the longest travel time of the case over `DEFAULT_CELLS`. A number too large for
    a count is cut at 10^18, for the caller to refuse.
    """
    travel = {name: pipe.length / wave_speed(pipe, fluid) for name, pipe in pipes.items()}
    if cell_time is None:
        cell_time = max(travel.values(), default=0.0) / DEFAULT_CELLS
    counts = {}
    for name, pipe in pipes.items():
        ratio = travel[name] / cell_time if cell_time > 0 else math.inf
        counts[name] = max(1, round(min(ratio, 1e18))) if pipe.cells is None else pipe.cells
    return counts
