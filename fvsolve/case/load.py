"""Reading of a case from a TOML file or a dict, in stages; each stage runs when what it needs is known."""

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fvsolve import exact, units
from fvsolve.argument_checks import TABLE, validated
from fvsolve.case import (
    chainage,
    checks,
    claims,
    connections,
    part_reading,
    resource_checks,
    shipped,
)
from fvsolve.case.case import Case, wave_speed
from fvsolve.case.conduits import water_of_conduits
from fvsolve.case.declared_tables import (
    DECLARED,
    KEYS,
    add_declared_parts,
    is_declared,
    read_declared_tables,
)
from fvsolve.case.part_reading import Parts
from fvsolve.case.pipe_routes import legs, read_routes
from fvsolve.case.probe import default_probes, read_probe
from fvsolve.case.reading import (
    Raw,
    Reading,
    copy_paths,
    default_faults,
    defaults_of,
    override,
    read_raw,
    split_key,
)
from fvsolve.case.sections import DEFAULT_ROWS, ExactSpec, FluidSpec, Numerics, Output, ViscosityLaw
from fvsolve.core.fluid import follow_temperature, properties, specific_heat
from fvsolve.errors import FluidError, did_you_mean
from fvsolve.parts import KINDS, Friction, Pipe, Scalar
from fvsolve.parts import value as val
from fvsolve.parts.carried_scalar import ZEROS
from fvsolve.parts.date_keys import StartTimeValue
from fvsolve.parts.nodes_and_links import is_kind
from fvsolve.parts.pipe.pipe_wall import OF_WALL
from fvsolve.parts.schedule import Schedule, Scheduled, signal_fault
from fvsolve.parts.table_model import RunTimes, read_keys
from fvsolve.units import Kinematic, show

if TYPE_CHECKING:
    from fvsolve.parts.pump.energy_use import EnergyUse

SCHEMA = 1
# each has a value in each cell and at each node, and a default probe at each node
MOST_SCALARS = 500
# keys of parts whose presence alone changes the case
PRESENCE_KEYS = ("required_pressure", "price")
# Tables with names that other tables refer to.
NAME_TABLES = (
    "nodes",
    "links",
    "signals",
    "controls",
    "scalars",
    "reactions",
    "routes",
    "defaults",
)
STUDY_KEYS = {"events", "protections"}
TOP = {
    "schema": (val.Whole(val.between(SCHEMA, SCHEMA)), SCHEMA),
    "title": (val.Text(changes=val.VALUE), ""),
    "description": (val.Text(changes=val.VALUE), ""),
    "source": (val.Text(changes=val.VALUE), ""),
    "gravity": (val.Quantity("acceleration", val.nonnegative), 9.80665),
}


@validated(set=TABLE)
def load(
    source: str | Path | Mapping[str, Any] | Case | Raw, set: Mapping[str, Any] | None = None
) -> Case:
    """Read a case from a TOML file, the name of a shipped case, a dict shaped like a file, or another case.

    set : values that override keys, such as {"links.main.cells": 400}. Numbers of the result are in SI, pressures
    absolute [Pa]. Raises CaseError with every fault: line, key path, value found, expected value, nearest valid name.
    """
    if isinstance(source, Raw):
        return read_case(
            replace(source, table=read_raw(source.table).table, overridden=[]), set or {}
        )
    if not isinstance(source, Case):
        return read_case(read_raw(find_source(source)), set or {})
    if not set:
        return source
    table = copy_paths(source.raw, [split_key(str(key)) for key in set])
    return read_case(Raw(table, source.name, source.path, source.folder), set, source)


def find_source(source: Any) -> Any:
    """Path of a shipped case if `source` is its name and not the path of a file; otherwise `source`."""
    if isinstance(source, str) and not Path(source).is_file() and source in shipped.names():
        return shipped.find(source)
    return source


def alternatives_of(table: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Groups of alternative keys of the tables of a case; a table may have at most one key of a group."""
    models, groups = [Numerics, Friction], dict(KINDS)
    if "controls" in table:
        from fvsolve.parts.control import Control

        groups["controls"] = Control.kinds
    for group, kinds in groups.items():
        parts = table[group].values() if isinstance(table.get(group), Mapping) else ()
        types = [str(part.get("type")) for part in parts if isinstance(part, Mapping)]
        models += [kinds[kind] for kind in dict.fromkeys(types) if kind in kinds]
    return list(dict.fromkeys(keys for model in models for keys in model.alternatives))


def read_case(raw: Raw, settings: Mapping[str, Any], previous: Case | None = None) -> Case:
    """Read a case; values that are equal in an earlier case `previous` are not read again.

    settings : overrides, see `load`. Raises CaseError with all faults.
    """
    # Overrides of tables that stand for parts come before these parts, all others may name them.
    first = {key: value for key, value in settings.items() if is_declared(split_key(str(key))[0])}
    refused = override(raw, first, alternatives_of) if first else []
    added = add_declared_parts(raw)
    settings = {key: value for key, value in settings.items() if key not in first}
    refused += override(raw, chainage.settings(raw.table, settings), alternatives_of)
    if added:
        reading = Reading(raw, refused)
        reading.add(added)
        reading.stop()  # parts that are missing would bring further faults
    if previous is not None and not refused:
        case = update_values(Reading(raw), previous)
        if case is not None:
            return case
    return _read_all(Reading(raw, refused), previous)


def _read_all(reading: Reading, previous: Case | None) -> Case:
    """Read all tables, in the order in which they depend on each other. Raises CaseError with all faults."""
    general = read_general(reading)
    reading.known = reusable_values(reading, previous)
    given = reading.raw.table.get("fluid", reading.needs_no_fluid)
    fluid, state = reading.reuse(("fluid",), given, functools.partial(read_fluid, reading))
    numerics = reading.table("numerics", Numerics)
    read_calendar(reading, numerics or valid_times(reading))
    check_names(reading)
    cut = part_reading.cut_pipes(reading, state, numerics)
    scalars = read_scalars(reading)
    reactions: dict[str, Any] = {}
    if "reactions" in reading.raw.table:
        from fvsolve.case.reactions import reaction_kinds, read_reactions

        reactions = read_reactions(reading, scalars)
    parts = part_reading.read_parts(reading, cut)
    scalars = fill_specific_heats(reading, scalars, parts.links, state)
    check_unused_signals(reading)
    kinds = part_reading.place_kinds(cut, parts, scalars, bool(reading.faults))
    routes = read_routes(reading, cut, parts.links)
    kinds["routes"] = {
        name: route and (legs(route, parts.links), parts.links) for name, route in routes.items()
    }
    kinds["reactions"] = reaction_kinds(reactions) if reactions else {}
    blocks = {}
    if "controls" in reading.raw.table:
        from fvsolve.case.controls import read_controls  # most cases have no blocks

        blocks = read_controls(reading, kinds)
    output = read_output(reading, numerics, kinds)
    kinds["run_up"] = run_up_kinds(reading, output)
    expect = claims.read_expectations(reading, kinds, routes)
    compare = claims.read_comparisons(reading, kinds)
    validation = read_validation_table(reading, kinds, routes)
    limits = claims.read_limits(reading, kinds, routes, parts.links, state, general["gravity"])
    others = {"controls": {name: block.control for name, block in blocks.items() if block}}
    check_parts(reading, cut, parts, others, state, numerics, general["gravity"])
    cells = has_cells(cut.table)
    check_times(reading, cut, parts, fluid, state, numerics or valid_times(reading), cells, expect)
    numerics = fill_numerics(reading, parts, fluid, scalars, numerics, cells)
    reading.add(
        checks.scalar_faults(scalars, parts.nodes, parts.links, cut.pieces, reading.raw.table)
    )
    reading.add(checks.scalar_range_faults(scalars, reactions, parts.nodes, parts.links))
    links = part_reading.fill_cells(reading, parts.links, state, numerics)
    if None not in (numerics, output, state) and not reading.faults:
        reading.add(size_faults(numerics, output, links, parts.meshes, state))
    waters, lines = {}, {}
    if state is not None and not reading.faults:
        weight = state.density * general["gravity"]
        waters, lines = water_of_conduits(parts.nodes, links, reading.setting.ambient, weight)
    energy = read_energy(reading, parts)
    named = reading.table("exact", ExactSpec) if "exact" in reading.raw.table else None
    reading.stop()
    setting, raw = reading.setting, reading.raw
    case = Case(
        name=raw.name,
        path=raw.path,
        folder=raw.folder,
        raw=raw.table,
        **general,
        ambient_pressure=setting.ambient,
        fluid=fluid,
        properties=state,
        nodes=parts.nodes | waters,
        links=links,
        meshes=parts.meshes | lines,
        lumped=parts.lumped,
        signals=dict(setting.used),
        scalars=scalars,
        numerics=numerics,
        output=output,
        expect=expect,
        compare=compare,
        routes=routes,
        limits=limits,
        controls=blocks,
        reactions=reactions,
        exact=named,
        energy=energy,
        copies=dict(setting.files),
        read=reading.read,
        validation=validation,
    )
    return case if named is None else with_exact(reading, case)


def read_validation_table(reading: Reading, kinds: dict[str, Any], routes: dict[str, Any]) -> Any:
    """Table `validation`; None without one."""
    if "validation" not in reading.raw.table:
        return None
    from fvsolve.case.validation_table import read_validation

    return read_validation(reading, kinds, routes)


def read_energy(reading: Reading, parts: Parts) -> "EnergyUse | None":
    """Table `[energy]`; None without it or if it is faulty."""
    if "energy" in reading.raw.table:
        from fvsolve.parts.pump.energy_use import EnergyUse

        return reading.table("energy", EnergyUse)
    if any(link.kind == "pump" for link in parts.links.values()):
        from fvsolve.parts.pump.energy_use import price_faults

        reading.add(price_faults(parts.links))
    return None


def read_general(reading: Reading) -> dict[str, Any]:
    """Keys outside tables; the ambient pressure is stored in the context of values. Unknown tables are faults."""
    table = reading.raw.table
    if STUDY_KEYS & table.keys() and not {"nodes", "links"} & table.keys():
        reading.fault((), f"is a study of a case; fvsolve study {reading.raw.file} runs it")
        reading.stop()
    if "validation" in table and not {"nodes", "links", "controls"} & table.keys():
        reading.fault(
            (), f"has a validation without a scene; fvsolve validate {reading.raw.file} runs it"
        )
        reading.stop()
    for key in table:
        if key not in KEYS and key not in DECLARED:
            known = (*KEYS, *DECLARED)
            reading.fault(
                (key,),
                f"unknown key{did_you_mean(key, known) or '; keys are ' + ', '.join(known)}",
            )
    given = table.get("ambient_pressure", 101325.0)
    with reading.catch("ambient_pressure"):
        ambient, gauge = units.parse(given, "pressure")
        if gauge:
            raise ValueError(
                f'{show(given)} is a gauge pressure; expected an absolute pressure, such as "1 atm"'
            )
        if ambient <= 0:
            raise ValueError(
                f'{show(given)} is not an absolute pressure above 0; expected for example "1 atm"'
            )
        reading.setting.ambient = ambient
    values = {key: default for key, (_, default) in TOP.items()}
    values["declared"] = read_declared_tables(reading)
    for key, value in TOP.items():
        with reading.catch():
            if key in table:
                values |= read_keys({key: table[key]}, {key: value}, reading.setting)
    return values


def reusable_values(reading: Reading, previous: Case | None) -> dict[tuple, tuple[Any, Any]]:
    """Values of an earlier case that hold in this case if their raw values are the same : as `Reading.known`.

    There are none if the ambient pressure changes, on which all gauge pressures depend, if the start time changes, from
    which dates count, or if defaults of parts change.
    """
    if previous is None or previous.ambient_pressure != reading.setting.ambient:
        return {}
    # times of files with dates count from the start time
    stated = [raw.get("numerics") for raw in (previous.raw, reading.raw.table)]
    if len({str(table.get("start_time")) for table in stated if isinstance(table, dict)}) != 1:
        return {}
    now, before = reading.raw.table, previous.raw
    same = now.get("defaults") == before.get("defaults")
    # with those of [numerics]
    same = same and defaults_of(now, "pipe") == defaults_of(before, "pipe")
    return previous.read if same else {}


def read_fluid(reading: Reading) -> tuple[FluidSpec | None, Any]:
    """Table `[fluid]` and properties of the fluid; None for each that is faulty."""
    spec = reading.table("fluid", FluidSpec)
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
        if isinstance(spec.viscosity, ViscosityLaw):
            return spec, follow_temperature(
                properties(**stated | {"viscosity": None}), spec.viscosity.points
            )
        return spec, properties(**stated)
    except FluidError as error:
        reading.fault(("fluid", error.key), error.message + _in_celsius(reading, stated, error.key))
        return spec, None


def _in_celsius(reading: Reading, stated: dict[str, Any], key: str) -> str:
    """Hint for a message if a temperature without unit is out of range in K but valid in degC; "" otherwise.

    stated : values of `[fluid]`; key : faulty key
    """
    given = reading.raw.get(("fluid", "temperature"))
    if key != "temperature" or isinstance(given, str):
        return ""
    try:
        properties(**{**stated, "temperature": stated["temperature"] + 273.15})
    except FluidError:
        return ""
    return f'; a bare number is in K, did you mean "{given:g} degC"?'


def check_names(reading: Reading) -> None:
    """Read the signals and check the defaults. Raises CaseError if a table of named parts is not a table."""
    table = reading.raw.table
    reading.setting.signals, reading.setting.controls = (
        reading.group("signals"),
        reading.group("controls"),
    )
    reading.add(default_faults(table, reading.setting))
    tables = [table.get(name, {}) for name in NAME_TABLES]
    tables += tables[-1].values() if isinstance(tables[-1], dict) else []  # of defaults
    if not all(isinstance(table, dict) for table in tables):
        for name in NAME_TABLES[:-1]:
            reading.group(name)
        reading.stop()  # the names are not known


def read_scalars(reading: Reading) -> dict[str, Any]:
    """Scalars by name, None for a faulty scalar."""
    result: dict[str, Any] = {}
    table = reading.group("scalars")
    if len(table) > MOST_SCALARS:
        reading.fault(("scalars",), f"has {len(table)} scalars; expected at most {MOST_SCALARS}")
    for name, given in list(table.items())[:MOST_SCALARS]:
        result[name] = None
        with reading.catch("scalars", name):
            result[name] = Scalar.model_validate(given, context=reading.setting)
    return result


def fill_specific_heats(
    reading: Reading, scalars: dict[str, Any], links: dict[str, Any], fluid: Any
) -> dict[str, Any]:
    """Scalars with the specific heat of the fluid where none is stated: with `heat`, and where walls store heat.

    Adds a fault for a specific heat that has no effect.
    """
    factors = [getattr(link, "retardation", {}).items() for link in links.values()]
    stored = {name for items in factors for name, factor in items if factor == OF_WALL}
    result = dict(scalars)
    for name, scalar in scalars.items():
        if scalar is None:
            continue
        needed = scalar.heat or (name in stored and scalar.unit in ZEROS)
        if scalar.specific_heat is not None and not needed and not reading.faults:
            text = 'needs heat = true, or a pipe with the retardation factor "wall"'
            reading.fault(("scalars", name, "specific_heat"), text)
        if needed and scalar.specific_heat is None and fluid is not None:
            try:
                found = specific_heat(fluid.name, fluid.temperature, fluid.pressure)
            except FluidError as error:
                reading.fault(("scalars", name), f"{error.message}; give the key `specific_heat`")
                continue
            result[name] = scalar.model_copy(update={"specific_heat": found})
    return result


def check_unused_signals(reading: Reading) -> None:
    """Add a fault for each signal that no part uses and that is not a schedule of any usual dimension."""
    for name, given in reading.setting.signals.items():
        if name in reading.setting.used or (
            isinstance(given, dict) and ("signal" in given or "sum" in given)
        ):
            continue
        if text := signal_fault(given):
            reading.fault(("signals", name), text)
            continue
        problems, dimensions = [], ("number", "flow", "pressure", "head", "force")
        for dimension in dimensions:
            try:
                Scheduled(dimension).read(given, reading.setting)
                break
            except ValueError as error:
                problems.append(error)
        if len(problems) == len(dimensions):
            with reading.catch("signals", name):
                raise problems[0]


def has_cells(table: dict[str, Any]) -> bool:
    """True if a case has pipes or basins, or parts of unknown type. table : nested dicts of the case"""
    kinds = [
        kind
        for group in ("nodes", "links")
        for kind in part_reading.table_kinds(table, group).values()
    ]
    return any(
        kind in (Pipe, None) or is_kind(kind, "basin") or is_kind(kind, "conduit") for kind in kinds
    )


def read_output(
    reading: Reading, numerics: Numerics | None, kinds: dict[str, Any]
) -> Output | None:
    """Table `[output]` with its probes and its interval of rows; None if it is faulty. kinds : as for `read_probe`"""
    output = reading.table("output", Output)
    valid = output if output is not None else reading.valid_keys("output", Output)
    kinds["sections"] = {}
    names_basins = any(
        (valid.gauges, valid.sections, valid.lines, valid.run_up, valid.grids, valid.maxima)
    )
    if names_basins:
        from fvsolve.case import basins  # only output of basins needs it

        reading.add(basins.add_gauges(valid, kinds["nodes"]))
        kinds["sections"], faults = basins.section_kinds(valid, kinds)
        reading.add(faults)
    if valid.probes is None:
        probes = default_probes(kinds)
    else:
        named = {}
        for n, text in enumerate(valid.probes):
            with reading.catch("output", "probes", n):
                probe = read_probe(text, kinds)
                named |= {} if probe is None else {probe.text: probe}
        probes = list(named.values())
    if names_basins:
        reading.add(basins.output_faults(valid, kinds["nodes"]))
    if output is None:
        return None
    changes: dict[str, Any] = {"probes": probes}
    if output.every is None and numerics is not None:
        changes["every"] = (numerics.end - numerics.start) / DEFAULT_ROWS
    return output.model_copy(update=changes)


def run_up_kinds(reading: Reading, output: Output | None) -> dict[str, Any]:
    """Run-ups of `[output]` by name, for the reading of expectations; None for each if `[output]` is faulty."""
    if output is not None:
        return output.run_up
    given = reading.raw.table.get("output")
    names = given.get("run_up") if isinstance(given, dict) else None
    return dict.fromkeys(names) if isinstance(names, dict) else {}


def valid_times(reading: Reading) -> Numerics | None:
    """Numerics with the valid keys of a faulty `[numerics]`; None without valid `end` or with invalid `start`."""
    given = reading.raw.table.get("numerics")
    valid = reading.valid_keys("numerics", Numerics) if isinstance(given, dict) else None
    times = {key for key in ("start", "end") if valid is not None and key in given}
    return valid if "end" in times and times <= valid.model_fields_set else None


def read_calendar(reading: Reading, numerics: Numerics | None) -> None:
    """Store start and end of the run and the instant of t = 0 in the context of values.

    numerics : table as far as it is valid, None if faulty
    """
    if numerics is not None and numerics.start < numerics.end:
        reading.setting.span = numerics.start, numerics.end
    reading.setting.start_time = read_start_time(reading, numerics)


def read_start_time(reading: Reading, numerics: Numerics | None) -> Any:
    """Instant of t = 0 of `[numerics]`: None without one, UNREAD if it is faulty.

    Adds a fault if the run leaves the calendar. numerics : table as far as it is valid, None if faulty
    """
    given = reading.raw.table.get("numerics")
    if not isinstance(given, dict) or "start_time" not in given:
        return None
    try:
        start = StartTimeValue().read(given["start_time"], reading.setting)
    except ValueError:
        return val.UNREAD
    if numerics is not None and not start.holds(numerics.start, numerics.end):
        text = f"{start.table()} with a run from {numerics.start:g} s to {numerics.end:g} s leaves the years 1 to 9999"
        reading.fault(("numerics", "start_time"), f"{text}; expected a run within these years")
        return val.UNREAD
    return start


def check_parts(
    reading: Reading,
    cut: chainage.CutTable,
    parts: Parts,
    others: dict[str, dict[str, Any]],
    state: Any,
    numerics: Numerics | None,
    gravity: float,
) -> None:
    """Check connections, and each part in the context of the others.

    others : parts of other sections, section -> name -> part; state : properties of the fluid, None if faulty
    """
    if cut.connections_known:
        reading.add(connections.connection_faults(part_reading.network_table(cut, parts)))
    groups = {"links": parts.links | cut.uncut, "nodes": parts.nodes, **others}
    raw, times = replace(reading.raw, table=cut.table), run_times(reading, numerics)
    about = reading.setting.ambient, gravity, state, raw, times
    reading.add(checks.part_faults(groups, *about, parts.meshes, parts.lumped))


def run_times(reading: Reading, numerics: Numerics | None) -> RunTimes:
    """Times of the run, as far as they are known."""
    if numerics is not None:
        return numerics.times
    return RunTimes(*(reading.setting.span or (0.0,)))


def check_times(
    reading: Reading,
    cut: chainage.CutTable,
    parts: Parts,
    fluid: FluidSpec | None,
    state: Any,
    times: Numerics | None,
    cells: bool,
    expect: dict[str, Any],
) -> None:
    """Check what depends on the times of the run: cavities, basins and expectations.

    state : properties of the fluid, None if faulty; times : None if unknown; cells : True with pipes or basins
    """
    if times is None:
        return
    reading.add(checks.cavity_faults(times, cells, fluid))
    if any(is_kind(node, "basin") for node in parts.nodes.values()):
        from fvsolve.case import basins

        span, named = (times.start, times.end), cut.table.get("nodes", {})
        reading.add(basins.find_faults(parts.nodes, parts.links, parts.meshes, state, span, named))
    reading.add(checks.claim_faults(expect, times))


def fill_numerics(
    reading: Reading,
    parts: Parts,
    fluid: FluidSpec | None,
    scalars: dict[str, Any],
    numerics: Numerics | None,
    cells: bool,
) -> Numerics | None:
    """Numerics with their defaults, which depend on the parts; None if faulty. cells : True with pipes or basins"""
    if numerics is None:
        return None
    reading.add(checks.step_faults(numerics, cells))
    pools = [parts.nodes[name] for name in parts.meshes]
    carries = bool(scalars) and any(pool.physics_type.carries for pool in pools)
    rubs = any(pool.physics_type.has_friction(pool) for pool in pools)
    rubs = rubs or any(
        getattr(link, "manning", 0.0) for link in parts.links.values() if is_kind(link, "conduit")
    )
    return numerics.filled(cells, carries, rubs, checks.follows_cavities(fluid, cells))


def size_faults(
    numerics: Any, output: Any, links: dict, meshes: dict, state: Any
) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of cells or rows that need too much memory, and of too short steps.

    Steps and output intervals must exceed the rounding of the time.
    numerics, output : tables as read; meshes : meshes of basins; state : properties of the fluid
    """
    yield from resource_checks.find_faults(numerics, output, links, meshes)
    # travel times of a wave through a cell; in basins a wave speed of 1 m/s is assumed
    times = [
        link.length / link.cells / wave_speed(link, state)
        for link in links.values()
        if link.kind == "pipe"
    ]
    times += [float(mesh.area.min()) ** 0.5 for mesh in meshes.values()]
    yield from resource_checks.rounding_faults(numerics, min(times, default=math.inf))


def with_exact(reading: Reading, case: Case) -> Case:
    """Return the case if its `[exact]` is valid. If overrides make it invalid, return the case without it.

    Raises CaseError if it is invalid without overrides, or if an override sets a key of `[exact]`.
    """
    faults = list(exact.find_faults(case))
    settings = {keys[0] for keys in reading.raw.overridden}
    if faults and settings and "exact" not in settings:
        return replace(case, exact=None)
    reading.add(faults)
    reading.stop()
    return case


def update_values(reading: Reading, previous: Case) -> Case | None:
    """Copy of an earlier case with new numbers of parts; None if the new case must be read in full.

    It must be read in full if more than numbers of parts may change, and if there is a fault.
    Names, types, connections, probes, expectations and all other tables are kept.
    """
    raw, setting = reading.raw, reading.setting
    if not is_self_contained(previous) or not all(
        is_number_key(raw, keys) for keys in raw.overridden
    ):
        return None
    setting.ambient, reading.read = previous.ambient_pressure, dict(previous.read)
    parts = {}
    for group in ("nodes", "links"):
        parts[group] = {}
        for name, given in raw.table.get(group, {}).items():
            known = previous.read.get((group, name))
            if known is None:
                return None
            if known[0] is not given:
                try:
                    part = part_reading.read_part(
                        reading, raw.table, type(known[1]), read_before(given, *known)
                    )
                    known = given, part
                except ValueError:
                    return None
                reading.read[group, name] = known
            parts[group][name] = known[1]
    nodes = part_reading.inherit_elevations(**parts)
    links = parts["links"]
    numerics = previous.numerics
    about = previous.ambient_pressure, previous.gravity, previous.properties, raw
    groups = {"links": links, "nodes": nodes}
    reading.add(checks.part_faults(groups, *about, numerics.times, {}, {}))
    links = part_reading.fill_cells(reading, links, previous.properties, numerics)
    if setting.lookups or reading.faults:
        return None
    reading.add(size_faults(numerics, previous.output, links, {}, previous.properties))
    if reading.faults:
        return None
    case = replace(previous, nodes=nodes, links=links, raw=raw.table, read=reading.read)
    return case if previous.exact is None else with_exact(reading, case)


def read_before(given: dict[str, Any], before: dict[str, Any], part: Any) -> dict[str, Any]:
    """Keys of a part (`given`) in which unchanged schedules are replaced by the schedules read for the earlier case.

    given, before : keys of the part as in the file, now and earlier; part : part as read earlier
    """
    values = vars(part)
    same = {
        key: schedule
        for key, value in given.items()
        if isinstance(schedule := values.get(key), Schedule)
        and isinstance(value, dict)
        and before.get(key) is value
    }
    return {**given, **same}


def is_self_contained(case: Case) -> bool:
    """True if a case has no files, measurements, signals, controls, scalars, basins, placed parts, equilibrium.

    An exact solution, if the case has one, must also be stated in its file.
    """
    outer = (
        case.signals
        or case.controls
        or case.scalars
        or case.compare
        or case.copies
        or case.equilibrium_nodes
    )
    no_outer_input = not (chainage.placed(chainage.add_bends(case.raw)) or outer)
    exact_in_file = case.exact is None or "exact" in case.raw
    return (
        no_outer_input
        and exact_in_file
        and not any(is_kind(node, "basin") for node in case.nodes.values())
    )


def is_number_key(raw: Any, keys: tuple) -> bool:
    """True if the value at a key path of a case is a number or a schedule of a part, or lies within one.

    Keys in `PRESENCE_KEYS` are excluded. raw : case before its values are read (`Raw`)
    """
    if len(keys) < 3 or keys[0] not in ("nodes", "links") or keys[2] in PRESENCE_KEYS:
        return False
    part = raw.get(keys[:2])
    return isinstance(part, dict) and keys[2] in number_keys(KINDS[keys[0]].get(part.get("type")))


@functools.cache
def number_keys(kind: type | None) -> frozenset[str]:
    """Keys of a type of part that are numbers or schedules."""
    values = {} if kind is None else kind.values()
    return frozenset(
        key for key, value in values.items() if isinstance(value, (val.Quantity, Scheduled))
    )
