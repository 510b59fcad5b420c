"""Meshes of basins, and checks of basins against the rest of a case."""

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

from fvsolve.case import moving_wall_checks, nodes_on_bodies
from fvsolve.case.resource_checks import BASIN_CELL, byte_text, free_memory, name_faults
from fvsolve.case.sections import Output
from fvsolve.errors import MeshError, did_you_mean, listing
from fvsolve.fluid.laws import law_names
from fvsolve.parts import Basin
from fvsolve.parts.basin import BasinStart, MovingWall, PatchNode
from fvsolve.parts.formula import means, samples
from fvsolve.parts.value import ReadContext, ValueFault
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh
    from fvsolve.mesh.mesh import MeshPoints

Faults = Iterator[tuple[tuple, str]]


@dataclass(frozen=True)
class BasinFields:
    """Mesh of a basin, and its fields that probes can record (name -> dimension)."""

    fields: dict[str, str]
    mesh: Mesh
    kind: ClassVar[str] = "basin"
    quantities: ClassVar[dict[str, str]] = {}

    def point(self, label: str, place: str | None) -> tuple[float, float]:
        """Point (x, y) [m] from the text `place` after "@" in a probe, such as "3.5,1.2".

        label : text of the probe before "@", for messages; place : None if the probe has no "@"
        Raises ValueError if the text is not a point inside the mesh.
        """
        middle = ",".join(f"{value:.4g}" for value in self.mesh.centre[len(self.mesh.centre) // 2])
        if place is None:
            raise ValueError(f'a probe of a basin needs a point, for example "{label}@{middle}"')
        try:
            x, y = (float(part) for part in place.split(","))
        except ValueError:
            raise ValueError(f'"@{place}" is not a point x,y [m]; expected for example "@{middle}"') from None
        return self.inside(x, y)

    def inside(self, x: float, y: float) -> tuple[float, float]:
        """Return the point (x, y) [m] if it lies inside the mesh. Raises ValueError if it lies outside or in a hole."""
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"{x:g}, {y:g} is not a point")
        if self.points.cell(x, y) < 0:
            near = ",".join(f"{value:.6g}" for value in self.points.nearest(x, y))
            raise ValueError(f"{x:g},{y:g} m lies outside the mesh or in a hole; the nearest point inside is {near}")
        return x, y

    @cached_property
    def points(self) -> MeshPoints:
        """Locator that finds the cell of a point."""
        from fvsolve.mesh.mesh import MeshPoints

        return MeshPoints(self.mesh)


def probe_kinds(name: str, basin: Basin, mesh: Mesh | None, lumped: Mesh | None, scalars: dict) -> dict[str, Any]:
    """Kinds of a basin and of its patches for the reading of probes, by full name.

    mesh, lumped : mesh of a basin with cells, or of a basin whose water is lumped masses; the other is None
    A basin without cells has the depth with sloshing modes, otherwise no fields; its kind is None if it is faulty.
    """
    own = basin.physics_type
    if lumped is not None:
        fields = {"depth": own.fields["depth"]} if basin.sloshing == "modes" and own.has_modes else {}
        return {name: BasinFields(fields, lumped) if own.has_modes else None}
    fields = own.fields | (dict.fromkeys(scalars, "number") if own.carries else {})
    patches = {f"{name}.{patch}": place_kind(basin, patch) for patch in patch_names(mesh)}
    return {name: BasinFields(fields, mesh), **patches}


def mesh_of(basin: Basin, setting: ReadContext) -> Mesh:
    """Mesh of a basin, from its keys or its mesh file. Raises ValueFault with all faults of the mesh."""
    from fvsolve.mesh import read, rectangle

    try:
        if basin.mesh is None:
            count = math.prod(basin.cells or ())
            if count * BASIN_CELL > free_memory():
                text = f"{count:.3g} cells take about {byte_text(count * BASIN_CELL)} of memory"
                raise ValueFault(
                    [(("cells",), f"{text}, and {byte_text(free_memory())} are free; expected fewer cells")]
                )
            sides = {name: (item.side, *item.span) if item.span else item.side for name, item in basin.patches.items()}
            grading = basin.grading or (1.0, 1.0)
            return rectangle(basin.size, basin.cells, grading=grading, patches=sides, holes=basin.holes or ())
        return read(setting.files[basin.mesh.file], basin.mesh.unit)
    except MeshError as error:
        if basin.mesh is not None:  # the faults are in the mesh file, not in keys of the case
            name, places = Path(basin.mesh.file).name, [item.place == "unit" for item in error.faults]
            raise ValueFault([(("mesh", "unit"), item.message) if key else (("mesh",), f"{name}: {item}")
                          for key, item in zip(places, error.faults, strict=True)]) from None  # fmt: skip
        raise ValueFault([(fault_keys(fault.place), fault.message) for fault in error.faults]) from None


def fault_keys(place: str) -> tuple:
    """Key path from the place of a mesh fault, such as "patches.east" or "holes[0]".

    It is () if the place does not begin with a key of a basin.
    """
    path = [int(word) if word.isdigit() else word for word in re.split(r"[.\[\]]", place) if word]
    return tuple(path) if path and path[0] in Basin.keys() else ()


def line_faults(output: Output, nodes: dict[str, Any]) -> Faults:
    """Faults (key path, message) of `[output.lines]`, the lines across basins.

    nodes : name -> class of the node, the `BasinFields` of a basin, or None for a faulty node
    """
    for name, line in output.lines.items():
        pool, key = nodes.get(line.basin), ("output", "lines", name)
        yield from ((key, text) for text in name_faults(name))
        if line.basin in nodes and pool is None:
            continue  # the basin itself is faulty
        if not isinstance(pool, BasinFields):
            pools = [basin for basin, kind in nodes.items() if kind is None or isinstance(kind, BasinFields)]
            near = did_you_mean(line.basin, pools) or f"; basins are {listing(pools) or 'none'}"
            yield (*key, "basin"), f"no basin named {show(line.basin)}{near}"
            continue
        for end, point in (("from", line.from_), ("to", line.to)):
            try:
                pool.inside(*point)
            except ValueError as error:
                yield (*key, end), str(error)
        if line.from_ == line.to:
            yield (*key, "to"), "is also the start of the line; expected another point"
    if output.lines and output.fields == 0:
        yield ("output", "lines"), "are written with every frame, but `fields` is 0; expected `fields = 1` or more"


def patch_names(mesh: Mesh) -> tuple[str, ...]:
    """Names of the patches of a mesh that a case may use: all but the last, which holds the faces without a name."""
    return mesh.patches[:-1]


def boundary_cells(mesh: Mesh, patch: str) -> np.ndarray:
    """Indices of the cells that have a face in a patch : int64[count], sorted."""
    return np.unique(mesh.left[mesh.patch(patch)])


def place_kind(basin: Basin, patch: str) -> type[PatchNode]:
    """Class of the node that a patch forms for links: `MovingWall` or `PatchNode`."""
    stated = basin.patches.get(patch)
    return MovingWall if stated is not None and stated.moves else PatchNode


def places(name: str, basin: Basin, mesh: Mesh, pose: Any = None) -> dict[str, PatchNode]:
    """Nodes at the patches of a basin, also at moving walls, by full name BASIN.PATCH, with their state at rest.

    pose : pose of the body that carries the basin; if None, elevation and depth are those of the upright basin
    """
    result = {}
    for patch in patch_names(mesh):
        rest = basin.physics_type.rest(
            basin, lambda shape: means(samples(shape, mesh)), boundary_cells(mesh, patch), mesh.area
        )
        if basin.on is not None:
            rest = nodes_on_bodies.on_body(basin, mesh, patch, rest, pose)
        kind = place_kind(basin, patch)
        result[f"{name}.{patch}"] = kind.model_construct(position=None, basin=name, patch=patch, **rest)
    return result


def places_on_bodies(nodes: dict[str, Any], meshes: dict[str, Mesh]) -> dict[str, PatchNode]:
    """Nodes at the patches of basins on bodies, by full name BASIN.PATCH.

    Elevation and depth are those of the upright basin, see `places`. Basins with faulty formulas are left out.
    """
    result: dict[str, PatchNode] = {}
    for name, mesh in meshes.items():
        if nodes[name].on is not None:
            with suppress(ValueError):
                result |= places(name, nodes[name], mesh)
    return result


def _patch_hint(basin: Basin, known: tuple[str, ...], name: str) -> str:
    """Text that lists the patches `known`, or explains how to give the patch `name` its name in the mesh file."""
    if known or basin.mesh is None:
        return f"patches are {listing(known) or 'none'}"
    file = Path(basin.mesh.file).name
    return (
        f"{file} has no named groups of lines; in Gmsh name the lines of this patch, such as 1 and 2, by "
        f"Physical Curve({show(name)}) = {{1, 2}};"
    )


def find_faults(
    nodes: dict[str, Any], links: dict[str, Any], meshes: dict, fluid: Any, times: tuple, all_nodes: Any
) -> Faults:
    """Faults (key path, message) of basins: density law, body, patches, moving walls, formulas.

    meshes : meshes of basins by name; fluid : properties of the fluid, or None if it is faulty
    times : start and end of the run [s]; all_nodes : tables of all nodes, also of faulty nodes
    """
    pools = {name: node for name, node in nodes.items() if isinstance(node, Basin)}
    joined = {place for link in links.values() for place in link.ports.values()}
    for name, basin in pools.items():
        key = ("nodes", name)
        own = basin.physics_type
        if fluid is not None and not own.accepts_law(fluid.law):
            laws = law_names(lambda law, own=own: own.accepts_law(law.name))
            yield ("fluid", "law"), f"{show(fluid.law)} does not apply to {own.description}; expected {laws}"
        yield from nodes_on_bodies.basin_faults(name, basin, nodes, all_nodes)
        if name not in meshes:
            continue
        known = patch_names(meshes[name])
        yield from moving_wall_checks.find_faults(name, basin, meshes[name], nodes, joined, times, all_nodes)
        for patch, options in basin.patches.items():
            if patch not in known:
                yield (*key, "patches", patch), f"the mesh has no such patch; {_patch_hint(basin, known, patch)}"
            elif f"{name}.{patch}" in joined and not own.joined:
                text = "a link joins this patch, but the key `velocity` gives the flow; expected no link"
                yield (*key, "patches", patch), text
            elif f"{name}.{patch}" in joined and (options.boundary or options.impedance) is not None:
                key_name = "boundary" if options.boundary else "impedance"
                text = "a link joins this patch and is its boundary; leave this key out"
                yield (*key, "patches", patch, key_name), text
            if options.impedance is not None and not own.allows_impedance:
                text = f"does not apply to physics {show(basin.physics)}; leave this key out"
                yield (*key, "patches", patch, "impedance"), text
        shapes = [*own.formulas(basin, meshes[name])]
        if basin.start is not None:
            shapes += [
                (("start", key_name), getattr(basin.start, key_name), None) for key_name in BasinStart.model_fields
            ]
            for other in sorted(basin.start.model_fields_set - set(own.starts.model_fields)):
                yield (*key, "start", other), f"does not apply to physics {show(basin.physics)}; leave this key out"
        shapes += [(("scalars", scalar), shape, None) for scalar, shape in basin.scalars.items()]
        for below, shape, points in shapes:
            try:
                if points is not None:
                    shape.at(*np.ascontiguousarray(points.T))
                else:
                    samples(shape, meshes[name])
            except ValueError as error:
                yield (*key, *below), str(error)
