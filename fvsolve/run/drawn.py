"""What `view` draws of a run: frames, units, and where parts stand. Knows cases and files; draws nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.case.basins import patch_names
from fvsolve.draw.aspect import LIKELY
from fvsolve.draw.scene import DrawnPart, DrawnScene, DrawnUnit
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.output import layout
from fvsolve.output.column import column
from fvsolve.output.fields import UNITS, read_lines

DIMENSIONS = {
    "pressure": "pressure", "least_pressure": "pressure", "greatest_pressure": "pressure", "head": "head",
    "velocity": "velocity", "speed": "velocity", "flow": "flow",
}  # fmt: skip
SILENT = {"pressure": "bar"}  # units of pictures where `[output]` is silent: six digits of Pa tell nobody anything


def scene_of(case, title: str, field: str, frames: list[tuple[float, list[Path]]], contours: int) -> DrawnScene:
    """The scene of frames (time [s], files) of a run, of none its parts; FvsolveError where there is no such field."""
    clock = column("t", "time", case)
    said = [(f"{field.replace('_', ' ')} at t = {clock.from_si(t):.6g} {clock.unit}", files) for t, files in frames]
    pipes = [name for name, link in case.links.items() if link.kind == "pipe"]
    lengths = {name: case.links[name].length for name in pipes}
    bodies = any(node.kind == "body" for node in case.nodes.values())
    scene = DrawnScene(title, unit_of(case, field), *lengths_of(case), said, names=pipes, contours=contours)
    scene.plan = "given" if all(node.position is not None for node in case.nodes.values()) else "laid out"
    if not frames:
        none = np.zeros(0, int)
        scene.frames, scene.pipes = [("parts", [])], [(np.zeros((0, 3)), none.reshape(0, 2), np.zeros(0), none)]
        lengths = {name: link.length for name, link in case.links.items() if hasattr(link, "length")}
        scene.plan = "schematic" if scene.plan != "given" and not lengths else scene.plan
    elif pipes and not case.meshes and not bodies:
        known = [*UNITS, *case.scalars]
        if field not in known:
            raise FvsolveError(f"no field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}")
        scene.pipes = [read_lines(files[0], field) for _, files in frames]
        if scene.plan == "given" and not _to_scale(scene, lengths):
            scene.plan = "own scale"
    scene.bodies = list(case.poses) if bodies else []
    if not bodies:
        plan = layout.positions(case, lengths) if pipes or not frames else _about_basins(case)
        scene.parts, scene.anchors = parts_of(case, plan), _anchors(case, plan)
    return scene


def unit_of(case, field: str) -> DrawnUnit:
    """A field in the unit of `[output]`; of what a physics from outside has, in that of its file."""
    if field in case.scalars:
        return DrawnUnit(field, case.scalars[field].unit)
    own = {key: one for name in case.meshes for key, one in case.nodes[name].own.fields.items()}
    dimension = (own | DIMENSIONS).get(field)
    if dimension is None:
        return DrawnUnit(field, "")
    asked = column(field, dimension, case)
    if asked.plain and dimension in SILENT:
        asked = column(field, dimension, case, asked.unit if dimension in case.output.units else SILENT[dimension])
    return DrawnUnit(field, asked.unit, asked.span_from_si(1.0), float(asked.from_si(0.0)))


def lengths_of(case) -> tuple[DrawnUnit, DrawnUnit]:
    """Units of the plan and of heights: of bodies those of positions, of water those of its level."""
    bodies = any(node.kind == "body" for node in case.nodes.values())
    plan, high = ("position", "position") if bodies else ("length", "level" if case.meshes else "head")
    found = [column(name, name, case) for name in (plan, high)]
    return tuple(DrawnUnit(one.name, one.unit, one.span_from_si(1.0)) for one in found)


def parts_of(case, plan: dict[str, np.ndarray]) -> list[DrawnPart]:
    """Nodes and links but pipes and basins, where they are drawn."""
    links = {name: link for name, link in case.links.items() if link.kind != "pipe"}
    piped = {port for link in case.links.values() if link.kind == "pipe" for port in link.ports.values()}
    found = []
    for name, node in case.nodes.items():
        if name in plan and name not in case.meshes:
            high = case.elevations.get(name, 0.0)
            held = name in piped or node.position is not None
            found.append(DrawnPart(f"nodes.{name}", name, _kinds(node), (*map(float, plan[name]), high),
                                   joint=node.kind == "junction", held=held))  # fmt: skip
    nodes = {part.name: part for part in found}
    for name, link in links.items():
        ends = [nodes[layout.place(port)].at for port in link.ports.values() if layout.place(port) in nodes]
        if not (ends or name in plan):
            continue
        at = np.array([*plan[name], np.mean([end[2] for end in ends]) if ends else 0.0]) if name in plan else None
        at = np.mean(ends, axis=0) if at is None else at
        between = tuple(_key(port, case) for port in link.ports.values() if layout.place(port) != name)
        found.append(DrawnPart(f"links.{name}", name, _kinds(link), tuple(map(float, at)), between, True,
                               own_place=name in plan))  # fmt: skip
    return found


def _key(port: str, case) -> str:
    """The part, or the patch, that a port joins."""
    if port in case.nodes:
        return f"nodes.{port}"
    owner = layout.place(port)
    return f"links.{owner}" if owner in case.links else port if owner in case.meshes else f"nodes.{owner}"


def _kinds(part) -> tuple[str, ...]:
    """Its kind and those of the classes that it is made of."""
    return tuple(dict.fromkeys(kind for one in type(part).__mro__ if (kind := one.__dict__.get("kind"))))


def _to_scale(scene: DrawnScene, lengths: dict[str, float]) -> bool:
    """Whether stated positions are as far apart as pipes are long."""
    points, lines, _, owner = scene.pipes[0]
    drawn = np.bincount(owner, np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1), len(lengths))
    share = float(np.median(drawn / np.array(list(lengths.values()))))
    return LIKELY[0] <= share <= LIKELY[1]


def _anchors(case, plan: dict[str, np.ndarray]) -> dict[str, tuple[float, float, float]]:
    """Middles of patches of basins."""
    found = {}
    for name, mesh in case.meshes.items():
        for patch in patch_names(mesh):
            middle = plan[name] + mesh.middle[mesh.patch(patch)].mean(axis=0)
            found[f"{name}.{patch}"] = (*map(float, middle), case.elevations.get(f"{name}.{patch}", 0.0))
    return found


def _about_basins(case) -> dict[str, np.ndarray]:
    """Plan positions of a case of basins without pipes: what joins a patch stands outside of it."""
    plan = {name: np.array(node.position, float) for name, node in case.nodes.items() if node.position is not None}
    plan |= {name: np.zeros(2) for name in case.meshes if name not in plan}
    if len(plan) == len(case.nodes):
        return plan
    size = max(float(np.ptp(mesh.points, axis=0).max()) for mesh in case.meshes.values()) if case.meshes else 1.0
    for _ in case.nodes:
        for link in case.links.values():
            ports = list(link.ports.values())
            for one, other in (ports, ports[::-1]) if len(ports) == 2 else ():
                if other in case.nodes and other not in plan and layout.place(one) in plan:
                    owner, _, patch = one.partition(".")
                    out, start = _outward(case, owner, patch) if patch else (np.array([1.0, 0.0]), np.zeros(2))
                    plan[other] = plan[owner] + start + 0.12 * size * out
    return plan


def _outward(case, basin: str, patch: str) -> tuple[np.ndarray, np.ndarray]:
    """Direction out of a basin at a patch, and the patch's middle."""
    mesh = case.meshes[basin]
    middle = mesh.middle[mesh.patch(patch)].mean(axis=0)
    inside = mesh.centre[mesh.left[mesh.patch(patch)]].mean(axis=0)
    return (middle - inside) / np.linalg.norm(middle - inside), middle
