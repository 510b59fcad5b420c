"""Printed numbers are in the units of `[output]`: for each command, the SI numbers converted."""

import re

import pytest
from reference.scenes import junction, lake, pipe, ramp, reservoir, scene, valve

from fvsolve.case import load
from fvsolve.cli.linear_commands import output_unit
from fvsolve.studies import response

UNITS = {
    "pressure": "bar",
    "flow": "l/s",
    "head": "mm",
    "length": "km",
    "energy": "kJ",
    "time": "ms",
    "velocity": "cm/s",
}


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """Files of a main with a closing valve, with output in SI and in other units."""
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 5),
        "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 2.0, 1.0, 0.0)),
    }
    nodes = {"top": lake(45.0), "gate": junction(), "outfall": reservoir("0 barg")}
    numerics = {"scheme": "upwind", "method": "ssp-rk2", "courant": 0.9}
    high = {"high": {"on": "main", "quantity": "pressure", "maximum": "9 bar"}}
    made, folder = (
        scene(nodes, links, 4.0, numerics, ["gate.pressure", "valve.flow"], 0.05, limits=high),
        [],
    )
    for name, units in (("si", {}), ("own", UNITS)):
        folder.append(tmp_path_factory.mktemp(name) / "main.toml")
        folder[-1].write_text(load(made, {"output.units": units}).resolved(), encoding="utf-8")
    return folder


ASKED = {
    "energy": ("--port", "gate"),
    "order": ("--levels", "3", "--cells", "5"),
    "response": ("--port", "top"),
    "optimise": (
        "--schedule",
        "links.valve.opening",
        "--minimise",
        "max(gate.pressure)",
        "--knots",
        "1",
        "--runs",
        "9",
    ),
    "size": ("--vary", "links.valve.area=0.0009,0.001", "--goal", "maximum"),
    "sweep": ("--set", "links.main.length=900,950"),
    "check": ("--set", "numerics.end=2"),
}
# command, pattern of a printed number and unit, SI unit, other unit, and conversion factor
TOLD = [
    ("energy", r"energy \[(?P<unit>.*?)\].*?supplied +top +(?P<number>\S+)", "J", "kJ", 1e-3),
    ("energy", r"energy throughput (?P<number>\S+) (?P<unit>\w+):", "J", "kJ", 1e-3),
    ("energy", r"least margin (?P<number>\S+) (?P<unit>\w+) at", "J", "kJ", 1e-3),
    ("energy", r"finished at t = (?P<number>\S+) (?P<unit>\w+);", "s", "ms", 1e3),
    (
        "order",
        r"pressure \[(?P<unit>.*?)\] at the end.*?\n +5 +\S+ +(?P<number>\S+)",
        "Pa",
        "bar",
        1e-5,
    ),
    (
        "order",
        r"flow \[(?P<unit>.*?)\] at the end.*?\n +5 +\S+ +(?P<number>\S+)",
        "m3/s",
        "l/s",
        1e3,
    ),
    ("optimise", r"linear (?P<number>\S+) (?P<unit>\w+), best", "Pa", "bar", 1e-5),
    ("optimise", r"t \[(?P<unit>\w+)\].*?\n.*?\n +(?P<number>\S+)", "s", "ms", 1e3),
    (
        "response",
        r"over pressure \[(?P<unit>.*?)\]; (?P<number>10) states",
        "m3/s/Pa",
        "l/s/bar",
        1.0,
    ),
    ("size", r"links.valve.area \[(?P<unit>.*?)\].*?\n +(?P<number>\S+)", "m2", "m2", 1.0),
    ("sweep", r"links.main.length \[(?P<unit>.*?)\].*?\n +(?P<number>\S+)", "m", "m", 1.0),
    ("check", r"links.valve.opening: continues to (?P<number>\S+) (?P<unit>\w+),", "s", "ms", 1e3),
    ("check", r"step at the start (?P<number>\S+) (?P<unit>\w+),", "s", "ms", 1e3),
]


@pytest.fixture(scope="module")
def printed(cases):
    """Output of each command by case, which the tests fill."""
    return {}


@pytest.mark.parametrize("command, pattern, si, own, size", TOLD)
def test_a_number_is_printed_in_the_requested_unit(
    command, pattern, si, own, size, cases, printed, fvs
):
    if command not in printed:
        out = [] if command in ("optimise", "size", "check") else ["--out"]
        said = [
            fvs(command, path, *ASKED[command], *out, *([path.parent / command] * len(out)))
            for path in cases
        ]
        assert [code for code, _, _ in said] == [0, 0], said
        printed[command] = [text for _, text, _ in said]
    one, other = (re.search(pattern, text, re.DOTALL) for text in printed[command])
    assert (one["unit"], other["unit"]) == (si, own)
    assert float(other["number"]) == pytest.approx(size * float(one["number"]), rel=1e-3)


def test_a_response_is_drawn_in_the_unit_that_stands_at_it(cases):
    found = [response(load(path), "top") for path in cases]
    sizes = [output_unit(load(path), one) for path, one in zip(cases, found, strict=True)]
    assert sizes[0] == (1.0, "m3/s/Pa") and sizes[1] == (pytest.approx(1e8), "l/s/bar")
    inner = response(load(cases[1]), "gate")
    assert output_unit(load(cases[1]), inner) == (pytest.approx(1e-8), "bar/(l/s)")


def test_a_number_without_a_unit_is_sized_without_a_unit(fvs, cases):
    code, out, _ = fvs(
        "size", cases[0], "--vary", "links.valve.discharge_coefficient=0.5,0.6", "--goal", "maximum"
    )
    assert code == 0 and out.startswith("links.valve.discharge_coefficient  ") and "[" not in out
