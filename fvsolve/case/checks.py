"""Checks between the parts of a case: elevations, times and steps, scalars, and each part in the context of the others.

The keys of a part are checked when it is read, its connections in `connections`.
"""

from collections.abc import Collection, Iterator
from typing import Any

from fvsolve import units
from fvsolve.case import connections
from fvsolve.case.claims import Expect
from fvsolve.case.reading import Raw
from fvsolve.case.resource_checks import name_faults
from fvsolve.case.sections import CAVITY_SCHEMES, FluidSpec, Numerics
from fvsolve.core.steppers.loop_records import LEAST_STEP, LEAST_TOLERANCE
from fvsolve.core.steppers.tableau import AUTO, METHODS
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS
from fvsolve.parts.carried_scalar import ZEROS
from fvsolve.parts.nodes_and_links import is_in_network, is_kind
from fvsolve.parts.pipe.pipe_wall import OF_WALL
from fvsolve.parts.schedule import is_formula
from fvsolve.parts.table_model import CaseContext, RunTimes
from fvsolve.parts.tolerances import is_shorter_than_rise
from fvsolve.parts.value import ROOT
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]
PLACE_KEYS = ("on", "at", "attitude")  # keys of places on bodies
RESERVED = {"time", "t", "mass", "energy", "nodes", "pipe", "value", "min_pressure", "max_pressure"}


def part_faults(
    groups: dict[str, dict[str, Any]],
    ambient: float,
    gravity: float | None,
    fluid: Any,
    raw: Raw | None,
    times: RunTimes,
    meshes: dict[str, Any],
    lumped: dict[str, Any],
) -> Faults:
    """Faults (key path, message) of elevations, of bodies, and of each part in the context of the other parts.

    groups : section -> name -> part, with the sections "links", "nodes" and others whose parts have faults of their own
    ambient : ambient pressure [Pa]; gravity [m/s2]; fluid : properties of the fluid, or None if it is faulty
    raw : case before its values were read, for messages; it may be None if `fluid` is None; times : times of the run
    meshes, lumped : basin -> mesh, of basins with cells and of basins whose water is lumped masses
    """
    nodes, links = groups["nodes"], groups["links"]
    has_bodies = any(node.kind == "body" or getattr(node, "on", None) for node in nodes.values())
    poses = {}
    named, raw_links = (
        (nodes, {}) if raw is None else (raw.table.get(group, {}) for group in ("nodes", "links"))
    )
    high = dict(nodes)
    if has_bodies:
        from fvsolve.case import bodies  # only cases with bodies need it

        poses = bodies.poses(nodes, times.start)
        high = {name: node for name, node in nodes.items() if bodies.has_elevation(node, poses)}
    lends = any(
        _may_lend(link, named)
        for name, link in raw_links.items()
        if name not in links or "profile" in link
    )
    if has_bodies:
        high = {name: bodies.with_elevation(node, poses) for name, node in high.items()}
    yield from _elevations(high, links, lends)

    def vacuum(group: str, name: str, key: str, pressures: list[float]) -> Faults:
        if fluid is not None:
            for keys, text in _vacuum((group, name, key), pressures, fluid, raw):
                yield (ROOT, *keys), text

    if meshes or lumped or gravity == 0.0 or any(map(in_space, (*nodes.values(), *links.values()))):
        from fvsolve.case import basins, bodies, sloshing

        yield from bodies.find_faults(nodes, named)
        yield from bodies.faults_on_bodies(
            nodes, links, basins.places_on_bodies(nodes, meshes), named
        )
        yield from bodies.coincident_ends(nodes, links, poses)
        yield from bodies.open_pins(nodes, links, poses)
        yield from sloshing.find_faults(nodes, lumped, poses)
        yield from sloshing.weightless(nodes, gravity)
        yield from bodies.overturned(nodes, poses)

    def separation(*ends: str) -> float | None:
        from fvsolve.case import bodies

        return bodies.separation(nodes, poses, *ends)

    around = CaseContext(nodes, links, ambient, gravity, fluid, times, vacuum, separation)
    for group, members in groups.items():
        for name, part in members.items():
            for keys, text in part.faults(name, around):
                # a single key, as a part of another package may give it
                keys = (keys,) if isinstance(keys, str) else keys
                yield keys[1:] if keys[:1] == (ROOT,) else (group, name, *keys), text


def _may_lend(link: Any, named: dict[str, Any]) -> bool:
    """True if a link may give elevations to its ends: it has a profile, or its type or one of its ends is unknown.

    link : its keys as in the file; named : tables of all nodes
    """
    if isinstance(link, dict) and "profile" in link:
        return True
    return (
        connections.kind_name(link, "links") is None
        or not {*connections.ends_of(link)} <= named.keys()
    )


def in_space(part: Any) -> bool:
    """True if a part has points, a route or a position in space or on a body."""
    values = vars(part)
    return (
        "points" in values
        or bool(values.get("route"))
        or any(values.get(key) is not None for key in PLACE_KEYS)
    )


def step_faults(numerics: Numerics, has_cells: bool) -> Faults:
    """Faults (key path, message) of times and step control; has_cells : True if the case has pipes or basins."""
    if not numerics.end > numerics.start:
        yield (
            ("numerics", "end"),
            f"{numerics.end:g} s is not after the start at {numerics.start:g} s",
        )
    method = METHODS.get(numerics.method)
    if numerics.courant is not None and not has_cells:
        or_rtol = " or `rtol`" if method is None or method.adaptive else ""
        yield (
            ("numerics", "courant"),
            f"needs cells, and the case has no pipe or basin; give `step`{or_rtol} instead",
        )
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if numerics.step is not None and not numerics.step > least:
        text = f"{numerics.step:g} s is below the rounding error of the time; expected more than {least:.2g} s"
        yield ("numerics", "step"), text
    if numerics.rtol is not None and numerics.rtol < LEAST_TOLERANCE:
        yield (
            ("numerics", "rtol"),
            f"{numerics.rtol:g} is below rounding errors; expected {LEAST_TOLERANCE:g} or more",
        )
    if numerics.method == AUTO and not numerics.courant is numerics.step is None:
        text = 'method "auto" controls the error of its steps; give `rtol`, not `courant` or `step`'
        yield ("numerics", "method"), text
    by_error = numerics.rtol is not None or (
        not has_cells and numerics.courant is numerics.step is None
    )
    if by_error and method is not None and not method.adaptive:
        able = " or ".join(
            dict.fromkeys(show(other.name) for other in METHODS.values() if other.adaptive)
        )
        message = f"method {show(method.name)} estimates no error; use {able}, or {'`courant` or ' * has_cells}`step`"
        yield ("numerics", "method" if numerics.rtol is None else "rtol"), message


def follows_cavities(fluid: FluidSpec | None, has_cells: bool) -> bool:
    """True if cavities in pipes are computed: the case has cells and `cavitation`. fluid : None if it is faulty"""
    return has_cells and fluid is not None and bool(fluid.cavitation)


def cavity_faults(numerics: Numerics, has_cells: bool, fluid: FluidSpec | None) -> Faults:
    """Yield a fault if a case with `cavitation` states a scheme that cannot compute cavities."""
    if follows_cavities(fluid, has_cells) and numerics.scheme not in (None, *CAVITY_SCHEMES):
        able = " or ".join(map(show, CAVITY_SCHEMES))
        yield (
            ("numerics", "scheme"),
            f"{show(numerics.scheme)} cannot compute cavities in pipes; expected {able}",
        )


def claim_faults(expect: dict[str, Expect], numerics: Numerics) -> Faults:
    """Faults of expectations (`[expect]`) at a time outside the run."""
    for text, claim in expect.items() if numerics.end > numerics.start else ():
        if (
            claim is not None
            and claim.time is not None
            and not numerics.start <= claim.time <= numerics.end
        ):
            run = f"{numerics.start:g} s to {numerics.end:g} s"
            yield ("expect", text), f"{claim.time:g} s is not within the run, {run}"


def _elevations(nodes: dict[str, Any], links: dict[str, Any], lends: bool) -> Faults:
    wet = {("nodes", name): node for name, node in nodes.items() if node.domain == "hydraulic"}
    wet |= {("links", name): link for name, link in links.items() if connections.chambers_of(link)}
    stated = dict.fromkeys(name for (_, name), part in wet.items() if part.elevation is not None)
    for (group, name), part in wet.items():
        derived = getattr(part, "head", None) is not None or getattr(part, "on", None) is not None
        if stated and name not in stated and not derived and not lends:
            yield (
                (group, name),
                f"elevation is missing, but stated for {listing(stated)}; expected for all or for none",
            )
    heights_of = {name: node.elevation for name, node in nodes.items()}
    heights_of |= {
        f"{name}.{place}": link.elevation
        for name, link in links.items()
        for place in connections.chambers_of(link)
    }
    for name, link in links.items():
        length = getattr(link, "length", None)
        heights = [heights_of[place] for place in link.ports.values() if place in heights_of]
        if length is None or len(heights) < 2 or None in heights:
            continue
        if is_shorter_than_rise(length, heights[0], heights[1]):
            climb = abs(heights[1] - heights[0])
            text = f"{length:g} m is too short: the ends differ by {climb:g} m in elevation; expected at least that"
            yield ("links", name, "length"), text


def _vacuum(keys: tuple, values: list[float], fluid: Any, raw: Raw) -> Faults:
    lowest = min(values)
    if lowest > fluid.vapor_pressure:
        return
    given, keys = _raw_value(keys, values.index(lowest), raw)
    formula = given.get("formula") if isinstance(given, dict) else given
    if isinstance(formula, str) and (isinstance(given, dict) or is_formula(formula)):
        text = f"{show(formula)} falls to {lowest:.4g} Pa absolute; expected values above the vapour pressure"
        yield keys, f"{text} of {fluid.vapor_pressure:.4g} Pa"
        return
    if isinstance(given, (dict, list)) or given is None:
        given = lowest
    yield keys, units.vacuum(given, lowest, fluid.vapor_pressure)


def _raw_value(keys: tuple, index: int, raw: Raw) -> tuple[Any, tuple]:
    """Value of entry `index` of a schedule as in the file, and its key path : (value, key path).

    If the schedule is a signal, the entry is taken from `[signals]`; a value that is not a list is returned whole.
    """
    given = raw.get(keys)
    if isinstance(given, dict) and "signal" in given:
        keys = ("signals", given["signal"])
        given = raw.get(keys)
    if isinstance(given, dict) and "control" in given:
        keys = ("controls", given["control"], "limits", index)
        return raw.get(keys), keys
    if isinstance(given, dict) and isinstance(given.get("value"), list):
        return given["value"][index], (*keys, "value", index)
    return given, keys


def reserved_names() -> set[str]:
    """Names that scalars cannot have.

    These are columns of output files, quantities of parts that may carry scalars, and fields of basins other than
    velocities.
    """
    from fvsolve.parts.basin import VELOCITY_FIELDS, Physics

    kinds = [kind for group in KINDS.values() for kind in group.values() if not is_in_network(kind)]
    fields = {
        name
        for physics in Physics.kinds.values()
        for name in physics.fields
        if name not in VELOCITY_FIELDS
    }
    return (
        RESERVED
        | fields
        | {name for kind in kinds for name in (*kind.quantities, *getattr(kind, "along", {}))}
    )


def scalar_faults(
    scalars: dict[str, Any],
    nodes: dict[str, Any],
    links: dict[str, Any],
    cut: Collection[str],
    table: dict[str, Any],
) -> Faults:
    """Faults (key path, message) of names of scalars, their values in parts, and parts that do not support them.

    cut : names of pipes that are cut into pieces; table : nested dicts of the case as in the file
    """
    for name in scalars:
        yield from ((("scalars", name), text) for text in name_faults(name))
        if name in reserved_names():
            yield ("scalars", name), f"{show(name)} is a reserved name; expected another name"
    for group, parts in (("nodes", nodes), ("links", links)):
        for name, part in parts.items():
            for scalar, value in getattr(part, "scalars", {}).items():
                if (text := _scalar_value_fault(scalar, value, part, scalars)) is not None:
                    yield (group, name, "scalars", scalar), text
            for scalar, factor in getattr(part, "retardation", {}).items():
                if (text := _retardation_fault(scalar, factor, scalars)) is not None:
                    yield (group, name, "retardation", scalar), text
            if (
                scalars
                and is_kind(part, "basin")
                and getattr(part, "infiltration", None) is not None
            ):
                text = "takes water, but not the scalars in it; expected a case without scalars, or no infiltration"
                yield (group, name, "infiltration"), text
            if scalars and is_kind(part, "basin") and not part.physics_type.carries:
                text = f"scalars are not supported with physics {show(part.physics)}; expected a free surface"
                yield (group, name), text
            for patch, patch_options in getattr(part, "patches", {}).items():
                from fvsolve.case import basins

                for scalar in patch_options.scalars:
                    place = (group, name, "patches", patch, "scalars", scalar)
                    if scalar not in scalars:
                        yield place, _unknown_scalar(scalar, scalars)
                    elif part.physics_type.joined and not (
                        patch_options.passes or basins.is_source(patch_options)
                    ):
                        text = "is not valid here, because the joined links give the value; remove this key, or set "
                        yield place, text + 'boundary = "open"'
            if scalars and part.no_scalars:
                yield (group, name), f"is {article(part.kind)}; {part.no_scalars}"
    heated = {name: item for name, item in scalars.items() if item is not None and item.heat}
    given = [
        *table.get("links", {}),
        *(name for name in links if name not in table.get("links", {})),
    ]
    yield from _heat_faults(
        heated,
        links,
        [*given, *cut],
        [*table.get("nodes", {})],
        any(item is None for item in scalars.values()),
    )


def _value_range(
    scalar: str, item: Any, reactions: dict[str, Any]
) -> tuple[float, bool, str] | None:
    """Least value of a scalar, True if it is excluded, and the reason; None for any value."""
    if item.heat:
        unit = f" {item.unit}"
        return (
            -item.zero,
            True,
            f"is not above absolute zero; expected a temperature above {-item.zero:g}{unit}",
        )
    for name, reaction in reactions.items():
        if reaction is not None and reaction.rate is None and scalar in reaction.sides.names:
            return (
                0.0,
                False,
                f"is negative, and reaction {name} follows mass action; expected a value of at least 0",
            )
    return None


def scalar_range_faults(
    scalars: dict[str, Any], reactions: dict[str, Any], nodes: dict[str, Any], links: dict[str, Any]
) -> Faults:
    """Faults (key path, message) of temperatures that are not above 0 K, and of negative amounts in mass action.

    scalars, reactions : by name, None if faulty
    """
    sound = {name: item for name, item in scalars.items() if item is not None}
    bounds = {
        name: bound
        for name, item in sound.items()
        if (bound := _value_range(name, item, reactions))
    }
    places = [(("scalars", name, "initial"), name, sound[name].initial) for name in bounds]
    for group, parts in (("nodes", nodes), ("links", links)):
        for name, part in parts.items():
            own = {} if is_kind(part, "basin") else getattr(part, "scalars", {})
            places += [
                ((group, name, "scalars", scalar), scalar, value) for scalar, value in own.items()
            ]
            for patch, options in getattr(part, "patches", {}).items():
                where = (group, name, "patches", patch, "scalars")
                places += [
                    ((*where, scalar), scalar, value) for scalar, value in options.scalars.items()
                ]
    for keys, scalar, value in places:
        if scalar in bounds and getattr(value, "kind", "") != "control":
            (low, is_open, text), least = (
                bounds[scalar],
                float(min(getattr(value, "value", [value]))),
            )
            if least < low or (is_open and least == low):
                yield keys, f"{least:g} {text}"


def _heat_faults(
    heated: dict[str, Any],
    links: dict[str, Any],
    link_names: list[str],
    node_names: list[str],
    faulty: bool,
) -> Faults:
    """Faults of scalars with heat, and of heat exchangers without such a scalar.

    link_names, node_names : names of all parts, faulty ones too; faulty : True if a scalar is, which may have heat
    """
    known = [*link_names, *node_names]
    if not heated and not faulty:
        text = "exchanges heat with a temperature of the fluid; declare one, [scalars.NAME] with heat = true"
        yield from (
            (("links", name), text) for name, link in links.items() if link.kind == "heat-exchanger"
        )
    for k, (name, scalar) in enumerate(heated.items()):
        if k > 0:
            yield (
                ("scalars", name, "heat"),
                f"{next(iter(heated))} is the temperature already; expected one scalar with heat",
            )
        for i, part in enumerate(scalar.heat_from or () if scalar.heat_from != "all" else ()):
            if part not in known:
                hint = did_you_mean(part, known) or f"; links are {listing(link_names)}"
                yield ("scalars", name, "heat_from", i), f"no part named {show(part)}{hint}"


def _scalar_value_fault(scalar: str, value: Any, part: Any, scalars: dict[str, Any]) -> str | None:
    """Fault text for the value of a scalar that a part states; None if it is valid."""
    if scalar not in scalars:
        return _unknown_scalar(scalar, scalars)
    if is_kind(part, "basin"):
        return None
    if part.own_scalars == "start" and not value.constant:
        return "is the value at the start; expected a number, not a schedule"
    if not part.own_scalars:
        expected = "expected an inflow, a reservoir, a tank, a chamber, a pipe or a conduit"
        return f"{article(part.kind)} has no scalar values; {expected}"
    return None


def _retardation_fault(scalar: str, factor: Any, scalars: dict[str, Any]) -> str | None:
    """Fault text for the retardation factor of a scalar in a pipe; None if it is valid."""
    if scalar not in scalars:
        return _unknown_scalar(scalar, scalars)
    if factor != OF_WALL or scalars[scalar] is None or scalars[scalar].unit in ZEROS:
        return None
    unit = show(scalars[scalar].unit)
    return f'"{OF_WALL}" is the heat in a wall, and {scalar} has the unit {unit}; expected a number, or unit = "degC"'


def _unknown_scalar(scalar: str, scalars: dict[str, Any]) -> str:
    near = did_you_mean(scalar, scalars) or (f"; scalars are {listing(scalars)}" if scalars else "")
    return f"no scalar named {show(scalar)}{near}" + (
        "" if scalars else f"; declare it as [scalars.{scalar}]"
    )
