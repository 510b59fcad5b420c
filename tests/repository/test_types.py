"""Public signatures are fully annotated, and a program that uses public names has the stated types (mypy, .ci/run)."""

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pytest

import fvsolve


def public_functions() -> Iterator[tuple[str, Any]]:
    """Public functions, and functions and properties of public classes with public names."""
    for name in fvsolve.__all__:
        value = getattr(fvsolve, name)
        if inspect.isfunction(value):
            yield name, value
        for key, item in vars(value).items() if inspect.isclass(value) else ():
            function = getattr(item, "fget", getattr(item, "func", getattr(item, "__func__", item)))
            if not key.startswith("_") and inspect.isfunction(function):
                yield f"{name}.{key}", function


@pytest.mark.parametrize(
    "name, function", [pytest.param(*pair, id=pair[0]) for pair in public_functions()]
)
def test_a_public_function_is_fully_annotated(name: str, function: Any) -> None:
    signature = inspect.signature(function)
    types = {key: one.annotation for key, one in signature.parameters.items() if key != "self"}
    lost = [
        key
        for key, type_ in (types | {"return": signature.return_annotation}).items()
        if type_ is inspect._empty
    ]
    assert not lost, f"{name}: no type of {lost}"


def test_type_checkers_see_every_public_name() -> None:
    stub = Path(fvsolve.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    listed = [line.split()[-1] for line in stub.splitlines() if line.startswith("from fvsolve.")]
    assert sorted(listed) == list(fvsolve.__all__)


def test_a_typed_program_runs(tmp_path: Path) -> None:
    case = assert_type(fvsolve.load("two-tanks", {"output.every": 40.0}), fvsolve.Case)
    model = assert_type(fvsolve.vary(fvsolve.build(case), {"nodes.high.level": 5.0}), fvsolve.Model)
    result = assert_type(fvsolve.run(model), fvsolve.Result)
    assert_type(result.t, np.ndarray)
    assert_type(result["high.level"], np.ndarray)
    assert assert_type(result.ok, bool) and assert_type(result.reason, str) == "finished"
    start = assert_type(fvsolve.initial_state(model), fvsolve.State)
    state = assert_type(fvsolve.advance(model, start, 1.0, {}), fvsolve.State)
    assert (
        assert_type(state.t, float) == 1.0 and assert_type(model.rhs(state), np.ndarray).size == 2
    )
    values = assert_type(
        fvsolve.integrate(lambda t, y: -y, [1.0], [0.0, 1.0], rtol=1e-9), np.ndarray
    )
    assert values[-1, 0] == pytest.approx(np.exp(-1.0), rel=1e-7)
    with pytest.raises(fvsolve.CaseError):
        fvsolve.run("two-tanks", set={"numerics.ende": 2.0})
