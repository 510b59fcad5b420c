"""restart.npz: all that a run needs to go on, bit for bit. Knows arrays and files; knows no physics."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fvsolve.errors import RunError, listing

# Keys of the resolved case that change what is said about a run, not the run.
SILENT = ("title", "expect", "compare")


@dataclass(frozen=True)
class Restart:
    """A checkpoint: the state, the solver's own arrays, and how far the files had come."""

    t: float
    y: np.ndarray
    memory: np.ndarray
    extra: dict[str, np.ndarray]
    rows: int
    history_bytes: int
    frames: int


def identity(case) -> dict[str, str]:
    """What has to be the same for a run to go on: the case but for its end time, and the versions."""
    said = {key: one for key, one in case.table().items() if key not in SILENT}
    said["numerics"].pop("end")
    digest = hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode())
    for path in case.files:
        digest.update(Path(path).read_bytes())
    return {"case": digest.hexdigest()[:16]} | versions(case)


def versions(case) -> dict[str, str]:
    """Versions that the numbers of a run depend on, and the machine that they were compiled for."""
    return programs() | {"fluid": case.properties.source}


def programs() -> dict[str, str]:
    """Versions of what computes."""
    return dict(_programs())


@functools.cache
def _programs() -> tuple[tuple[str, str], ...]:
    """They stay the same while a process lasts."""
    import fvsolve
    from fvsolve import jit

    own = {"fvsolve": fvsolve.__version__, "sources": jit.source_hash(), "python": sys.version.split()[0]}
    own |= {"numpy": np.__version__, "numba": "not used", "target": "none"}
    if jit.COMPILING:
        own |= {"numba": jit.store.numba_version(), "target": jit.store.target()["name"]}
    return tuple(own.items())


def write_restart(path: Path, restart: Restart, who: dict[str, str]) -> None:
    """Replace the checkpoint: a kill at any moment leaves the old one or the new one, never half of one."""
    arrays = {f"extra.{name}": np.asarray(value) for name, value in restart.extra.items()}
    arrays |= {"t": np.float64(restart.t), "y": restart.y, "memory": restart.memory}
    arrays["counts"] = np.array([restart.rows, restart.history_bytes, restart.frames])
    arrays["identity"] = np.array(json.dumps(who))
    fresh = path.with_suffix(".tmp")
    with open(fresh, "wb") as file:
        np.savez(file, **arrays)
    os.replace(fresh, path)


def read_restart(path: Path, who: dict[str, str]) -> Restart:
    """The checkpoint at `path`; RunError where it belongs to another case or to other versions."""
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
        found = json.loads(str(arrays.pop("identity")))
        t, y, memory, counts = (arrays.pop(name) for name in ("t", "y", "memory", "counts"))
    except Exception as error:  # whatever zip, numpy and json make of a damaged file
        said = f"{error} is not there" if isinstance(error, KeyError) else error
        raise RunError(f"{path} cannot be read ({said}); start the run again with --force") from None
    harmed = [name for name, array, axes in (("t", t, 0), ("y", y, 1), ("memory", memory, 1))
              if array.dtype != np.float64 or array.ndim != axes]  # fmt: skip
    harmed = harmed or [name for name, array in (("t", t), ("y", y)) if not np.isfinite(array).all()]
    harmed += ["counts"] if counts.shape != (3,) or counts.dtype.kind != "i" or counts.min() < 0 else []
    harmed += ["identity"] if not isinstance(found, dict) else []
    if harmed:
        raise RunError(f"{path}: {listing(harmed)} is not what a run writes; start the run again with --force")
    _check(path, found, who)
    extra = {name.removeprefix("extra."): value for name, value in arrays.items()}
    return Restart(float(t), y, memory, extra, *counts.tolist())


def _check(path: Path, found: dict[str, str], wanted: dict[str, str]) -> None:
    if found.get("case") != wanted["case"]:
        raise RunError(
            f"{path} belongs to another case: more than numerics.end has changed since (an [output] every "
            "that is not stated changes with it); start again with --force, or keep both with --out DIR"
        )
    other = [name for name in wanted if found.get(name) != wanted[name]]
    if other:
        listed = ", ".join(f"{name} {found.get(name)} (now {wanted[name]})" for name in other)
        raise RunError(
            f"{path} was written by other versions, so the run would not go on bit for bit: {listed}; "
            "start again with --force, or go on with the versions of then"
        )
