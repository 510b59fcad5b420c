"""Package, case and commands of docs/own-parts.md, installed and run as they stand."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from reference.folders import section
from reference.outside_packages import files_of, install_page, lines_not_printed, python, runs_of

from fvsolve.compile import cache_folders
from fvsolve.features.controls.kernels.tables import CONTROL, HOOKS
from fvsolve.features.controls.rows import ControlRows, StaticRows
from fvsolve.parts import plugins
from fvsolve.parts.control import Control

TEXT = section("own-parts", "A block of controls")
FILES, RUNS = files_of(TEXT), runs_of(TEXT)
FOLDERS = ("watch", "watch/running_max", "watch/lag")
METHODS = ("dormand-prince", "radau-iia-5", "rodas-5p")  # explicit, implicit, Rosenbrock
ROWS = """
import json, sys
import fvsolve
found = {}
for method in sys.argv[1:]:
    result = fvsolve.run("peaks.toml", {"numerics.method": method})
    names = ("tower.level", "controls.top.output", "controls.mean.output")
    found[method] = [result.t.tolist(), *(result[name].tolist() for name in names)]
print(json.dumps(found))
"""
RESUMED = """
import tomllib
from pathlib import Path
import fvsolve
from reference.resumed_runs import killed_and_resumed, same_files
whole = Path("runs/whole").absolute()
case = tomllib.loads(Path("peaks.toml").read_text())
fvsolve.run(case, {"numerics.end": 600.0}, out=whole, pictures=False)
same_files(whole, killed_and_resumed(whole, 101.7))
print("equal")
"""
FAULTS = """
import tomllib
import fvsolve
table = tomllib.load(open("peaks.toml", "rb"))
del table["controls"]["top"]["period"]
table["controls"]["mean"]["period"] = 1.0
table["controls"]["second"] = {
    "type": "running-max", "input": "tower.level", "window": 1.0, "period": 2.0, "offset": 3.0
}
try:
    fvsolve.load(table)
except fvsolve.CaseError as error:
    print(*error.faults, sep="\\n")
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """Folder with the case of the page and its installed package."""
    return install_page(tmp_path_factory.mktemp("home"), FILES, *FOLDERS)


@pytest.mark.parametrize("commands, output", RUNS, ids=[run[0].splitlines()[0] for run in RUNS])
def test_the_commands_of_the_page_print_its_text(commands, output, home):
    assert lines_not_printed(home, commands, output) == []


def test_the_test_of_the_page_passes(home):
    done = python(home, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_watch.py")
    assert "1 passed" in done.stdout


@pytest.fixture(scope="module")
def rows(home) -> dict[str, np.ndarray]:
    """Times, level, greatest level and mean flow of the case : method -> float64[4, rows]."""
    found = json.loads(python(home, "-c", ROWS, *METHODS).stdout)
    return {method: np.array(values) for method, values in found.items()}


@pytest.mark.parametrize("method", METHODS)
def test_the_running_maximum_is_that_of_numpy_on_the_recorded_level(method, rows):
    t, level, top, _ = rows[method]
    samples = level[::2]  # every 0.5 s, the period of the block
    windows = [samples[max(0, k - 8) : k + 1].max() for k in range(len(samples))]
    assert len(t) == 241 and np.ptp(top) > 0.3
    # a row between samples shows the output of the sample before it, and a row at a sample that before this sample
    assert top[1::2] == pytest.approx(windows[:-1], abs=1e-12)
    assert top[2::2] == pytest.approx(windows[:-1], abs=1e-12)
    assert top[0] == level[0] == 3.0


@pytest.mark.parametrize("method", METHODS)
def test_the_lag_is_the_closed_form(method, rows):
    """v' = (a sin(w t) - v) / T from v = 0: v = a (sin wt - w T cos wt + w T exp(-t / T)) / (1 + (w T)^2)."""
    t, _, _, mean = rows[method]
    w, time, a = 2.0 * np.pi / 20.0, 5.0, 0.05
    exact = np.sin(w * t) - w * time * (np.cos(w * t) - np.exp(-t / time))
    assert mean == pytest.approx(a * exact / (1.0 + (w * time) ** 2), abs=1e-9)


def test_a_killed_and_resumed_run_has_the_same_files_to_the_byte(home, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
    assert python(home, "-c", RESUMED).stdout.endswith("equal\n")


def test_without_compilation_the_history_is_the_same_to_the_byte(home):
    words = ("-m", "fvsolve", "run", "peaks.toml", "--set", "numerics.end=12", "--out")
    python(home, *words, "runs/compiled")
    python(home, *words, "runs/plain", NUMBA_DISABLE_JIT="1")
    texts = [(home / "runs" / name / "history.csv").read_bytes() for name in ("compiled", "plain")]
    assert texts[0] == texts[1]


def test_all_faults_of_blocks_of_others_are_reported_with_their_keys(home):
    assert sorted(python(home, "-c", FAULTS).stdout.splitlines()) == [
        "controls.mean.period: unknown key; use it in a `function` that reads this block, which acts at all times",
        "controls.second.offset: 3 s is not below the period; expected less than 2 s",
        "controls.second.window: 1 s is below the period; expected at least 2 s",
        "controls.top: period is missing",
    ]


def test_code_of_a_block_is_stored_by_the_sources_of_the_feature_that_it_calls(home):
    folder = home / "watch" / "lag"
    (controls,) = plugins.called_features(folder)
    cache_folders.add_sources(folder)
    alone = cache_folders.EXTRA_FOLDERS.pop(folder.resolve())
    cache_folders.add_sources(folder, called=[controls])
    assert cache_folders.EXTRA_FOLDERS.pop(folder.resolve()) != alone
    assert controls.name == "controls"


def test_the_page_names_all_hooks_and_only_columns_that_exist():
    named = {*re.findall(r"^\|(?: [^|]*\|)?? `(\w+)[(`]", TEXT, re.MULTILINE)}
    rows = {name for name in vars(ControlRows) | vars(StaticRows) if not name.startswith("_")}
    keys = {
        name
        for name, value in vars(Control).items()
        if isinstance(value, property | classmethod) and not name.startswith("_")
    }
    assert named >= (rows | keys | {"law", "faults", *HOOKS}) - {"kinds", "feeds_through"}
    columns = {*re.findall(r'(?<=[ `])"(\w+)"`', TEXT)}
    assert len(columns) == 10 and columns <= {*CONTROL.names}
