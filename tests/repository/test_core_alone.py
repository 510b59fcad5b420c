"""The core runs without features, studies, reports and exchange; each feature runs with those only that it imports."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fvsolve

PACKAGE = Path(fvsolve.__file__).parent
CASES = PACKAGE.parent / "cases"
ABOVE = ("studies", "exchange")  # folders that no run needs; of `report` it needs `draw` alone
# feature -> a case that wakes it, and keys that do
AWAKE = {
    "delay_lines": ["valve-closure", "--set", 'numerics.pipe_model="delay-line"'],
    "controls": ["tank-relay"],
    "scalars": ["temperature-front"],
    "basins": ["dam-break"],
    "networks": ["clutch"],
    "motion": ["closed-cylinder"],
}
CALLED = {"basins": ["scalars"]}  # features that a feature may import
RUN = "import sys, fvsolve; from fvsolve.cli import main; print(fvsolve.__file__); sys.exit(main())"


def copy_of_package(top: Path, feature: str) -> None:
    """Write the package and its cases to a folder, without the folders ABOVE and without all features but one."""
    left_out = shutil.ignore_patterns("__pycache__", *ABOVE)
    shutil.copytree(PACKAGE, top / "fvsolve", ignore=left_out)
    shutil.copytree(CASES, top / "cases")
    for file in (top / "fvsolve" / "report").glob("*.py"):
        if file.name != "__init__.py":
            file.unlink()
    for folder in (top / "fvsolve" / "features").iterdir():
        if folder.is_dir() and folder.name not in (feature, *CALLED.get(feature, ())):
            shutil.rmtree(folder)


def run(top: Path, *words: str) -> subprocess.CompletedProcess:
    """Process of `fvsolve run` of the copy."""
    environment = os.environ | {"PYTHONPATH": str(top), "MPLBACKEND": "Agg"}
    command = [sys.executable, "-c", RUN, "run", *words, "--no-pictures", "--out", str(top / "out")]
    return subprocess.run(command, cwd=top, env=environment, capture_output=True, text=True)


def test_features_of_the_package_have_cases_here():
    assert {
        path.parent.name for path in (PACKAGE / "features").glob("*/feature.py")
    } == AWAKE.keys()


def test_a_surge_runs_without_features(tmp_path):
    copy_of_package(tmp_path, "")
    done = run(tmp_path, "valve-closure")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(tmp_path)) and "holds: max(gate.pressure)" in done.stdout


@pytest.mark.parametrize("feature", AWAKE)
def test_a_feature_runs_without_the_others(feature, tmp_path):
    copy_of_package(tmp_path, feature)
    done = run(tmp_path, *AWAKE[feature])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(tmp_path)) and "finished at t =" in done.stdout
