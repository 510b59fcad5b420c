"""Faults in a block of another package: each is named with its package, file, line and remedy."""

import re
import shutil

import pytest
from reference.outside_packages import install, python

PART = '''"""Peaks."""

from typing import Annotated

from fvsolve.parts.control import SingleInput
from fvsolve.parts.value import Quantity, UsualRange, positive


class Peak(SingleInput, kind="peak"):
    """Greatest sample so far, which decays."""

    same_unit = True
    decay: Annotated[
        float,
        Quantity("time", positive, "decay [s]", usual=UsualRange(1e-3, 1e5, "waves to days")),
    ]

    def faults(self, name, around):
        yield from super().faults(name, around)
        if self.decay < 0.2:
            yield "decay", "is too short"

    def unusual(self):
        if self.decay > 1e3:
            yield ("decay",), self.decay, 1e3, f"{self.decay:g} s hardly decays"
'''
LOWER = '''"""Rows of peaks."""

from fvsolve.features.controls.rows import StaticRows

from . import law


class PeakRows(StaticRows, kind="peak"):
    """A block with a memory."""

    law = law

    def numbers(self, draft, name, block):
        return [block.control.decay]

    def sampled_numbers(self, control):
        return 1

    def value(self, control, start):
        return start.inputs[0]
'''
LAW = '''"""Peak; its number is the time of decay."""

from math import exp

from fvsolve.features.controls.kernels.blocks import input_change
from fvsolve.jit import njit


@njit
def sample(t, y, tables, control):
    memory, first = tables.discrete, control["memory"] + 2
    fade = exp(-control["period"] / tables.floats[control["data"]])
    x = input_change(y, tables, control, 0)
    memory[first] = max(x, x + fade * (memory[first] - x))
    return tables.floats[control["starts"]] + memory[first]
'''
CASE = """
[nodes.source]
type = "reservoir"
pressure = "2 bar"
[nodes.pond]
type = "tank"
area = 1.0
level = 1.0
[links.gate]
type = "valve"
from = "source"
to = "pond"
area = "1 cm2"
discharge_coefficient = 0.6
[controls.top]
type = "peak"
input = "pond.level"
decay = 3
period = 0.5
[fluid]
name = "user"
density = 1000
viscosity = 1e-3
bulk_modulus = 2e9
law = "linear"
[numerics]
end = 4
step = 0.1
method = "rk4"
[output]
every = 0.5
probes = ["pond.level", "controls.top.output"]
"""


def outcome(folder, *command, code=2, case=("", ""), **edits):
    """Result of `fvsolve run` with the edits (old text, new text) of part, lower and law.

    Without a command the case is run with a period; case : edit of the case
    """
    texts = {"part": PART, "lower": LOWER, "law": LAW}
    for name, (old, new) in edits.items():
        assert old in texts[name]
        texts[name] = texts[name].replace(old, new, 1)
    shutil.rmtree(folder / "mill-1.0.dist-info", ignore_errors=True)
    files = {f"mill/peak/{name}.py": text for name, text in texts.items()}
    files |= {"mill/__init__.py": "", "mill/peak/__init__.py": ""}
    install(folder, "mill", files, {"fvsolve.parts": {"peak-of-mine": "mill.peak"}})
    assert case[0] in CASE
    (folder / "case.toml").write_text(CASE.replace(*case, 1), encoding="utf-8")
    return python(folder, "-m", "fvsolve", *(command or ("run", "case.toml")), code=code)


def line_of(text: str, start: str) -> int:
    """Number of the line of a text that begins with `start` after blanks."""
    return next(k for k, line in enumerate(text.splitlines(), 1) if line.strip().startswith(start))


FAULTS = {  # edits -> texts of the message
    "sample under another name": (
        {"law": ("def sample(", "def sampel(")},
        ['unknown function "sampel" of a law; expected one of decide', 'did you mean "sample"?'],
    ),
    "no sample": (
        {"law": ("def sample(", "def _sample(")},
        ['law.py has neither "decide" nor "sample"'],
    ),
    "no period, and no decide": (
        {"case": ("period = 0.5\n", "")},
        ["in controls.top: ", 'has no function "decide"; a block without it needs a `period`'],
    ),
    "states without adapt": (
        {
            "law": ("def sample(", "def decide("),
            "lower": (
                "    def sampled",
                '    def states(self, c):\n        return ("x",)\n\n    def sampled',
            ),
            "case": ("period = 0.5\n", ""),
        },
        ['has no function "adapt", which writes the rates of its states'],
    ),
    "nothing returned": (
        {"law": ("    return tables", "    tables")},
        [
            f"law.py, line {line_of(LAW, 'def sample')}: ",
            'the function "sample" returns nothing; expected its result',
        ],
    ),
    "None returned": (
        {"law": ('return tables.floats[control["starts"]] + memory[first]', "return None")},
        ['the function "sample" returns nothing'],
    ),
    "no decorator": (
        {"law": ("@njit\ndef sample", "def sample")},
        ['the function "sample" has no decorator; expected the decorator `njit` of `fvsolve.jit`'],
    ),
    "hook under another name": (
        {"lower": ("def sampled_numbers", "def sampled_number")},
        [
            f"lower.py, line {line_of(LOWER, 'def sampled_numbers')}: ",
            'fvsolve calls no method "sampled_number"; did you mean "sampled_numbers"?',
        ],
    ),
    "no value": (
        {"lower": ("def value", "def _value")},
        ['lower.py, line 8 has no method "value", which gives the output at the start'],
    ),
    "arguments of value": (
        {"lower": ("def value(self, control, start)", "def value(self, control)")},
        ["value(self, control); expected value(self, control, start)"],
    ),
    "another kind": (
        {"lower": ('kind="peak"', 'kind="peek"')},
        [
            'lower.py declares rows of the kind "peek"; expected a class with kind="peak", as the class Peak'
        ],
    ),
    "no law": (
        {"lower": ("    law = law\n", "")},
        ["lower.py, line 8: a block has no law; expected `law = law`"],
    ),
}


@pytest.mark.parametrize("name", [*FAULTS])
def test_a_fault_of_the_package_is_named_before_the_run(name, tmp_path):
    edits, texts = FAULTS[name]
    done = outcome(tmp_path, **edits)
    assert done.stderr.startswith("the part peak-of-mine of the package mill")
    assert [text for text in texts if text not in done.stderr] == [], done.stderr
    assert "report" not in done.stderr


def test_other_arguments_of_a_method_of_a_block_are_named_where_the_package_is_read(tmp_path):
    done = outcome(tmp_path, part=("def faults(self, name, around)", "def faults(self, name)"))
    assert f"part.py, line {line_of(PART, 'def faults')}: " in done.stderr
    assert "faults(self, name); expected faults(self, name, around)" in done.stderr


@pytest.mark.parametrize("name", ["fade_", "memory.size_"])
def test_an_unknown_name_in_a_law_is_reported_with_its_line(name, tmp_path):
    done = outcome(tmp_path, code=1, law=("fade *", f"{name} *"))
    assert re.match("the part peak-of-mine of the package mill failed at .*mill.peak", done.stderr)
    assert f"law.py, line {line_of(LAW, 'memory[first] =')}: " in done.stderr, done.stderr
    assert name.rpartition(".")[2] in done.stderr
    assert done.stderr.endswith("\nCorrect it, or remove the package.\n")


def test_a_fault_with_a_text_as_its_place_has_this_key(tmp_path):
    done = outcome(tmp_path, case=("decay = 3", "decay = 0.1"))
    assert "controls.top.decay: is too short" in done.stderr


NOTES = {
    "usual range": (("decay = 3", "decay = 2e6"), "controls.top.decay: 2e+06 s is outside"),
    "unusual": (("decay = 3", "decay = 2e3"), "controls.top.decay: 2000 s hardly decays"),
    "one sample": (("period = 0.5", "period = 9"), "controls.top.period: 9 s gives one sample"),
    "no sample": (
        ("period = 0.5", "period = 9\noffset = 5"),
        "controls.top.period: 9 s gives no sample in a run of 4 s",
    ),
}


@pytest.mark.parametrize("name", [*NOTES])
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_value_that_is_not_plausible_gets_a_note(command, name, tmp_path):
    edit, text = NOTES[name]
    done = outcome(tmp_path, command, "case.toml", code=0, case=edit)
    assert text in done.stdout + done.stderr


def test_a_run_continues_only_with_its_first_law(tmp_path):
    first = ("run", "case.toml", "--out", "whole")
    further = (*first, "--resume", "--set", "numerics.end=6")
    outcome(tmp_path, *first, code=0)
    changed = outcome(tmp_path, *further, law=("max(x, x + fade", "max(x, x + 0.5 * fade"))
    assert "part peak" in changed.stderr
    outcome(tmp_path, *further, code=0)


def test_inputs_of_a_block_with_same_unit_have_the_unit_of_the_first(tmp_path):
    """The median of a level and a flow would be a number without a meaning."""
    keys = "\n".join(
        f'    {key}: Annotated[str, Text("probe")]' for key in ("first", "second", "third")
    )
    part = (
        "class Peak(SingleInput, kind",
        f'''class Median(Control, kind="median"):
    """Median of three inputs."""

    same_unit = True

{keys}

    @classmethod
    def inputs_of(cls, given):
        return {{(key,): given[key] for key in ("first", "second", "third")}}


class Peak(SingleInput, kind''',
    )
    imports = ("import SingleInput\n", "import Control, SingleInput\n")
    case = (
        "[fluid]",
        '[controls.middle]\ntype = "median"\nfirst = "pond.level"\nsecond = "gate.flow"\n'
        'third = "controls.top"\n[fluid]',
    )
    text = PART.replace(*imports).replace("import Quantity,", "import Quantity, Text,")
    done = outcome(tmp_path, case=case, part=(PART, text.replace(*part)))
    assert "controls.middle.second: is a flow, but the first input is a" in done.stderr, done.stderr
    assert "middle.third" not in done.stderr
