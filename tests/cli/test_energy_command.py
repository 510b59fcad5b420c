"""`fvsolve energy`: output, files, JSON and errors; ordinary runs import none of its modules."""

import csv
import json
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
from reference import folders
from reference.scenes import WATER, chamber, junction, lake, pipe, reservoir, scene, tank, valve

from fvsolve.case.text import write

FLUID = {key: value for key, value in WATER.items() if key != "law"}


def hammer() -> dict:
    """Case of a main with friction whose valve closes to 20 %."""
    nodes = {"lake": lake(50.0), "gate": junction(), "air": reservoir("0 barg")}
    main = pipe(
        "lake", "gate", 600.0, 0.3, 1200.0, 20, friction={"model": "steady", "factor": 0.02}
    )
    opening = {"start": 0.1, "duration": 0.5, "value": [1.0, 0.2]}
    links = {"main": main, "tap": valve("gate", "air", 0.61 * 0.002, opening)}
    return scene(
        nodes, links, 2.0, {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}, fluid=FLUID
    )


def joined(one: dict, other: dict, area: float) -> dict:
    """Case of two nodes that a valve joins, without output and numerics of its own."""
    case = scene(
        {"a": one, "b": other}, {"way": valve("a", "b", 0.61 * area)}, 20.0, {}, fluid=FLUID
    )
    return {key: value for key, value in case.items() if key != "output"}


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "hammer.toml"
    path.write_text(write(hammer()))
    return str(path)


@pytest.fixture
def energy_command(monkeypatch, fvs, tmp_path):
    """Function that runs `fvsolve energy` in a temporary folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)
    return partial(fvs, "energy")


def test_the_ledger_is_printed_and_written_row_by_row(energy_command, case, tmp_path):
    code, out, _ = energy_command(case, "--port", "lake")
    assert code == 0
    assert "passive over this run" in out
    assert "the numerical method dissipates energy" in out
    folder = tmp_path / "runs" / "hammer.energy"
    with open(folder / "energy.csv", newline="") as file:
        header, *rows = csv.reader(file)
    table = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    assert header[0] == "t [s]"
    parts = {
        what: sum(one for name, one in table.items() if name.startswith(what + " "))
        for what in ("supplied", "stored", "dissipated", "scheme")
    }
    left = parts["supplied"] - parts["stored"] - parts["dissipated"]
    assert table["remainder [J]"] == pytest.approx(left, abs=1e-9)
    assert table["remainder [J]"] == pytest.approx(parts["scheme"] + table["step [J]"], abs=1e-8)
    assert table["t [s]"][-1] == 2.0
    assert (folder / "energy.png").stat().st_size > 10_000
    assert (folder / "energy.svg").read_text().startswith("<?xml")


def test_its_json_has_exactly_the_documented_keys(energy_command, case):
    code, out, err = energy_command(case, "--json", "--port", "gate")
    said = json.loads(out)
    assert (code, err) == (0, "")
    page = folders.page("energy")
    for key in [*said, *said["port"]]:
        assert f"`{key}`" in page, key
    total = (
        sum(said["supplied"].values())
        - sum(said["stored"].values())
        - sum(said["dissipated"].values())
    )
    assert said["remainder"] == pytest.approx(total, abs=1e-8)
    assert said["port"]["passive"]
    assert set(said["at_start"]) == {"main"}


def test_pairs_are_run_and_tabled(energy_command, case, tmp_path):
    code, out, _ = energy_command(
        case, "--scheme", "upwind,upwind5", "--method", "ssp-rk3,euler", "--json"
    )
    rows = json.loads(out)["pairs"]
    assert code == 0
    assert [(row["scheme"], row["method"]) for row in rows] == [
        ("upwind", "ssp-rk3"),
        ("upwind", "euler"),
        ("upwind5", "ssp-rk3"),
        ("upwind5", "euler"),
    ]
    assert [row["creates"] for row in rows] == [False, False, False, True]
    assert (tmp_path / "runs" / "hammer.energy" / "pairs.csv").read_text().count("\n") == 5
    kept = tmp_path / "runs" / "hammer.energy" / "points.jsonl"
    before = kept.read_text()
    code, out, _ = energy_command(case, "--method", "euler", "--scheme", "upwind5")
    assert kept.read_text() == before
    assert "create energy in this run: upwind5 with euler" in out


def test_without_a_case_it_prints_claims_of_schemes_and_methods(energy_command):
    code, out, _ = energy_command(
        "--scheme", "upwind,fromm,upwind5", "--method", "euler,gauss-4", "--json"
    )
    said = json.loads(out)
    assert code == 0
    assert {one["scheme"]: one["passive"] for one in said["schemes"]} == {
        "upwind": True,
        "fromm": True,
        "upwind5": False,
    }
    code, out, _ = energy_command("--scheme", "upwind,fromm,upwind5", "--method", "euler,gauss-4")
    assert "create energy at every step size: fromm with euler" in out
    assert (
        "schemes that create energy at pipe ends with every method, up to the gain above: upwind5"
        in out
    )


@pytest.mark.parametrize(
    "arguments, fault",
    [
        (["--port", "gat"], 'no port named "gat"'), (["--scheme", "upwnd"], 'did you mean "upwind"'),
        (["--method", "xyz"], "expected euler, improved-euler"), (["--scheme", "quik"], "expected upwind, muscl"),
        (["--method", "rk5"], 'no method named "rk5"'), (["--set", "nodes.lake.hed=3"], "unknown key"),
    ],
)  # fmt: skip
def test_bad_input_is_named(energy_command, case, arguments, fault):
    code, out, err = energy_command(case, *arguments)
    assert code == 2
    assert fault in err
    assert not out


@pytest.fixture
def tanks(tmp_path):
    path = tmp_path / "tanks.toml"
    path.write_text(write(joined(tank(2.0, 3.0), tank(0.7, 0.5), 0.01)))
    return str(path)


def test_methods_that_were_refused_are_given_no_verdict_and_a_way_out_that_works(
    energy_command, tanks
):
    code, out, _ = energy_command(tanks, "--method", "euler,rk4")
    assert code == 2
    assert (
        "weno5 with euler, weno5 with rk4: refused: numerics.method: each estimates no error" in out
    )
    assert "no pair ran, so the creation of energy was not checked" in out
    assert "creates energy in this run" not in out
    way_out = out.partition("--set ")[2].split()[0]
    code, out, _ = energy_command(tanks, "--method", "euler,implicit-euler", "--set", way_out)
    assert code == 0
    assert "create energy in this run: weno5 with euler\n" in out
    code, out, _ = energy_command(tanks, "--method", "euler,auto")
    assert code == 0
    assert 'weno5 with euler: refused: numerics.method: method "euler" estimates no error' in out
    assert "none of the pairs that ran creates energy in this run" in out
    code, out, _ = energy_command(tanks, "--method", "euler", "--json")
    assert code == 2
    assert "estimates no error" in json.loads(out)["pairs"][0]["reason"]


@pytest.mark.parametrize(
    "given", [["--port", "lake"], ["--set", "numerics.end=1"], ["--out", "there"]]
)
def test_options_about_a_run_are_refused_by_name_without_a_case(energy_command, given):
    code, out, err = energy_command(*given)
    assert (code, out) == (2, "")
    assert err.startswith(f"{given[0]}: valid only with a case")


def test_without_a_case_auto_is_described_as_several_methods(energy_command):
    code, _, err = energy_command("--method", "auto")
    assert code == 2
    assert "changes between dormand-prince and rodas-5p (radau-iia-5 below rtol 1e-06);" in err


def test_a_case_without_ports_states_that_it_has_none(energy_command, tanks):
    code, _, err = energy_command(tanks, "--port", "a")
    assert code == 2
    assert err.strip().endswith(
        "expected a reservoir, an inflow or a junction; the case has no such node"
    )


def test_the_residual_of_newton_is_printed_with_the_verdict(energy_command, tmp_path):
    pot = chamber(0.02, "5 barg")
    (tmp_path / "pot.toml").write_text(write(joined(reservoir("50 barg"), pot, 1e-6)))
    # the chamber is full after 2 s
    step = ["--set", "numerics.step=0.01", "--set", "numerics.end=5"]
    code, out, _ = energy_command(
        "pot.toml", "--set", "numerics.method=radau-iia-5", "--set", "numerics.rtol=1e-3"
    )
    assert code == 0
    assert "J, of which Newton residuals cause " in out
    code, out, _ = energy_command("pot.toml", "--set", "numerics.method=gauss-4", *step)
    assert code == 0
    assert "J: rounding" in out
    code, out, _ = energy_command("pot.toml", "--set", "numerics.method=rk4", *step)
    assert "Newton" not in out


@pytest.mark.parametrize(
    "asked, goes_on",
    [(["--set", "numerics.method=rk4"], "the same command starts from the beginning"),
     (["--method", "rk4,heun"], "interrupted after 0 of 2 points; the same command resumes from there")],
)  # fmt: skip
def test_ctrl_c_ends_with_130_and_promises_nothing_that_is_not_there(
    tanks, tmp_path, asked, goes_on
):
    run = [
        sys.executable,
        "-m",
        "fvsolve",
        "energy",
        tanks,
        *asked,
        "--set",
        "numerics.step=1e-5",
        "--set",
        "numerics.end=1e5",
    ]
    left = subprocess.Popen(
        run, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while left.poll() is None and not (tmp_path / "runs" / "tanks.energy").exists():
        time.sleep(0.05)
    time.sleep(0.5)
    left.send_signal(signal.SIGINT)
    out, err = left.communicate(timeout=60)
    assert left.returncode == 130
    assert "--resume" not in out + err
    assert "interrupted" in out + err
    assert goes_on in out + err
    assert not (tmp_path / "runs" / "tanks.energy" / "points.jsonl").exists()


def test_a_run_that_blows_up_is_shown_with_its_created_energy(energy_command, case):
    code, out, _ = energy_command(case, "--set", "numerics.courant=3", "--json")
    said = json.loads(out)
    assert code == 1
    assert "has grown to" in said["reason"]
    assert said["verdict"] == "the numbers create energy"


def test_an_ordinary_run_loads_its_balance_for_the_watch_and_nothing_of_the_command(case):
    found = "[name for name in sys.modules if 'energy' in name and name.startswith('fvsolve')]"
    code = f"import sys, fvsolve; fvsolve.run({case!r}); print(sorted({found}))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    watch = [
        "kernels.energy_rows",
        "kernels.energy_supply",
        "kernels.network_energy",
        "kernels.pipe_energy",
        "model.energy_accounts",
    ]
    assert said.stdout.strip() == str(
        [f"fvsolve.core.{name}" for name in [*watch, "solve.energy_watch"]]
    )
