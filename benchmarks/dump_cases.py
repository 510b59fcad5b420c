"""Dumps of shipped cases of one checkout for compare_commits.py: rates at a few states, and all files of a run.

    python -P dump_cases.py CHECKOUT MAP

Each line of standard input is a case file, the file of its dump, and a JSON object of keys with new values, separated
by tabs. The program writes the dump, then a line on standard output. It finds names of fvsolve through the map, because
two commits may spell them differently.
"""

from __future__ import annotations

import csv
import inspect
import json
import pickle
import re
import sys
import tempfile
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent))
from compare_dumps import Dump, Names  # noqa: E402

# Keys of summary.json with wall times, versions and hashes.
LEFT_OUT = ("seconds", "seconds_setup", "seconds_total", "cost", "ended", "versions")
# The checkpoint depends on wall time, and contains versions and hashes.
UNREAD = ("restart.npz",)
# Earlier ends of cases that take more than half a minute [s].
ENDS = {"tracer-basin": 150.0}
PART = 0.25  # fraction of the run after which the rates are evaluated as well


class Named:
    """Object whose attributes are found under any name that the map gives them."""

    def __init__(self, one, names: Names) -> None:
        self.one, self.names = one, names

    def __getattr__(self, name: str):
        spellings = self.names.spellings(name)
        for spelling in spellings:
            if hasattr(self.one, spelling):
                return getattr(self.one, spelling)
        raise AttributeError(
            f"{type(self.one).__name__} {getattr(self.one, '__name__', '')} has no {name} "
            f"(spellings: {', '.join(spellings)}); state its new name in the map"
        )


def dump(path: Path, changed: dict, names: Names, fvsolve) -> Dump:
    """Values of a case: its model at some states, then its run; for an invalid case the kind and number of faults.

    changed : new values of keys
    """
    api, found = Named(fvsolve, names), {}
    try:
        model = api.build(api.load(path, shorter(path, names) | changed))
    except api.FvsolveError as error:
        return {("fault",): type(error).__name__, ("faults",): len(getattr(error, "faults", "1"))}
    start = api.initial_state(model)
    found |= state_values("start", model, start, names)
    with tempfile.TemporaryDirectory(prefix="fvsolve-dump-") as folder:
        silent = next(
            one
            for one in names.spellings("pictures")
            if one in inspect.signature(api.run).parameters
        )
        api.run(model, None, Path(folder) / "run", **{silent: False})
        found |= directory(Path(folder) / "run", names)
    times = [(one,) for one in names.spellings("t")]
    end = next(
        value
        for (file, *key), value in found.items()
        if file.endswith(".json") and tuple(key) in times
    )
    begin = Named(start, names).t
    try:
        part = api.advance(model, start, begin + PART * (end - begin))
        last = api.advance(model, part, end)
    except api.FvsolveError as error:
        return found | {("advance",): type(error).__name__}
    found |= state_values("part", model, part, names)
    found |= state_values("last", model, last, names)
    found |= state_values("start again", model, start, names)
    middle = 0.5 * (Named(start, names).y + Named(last, names).y)
    found |= rates("middle", model, Named(part, names).t, middle, names)
    return found


def shorter(path: Path, names: Names) -> dict:
    """Key with the earlier end of a case in ENDS; empty for other cases."""
    end = next((ENDS[one] for one in names.spellings(path.stem) if one in ENDS), None)
    if end is None:
        return {}
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    section = next(one for one in names.spellings("numerics") if one in table)
    return {
        f"{section}.{next(one for one in names.spellings('end') if one in table[section])}": end
    }


def state_values(label: str, model, state, names: Names) -> Dump:
    """Values of a state: time, vector, memory, right-hand side by vector and by state, and all probes."""
    own, of = Named(state, names), Named(model, names)
    found = {
        (label, "t"): float(own.t),
        (label, "y"): own.y.copy(),
        (label, "memory"): flat(own.memory),
    }
    found |= rates(label, model, own.t, own.y, names)
    return found | {(label, "rates by memory"): of.rhs(state), (label, "probes"): of.observe(state)}


def flat(memory) -> np.ndarray:
    """Memory of a state as a vector; versions before the named arrays had this vector, with the size of the history."""
    if not isinstance(memory, dict):
        return memory.copy()
    size = [np.array([float(memory["past"].size)])] if "past" in memory else []
    return (
        np.concatenate([array.ravel() for array in memory.values()] + size)
        if memory
        else np.zeros(0)
    )


def rates(label: str, model, t: float, y, names: Names) -> Dump:
    """Right-hand side at (t, y) with all other output of its evaluation."""
    dydt, out = Named(model, names).evaluate(t, y)
    return {(label, "dydt"): dydt, (label, "out"): out}


def directory(folder: Path, names: Names) -> Dump:
    """Values of all files of a run directory."""
    found: Dump = {}
    readers = {".json": summary, ".csv": table, ".toml": case, ".vtu": frame, ".pvd": series}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix in readers and path.name not in UNREAD:
            place = path.relative_to(folder).as_posix()
            found |= {
                (place, *inner): value for inner, value in readers[path.suffix](path, names).items()
            }
    return found | {("files",): "\n".join(sorted({one[0] for one in found if "." in one[0]}))}


def summary(path: Path, names: Names) -> Dump:
    """Values of summary.json without the keys of LEFT_OUT."""
    left = {spelling for key in LEFT_OUT for spelling in names.spellings(key)}
    said = json.loads(path.read_text(encoding="utf-8"))
    return dict(leaves({key: value for key, value in said.items() if key not in left}))


def case(path: Path, names: Names) -> Dump:
    """Values of a case file."""
    return dict(leaves(tomllib.loads(path.read_text(encoding="utf-8"))))


def leaves(value, place: tuple[str, ...] = ()):
    """Place and value of all values in nested tables and lists.

    A list of floats is an array, an empty list or table a text.
    """
    if isinstance(value, list) and value and all(type(one) is float for one in value):
        yield place, np.array(value)
    elif isinstance(value, (dict, list)) and value:
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(one, (*place, str(key)))
    elif value is None or isinstance(value, (bool, int, float, str)):
        yield place, value
    else:
        yield place, str(value)


def table(path: Path, names: Names) -> Dump:
    """Columns of a CSV file by header, and the order of the headers."""
    with open(path, encoding="utf-8", newline="") as file:
        headers, *rows = csv.reader(file)
    found: Dump = {("headers",): "\n".join(headers)}
    for k, header in enumerate(headers):
        texts = [row[k] for row in rows]
        try:
            found[(header,)] = np.array([float(text) for text in texts])
        except ValueError:
            found[(header,)] = "\n".join(texts)
    return found


def frame(path: Path, names: Names) -> Dump:
    """Arrays of a VTK file by section and name, with their units."""
    import meshio

    mesh = meshio.vtu.read(str(path))
    found: Dump = {("points",): mesh.points}
    for k, block in enumerate(mesh.cells):
        found[f"cells {k}", block.type] = block.data
        found |= {
            (f"cells {k}", name): np.asarray(values[k]) for name, values in mesh.cell_data.items()
        }
    found |= {("points", name): np.asarray(values) for name, values in mesh.point_data.items()}
    text = path.read_text(encoding="utf-8")
    units = re.findall(
        r'Name="([^"]*)"[^>]*>[^<]*<InformationKey name="UNITS_LABEL"[^>]*>([^<]*)<', text
    )
    return found | {("units", name): unit for name, unit in units}


def series(path: Path, names: Names) -> Dump:
    """Times and files of the frames of a PVD file."""
    root = ElementTree.parse(path).getroot()
    return {
        (str(k), key): text
        for k, one in enumerate(root.iter("DataSet"))
        for key, text in one.attrib.items()
    }


def main() -> None:
    checkout, written = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    answers, sys.stdout = sys.stdout, sys.stderr
    import fvsolve

    home = Path(fvsolve.__file__).resolve()
    if checkout not in home.parents:
        raise SystemExit(f"fvsolve was imported from {home}; expected a place below {checkout}")
    names = Names(written.read_text(encoding="utf-8").splitlines())
    for line in sys.stdin:
        file, out, changed = line.rstrip("\n").split("\t")
        Path(out).write_bytes(pickle.dumps(dump(Path(file), json.loads(changed), names, fvsolve)))
        print("written", file=answers, flush=True)
