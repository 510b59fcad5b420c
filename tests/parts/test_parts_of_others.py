"""Worked example of docs/own-parts.md, run as printed from a package outside fvsolve."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import uuid
from pathlib import Path

import numpy as np
import pytest
from reference.folders import section
from scipy.integrate import solve_ivp

import fvsolve

PAGE = section("own-parts", "A part without a state")
BLOCKS = dict(re.findall(r"`([\w./]+\.\w+)`[^`]*?:\n\n```\w+\n(.*?)```", PAGE, re.DOTALL))
BLOCKS |= dict(re.findall(r"`(test_runner\.py)`.*?```python\n(.*?)```", PAGE, re.DOTALL))
RESISTANCE, LOSS, AREA, LEVEL = 2e6, 4e8, 2.0, 20.0


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """Folder with the case and an installed package `mill` that provides the part `runner`."""
    top = tmp_path_factory.mktemp("mill")
    package = top / "mill" / "runner"
    package.mkdir(parents=True)
    for name in ("part.py", "lower.py", "law.py"):
        (package / name).write_text(BLOCKS[f"runner/{name}"], encoding="utf-8")
    for folder in (package, package.parent):
        (folder / "__init__.py").touch()
    (top / "mill.toml").write_text(BLOCKS["mill.toml"], encoding="utf-8")
    (top / "test_runner.py").write_text(BLOCKS["test_runner.py"], encoding="utf-8")
    offered = tomllib.loads(re.search(r"```toml\n(\[project\.entry.*?)```", PAGE, re.DOTALL)[1])
    facts = top / "mill-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: mill\nVersion: 1.0\n", encoding="utf-8"
    )
    rows = [
        f"{name} = {place}"
        for name, place in offered["project"]["entry-points"]["fvsolve.parts"].items()
    ]
    (facts / "entry_points.txt").write_text(
        "\n".join(["[fvsolve.parts]", *rows, ""]), encoding="utf-8"
    )
    return top


def python(home: Path, *arguments: str, **environment: str) -> str:
    """Standard output of a Python process that can import the package; the process must succeed."""
    paths = [
        str(home),
        str(Path(fvsolve.__file__).parents[1]),
        *filter(None, [os.environ.get("PYTHONPATH")]),
    ]
    known = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "MPLBACKEND": "Agg"} | environment
    done = subprocess.run(
        [sys.executable, *arguments], cwd=home, env=known, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def command(home: Path, *words: str, **environment: str) -> str:
    return python(home, "-m", "fvsolve", *words, **environment)


def flow(level: float, weight: float) -> float:
    """Root of resistance q + loss q^2 = rho g level."""
    return (-RESISTANCE + np.sqrt(RESISTANCE**2 + 4.0 * LOSS * weight * level)) / (2.0 * LOSS)


def test_its_own_test_passes(home):
    assert "1 passed" in python(
        home, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_runner.py"
    )


COMMANDS = """
import contextlib, io, json, sys
from fvsolve.cli import main
found = []
for words in json.loads(sys.argv[1]):
    sys.argv, said, code = ["fvsolve", *words], io.StringIO(), 0
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    found.append((code, said.getvalue()))
print(json.dumps(found))
"""


def test_commands_know_it_like_any_other(home):
    told = python(home, "-m", "fvsolve.case.key_tables", "runner").splitlines()
    assert told[2:] == [
        "| `resistance` | -, above 0 | *needed* | profile | of its gaps [Pa s/m3] |",
        "| `loss` | -, above 0 | *needed* | profile | of its blades [Pa s2/m6] |",
        "| `efficiency` | -, between 0 and 1 | 0.8 | profile | share of its blades that the shaft gets |",
    ]
    several = [["schema"], ["check", "mill.toml"]]
    several += [
        ["check", "mill.toml", "--set", wrong]
        for wrong in ("links.wheel.efficiency=2", 'links.wheel.loss="3 m"')
    ]
    schema, right, *wrong = json.loads(python(home, "-c", COMMANDS, json.dumps(several)))
    assert (
        schema[0] == 0 and "share of its blades that the shaft gets" in schema[1] and right[0] == 0
    )
    assert all(code == 2 for code, _ in wrong)
    assert "links.wheel.efficiency" in wrong[0][1] and "links.wheel.loss" in wrong[1][1]


def test_its_pole_is_that_of_its_law(home):
    """rho A dz/dt = -rho q(z): the pole is -q'(z) / A."""
    command(home, "linearise", "mill.toml", "--out", "linear")
    case = fvsolve.load({**tomllib.loads(BLOCKS["mill.toml"]), "links": {"wheel": VALVE}})
    weight = case.properties.density * case.gravity
    with np.load(home / "linear" / "linear.npz") as file:
        (pole,) = np.linalg.eigvals(file["A"])
    assert pole == pytest.approx(
        -weight / np.sqrt(RESISTANCE**2 + 4.0 * LOSS * weight * LEVEL) / AREA, rel=1e-6
    )


VALVE = {
    "type": "valve",
    "from": "upper",
    "to": "lower",
    "discharge_coefficient": 1.0,
    "area": 1e-3,
}


def test_its_shaft_takes_its_share(home):
    """Energy at the shaft: integral of efficiency loss |q|^3 over the run, by SciPy for the falling level."""
    found = json.loads(command(home, "energy", "mill.toml", "--json"))
    weight = fvsolve.load({**tomllib.loads(BLOCKS["mill.toml"]), "links": {"wheel": VALVE}})
    weight = weight.properties.density * weight.gravity
    rates = lambda t, y: [-flow(y[0], weight) / AREA, 0.8 * LOSS * flow(y[0], weight) ** 3]  # noqa: E731
    exact = solve_ivp(rates, (0.0, 600.0), [LEVEL, 0.0], rtol=1e-11, atol=1e-9).y[1, -1]
    assert found["supplied"]["wheel"] == pytest.approx(-exact, rel=1e-7)
    assert found["relative"] < 1e-10 and found["ok"]


def test_its_order_is_that_of_methods(home):
    told = json.loads(
        command(
            home,
            "order",
            "mill.toml",
            "--json",
            "--levels",
            "4",
            "--method",
            "euler,improved-euler",
        )
    )
    orders = [one["fits"]["upper.level"]["L2"]["order"] for one in told["studies"]]
    assert orders == pytest.approx([1.0, 2.0], abs=0.05)


REVERSED = """
import itertools, fvsolve, numpy as np

def line(law, method, back):
    ends = ("b", "a") if back else ("a", "b")
    pipe = {"type": "pipe", "length": 50.0, "diameter": 0.2, "wave_speed": 1000.0, "cells": 20}
    pipe["friction"] = {"model": "steady", "factor": 0.02}
    head = {"kind": "linear", "time": [0.0, 0.5], "value": [30.0, 5.0]}
    return {
        "fluid": {"name": "water", "temperature": "15 degC", "law": law},
        "nodes": {"up": {"type": "reservoir", "head": head}, "a": {"type": "junction"}, "b": {"type": "junction"},
                  "down": {"type": "reservoir", "head": 10.0}},
        "links": {"p": pipe | {"from": "up", "to": "a"}, "q": pipe | {"from": "b", "to": "down"},
                  "w": {"type": "runner", "from": ends[0], "to": ends[1], "resistance": 2e6, "loss": 4e8}},
        "numerics": {"end": 1.5, "scheme": "upwind", "method": method, "step": 2e-3},
        "output": {"probes": ["w.flow"], "every": 0.05},
    }

for law, method in itertools.product(("linear", "log", "table", "mixture"), ("rk4", "radau-iia-3", "rodas-4")):
    there, back = (fvsolve.run(fvsolve.load(line(law, method, way))) for way in (False, True))
    flow = there["w.flow"]
    assert there.ok and back.ok and flow[0] > 0.01 and flow[-1] < -1e-3, (law, method)
    print(law, method, np.abs(flow + back["w.flow"]).max() / flow.max())
"""


def test_drawn_from_the_other_end_it_carries_as_much_the_other_way(home):
    """Between pipes with reversing flow, both runs agree to rounding; `rodas-4` to that of difference quotients."""
    rows = [row.split() for row in python(home, "-c", REVERSED).splitlines()]
    assert len(rows) == 12
    for law, method, apart in rows:
        rounding = 1.5e-8 if method == "rodas-4" and law != "linear" else 1e-11
        assert float(apart) < rounding, (law, method, apart)


def test_an_edit_of_its_law_counts_and_a_second_start_compiles_nothing(home):
    def least() -> tuple[float, bool]:
        """Least level in a new process, and True if it imports numba, without which nothing is compiled."""
        code = "level = fvsolve.run('mill.toml').summary['extremes']['upper.level']['minimum']"
        code = (
            f"import json, sys, fvsolve; {code}; print(json.dumps([level, 'numba' in sys.modules]))"
        )
        return tuple(json.loads(python(home, "-c", code)))

    (first, _), law = least(), home / "mill" / "runner" / "law.py"
    text = law.read_text(encoding="utf-8")
    edited = text.replace("return copysign(0.5 *", "return copysign(0.25 *")
    try:  # this text is in no cache
        law.write_text(f"{edited}\n# {uuid.uuid4()}\n", encoding="utf-8")
        level, compiled = least()
        assert compiled and level > first + 1.0  # half the flow
        assert least() == (level, False)
    finally:
        law.write_text(text, encoding="utf-8")
    assert least() == (first, False)


def test_a_folder_can_be_named(home):
    """The folder of a part is given by FVSOLVE_PARTS or by `register_part`."""
    bare = home / "alone"
    bare.mkdir()
    (bare / "mill.toml").write_text(BLOCKS["mill.toml"], encoding="utf-8")
    folder = bare / "runner"
    shutil.copytree(home / "mill" / "runner", folder)
    named = 'import fvsolve; fvsolve.register_part("runner"); print(fvsolve.run("mill.toml").ok)'
    paths = {"PYTHONPATH": str(Path(fvsolve.__file__).parents[1])}
    for words, more in (
        (["-c", named], {}),
        (["-m", "fvsolve", "check", "mill.toml"], {"FVSOLVE_PARTS": str(folder)}),
    ):
        done = subprocess.run(
            [sys.executable, *words],
            cwd=bare,
            env=os.environ | paths | more,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
