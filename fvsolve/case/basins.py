"""Meshes of basins, and what must hold between these, their patches and the rest of a case. Knows no network."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.case import riding, walls
from fvsolve.case.cells import means, samples
from fvsolve.case.riding_patches import on_body
from fvsolve.case.sections import Output
from fvsolve.case.size import BASIN_CELL, LONGEST_NAME, free_memory, size
from fvsolve.errors import MeshError, did_you_mean, listing
from fvsolve.fluid.laws import named
from fvsolve.parts import Basin
from fvsolve.parts.basin.part import MovingWall, Place, StartOfFields
from fvsolve.parts.value import Misfit, Setting
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh
    from fvsolve.mesh.points import MeshPoints

Found = Iterator[tuple[tuple, str]]


@dataclass(frozen=True)
class Pool:
    """A basin as probes see it: its fields, name -> dimension, and its mesh."""

    fields: dict[str, str]
    mesh: Mesh
    kind: ClassVar[str] = "basin"
    quantities: ClassVar[dict[str, str]] = {}

    def point(self, what: str, place: str | None) -> tuple[float, float]:
        """The point inside that a text such as "3.5,1.2" means [m]; ValueError where it means none."""
        middle = ",".join(f"{value:.4g}" for value in self.mesh.centre[len(self.mesh.centre) // 2])
        if place is None:
            raise ValueError(f'a basin is read at points: say where, for example "{what}@{middle}"')
        try:
            x, y = (float(one) for one in place.split(","))
        except ValueError:
            raise ValueError(f'"@{place}" is no point x,y [m]; wanted for example "@{middle}"') from None
        return self.inside(x, y)

    def inside(self, x: float, y: float) -> tuple[float, float]:
        """The same point; ValueError where it lies outside or in a hole."""
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"{x:g}, {y:g} is no point")
        if self.points.cell(x, y) < 0:
            near = ",".join(f"{value:.6g}" for value in self.points.nearest(x, y))
            raise ValueError(f"{x:g},{y:g} m lies outside the mesh or in a hole; the nearest point inside is {near}")
        return x, y

    @cached_property
    def points(self) -> MeshPoints:
        """Finds points of the mesh."""
        from fvsolve.mesh.points import MeshPoints

        return MeshPoints(self.mesh)


def lumped_fields(basin: Basin) -> dict[str, str]:
    """What can be read at points of water without cells: its depth where it swings."""
    return {"depth": basin.own.fields["depth"]} if basin.sloshing == "modes" and basin.own.sloshes else {}


def mesh_of(basin: Basin, setting: Setting) -> Mesh:
    """The mesh of a basin; Misfit with all that is wrong with it."""
    from fvsolve.mesh import read, rectangle

    try:
        if basin.mesh is None:
            many = math.prod(basin.cells or ())
            if many * BASIN_CELL > free_memory():
                said = f"{many:.3g} cells take about {size(many * BASIN_CELL)} of memory"
                raise Misfit([(("cells",), f"{said}, and {size(free_memory())} are free; wanted fewer")])
            sides = {name: (one.side, *one.span) if one.span else one.side for name, one in basin.patches.items()}
            grading = basin.grading or (1.0, 1.0)
            return rectangle(basin.size, basin.cells, grading=grading, patches=sides, holes=basin.holes or ())
        return read(setting.files[basin.mesh.file], basin.mesh.unit)
    except MeshError as error:
        if basin.mesh is not None:  # what is wrong lies in its file, and is no key of the case
            name, places = Path(basin.mesh.file).name, [one.place == "unit" for one in error.faults]
            raise Misfit([(("mesh", "unit"), one.message) if key else (("mesh",), f"{name}: {one}")
                          for key, one in zip(places, error.faults, strict=True)]) from None  # fmt: skip
        raise Misfit([(keys(fault.place), fault.message) for fault in error.faults]) from None


def keys(place: str) -> tuple:
    """What a fault's place says, as keys: "patches.east", "holes[0]"."""
    found = [int(one) if one.isdigit() else one for one in re.split(r"[.\[\]]", place) if one]
    return tuple(found) if found and found[0] in Basin.keys() else ()


def line_faults(output: Output, nodes: dict[str, Any]) -> Found:
    """Faults of lines across basins; `nodes` are kinds, or what of a basin can be read."""
    for name, line in output.lines.items():
        pool, key = nodes.get(line.basin), ("output", "lines", name)
        if len(name) > LONGEST_NAME:
            yield key, f"has {len(name)} letters; wanted {LONGEST_NAME} at most"
        if not re.fullmatch(r"[\w-]+", name):
            yield key, f"{show(name)} is no name; a name has letters, digits, _ and -"
        if line.basin in nodes and pool is None:
            continue  # at fault itself
        if not isinstance(pool, Pool):
            pools = [one for one, kind in nodes.items() if kind is None or isinstance(kind, Pool)]
            near = did_you_mean(line.basin, pools) or f"; basins are {listing(pools) or 'none'}"
            yield (*key, "basin"), f"no basin named {show(line.basin)}{near}"
            continue
        for end, point in (("from", line.from_), ("to", line.to)):
            try:
                pool.inside(*point)
            except ValueError as error:
                yield (*key, end), str(error)
        if line.from_ == line.to:
            yield (*key, "to"), "is where the line starts; wanted another point"
    if output.lines and output.fields == 0:
        yield ("output", "lines"), "are written at every frame, and fields is 0; wanted fields = 1 or more"


def patch_names(mesh: Mesh) -> tuple[str, ...]:
    """Patches that a file may name; the last one is all that has no name."""
    return mesh.patches[:-1]


def behind(mesh: Mesh, patch: str) -> np.ndarray:
    """Numbers of the cells behind a patch : int64[count]."""
    return np.unique(mesh.left[mesh.patch(patch)])


def place_kind(basin: Basin, patch: str) -> type[Place]:
    """What a patch is as a place."""
    stated = basin.patches.get(patch)
    return MovingWall if stated is not None and stated.moves else Place


def places(name: str, basin: Basin, mesh: Mesh, pose: Any = None) -> dict[str, Place]:
    """Patches as places, at rest; pose : of the body that it rides on, without which none says what it is under."""
    found = {}
    for patch in patch_names(mesh):
        rest = basin.own.rest(basin, lambda shape: means(samples(shape, mesh)), behind(mesh, patch), mesh.area)
        if basin.on is not None:
            rest = on_body(basin, mesh, patch, rest, pose)
        kind = place_kind(basin, patch)
        found[f"{name}.{patch}"] = kind.model_construct(position=None, basin=name, patch=patch, **rest)
    return found


def riding_places(nodes: dict[str, Any], meshes: dict[str, Mesh]) -> dict[str, Place]:
    """Patches of basins that ride, where they are on bodies; none of a basin whose formulas are at fault."""
    found: dict[str, Place] = {}
    for name, mesh in meshes.items():
        if nodes[name].on is not None:
            with suppress(ValueError):
                found |= places(name, nodes[name], mesh)
    return found


def _patches(basin: Basin, known: tuple[str, ...], wanted: str) -> str:
    """What patches there are, or how a file comes to have some."""
    if known or basin.mesh is None:
        return f"patches are {listing(known) or 'none'}"
    name = Path(basin.mesh.file).name
    return f"{name} names no groups of lines; Gmsh does by Physical Curve({show(wanted)}) = {{1, 2}};"


def misfits(
    nodes: dict[str, Any], links: dict[str, Any], meshes: dict, fluid: Any, times: tuple, all_nodes: Any
) -> Found:
    """Faults of patches, and of what basins do not go with; times : of start and end [s].

    all_nodes : names of all, also of those at fault themselves
    """
    found = {name: node for name, node in nodes.items() if isinstance(node, Basin)}
    joined = {place for link in links.values() for place in link.ports.values()}
    for name, basin in found.items():
        key = ("nodes", name)
        own = basin.own
        if fluid is not None and not own.goes(fluid.law):
            wanted = named(lambda law, own=own: own.goes(law.name))
            yield ("fluid", "law"), f"{show(fluid.law)} does not go with {own.described}; wanted {wanted}"
        yield from riding.misfits(name, basin, nodes, all_nodes)
        if name not in meshes:
            continue
        known = patch_names(meshes[name])
        yield from walls.misfits(name, basin, meshes[name], nodes, joined, times, all_nodes)
        for patch, one in basin.patches.items():
            if patch not in known:
                yield (*key, "patches", patch), f"the mesh has no such patch; {_patches(basin, known, patch)}"
            elif f"{name}.{patch}" in joined and not own.joined:
                yield (*key, "patches", patch), "a link joins here, but what flows is given by velocity"
            elif f"{name}.{patch}" in joined and (one.boundary or one.impedance) is not None:
                what = "boundary" if one.boundary else "impedance"
                yield (*key, "patches", patch, what), "a link joins here, and the patch is its boundary; leave it out"
            if one.impedance is not None and not own.echoes:
                yield (*key, "patches", patch, "impedance"), f"means nothing to physics {show(basin.physics)}"
        shapes = [*own.shapes(basin, meshes[name])]
        if basin.start is not None:
            shapes += [(("start", what), getattr(basin.start, what), None) for what in StartOfFields.model_fields]
            for other in sorted(basin.start.model_fields_set - set(own.starts.model_fields)):
                yield (*key, "start", other), f"means nothing to physics {show(basin.physics)}"
        shapes += [(("scalars", scalar), shape, None) for scalar, shape in basin.scalars.items()]
        for below, shape, points in shapes:
            try:
                if points is not None:
                    shape.at(*np.ascontiguousarray(points.T))
                else:
                    samples(shape, meshes[name])
            except ValueError as error:
                yield (*key, *below), str(error)
