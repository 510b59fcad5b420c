"""Meshes, patches and outputs of basins, and checks of basins against the rest of a case."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.case import bodies
from fvsolve.case.interior_patches import interior_patches
from fvsolve.case.moving_walls import moving_wall_faults, moving_walls
from fvsolve.case.output_grids import grid_faults
from fvsolve.case.raster_meshes import (
    raster_extent,
    rasters_with_holes,
    stretch_notes,
    terrace_notes,
)
from fvsolve.case.resource_checks import BASIN_CELL, byte_text, free_memory, name_faults
from fvsolve.case.sections import Output
from fvsolve.core.fluid.laws import law_names
from fvsolve.errors import MeshError, did_you_mean, listing
from fvsolve.parts.formula import means, samples
from fvsolve.parts.mesh_fields import NODES
from fvsolve.parts.nodes_and_links import is_kind
from fvsolve.parts.value import ReadContext, ValueFault
from fvsolve.units import show


def closure_faults(basin: Any, options: Any) -> Faults:
    """Faults (key path within the patch, message) of the closure of a driven patch; options : keys of the patch."""
    if options.depth is not None and options.discharge is None:
        yield (
            ("depth",),
            "is the depth of an inflow by `discharge`; give `discharge` too, or leave this key out",
        )
    elif (
        options.depth is not None
        and options.depth.kind != "control"
        and not options.depth.value.max() > 0.0
    ):
        yield (
            ("depth",),
            "is never above 0; expected the depth of a supercritical inflow, or no key for critical flow",
        )
    if options.closure is None:
        return
    below = "boundary" if options.closure == options.boundary else options.closure
    if not basin.physics_type.has_closures:
        yield (below,), f"does not apply to physics {show(basin.physics)}; leave this key out"
        return
    if basin.on is not None:
        yield (
            (below,),
            "a basin on a body has no driven patches; expected a wall, an open boundary or a link",
        )
    if options.normal_slope is not None and not basin.manning:
        yield (below,), "needs the friction of the bed; give `manning` of the basin too"
    if options.rating is not None and options.rating.fault:
        key, text = options.rating.fault
        yield (below, key), text


def source_faults(basin: Any, mesh: Any) -> Faults:
    """Faults (key path within the basin, message) of rain, infiltration and walls in a basin that moves or deforms.

    A series of rain with too many frames is a fault too.
    """
    frames = len(getattr(getattr(basin, "rain", None), "frames", ()))
    if (size := 2 * 8 * frames * len(mesh.cells)) > free_memory():  # copied once
        text = f"{frames} frames on {len(mesh.cells)} cells take about {byte_text(size)} of memory, and "
        yield (
            ("rain",),
            f"{text}{byte_text(free_memory())} are free; expected fewer frames or cells",
        )
    for key in ("rain", "infiltration", "walls"):
        if getattr(basin, key, None) and (basin.on is not None or moving_walls(basin)):
            where = "a basin on a body" if basin.on is not None else "a basin with a moving wall"
            yield (
                (key,),
                f"is not supported for {where}; expected a fixed basin, or leave this key out",
            )


def face_wall_faults(basin: Any, mesh: Any) -> Faults:
    """Faults (key path within the basin, message) of the walls on faces between cells of a basin."""
    for name, wall in (getattr(basin, "walls", None) or {}).items():
        yield from ((("walls", name), text) for text in name_faults(name))
        if name in patch_names(mesh):
            yield ("walls", name), f"{name} is also the name of a patch; expected another name"
        if wall.group is not None and wall.group not in mesh.groups:
            what = "a rectangle has no groups; expected `line`"
            if not basin.is_rectangle:
                known = [*mesh.groups, *patch_names(mesh)]
                what = f"no such group in {Path(basin.mesh.file).name}{did_you_mean(wall.group, known)}"
                what += f"; its groups are {listing(known) or 'none'}"
            yield ("walls", name, "group"), what
        elif not wall.chain(mesh).faces.size:
            low, high = (
                ", ".join(f"{x:.6g}" for x in end)
                for end in (mesh.points.min(0), mesh.points.max(0))
            )
            text = f"cuts no face between two cells; the basin reaches from ({low}) m to ({high}) m"
            yield ("walls", name, "line" if wall.group is None else "group"), text


def rating_faults(basin: Any, mesh: Any, patch: str) -> Faults:
    """Fault (key path within the patch, message) of a rating with outflow below the bed."""
    rating = basin.patches[patch].rating
    if rating is None or rating.fault or not basin.physics_type.has_closures:
        return
    lowest, doubt = bed_at(basin, mesh, patch)
    if rating.lowest < lowest - doubt:
        text = f"passes water from the level {rating.lowest:g} m on, below the bed, {lowest:g} m at its lowest"
        yield ("rating", "level"), f"{text}; expected 0 flow up to the bed"


def bed_at(basin: Any, mesh: Any, patch: str) -> tuple[float, float]:
    """(lowest bed in the cells at a patch above the elevation, greatest step to an adjacent cell) [m].

    From the centres on, the bed may fall by this step to the outline. A faulty bed counts as -inf.
    """
    try:
        cells, bed = boundary_cells(mesh, patch), means(samples(basin.bed, mesh))
    except ValueError:
        return -math.inf, 0.0
    left, right = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    at = np.isin(left, cells) | np.isin(right, cells)
    return float(bed[cells].min()), float(np.abs(bed[left] - bed[right])[at].max(initial=0.0))


def crest_faults(links: dict[str, Any], pools: dict[str, Any], meshes: dict) -> Faults:
    """Faults (key path, message) of weirs between two basins with a crest that is always below the beds of both."""
    for name, weir in links.items():
        if not is_kind(weir, "weir") or weir.crest.kind == "control":
            continue
        ends = [*weir.ports.values()]
        levels = []
        doubts = []
        for pool, _, patch in (end.partition(".") for end in ends):
            if (
                pool in meshes
                and patch in patch_names(meshes[pool])
                and getattr(pools[pool], "bed", None) is not None
            ):
                lowest, doubt = bed_at(pools[pool], meshes[pool], patch)
                levels.append((pools[pool].elevation or 0.0) + lowest)
                doubts.append(doubt)
        top = float(weir.crest.value.max())
        if len(levels) == 2 and all(
            top < level - doubt for level, doubt in zip(levels, doubts, strict=True)
        ):
            at = " and ".join(
                f"{level:g} m at {end}" for level, end in zip(levels, ends, strict=True)
            )
            text = f"{top:g} m above datum is below the bed on both sides, {at}"
            yield (
                ("links", name, "crest"),
                f"{text}; expected a crest above the lower bed, in heights above datum",
            )


if TYPE_CHECKING:
    from fvsolve.core.mesh import Mesh
    from fvsolve.core.mesh.mesh import MeshPoints
    from fvsolve.parts.basin import Basin, PatchNode

Faults = Iterator[tuple[tuple, str]]


@dataclass(frozen=True)
class BasinFields:
    """Mesh of a basin, and its fields that probes can record (name -> dimension).

    has_maxima : True if its greatest values in cells can be recorded; what : text about the basin, for messages
    quantities : quantities of the whole basin (name -> dimension); gauges : named points [m]
    basin : keys of the basin
    """

    fields: dict[str, str]
    mesh: Mesh
    has_maxima: bool = False
    what: str = ""
    quantities: dict[str, str] = field(default_factory=dict)
    gauges: dict[str, tuple[float, float]] = field(default_factory=dict)
    basin: Any = None
    kind: ClassVar[str] = "basin"

    def point(self, label: str, place: str | None) -> tuple[float, float]:
        """Point (x, y) [m] from the text `place` after "@" in a probe, such as "3.5,1.2", or the name of a gauge.

        label : text of the probe before "@", for messages; place : None if the probe has no "@"
        Raises ValueError if the text is not a point inside the mesh.
        """
        middle = ",".join(f"{value:.4g}" for value in self.mesh.centre[len(self.mesh.centre) // 2])
        if place is None:
            raise ValueError(f'a probe of a basin needs a point, for example "{label}@{middle}"')
        if place.strip() in self.gauges:
            return self.gauges[place.strip()]  # a point outside is a fault of the gauge
        try:
            x, y = (float(part) for part in place.split(","))
        except ValueError:
            near = did_you_mean(place.strip(), self.gauges)
            text = f'"@{place}" is not a point x,y [m], or the name of a gauge of this basin{near}'
            raise ValueError(f'{text}; expected for example "@{middle}"') from None
        return self.inside(x, y)

    def inside(self, x: float, y: float) -> tuple[float, float]:
        """Return the point (x, y) [m] if it lies inside the mesh. Raises ValueError if it lies outside or in a hole."""
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"{x:g}, {y:g} is not a point")
        if self.points.cell(x, y) < 0:
            near = ",".join(f"{value:.6g}" for value in self.points.nearest(x, y))
            east, north = getattr(self.basin, "origin", None) or (0.0, 0.0)
            if (east or north) and self.points.cell(x - east, y - north) >= 0:
                near += (
                    f"; for easting and northing subtract `origin`: {x - east:.6g},{y - north:.6g}"
                )
            text = f"{x:.9g},{y:.9g} m lies outside the mesh or in a hole"
            raise ValueError(f"{text}; the nearest point inside is {near}")
        return x, y

    @cached_property
    def points(self) -> MeshPoints:
        """Locator that finds the cell of a point."""
        from fvsolve.core.mesh.mesh import MeshPoints

        return MeshPoints(self.mesh)


def probe_kinds(
    name: str, basin: Basin, mesh: Mesh | None, lumped: Mesh | None, scalars: dict
) -> dict[str, Any]:
    """Kinds of a basin and of its patches for the reading of probes, by full name.

    mesh, lumped : mesh of a basin with cells, or of a basin whose water is lumped masses; the other is None
    A basin without cells has the depth with sloshing modes, otherwise no fields; its kind is None if it is faulty.
    """
    own = basin.physics_type
    if lumped is not None:
        fields = (
            {"depth": own.fields["depth"]} if basin.sloshing == "modes" and own.has_modes else {}
        )
        what = f"the water of {name} has no cells (sloshing = {show(basin.sloshing)})"
        return {name: BasinFields(fields, lumped, what=what) if own.has_modes else None}
    fields = own.fields | (dict.fromkeys(scalars, "number") if own.carries else {})
    patches = {f"{name}.{patch}": place_kind(basin, patch) for patch in patch_names(mesh)}
    what = f"{name} has the physics {show(own.name)}"
    return {
        name: BasinFields(fields, mesh, bool(own.maxima), what, own.totals, basin=basin),
        **patches,
    }


def mesh_of(basin: Basin, setting: ReadContext) -> Mesh:
    """Mesh of a basin, from its keys or its mesh file. Raises ValueFault with all faults of the mesh."""
    from fvsolve.core.mesh import read, rectangle
    from fvsolve.core.mesh.rectangles import HOLES

    try:
        if basin.is_rectangle:
            size, cells, corner = (
                raster_extent(basin, setting)
                if basin.mesh
                else (basin.size, basin.cells, (0.0, 0.0))
            )
            count = math.prod(cells or ())
            if count * BASIN_CELL > free_memory():
                text = f"{count:.3g} cells take about {byte_text(count * BASIN_CELL)} of memory"
                text += f", and {byte_text(free_memory())} are free; expected fewer cells"
                raise ValueFault([(("mesh", "cell") if basin.mesh else ("cells",), text)])
            sides = {
                name: (item.side, *item.span) if item.span else item.side
                for name, item in basin.patches.items()
                if not item.is_interior
            }
            grading = basin.grading or (1.0, 1.0)
            rasters = rasters_with_holes(basin, setting)
            lacks = [("cells without data", raster.lacks) for raster in rasters]
            holes = basin.holes or ()
            if hasattr(holes, "lacks"):  # by polygons
                holes, lacks = (), [*lacks, (HOLES, holes.lacks)]
            mesh = rectangle(size, cells, corner, grading, sides, holes, lacks)
            notes = (*terrace_notes(basin, mesh.grid), *stretch_notes(basin, mesh, setting))
            mesh = replace(mesh, notes=(*notes, *getattr(basin.holes, "notes", ())))
            return replace(mesh, interior=interior_patches(basin, mesh))
        if rasters_with_holes(basin, setting):
            raise ValueFault(
                [
                    (
                        (),
                        "`outside` of a raster applies to rectangles; leave it out, or cut the mesh file",
                    )
                ]
            )
        groups = [wall.group for wall in (getattr(basin, "walls", None) or {}).values()]
        bed = getattr(basin, "bed", None)
        heights = bed is not None and bed.given == NODES
        path, unit = setting.files[basin.mesh.file], basin.mesh.unit
        mesh = read(path, unit, groups, heights, basin.mesh.ignore)
        mesh = replace(mesh, notes=(*mesh.notes, *stretch_notes(basin, mesh, setting)))
        return replace(mesh, interior=interior_patches(basin, mesh))
    except MeshError as error:
        if not basin.is_rectangle:  # the faults are in the mesh file, not in keys of the case
            name = Path(basin.mesh.file).name
            keys = ("unit", "ignore")
            places = [item.place if item.place in keys else "" for item in error.faults]
            raise ValueFault(
                [
                    (("mesh", key), item.message) if key else (("mesh",), f"{name}: {item}")
                    for key, item in zip(places, error.faults, strict=True)
                ]
            ) from None
        raise ValueFault(
            [(fault_keys(fault.place), fault.message) for fault in error.faults]
        ) from None


def fault_keys(place: str) -> tuple:
    """Key path from the place of a mesh fault, such as "patches.east" or "holes[0]".

    It is () if the place does not begin with a key of a basin.
    """
    from fvsolve.parts.basin import Basin

    path = [int(word) if word.isdigit() else word for word in re.split(r"[.\[\]]", place) if word]
    return tuple(path) if path and path[0] in Basin.keys() else ()


def output_faults(output: Output, nodes: dict[str, Any]) -> Faults:
    """Faults (key path, message) of the tables of `[output]` for basins: `lines`, `maxima`, `run_up`, `grids`.

    nodes : name -> class of the node, the `BasinFields` of a basin, or None for a faulty node
    """
    for group, named in (("lines", output.lines), ("run_up", output.run_up)):
        for name, line in named.items():
            key = "output", group, name
            yield from ((key, text) for text in name_faults(name))
            yield from _basin_faults((*key, "basin"), line.basin, nodes, group == "run_up")
            for end, text in _end_faults(line, nodes.get(line.basin), group == "lines"):
                yield (*key, end), text
    for name, grid in output.grids.items():
        key, pool = ("output", "grids", name), nodes.get(grid.basin)
        yield from ((key, text) for text in name_faults(name))
        yield from _basin_faults((*key, "basin"), grid.basin, nodes, False)
        if isinstance(pool, BasinFields) and pool.basin is not None:
            yield from (
                ((*key, *below), text) for below, text in grid_faults(grid, pool, output.fields)
            )
    for k, name in enumerate(output.maxima):
        yield from _basin_faults(("output", "maxima", k), name, nodes, True)
    if output.lines and output.fields == 0:
        yield (
            ("output", "lines"),
            "are written with every frame, but `fields` is 0; expected `fields = 1` or more",
        )


def add_gauges(output: Output, nodes: dict[str, Any]) -> Faults:
    """Add the gauges of `[output]` to their basins; yield their faults (key path, message).

    nodes : as for `output_faults`
    """
    for name, gauge in output.gauges.items():
        key, pool = ("output", "gauges", name), nodes.get(gauge.basin)
        yield from ((key, text) for text in name_faults(name))
        yield from _basin_faults((*key, "basin"), gauge.basin, nodes, False)
        if name in nodes:
            yield key, f"{name} is also the name of a node; expected another name"
        if isinstance(pool, BasinFields):
            pool.gauges[name] = gauge.at
            try:
                pool.inside(*gauge.at)
            except ValueError as error:
                yield (*key, "at"), str(error)


@dataclass(frozen=True)
class SectionKind:
    """Quantities that probes of a section record (name -> dimension)."""

    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    kind: ClassVar[str] = "section"


def section_kinds(
    output: Output, kinds: dict[str, Any]
) -> tuple[dict[str, SectionKind | None], list]:
    """(kinds of the sections of `[output]` for probes, None for a faulty section; faults (key path, message)).

    kinds : kinds of all parts, as for `read_probe`
    """
    result, faults = {}, []
    for name, section in output.sections.items():
        key, pool = ("output", "sections", name), kinds["nodes"].get(section.basin)
        found = [(key, text) for text in name_faults(name)]
        groups = [
            group
            for group in ("nodes", "links", "controls", "routes")
            if name in kinds.get(group, ())
        ]
        found += [
            (key, f"{name} is also a name in `{group}`; expected another name") for group in groups
        ]
        found += _basin_faults((*key, "basin"), section.basin, kinds["nodes"], True)
        # The ends of a polyline, as of a wall, may lie outside the basin.
        if section.line is None:
            found += [((*key, end), text) for end, text in _end_faults(section, pool, True)]
        if isinstance(pool, BasinFields) and not found:
            if pool.basin.on is not None or moving_walls(pool.basin):
                found.append(
                    (
                        (*key, "basin"),
                        f"{section.basin} moves or has a moving wall; expected a fixed basin",
                    )
                )
            elif not section.chain(pool.mesh).faces.size:
                found.append((key, "cuts no face between two cells; expected a longer line"))
        result[name] = None if found or pool is None else SectionKind()
        faults += found
    return result, faults


def _basin_faults(key: tuple, name: Any, nodes: dict[str, Any], recorded: bool) -> Faults:
    """Yield a fault with the key path `key` if `name` is not a suitable basin; nodes : as for `output_faults`.

    recorded : True if greatest values of the basin are recorded, or flows through sections
    """
    pool = nodes.get(name, name) if isinstance(name, str) else name
    if pool is not None and not isinstance(pool, BasinFields):
        pools = [
            basin for basin, kind in nodes.items() if kind is None or isinstance(kind, BasinFields)
        ]
        near = did_you_mean(str(name), pools) or f"; basins are {listing(pools) or 'none'}"
        yield key, f"no basin named {show(name)}{near}"
    elif pool is not None and recorded and not pool.has_maxima:
        from fvsolve.parts.basin import Physics

        able = listing(show(kind) for kind, physics in Physics.kinds.items() if physics.maxima)
        yield key, f"{pool.what}; expected a basin with cells and the physics {able}"


def _end_faults(line: Any, pool: Any, inside: bool) -> Iterator[tuple[str, str]]:
    """Yield (key, message) for each fault of the ends of a line; pool : its basin, a `BasinFields` if it is valid.

    inside : True if the ends must lie in the mesh
    """
    for key, point in (("from", line.from_), ("to", line.to)):
        try:
            if inside and isinstance(pool, BasinFields):
                pool.inside(*point)
        except ValueError as error:
            yield key, str(error)
    if line.from_ == line.to and line.to is not None:
        yield "to", "is also the start of the line; expected another point"


def patch_names(mesh: Mesh) -> tuple[str, ...]:
    """Names of the patches of a mesh that a case may use: all but the last, which holds the faces without a name."""
    return (*mesh.patches[:-1], *mesh.interior)


def boundary_cells(mesh: Mesh, patch: str) -> np.ndarray:
    """Indices of the cells that have a face in a patch, or of those in an interior patch : int64[count], sorted."""
    return (
        np.unique(mesh.faces(patch).inside) if patch not in mesh.interior else mesh.interior[patch]
    )


def place_kind(basin: Basin, patch: str) -> type[PatchNode]:
    """Class of the node that a patch forms: `MovingWall`, `DrivenPatch`, or else `PatchNode`."""
    from fvsolve.parts.basin import DrivenPatch, MovingWall, PatchNode

    stated = basin.patches.get(patch)
    if stated is not None and (stated.moves or stated.closure):
        return MovingWall if stated.moves else DrivenPatch
    return DrivenPatch if may_have_faces(basin) else PatchNode


def may_have_faces(basin: Basin) -> bool:
    """True if the flow of links may pass through the faces of the patches of a basin."""
    return basin.physics_type.has_closures and basin.on is None and not moving_walls(basin)


def patches_with_faces(
    nodes: dict[str, Any], links: dict[str, Any], meshes: dict
) -> frozenset[str]:
    """Full names of the patches through whose faces the flow of their links passes; cells take it at other patches.

    These are patches of fixed basins that may have closures, unless a rigid column joins them: a level that a column
    draws far below the bed, because its flow is above critical, would stop it within a step.
    """
    joined, others = set(), set()
    for link in links.values():
        (others if link.kind == "rigid-column" else joined).update(link.ports.values())
    fixed = [name for name in meshes if may_have_faces(nodes[name])]
    names = {f"{name}.{patch}" for name in fixed for patch in patch_names(meshes[name])}
    given = {
        f"{name}.{patch}"
        for name in fixed
        for patch, keys in nodes[name].patches.items()
        if is_source(keys)
    }
    ends = {
        f"{name}.{patch}"
        for name in fixed
        if nodes[name].added
        for patch in patch_names(meshes[name])
    }
    return frozenset(names & ((joined | given) - others) | ends)


def is_source(patch: Any) -> bool:
    """True for an interior patch with a given inflow."""
    return patch is not None and patch.is_interior and patch.discharge is not None


def places(
    name: str, basin: Basin, mesh: Mesh, pose: Any = None, with_faces: frozenset[str] = frozenset()
) -> dict[str, PatchNode]:
    """Nodes at the patches of a basin, also at moving walls, by full name BASIN.PATCH, with their state at rest.

    pose : pose of the body that carries the basin; if None, elevation and depth are those of the upright basin
    with_faces : result of `patches_with_faces`; the cells of such a patch are the node BASIN.PATCH.inside
    """
    from fvsolve.parts.basin import PatchJunction

    result = {}
    for patch in patch_names(mesh):
        rest = basin.physics_type.rest(
            basin, lambda shape: means(samples(shape, mesh)), boundary_cells(mesh, patch), mesh.area
        )
        if basin.on is not None:
            rest = bodies.on_body(basin, mesh, patch, rest, pose)
        kind, place = place_kind(basin, patch), f"{name}.{patch}"
        keys = {"position": None, "basin": name, "patch": patch, **rest}
        if place in with_faces and not basin.added:
            stated, inflow = basin.patches.get(patch), {}
            if is_source(stated):
                inflow = {"flow": stated.discharge, "scalars": stated.scalars}
            result[place] = PatchJunction.model_construct(**keys, **inflow)
            place = f"{place}.inside"
        result[place] = kind.model_construct(**keys)
    return result


def face_links(nodes: dict[str, Any], meshes: dict, with_faces: frozenset[str]) -> dict[str, Any]:
    """Links from the junctions of the links at patches to the cells there, by name BASIN.PATCH.face."""
    result = {}
    for name, mesh in meshes.items():
        for patch in patch_names(mesh):
            if f"{name}.{patch}" in with_faces:
                length = float(mesh.length[mesh.faces(patch).index].sum())
                result[f"{name}.{patch}.face"] = nodes[name].face_link(name, patch, length)
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


def _patch_hint(basin: Basin, mesh: Any, name: str) -> str:
    """Text that lists the patches of a mesh, or explains how to give the patch `name` its name in the mesh file."""
    known = patch_names(mesh)
    if name in mesh.groups:
        return f"the lines of this group lie between cells, where `walls` may name it; patches are {listing(known)}"
    if known or basin.is_rectangle:
        return f"patches are {listing(known) or 'none'}"
    file = Path(basin.mesh.file).name
    return (
        f"{file} has no named groups of lines; in Gmsh name the lines of this patch, such as 1 and 2, by "
        f"Physical Curve({show(name)}) = {{1, 2}};"
    )


def patch_faults(name: str, basin: Any, mesh: Any, joined: set) -> Faults:
    """Faults (key path below `patches`, message) of the patches of a basin.

    joined : places that links join
    """
    own = basin.physics_type
    known = patch_names(mesh)
    for patch, options in basin.patches.items():
        if patch not in known:
            text = f"the mesh has no such patch; {_patch_hint(basin, mesh, patch)}"
            yield (patch,), text
        elif f"{name}.{patch}" in joined and not own.joined:
            text = (
                "a link joins this patch, but the key `velocity` gives the flow; expected no link"
            )
            yield (patch,), text
        elif f"{name}.{patch}" in joined:
            text = "a link joins this patch and is its boundary; leave this key out"
            given = (key for key in options.boundary_keys if getattr(options, key) is not None)
            yield from (((patch, key), text) for key in given)
        if patch in known:
            faults = [*closure_faults(basin, options), *rating_faults(basin, mesh, patch)]
            yield from (((patch, *below), text) for below, text in faults)
        if options.impedance is not None and not own.allows_impedance:
            text = f"does not apply to physics {show(basin.physics)}; leave this key out"
            yield (patch, "impedance"), text


def find_faults(
    nodes: dict[str, Any],
    links: dict[str, Any],
    meshes: dict,
    fluid: Any,
    times: tuple,
    all_nodes: Any,
) -> Faults:
    """Faults (key path, message) of basins: density law, body, patches, moving walls, formulas.

    meshes : meshes of basins by name; fluid : properties of the fluid, or None if it is faulty
    times : start and end of the run [s]; all_nodes : tables of all nodes, also of faulty nodes
    """
    pools = {name: node for name, node in nodes.items() if is_kind(node, "basin")}
    joined = {place for link in links.values() for place in link.ports.values()}
    yield from crest_faults(links, pools, meshes)
    for name, basin in pools.items():
        key = ("nodes", name)
        own = basin.physics_type
        if fluid is not None and not own.accepts_law(fluid.law):
            laws = law_names(own.accepts_law)
            yield (
                ("fluid", "law"),
                f"{show(fluid.law)} does not apply to {own.description}; expected {laws}",
            )
        yield from bodies.basin_faults(name, basin, nodes, all_nodes)
        if name not in meshes:
            continue
        yield from moving_wall_faults(name, basin, meshes[name], nodes, joined, times, all_nodes)
        faults = patch_faults(name, basin, meshes[name], joined)
        yield from (((*key, "patches", *below), text) for below, text in faults)
        shapes = [*own.formulas(basin, meshes[name])]
        if basin.start is not None:
            shapes += [
                (("start", key_name), getattr(basin.start, key_name), None)
                for key_name in type(basin.start).model_fields
            ]
            for other in sorted(basin.start.model_fields_set - set(own.starts.model_fields)):
                yield (
                    (*key, "start", other),
                    f"does not apply to physics {show(basin.physics)}; leave this key out",
                )
        shapes += [(("scalars", scalar), shape, None) for scalar, shape in basin.scalars.items()]
        below_faults = [*source_faults(basin, meshes[name]), *face_wall_faults(basin, meshes[name])]
        yield from (((*key, *below), text) for below, text in below_faults)
        for below, shape, points in shapes:
            try:
                if points is not None:
                    shape.at(*np.ascontiguousarray(points.T))
                else:
                    samples(shape, meshes[name])
            except ValueError as error:
                yield (*key, *below), str(error)
            else:
                yield from (
                    ((*key, *below), text)
                    for text in own.value_faults(basin, below, shape, meshes[name])
                )
