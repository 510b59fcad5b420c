"""Manufactured solutions: start, source and exact solution as functions of x and t, and values inside pipes."""

import numpy as np
import pytest
from pytest import approx
from reference import scenes

from fvsolve.errors import FvsolveError
from fvsolve.studies import order

LENGTH, SPEED, DIAMETER = 100.0, 1000.0, 0.5
AREA, K, W = scenes.area(DIAMETER), 1.5 * np.pi / LENGTH, 300.0


def case(cells: int = 20, friction=scenes.NO_FRICTION, **numerics) -> dict:
    """Case of a pipe between a reservoir and a dead end."""
    nodes = {"lake": scenes.reservoir(3e5), "end": scenes.junction()}
    links = {"main": scenes.pipe("lake", "end", LENGTH, DIAMETER, SPEED, cells, friction=friction)}
    given = {"scheme": "upwind5", "method": "verner-7", "courant": 0.5, **numerics}
    probes = ["end.pressure", "main.pressure@0.37", "main.flow@0.61", "main.flow@0"]
    return scenes.scene(nodes, links, 0.15, given, probes, every=0.01)


def free(pipe, x, t):
    """Pressure and flow of a standing wave without source."""
    swing = 1e5 * AREA / (scenes.RHO * SPEED)
    return 3e5 + 1e5 * np.sin(K * x) * np.cos(K * SPEED * t), -swing * np.cos(K * x) * np.sin(K * SPEED * t)


def driven(pipe, x, t):
    """Pressure and flow of waves that need a source."""
    return 3e5 + 1e5 * np.sin(K * x) * np.cos(W * t), 0.3 * np.cos(K * x) * np.sin(2 * W * t)


def drive(pipe, x, t):
    """Source of `driven`: p_t A / a^2 + rho q_x, and rho q_t + A p_x."""
    p_t, p_x = -W * 1e5 * np.sin(K * x) * np.sin(W * t), K * 1e5 * np.cos(K * x) * np.cos(W * t)
    q_t, q_x = 0.6 * W * np.cos(K * x) * np.cos(2 * W * t), -0.3 * K * np.sin(K * x) * np.sin(2 * W * t)
    return AREA / SPEED**2 * p_t + scenes.RHO * q_x, scenes.RHO * q_t + AREA * p_x


@pytest.mark.parametrize(("scheme", "p"), [("upwind", 1), ("fromm", 2), ("upwind3", 3), ("upwind5", 5)])
def test_a_standing_wave_shows_the_order_of_the_scheme(scheme, p):
    cells = {1: 80, 5: 15}.get(p, 40)
    found = order(case(cells), schemes=scheme, exact=free, levels=5)
    assert found.kind == "function"
    fit = found.fits["pressure"]["L2"]
    assert fit.order == approx(p, abs=0.15), fit


@pytest.mark.parametrize(("scheme", "p"), [("upwind3", 3), ("upwind5", 5)])
@pytest.mark.parametrize("probe", ["main.pressure@0.37", "main.flow@0.61", "end.pressure", "main.flow@0"])
def test_reading_at_a_point_does_not_cap_the_order(scheme, p, probe):
    """0.37 is at another place of its cell at each level."""
    found = order(case(20), schemes=scheme, exact=free, levels=4)
    fit = found.fits[probe]["L2"]
    assert fit.order > p - 0.2, fit
    slow = [e.errors[probe]["L2"] for e in found.rows]
    assert slow[0] / slow[-1] > 2.0 ** (3 * (p - 0.3))


@pytest.mark.parametrize(("scheme", "p"), [("upwind3", 3), ("upwind5", 5)])
def test_a_source_is_fed_in_at_the_order_of_the_scheme(scheme, p):
    """Maximum norm: the error is largest at the ends, and inside it falls by one order more at first."""
    found = order(case(30), schemes=scheme, exact=driven, source=drive, levels=4)
    assert found.fits["pressure"]["max"].order == approx(p, abs=0.25)
    slow = [row.errors["flow"]["max"] for row in found.rows]
    assert slow[0] / slow[-1] > 2.0 ** (3 * (p - 0.2))


def test_friction_is_averaged_to_fourth_order_where_the_flow_keeps_its_direction():
    """The flow between two reservoirs does not reverse; where it does, |q| q has a kink and the order is three."""
    factor, loss, k = 0.5, 0.5 * scenes.RHO / (2 * DIAMETER * AREA), 2 * np.pi / LENGTH

    def exact(pipe, x, t):
        return 3e5 + 1e5 * np.sin(k * x) * np.cos(W * t), 0.6 + 0.3 * np.cos(k * x) * np.cos(2 * W * t)

    def source(pipe, x, t):
        p_t, p_x = -W * 1e5 * np.sin(k * x) * np.sin(W * t), k * 1e5 * np.cos(k * x) * np.cos(W * t)
        q_t, q_x = -0.6 * W * np.cos(k * x) * np.sin(2 * W * t), -0.3 * k * np.sin(k * x) * np.cos(2 * W * t)
        q = exact(pipe, x, t)[1]
        return AREA / SPEED**2 * p_t + scenes.RHO * q_x, scenes.RHO * q_t + AREA * p_x + loss * q**2

    between = case(20, {"model": "steady", "factor": factor})
    between["nodes"]["end"] = scenes.reservoir(3e5)
    found = order(between, exact=exact, source=source, levels=4)
    for variable in ("pressure", "flow"):
        errors = [row.errors[variable]["L2"] for row in found.rows]
        assert errors[0] / errors[-1] > 2.0 ** (3 * 3.8), errors


def test_a_wrong_exact_solution_is_found_out():
    wrong = lambda pipe, x, t: (free(pipe, x, 1.001 * t)[0], free(pipe, x, t)[1])  # noqa: E731
    found = order(case(20), exact=wrong, levels=4)
    assert found.fits["pressure"]["L2"].reason and not found.fits["flow"]["L2"].reason


def test_a_start_alone_is_judged_by_a_finer_run():
    found = order(case(20), schemes="upwind3", initial=lambda pipe, x: free(pipe, x, 0.0), levels=4)
    assert found.kind == "finer" and found.fits["pressure"]["L1"].order == approx(3.0, abs=0.2)


def test_time_alone_is_judged_on_the_grid_unless_the_exact_solution_is_asked_for():
    grid = order(case(20), methods="ssp-rk3", exact=driven, source=drive, refine="time", levels=4)
    assert grid.kind == "finer" and grid.fits["pressure"]["L2"].order == approx(3.0, abs=0.1)
    asked = order(case(20), methods="ssp-rk3", exact=free, refine="time", levels=4, against="exact")
    assert asked.kind == "function" and asked.rows[-1].errors["pressure"]["L2"] > 1.0  # the error of the grid
    with pytest.raises(FvsolveError, match="needs the function"):
        order(case(20), initial=lambda pipe, x: free(pipe, x, 0.0), against="exact")


def test_functions_want_pipes_and_the_linear_law():
    with pytest.raises(FvsolveError, match="has no pipes"):
        order("cases/two-tanks.toml", exact=free)
    with pytest.raises(FvsolveError, match='need the law "linear"'):
        order({**case(), "fluid": {"name": "Water", "law": "log"}}, exact=free)


def raises(pipe, x, t):
    raise ZeroDivisionError("no mass at noon")


@pytest.mark.parametrize("numerics", [{}, {"courant": None, "rtol": 1e-6}], ids=["courant", "rtol"])
def test_what_a_source_raises_is_the_cause_that_is_said(numerics):
    given = {key: value for key, value in case(10, **numerics)["numerics"].items() if value is not None}
    with pytest.raises(FvsolveError, match=r'source.*"main" raised ZeroDivisionError: no mass at noon') as error:
        order({**case(10), "numerics": given}, exact=driven, source=raises, levels=3)
    assert isinstance(error.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize(
    "wrong",
    [lambda *_: None, lambda *_: 1.0, lambda *_: (1.0, 2.0, 3.0), lambda *_: (np.zeros(3), 0.0), lambda *_: "ab"],
    ids=["nothing", "one", "three", "another shape", "text"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["initial", "source", "exact"])
def test_what_a_function_gives_wrongly_is_named(name, wrong):
    given = {"exact": driven, "source": drive, name: wrong}
    with pytest.raises(FvsolveError, match=rf'{name}\(pipe, x.*"main" must return two numbers or arrays of'):
        order(case(10), levels=3, **given)


@pytest.mark.parametrize("name", ["initial", "source", "exact"])
def test_where_a_function_is_not_finite_is_said(name):
    given = {"exact": driven, "source": drive, name: lambda pipe, x, *t: (np.where(x > 55.0, np.nan, 3e5), 0.0)}
    with pytest.raises(
        FvsolveError, match=rf'{name}\(pipe, x.*"main" returns values that are not finite, first at x = 5'
    ):
        order(case(10), levels=3, **given)


def test_a_source_that_is_two_numbers_is_spread_along_the_pipe():
    found = order(case(10), initial=lambda pipe, x: (3e5, 0.0), source=lambda *_: (0.0, 0.0), levels=3)
    assert all(not row.reason for row in found.rows)
