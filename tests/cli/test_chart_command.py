"""`fvsolve chart`: output, files and refused arguments."""

import csv
import json
import re

import pytest

GIVEN = ["--method", "auto,rodas-5p", "--rtol", "1e-2,1e-4,1e-6"]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out"


def test_a_chart_leaves_table_and_both_pictures_and_states_the_cost_of_the_default(fvs, folder):
    code, said, _ = fvs("chart", "two-tanks", *GIVEN, "--target", "1e-3", "--out", folder)
    assert code == 0
    assert {path.name for path in folder.iterdir()} == {
        "chart.csv",
        "chart.png",
        "chart.svg",
        "points.jsonl",
    }
    assert (folder / "chart.png").read_bytes()[:4] == b"\x89PNG"
    assert "<svg" in (folder / "chart.svg").read_text()
    lines = list(csv.DictReader((folder / "chart.csv").open()))
    # coarser tolerances are added until one of them misses the target
    methods = [line["method"] for line in lines]
    assert {*methods} == {"auto", "rodas-5p"} and min(
        methods.count(name) for name in {*methods}
    ) >= 3
    assert "default: auto" in said
    assert "\nmethod = " in said and "\nrtol = " in said


def test_json_is_a_single_object_with_every_point_unrounded(fvs, folder):
    code, said, _ = fvs("chart", "chamber-and-orifice", *GIVEN, "--json", "--out", folder)
    found = json.loads(said)
    assert code == 0
    assert len(found["points"]) == 6
    assert {"trajectory", "end", "seconds", "rhs", "updates", "ok", "reason"} <= found["points"][
        0
    ].keys()
    assert found["floor"]["trajectory"] > 0.0
    assert found["front"][0]["target"] == 0.1


def test_the_lines_that_are_printed_reach_the_target_when_run(fvs, folder, tmp_path):
    from fvsolve.case import shipped

    code, said, _ = fvs("chart", "two-tanks", *GIVEN, "--target", "1e-4", "--out", folder)
    lines = said.partition("cell_time\n")[2].strip()
    text = shipped.find("two-tanks").read_text()
    for key in ("scheme", "method", "rtol"):
        text = "".join(line for line in text.splitlines(True) if not line.startswith(f"{key} ="))
    file = tmp_path / "pasted.toml"
    file.write_text(text.replace("[numerics]\n", f"[numerics]\n{lines}\n").partition("[expect]")[0])
    code, out, _ = fvs("run", file, "--out", tmp_path / "run", "--json")
    assert code == 0
    # The difference of level is (sqrt(3) - k t)^2 until it is zero, the volume 13.5 m3.
    k = 0.61 * 5e-3 * (9.80665 / 2) ** 0.5 * (1 / 3 + 1 / 1.5)
    rows = list(csv.reader((tmp_path / "run" / "history.csv").open()))
    t = [float(row[0]) for row in rows[1:]]
    high = [float(row[rows[0].index("high.level [m]")]) for row in rows[1:]]
    exact = [3.0 + max(3.0**0.5 - k * x, 0.0) ** 2 / 3 for x in t]
    assert sum(abs(a - b) for a, b in zip(high, exact, strict=True)) / len(t) <= 1e-4 * 1.0


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--cells", "10"], "no pipe"),
        (["--rtol", "1e-3,x"], "--rtol: x is not a number above 0"),
        (["--method", "dormand-prinse"], 'did you mean "dormand-prince"'),
        (["--set", "numerics.rtol=1e-4"], "--set numerics.rtol has no effect"),
        (["--target", "2"], "--target: 2 is not a valid error"),
        (["--target", "-1e-3"], "--target: -0.001 is not a valid error"),
    ],
)
def test_invalid_requests_are_named(fvs, folder, arguments, said):
    code, out, error = fvs("chart", "two-tanks", *arguments, "--out", folder)
    assert (code, out) == (2, "")
    assert said in error


def test_models_of_the_scene_are_charted_too(fvs, folder):
    code, said, _ = fvs("chart", "chamber-and-orifice", "--models", "--target", "0.1")
    assert code == 0
    rows = [line.split() for line in said.splitlines() if line.startswith("as it is")]
    times = {f"as it is, {row[3]}": float(row[-2]) for row in rows}  # [ms]
    name, gain = re.search(r"cheapest within 0.1: (.*), 1 states, (.*) times faster", said).groups()
    assert name == min(times, key=times.get)
    assert float(gain) == pytest.approx(times["as it is, log"] / times[name], rel=0.01)
