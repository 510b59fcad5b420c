"""Hypothesis draws equal inputs whatever modules are loaded, and tries failed inputs first."""

from __future__ import annotations

import ast
import importlib.util
import sys

import hypothesis_profiles
from hypothesis import given, seed
from hypothesis import strategies as st
from hypothesis.internal import constants_ast
from hypothesis.internal.conjecture import providers
from hypothesis_profiles import examples


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
    monkeypatch.setattr(providers, "_local_constants", providers._local_constants | constants_ast.Constants())
    load_constants(tmp_path, 900_000)
    assert drawn() != before  # hypothesis draws constants by default, so this test can fail


def test_an_input_that_failed_once_is_tried_first(tmp_path, monkeypatch):
    monkeypatch.setattr(hypothesis_profiles, "KEPT", tmp_path)
    (tmp_path / "test_hypothesis_profiles.check.txt").write_text("[{'number': 41.25}]", encoding="utf-8")
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
