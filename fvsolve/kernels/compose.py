"""Writes the functions of a scene from what each of its rooms adds, so that a scene compiles its own rooms alone.

A room is a set of calls: before the nodes are closed, after, and to read a state. The module that joins them is a text
of some twenty lines in the folder of compiled code, written once and cached like any other. Knows names; knows no law.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from fvsolve.jit import composed_folder
from fvsolve.kernels.devices.laws import LAWS

HOME = "fvsolve.kernels"


@dataclass(frozen=True)
class Room:
    """Calls as `module: function(arguments)`, "" for none; all of them find the tables open.

    before : sets what the nodes are closed with; after : adds to rates; observe, record : read an accepted state
    events : event functions; by_nodes : of them, those for which nodes are closed
    """

    before: str = ""
    after: str = ""
    observe: str = ""
    record: str = ""
    events: str = ""
    by_nodes: bool = False
    power: str = ""
    stored: str = ""


ROOMS = {  # in the order in which they are called
    "bodies": Room(
        "mechanics: chambers(y, out, tables)",
        "mechanics: finish_bodies(t, y, dydt, out, tables)",
        "mechanics: observe_bodies(y, out, tables, values)",
        "mechanics: record_bodies(t, y, tables)",
        "mechanics: body_events(y, tables, g)",
    ),
    "devices": Room(
        "DEVICES: set_devices(t, y, out, tables)",
        "DEVICES: move_devices(t, y, dydt, out, tables)",
        "DEVICES: observe_devices(t, y, out, tables, values)",
        "DEVICES: mark_devices(t, out, tables)",
        "DEVICES: device_events(t, y, out, tables, g)",
        True,
        "DEVICES: power_devices(t, y, dydt, out, tables, power)",
        "DEVICES: stored_devices(t, y, out, tables, stored)",
    ),
    "memory": Room(
        after="unsteady.memory: remember_linear(y, dydt, tables)",
        power="unsteady.energy: add_power(y, dydt, tables, power)",
        stored="unsteady.energy: add_stored(y, tables, stored)",
    ),
    "memory, barotropic": Room(
        after="unsteady.barotropic: remember_barotropic(y, dydt, tables)",
        power="unsteady.energy: add_power(y, dydt, tables, power)",
        stored="unsteady.energy: add_stored(y, tables, stored)",
    ),
    "cavities": Room(record="cavitating: record_cavities(t, y, tables)"),
}
CORES = {  # (law, whether there are pipes) -> the fluid's right-hand side
    ("linear", True): "network: rhs_linear",
    ("linear", False): "lumped: rhs_lumped_linear",
    ("barotropic", True): "barotropic: rhs_barotropic",
    ("barotropic", False): "barotropic_lumped: rhs_lumped_barotropic",
    ("cavitating", True): "cavitating: rhs_cavitating",
}
OBSERVE = {
    "linear": "observer: observe_linear(t, y, out, handle, values)",
    "barotropic": "barotropic: observe_barotropic(t, y, out, handle, values)",
}
OBSERVE["cavitating"] = OBSERVE["barotropic"]
ENERGY = {
    "linear": (
        "energy: power_linear(t, y, dydt, out, handle, power)",
        "energy: stored_linear(t, y, dydt, out, handle, stored)",
    ),
    "barotropic": (
        "energy_barotropic: power_barotropic(t, y, dydt, out, handle, power)",
        "energy_barotropic: stored_barotropic(t, y, dydt, out, handle, stored)",
    ),
}
TEMPLATE = Path(__file__).parent / "devices" / "loops.py"
TANKS = "observer: tank_events(y, tables, g)"
RECORD = "observer: record_all(t, y, out, tables, values)"


def functions(law: str, pipes: bool, rooms: tuple[str, ...], kinds: tuple[int, ...]) -> ModuleType:
    """The module with `rhs`, `observe`, `record` and `events` of scenes under a law, with or without pipes.

    kinds : codes of the devices that there are
    """
    core, own = f"{CORES[law, pipes]}(t, y, dydt, out, handle)", [ROOMS[room] for room in rooms]
    before, after = [room.before for room in own], [room.after for room in own]
    by_nodes = [room.events for room in own if room.by_nodes]
    closed = [line.replace("dydt", "y[:0]") for line in [*before, core]] if by_nodes else []
    bodies = {
        "rhs(t, y, dydt, out, handle)": [*before, core, *after],
        "observe(t, y, out, handle, values)": [OBSERVE[law], *(room.observe for room in own)],
        "record(t, y, out, handle, values)": [
            ": observe(t, y, out, handle, values)", *(room.record for room in own), RECORD
        ],
        "events(t, y, handle, g)": [TANKS, *(room.events for room in own if not room.by_nodes), *closed, *by_nodes],
    }  # fmt: skip
    return scene([law, "pipes" if pipes else "lumped", *map(plain, rooms)], bodies, kinds)


def energies(law: str, rooms: tuple[str, ...], kinds: tuple[int, ...]) -> ModuleType:
    """The module with `power` and `stored` of scenes under a law."""
    own, (power, stored) = [ROOMS[room] for room in rooms], ENERGY[law]
    bodies = {
        "power(t, y, dydt, out, handle, power)": [power, *(room.power for room in own)],
        "stored(t, y, dydt, out, handle, stored)": [stored, *(room.stored for room in own)],
    }
    return scene(["energy", law, *map(plain, rooms)], bodies, kinds)


def scene(names: list[str], bodies: dict[str, list[str]], kinds: tuple[int, ...]) -> ModuleType:
    """The module of these functions, with its devices' loops beside it where there are any."""
    if not kinds:
        return module("_".join(names), text(bodies))
    loops = module("_".join(["devices", *map(str, kinds)]), device_text(kinds))
    name = loops.__name__.removeprefix(f"{HOME}.")
    return module("_".join([*names, *map(str, kinds)]), text(bodies).replace("DEVICES", name))


def device_text(kinds: tuple[int, ...]) -> str:
    """The source of what all devices of a scene do, kind by kind: the template, with the calls of these kinds in it."""
    own = {kind: LAWS[kind] for kind in kinds}
    lines = imports([f"{HOME}.devices.{call}" for law in own.values() for call in vars(law).values() if call])
    for line in TEMPLATE.read_text(encoding="utf-8").splitlines():
        what = line.strip().removeprefix("# each: ")
        if what == line.strip():
            lines.append(line)
            continue
        indent, (*into, job) = line[: len(line) - len(line.lstrip())], what.split(" = ")
        for kind, law in own.items():
            if getattr(law, job):
                said = " = ".join([*into, getattr(law, job).split(": ")[1]])
                lines += [f'{indent}if device["kind"] == {kind}:', f"{indent}    {said}"]
    return "\n".join(lines) + "\n"


def plain(room: str) -> str:
    """The name of a room as part of a file's."""
    return re.sub("[^a-z]+", "_", room)


def text(bodies: dict[str, list[str]]) -> str:
    """The source of a module: heads of functions and what they call, in order."""
    homes = ["fvsolve.jit: njit", f"{HOME}.handle: open_tables", f"{HOME}.records: I_SPARE"]
    homes += [f"{HOME}.{call}" for called in bodies.values() for call in called if call and not call.startswith(":")]
    lines = imports(homes)
    for head, called in bodies.items():
        lines += ["", "", "@njit", f"def {head}:", "    tables = open_tables(handle)"]
        if " out," not in head:
            lines.append("    out = tables[I_SPARE]")
        lines += [f"    {call.split(': ')[1]}" for call in called if call]
    return "\n".join(lines) + "\n"


def imports(calls: list[str]) -> list[str]:
    """What a module must import for these calls, each once."""
    parted = [call.split(": ") for call in calls]
    return list(dict.fromkeys(f"from {home} import {rest.split('(')[0]}" for home, rest in parted))


@functools.cache
def module(name: str, source: str) -> ModuleType:
    """The module of a source text, written beside the compiled code where it is not there yet."""
    path = composed_folder() / f"{name}.py"
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        fresh = Path(f"{path}.{os.getpid()}")
        fresh.write_text(source, encoding="utf-8")
        os.replace(fresh, path)
    spec = importlib.util.spec_from_file_location(f"{HOME}.composed_{name}", path)
    made = sys.modules[spec.name] = importlib.util.module_from_spec(spec)  # where numba looks for it
    spec.loader.exec_module(made)
    return made
