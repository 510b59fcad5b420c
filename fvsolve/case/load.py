"""Reading of a case from a TOML file or a dict."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from fvsolve import exact, units
from fvsolve.case import (
    basins,
    bodies,
    chainage,
    check,
    defaults,
    inherited_elevations,
    resource_checks,
    scalar_checks,
    shipped,
    text,
)
from fvsolve.case.case import Case, default_cells, wave_speed
from fvsolve.case.design_limits import DesignLimit, limit_faults, read_limit
from fvsolve.case.expectations import Compare, Expect, read_compare, read_expect
from fvsolve.case.extent import ALL
from fvsolve.case.pipe_routes import Route, expand_pieces, first_gap, legs
from fvsolve.case.pipe_routes import find_faults as route_misfits
from fvsolve.case.probe import Probe, default_probes, read_probe
from fvsolve.case.raw import Raw, copy_paths, override, read_raw, split_key
from fvsolve.case.sections import DEFAULT_ROWS, ExactSpec, FluidSpec, Numerics, Output
from fvsolve.case.update_values import update_values
from fvsolve.data import read_table
from fvsolve.errors import CaseError, Fault, FluidError, did_you_mean, listing
from fvsolve.fluid import properties
from fvsolve.parts import KINDS, Basin, Chamber, Friction, Pipe, Scalar
from fvsolve.parts.body.part import Body, BodyPoint
from fvsolve.parts.node import Node
from fvsolve.parts.pipe.part import MOST_CELLS
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table_model import faults_of_error, read_keys
from fvsolve.parts.value import (
    ROOT,
    VALUE,
    Quantity,
    ReadContext,
    Text,
    ValueFault,
    Whole,
    between,
    nonnegative,
)
from fvsolve.units import Kinematic, show
from fvsolve.validation import TABLE, validated

SCHEMA = 1
GROUPS = {
    "fluid": "the fluid",
    "nodes": "places",
    "links": "parts between the places",
    "numerics": "settings of the solver",
}
LINKLESS = ("basin", "body")  # nodes that need no link
NAME_TABLES = (
    "nodes",
    "links",
    "signals",
    "scalars",
    "routes",
    "defaults",
)  # tables with names that other tables refer to
STUDY_KEYS = {"events", "protections"}
KEYS = (
    "schema", "title", "description", "source", "ambient_pressure", "gravity", "fluid", "nodes", "links",
    "signals", "scalars", "defaults", "numerics", "output", "expect", "compare", "routes", "limits", "exact",
)  # fmt: skip
TOP = {
    "schema": (Whole(between(SCHEMA, SCHEMA)), SCHEMA),
    "title": (Text(changes=VALUE), ""),
    "description": (Text(changes=VALUE), ""),
    "source": (Text(changes=VALUE), ""),
    "gravity": (Quantity("acceleration", nonnegative), 9.80665),
}


@validated(set=TABLE)
def load(source: str | Path | Mapping[str, Any] | Case | Raw, set: Mapping[str, Any] | None = None) -> Case:
    """Read a case from a TOML file, the name of a shipped case, a dict shaped like a file, or another case.

    set : values that override keys, such as {"links.main.cells": 400}. Numbers of the result are in SI, pressures
    absolute [Pa]. Raises CaseError with every fault: line, key path, value found, expected value, nearest valid name.
    """
    if isinstance(source, Raw):
        return _Reader(replace(source, table=read_raw(source.table).table, overridden=[]), set or {}).case()
    if not isinstance(source, Case):
        return _Reader(read_raw(find_source(source)), set or {}).case()
    if not set:
        return source
    table = copy_paths(source.raw, [split_key(str(key)) for key in set])
    return _Reader(Raw(table, source.name, source.path, source.folder), set, source).case()


def find_source(source: Any) -> Any:
    """Path of a shipped case if `source` is its name and not the path of a file; otherwise `source`."""
    if isinstance(source, str) and not Path(source).is_file() and source in shipped.names():
        return shipped.find(source)
    return source


def shortest_cell_time(links: Mapping[str, Any], meshes: Mapping[str, Any], fluid: Any) -> float:
    """Shortest travel time of a wave through a cell of a pipe or basin [s]; inf without cells.

    In basins a wave speed of 1 m/s is assumed. meshes : meshes of basins; fluid : properties of the fluid
    """
    times = [link.length / link.cells / wave_speed(link, fluid) for link in links.values() if isinstance(link, Pipe)]
    return min([*times, *(float(mesh.area.min()) ** 0.5 for mesh in meshes.values())], default=math.inf)


def _alternatives() -> list[tuple[str, ...]]:
    """Groups of alternative keys of numerics, friction and all parts; a table may have at most one key of a group."""
    return _alternatives_of((Numerics, Friction, *KINDS["nodes"].values(), *KINDS["links"].values()))


@functools.lru_cache(maxsize=4)
def _alternatives_of(models: tuple) -> list[tuple[str, ...]]:
    return list(dict.fromkeys(keys for model in models for keys in model.alternatives))


class _Reader:
    """Reader of one case. It reads the tables in the order in which they depend on each other, and collects faults."""

    def __init__(self, raw: Raw, settings: Mapping[str, Any], before: Case | None = None):
        self.raw, self.before = raw, before
        settings = chainage.settings(raw.table, settings)
        self.refused: list[Fault] = override(raw, settings, _alternatives())  # settings that cannot be applied
        self.faults = self.refused[:]
        self.setting = ReadContext(folder=raw.folder)
        self.read: dict[tuple, tuple[Any, Any]] = {}  # key path -> (raw value, value as read)
        self.origin: dict[tuple, tuple] = {}  # key path of a piece of a cut pipe -> key path in the file
        self.pieces: dict[str, list[str]] = {}  # cut pipe -> names of its pieces
        self.original = raw.table  # before pipes are cut
        self.unreadable: set[tuple[str, str]] = set()  # (group, name) that depend on faulty parts
        self.uncut: dict[str, Pipe] = {}  # pipes not cut, since parts placed on them are faulty
        self.joined = True  # True while the connections are known
        self.lumped: dict[str, Any] = {}  # meshes of basins whose water is lumped masses on a body

    def case(self) -> Case:
        if (case := update_values(self)) is not None:
            return case
        self.faults, self.setting, self.read = self.refused[:], ReadContext(folder=self.raw.folder), {}
        top = self.top()
        if self.before is not None and self.before.ambient_pressure != self.setting.ambient:
            self.before = None  # all gauge pressures change
        if self.before is not None and self.before.raw.get("defaults") is not self.original.get("defaults"):
            self.before = None  # every pipe may change
        fluid, properties = self.reuse(("fluid",), self.raw.table.get("fluid"), self.fluid)
        numerics = self.table("numerics", Numerics)
        self.setting.signals = self.group("signals")
        self.add(defaults.find_faults(self.raw.table, self.setting))
        tables = [self.raw.table.get(name, {}) for name in NAME_TABLES]
        tables += tables[-1].values() if isinstance(tables[-1], dict) else []  # of defaults
        if not all(isinstance(table, dict) for table in tables):
            for name in NAME_TABLES[:-1]:
                self.group(name)
            self.stop()  # the names are not known
        whole = self.raw.table
        self.cut(properties, numerics)
        carried = self.scalars()
        parts = {group: self.parts(group) for group in ("nodes", "links")}
        parts["nodes"] = inherited_elevations.inherit_elevations(**parts)
        meshes = self.meshes(parts["nodes"])
        self.unused_signals()
        kinds = {group: self.kinds(group) for group in parts} | {"scalars": carried}
        has_cells = Pipe in kinds["links"].values() or Basin in kinds["nodes"].values()
        has_cells = has_cells or None in (*kinds["links"].values(), *kinds["nodes"].values())  # faulty ones
        kinds["uncut"] = dict.fromkeys(self.uncounted() if self.faults else ())
        kinds["nodes"] |= {f"{name}.{place}": Chamber for name, kind in kinds["links"].items() if kind
                           for place, domain in kind.owns.items() if domain == "hydraulic"}  # fmt: skip
        for name, node in parts["nodes"].items():
            if isinstance(node, Body):
                kinds["nodes"][name] = bodies.BodyQuantities(node)
        for name, node in self.group("nodes").items():  # faulty nodes included
            kinds["nodes"] |= dict.fromkeys(check.points_of(name, node), BodyPoint)
        for name, kind in [*kinds["nodes"].items()]:
            if name in self.lumped and not parts["nodes"][name].physics_type.has_modes:
                kinds["nodes"][name] = None  # faulty
            elif name in self.lumped:
                kinds["nodes"][name] = basins.BasinFields(basins.lumped_fields(parts["nodes"][name]), self.lumped[name])
            elif kind is Basin and name not in meshes:
                kinds["nodes"][name] = None  # faulty
            if name in meshes:
                pool = parts["nodes"][name]
                own = dict.fromkeys(carried, "number") if pool.physics_type.carries else {}
                kinds["nodes"][name] = basins.BasinFields(pool.physics_type.fields | own, meshes[name])
                kinds["nodes"] |= {f"{name}.{patch}": basins.place_kind(pool, patch)
                                   for patch in basins.patch_names(meshes[name])}  # fmt: skip
        routes = self.routes(parts["links"])
        kinds["routes"] = {
            name: route and (legs(route, parts["links"]), parts["links"]) for name, route in routes.items()
        }
        kinds["pipes"] = {name: link for name, link in parts["links"].items() if isinstance(link, Pipe)}
        output = self.output(numerics, kinds)
        expect, compare = self.expect(kinds, routes), self.compare(kinds)
        limits = self.limits(kinds, routes, parts["links"], properties, top["gravity"])
        if self.joined:
            self.add(check.network(self.network_table(meshes)))
        about = self.setting.ambient, top.get("gravity"), properties, self.raw
        start = numerics.start if numerics is not None else 0.0
        self.add(check.parts(parts["nodes"], parts["links"] | self.uncut, *about, start, meshes, self.lumped))
        timed = numerics or self.valid_times()
        if timed is not None:
            self.add(check.cavities(timed, has_cells, fluid))
            self.add(basins.find_faults(*parts.values(), meshes, properties, (timed.start, timed.end),
                                     self.group("nodes")))  # fmt: skip
            self.add(check.claims(expect, timed))
        if numerics is not None:
            self.add(check.numerics(numerics, has_cells))
            carries = bool(carried) and any(parts["nodes"][name].physics_type.carries for name in meshes)
            rubs = any(parts["nodes"][name].physics_type.has_friction(parts["nodes"][name]) for name in meshes)
            numerics = numerics.filled(has_cells, carries, rubs, check.follows_cavities(fluid, has_cells))
        self.add(scalar_checks.find_faults(carried, *parts.values(), properties))
        links = self.cells(parts["links"], properties, numerics)
        if None not in (numerics, output, properties) and not self.faults:
            self.add(self.sizes(numerics, output, links, meshes, properties))
        named = self.table("exact", ExactSpec) if "exact" in self.raw.table else None
        self.stop()
        case = Case(
            name=self.raw.name,
            path=self.raw.path,
            ambient_pressure=self.setting.ambient,
            fluid=fluid,
            properties=properties,
            nodes=parts["nodes"],
            links=links,
            signals=dict(self.setting.used),
            scalars=carried,
            numerics=numerics,
            output=output,
            expect=expect,
            compare=compare,
            routes=routes,
            limits=limits,
            exact=named,
            copies=dict(self.setting.files),
            raw=whole,
            folder=self.raw.folder,
            meshes=meshes,
            lumped=self.lumped,
            read=self.read,
            **top,
        )
        return case if named is None else self.exact(case)

    def sizes(self, numerics, output, links, meshes, properties) -> Iterator[tuple[tuple, str]]:
        """Faults (key path, message) of cells or rows that need too much memory, and of too short steps.

        Steps and output intervals must exceed the rounding of the time.

        numerics, output : tables as read; meshes : meshes of basins; properties : properties of the fluid
        """
        yield from resource_checks.find_faults(numerics, output, links, meshes)
        yield from resource_checks.rounding_faults(numerics, shortest_cell_time(links, meshes, properties))

    def exact(self, case: Case) -> Case:
        """Return the case if its `[exact]` is valid. If overrides make it invalid, return the case without it.

        Raises CaseError if it is invalid without overrides, or if an override sets a key of `[exact]`.
        """
        faults = list(exact.find_faults(case))
        settings = {keys[0] for keys in self.raw.overridden}
        if faults and settings and "exact" not in settings:
            return replace(case, exact=None)
        self.add(faults)
        self.stop()
        return case

    def cut(self, properties: Any, numerics: Numerics | None) -> None:
        """Replace the table of the case by one with its pipes cut at their bends and at the parts placed on them.

        Faults of these parts are added to the list of faults.
        properties : properties of the fluid, or None if it is faulty; numerics : table as read, or None if it is faulty
        """
        table = chainage.add_bends(self.raw.table)
        tables = (table.get("nodes"), table.get("links"), table.get("routes", {}))
        if not all(isinstance(item, dict) for item in tables) or not chainage.placed(table):
            return
        for group, name, part in chainage.placed(table):
            self.kind(group, name, part)
        self.origin = {("nodes", f"{name}-bend-{k + 1}"): ("links", name, "bends", k)
                       for name, item in table["links"].items() if chainage.is_pipe(item)
                       for k in range(len(item["bends"]) if isinstance(item.get("bends"), list) else 0)}  # fmt: skip
        odd = list(chainage.faults(table))
        self.add(odd)
        astray = {keys[:2] for keys, _ in odd}
        pipes, table = {}, defaults.fill_pipes(table)
        for name, given in table["links"].items():
            if chainage.is_pipe(given) and ("links", name) not in astray:
                try:
                    pipes[name] = self.part(Pipe, {key: item for key, item in given.items() if key != "pieces"})
                except ValueError as error:
                    self.add_error(("links", name), error)
        if None in (properties, numerics):
            counts = {name: pipe.cells or 1 for name, pipe in pipes.items()}
        else:
            counts = default_cells(pipes, properties, numerics.cell_time)
        result = chainage.cut(table, pipes, counts, astray, self.fault)
        self.raw, self.pieces = replace(self.raw, table=result.table), result.pieces
        self.unreadable, self.uncut, self.joined = result.unreadable, result.uncut, result.connections_known
        self.origin |= result.origin

    def reuse(self, place: tuple, given: Any, make: Callable[[], Any]) -> Any:
        """Value as read for the case `before` if its raw content is the same object, otherwise the result of `make()`.

        place : key path; given : raw content, as in the file. A value without faults that uses no file and no signal is
        kept in `read` for the next reading.
        """
        before = None if self.before is None else self.before.read.get(place)
        if before is not None and before[0] is given:
            self.read[place] = before
            return before[1]
        state = self.setting.lookups, len(self.faults)
        value = make()
        if state == (self.setting.lookups, len(self.faults)):
            self.read[place] = given, value
        return value

    def stop(self) -> None:
        """Raise CaseError if faults were collected."""
        if self.faults:
            raise CaseError(dict.fromkeys(self.faults), self.raw.file)

    def fault(self, keys: tuple, message: str) -> None:
        if ROOT in keys:
            keys = keys[len(keys) - keys[::-1].index(ROOT) :]
        own = (*self.origin.get(keys[:2], keys[:2]), *keys[2:])
        keys = defaults.default_place(self.original, own)
        place = text.path(keys)
        if keys != own and any(fault.place == place for fault in self.faults):
            return  # a faulty default, already reported for another part
        if self.raw.is_override(keys):
            self.faults.append(Fault(place, message, override=True))
        else:
            self.faults.append(Fault(place, message, self.raw.line(keys)))

    def add(self, faults: Iterable[tuple[tuple, str]]) -> None:
        for keys, message in faults:
            self.fault(keys, message)

    def add_error(self, keys: tuple, error: ValueError) -> None:
        if isinstance(error, ValueFault):
            self.add(((*keys, *below), message) for below, message in error.faults)
        elif hasattr(error, "errors"):
            self.add(((*keys, *below), message) for below, message in faults_of_error(error, []))
        else:
            self.fault(keys, str(error))

    def group(self, name: str) -> dict[str, Any]:
        table = self.raw.table.get(name, {})
        if not isinstance(table, dict):
            self.fault((name,), f"{show(table)} is not a table")
            return {}
        return table

    def table(self, name: str, model: Any) -> Any:
        if name not in self.raw.table:
            if name in GROUPS:
                self.fault((), f"[{name}] is missing: {GROUPS[name]}")
                return None
        given = self.raw.table
        try:
            return self.reuse((name, "table"), given.get(name), lambda: model.model_validate(
                given.get(name, {}), context=self.setting))  # fmt: skip
        except ValueError as error:
            self.add_error((name,), error)
            return None

    def valid_keys(self, name: str, model: Any) -> Any:
        """Instance of `model` with the valid keys of the table `name`, without checks of the table.

        Other keys have their defaults; a required key without a valid value is missing.
        """
        values = {}
        for key, value in model.values().items():
            with suppress(KeyError, TypeError, ValueError):
                values[key] = value.read(self.raw.table[name][key], self.setting)
        return model.model_construct(**values)

    def valid_times(self) -> Numerics | None:
        """Numerics with the valid keys of a faulty `[numerics]`; None without valid `end` or with invalid `start`."""
        given = self.raw.table.get("numerics")
        valid = self.valid_keys("numerics", Numerics) if isinstance(given, dict) else None
        times = {key for key in ("start", "end") if valid is not None and key in given}
        return valid if "end" in times and times <= valid.model_fields_set else None

    def top(self) -> dict[str, Any]:
        if STUDY_KEYS & self.raw.table.keys() and not {"nodes", "links"} & self.raw.table.keys():
            self.fault((), f"is a study of a case; fvsolve study {self.raw.file} runs it")
            self.stop()
        for key in self.raw.table:
            if key not in KEYS:
                self.fault((key,), f"unknown key{did_you_mean(key, KEYS) or '; keys are ' + ', '.join(KEYS)}")
        given = self.raw.table.get("ambient_pressure", 101325.0)
        try:
            ambient, gauge = units.parse(given, "pressure")
            if gauge:
                raise ValueError(f'{show(given)} is a gauge pressure; expected an absolute pressure, such as "1 atm"')
            if ambient <= 0:
                raise ValueError(f'{show(given)} is not an absolute pressure above 0; expected for example "1 atm"')
            self.setting.ambient = ambient
        except ValueError as error:
            self.fault(("ambient_pressure",), str(error))
        values = {key: default for key, (_, default) in TOP.items()}
        for key, value in TOP.items():
            try:
                if key in self.raw.table:
                    values |= read_keys({key: self.raw.table[key]}, {key: value}, self.setting)
            except ValueError as error:
                self.add_error((), error)
        return values

    def fluid(self) -> tuple[FluidSpec | None, Any]:
        spec = self.table("fluid", FluidSpec)
        if spec is None:
            return None, None
        stated = {key: getattr(spec, key) for key in FluidSpec.model_fields}
        try:
            if isinstance(spec.viscosity, Kinematic):
                density = spec.density
                if density is None:
                    density = properties(**{**stated, "viscosity": None}).density
                stated["viscosity"] = float(spec.viscosity) * density
                spec = spec.model_copy(update={"viscosity": stated["viscosity"]})
            return spec, properties(**stated)
        except FluidError as error:
            self.fault(("fluid", error.key), error.message + self.in_celsius(stated, error.key))
            return spec, None

    def in_celsius(self, stated: dict[str, Any], key: str) -> str:
        """Hint for a message if a temperature without unit is out of range in K but valid in degC; "" otherwise.

        stated : values of `[fluid]`; key : faulty key
        """
        given = self.raw.get(("fluid", "temperature"))
        if key != "temperature" or isinstance(given, str):
            return ""
        try:
            properties(**{**stated, "temperature": stated["temperature"] + 273.15})
        except FluidError:
            return ""
        return f'; a bare number is in K, did you mean "{given:g} degC"?'

    def kinds(self, group: str) -> dict[str, Any]:
        result = {}
        for name, part in self.group(group).items():
            kind = part.get("type") if isinstance(part, dict) else None
            result[name] = KINDS[group].get(kind) if isinstance(kind, str) else None
            if group == "nodes" and result[name] is not None:
                result[name] = result[name].variant(part)
        return result

    def parts(self, group: str) -> dict[str, Any]:
        alone = (*LINKLESS, None)  # faulty ones
        basin = any(check.kind_name(node) in alone for node in self.group("nodes").values())
        if group not in self.raw.table and not (group == "links" and basin):
            self.fault((), f"[{group}] is missing: {GROUPS[group]}")
        result = {}
        for name, part in self.group(group).items():
            if not re.fullmatch(r"[\w-]+", name):
                self.fault((group, name), f"{show(name)} is not a valid name; a name has only letters, digits, _ and -")
            if len(name) > resource_checks.LONGEST_NAME:
                self.fault((group, name), f"has {len(name)} letters; expected at most {resource_checks.LONGEST_NAME}")
            if not isinstance(part, dict):
                self.fault((group, name), f"{show(part)} is not a table; expected a table with a type")
                continue
            kind = self.kind(group, name, part)
            if kind is None or (group, name) in self.unreadable:
                continue
            try:
                result[name] = self.reuse((group, name), part, functools.partial(self.part, kind, part))
            except ValueError as error:
                self.add_error((group, name), error)
        return result

    def uncounted(self) -> list[str]:
        """Names of faulty parts with unknown points, patches or chambers, and of pipes with unknown pieces."""
        nodes, links = self.group("nodes"), self.group("links")
        pipes = [name for name, link in links.items()
                if chainage.is_pipe(link) and not isinstance(link.get("bends", []), list)]  # fmt: skip
        return pipes + [name for name in (*nodes, *links) if check.has_unknown_places(name, nodes, links)]

    def part(self, kind: Any, given: dict[str, Any]) -> Any:
        """Read a part of class `kind` from its keys in the file, completed by defaults."""
        rest = {key: value for key, value in defaults.with_defaults(self.raw.table, given).items() if key != "type"}
        kind = kind.variant(rest) if issubclass(kind, Node) else kind
        return kind.model_validate(rest, context=self.setting)

    def meshes(self, nodes: dict[str, Any]) -> dict[str, Any]:
        """Meshes of basins with cells, by name. Those of basins without cells are added to `lumped`.

        Basins with a faulty mesh are removed from `nodes`.
        """
        result = {}
        for name, node in [*nodes.items()]:
            try:
                if isinstance(node, Basin):
                    mesh = self.reuse(("meshes", name), node, functools.partial(basins.mesh_of, node, self.setting))
                    (self.lumped if node.lumped else result)[name] = mesh
            except ValueFault as error:
                self.add_error(("nodes", name), error)
                del nodes[name]
        return result

    def network_table(self, meshes: dict[str, Any]) -> dict[str, Any]:
        """Nested dicts of the case for the check of connections, in which basins have all patches of their meshes.

        A basin with a faulty mesh file has the patches that links name. A node that cannot be read is replaced by a
        junction; links that cannot be read are left out, except pipes.
        """
        nodes, links = self.group("nodes"), self.group("links")
        patches = {name: basins.patch_names(mesh) for name, mesh in meshes.items()}
        lost = [
            name for name, part in nodes.items() if check.has_mesh_file(part) and name not in (*meshes, *self.lumped)
        ]
        patches |= {name: check.named_places(name, links) for name in lost}
        if not patches and not self.unreadable:
            return self.raw.table
        own = {name: {**nodes[name], "patches": dict.fromkeys(names, {}) | (nodes[name].get("patches") or {})}
               for name, names in patches.items()}  # fmt: skip
        own |= {name: {"type": "junction"} for group, name in self.unreadable if group == "nodes"}
        unfit = [name for group, name in self.unreadable if group == "links" and not chainage.is_pipe(links[name])]
        links = {name: part for name, part in links.items() if name not in unfit}
        return {**self.raw.table, "nodes": {**nodes, **own}, "links": links}

    def kind(self, group: str, name: str, part: dict[str, Any]) -> Any:
        known = KINDS[group]
        if "type" not in part:
            self.fault((group, name), f"type is missing; expected one of {listing(sorted(known))}")
            return None
        kind = part["type"]
        if not isinstance(kind, str) or kind not in known:
            other = "links" if group == "nodes" else "nodes"
            hint = did_you_mean(str(kind), known)
            if isinstance(kind, str) and kind in KINDS[other]:
                hint = f"; it belongs under [{other}]"
            synonym = read_table("part_synonyms").get(str(kind).casefold().replace("_", "-").replace(" ", "-"))
            hint = f"; use {synonym}" if synonym else f"; types are {listing(sorted(known))}{hint}"
            self.fault((group, name, "type"), f"unknown type {show(kind)}{hint}")
            return None
        return known[kind]

    def scalars(self) -> dict[str, Any]:
        """Scalars by name; None for a faulty scalar."""
        result = {}
        for name, given in self.group("scalars").items():
            result[name] = None
            try:
                result[name] = Scalar.model_validate(given, context=self.setting)
            except ValueError as error:
                self.add_error(("scalars", name), error)
        return result

    def unused_signals(self) -> None:
        for name, given in self.setting.signals.items():
            if name in self.setting.used or (isinstance(given, dict) and "signal" in given):
                continue
            problems, dimensions = [], ("number", "flow", "pressure", "head", "force")
            for dimension in dimensions:
                try:
                    Scheduled(dimension).read(given, self.setting)
                except ValueError as error:
                    problems.append(error)
            if len(problems) == len(dimensions):
                self.add_error(("signals", name), problems[0])

    def cells(self, links: dict[str, Any], properties: Any, numerics: Numerics | None) -> dict[str, Any]:
        pipes = {name: link for name, link in links.items() if isinstance(link, Pipe)}
        if properties is None or numerics is None:
            return links
        counts = default_cells(pipes, properties, numerics.cell_time)
        worst = max(counts, key=counts.get, default=None)
        if worst is not None and counts[worst] > MOST_CELLS:
            self.fault(
                ("numerics", "cell_time"),
                f"would cut {worst} into {counts[worst]:.3g} cells, more than {MOST_CELLS:.0e}; expected a longer time",
            )
            return links
        filled = {name: links[name].model_copy(update={"cells": count}) for name, count in counts.items()
                  if count != links[name].cells}  # fmt: skip
        return {name: filled.get(name, link) for name, link in links.items()}

    def probe(self, given: Any, keys: tuple, kinds: dict) -> Probe | None:
        try:
            return read_probe(given, kinds)
        except ValueError as error:
            self.fault(keys, str(error))
            return None

    def output(self, numerics: Numerics | None, kinds: dict) -> Output | None:
        output = self.table("output", Output)
        valid = output if output is not None else self.valid_keys("output", Output)
        if valid.probes is None:
            probes = default_probes(kinds)
        else:
            named = [self.probe(text, ("output", "probes", n), kinds) for n, text in enumerate(valid.probes)]
            probes = list({probe.text: probe for probe in named if probe is not None}.values())
        self.add(basins.line_faults(valid, kinds["nodes"]))
        if output is None:
            return None
        changes: dict[str, Any] = {"probes": probes}
        if output.every is None and numerics is not None:
            changes["every"] = (numerics.end - numerics.start) / DEFAULT_ROWS
        return output.model_copy(update=changes)

    def routes(self, links: dict[str, Any]) -> dict[str, Route | None]:
        """Routes by name; None for a faulty route."""
        result: dict[str, Route | None] = {}
        named, odd = self.group("links"), set()
        for name, given in self.group("routes").items():
            result[name] = None
            if name in self.group("nodes") or name in named or name in ALL:
                self.fault(
                    ("routes", name),
                    f"{show(name)} is also the name of a node or link, or a reserved word; expected another name",
                )
                continue
            try:
                result[name] = expand_pieces(Route.model_validate(given, context=self.setting), self.pieces, links)
            except ValueError as error:
                self.add_error(("routes", name), error)
                with suppress(KeyError, TypeError, ValueError):
                    pipes = Route.values()["pipes"].read(given["pipes"], self.setting)
                    result[name] = expand_pieces(Route.model_construct(pipes=pipes), self.pieces, links)
                    odd.add(name)
        faulty = list(route_misfits(result, links, named, self.pieces)) if self.joined else []
        self.add(faulty)
        lost = odd | {keys[1] for keys, _ in faulty}
        pipes = {name for name, link in links.items() if isinstance(link, Pipe)}
        lost |= {name for name, route in result.items()
                 if route and (not pipes.issuperset(route.pipes) or first_gap(route, links) is not None)}  # fmt: skip
        return {name: None if name in lost else route for name, route in result.items()}

    def limits(self, kinds: dict, routes: dict, links: dict[str, Any], *about: Any) -> dict[str, DesignLimit | None]:
        """Design limits by name; None for a limit on faulty parts.

        kinds, routes, links : as for `read_limit`; about : properties of the fluid and gravity [m/s2]
        """
        result = {}
        for name, given in self.group("limits").items():
            try:
                result[name] = read_limit(name, given, kinds, routes, links, self.setting)
                self.add((("limits", name, *keys), text) for keys, text in limit_faults(result[name], *about))
            except ValueError as error:
                self.add_error(("limits", name), error)
        return result

    def expect(self, kinds: dict, routes: dict) -> dict[str, Expect]:
        result = {}
        for claim, given in self.group("expect").items():
            try:
                result[claim] = read_expect(claim, given, kinds, routes, self.setting)
            except ValueError as error:
                self.add_error(("expect", claim), error)
        return result

    def compare(self, kinds: dict) -> dict[str, Compare]:
        result = {}
        for name, given in self.group("compare").items():
            probe = self.probe(name, ("compare", name), kinds)
            try:
                result[name] = read_compare(probe, given, self.setting)
            except ValueError as error:
                self.add_error(("compare", name), error)
        return result
