"""`njit` of the package: an edit in another file causes compilation, and a second process loads compiled code."""

import contextlib
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reference.small_package import LAW, python

import fvsolve
from fvsolve import jit
from fvsolve.compile import cache_folders, store
from fvsolve.core.steppers.run_handle import no_algebra
from fvsolve.features.basins import COMPILED

PROBE = """
import sys
from fvsolve.core.steppers.loop import loop
value = loop(4)
print(value, 'numba' in sys.modules, 'numba' in sys.modules and sum(loop.numba.stats.cache_misses.values()))
"""


POWERS = """from fvsolve.jit import njit, specialise

ADDED = None

@njit
def square(x):
    return x * x

@njit
def cube(x):
    return x * x * x

def _sums(n):
    \"\"\"Sum of powers.\"\"\"
    total = 0.0
    for i in range(n):
        total += POWER(float(i)) if ADDED is None else POWER(float(i)) + ADDED
    return total

sum_of_squares = specialise(_sums, "sum_of_squares", POWER=square)
sum_of_cubes = specialise(_sums, "sum_of_cubes", POWER=cube, ADDED=0.5)
"""
SPECIALISED = """
import pickle, sys
from fvsolve.core.kernels import powers
from fvsolve.core.kernels.powers import sum_of_cubes, sum_of_squares
print(sum_of_squares(4), sum_of_cubes(4), 'numba' in sys.modules)
for function in (sum_of_squares, sum_of_cubes):
    plain = getattr(function, "py_func", function)
    assert plain(4) == function(4) and plain.__doc__ == function.__doc__ == "Sum of powers."
    assert pickle.loads(pickle.dumps(function)) is function and function.__module__ == powers.__name__
    if hasattr(function, "numba"):
        stats = function.numba.stats
        print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


def test_second_process_needs_no_numba_and_an_edit_in_another_module_is_noticed(package):
    assert python(package, PROBE) == ["12.0", "True", "1"]
    assert python(package, PROBE) == ["12.0", "False", "False"]
    (package / "core" / "kernels" / "law.py").write_text(LAW.format(factor=3.0))
    assert python(package, PROBE) == ["18.0", "True", "1"]
    for kept in (package.parent / "cache" / "code").rglob(f"*{store.SUFFIX}"):
        kept.unlink()
    assert python(package, PROBE) == ["18.0", "True", "0"]  # cache of numba
    assert python(package, PROBE) == ["18.0", "False", "False"]
    assert not list(package.rglob("*.nb?")), "compiled code belongs in the cache folder"


def test_without_the_store_all_code_comes_from_numba(package):
    """`FVSOLVE_STORE=0`, for a numba whose machine code the store cannot load."""
    off = {"FVSOLVE_STORE": "0"}
    assert python(package, PROBE, **off) == ["12.0", "True", "1"]
    assert python(package, PROBE, **off) == ["12.0", "True", "0"]
    cold = "from fvsolve import jit; from fvsolve.compile.cache_folders import is_cached; print(jit.is_cold(), {})"
    asked = cold.format("is_cached('loop'), is_cached('law'), is_cached('oop')")
    assert python(package, asked, **off) == ["False", "True", "True", "False"]
    assert not list((package.parent / "cache" / "code").rglob(f"*{store.SUFFIX}"))
    assert python(package, PROBE) == ["12.0", "True", "0"] and python(package, PROBE) == [
        "12.0",
        "False",
        "False",
    ]


@pytest.mark.parametrize("copy, told", [
    ('"sum_of_squares", POWER=cube, __name__=__name__', 'powers has a copy of _sums with the name "sum_of_squares"'),
    ('"sum_of_more", POWER=cube', "the copy sum_of_more of _sums needs __name__=__name__"),
])  # fmt: skip
def test_a_template_is_compiled_once_under_a_name(package, copy, told):
    """The copy of the second module ran the code of the first, loaded from the cache."""
    (package / "core" / "kernels" / "powers.py").write_text(POWERS)
    line = (
        "from fvsolve.jit import specialise\nfrom fvsolve.core.kernels.powers import _sums, cube\n"
    )
    (package / "core" / "steppers" / "more.py").write_text(
        f"{line}other = specialise(_sums, {copy})\n"
    )
    code = (
        "try:\n    import fvsolve.core.steppers.more\nexcept ValueError as fault:\n    print(fault)"
    )
    assert f"fvsolve.core.steppers.more: {told}" in " ".join(python(package, code)).replace(
        "fvsolve.core.kernels.", ""
    )


def test_a_run_without_the_store_has_the_same_results():
    """Events, probes and error control of a whole run, to the bit."""
    code = """
import fvsolve
from fvsolve.compile import store
run = fvsolve.run("two-tanks", {"output.fields": 0})
print(store.IN_USE, run.ok, run.summary["steps"], run.si("low.level").tobytes().hex())
"""
    words = {}
    for setting in ("0", "1"):
        environment = os.environ | {
            "FVSOLVE_STORE": setting,
            "PYTHONPATH": str(cache_folders.PACKAGE.parent),
        }
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        words[setting] = done.stdout.split()
    assert (
        words["0"][:2] == ["False", "True"]
        and words["0"][1:] == words["1"][1:]
        and len(words["0"][3]) > 1000
    )


PRIVATE = re.compile(
    r"numba\.(core|np|extending|misc|_\w+)|_numba_type_|\b(lib|context|builder)\.call_conv\b"
)


def test_only_the_folder_compile_depends_on_private_names_of_numba():
    users = {
        path
        for path in cache_folders.PACKAGE.rglob("*.py")
        if PRIVATE.search(path.read_text(encoding="utf-8"))
    }
    assert {path.parent.name for path in users} == {"compile"} and len(users) >= 3


def test_python_and_compiled_code_may_call_the_same_function(package):
    """A function that only compiled code has called gets an entry point for Python at its first call from Python."""
    code = """
from fvsolve.core.steppers.loop import law, loop
print(loop(4), len(law.numba.overloads), len(law.numba.within.overloads), law(1.0), len(law.numba.overloads))
"""
    assert python(package, code) == ["12.0", "0", "1", "2.0", "1"]
    assert python(package, code) == ["12.0", "0", "0", "2.0", "0"]


def test_two_signatures_of_the_same_types_for_numba_may_both_come_from_its_cache(package):
    """An array with a single row is contiguous in both orders, which is another signature and the same type."""
    code = """
import sys
import numpy as np
from fvsolve.core.kernels.corner import corner
for rows in (1, 2):
    table = np.full((rows, 3), 7.0)
    table.flags.writeable = False
    print(corner(table))
print('numba' in sys.modules)
"""
    (package / "core" / "kernels" / "corner.py").write_text(
        "from fvsolve.jit import njit\n\n@njit\ndef corner(table):\n    return table[0, 0]\n"
    )
    assert python(package, code) == ["7.0", "7.0", "True"]
    for kept in (package.parent / "cache" / "code").rglob(f"*{store.SUFFIX}"):
        kept.unlink()
    assert python(package, code) == ["7.0", "7.0", "True"]
    assert python(package, code) == ["7.0", "7.0", "False"]


def test_specialisations_of_a_template_are_stored_each_under_its_own_name(package):
    """The second process loads both without numba; without the store they come from numba's own cache."""
    (package / "core" / "kernels" / "powers.py").write_text(POWERS)
    assert python(package, SPECIALISED) == ["14.0", "38.0", "True", "0", "1", "0", "1"]
    assert python(package, SPECIALISED)[:3] == ["14.0", "38.0", "False"]
    stored = list((package.parent / "cache" / "code").rglob(f"sum_of_*{store.SUFFIX}"))
    assert sorted(path.name.rpartition("-")[0] for path in stored) == [
        "sum_of_cubes",
        "sum_of_squares",
    ]
    for path in stored:
        path.unlink()
    assert python(package, SPECIALISED) == ["14.0", "38.0", "True", "1", "0", "1", "0"]
    assert python(package, SPECIALISED, NUMBA_DISABLE_JIT="1") == ["14.0", "38.0", "False"]
    (package / "core" / "kernels" / "powers.py").write_text(
        POWERS.replace("ADDED=0.5", "ADDED=1.5")
    )
    assert python(package, SPECIALISED) == ["14.0", "42.0", "True", "0", "1", "0", "1"]


def forged(package: Path, **changes) -> Path:
    """The only file of the store, with changed header and valid checksum."""
    (path,) = (package.parent / "cache" / "code").rglob(f"*{store.SUFFIX}")
    head, _, code = path.read_bytes()[store.DIGEST :].partition(b"\n")
    data = json.dumps(json.loads(head) | changes).encode() + b"\n" + code
    path.write_bytes(hashlib.sha256(data).digest() + data)
    return path


def test_a_store_serves_wherever_it_is_copied_to(package, tmp_path):
    """Stored code is valid in a copy of the package; numba's own cache is not, because it depends on time stamps."""
    assert python(package, PROBE) == ["12.0", "True", "1"]
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(package, elsewhere / "fvsolve", copy_function=shutil.copyfile)
    shutil.copytree(tmp_path / "cache", elsewhere / "cache", ignore=shutil.ignore_patterns("*.nb?"))
    assert python(elsewhere / "fvsolve", PROBE) == ["12.0", "False", "False"]


def test_settings_that_change_code_have_a_store_of_their_own(package):
    assert python(package, PROBE) == ["12.0", "True", "1"]
    for _ in range(2):
        told = python(package, PROBE, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
        assert told[0] == "12.0"
    assert told[1] == "False" and python(package, PROBE, NUMBA_DEBUG_JIT="0") == [
        "12.0",
        "False",
        "False",
    ]
    said = "from fvsolve import jit; print(jit.other_caches())"
    other, own = (python(package, said, **settings) for settings in ({"NUMBA_OPT": "1"}, {}))
    named = " ".join(other)
    assert named.count(store.target()["processor"]) == 2 and "generic-" in named, (
        "two stores and this machine's"
    )
    target = python(package, "from fvsolve.compile import store; print(store.target()['name'])")
    assert own[own.index("is") + 1] == target[0]


def test_code_for_a_stated_processor_serves_other_processors(package):
    """Two processors of different names have one store if both settings are given, else each has its own."""
    other = "from llvmlite import binding; binding.get_host_cpu_name = lambda: 'znver9'\n"
    other += "binding.get_host_cpu_features = lambda: binding.targets.FeatureMap()\n"
    stated = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    assert python(package, PROBE, **stated) == ["12.0", "True", "1"]
    assert python(package, other + PROBE, **stated) == ["12.0", "False", "False"]
    name = "from fvsolve.compile import store; print(store.target()['name'].rpartition('-')[0])"
    assert python(package, other + name) == ["znver9"] and python(
        package, other + name, **stated
    ) == ["generic"]


def test_code_of_other_sources_is_named(package):
    python(package, PROBE)
    old = python(package, "from fvsolve import jit; print(jit.source_hash())")[0]
    (package / "units.py").write_text("NEW = 1\n")
    told = " ".join(python(package, "from fvsolve import jit; print(jit.other_caches())"))
    assert (
        f"contains code compiled from other versions of the sources ({old}), which cannot be used"
        in told
    )


@pytest.mark.parametrize(
    "changes, named",
    {
        "another machine": (
            {"target": "znver9-01234567"},
            r"contains code compiled for znver9-01234567; this machine is \S+",
        ),
        "a helper that is gone": (
            {"wanted": ["numba_gone"]},
            r"code of fvsolve.core.steppers.loop.loop cannot be loaded: numba \S+ has no numba_gone",
        ),
        "a helper not declared": (
            {"wanted": []},
            r"not found: \[ numba_\w+[^$]*code of fvsolve.core.steppers.loop.loop cannot be loaded: it calls",
        ),
    }.values(),
    ids=["another machine", "a helper that is gone", "a helper not declared"],
)
def test_functions_that_cannot_be_called_are_refused_by_name_and_compiled_again(
    package, changes, named
):
    python(package, PROBE)
    forged(package, **changes)
    said = python(package, PROBE, told=named)
    assert said[:2] == ["12.0", "True"]
    assert python(package, PROBE) == ["12.0", "False", "False"]


def test_old_generations_are_deleted_except_the_newest(package):
    for generation in range(6):
        (package / "units.py").write_text(f"GENERATION = {generation}\n")
        python(package, "from fvsolve import jit; jit.code_folder()")
    assert (
        len(list((package.parent / "cache" / "code").iterdir()))
        == cache_folders.KEPT_GENERATIONS + 1
    )


def test_without_jit_the_plain_function_comes_back_and_numba_stays_away(package):
    code = "import sys; from fvsolve.core.steppers.loop import loop; print(loop(4), 'numba' in sys.modules)"
    assert python(package, code, NUMBA_DISABLE_JIT="1") == ["12.0", "False"]


def test_a_function_without_a_file_compiles_without_a_cache(package):
    code = "from fvsolve.jit import njit\n@njit\ndef f(x): return x + 1\nprint(f(1), type(f.numba._cache).__name__)"
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
    function.numba.compile("float64(float64)")

@njit
def either(first, x):
    function = one if first else two
    return function(x)

print(either(True, 0.0), either(False, 0.0))
"""
    assert python(package, code) == ["1.0", "2.0"]


def test_cache_folder_falls_back_when_the_stated_folder_is_not_writable(package, tmp_path):
    (tmp_path / "file").touch()
    code = "from fvsolve.jit import cache_folder; print(cache_folder())"
    assert python(package, code, FVSOLVE_CACHE=str(tmp_path / "stated")) == [
        str(tmp_path / "stated")
    ]
    stated = {"FVSOLVE_CACHE": str(tmp_path / "file" / "x"), "TMPDIR": str(tmp_path)}
    fallback = Path(python(package, code, **stated)[0])
    assert fallback.parent == tmp_path and fallback.name.startswith("fvsolve-cache")


def test_only_hashed_folders_compile():
    """Functions of the core are hashed together; those of a feature are in its folder `kernels` or in laws of parts.

    Basins state all their compiled files.
    """
    users = {
        path
        for path in cache_folders.PACKAGE.rglob("*.py")
        if re.search(r"^@njit|\bnjit\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    features = cache_folders.PACKAGE / "features"
    hashed = {
        *cache_folders.compiled_sources(),
        *features.glob("*/kernels/*.py"),
        *features.glob("*/*/law*.py"),
        *COMPILED,
    }
    assert users <= hashed, "njit outside of the hashed sources would never be cached"


def test_declarations_and_lowerings_compile_nothing():
    """Of parts only laws are hashed, of basins only compiled files; edits elsewhere keep the compiled code."""
    hashed = {path.relative_to(cache_folders.PACKAGE) for path in cache_folders.compiled_sources()}
    of_basins = {
        path.relative_to(cache_folders.PACKAGE / "features" / "basins") for path in COMPILED
    }
    assert not any(path.parts[0] == "features" for path in hashed)
    assert {
        Path("liquid/grid_linear.py"),
        Path("basin_scalars.py"),
        Path("free_surface/law_patch_face.py"),
    } < of_basins
    assert {path.name[:3] for path in hashed if path.parts[0] == "parts"} == {"law"}
    assert not any(path.name.startswith(("part", "lower", "feature")) for path in of_basins)


def test_a_compiled_function_of_declared_arguments_takes_no_others():
    """Machine code does not check types: integers are accepted as numbers, other arrays are refused."""
    if not jit.COMPILING:
        pytest.skip("JIT is off")
    factor, solve, *_ = no_algebra()
    whole, numbers = np.zeros(3, dtype=np.int64), np.zeros(3)
    assert factor(whole, numbers, 1, numbers) == 0 and solve(whole, numbers, numbers) is None
    frozen = numbers.copy()
    frozen.flags.writeable = False
    for wrong in (
        whole,
        numbers.astype(np.float32),
        numbers[::2],
        frozen,
        np.zeros((3, 1)),
        [0.0],
        None,
    ):
        solve(whole, numbers.copy(), numbers)  # an array that does not exist any more
        with pytest.raises(
            TypeError, match="argument 1 is .*; expected a writable C-contiguous array"
        ):
            solve(whole, wrong, numbers)


def test_code_compiled_by_the_second_process_is_then_taken_from_the_store(monkeypatch):
    """The code for the second process runs, and the name that decides to skip it is that of a function in the store."""
    from fvsolve.core.kernels import compiled_functions
    from fvsolve.core.steppers import integrator

    asked = {}

    @contextlib.contextmanager
    def noted(code, cached):
        asked[cached] = code
        yield

    model = fvsolve.build(fvsolve.load("two-tanks"))
    monkeypatch.setattr(compiled_functions, "compile_in_parallel", noted)
    monkeypatch.setattr(integrator, "compile_in_parallel", noted)
    compiled_functions.Functions(model.functions.cast)
    integrator.attempt_of.__wrapped__("full", "banded")
    assert len(asked) == 2
    for cached, code in asked.items():
        exec(code, {})
        assert list(jit.code_folder().glob(f"{cached}-*{store.SUFFIX}")), cached
