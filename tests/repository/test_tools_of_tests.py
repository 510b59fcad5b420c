"""Tools of the tests: names of their folders, the tally, planted faults, and profiles of hypothesis.

The tally lists schemes, methods, parts, laws, commands and tests that did not run. The planted faults fit the present
package. Hypothesis draws equal inputs whatever modules are loaded, and tries failed inputs first.
"""

import ast
import functools
import importlib.util
import sys
from collections import Counter
from pathlib import Path

import choose_quick_tests
import drawn_faults
import hypothesis_profiles
import planted_faults
import pytest
from hypothesis import given, seed
from hypothesis import strategies as st
from hypothesis.internal import constants_ast
from hypothesis.internal.conjecture import providers
from hypothesis_profiles import examples
from reference import folders
from reference.pairs import is_in_turn
from reference.scenes import lake, pipe, reservoir, scene
from tally import Tally, expected, unknown_names

import fvsolve

OTHERS = {"repository", "invariance", "reference"}  # tests of several packages or of none


def test_every_folder_of_tests_is_a_package_or_an_exception():
    tests = folders.CASES.parent / "tests"
    stand = {path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py")}
    stages = [
        PACKAGE,
        *(PACKAGE / name for name in ("core", "exchange", "features", "report", "studies")),
    ]
    assert stand - OTHERS <= {path.stem for stage in stages for path in stage.iterdir()}


def test_a_name_that_was_not_run_is_missing():
    tally = Tally()
    tally.add({kind: sorted(names) for kind, names in expected().items()})
    assert tally.missing() == []
    tally.names["scheme"].remove("weno5")
    tally.names["command"] -= {"run", "check"}
    assert tally.missing() == ["scheme: weno5", "command: check, run"]


def test_a_listed_test_that_is_not_there_is_named():
    tally = Tally()
    tally.add(
        {kind: sorted(names) for kind, names in expected().items()}
        | {"unknown": ["tests/a.py::test_gone"]}
    )
    assert tally.missing() == ["tests/durations.json: tests/a.py::test_gone is not a test"]


def test_a_recorded_cache_counts_its_results_as_calls_and_can_be_cleared():
    def doubled(x):
        choose_quick_tests.CALLED.add("a compiled function")
        return [2 * x]

    doubled.__module__ = "fvsolve.somewhere"
    cached = choose_quick_tests.recording(functools.cache)(doubled)
    first = cached(2)
    choose_quick_tests.CALLED.clear()
    assert cached(2) is first and choose_quick_tests.CALLED == {"a compiled function"}
    cached.cache_clear()
    assert cached(2) == first and cached(2) is not first


@pytest.mark.in_turn
@pytest.mark.parametrize("first, second", [(0, 0), (1, 1), (2, 4), (3, 9)])
@pytest.mark.parametrize("letter", ["a", "b"])
@pytest.mark.parametrize("word", ("x", "y", "z"))
def test_combinations_in_turn_contain_each_value(request, first, second, letter, word):
    assert second == first**2
    chosen = [(0, "a", "x"), (1, "b", "y"), (2, "a", "z"), (3, "b", "x")]
    assert is_in_turn(request.node) == ((first, letter, word) in chosen)


def test_only_tests_that_cannot_be_missing_for_want_of_a_library_are_unknown():
    """A file without collected tests needs an optional library; a file that is gone or collected has no such reason."""
    here = "tests/repository/test_tools_of_tests.py"
    listed = {f"{here}::test_a": 1.0, f"{here}::test_gone": 1.0, "tests/gone.py::test_b": 1.0}
    listed |= {"tests/solve/test_ranks.py::test_ranks": 1.0}
    assert unknown_names(listed, [f"{here}::test_a"]) == {
        f"{here}::test_gone",
        "tests/gone.py::test_b",
    }


def test_a_run_counts_its_parts_scheme_method_and_law(request):
    from conftest import TALLY

    tally = request.config.stash[TALLY]
    before, tally.names = tally.names, Tally().names
    try:
        nodes = {"a": lake(30.0), "b": reservoir(2e5)}
        links = {"p": pipe("a", "b", 100.0, 0.1, 1000.0, 4, initial_flow=0.0)}
        fvsolve.run(scene(nodes, links, 0.1, {"scheme": "fromm", "method": "heun", "courant": 0.4}))
        assert tally.plain() == {
            "law": ["linear"],
            "method": ["heun"],
            "part": ["pipe", "reservoir"],
            "scheme": ["fromm"],
        }
    finally:
        for kind, names in tally.names.items():
            before[kind] |= names
        tally.names = before


PACKAGE = Path(fvsolve.__file__).parent


@pytest.mark.parametrize("fault", planted_faults.FAULTS, ids=lambda fault: fault.path)
def test_each_fault_changes_a_single_place_and_still_compiles(fault):
    text = (PACKAGE / fault.path).read_text(encoding="utf-8")
    planted = fault.planted(text)
    assert planted != text
    compile(planted, fault.path, "exec")


def test_there_are_enough_and_each_folder_of_the_package_has_a_fault():
    folders = {path.parent.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py")}
    folders -= {Path("data")}  # printed tables, and one function that reads them
    folders -= {Path("features"), Path("exchange")}  # a docstring
    # a folder for each part
    of_parts = {path.parent.relative_to(PACKAGE) for path in PACKAGE.glob("*/**/part.py")}
    count = Counter(Path(fault.path).parent for fault in planted_faults.FAULTS)
    assert sum(count.values()) == 59
    assert folders - of_parts <= set(count)
    assert sum(count[folder] for folder in count if folder.parts[:1] == ("parts",)) >= 4


def test_drawn_faults_follow_their_seed_and_still_compile():
    """Each kind of fault in each group of files occurs; no two faults are in a file, and each changes a single line."""
    faults = drawn_faults.drawn(1, 40)
    assert faults == drawn_faults.drawn(1, 40) and faults[:4] != drawn_faults.drawn(2, 4)
    assert len({fault.path for fault in faults}) == 40
    assert {drawn_faults.group_of(Path(fault.path)) for fault in faults[:4]} == set(
        drawn_faults.GROUPS
    )
    for fault in faults:
        text = (PACKAGE / fault.path).read_text(encoding="utf-8")
        planted = fault.planted(text)
        compile(planted, fault.path, "exec")
        lines = zip(text.splitlines(), planted.splitlines(), strict=True)
        assert sum(before != after for before, after in lines) == 1
        assert text[: fault.start] == planted[: fault.start]


@pytest.mark.parametrize(
    "kind, source, changes",
    [
        ("sign", "return a - (b + c)", [("-", "+"), ("+", "-")]),
        ("sign", 'return "a" + b', []),
        ("factor", "return 2.0 * a + 3 * b", [("", "1.01 * ")]),
        ("comparison", "return a < b and c >= d", [("<", ">"), (">=", "<=")]),
        ("index", "return a[k] + b[k + 1] + c[name]", [("k", "k - 1"), ("k + 1", "k")]),
    ],
)
def test_places_of_faults_are_operators_and_indices(kind, source, changes):
    text = f"LIMIT = 2.0 * 3.0 - 1.0\n\n\ndef f(a, b, c, d, k):\n    # a - b\n    {source}\n"
    places = list(drawn_faults.Places(text).of_kind(kind))
    assert sorted(place[1:] for place in places) == sorted(changes)
    assert all(text.startswith(old, start) for start, old, _ in places)


def test_a_fault_is_planted_at_its_own_place():
    text = "x = a + b\ny = a + b\n"
    assert drawn_faults.DrawnFault("x.py", 16, "+", "-").planted(text) == "x = a + b\ny = a - b\n"
    with pytest.raises(ValueError, match="does not stand"):
        drawn_faults.DrawnFault("x.py", 15, "+", "-").planted(text)


def drawn() -> list[float]:
    values = []

    @seed(1)
    @examples(100)
    @given(st.lists(st.floats(), min_size=20, max_size=20))
    def record(numbers):
        values.append(repr(numbers))

    record()
    return values


def load_constants(folder, first: int) -> None:
    """Load a module with 400 numbers that occur nowhere else."""
    path = folder / f"constants_{first}.py"
    path.write_text("\n".join(f"x{k} = {first + k}.015625" for k in range(400)), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)


def test_constants_of_a_module_that_is_loaded_are_not_drawn(tmp_path, monkeypatch):
    before = drawn()
    load_constants(tmp_path, 700_000)
    assert drawn() == before
    monkeypatch.setattr(providers, "is_local_module_file", constants_ast.is_local_module_file)
    monkeypatch.setattr(
        providers, "_local_constants", providers._local_constants | constants_ast.Constants()
    )
    load_constants(tmp_path, 900_000)
    assert drawn() != before  # hypothesis draws constants by default, so this test can fail


def test_an_input_that_failed_once_is_tried_first(tmp_path, monkeypatch):
    monkeypatch.setattr(hypothesis_profiles, "KEPT", tmp_path)
    (tmp_path / "test_tools_of_tests.check.txt").write_text("[{'number': 41.25}]", encoding="utf-8")
    tried = []

    def check(number):
        tried.append(number)

    examples(3)(given(number=st.floats(0.0, 1.0))(check))()
    assert tried[0] == 41.25 and len(tried) == 4


def test_each_file_of_failing_inputs_names_a_single_test():
    for path in hypothesis_profiles.KEPT.glob("*.txt"):
        module, test = path.stem.split(".")
        texts = [file.read_text(encoding="utf-8") for file in path.parents[1].rglob(f"{module}.py")]
        assert sum(f"def {test}(" in text for text in texts) == 1
        assert ast.literal_eval(path.read_text(encoding="utf-8"))
