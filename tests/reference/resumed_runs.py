"""Runs that are killed and resumed, and the comparison of their files."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import fvsolve
from reference.scenes import branched

DYING = """
import itertools, os, sys
from importlib import import_module
import fvsolve
rooms = import_module("fvsolve.core.solve.solve")
rooms.CHECKPOINT_SECONDS = rooms.CHUNK_SECONDS = 0.0
save, pauses = rooms.Run.save, itertools.count(1)
def save_and_die(run):
    dies = run.loop.t >= float(sys.argv[3])
    if dies or next(pauses) % 20 == 0:
        save(run)
    if dies:
        os._exit(9)
rooms.Run.save = save_and_die
fvsolve.run(sys.argv[1], out=sys.argv[2], pictures=sys.argv[4] == "True")
"""


def killed_and_resumed(whole: Path, moment: float, pictures: bool = False) -> Path:
    """Folder of a run of the case of `whole` that is killed after `moment` [s], then resumed in this process."""
    script, broken = whole.parent / "dying.py", whole.parent / "broken"
    script.write_text(DYING)
    died = subprocess.run(
        [sys.executable, *map(str, (script, whole / "case.toml", broken, moment, pictures))]
    )
    assert died.returncode == 9 and moment <= reached(broken) < fvsolve.open_run(whole).t[-1]
    assert (
        fvsolve.run(whole / "case.toml", out=broken, resume=True, pictures=pictures).reason
        == "finished"
    )
    return broken


def reached(folder) -> float:
    """Time of the last checkpoint [s], 0 without a checkpoint."""
    try:
        with np.load(folder / "restart.npz") as kept:
            return float(kept["t"])
    except FileNotFoundError:
        return 0.0


# work of the run, not its results
WORK = ("rhs", "ended", "seconds", "seconds_setup", "seconds_total", "cost")


def long_run(**numerics) -> dict:
    """Case with about a second of steps."""
    case = branched(fields=20)
    case["nodes"]["tower"] = {
        "type": "tank",
        "area": 2.0,
        "level": 5.0,
        "height": 30.0,
        "elevation": 10.0,
    }
    case["links"]["riser"] = {
        "type": "valve",
        "from": "fork",
        "to": "tower",
        "area": 0.01,
        "discharge_coefficient": 0.6,
    }
    case["numerics"] = {"end": 2500.0, "scheme": "muscl", "method": "ssp-rk3", **numerics}
    case["output"] |= {"every": 0.1, "probes": [*case["output"]["probes"], "tower.level"]}
    return case


def same_files(one: Path, other: Path) -> None:
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(other) for path in other.rglob("*") if path.is_file())
    for name in files:
        if name.name == "summary.json":
            said, again = (json.loads((run / name).read_text()) for run in (one, other))
            assert {**said, **dict.fromkeys(WORK)} == {**again, **dict.fromkeys(WORK)}
        elif name.name != "restart.npz":  # times of checkpoints differ
            assert (one / name).read_bytes() == (other / name).read_bytes(), name
