"""restart.npz: state and arrays from which a run continues with exactly the same results."""

import functools
import hashlib
import json
import math
import sys
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fvsolve.case.resource_checks import byte_text, fits
from fvsolve.core.assembly.features import features_of
from fvsolve.core.schemes import LIMITERS
from fvsolve.errors import RunError, listing
from fvsolve.file_replacement import replacing

SEAL = "seal"  # name of the digest of all other arrays
# end of a zip file without comment: bytes 12 to 15 are the size of its list of names
END_LENGTH = 22
MOST_NAMES = 100_000  # greatest size of the list of names [B]


class OtherCase(RunError):
    """Error: a checkpoint belongs to another case."""


@dataclass(frozen=True)
class Restart:
    """Checkpoint of a run.

    t : time [s]; y : state; memory : arrays of the solver by name, such as those of step control and delay lines
    rows, history_bytes, frames : rows and bytes of history.csv, and frames of fields, written so far
    step_keys : `Case.step_keys` of the run; continued : earlier changes of these, see `changed_steps`
    """

    t: float
    y: np.ndarray
    memory: dict[str, np.ndarray]
    rows: int
    history_bytes: int
    frames: int
    step_keys: dict = field(default_factory=dict)
    continued: list = field(default_factory=list)


def other_steps(restart: Restart, case) -> dict[str, list]:
    """Keys of step control that a case changes: key -> [value of the checkpoint, value of the case]."""
    before, after = restart.step_keys, case.step_keys
    keys = sorted(key for key in before.keys() | after.keys() if before.get(key) != after.get(key))
    return {f"numerics.{key}": [before.get(key), after.get(key)] for key in keys}


def changed_steps(restart: Restart, case) -> list[dict]:
    """Changes of the keys of step control since the start of a run: for each its time [s], and key -> (before, after).

    Raises RunError if the last of these changes is not possible: histories of delays depend on the steps.
    """
    values = other_steps(restart, case)
    if not values:
        return restart.continued
    names = [name for feature in features_of(case) for name in feature.step_histories]
    if any(restart.memory[name].size for name in names if name in restart.memory):
        raise RunError(
            f"{next(iter(values))} cannot change in a continued run with delay lines or delays of controls, "
            "whose histories belong to the steps; start again with --force"
        )
    if restart.t == case.numerics.start:
        return restart.continued
    return [*restart.continued, {"t": restart.t, "keys": values}]


def identity(case) -> dict[str, str]:
    """Hash of the case and of its files, and `versions`; a run can only continue if all are equal.

    The hash leaves out the end time and the keys that change only the report, see `Case.identity_text`.
    """
    digest = hashlib.sha256(case.identity_text.encode())
    for path in case.files:
        digest.update(Path(path).read_bytes())
    return {"case": digest.hexdigest()[:16]} | versions(case)


def versions(case) -> dict[str, str]:
    """Versions on which the numbers of a run depend: programs, source of fluid data, target processor, own limiter."""
    own = LIMITERS[case.numerics.limiter].own
    return (
        program_versions()
        | {"fluid": case.properties.source}
        | ({"limiter": own.digest} if own else {})
        | digests_of_others(case)
    )


def digests_of_others(case) -> dict[str, str]:
    """Digest of the files of each part and block of another package : "part KIND" -> digest; a law may have changed."""
    members = [*case.nodes.values(), *case.links.values()]
    members += [block.control for block in case.controls.values()]
    kinds = {type(part) for part in members if not type(part).__module__.startswith("fvsolve.")}
    found = {}
    for kind in kinds:
        file = getattr(sys.modules.get(kind.__module__), "__file__", None)
        # A class that is defined in a notebook has no file.
        if file is None:
            continue
        digest = hashlib.sha256()
        for path in sorted(Path(file).parent.glob("*.py")):
            digest.update(path.name.encode() + path.read_bytes())
        found[f"part {kind.kind}"] = digest.hexdigest()[:16]
    return found


def program_versions() -> dict[str, str]:
    """Versions of the programs that compute: fvsolve, Python, numpy, numba, and the target processor."""
    return dict(_program_versions())


@functools.cache
def _program_versions() -> tuple[tuple[str, str], ...]:
    """Versions of the programs, as pairs; cached, because they cannot change within a process."""
    import fvsolve
    from fvsolve import jit
    from fvsolve.compile import store

    own = {
        "fvsolve": fvsolve.__version__,
        "sources": jit.source_hash(),
        "python": sys.version.split()[0],
    }
    own |= {"numpy": np.__version__, "numba": "not used", "target": "none"}
    if jit.COMPILING:
        own |= {"numba": store.numba_version(), "target": store.target()["name"]}
    return tuple(own.items())


def write_restart(path: Path, restart: Restart, who: dict[str, str]) -> None:
    """Replace the checkpoint file; if the process is killed, either the old or the new file is complete.

    who : result of `identity`
    """
    arrays = {f"memory.{name}": array for name, array in restart.memory.items()}
    arrays |= {"t": np.float64(restart.t), "y": restart.y}
    arrays["counts"] = np.array([restart.rows, restart.history_bytes, restart.frames])
    arrays["identity"] = np.array(json.dumps(who))
    arrays["steps"] = np.array(json.dumps([restart.step_keys, restart.continued]))
    arrays[SEAL] = np.array(digest_of(arrays))
    with replacing(path) as fresh, open(fresh, "wb") as file:
        np.savez(file, **arrays)


def digest_of(arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 of the names, types, shapes and values of arrays, as a text."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(repr((name, array.dtype.descr, np.shape(arrays[name]))).encode())
        digest.update(array.view(np.uint8))
    return digest.hexdigest()


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrays of an .npz file that is not compressed, by name.

    Raises ValueError before memory is taken if an array is larger than its data, or than the free memory; other damage
    raises errors of many types.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        stream.seek(max(0, size - END_LENGTH))
        end = stream.read()
        if end[:4] != b"PK\x05\x06" or int.from_bytes(end[12:16], "little") > MOST_NAMES:
            raise ValueError("it is cut, or not a checkpoint")
        with zipfile.ZipFile(stream) as archive:
            members = archive.infolist()
            total = sum(member.file_size for member in members)
            if total > size or any(
                member.compress_type != zipfile.ZIP_STORED for member in members
            ):
                raise ValueError("it is compressed, or its arrays overlap")
            if not fits(total):
                raise ValueError(
                    f"its arrays of {byte_text(total)} do not fit into the free memory"
                )
            if len({member.filename for member in members}) < len(members):
                raise ValueError("two arrays have the same name")
            return {
                member.filename.removesuffix(".npy"): read_array(archive, member)
                for member in members
            }


def read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    """Array of a member of an .npz file. Raises ValueError if its shape and type do not fit the size of its data."""
    with archive.open(member) as file:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError(f"{member.filename} is not an array")
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        if dtype.hasobject or math.prod(shape) * dtype.itemsize != member.file_size - file.tell():
            raise ValueError(f"the shape of {member.filename} does not fit its data")
    with archive.open(member) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def read_restart(path: Path, who: dict[str, str]) -> Restart:
    """Read a checkpoint file; raises RunError if it is damaged or belongs to another case or other versions.

    who : expected result of `identity`
    """
    try:
        arrays = read_arrays(path)
        seal = str(arrays.pop(SEAL))
        is_sealed = seal == digest_of(arrays)
        stored, steps = (json.loads(str(arrays.pop(name))) for name in ("identity", "steps"))
        t, y, counts = (arrays.pop(name) for name in ("t", "y", "counts"))
    except Exception as error:  # zip, numpy and json raise many types on a damaged file
        reason = (
            f"{error} is missing"
            if isinstance(error, KeyError)
            else (str(error).splitlines() or [type(error).__name__])[0]
        )
        raise RunError(
            f"{path} cannot be read ({reason}); start the run again with --force"
        ) from None
    damaged = [
        name
        for name, array, axes in (("t", t, 0), ("y", y, 1))
        if array.dtype != np.float64 or array.ndim != axes
    ]
    damaged = damaged or [
        name for name, array in (("t", t), ("y", y)) if not np.isfinite(array).all()
    ]
    damaged += (
        ["counts"] if counts.shape != (3,) or counts.dtype.kind != "i" or counts.min() < 0 else []
    )
    damaged += ["identity"] if not isinstance(stored, dict) else []
    damaged += (
        ["steps"] if not isinstance(steps, list) or [*map(type, steps)] != [dict, list] else []
    )
    if damaged:
        raise RunError(
            f"{path}: damaged or edited data ({listing(damaged)}); start the run again with --force"
        )
    if not is_sealed:
        text = "was changed after the run wrote it: the digest of its arrays differs"
        raise RunError(f"{path} {text}; start the run again with --force")
    _check_identity(path, stored, who)
    memory = {name.removeprefix("memory."): array for name, array in arrays.items()}
    return Restart(float(t), y, memory, *counts.tolist(), *steps)


def _check_identity(path: Path, stored: dict[str, str], expected: dict[str, str]) -> None:
    if stored.get("case") != expected["case"]:
        raise OtherCase(f"{path} belongs to another case")
    other = [name for name in expected if stored.get(name) != expected[name]]
    if other:
        listed = ", ".join(f"{name} {stored.get(name)} (now {expected[name]})" for name in other)
        raise RunError(
            f"{path} was written by other versions, so the continued run could differ from an uninterrupted run: "
            f"{listed}; start again with --force, or continue with the earlier versions"
        )
