"""Hostile and unlucky inputs, drawn at random: mutants of every key of the shipped cases, and texts that are no cases.

Each input has a name from which it is made again: `CASE KEY CHANGE` or the name of a text and its size.
"""

import copy
import datetime
import random
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from reference import folders

CASES = sorted([*folders.CASES.glob("*.toml"), *(folders.CASES / "studies").glob("*.toml")])
HUGE = 10**5000  # a whole number with more digits than Python prints


class Input(NamedTuple):
    """Input: its name, and a table of a case with its folder, or the text of a file."""

    name: str
    table: Any = None
    folder: Path | None = None
    text: str | bytes | None = None


def places(table: Any, path: tuple = ()) -> Iterator[tuple]:
    """Key paths of all values of nested tables and lists; of a list the first three items."""
    items = (
        table.items()
        if isinstance(table, dict)
        else enumerate(table[:3])
        if isinstance(table, list)
        else ()
    )
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def number_of(value: Any) -> tuple[float, str] | None:
    """Number and unit of a value of a case: of a number, or of a text that begins with a number; else None."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value), ""
    if isinstance(value, str):
        number, _, unit = value.partition(" ")
        try:
            return float(number), unit
        except ValueError:
            return None
    return None


SCALES = {
    "zero": 0.0,
    "negative": -1.0,
    "million": 1e6,
    "millionth": 1e-6,
    "1e30": 1e30,
    "1e-30": 1e-30,
    "1e99": 1e99,
}
NUMBERS = {
    "1e300": 1e300,
    "1e-300": 1e-300,
    "least": 5e-324,
    "nan": float("nan"),
    "inf": float("inf"),
    "-0": -0.0,
    "2**62": 2**62,
    "2**63": 2**63,
    "2**64": 2**64,
    "huge": HUGE,
    "-huge": -HUGE,
}
OTHERS = {
    "text": "abc",
    "empty text": "",
    "flag": True,
    "table": {"a": 1.0},
    "empty table": {},
    "list": [1.0, 2.0],
    "empty list": [],
    "list of lists": [[1.0], [2.0]],
    "list of tables": [{"a": 1}],
    "date": datetime.date(2026, 1, 1),
    "schedule": {"time": [0.0, 1.0], "value": [1.0, 0.0]},
    "formula": "sin(t)",
    "file": {"file": "nothing.csv"},
    "control": {"control": "nothing"},
    "signal": {"signal": "nothing"},
    "5 kg": "5 kg",
    "3 barg": "3 barg",
    "1e400 m": "1e400 m",
    "blanks": " " * 1000,
    "snowman": "\N{SNOWMAN}",
    "null character": "\0",
    "long": "x" * 100_000,
    "blank text": "1" + " " * 100_000 + "x",
    "number": 5.0,
    "whole": 5,
    "digits": "1" * 100_000,
    "digits m": "1" * 100_000 + " m",
    "brackets": "(" * 10_000,
    "plus": "1+" * 50_000 + "1",
    "commas": "," * 100_000,
    "points": "." * 100_000,
    "path": "../../../../etc/passwd",
    "device": "/dev/zero",
    "folder": ".",
    "none": None,
}
REMOVED = ("missing", "renamed")
SCALED = 0.5  # share of the changes of numbers by a factor


def mutant(source: dict, path: tuple, change: str) -> dict:
    """Copy of a table in which the value at a key path is changed; `change` is one of the names above."""
    table = copy.deepcopy(source)
    inner = table
    for key in path[:-1]:
        inner = inner[key]
    key, value = path[-1], inner[path[-1]]
    if change == "missing":
        del inner[key]
    elif change == "renamed":
        if isinstance(inner, dict):
            inner[f"{key}x"] = inner.pop(key)
    elif change == "twice":
        inner[key] = [value, value]
    elif change in SCALES:
        number, unit = number_of(value)
        scaled = number * SCALES[change] if change != "zero" else 0.0
        inner[key] = f"{scaled!r} {unit}" if unit else scaled
    else:
        inner[key] = copy.deepcopy((NUMBERS | OTHERS)[change])
    return table


def changes(value: Any) -> list[str]:
    """Names of the changes of a value."""
    scales = list(SCALES) if number_of(value) else []
    return [*scales, *NUMBERS, *OTHERS, *REMOVED, "twice"]


def tables() -> dict[str, tuple[dict, Path]]:
    """Shipped cases: name -> (table, folder)."""
    return {
        path.stem: (tomllib.loads(path.read_text(encoding="utf-8")), path.parent) for path in CASES
    }


NAMED = (
    "nodes",
    "links",
    "signals",
    "controls",
    "scalars",
    "reactions",
    "limits",
    "routes",
    "expect",
    "defaults",
)


def kinds_of_keys(known: dict[str, tuple[dict, Path]]) -> dict[tuple, dict[str, list[tuple]]]:
    """Keys of the shipped cases by the types of their parts : kind of key -> case -> key paths.

    known : as from `tables`
    """
    result: dict[tuple, dict[str, list[tuple]]] = {}
    for name, (table, _) in known.items():
        for path in places(table):
            kind = tuple(0 if isinstance(key, int) else key for key in path)
            if len(path) > 1 and path[0] in NAMED:
                part = table[path[0]].get(path[1])
                kind = (
                    path[0],
                    str(part.get("type", "")) if isinstance(part, dict) else "",
                    *kind[2:],
                )
            result.setdefault(kind, {}).setdefault(name, []).append(path)
    return result


def mutants(draw: random.Random, count: int) -> Iterator[Input]:
    """Mutants of shipped cases, drawn evenly over the kinds of keys, then over the cases that have a key."""
    known = tables()
    kinds = list(kinds_of_keys(known).values())
    for _ in range(count):
        name, paths = draw.choice(list(draw.choice(kinds).items()))
        path = draw.choice(paths)
        table, folder = known[name]
        value: Any = table
        for key in path:
            value = value[key]
        change = draw.choice(
            list(SCALES) if number_of(value) and draw.random() < SCALED else changes(value)
        )
        yield Input(
            f"{name} {'.'.join(map(str, path))} {change}", mutant(table, path, change), folder
        )


SCENE = """[fluid]
name = "user"
density = 1000
bulk_modulus = 2e9
viscosity = 1e-3
[nodes.lake]
type = "reservoir"
head = "50 m"
[nodes.gate]
type = "junction"
[nodes.out]
type = "reservoir"
pressure = "0 barg"
[links.main]
type = "pipe"
from = "lake"
to = "gate"
length = "900 m"
diameter = "300 mm"
wave_speed = "1200 m/s"
cells = 10
[links.valve]
type = "valve"
from = "gate"
to = "out"
area = "0.01 m2"
[numerics]
end = "1 s"
"""
# Units of text that are repeated, with the text before and after them.
REPEATED = {
    "dots of a key": ("", "a.", "a = 1\n"),
    "quoted dots of a key": ("", '"=,".', "a = 1\n"),
    "dots of a header": ("[", "a.", "a]\n"),
    "dots of an inline key": ("x = { ", "a . ", "a = 1 }\n"),
    "brackets": ("a = ", "[", "\n"),
    "closed brackets": ("a = ", "[]", "\n"),
    "braces": ("a = ", "{ a = ", "\n"),
    "headers": ("", "[[a]]\n", ""),
    "unknown keys": ("", "k{n} = 1\n", ""),
    "unknown tables": ("", "[t{n}]\n", ""),
    "unknown keys of a pipe": ("", "[links.main.k{n}]\nx = 1\n", ""),
    "unknown numerics": ("", "k{n} = 1\n", ""),
    "parts": ("", '[nodes.n{n}]\ntype = "junction"\n', ""),
    "unknown parts": ("", '[nodes.n{n}]\ntype = "x"\n', ""),
    "faulty parts": ("", "[nodes.n{n}]\n", ""),
    "loose pipes": ("", '[links.l{n}]\ntype = "pipe"\n', ""),
    "blanks of a claim": ('[expect]\n"max(', " ", 'gate.pressure) " = { value = 1, rtol = 1 }\n'),
    "blanks after a claim": ('[expect]\n"max(gate.pressure', " ", 'x" = { value = 1, rtol = 1 }\n'),
    "claims": ("[expect]\n", '"max(p{n}.pressure)" = { value = 1, rtol = 1 }\n', ""),
    "letters of a claim": ('[expect]\n"', "m", '" = { value = 1, rtol = 1 }\n'),
    "probes": ("[output]\nprobes = [", '"p{n}.pressure", ', "]\n"),
    "probe": ('[output]\nprobes = ["', "a.", '"]\n'),
    "blanks of a probe": ('[output]\nprobes = ["gate.pressure@', " ", 'x"]\n'),
    "blanks of a unit": ('gravity = "9', " ", 'm/s2"\n'),
    "slashes of a unit": ('gravity = "9 m', " / ", 's2"\n'),
    "powers": ('gravity = "9 m', "^9", '"\n'),
    "digits": ("gravity = ", "1", "\n"),
    "hex digits": ("gravity = 0x", "f", "\n"),
    "digits after the point": ("gravity = 9.", "1", "\n"),
    "digits in quotes": ('gravity = "', "1", ' m/s2"\n'),
    "underscores": ("gravity = ", "1_", "1\n"),
    "exponent": ("gravity = 1e", "9", "\n"),
    "zeros": ("gravity = 0.", "0", "1\n"),
    "letters of a name": ('[nodes."', "a", '"]\ntype = "junction"\n'),
    "letters of a key": ("", "a", " = 1\n"),
    "letters of a bare line": ("", "a", "\n"),
    "blanks of a line": ("", " ", "x\n"),
    "tabs of a line": ("", "\t", "= 1\n"),
    "empty lines": ("", "\n", "x\n"),
    "carriage returns": ("", "\r", "x\n"),
    "comments": ("", "# a\n", "x\n"),
    "comment": ("#", "=", "\nx\n"),
    "quotes": ("", '"', "\n"),
    "apostrophes": ("", "'", "\n"),
    "equals": ("", "=", "\n"),
    "escapes": ('title = "', "\\\\", "\n"),
    "open escapes": ('title = "', '\\"', "\n"),
    "title": ('title = "', "a", '"\n'),
    "text of lines": ('title = """', '""a\n', '"""\n'),
    "formula": ('[defaults.pipe]\nlength = "', "1+", '1"\n'),
    "parentheses": ('gravity = "', "(", '"\n'),
    "minus signs": ('gravity = "', "-", '1"\n'),
    "signals": ("", "[signals.s{n}]\ntime = [0, 1]\nvalue = [0, 1]\n", ""),
    "controls": ("", '[controls.c{n}]\ntype = "gain"\ninput = "c{n}"\ngain = 1\n', ""),
    "scalars": ("", "[scalars.s{n}]\n", ""),
    "routes": ("", '[routes.r{n}]\nfrom = "lake"\nto = "gate"\n', ""),
    "schedule": ("[signals.s]\ntime = [", "{n}, ", "]\nvalue = [1]\n"),
    "defaults": ("[defaults.pipe]\n", "k{n} = 1\n", ""),
    "compare": ("", "[[compare]]\n", ""),
    "limits": ("", "[limits.l{n}]\n", ""),
    "dates": ("", "d{n} = 2026-01-01\n", ""),
    "null characters": ("", "\0", "\n"),
    "surrogates": ("", "\\ud800", "\n"),
    "marks": ("", "\ufeff", "\n"),
    "hash signs": ("", "#", "\n"),
    "wide letters": ("", "\N{SNOWMAN}", " = 1\n"),
    "backslashes": ("", "\\", "\n"),
}
SIZES = (1_000, 20_000, 100_000, 1_000_000)  # greatest length of a text [characters]


def repeated(name: str, size: int, before: bool) -> Input:
    """Text with a repeated unit; before : True if it stands before a valid scene, else after it."""
    first, unit, last = REPEATED[name]
    count = size // len(unit)
    middle = (
        "".join(unit.replace("{n}", str(n)) for n in range(count))
        if "{n}" in unit
        else unit * count
    )
    text = first + middle + last
    text = text + SCENE if before else f"{SCENE}{text}"
    return Input(f"text {name} {size} {'before' if before else 'after'}", text=text)


def texts(draw: random.Random, count: int) -> Iterator[Input]:
    """Texts of files: repeated units, noise in a scene, and bytes."""
    every = [
        (name, size, before) for name in REPEATED for size in SIZES for before in (True, False)
    ]
    draw.shuffle(every)
    for n in range(count):
        if n < len(every):
            yield repeated(*every[n])
        elif n % 2:
            at, noise = (
                draw.randrange(len(SCENE)),
                "".join(chr(draw.choice(range(1, 0x2FF))) for _ in range(8)),
            )
            yield Input(
                f"text noise {at} {noise!r}",
                text=SCENE[:at] + noise + SCENE[at + draw.randrange(20) :],
            )
        else:
            content = draw.randbytes(draw.randrange(200))
            yield Input(f"text bytes {content!r}", text=content)
