"""Public doors take what they can take, and say so of everything else; what they hand out is not to be written into."""

from __future__ import annotations

import inspect
from functools import partial

import numpy as np
import pytest
from test_output import branched
from test_text_as_it_stands import still

import fvsolve
from fvsolve import FvsolveError, State, advance, initial_state, integrate
from fvsolve.output.memory import MemorySink
from fvsolve.studies import sweep


@pytest.fixture(scope="module")
def model():
    return fvsolve.build(fvsolve.load(branched(fields=0)))


BAD = {
    "too short": lambda y: np.zeros(3),
    "none": lambda y: np.zeros(0),
    "too long": lambda y: np.zeros(y.size + 1),
    "a column": lambda y: y[:, None],
    "a number": lambda y: 0.0,
    "complex": lambda y: y + 1j,
    "text": lambda y: "y",
    "texts": lambda y: ["a"] * y.size,
    "nothing": lambda y: None,
    "ragged": lambda y: [[0.0], [0.0, 1.0]],
    "objects": lambda y: np.array([None] * y.size),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_states_of_another_size_or_kind_are_refused(name, model):
    y = BAD[name](model.start)
    for door in (model.rhs, model.evaluate, model.jacobian, model.observe):
        with pytest.raises(FvsolveError, match="y .*; wanted a number for each|is not made of real numbers"):
            door(0.0, y)
    out = model.new_out()
    for door in (lambda y: model.fields(y, out), model.contents, lambda y: advance(model, State(0.0, y), 0.1)):
        with pytest.raises(FvsolveError):
            door(y)


@pytest.mark.parametrize("t", [np.nan, np.inf, "0", None, 1j, [0.0, 1.0]])
def test_times_that_are_none_are_refused(t, model):
    for door in (model.rhs, model.evaluate, model.observe, State):
        with pytest.raises(FvsolveError, match=r"t = .* (is no time|is not made of real numbers)"):
            door(t, model.start)
    with pytest.raises(FvsolveError, match="until = "):
        advance(model, initial_state(model), t)


def test_what_means_the_same_is_taken(model):
    y = model.start
    wanted = model.rhs(0.0, y)
    for same in (list(y), y.astype(np.float32) * 0 + y, np.repeat(y, 2)[::2]):
        assert np.array_equal(model.rhs(0, same), wanted)
    assert np.array_equal(State(0, list(y)).y, y)


def test_other_doors_are_as_wary(model):
    start = initial_state(model)
    with pytest.raises(FvsolveError, match="waves has shape"):
        model.cell_pressure(0, np.zeros(3))
    with pytest.raises(FvsolveError, match="waves has shape"):
        model.cell_pressure(7, np.zeros(30))
    with pytest.raises(FvsolveError, match="pressure = "):
        model.head("1 bar", 0.0)
    with pytest.raises(FvsolveError, match="out has shape"):
        model.fields(model.start, np.zeros(2))
    with pytest.raises(FvsolveError, match="takes a Model and a State"):
        advance(start, model, 1.0)
    with pytest.raises(FvsolveError, match="inputs = "):
        advance(model, start, 1.0, ["valve.opening"])
    with pytest.raises(FvsolveError, match="memory of 3 numbers"):
        fvsolve.solve(model, State(0.0, model.start, np.ones(3)), object())
    with pytest.raises(FvsolveError, match="cannot be called"):
        fvsolve.run(still(), progress=3)


@pytest.mark.parametrize("y0, t, more, words", [
    (np.zeros((2, 2)), [0, 1], {}, "y0 has shape"), ([1j], [0, 1], {}, "y0 = "), ([1.0], [0, 1j], {}, "t = "),
    ([1.0], [0, 1], {"method": 3}, "method = 3"), ([1.0], [0, 1], {"counts": []}, "counts = "),
])  # fmt: skip
def test_integrate_takes_rows_of_real_numbers(y0, t, more, words):
    with pytest.raises(FvsolveError, match=words):
        integrate(lambda t, y: -y, y0, t, **more)


def test_arrays_of_a_result_are_not_to_be_written_into(tmp_path):
    held = fvsolve.run(branched(fields=0), {"numerics.end": 0.05}, tmp_path / "run")
    for result in (held, fvsolve.run(branched(fields=0), {"numerics.end": 0.05}), fvsolve.open_run(tmp_path / "run")):
        arrays = [result.t, result["gate.pressure"], result.seconds, *result.envelope["main"].values()]
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
        frame = result.frame()
        frame.iloc[0, 0] = -1.0
        assert frame.iloc[0, 0] == -1.0 and result["gate.pressure"][0] != -1.0
        with pytest.raises(FvsolveError, match="no probe"):
            result[3]


class Mine(Exception):
    """Raised by a caller."""


@pytest.mark.parametrize("error", [Mine, ValueError, StopIteration, FvsolveError, SystemExit])
def test_what_progress_raises_reaches_the_caller(error, tmp_path):
    def progress(*_):
        raise error("mine")

    slow = {"numerics.step": "1 us", "numerics.method": "rk4"}
    for more in ({}, {"out": tmp_path / "run", "force": True}):
        with pytest.raises(error, match="mine"):
            fvsolve.run(still(), slow, progress=progress, **more)
    for first in (0, 1, 2):

        def late(done, total, what, first=first):
            if done == first:
                raise error("mine")

        with pytest.raises(error, match="mine"):
            sweep(still(), {"nodes.pond.level": [-1.0, -2.0]}, progress=late)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_state_that_is_not_finite_is_refused_with_the_name_of_the_first(value, model):
    y = model.start.copy()
    y[[5, 9]] = value
    state = State(0.0, y)
    doors = [partial(door, 0.0, y) for door in (model.rhs, model.evaluate, model.jacobian, model.observe)]
    doors += [lambda: model.observe(state), lambda: advance(model, state, 0.1)]
    doors += [lambda: fvsolve.solve(model, state, object())]
    for door in doors:
        with pytest.raises(FvsolveError) as error:
            door()
        assert f"y[5] = {value}, {model.state_names[5]};" in str(error.value)


WRONG = [3, None, "", [], np.zeros(3)]
WHAT_IS_THERE = {"case": lambda m: m.case, "model": lambda m: m, "state": initial_state, "y": lambda m: m.start}
WHAT_IS_THERE |= {"out": lambda m: m.new_out(), "sink": MemorySink, "f": lambda m: lambda t, y: -y}
PLAIN = {"t": 0.0, "until": 0.0, "y0": [1.0], "source": "valve-closure", "directory": "nowhere", "name": "mine", "k": 0,
         "text": "0 |\n--+--\n  | 1", "elevation": 0.0, "pressure": 1e5}  # fmt: skip


def doors(model):
    """All that is called in `fvsolve` and at a Model, and its arguments."""
    names = [name for name in fvsolve.__all__ if not isinstance(getattr(fvsolve, name), type)]
    found = {name: getattr(fvsolve, name) for name in names} | {"State": State}
    at_model = {name: getattr(model, name) for name in dir(model) if name[0] != "_"}
    found |= {f"Model.{name}": one for name, one in at_model.items() if callable(one) and name not in NO_DOORS}
    return found


NO_DOORS = ("functions", "handle", "picture")


def test_every_door_says_what_it_wants(model, tmp_path, monkeypatch):
    """Anything at every argument of every door is taken, or refused by a text of ours."""
    monkeypatch.chdir(tmp_path)
    bad = []
    for name, door in doors(model).items():
        wanted = inspect.signature(door).parameters.values()
        there = {one.name: WHAT_IS_THERE[one.name](model) if one.name in WHAT_IS_THERE else PLAIN.get(one.name)
                 for one in wanted if one.default is one.empty}  # fmt: skip
        if name == "integrate":
            there["t"] = [0.0, 1.0]
        if name == "run":
            there["case"] = model
        for one in wanted:
            for given in WRONG:
                try:
                    door(**{**there, one.name: given})
                except FvsolveError as error:
                    assert str(error)
                except Exception as error:  # which none of these is
                    bad.append((name, one.name, given, repr(error)))
    assert bad == []
