"""Faults in a part of another package: each is named with its package, file, line and remedy."""

import re

import pytest
from reference.outside_packages import install, python

PART = '''"""A rigid tube."""

from typing import Annotated

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.value import Number, positive


class Tube(TwoPort, kind="tube"):
    """I dM/dt = p1 - p2. Ports: from, to. Stored energy: I M^2 / (2 rho)."""

    quantities = {"flow": "flow", "mass_flow": "mass flow"}
    inertia: Annotated[float, Number(positive, "length over area [1/m]")]
'''
LOWER = '''"""Rows of tubes."""

from fvsolve.core.assembly.lowering import Device

from . import law


class TubeRows(Device, kind="tube"):
    """A restriction whose flow is a state."""

    law = law
    states = ("flow",)

    def restriction(self, draft, name, link, row):
        row["conductance"] = 1.0

    def numbers(self, draft, name, link):
        return [link.inertia]

    def scales(self, draft, name, link):
        return [1.0]

    def edge(self, start, k):
        return None

    def follow(self, start, k):
        pass
'''
LAW = '''"""Flow of a tube; its number is the inertia."""

from fvsolve.jit import njit


@njit
def set(t, y, out, tables, device):
    k = device["valve"]
    out[tables.layout[0]["conductance"] + k] = 1.0
    out[tables.layout[0]["drive"] + k] = tables.valves[k]["flow"] + y[device["y"]]


@njit
def move(t, y, dydt, out, tables, device):
    valve, first = tables.valves[device["valve"]], tables.layout[0]["pressure"]
    change = out[first + valve["from_node"]] - out[first + valve["to_node"]]
    dydt[device["y"]] = (valve["drop"] + change) / tables.floats[device["data"]]


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    return out[tables.layout[0]["drive"] + k] - m, 0.0


@njit
def slope(out, tables, k, g, drop):
    return 0.0


@njit
def value(t, y, out, tables, device, quantity):
    return tables.valves[device["valve"]]["flow"] + y[device["y"]]
'''
CASE = """
[fluid]
name = "user"
density = 1000
bulk_modulus = "2.2 GPa"
viscosity = "1 cSt"

[nodes.upper]
type = "tank"
area = "2 m2"
level = "5 m"

[nodes.lower]
type = "tank"
area = "1 m2"
level = "3 m"

[links.joint]
type = "tube"
from = "upper"
to = "lower"
inertia = 2000.0

[numerics]
end = "1 s"
method = "rk4"
step = "0.1 s"
initial = "rest"

[output]
probes = ["joint.flow", "joint.mass_flow"]
"""
FILES = {"part": PART, "lower": LOWER, "law": LAW}


def outcome(top, command="check", group="fvsolve.parts", code=2, **edits):
    """Standard error of a command for a case with the part; edits : module -> text that is replaced, and its value."""
    files = {"mill/__init__.py": "", "mill/tube/__init__.py": "", "pond.toml": CASE}
    for name, text in FILES.items():
        old, new = edits.pop(name, ("", ""))
        assert old in text
        files[f"mill/tube/{name}.py"] = text.replace(old, new) if old else text
    assert not edits
    home = install(top, "mill", files, {group: {"pipe-of-mine": "mill.tube"}})
    words = ["run", "pond.toml", "--out", "out"] if command == "run" else [command, "pond.toml"]
    return python(home, "-m", "fvsolve", *words, code=code)


def line_of(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def test_quantities_of_lower_follow_from_the_part(tmp_path):
    """The flow is a volume flow, and the own quantity is the value of the law: they differ by the density."""
    done = outcome(tmp_path, "run", code=0)
    rows = (tmp_path / "out" / "history.csv").read_text("utf-8").splitlines()
    t, flow, mass_flow = (float(value) for value in rows[-1].split(","))
    assert mass_flow == pytest.approx(1000.0 * flow, rel=1e-12) and flow > 0.005, done.stdout


SAME_NAMES = {  # edits -> text of the message
    "quantities in lower.py without those of part.py": (
        {"lower": ('    states = ("flow",)', '    states = ("flow",)\n    quantities = ("head",)')},
        ['unknown quantity "head"', 'the quantity "mass_flow" of part.py has no value', "lower.py"],
    ),
    "no value": (
        {"law": ("def value(", "def _value(")},
        ['the quantity "mass_flow" of part.py has no value; expected', 'a function "value"'],
    ),
    "no device": (
        {"lower": ("Device", "Restriction")},
        ['the quantity "mass_flow" of part.py has no value; expected a class derived from Device'],
    ),
}
FAULTS = SAME_NAMES | {
    "no scales": (
        {"lower": ("def scales", "def sizes")},
        [
            "in joint: ",
            "lower.py, line 8: ",
            '`scales` gives 0 numbers for the states "flow"; expected',
            "a number above 0 for each state",
        ],
    ),
    "two scales": (
        {"lower": ("return [1.0]", "return [1.0, 2.0]")},
        [
            '`scales` gives 2 numbers for the states "flow"; expected a number above 0 for each state'
        ],
    ),
    "scale 0": (
        {"lower": ("return [1.0]", "return [0.0]")},
        ['`scales` gives 0.0 for the state "flow"; expected a number above 0'],
    ),
    "scale below 0": (
        {"lower": ("return [1.0]", "return [-1.0]")},
        ['`scales` gives -1.0 for the state "flow"; expected a number above 0'],
    ),
    "scale not finite": (
        {"lower": ("return [1.0]", 'return [float("nan")]')},
        ['`scales` gives nan for the state "flow"; expected a number above 0'],
    ),
    "set under another name": (
        {"law": ("def set(", "def sets(")},
        [
            f"law.py, line {line_of(LAW, 'def set')}: ",
            'unknown function "sets" of a law; expected one of set, move, ',
        ],
    ),
    "move under another name": (
        {"law": ("def move(", "def moves(")},
        ['or a name that begins with "_"; did you mean "move"?'],
    ),
    "no move": (
        {"law": ("def move(", "def _move(")},
        [
            'it has the states "flow", but its law',
            'law.py has no function "move", which writes their rates',
        ],
    ),
    "no decorator": (
        {"law": ("@njit\ndef slope", "def slope")},
        [
            f"law.py, line {line_of(LAW, 'def slope') - 1}: ",
            'the function "slope" has no decorator; expected the decorator `njit` of `fvsolve.jit`',
        ],
    ),
    "decorator of numba": (
        {"law": ("from fvsolve.jit import", "from numba import")},
        [
            'law.py, line 7: the function "set" has numba.njit; expected the decorator `njit` of `fvsolve.jit`'
        ],
    ),
    "another kind": (
        {"lower": ('kind="tube"', 'kind="tub"')},
        [
            'lower.py declares rows of the kind "tub"; expected a class with kind="tube", as the class Tube'
        ],
    ),
    "no kind": (
        {"lower": (', kind="tube"', "")},
        ['lower.py declares no rows; expected a class with kind="tube", as the class Tube'],
    ),
    "no law": (
        {"lower": ("    law = law\n", "")},
        ["lower.py, line 8: a device has no law; expected `law = law`"],
    ),
}


@pytest.mark.parametrize("name", [*FAULTS])
def test_a_fault_of_the_package_is_named_before_the_run(name, tmp_path):
    edits, texts = FAULTS[name]
    done = outcome(tmp_path, **edits)
    assert done.stderr.startswith("the part pipe-of-mine of the package mill")
    assert [text for text in texts if text not in done.stderr] == [], done.stderr
    assert "report" not in done.stderr


FAILURES = {
    "column in law.py": (
        {"law": ('valve["drop"]', 'valve["droop"]')},
        (
            f"law.py, line {line_of(LAW, 'dydt[device')}: ",
            'unknown column "droop"; did you mean "drop"?',
        ),
    ),
    "column in lower.py": (
        {"lower": ('row["conductance"]', 'row["condutance"]')},
        (
            f"lower.py, line {line_of(LOWER, 'row[')}: ",
            'unknown column "condutance"; did you mean "conductance"?',
        ),
    ),
    "name in law.py": (
        {"law": ("tables.valves[k]", "tables.valve[k]")},
        ("law.py, line 10: ", "valve"),
    ),
    "attribute in lower.py": (
        {"lower": ("link.inertia", "link.mass")},
        ("lower.py, line 18: ", "AttributeError: 'Tube' object has no attribute 'mass'"),
    ),
}


@pytest.mark.parametrize("name", [*FAILURES])
def test_an_error_in_a_module_of_the_package_is_reported_to_its_user(name, tmp_path):
    edits, texts = FAILURES[name]
    done = outcome(tmp_path, "run", code=1, **edits)
    assert re.match("the part pipe-of-mine of the package mill failed at .*mill.tube.", done.stderr)
    assert [text for text in texts if text not in done.stderr] == [], done.stderr
    assert done.stderr.endswith("\nCorrect it, or remove the package.\n")


def test_an_unknown_dimension_of_a_quantity_is_named(tmp_path):
    done = outcome(tmp_path, part=('"mass flow"', '"mass-flow"'))
    fault = (
        "pipe-of-mine of the entry points fvsolve.parts of mill: mill.tube cannot be read: mill.tube.part.Tube: the "
        'quantity "mass_flow" has the unknown dimension "mass-flow"; did you mean "mass flow"?; correct or remove it'
    )
    assert done.stderr.count(fault) == 1


def test_an_unknown_group_of_entry_points_is_named_once(tmp_path):
    done = outcome(tmp_path, group="fvsolve.part")
    fault = 'unknown group of entry points fvsolve.part of mill; did you mean "fvsolve.parts"?'
    assert done.stderr.count(fault) == 1
