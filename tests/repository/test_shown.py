"""Objects as text, notebook table, frame and picture; shipped cases by name; tableaus from arrays and files."""

import base64
import functools
import importlib
import json
import subprocess
import sys
from fractions import Fraction
from importlib.resources import files

import numpy as np
import pytest

import fvsolve
from fvsolve import advance, build, initial_state, load, run, tableau
from fvsolve.core.steppers import METHODS
from fvsolve.errors import FvsolveError
from fvsolve.studies import advection_limits, chart, order, response, sweep

CASE = "two-tanks"
ROW = "0 |\n1 | 1\n--+--\n | 1/2 1/2\n"


@functools.cache
def object_of(kind: str):
    """Object of one of the kinds, which the tests of this module share."""
    if kind == "State":
        return advance(object_of("Model"), initial_state(object_of("Model")), 1.0)
    return {
        "Case": lambda: load(CASE),
        "Model": lambda: build(object_of("Case")),
        "Result": lambda: run(object_of("Model")),
        "Order": lambda: order(
            CASE, {"numerics.step": 4.0}, refine="time", levels=3, methods="rk4"
        ),
        "Sweep": lambda: sweep(CASE, {"numerics.rtol": [1e-4, 1e-5]}),
        "Chart": lambda: chart(CASE, methods=["rk4"], step=[4.0, 2.0]),
    }[kind]()


KINDS = ["Case", "Model", "State", "Result", "Order", "Sweep", "Chart"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_object_has_a_line_a_table_and_a_picture(kind, tmp_path):
    one = object_of(kind)
    line, page = repr(one), one._repr_html_()
    assert line.startswith(f"<{kind} ") and len(line) < 160 and "\n" not in line
    assert "<table>" in page and line.replace("<", "&lt;").partition(" ")[0] in page
    data = base64.b64decode(page.partition("data:image/png;base64,")[2].partition('"')[0])
    assert data.startswith(b"\x89PNG") and 2000 < len(data) < 150_000
    frame = one.frame()
    assert len(frame) > 0 and len(frame.columns) > 0
    one.plot(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 5000


def test_a_notebook_shows_the_table_alone_if_nothing_can_be_drawn(monkeypatch):
    for kind in KINDS:
        monkeypatch.setattr(
            type(object_of(kind)), "plot", lambda *_: importlib.import_module("no_matplotlib")
        )
        page = object_of(kind)._repr_html_()
        assert "<table>" in page and "<img" not in page


def test_tables_hold_the_numbers():
    assert object_of("State").frame()["y"].to_numpy() == pytest.approx(
        object_of("State").y, abs=0.0
    )
    assert list(object_of("Model").frame()["state"]) == object_of("Model").state_names
    assert list(object_of("Sweep").frame()["numerics.rtol"]) == [1e-4, 1e-5]
    assert len(object_of("Order").frame()) == 3 and len(object_of("Chart").frame()) == len(
        object_of("Chart").points
    )


def test_names_in_a_notebook_are_text_and_no_markup():
    found = sweep(CASE, {"title": ["a<b>", "c"], "output.probes": [[]]})
    assert "a<b>" not in found._repr_html_() and "a&lt;b&gt;" in found._repr_html_()


def test_a_shipped_case_goes_by_its_name_as_on_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / CASE).mkdir()  # a folder is not a case
    assert run(CASE).summary["case"] == CASE
    (tmp_path / CASE).rmdir()
    with pytest.raises(FvsolveError):
        load("no-such-case")
    (tmp_path / CASE).write_text("schema = 2\n")  # an existing file takes precedence
    with pytest.raises(FvsolveError, match="fault"):
        load(CASE)


@pytest.mark.parametrize(
    "name", ["valve-clsure", "valve_closure", "valve-closure.toml", "cases2/valve-clsure.toml"]
)
def test_a_misspelled_shipped_case_is_named_in_python(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for function in (
        run,
        load,
        order,
        chart,
        lambda case: response(case, "gate"),
        lambda case: sweep(case, {"a": [1]}),
    ):
        with pytest.raises(
            FvsolveError,
            match='there is no such file; did you mean the shipped case "valve-closure"',
        ):
            function(name)
    (tmp_path / "valve-closer.toml").write_text("")  # a file of the caller takes precedence
    with pytest.raises(FvsolveError, match='did you mean "valve-closer.toml"'):
        load("valve-closer")


def test_a_misspelled_shipped_case_is_named_by_commands(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in (("run",), ("check",), ("energy",), ("precompile", "--for"), ("new",)):
        code, _, err = fvs(*command, "valve-clsure")
        assert (
            code == 2
            and 'no shipped case valve-clsure; did you mean "valve-closure"'
            in err.replace("no file and ", "")
        )


def test_a_misspelled_run_directory_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(CASE, out="runs/two-tanks", pictures=False)
    for name in ("runs/two-tank", "two-tanks", "two_tanks"):
        with pytest.raises(FvsolveError, match='no summary.json.*did you mean "runs/two-tanks"'):
            fvsolve.open_run(name)
    with pytest.raises(FvsolveError, match="or finish the run$"):
        fvsolve.open_run("something-else")


def test_a_tableau_from_arrays_is_that_of_its_text():
    text = tableau("shown-text", ROW)
    for a in ([[0, 0], [1, 0]], np.array([[0.0, 0.0], [1.0, 0.0]])):
        method = tableau("shown-array", a, [Fraction(1, 2), Fraction(1, 2)], [0, 1])
        assert (
            np.array_equal(method.a, text.a)
            and np.array_equal(method.b, text.b)
            and np.array_equal(method.c, text.c)
        )
        assert (method.order, method.stages) == (text.order, text.stages) == (2, 2)
    # c defaults to the row sums
    assert tableau("shown-array", A=[[0, 0], [0.5, 0]], b=[0.0, 1.0]).order == 2
    pair = tableau("shown-array", [[0, 0], [1, 0]], [[0.5, 0.5], [1.0, 0.0]], [0.0, 1.0])
    assert pair.adaptive and (pair.order, pair.error_order) == (2, 1)


def test_a_tableau_of_third_parts_in_floating_point_retains_its_order():
    a = [[0, 0, 0], [1 / 3, 0, 0], [0, 2 / 3, 0]]
    assert tableau("shown-heun", a, [1 / 4, 0, 3 / 4]).order == METHODS["heun"].order == 3


@pytest.mark.parametrize(
    "a, b, c", [([[0, 0]], [1], None), ([[0]], [1, 2], None), ([[0]], [1], [0, 1])]
)
def test_arrays_of_another_shape_are_refused(a, b, c):
    with pytest.raises(FvsolveError, match="expected"):
        tableau("shown-wrong", a, b, c)
    with pytest.raises(FvsolveError, match="b is missing"):
        tableau("shown-wrong", a)
    for given in ({}, {"text": ROW, "A": a}):
        with pytest.raises(FvsolveError, match="either text or A"):
            tableau("shown-wrong", **given)


def test_a_file_of_a_printed_tableau_is_a_method_on_the_command_line(fvs, tmp_path):
    path = tmp_path / "my-heun2.txt"
    path.write_text(ROW)
    code, out, _ = fvs(
        "order",
        CASE,
        "--refine",
        "time",
        "--levels",
        "3",
        "--method",
        path,
        "--set",
        "numerics.step=4",
        "--out",
        tmp_path / "order",
        "--json",
    )
    assert code == 0 and "my-heun2" in out
    assert json.loads(fvs("methods", path, "--out", tmp_path / "m.png", "--json")[1])["order"] == 2
    path.write_text("0 | what\n")
    code, _, err = fvs("methods", path)
    assert code == 2 and "my-heun2.txt" in err


def test_a_response_at_a_number_is_a_number():
    found = response("pipe-tiny-chamber", "body", scheme="upwind")
    assert isinstance(found(1j), complex) and np.shape(found([1j, 2j])) == (2,)
    assert found([1j])[0] == found(1j)


def test_the_version_is_printed(fvs):
    code, out, _ = fvs("--version")
    assert code == 0 and out.strip() == f"fvsolve {fvsolve.__version__}"
    assert files("fvsolve").joinpath("py.typed").is_file()
    assert (
        subprocess.run(
            [sys.executable, "-c", "import fvsolve; print(fvsolve.__version__)"],
            capture_output=True,
            text=True,
        ).stdout.strip()
        == fvsolve.__version__
    )


def test_the_first_run_on_a_machine_states_that_it_compiles(fvs, tmp_path, monkeypatch):
    from fvsolve import jit
    from fvsolve.cli import app

    app.announce_compilation.cache_clear()
    monkeypatch.setattr(jit, "is_cold", lambda: True)
    assert "compiles" in fvs("check", CASE)[2]
    assert "compiles" not in fvs("check", CASE)[2]


def test_a_name_stands_for_a_list_of_it_in_all_studies():
    one = order(CASE, {"numerics.step": 4.0}, refine="time", levels=3, methods="rk4")
    both = order(CASE, {"numerics.step": 4.0}, refine="time", levels=3, methods=["rk4", "heun"])
    assert one.method == "rk4" and [found.method for found in both] == ["rk4", "heun"]
    assert {
        point.setting.method for point in chart(CASE, methods="rk4", step=[4.0, 2.0]).points
    } >= {"rk4"}
    assert [one.method for one in advection_limits("upwind", "rk4")] == ["rk4"]


def test_a_model_reads_any_state():
    model = build(load(CASE))
    state = advance(model, initial_state(model), 1.0)
    assert model.observe(state) == pytest.approx(model.observe(state.t, state.y), abs=0.0)
    assert model.observe(state).shape == (len(model.probes),)
