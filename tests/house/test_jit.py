"""The package's njit: an edit in another file is noticed, and a second process starts from the cache."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fvsolve import jit

LAW = """from fvsolve.jit import njit

@njit
def law(x):
    return {factor} * x
"""
LOOP = """from fvsolve.jit import njit
from fvsolve.kernels.law import law

@njit
def loop(n):
    total = 0.0
    for i in range(n):
        total += law(float(i))
    return total
"""
PROBE = """
import numba, sys
before = numba.config.CACHE_DIR
from fvsolve.steppers.loop import loop
value = loop(4)
stats = loop.stats
hits, misses = sum(stats.cache_hits.values()), sum(stats.cache_misses.values())
print(value, hits, misses, before == numba.config.CACHE_DIR)
"""


@pytest.fixture
def package(tmp_path):
    """A small copy of the package: jit.py and two files of jitted functions, one calling the other."""
    folder = tmp_path / "fvsolve"
    for room in (folder, folder / "kernels", folder / "steppers"):
        room.mkdir()
        (room / "__init__.py").touch()
    shutil.copy(jit.__file__, folder)
    (folder / "kernels" / "law.py").write_text(LAW.format(factor=2.0))
    (folder / "steppers" / "loop.py").write_text(LOOP)
    return folder


def python(package: Path, code: str, **environment: str) -> list[str]:
    """Words printed by `code` in a new process with this copy and a cache of its own; it warns of nothing."""
    stated = {"FVSOLVE_CACHE": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_JIT"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=inherited | stated | environment,
        cwd=package.parent,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_second_process_hits_the_cache_and_an_edit_elsewhere_is_noticed(package):
    assert python(package, PROBE) == ["12.0", "0", "1", "True"]
    assert python(package, PROBE) == ["12.0", "1", "0", "True"]
    (package / "kernels" / "law.py").write_text(LAW.format(factor=3.0))
    assert python(package, PROBE) == ["18.0", "0", "1", "True"]
    assert not list(package.rglob("*.nb?")), "compiled code belongs in the cache folder"


def test_python_and_compiled_code_may_call_the_same_function(package):
    """What compiled code alone has called has no door to Python, and gets one when Python calls it."""
    code = """
from fvsolve.steppers.loop import law, loop
print(loop(4), len(law.overloads), len(law.within.overloads), law(1.0), len(law.overloads))
"""
    assert python(package, code) == ["12.0", "0", "1", "2.0", "1"]
    assert python(package, code) == ["12.0", "0", "0", "2.0", "1"]


def test_old_generations_are_deleted_and_the_newest_few_kept(package):
    for generation in range(6):
        (package / "units.py").write_text(f"GENERATION = {generation}\n")
        python(package, "from fvsolve import jit; jit._code_folder()")
    assert len(list((package.parent / "cache" / "code").iterdir())) == jit.KEPT + 1


def test_without_jit_the_plain_function_comes_back_and_numba_stays_away(package):
    code = "import sys; from fvsolve.steppers.loop import loop; print(loop(4), 'numba' in sys.modules)"
    assert python(package, code, NUMBA_DISABLE_JIT="1") == ["12.0", "False"]


def test_a_function_without_a_file_compiles_without_a_cache(package):
    code = "from fvsolve.jit import njit\n@njit\ndef f(x): return x + 1\nprint(f(1), type(f._cache).__name__)"
    assert python(package, code) == ["2", "NullCache"]


def test_options_reach_numba_and_division_by_zero_does_not_raise(package):
    code = """
from fvsolve.jit import njit
ratio = njit(boundscheck=True)(lambda x, y: x / y)
print(ratio(1.0, 0.0), ratio.targetoptions["boundscheck"])
"""
    assert python(package, code) == ["inf", "True"]


def test_first_class_functions_do_not_warn(package):
    code = """
from fvsolve.jit import njit
one, two = njit(lambda x: x + 1.0), njit(lambda x: x + 2.0)
for function in (one, two):
    function.compile("float64(float64)")

@njit
def either(first, x):
    function = one if first else two
    return function(x)

print(either(True, 0.0), either(False, 0.0))
"""
    assert python(package, code) == ["1.0", "2.0"]


def test_cache_folder_falls_back_when_the_stated_one_is_not_writable(package, tmp_path):
    (tmp_path / "file").touch()
    code = "from fvsolve.jit import cache_folder; print(cache_folder())"
    assert python(package, code, FVSOLVE_CACHE=str(tmp_path / "stated")) == [str(tmp_path / "stated")]
    stated = {"FVSOLVE_CACHE": str(tmp_path / "file" / "x"), "TMPDIR": str(tmp_path)}
    fallback = Path(python(package, code, **stated)[0])
    assert fallback.parent == tmp_path and fallback.name.startswith("fvsolve-cache")


def test_only_rooms_that_are_hashed_compile():
    users = {path for path in jit.PACKAGE.rglob("*.py") if "njit" in path.read_text(encoding="utf-8")}
    assert users <= set(jit._sources()), "njit outside of jit.ROOMS would never be cached"


def test_what_declares_or_lowers_compiles_nothing():
    """So an edit there leaves compiled code as it is: of parts laws alone are hashed, of basins all that compiles."""
    hashed = {path.relative_to(jit.PACKAGE) for path in jit._sources()}
    assert Path("basins/liquid/grid.py") in hashed and Path("basins/carried.py") in hashed
    assert {path.name[:3] for path in hashed if path.parts[0] == "parts"} == {"law"}
    assert not any(path.name.startswith(("part", "lower")) for path in hashed if path.parts[0] == "basins")
