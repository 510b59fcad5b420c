"""Command line: tables for readers, JSON for programs, messages and exit codes, never a traceback."""

import contextlib
import importlib.util
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import fvsolve

CASE = """
title = "A valve shuts"
[fluid]
name = "user"
density = 1000.0
bulk_modulus = 2.2e9
viscosity = 1e-3
vapor_pressure = 2300.0
[nodes.lake]
type = "reservoir"
head = 50.0
[nodes.gate]
type = "junction"
[nodes.air]
type = "reservoir"
pressure = "0 barg"
[links.main]
type = "pipe"
from = "lake"
to = "gate"
length = "600 m"
diameter = "300 mm"
wave_speed = 1200.0
cells = 20
[links.valve]
type = "valve"
from = "gate"
to = "air"
area = 0.002
opening = { time = [0.1, 0.2], value = [1.0, 0.0] }
[numerics]
end = 2.0
scheme = "muscl"
method = "ssp-rk2"
courant = 0.8
[output]
every = 0.01
fields = 4
probes = ["gate.pressure", "valve.flow"]
[expect]
"min(valve.flow)" = { value = 0.0, atol = 1e-9 }
"""


@pytest.fixture
def case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shut.toml").write_text(CASE)
    return "shut.toml"


def test_run_prints_the_extremes_the_claims_and_the_files(case, fvs):
    code, out, err = fvs("run", case)
    assert code == 0 and err == ""
    assert "A valve shuts" in out and "gate.pressure" in out and "holds: min(valve.flow)" in out
    assert "mass ledger" in out and "finished at t = 2 s" in out
    assert "runs/shut" in out.replace("\\", "/") and "history.csv" in out
    assert fvsolve.open_run("runs/shut").ok


def test_json_is_a_single_object_with_unrounded_numbers(case, fvs):
    code, out, err = fvs("run", case, "--json", "--out", "there")
    said = json.loads(out)
    assert code == 0 and err == ""
    assert said["reason"] == "finished" and Path(said["directory"]) == Path("there")
    assert (
        said["extremes"]["gate.pressure"]["maximum"]
        == fvsolve.open_run("there").extremes["gate.pressure"][2]
    )


def test_several_cases_go_to_directories_of_their_own(case, fvs):
    Path("other.toml").write_text(CASE)
    code, out, _ = fvs("run", case, "other.toml", "--out", "both", "--json")
    assert code == 0 and len(json.loads(out)["runs"]) == 2
    assert {path.name for path in Path("both").iterdir()} == {"shut", "other"}


@pytest.mark.parametrize("options", [("--out", "both"), ("--out", "both", "--force"), ()])
def test_cases_that_would_write_to_the_same_directory_are_refused_before_any_runs(
    case, fvs, options
):
    for folder in ("n1", "n2"):
        Path(folder).mkdir()
        Path(folder, "main.toml").write_text(CASE)
    one, two = str(Path("n1", "main.toml")), str(Path("n2", "main.toml"))
    code, out, err = fvs("run", case, one, two, *options)
    place = Path("both" if options else "runs", "main")
    assert code == 2 and out == ""
    assert f"{one} and {two} would both write {place}" in err and "--out DIR" in err
    assert not Path("both").exists() and not Path("runs").exists()
    code, _, err = fvs("run", case, case, *options)
    assert code == 2 and "shut.toml is named twice" in err


def test_set_overrides_any_key(case, fvs):
    settings = [
        "links.main.cells=7",
        "links.main.length=500 m",
        'links.main.friction={ model = "none" }',
    ]
    code, out, _ = fvs("run", case, "--json", *(f"--set={one}" for one in settings))
    assert code == 0 and json.loads(out)["cells"] == 7
    written = fvsolve.load("runs/shut/case.toml")
    assert written.links["main"].length == 500.0 and written.links["main"].friction.model == "none"


def test_set_without_a_value_names_the_expected_form(case, fvs):
    code, out, err = fvs("run", case, "--set", "links.main.cells")
    assert code == 2 and out == "" and "expected KEY=VALUE" in err


def test_all_bad_settings_are_reported_at_once(case, fvs):
    settings = ["nope", "links.mian.cells=4", "=3", "numeric.end=4", "links.main.cells=many"]
    code, out, err = fvs("check", case, *(f"--set={one}" for one in settings))
    assert code == 2 and out == "" and "shut.toml: 5 faults" in err
    assert err.count("expected KEY=VALUE") == 2
    for key in (
        "--set nope",
        "--set =3",
        "--set links.mian.cells",
        "--set numeric",
        "--set links.main.cells",
    ):
        assert f"  {key}: " in err
    code, _, err = fvs("check", case, "--set", "nope")
    assert code == 2 and "shut.toml: 1 fault\n  --set nope: expected KEY=VALUE" in err


def test_a_case_that_cannot_start_names_the_place(case, fvs):
    line = CASE.splitlines().index("[links.main]") + 1
    for command in ("run", "check"):
        code, out, err = fvs(
            command, case, "--set", "nodes.gate.type=reservoir", "--set", "nodes.gate.head=1 m"
        )
        assert code == 2 and out == ""
        assert (
            f"shut.toml: 1 fault\n  line {line}: links.main: no steady state: this pipe has no friction"
            in err
        )
    assert not Path("runs").exists()


def test_a_bad_case_is_a_message_and_exit_code_2(case, fvs):
    Path(case).write_text(CASE.replace("opening", "openning").replace('"300 mm"', '"300 kg"'))
    code, out, err = fvs("run", case)
    assert code == 2 and out == ""
    assert "shut.toml: 2 faults" in err and 'did you mean "opening"' in err
    assert not Path("runs").exists()


def test_an_earlier_run_is_in_the_way(case, fvs):
    assert fvs("run", case)[0] == 0
    code, _, err = fvs("run", case)
    assert code == 2 and "--force" in err
    assert fvs("run", case, "--force")[0] == 0
    assert fvs("run", case, "--resume")[0] == 0  # a complete run has nothing to resume


def test_a_claim_that_fails_is_exit_code_1(case, fvs):
    code, out, _ = fvs(
        "run", case, "--set", 'expect={ "max(valve.flow)" = { value = 1.0, rtol = 1e-3 } }'
    )
    assert code == 1 and "FAILS: max(valve.flow)" in out


def test_a_run_that_stops_early_is_exit_code_1(case, fvs):
    code, out, _ = fvs("run", case, "--set", "numerics.courant=5", "--set", "numerics.end=60")
    assert code == 1 and "stopped" in out


def test_a_missing_file_is_named_and_a_near_case_suggested(case, fvs):
    code, _, err = fvs("run", "nowhere.toml")
    assert code == 2 and "nowhere.toml" in err
    name = json.loads(fvs("list", "--json")[1]).popitem()[0]
    code, _, err = fvs("run", name[:-1])
    assert code == 2 and f'did you mean "{name}"' in err


def test_check_shows_the_interpretation(case, fvs):
    code, out, _ = fvs("check", case)
    assert code == 0
    assert all(word in out for word in ("main", "1200", "lake", "gate", "Reynolds", "step"))
    said = json.loads(fvs("check", case, "--json")[1])
    assert said["pipes"]["main"]["cells"] == 20
    assert not Path("runs").exists()


def test_list_names_every_shipped_case_with_its_title(fvs):
    titles = json.loads(fvs("list", "--json")[1])
    code, out, _ = fvs("list")
    assert code == 0 and titles
    assert all(name in out and title for name, title in titles.items())


def test_new_copies_a_case_that_runs_and_never_overwrites(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in json.loads(fvs("list", "--json")[1]):
        code, out, _ = fvs("new", name)
        assert code == 0 and out.splitlines()[0] == f"{name}.toml"
        assert fvsolve.load(tmp_path / f"{name}.toml").title
    code, _, err = fvs("new", name)
    assert code == 2 and "exists" in err


def test_schema_is_json(fvs):
    code, out, _ = fvs("schema")
    assert code == 0 and json.loads(out)["properties"]["nodes"]


def test_compare_gives_differences_per_shared_probe(case, fvs):
    fvs("run", case, "--out", "a")
    fvs("run", case, "--out", "b", "--set", "links.main.cells=40")
    code, out, _ = fvs("compare", "a", "b", "--json")
    one = json.loads(out)["probes"]["gate.pressure"]
    a, b = (fvsolve.open_run(name)["gate.pressure"] for name in "ab")
    assert code == 0 and abs(one["greatest"]) == max(abs(b - a)) > 0.0
    code, out, _ = fvs("compare", "a", "a")
    assert code == 0 and "gate.pressure" in out


def test_view_draws_a_frame(case, fvs):
    fvs("run", case)
    code, out, err = fvs("view", "runs/shut", "--time", "1 s", "--field", "head")
    if "OpenGL" in err:
        pytest.skip(err)
    assert code == 0 and Path(out.strip()).read_bytes().startswith(b"\x89PNG")
    code, _, err = fvs("view", "runs/shut", "--field", "presure")
    assert code == 2 and 'did you mean "pressure"' in err


def test_a_warm_run_imports_neither_numba_nor_coolprop_nor_pyvista_nor_pint(case, fvs):
    fvs("run", case)
    code = (
        "import sys; from fvsolve.cli import main\n"
        "sys.argv = ['fvsolve', 'run', 'shut.toml', '--force']\n"
        "try: main()\n"
        "except SystemExit as left: assert not left.code\n"
        "heavy = ('numba', 'CoolProp', 'pyvista', 'vtkmodules', 'pint', 'scipy', 'pandas', 'matplotlib')\n"
        "print(*[name for name in heavy if name in sys.modules], file=sys.stderr)"
    )
    Path("warm.py").write_text(code)
    done = subprocess.run([sys.executable, "warm.py"], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == ""


LOST = "raise ModuleNotFoundError(f'No module named {__name__!r}', name=__name__)\n"
WITHOUT_PYVISTA = """
import contextlib, io, json, sys
from fvsolve.cli import main
results = []
for line in sys.argv[1:]:
    sys.argv, out, err = ["fvsolve", *line.split()], io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try: main()
        except SystemExit as left: code = left.code or 0
        else: code = 0
    results.append((code, out.getvalue(), err.getvalue()))
print(json.dumps(results))
"""


def test_only_pictures_of_basins_and_bodies_need_pyvista(case, tmp_path):
    """Modules that cannot be imported take the place of PyVista and VTK, also in processes that draw."""
    lost = tmp_path / "lost"  # not the present folder, whose modules no process imports
    lost.mkdir()
    for name in ("pyvista", "vtk", "vtkmodules"):
        (lost / f"{name}.py").write_text(LOST)
    commands = [
        f"run {case} --set output.fields=2",
        "view runs/shut --field head",
        f"order {case} --levels 2 --cells 5 --out order",
        "run dam-break --set nodes.tank.cells=[20,5] --set output.fields=1",
        "view runs/dam-break",
    ]
    commands += ["report runs/shut"] if importlib.util.find_spec("plotly") else []
    search = os.pathsep.join([str(lost), str(Path(fvsolve.__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_PYVISTA, *commands],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": search},
    )
    results = json.loads(done.stdout)
    # 1: few cells miss claims
    assert [code for code, _, _ in results] == [0, 0, 0, 1, 2, 0][: len(commands)], results
    message = results[4][2]
    assert (
        message.count("\n") == 1
        and "No module named 'pyvista'" in message
        and "pip install pyvista" in message
    )
    for name in (
        "shut/view-head.png",
        "shut/history.png",
        "shut/envelope.csv",
        "dam-break/history.png",
    ):
        assert Path("runs", name).stat().st_size
    assert (
        len(list(Path("runs/dam-break/fields").glob("*.vtu"))) == 2
        and Path("order/order.png").exists()
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C cannot be sent to one process there")
def test_ctrl_c_ends_a_run_cleanly_and_resume_goes_on(case):
    settings = ["--set", "output.fields=0", "--set", "output.every=1", "--set"]
    command = [sys.executable, "-m", "fvsolve", "run", case, *settings]
    running = subprocess.Popen(
        [*command, "numerics.end=1e6"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    wait_for_a_checkpoint(Path("runs/shut/restart.npz"), running)
    running.send_signal(signal.SIGINT)
    out, err = (text.decode() for text in running.communicate(timeout=30))
    assert running.returncode == 130, err
    assert "interrupted" in out and "--resume" in out and "Traceback" not in err
    stopped = fvsolve.open_run("runs/shut")
    assert not stopped.ok and 0.0 < stopped.summary["t"] < 1e6
    end = f"numerics.end={stopped.summary['t'] + 10.0}"
    assert subprocess.run([*command, end, "--resume"], capture_output=True).returncode == 0
    assert fvsolve.open_run("runs/shut").ok


def wait_for_a_checkpoint(path: Path, running: subprocess.Popen) -> None:
    """Wait until the first checkpoint is replaced; fail if the process ends before."""
    first = None
    while first is None or path.stat().st_mtime_ns == first:
        if first is None and path.exists():
            first = path.stat().st_mtime_ns
        assert running.poll() is None, running.communicate()
        time.sleep(0.01)


def test_an_epanet_file_is_distinguished_from_a_case(fvs, tmp_path):
    path = tmp_path / "pump.inp"
    path.write_text("[TITLE]\nA town\n\n[JUNCTIONS]\na 10 5\n[END]\n")
    for command in ("run", "check"):
        code, _, err = fvs(command, path)
        said = " ".join(err.split())
        assert code == 2 and "an EPANET network" in said and "fvsolve import" in said


def test_a_case_is_copied_next_to_its_mesh_and_another_mesh_stays(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert fvs("new", "flooding", "one.toml")[0] == 0
    code, out, _ = fvs("new", "flooding", "two.toml")
    assert code == 0 and out.split() == ["two.toml"]
    mesh = tmp_path / "flooding.msh"
    mesh.write_text("another")
    code, _, err = fvs("new", "flooding", "three.toml")
    assert (
        code == 2
        and "exists" in err
        and mesh.read_text() == "another"
        and not (tmp_path / "three.toml").exists()
    )


def test_a_caller_may_put_any_text_stream_in_place_of_standard_output(monkeypatch):
    """Streams of notebooks and `io.StringIO` have no `reconfigure`."""
    from fvsolve.cli import main

    monkeypatch.setattr(sys, "argv", ["fvsolve", "--version"])
    with (
        contextlib.redirect_stdout(io.StringIO()) as said,
        contextlib.redirect_stderr(io.StringIO()),
    ):
        with contextlib.suppress(SystemExit):
            main()
    assert fvsolve.__version__ in said.getvalue()
