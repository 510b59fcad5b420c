"""The method `auto` selects explicit or implicit steps by their cost, and reports each choice."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from reference.folders import CASES
from reference.scenes import chamber, lake, pipe, reservoir, scene, tank, valve

import fvsolve

IMPLICIT = ("newton", "ros", "dirk", "irk", "linear_dense", "linear_banded", "linear_sparse")
PROBE = f"""
import json, sys, fvsolve
result = fvsolve.run(json.load(sys.stdin))
print(result.reason, [row["method"] for row in result.summary["methods"]])
print([name for name in {IMPLICIT} if "fvsolve.core.steppers." + name in sys.modules])
"""


@pytest.mark.parametrize(
    "method, loaded", [("auto", []), ("dormand-prince", []), ("rodas-5p", ["newton", "ros"])]
)
def test_a_scene_that_is_not_stiff_stays_explicit_and_imports_nothing_else(method, loaded):
    nodes = {"lake": lake(10.0), "surge": tank(2.0, 12.0)}
    links = {"main": pipe("lake", "surge", 200.0, 0.4, 1000.0, 20)}
    case = json.dumps(scene(nodes, links, 5.0, {"method": method, "rtol": 1e-6, "initial": "rest"}))
    done = subprocess.run(
        [sys.executable, "-c", PROBE], input=case, capture_output=True, text=True, env=os.environ
    )
    reason, found = done.stdout.splitlines()
    assert reason == f"finished ['{'dormand-prince' if method == 'auto' else method}']", done.stderr
    assert all(name in found for name in loaded) and bool(loaded) == (found != "[]")


def servo(**numerics):
    return fvsolve.run(
        CASES / "cylinder-servo.toml", set={f"numerics.{key}": x for key, x in numerics.items()}
    )


def test_it_turns_implicit_where_the_scene_turns_stiff_and_back_where_that_ends():
    """`auto` changes to implicit steps before the spool valve shuts at 95 ms, and back to explicit steps later.

    The rates reach 3e7 1/s while the edges of the valve are shut.
    """
    result = servo(method="auto", rtol=1e-6)
    assert [e for e in result.expectations if not e.ok] == []
    methods = result.summary["methods"]
    assert [row["method"] for row in methods] == ["dormand-prince", "rodas-5p", "dormand-prince"]
    assert methods[0] == {
        "time": 0.0,
        "method": "dormand-prince",
        "why": "until stability limits the explicit steps",
    }
    stiff, calm = methods[1], methods[2]
    assert 0.0 < stiff["time"] < 0.095 < calm["time"] < 0.16
    assert (
        stiff["why"].startswith("stability limited explicit steps to ")
        and "an implicit step costs" in stiff["why"]
    )
    assert calm["why"].startswith("rates of about ") and calm["why"].endswith(" s again")
    assert 0 < result.summary["jacobians"] < result.summary["steps"]
    assert (
        result.summary["steps"] < 0.2 * servo(method="dormand-prince", rtol=1e-6).summary["steps"]
    )


def test_stated_rate_and_step_agree():
    """The reported rate times the reported step of explicit methods is between 0.5 and 10."""
    for case in ("chamber-chain", "pipe-tiny-chamber"):
        result = fvsolve.run(
            CASES / f"{case}.toml", set={"numerics.method": "auto", "numerics.rtol": 1e-6}
        )
        assert [e for e in result.expectations if not e.ok] == []
        why = result.summary["methods"][1]["why"].split()
        rate, step = float(why[why.index("about") + 1]), float(why[why.index("to") + 1])
        assert 0.5 < rate * step < 10.0, case


def thimble(**numerics) -> dict:
    """Case of a small chamber between a pump and a large chamber, with an outlet that shuts from 1 s on."""
    nodes = {
        "pump": reservoir(8e6),
        "pot": chamber(1e-6, 1e6),
        "tub": chamber(0.05, 3e6),
        "out": reservoir(5e5),
    }
    links = {
        "in": valve("pump", "pot", 2e-6),
        "mid": valve("pot", "tub", 4e-6, {"time": [0.0, 1.0, 1.2], "value": [1.0, 1.0, 0.0]}),
        "leak": valve("tub", "out", 1e-7),
    }
    return scene(nodes, links, 2.0, numerics, ["pot.pressure", "tub.pressure"], 0.05)


@pytest.mark.parametrize("rtol, implicit", [(1e-6, "rodas-5p"), (1e-8, "radau-iia-5")])
def test_it_ends_where_a_single_method_does(rtol, implicit):
    auto, fixed = (fvsolve.run(thimble(method=name, rtol=rtol)) for name in ("auto", "rodas-5p"))
    assert auto.ok and [row["method"] for row in auto.summary["methods"]][:2] == [
        "dormand-prince",
        implicit,
    ]
    for name in ("pot.pressure", "tub.pressure"):
        assert auto[name] == pytest.approx(fixed[name], rel=max(1e-6, 10 * rtol))


@pytest.mark.in_turn
@pytest.mark.parametrize("end", [0.6, 2.5])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_a_servo_arm_takes_about_the_steps_of_radau(end, rtol):
    """`auto` needs at most about twice the evaluations of `radau-iia-5` on a servo arm.

    Its hoses carry nearly no flow for seconds, and their law is curved within few pascals of 150 bar.
    """
    arm, found = Path(__file__).parents[1] / "reference" / "servo-arm.toml", {}
    for name in ("auto", "radau-iia-5"):
        keys = {"numerics.method": name, "numerics.rtol": rtol, "numerics.end": end}
        found[name] = fvsolve.run(arm, set=keys)
    auto, radau = (one.summary for one in found.values())
    assert auto["rhs"] + 500 < 2.0 * (radau["rhs"] + 500)
    assert found["auto"]["arm.angle"] == pytest.approx(
        found["radau-iia-5"]["arm.angle"], rel=30 * rtol
    )


def test_auto_goes_by_the_error_even_where_there_are_cells():
    nodes = {"lake": lake(10.0), "surge": tank(2.0, 12.0)}
    case = scene(
        nodes, {"main": pipe("lake", "surge", 200.0, 0.4, 1000.0, 20)}, 1.0, {"method": "auto"}
    )
    assert fvsolve.load(case).numerics.rtol == 1e-6
