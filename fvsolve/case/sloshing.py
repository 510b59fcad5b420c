"""Linear sloshing modes of a tank: masses on springs, and the water below a flat surface.

Potential theory of a flat bed and upright walls, small motions, any depth h (Dodge, The New Dynamic Behavior of Liquids
in Moving Containers, 2000, chapter 3). A box has odd modes n along each side L with wave number k = n pi / L. An
upright cylinder of radius a has modes with k = s / a, J1'(s) = 0, along x and along y. The angular frequency w is given
by w^2 = g k tanh(k h). With the mass M of all water, a mode has mass m and this rise of the surface per travel of m:

    box       m = M 8 tanh(k h) / (k h (k L)^2)     rise -4 tanh(k h) / (k L) cos(k x), x from a wall
    cylinder  m = M 2 tanh(k h) / (k h (s^2 - 1))   rise 2 s tanh(k h) / (s^2 - 1) J1(k r) / J1(s) cos(angle)

r and angle are polar coordinates about the axis. The mass m lies h - (2 / k) tanh(k h / 2) above the bed. With its
surface held flat the water has the inertia of an ideal fluid under a lid (Joukowski, 1885), not that of a rigid body.
Higher modes are left out: their water moves with the tank.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.bodies import point_inertia, poses
from fvsolve.parts.formula import means, samples
from fvsolve.parts.schedule import constant

MODES = 3  # modes along x, and along y
ROUNDNESS = 1e-3  # allowed deviation of the corners of a circular outline, relative to the radius
# least cosine between the normal of the bed and the vertical: modes hold for nearly level tanks
UPRIGHT = 0.9
FLAT = 1e-9  # allowed rise of a flat bed, relative to the depth
TERMS = 2000  # number of terms of a series
Faults = Iterator[tuple[tuple, str]]


class Outline(NamedTuple):
    """Outline of a tank.

    sides : lengths of a box along x and y [m], or the diameter of a cylinder twice
    middle : float64[2]  centre in the axes of the basin [m]; is_round : True for a cylinder
    """

    sides: tuple[float, float]
    middle: np.ndarray
    is_round: bool


class SloshingMode(NamedTuple):
    """Sloshing mode, modelled by a mass on a spring.

    along : direction, 0 for x, 1 for y; number : number of the mode, from 1; k : wave number [1/m]
    mass : moving mass [kg]; height : its height above the bed [m]; square : square of the angular frequency [1/s2]
    rise : rise of the surface at the wall on the positive side (along x or y), per travel of the mass [-]
    """

    along: int
    number: int
    k: float
    mass: float
    height: float
    square: float
    rise: float


class Slowest(NamedTuple):
    """Slowest mode of a tank.

    kh : wave number times depth [-]
    excess : percentage by which shallow-water theory gives too high a frequency [%]
    """

    kh: float
    excess: float


def slowest(basin: Any, mesh: Any) -> Slowest | None:
    """Slowest mode of a tank; None if its modes are not known.

    They are known for boxes and upright cylinders with water over a flat bed.
    """
    bed, outline = means(samples(basin.bed, mesh)), outline_of(mesh)
    if (
        outline is None
        or np.ptp(bed) > FLAT * abs(basin.level - bed.min())
        or not basin.level > bed[0]
    ):
        return None
    deep = modes(outline, basin.level - bed[0], 1.0, 1.0, 1)[int(np.argmax(outline.sides))].k * (
        basin.level - bed[0]
    )
    return Slowest(deep, 100.0 * float(np.sqrt(deep / np.tanh(deep)) - 1.0))


def outline_of(mesh: Any) -> Outline | None:
    """Rectangle or circle that a mesh fills; None for other outlines."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    area, sides = float(mesh.area.sum()), high - low
    if abs(area / float(np.prod(sides)) - 1.0) < 1e-9:
        return Outline(tuple(sides.tolist()), 0.5 * (low + high), False)
    middle = mesh.centroid
    far = np.linalg.norm(mesh.points[np.unique(mesh.ends[mesh.inner :])] - middle, axis=1)
    if np.ptp(far) < ROUNDNESS * far.mean():
        return Outline((2.0 * float(np.sqrt(area / np.pi)),) * 2, middle, True)
    return None


def bed_of(basin: Any, mesh: Any) -> float:
    """Height of a flat bed above the origin of the basin [m]."""
    return float(means(samples(basin.bed, mesh))[0])


def depth_of(basin: Any, mesh: Any) -> float:
    """Depth of water at rest over a flat bed [m]."""
    return basin.level - bed_of(basin, mesh)


def modes(
    outline: Outline, depth: float, density: float, gravity: float, count: int = MODES
) -> list[SloshingMode]:
    """First `count` modes in each direction of water in a tank, alternately along x and y.

    depth [m]; density [kg/m3]; gravity [m/s2]
    """
    from scipy.special import jnp_zeros

    result = []
    for number, root in enumerate(jnp_zeros(1, count), 1):
        for along, side in enumerate(outline.sides):
            k = 2.0 * root / side if outline.is_round else (2 * number - 1) * np.pi / side
            steep = float(np.tanh(k * depth))
            if outline.is_round:
                share = 2.0 * steep / (k * depth * (root**2 - 1.0))
                rise = 2.0 * root * steep / (root**2 - 1.0)
            else:
                share, rise = 8.0 * steep / (k * depth * (k * side) ** 2), 4.0 * steep / (k * side)
            height = depth - 2.0 / k * float(np.tanh(0.5 * k * depth))
            mass = density * area_of(outline) * depth * share
            result.append(
                SloshingMode(
                    along, number, float(k), mass, height, gravity * float(k) * steep, float(rise)
                )
            )
    return result


def area_of(outline: Outline) -> float:
    """Area of the bed of a tank [m2]."""
    a, b = outline.sides
    return 0.25 * np.pi * a * a if outline.is_round else a * b


def surface_rise(outline: Outline, mode: SloshingMode, x: float, y: float) -> float:
    """Rise of the surface at the point (x, y) [m] per travel of the mass of a mode [-]."""
    from scipy.special import j1, jnp_zeros

    dx, dy = np.array([x, y]) - outline.middle
    if not outline.is_round:
        far = (dx, dy)[mode.along] + 0.5 * outline.sides[mode.along]
        return float(-mode.rise * np.cos(mode.k * far))
    r = float(np.hypot(dx, dy))
    part = (dx, dy)[mode.along] / r if r > 0.0 else 0.0
    return float(mode.rise * j1(mode.k * r) / j1(jnp_zeros(1, mode.number)[-1]) * part)


def lid_inertia(outline: Outline, depth: float, density: float) -> np.ndarray:
    """Inertia matrix about the centre of an ideal fluid that fills a closed box or cylinder : float64[3, 3] [kg m2]."""
    a, b = outline.sides
    if outline.is_round:
        across = density * cylinder_inertia(0.5 * a, depth)
        return np.diag([across, across, 0.0])
    return density * np.diag(
        [
            a * rectangle_inertia(b, depth),
            b * rectangle_inertia(a, depth),
            depth * rectangle_inertia(a, b),
        ]
    )


def rectangle_inertia(a: float, b: float) -> float:
    """Inertia of an ideal fluid in a rotating box, per density and per length along the axis of rotation [m4].

    It is the polar moment of the rectangle with sides a, b [m] minus its torsion constant.
    """
    long, short = max(a, b), min(a, b)
    odd = np.arange(1, 2 * TERMS, 2)
    series = float(np.sum(np.tanh(0.5 * np.pi * odd * long / short) / odd**5))
    torsion = long * short**3 * (1.0 / 3.0 - 64.0 / np.pi**5 * short / long * series)
    return a * b * (a * a + b * b) / 12.0 - torsion


def cylinder_inertia(a: float, h: float) -> float:
    """Inertia per density [m5] of an ideal fluid in a closed cylinder about a horizontal axis through its centre.

    a : radius [m]; h : height [m]. The velocity potential (-r z + sum of b_j I1(c_j r) sin(c_j z)) cos(angle), with
    c_j = (2 j - 1) pi / h and z from the centre, has the normal velocity of the walls at all walls.
    """
    from scipy.special import ive

    j = np.arange(1, TERMS + 1)
    c, sign = (2 * j - 1) * np.pi / h, np.where(j % 2, 1.0, -1.0)
    part = 4.0 * sign / (h * c * c)  # coefficients of z in sin(c z)
    slope = 0.5 * (ive(0, c * a) + ive(2, c * a))  # I1', scaled like ive
    wall = (
        np.pi
        * a
        * (-a * h**3 / 12.0 + np.sum(2.0 * part**2 * ive(1, c * a) / (c * slope)) * h / 2.0)
    )
    lids = (
        2.0
        * np.pi
        * (h * a**4 / 8.0 - np.sum(2.0 * part * sign * a * a * ive(2, c * a) / (c * c * slope)))
    )
    return float(wall + lids)


def find_faults(nodes: dict[str, Any], lumped: dict[str, Any], stand: dict[str, Any]) -> Faults:
    """Faults (key path, message) of basins whose water is modelled by sloshing modes.

    lumped : basin -> mesh, of basins without cells; stand : name of a body -> `Pose`
    """
    for name, mesh in lumped.items():
        basin, key = nodes[name], ("nodes", name)
        if basin.sloshing != "modes" or not basin.physics_type.has_modes:
            continue
        if outline_of(mesh) is None:
            text = (
                "modes are known only for boxes and upright cylinders (a circular "
                'mesh); expected "cells" or "frozen"'
            )
            yield (*key, "sloshing"), text
        elif np.ptp(bed := means(samples(basin.bed, mesh))) > FLAT * abs(basin.level - bed.min()):
            yield (
                (*key, "bed"),
                'modes are known only over a flat bed; expected a single height, or sloshing = "cells"',
            )
        elif not basin.level > bed[0]:
            yield (
                (*key, "level"),
                f"{basin.level:g} m is not above the bed, at {bed[0]:g} m; expected a higher level",
            )
        yield from unsupported_keys(key, basin)
        if (pose := stand.get(basin.on)) is not None:
            upright = float((pose.attitude @ basin.rotation)[2, 2])
            if upright < UPRIGHT:
                text = f"the bed is {np.degrees(np.arccos(upright)):.3g} deg off level at the start, where modes are "
                yield (*key, "sloshing"), text + 'not valid; expected "cells" or "frozen"'


def weightless(nodes: dict[str, Any], gravity: float | None) -> Faults:
    """Yield a fault if gravity is zero in a case with a free water surface. Frozen water on a body is allowed."""
    for name, basin in nodes.items():
        if gravity == 0.0 and getattr(getattr(basin, "physics_type", None), "has_modes", False):
            if not (basin.on and basin.sloshing == "frozen"):
                text = f'the water in {name} needs gravity; expected more than 0, or sloshing = "frozen" on a body'
                yield ("gravity",), text
                return


def unsupported_keys(key: tuple, basin: Any) -> Faults:
    """Faults of keys of a basin that are not valid with sloshing modes; key : key path of the basin."""
    for key_name in sorted(basin.start.model_fields_set) if basin.start is not None else ():
        yield (
            (*key, "start", key_name),
            "sloshing modes start from level water at rest; leave this key out",
        )
    for patch, patch_options in basin.patches.items():
        if patch_options.passes:
            text = "sloshing modes are valid only with walls on all sides; expected a wall"
            yield (*key, "patches", patch, "boundary"), text
    for key_name in ("manning", "factor"):
        if getattr(basin, key_name) is not None:
            yield (*key, key_name), "sloshing modes have no friction; leave this key out"


def held_water(basin: Any, mesh: Any, density: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre [m] and inertia about the centre [kg m2] of water with its surface held flat.

    centre : float64[3] and inertia : float64[3, 3] are in the axes of the basin.
    """
    outline, depth = outline_of(mesh), depth_of(basin, mesh)
    centre = np.array([*outline.middle, bed_of(basin, mesh) + 0.5 * depth])
    return density * area_of(outline) * depth, centre, lid_inertia(outline, depth, density)


def mode_bodies(
    name: str, basin: Any, mesh: Any, pose: Any, density: float, gravity: float
) -> dict[str, Any]:
    """Bodies, by name, that model the sloshing modes of a basin: one on a spring per mode, and one of negative mass.

    The fixed body of negative mass subtracts the moving masses from the water, which is added to the body with its full
    mass. In a cylinder the modes of one number along x and y share a mass, which slides along y on a massless body
    that slides along x. pose : pose at the start of the body that carries the basin
    """
    from fvsolve.parts.body import Joint

    outline = outline_of(mesh)
    turn = basin.rotation
    all_modes = modes_of(basin, mesh, density, gravity)
    result = {}
    bed = np.array(basin.place) + turn @ (*outline.middle, bed_of(basin, mesh))
    places = [bed + turn[:, 2] * item.height for item in all_modes]
    masses = np.array([item.mass for item in all_modes]) * (0.5 if outline.is_round else 1.0)
    held = masses @ np.array(places) / masses.sum()
    spread = sum(point_inertia(m, r - held) for m, r in zip(masses, places, strict=True))
    result[f"{name} held"] = hidden_body(
        -float(masses.sum()), -spread, Joint.model_construct(kind="fixed", on=basin.on), held
    )
    down = (pose.attitude @ turn).T @ np.array([0.0, 0.0, -gravity])
    for mode, place in zip(all_modes, places, strict=True):
        on, first = basin.on, f"{name} x{mode.number}"
        if outline.is_round and mode.along == 1:
            on, place = first, np.zeros(3)
        carried = 0.0 if outline.is_round and mode.along == 0 else mode.mass
        joint = Joint.model_construct(
            kind="prismatic",
            on=on,
            at=tuple(place.tolist()),
            axis=tuple(turn[:, mode.along].tolist()),
            travel=constant(float(down[mode.along] / mode.square)),
            stiffness=mode.mass * mode.square,
        )
        result[mode_body_name(name, mode)] = hidden_body(
            carried, np.zeros((3, 3)), joint, np.zeros(3)
        )
    return result


def surface_factors(
    basin: Any, mesh: Any, x: float, y: float, density: float, gravity: float
) -> tuple[list[SloshingMode], list[float]]:
    """Modes of a basin, and the rise of the surface at the point (x, y) [m] per travel of the mass of each mode [-].

    Higher modes, which are not modelled, would follow the acceleration without delay. Their rise is added to the rise
    of the last modelled mode along each axis, so that a surface in equilibrium is plane.
    """
    outline, all_modes = outline_of(mesh), modes_of(basin, mesh, density, gravity)
    rises = [surface_rise(outline, mode, x, y) for mode in all_modes]
    rest = (np.array([x, y]) - outline.middle).tolist()
    for mode, rise in zip(all_modes, rises, strict=True):
        rest[mode.along] -= gravity * rise / mode.square
    last = len(all_modes) - 2
    return all_modes, [
        *rises[:last],
        *(
            rises[k] + rest[all_modes[k].along] * all_modes[k].square / gravity
            for k in (last, last + 1)
        ),
    ]


def mode_body_name(name: str, mode: SloshingMode) -> str:
    """Name of the body that models a mode, such as "pool x1"."""
    return f"{name} {'xy'[mode.along]}{mode.number}"


def modes_of(basin: Any, mesh: Any, density: float, gravity: float) -> list[SloshingMode]:
    """Sloshing modes of a basin; density [kg/m3], gravity [m/s2]."""
    return modes(outline_of(mesh), depth_of(basin, mesh), density, gravity)


def hidden_body(mass: float, inertia: np.ndarray, joint: Any, centre: np.ndarray) -> Any:
    """Body that is not in the file.

    mass : may be negative [kg]; inertia : float64[3, 3]  about the centre of mass [kg m2]
    centre : centre of mass in the axes of the body [m]
    """
    from fvsolve.parts.body import Body

    return Body.model_construct(
        mass=mass,
        inertia=tuple(map(tuple, inertia.tolist())),
        joint=joint,
        points={},
        centre_of_mass=tuple(np.asarray(centre).tolist()),
    )


def nodes_with_water(
    nodes: dict[str, Any], lumped: dict[str, Any], density: float, gravity: float, t: float
) -> dict[str, Any]:
    """Copy of `nodes` with the water of basins without cells as masses.

    The water is added to the mass, centre of mass and inertia of its body; sloshing modes are additional bodies.
    lumped : basin -> mesh, of the basins without cells; density of the water [kg/m3]; gravity [m/s2]
    t : start time [s]
    """
    result = dict(nodes)
    for name, mesh in lumped.items():
        basin, body = nodes[name], result[nodes[name].on]
        mass_of = frozen_water if basin.sloshing == "frozen" else held_water
        mass, centre, inertia = mass_of(basin, mesh, density)
        turn = basin.rotation
        centre = np.array(basin.place) + turn @ centre
        both, own = body.mass + mass, np.array(body.centre_of_mass)
        middle = (body.mass * own + mass * centre) / both
        total = body.inertia_matrix() + point_inertia(body.mass, own - middle)
        total = total + turn @ inertia @ turn.T + point_inertia(mass, centre - middle)
        change = {
            "mass": both,
            "centre_of_mass": tuple(middle.tolist()),
            "inertia": tuple(map(tuple, total.tolist())),
        }
        result[nodes[name].on] = body.model_copy(update=change)
    swinging = {name: mesh for name, mesh in lumped.items() if nodes[name].sloshing == "modes"}
    stand = poses(result, t) if swinging else {}
    for name, mesh in swinging.items():
        result |= mode_bodies(name, nodes[name], mesh, stand[nodes[name].on], density, gravity)
    return result


def frozen_water(basin: Any, mesh: Any, density: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre [m] and inertia about the centre [kg m2] of water at rest, in the axes of the basin.

    The water is the sum of prisms over the cells. centre : float64[3]; inertia : float64[3, 3]
    """
    bed = means(samples(basin.bed, mesh))
    depth = np.maximum(basin.level - bed, 0.0)
    mass = density * mesh.area * depth
    places = np.column_stack([mesh.centre, bed + 0.5 * depth])
    total, wide = float(mass.sum()), mesh.area / 12.0
    centre = mass @ places / total
    if mesh.grid is not None and len(mesh.cells) == mesh.grid.nx * mesh.grid.ny:
        along, across = np.diff(mesh.grid.x) ** 2 / 12.0, np.diff(mesh.grid.y) ** 2 / 12.0
        along, across = np.tile(along, mesh.grid.ny), np.repeat(across, mesh.grid.nx)
    else:
        along = across = wide
    high = depth**2 / 12.0
    inertia = np.diag([mass @ (across + high), mass @ (along + high), mass @ (along + across)])
    for m, place in zip(mass, places - centre, strict=True):
        inertia += point_inertia(float(m), place)
    return total, centre, inertia
