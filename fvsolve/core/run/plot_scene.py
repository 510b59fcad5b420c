"""Data of the pictures that `view` draws of a run: frames, units, and positions of parts."""

from pathlib import Path

import numpy as np

from fvsolve.case.basins import patch_names
from fvsolve.core.output import network_layout
from fvsolve.core.output.fields import FIELD_UNITS, read_pipe_lines
from fvsolve.core.output.unit_columns import column
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.exact.solution import value
from fvsolve.parts.date_keys import moment_text
from fvsolve.report.draw.scene import PLAUSIBLE_SCALE, DrawnPart, DrawnScene, DrawnUnit

DIMENSIONS = {
    "pressure": "pressure",
    "min_pressure": "pressure",
    "max_pressure": "pressure",
    "head": "head",
    "min_head": "head",
    "max_head": "head",
    "velocity": "velocity",
    "speed": "velocity",
    "flow": "flow",
}
# units of pictures if `[output]` sets none: pressures in Pa are hard to read
DEFAULT_UNITS = {"pressure": "bar"}


def scene_of(
    case, title: str, field: str, frames: list[tuple[float, list[Path]]], contours: int
) -> DrawnScene:
    """Scene of a quantity of a run, for drawing; without frames, only its parts.

    field : name of the quantity; frames : list of (time [s], files with the fields); contours : number of contour lines
    Raises FvsolveError for an unknown quantity of a case with pipes that has no basins and no bodies; for other cases
    the drawing raises it.
    """
    clock = column("t", "time", case)
    over_run = any(field in case.nodes[name].physics_type.maxima for name in case.meshes)
    caption = f"{field.replace('_', ' ')} {'up to' if over_run else 'at'} t = "
    start = case.numerics.start_time
    captions = [
        (moment_text(f"{caption}{clock.from_si(t):.6g} {clock.unit}", t, start), files)
        for t, files in frames
    ]
    pipes = [name for name, link in case.links.items() if link.kind == "pipe"]
    lengths = {name: case.links[name].length for name in pipes}
    bodies = any(node.kind == "body" for node in case.nodes.values())
    scene = DrawnScene(
        title, unit_of(case, field), *lengths_of(case), captions, names=pipes, contours=contours
    )
    scene.over_run = over_run
    scene.plan = (
        "given" if all(node.position is not None for node in case.nodes.values()) else "laid out"
    )
    if not frames:
        none = np.zeros(0, int)
        scene.frames, scene.pipes = (
            [("parts", [])],
            [(np.zeros((0, 3)), none.reshape(0, 2), np.zeros(0), none)],
        )
        lengths = {
            name: link.length for name, link in case.links.items() if hasattr(link, "length")
        }
        scene.plan = "schematic" if scene.plan != "given" and not lengths else scene.plan
    elif pipes and not case.meshes and not bodies:
        known = [*FIELD_UNITS, *case.scalars]
        if field not in known:
            raise FvsolveError(
                f"unknown field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}"
            )
        scene.pipes = [read_pipe_lines(files[0], field) for _, files in frames]
        if scene.plan == "given" and not _to_scale(scene, lengths):
            scene.plan = "own scale"
    scene.bodies = list(case.poses) if bodies else []
    if not bodies:
        plan = (
            network_layout.plan_positions(case, lengths)
            if pipes or not frames
            else _about_basins(case)
        )
        scene.parts, scene.anchors = parts_of(case, plan), _anchors(case, plan)
        scene.walls = _walls(case, plan)
    return scene


def unit_of(case, field: str) -> DrawnUnit:
    """Unit of a quantity in pictures: as in `[output]`, by default bar for pressures; "" for unknown names."""
    if field in case.scalars:
        return DrawnUnit(field, case.scalars[field].unit)
    dimensions = {}
    for name in case.meshes:
        dimensions |= case.nodes[name].physics_type.fields | case.nodes[name].physics_type.maxima
    dimension = (dimensions | DIMENSIONS).get(field)
    if dimension is None:
        return DrawnUnit(field, "")
    unit_column = column(field, dimension, case)
    if unit_column.plain and dimension in DEFAULT_UNITS:
        label = unit_column.unit if dimension in case.output.units else DEFAULT_UNITS[dimension]
        unit_column = column(field, dimension, case, label)
    return DrawnUnit(
        field, unit_column.unit, unit_column.span_from_si(1.0), float(unit_column.from_si(0.0))
    )


def lengths_of(case) -> tuple[DrawnUnit, DrawnUnit]:
    """Units of plan coordinates and of heights in a picture, from `[output]`."""
    bodies = any(node.kind == "body" for node in case.nodes.values())
    plan, height = (
        ("position", "position") if bodies else ("length", "level" if case.meshes else "head")
    )
    columns = [column(name, name, case) for name in (plan, height)]
    return tuple(DrawnUnit(own.name, own.unit, own.span_from_si(1.0)) for own in columns)


def parts_of(case, plan: dict[str, np.ndarray]) -> list[DrawnPart]:
    """Nodes and links, except pipes and basins, with their positions in the drawing; plan : name -> x, y [m]."""
    links = {name: link for name, link in case.links.items() if link.kind != "pipe"}
    piped = {
        port for link in case.links.values() if link.kind == "pipe" for port in link.ports.values()
    }
    parts = []
    for name, node in case.nodes.items():
        if name in plan and name not in case.meshes:
            height = case.elevations.get(name, 0.0)
            fixed = name in piped or node.position is not None
            parts.append(
                DrawnPart(
                    f"nodes.{name}",
                    name,
                    _kinds(node),
                    (*map(float, plan[name]), height),
                    joint=node.kind == "junction",
                    held=fixed,
                )
            )
    nodes = {part.name: part for part in parts}
    for name, link in links.items():
        owners = [network_layout.place(port) for port in link.ports.values()]
        ends = [nodes[owner].at for owner in owners if owner in nodes]
        if not (ends or name in plan):
            continue
        at = (
            np.array([*plan[name], np.mean([end[2] for end in ends]) if ends else 0.0])
            if name in plan
            else None
        )
        at = np.mean(ends, axis=0) if at is None else at
        between = tuple(
            _key(port, case) for port in link.ports.values() if network_layout.place(port) != name
        )
        parts.append(
            DrawnPart(
                f"links.{name}",
                name,
                _kinds(link),
                tuple(map(float, at)),
                between,
                True,
                own_place=name in plan,
            )
        )
    return parts


def _key(port: str, case) -> str:
    """Key of the part or patch that a port joins: "nodes.NAME", "links.NAME" or "BASIN.PATCH"."""
    if port in case.nodes:
        return f"nodes.{port}"
    owner = network_layout.place(port)
    return (
        f"links.{owner}"
        if owner in case.links
        else port
        if owner in case.meshes
        else f"nodes.{owner}"
    )


def _kinds(part) -> tuple[str, ...]:
    """Type names of a part and of its base classes."""
    return tuple(
        dict.fromkeys(kind for base in type(part).__mro__ if (kind := base.__dict__.get("kind")))
    )


def _to_scale(scene: DrawnScene, lengths: dict[str, float]) -> bool:
    """True if the distances between stated positions roughly agree with the lengths of pipes."""
    points, lines, _, owner = scene.pipes[0]
    drawn = np.bincount(
        owner, np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1), len(lengths)
    )
    share = float(np.median(drawn / np.array(list(lengths.values()))))
    return PLAUSIBLE_SCALE[0] <= share <= PLAUSIBLE_SCALE[1]


def _anchors(case, plan: dict[str, np.ndarray]) -> dict[str, tuple[float, float, float]]:
    """Midpoints of the patches of basins in the drawing: BASIN.PATCH -> x, y, elevation [m]."""
    anchors = {}
    for name, mesh in case.meshes.items():
        for patch in patch_names(mesh):
            middle = plan[name] + mesh.middle[mesh.faces(patch).index].mean(axis=0)
            anchors[f"{name}.{patch}"] = (
                *map(float, middle),
                case.elevations.get(f"{name}.{patch}", 0.0),
            )
    return anchors


def _walls(case, plan: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Faces of each wall of the basins in the drawing, at its crest at the start : float64[faces, 2, 3] [m].

    Walls whose crests follow a control are left out, because their crests are known only in a run.
    """
    found = []
    for name, mesh in case.meshes.items():
        for wall in (getattr(case.nodes[name], "walls", None) or {}).values():
            if wall.crest.kind == "control":
                continue
            ends = plan[name] + mesh.points[mesh.ends[wall.chain(mesh).faces]]
            crest = float(value(wall.crest, case.numerics.start))
            height = np.full((*ends.shape[:2], 1), crest + (case.nodes[name].elevation or 0.0))
            found.append(np.concatenate([ends, height], axis=2))
    return found


def _about_basins(case) -> dict[str, np.ndarray]:
    """Plan positions (name -> x, y [m]) for a case of basins without pipes; parts at a patch lie outside of it."""
    plan = {
        name: np.array(node.position, float)
        for name, node in case.nodes.items()
        if node.position is not None
    }
    plan |= {name: np.zeros(2) for name in case.meshes if name not in plan}
    if len(plan) == len(case.nodes):
        return plan
    size = (
        max(float(np.ptp(mesh.points, axis=0).max()) for mesh in case.meshes.values())
        if case.meshes
        else 1.0
    )
    for _ in case.nodes:
        for link in case.links.values():
            ports = list(link.ports.values())
            for port, opposite in (ports, ports[::-1]) if len(ports) == 2 else ():
                if (
                    opposite in case.nodes
                    and opposite not in plan
                    and network_layout.place(port) in plan
                ):
                    owner, _, patch = port.partition(".")
                    out, start = (
                        _outward(case, owner, patch)
                        if patch
                        else (np.array([1.0, 0.0]), np.zeros(2))
                    )
                    plan[opposite] = plan[owner] + start + 0.12 * size * out
    return plan


def _outward(case, basin: str, patch: str) -> tuple[np.ndarray, np.ndarray]:
    """Unit vector out of a basin at a patch, and the midpoint of the patch [m] : float64[2] each.

    At an interior patch the vector leads away from the middle of the basin.
    """
    mesh = case.meshes[basin]
    middle = mesh.middle[mesh.faces(patch).index].mean(axis=0)
    inside = (
        mesh.centroid
        if patch in mesh.interior
        else mesh.centre[mesh.faces(patch).behind].mean(axis=0)
    )
    length = np.linalg.norm(middle - inside)
    return (middle - inside) / length if length > 0.0 else np.array([1.0, 0.0]), middle
