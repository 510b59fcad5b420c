"""Public functions accept valid arguments and refuse others with a message; returned arrays are read-only."""

import inspect
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from reference.scenes import branched, still

import fvsolve
from fvsolve import FvsolveError, State, advance, initial_state, integrate, steppers, studies
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.studies import LineImpedance, Transfer, sweep


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
}


@pytest.mark.parametrize("name", BAD)
def test_states_of_another_size_or_kind_are_refused(name, model):
    y = BAD[name](model.start)
    for door in (model.rhs, model.evaluate, model.jacobian, model.observe):
        with pytest.raises(
            FvsolveError, match="y .*; expected a number for each|does not consist of real numbers"
        ):
            door(0.0, y)
    out = model.new_out()
    for door in (
        lambda y: model.fields(y, out),
        model.contents,
        lambda y: advance(model, State(0.0, y), 0.1),
    ):
        with pytest.raises(FvsolveError):
            door(y)


@pytest.mark.parametrize("t", [np.nan, np.inf, "0", None, 1j, [0.0, 1.0]])
def test_times_that_are_none_are_refused(t, model):
    for door in (model.rhs, model.evaluate, model.observe, State):
        with pytest.raises(
            FvsolveError, match=r"t = .* (is not a time|does not consist of real numbers)"
        ):
            door(t, model.start)
    with pytest.raises(FvsolveError, match="until = "):
        advance(model, initial_state(model), t)


def test_equivalent_values_are_accepted(model):
    y = model.start
    wanted = model.rhs(0.0, y)
    for same in (list(y), y.astype(np.float32) * 0 + y, np.repeat(y, 2)[::2]):
        assert np.array_equal(model.rhs(0, same), wanted)
    assert np.array_equal(State(0, list(y)).y, y)


def test_other_public_functions_are_as_strict(model):
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
    with pytest.raises(FvsolveError, match="memory is of type ndarray; expected a dict of arrays"):
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
    for result in (
        held,
        fvsolve.run(branched(fields=0), {"numerics.end": 0.05}),
        fvsolve.open_run(tmp_path / "run"),
    ):
        arrays = [
            result.t,
            result["gate.pressure"],
            result.seconds,
            *result.envelope["main"].values(),
        ]
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
        frame = result.frame()
        frame.iloc[0, 0] = -1.0
        assert frame.iloc[0, 0] == -1.0 and result["gate.pressure"][0] != -1.0
        with pytest.raises(FvsolveError, match="no probe"):
            result[3]


class Mine(Exception):
    """Exception of a caller."""


@pytest.mark.parametrize("error", [Mine, ValueError, StopIteration, FvsolveError, SystemExit])
def test_exceptions_of_progress_reach_the_caller(error, tmp_path):
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
    calls = [
        partial(door, 0.0, y) for door in (model.rhs, model.evaluate, model.jacobian, model.observe)
    ]
    calls += [lambda: model.observe(state), lambda: advance(model, state, 0.1)]
    calls += [lambda: fvsolve.solve(model, state, object())]
    for door in calls:
        with pytest.raises(FvsolveError) as error:
            door()
        assert f"y[5] = {value}, {model.state_names[5]};" in str(error.value)


WRONG = [3, None, "", [], np.zeros(3)]
WHAT_IS_THERE = {
    "case": lambda m: m.case,
    "model": lambda m: m,
    "state": initial_state,
    "y": lambda m: m.start,
}
WHAT_IS_THERE |= {"out": lambda m: m.new_out(), "sink": MemorySink, "f": lambda m: lambda t, y: -y}
PLAIN = {
    "t": 0.0,
    "until": 0.0,
    "y0": [1.0],
    "source": "valve-closure",
    "directory": "nowhere",
    "name": "mine",
    "k": 0,
    "text": "0 |\n--+--\n  | 1",
    "elevation": 0.0,
    "pressure": 1e5,
}


def public_functions(model):
    """Functions of `fvsolve`, methods of Model, and State, by name."""
    names = [name for name in fvsolve.__all__ if not isinstance(getattr(fvsolve, name), type)]
    found = {name: getattr(fvsolve, name) for name in names} | {"State": State}
    at_model = {name: getattr(model, name) for name in dir(model) if name[0] != "_"}
    found |= {
        f"Model.{name}": one
        for name, one in at_model.items()
        if callable(one) and name not in NO_DOORS
    }
    return found


NO_DOORS = ("functions", "handle", "picture")
LINE, FIRST = LineImpedance(1.0, 1.0, 0.5), Transfer([[-1.0]], [1.0], [1.0], 0.0)
OTHERS = {  # functions of results and studies, with valid arguments
    "Result.plot": (lambda there: there.result.plot, {"path": None}),
    "Result.plot_envelope": (lambda there: there.result.plot_envelope, {"path": None}),
    "Result.column": (lambda there: there.result.column, {"probe": "gate.pressure"}),
    "Result.si": (lambda there: there.result.si, {"probe": "gate.pressure"}),
    "Result.view": (
        lambda there: there.result.view,
        {"time": None, "field": None, "path": None, "contours": 0},
    ),
    "Result.animate": (
        lambda there: there.result.animate,
        {"path": None, "field": None, "contours": 0},
    ),
    "Case.elevation": (lambda there: there.case.elevation, {"name": "gate"}),
    "Case.wave_speed": (lambda there: there.case.wave_speed, {"name": "main"}),
    "Case.plot": (lambda there: there.case.plot, {"path": None}),
    "fit": (lambda there: studies.fit, {"sizes": [4, 2, 1], "errors": [16, 4, 1], "floor": 0.0}),
    "advection_limit": (
        lambda there: studies.advection_limit,
        {"scheme": "upwind", "method": "rk4", "courant": None},
    ),
    "advection_limits": (
        lambda there: studies.advection_limits,
        {"schemes": "upwind", "methods": "rk4", "courant": 1},
    ),
    "limit_of": (
        lambda there: studies.limit_of,
        {"weights": (0, 0, 1, 0, 0), "scheme": "mine", "method": "rk4", "courant": 1},
    ),
    "positive_real": (
        lambda there: studies.positive_real,
        {"numerator": [1], "denominator": [1, 1]},
    ),
    "line_positive_real": (
        lambda there: studies.line_positive_real,
        {"line": LINE, "shift": None, "tolerance": 1e-6},
    ),
    "sweep_positive_real": (
        lambda there: studies.sweep_positive_real,
        {"h": lambda s: 1.0, "slope": 0.0, "high": 1.0, "shift": 0.0, "tolerance": 1e-6},
    ),
    "state_positive_real": (
        lambda there: studies.state_positive_real,
        {"h": FIRST, "tolerance": 1e-9},
    ),
    "LineImpedance": (
        lambda there: partial(LineImpedance),
        {"z0": 1.0, "time": 1.0, "reflection": 0.5},
    ),
    "LineImpedance()": (lambda there: LINE, {"s": 1j}),
    "Transfer": (
        lambda there: partial(Transfer),
        {"a": [[-1.0]], "b": [1.0], "c": [1.0], "d": 0.0},
    ),
    "Transfer()": (lambda there: FIRST, {"s": 1j}),
    "limited_limits": (
        lambda there: studies.limited_limits,
        {"schemes": "muscl", "methods": "rk4", "cells": 3},
    ),
    "analyse": (lambda there: steppers.analyse, {"method": "rk4"}),
    "local_error": (
        lambda there: steppers.local_error,
        {"method": "rk4", "lam": -1.0, "h": 0.1, "y": 1.0},
    ),
    "global_error": (
        lambda there: steppers.global_error,
        {"method": "rk4", "lam": 1j, "h": 0.1, "steps": 3},
    ),
    "seen_frequency": (
        lambda there: steppers.seen_frequency,
        {"method": "rk4", "omega": 1.0, "h": 0.1},
    ),
    "stability_function": (lambda there: steppers.stability_function, {"method": "rk4"}),
    "pade": (lambda there: steppers.pade, {"k": 1, "m": 1}),
}
OTHER = [
    object(),
    "",
    "no\0where",
    "nowhere/at all",
    [None],
    ["a"],
    [np.nan],
    np.zeros((2, 3)),
    {"a": 1},
    b"x",
    np.nan,
    np.inf,
    -1,
    2.5,
    True,
    1 + 1j,
]
TAKEN = {  # values of OTHER that are valid, and the arguments that accept them
    "2.5": "fit.floor advection_limit.courant advection_limits.courant limit_of.courant line_positive_real.shift "
    "line_positive_real.tolerance sweep_positive_real.slope sweep_positive_real.high sweep_positive_real.shift "
    "sweep_positive_real.tolerance state_positive_real.tolerance LineImpedance.z0 LineImpedance.time seen_frequency.h",
    "2.5 -1": "positive_real.numerator positive_real.denominator LineImpedance.reflection Transfer.d local_error.h "
    "global_error.h seen_frequency.omega",
    "2.5 -1 (1+1j)": "LineImpedance().s Transfer().s local_error.lam local_error.y global_error.lam",
    "'nowhere/at all' 'no\\x00where'": "limit_of.scheme",
}
TAKEN = {one: given for given, many in TAKEN.items() for one in many.split()}


@pytest.fixture(scope="module")
def there(model):
    return SimpleNamespace(
        case=model.case, result=fvsolve.run(branched(fields=0), {"numerics.end": 0.01})
    )


@pytest.mark.parametrize("name", OTHERS)
def test_results_and_studies_accept_their_documented_arguments_and_refuse_all_else(
    name, there, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    make, plain = OTHERS[name]
    door, bad = make(there), []
    for one in plain:
        for given in OTHER:
            try:
                door(**{**plain, one: given})
                if repr(given) not in TAKEN.get(f"{name}.{one}", ""):
                    bad.append(f"{name}: {one} = {given!r} was taken")
            except FvsolveError as error:
                assert len(str(error)) > 10
            except Exception as error:  # any other exception is a fault
                bad.append(f"{name}: {one} = {given!r}: {error!r}")
    assert bad == []
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("given, words", [
    ("gate.presure", 'did you mean "gate.pressure"'), (3, "no probe 3"),
])  # fmt: skip
def test_a_result_suggests_the_nearest_probe(given, words, there):
    for door in (there.result.column, there.result.si):
        with pytest.raises(FvsolveError, match=words):
            door(given)


def test_a_picture_that_cannot_be_written_is_named(there, tmp_path):
    for name, words in (("no/such/folder.png", "folder.png"), ("gate.flow", "flow")):
        for plot in (there.result.plot, there.result.plot_envelope, there.case.plot):
            with pytest.raises(FvsolveError, match=f"{words}.*cannot be written"):
                plot(tmp_path / name)


def test_a_study_states_the_fault_of_its_argument():
    for study, given, words in (
        (studies.sweep, {"vary": {"nodes.pond.level": 3}}, "expected a table of lists"),
        (studies.failure_map, {"key": ["links.main.cells"]}, "expected a key and its values"),
        (studies.order, {"cells": 3, "refine": "time"}, "cells = 3: only steps are refined here"),
        (studies.ladder, {"target": "0.01"}, 'target = "0.01"; expected a finite number'),
    ):
        with pytest.raises(FvsolveError, match=words):
            study(still(), **given)
    with pytest.raises(FvsolveError, match="limited schemes are muscl, weno5"):
        studies.limited_limits("fromm", "rk4")
    with pytest.raises(FvsolveError, match="no input named 3"):
        model = fvsolve.build(fvsolve.load(still()))
        advance(model, initial_state(model), 1.0, {3: 1.0})
    for bad in (lambda s: "a", lambda s: np.zeros(3), lambda s: {}):
        with pytest.raises(FvsolveError, match="expected a number for each"):
            studies.sweep_positive_real(bad, 0.0, 1.0)


def test_every_public_function_states_its_expectation(model, tmp_path, monkeypatch):
    """Each argument of each public function accepts a wrong value or raises an error of fvsolve with a text."""
    monkeypatch.chdir(tmp_path)
    bad = []
    for name, door in public_functions(model).items():
        wanted = inspect.signature(door).parameters.values()
        there = {
            one.name: WHAT_IS_THERE[one.name](model)
            if one.name in WHAT_IS_THERE
            else PLAIN.get(one.name)
            for one in wanted
            if one.default is one.empty
        }
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
                except Exception as error:  # any other exception is a fault
                    bad.append((name, one.name, given, repr(error)))
    assert bad == []
