"""Matrices A, B, C, D of cases: closed forms, eigenfrequencies of pipes, and runs with slightly changed inputs."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    NO_FRICTION,
    RHO,
    area,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    step,
    tank,
    valve,
)
from scipy.linalg import expm, matrix_balance

import fvsolve
from fvsolve.core.model.energy_norm import energy_form
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.advance import advance
from fvsolve.core.solve.held_inputs import hold
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies import operating_point, work_limit
from fvsolve.studies.linearise import (
    eigenvalues_near,
    find_eigenvalues,
    linearise,
    linearise_at,
    poles_of,
)
from fvsolve.studies.ports.response import response
from fvsolve.studies.stability import real_runs
from fvsolve.studies.stability.stability import stability

K = 2.2e9
TIGHT = {"method": "dormand-prince", "rtol": 1e-9}
LINES = {"scheme": "upwind5", "method": "rk4", "courant": 0.5}


def filling(opening=0.5, **more):
    """Case of a chamber of 2 l at 1 MPa that a reservoir at 3 MPa fills through a valve of 10 mm2."""
    nodes = {"pump": reservoir(3e6), "bottle": chamber(2e-3, 1e6)}
    return scene(
        nodes,
        {"v": valve("pump", "bottle", 1e-5, opening)},
        1.0,
        TIGHT,
        ["bottle.pressure", "v.flow"],
        **more,
    )


def test_a_chamber_behind_an_orifice_equals_the_closed_form():
    found = linearise(filling(), ["pump.pressure", "v.opening"], ["bottle.pressure", "v.flow"])
    mass_flow = 0.5 * 1e-5 * math.sqrt(2 * RHO * 2e6)
    slope, stiffness = mass_flow / (2 * 2e6), K / (RHO * 2e-3)
    assert found.states == ["bottle.mass"] and found.state_units == ["kg"]
    assert found.a == pytest.approx(np.array([[-slope * stiffness]]), rel=1e-7)
    assert found.b == pytest.approx(np.array([[slope, mass_flow / 0.5]]), rel=1e-7)
    assert found.c == pytest.approx(np.array([[stiffness], [-slope * stiffness / RHO]]), rel=1e-7)
    assert found.d == pytest.approx(
        np.array([[0.0, 0.0], [slope / RHO, mass_flow / 0.5 / RHO]]), rel=1e-7
    )
    assert found.input_values == pytest.approx((3e6, 0.5))
    assert found.output_values == pytest.approx((1e6, mass_flow / RHO))
    assert (found.input_units, found.output_units) == (("Pa", "-"), ("Pa", "m3/s"))
    assert max(found.error.values()) < 1e-6


@pytest.mark.parametrize("case", ["two-tanks", "surge-tank", "closed-cylinder"])
def test_poles_are_eigenvalues_of_a_with_their_vectors(case):
    """det(lambda I - A) = 0 and (A - lambda I) v = 0, by singular values of the balanced A."""
    a = matrix_balance(linearise(case).a)[0]
    values = find_eigenvalues(a).values
    assert len(values) == len(a)
    for pole in values:
        m = pole * np.eye(len(a)) - a
        _, sizes, vectors = np.linalg.svd(m)
        assert sizes[-1] < 1e-9 * np.linalg.norm(a) and np.linalg.norm(
            m @ vectors[-1].conj()
        ) < 1e-9 * np.linalg.norm(a)


@pytest.mark.parametrize("opening", [0.0, 1.0])
def test_an_opening_at_the_end_of_its_range_is_moved_to_the_inner_side(opening):
    found = linearise(filling(opening), ["v.opening"], ["v.flow"])
    assert found.d[0, 0] == pytest.approx(1e-5 * math.sqrt(2 * 2e6 / RHO), rel=1e-7)


def test_two_tanks_lose_their_difference_at_the_rate_of_the_closed_form():
    nodes = {"high": tank(3.0, 4.0), "low": tank(1.5, 1.0)}
    found = linearise(scene(nodes, {"hole": valve("high", "low", 0.003)}, 1.0, TIGHT))
    # d mass flow / d difference of levels
    slope = RHO * 0.003 * math.sqrt(2 * GRAVITY * 3.0) / (2 * 3.0)
    per = np.array([1 / (RHO * 3.0), -1 / (RHO * 1.5)])
    assert found.a == pytest.approx(slope * np.array([-per, per]), rel=1e-7)
    poles = np.sort(np.linalg.eigvals(found.a).real)
    assert poles == pytest.approx([-slope * (1 / 3.0 + 1 / 1.5) / RHO, 0.0], abs=1e-12)


def test_a_rigid_column_swings_between_two_tanks_at_its_frequency():
    nodes = {"a": tank(2.0, 3.0), "b": tank(1.0, 3.0)}
    column = {
        "type": "rigid-column",
        "from": "a",
        "to": "b",
        "length": 40.0,
        "diameter": 0.5,
        "friction": {"model": "none"},
    }
    found = linearise(scene(nodes, {"c": column}, 1.0, TIGHT))
    omega = math.sqrt(GRAVITY * area(0.5) / 40.0 * (1 / 2.0 + 1 / 1.0))
    poles = find_eigenvalues(found.a).poles()
    assert [p["frequency"] for p in poles] == pytest.approx([0.0, omega / (2 * math.pi)], abs=1e-9)
    assert abs(poles[1]["damping"]) < 1e-8


def servo(**more):
    nodes = {
        "pump": reservoir(14e6),
        "sump": reservoir(2e5),
        "ground": {"type": "frame"},
        "load": {"type": "mass", "mass": 300.0, "initial_position": 0.1},
    }
    links = {
        "spool": {
            "type": "spool-valve",
            "ports": {"P": "pump", "T": "sump", "A": "cyl.A", "B": "cyl.B"},
            "area": 2e-5,
            "position": 0.0,
        },
        "cyl": {
            "type": "cylinder",
            "ports": {"rod": "load", "case": "ground"},
            "stroke": 0.3,
            "area_A": 2e-3,
            "area_B": 1e-3,
            "dead_volume_A": 1e-5,
            "dead_volume_B": 1e-5,
            "initial_pressure_A": 3e6,
            "initial_pressure_B": 6e6 - AMBIENT,
        },
    }
    return scene(nodes, links, 0.1, TIGHT, ["load.position", "load.velocity"], **more)


def test_a_shut_servo_has_the_natural_frequency_of_its_oil():
    found = linearise(servo())
    stiffness = K * (2e-3**2 / (1e-5 + 2e-3 * 0.1) + 1e-3**2 / (1e-5 + 1e-3 * 0.2))
    fastest = find_eigenvalues(found.a).poles()[-1]
    assert 2 * math.pi * fastest["frequency"] == pytest.approx(
        math.sqrt(stiffness / 300.0), rel=2e-3
    )


def test_a_spool_at_its_middle_is_no_place_to_linearise_an_input_and_next_to_it_is():
    with pytest.raises(
        FvsolveError, match="spool.position = 0 cannot be linearised.*a rise and a fall"
    ):
        linearise(servo(), ["spool.position"])
    found = linearise(servo(), ["spool.position"], set={"links.spool.position": 0.1})
    gain = 0.61 * 2e-5 * math.sqrt(2 * RHO * (14e6 - 3e6))
    assert found.b[found.states.index("cyl.A.excess"), 0] == pytest.approx(gain, rel=1e-6)


OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.4e9, "viscosity": 46e-6, "law": "linear"}
HOSE = 9e-3  # diameter of its orifice [m]


def behind_hoses(**spool):
    """Case of a spool valve with hoses at zero drop behind its chambers; their laminar slope is 1e6 that of the oil."""
    nodes = {
        "P": reservoir(2e7),
        "T": reservoir(3e5),
        "A": chamber(4e-4, 5e6),
        "B": chamber(4e-4, 4e6),
        "a": chamber(2e-4, 5e6),
        "b": chamber(2e-4, 4e6),
    }
    links = {
        "spool": {
            "type": "spool-valve",
            "ports": {port: port for port in "PTAB"},
            "area": 2e-5,
            "position": 0.0,
        },
        "hoseA": valve("A", "a", area(HOSE)),
        "hoseB": valve("B", "b", area(HOSE)),
    }
    links["spool"] |= spool
    return scene(nodes, links, 1.0, TIGHT, fluid=OIL)


def gain(drop):
    """Mass flow over position of a spool of 20 mm2 at a pressure drop [kg/s]."""
    return 0.61 * 2e-5 * math.sqrt(2 * OIL["density"] * drop)


@pytest.mark.parametrize("outputs", [[], ["spool.flow_P"]])
def test_a_shut_spool_is_refused_whatever_stands_behind_its_chambers(outputs):
    """Chamber B drains with slope gain(37 bar) in one direction and fills with slope gain(160 bar) in the opposite."""
    with pytest.raises(
        FvsolveError, match="spool.position = 0 cannot be linearised.*a rise and a fall"
    ):
        linearise(behind_hoses(), ["spool.position"], outputs)


@pytest.mark.parametrize("position, flows", [(0.01, (150e5, -37e5)), (-0.01, (47e5, -160e5))])
def test_a_spool_next_to_its_middle_has_the_slope_of_that_side(position, flows):
    found = linearise(behind_hoses(position=position), ["spool.position"])
    rows = [found.states.index(f"{port}.mass") for port in "AB"]
    assert found.b[rows, 0] == pytest.approx(
        [math.copysign(gain(abs(x)), x) for x in flows], rel=1e-6
    )
    assert found.error["BD"] < 1e-6


def test_a_shut_valve_has_the_slope_of_its_opening_whatever_stands_behind_it():
    """The law is laminar below 0.001 of the opening; the slope is that above, although hoses need steps of 1e-11."""
    nodes = {"P": reservoir(2e7), "A": chamber(4e-4, 5e6), "a": chamber(2e-4, 5e6)}
    links = {"v": valve("P", "A", 2e-5, 0.0), "hose": valve("A", "a", area(HOSE))}
    found = linearise(scene(nodes, links, 1.0, TIGHT, fluid=OIL), ["v.opening"], ["v.flow"])
    assert found.b[0, 0] == pytest.approx(2e-5 * math.sqrt(2 * 870.0 * 1.5e7), rel=1e-6)
    assert found.d[0, 0] == pytest.approx(found.b[0, 0] / 870.0, rel=1e-6)


@pytest.mark.parametrize("hose", [False, True])
def test_a_relief_valve_at_its_set_pressure_is_refused_with_any_neighbours(hose):
    """The valve opens in one direction only; the laminar slope of a hose in its row once hid this."""
    nodes = {"T": reservoir(3e5), "A": chamber(4e-4, 5e6)} | (
        {"a": chamber(4e-4, 5e6)} if hose else {}
    )
    links = {
        "relief": {
            "type": "relief-valve",
            "from": "A",
            "to": "T",
            "diameter": 8e-3,
            "set_pressure": 5e6,
            "overpressure": 1.5e6,
        }
    }
    links |= {"hose": valve("A", "a", area(HOSE))} if hose else {}
    with pytest.raises(
        FvsolveError, match="A.mass: the slopes for a rise and a fall of this state differ"
    ):
        linearise(scene(nodes, links, 1.0, TIGHT, fluid=OIL))


def test_an_output_that_opens_in_a_single_direction_is_refused_by_its_name():
    """The gap of a closed linkage is zero, and its probe is the length of a vector, which has no slope at zero."""
    with pytest.raises(FvsolveError, match="loop.gap cannot be linearised.*--outputs"):
        linearise("four-bar", outputs=["two.angle", "loop.gap"])
    assert linearise("four-bar", outputs=["two.angle"]).c.shape[0] == 1


def line(cells, probes=(), friction=NO_FRICTION, demand=0.0, scheme="upwind5"):
    """Case of a pipe of 600 m and 1200 m/s between a lake and a dead end."""
    made = pipe("top", "end", 600.0, 0.5, 1200.0, cells, friction=friction)
    numerics = {**LINES, "scheme": scheme}
    return scene(
        {"top": lake(50.0), "end": junction(demand)}, {"main": made}, 1.0, numerics, probes
    )


def test_an_open_shut_pipe_has_the_frequencies_of_odd_quarters_as_cells_grow():
    errors = []
    for cells in (10, 20, 40):
        found = linearise(line(cells))
        poles = poles_of(found.a, energy_form(found.at.model)).poles()
        exact = (2 * np.arange(1, 4) - 1) * 1200.0 / (4 * 600.0)
        errors.append(np.abs([p["frequency"] for p in poles[:3]] - exact) / exact)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders > 3.9) and np.all(errors[-1] < [1e-7, 2e-6, 3e-5])


def test_steady_friction_damps_waves_at_half_its_rate():
    factor, demand = 0.03, 0.2
    found = linearise(line(40, (), {"model": "quasi-steady", "factor": factor}, demand))
    velocity = demand / area(0.5)
    slowest = poles_of(found.a, energy_form(found.at.model)).poles()[0]
    assert slowest["real"] == pytest.approx(-factor * velocity / (2 * 0.5), rel=1e-4)


def test_inputs_have_the_values_of_the_case():
    found = linearise(line(4, demand=0.2), ["end.demand", "top.head"])
    assert found.input_units == ("m3/s", "m") and found.input_values == pytest.approx(
        (0.2, 50.0), rel=1e-12
    )


def network():
    nodes = {
        "pump": reservoir(3e6),
        "gate": junction(),
        "bottle": chamber(0.05),
        "air": reservoir(AMBIENT),
    }
    links = {
        "main": pipe("pump", "gate", 20.0, 0.05, 1000.0, 6),
        "v": valve("gate", "bottle", 2e-4, 0.6),
        "out": valve("bottle", "air", 1e-4),
    }
    numerics = {"scheme": "upwind5", "method": "rk4", "step": 1e-4}
    return scene(
        nodes, links, 1.0, numerics, ["gate.pressure", "main.flow@0.4", "v.flow", "bottle.pressure"]
    )


@pytest.mark.parametrize(
    "name, change", [("v.opening", 1e-5), ("pump.pressure", 10.0), ("gate.demand", 1e-7)]
)
def test_a_small_step_of_an_input_moves_a_run_as_a_b_c_d_predict(name, change):
    outputs = ["gate.pressure", "main.flow@0.4", "v.flow", "bottle.pressure"]
    found = linearise(network(), [name], outputs)
    model, span = fvsolve.build(fvsolve.load(network())), 0.03
    ends = []
    for sign in (1.0, -1.0):
        held = {name: found.input_values[0] + sign * change}
        state = advance(model, initial_state(model), span, held)
        ends.append(hold(model, held).observe(span, state.y))
    run = (ends[0] - ends[1]) / (2 * change)
    n = len(found.states)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n:] = found.a, found.b
    response = found.c @ expm(span * whole)[:n, n] + found.d[:, 0]
    assert run == pytest.approx(response, rel=2e-3, abs=2e-3 * np.max(np.abs(found.d)))


def test_a_matches_the_models_own_jacobian_and_large_ones_are_sparse():
    found = linearise(network())
    model = found.at.model
    own = model.jacobian(0.0, np.zeros(model.y_size))
    assert np.max(np.abs(found.a - own)) < 1e-6 * np.max(np.abs(own))
    large = linearise(line(600))
    assert large.sparse and large.a.shape == (1200, 1200) and large.a.nnz < 12 * 1200
    rng = np.random.default_rng(0)
    y = rng.standard_normal(1200)
    assert large.a @ y == pytest.approx(large.at.model.rhs(0.0, y), rel=1e-7, abs=1e-7)


def test_an_incomplete_spectrum_states_the_poles_it_contains():
    found = linearise(line(900))
    values = poles_of(found.a, energy_form(found.at.model))
    assert (
        not values.complete and "of 1800" in values.description and "ARPACK" in values.description
    )
    exact = (2 * np.arange(1, 4) - 1) * 0.5
    assert [p["frequency"] for p in values.poles()[:3]] == pytest.approx(exact, rel=1e-6)


def test_the_state_at_a_jump_is_taken_just_after_it_or_just_before():
    case = filling(step(0.003, 0.5, 0.25))
    before, after = (
        linearise(case, ["v.opening"], at=0.003, before=side) for side in (True, False)
    )
    assert (before.input_values, after.input_values) == ((0.5,), (0.25,))
    assert before.a[0, 0] == pytest.approx(2 * after.a[0, 0], rel=1e-6)
    assert "just before a jump" in before.at.when and "just after a jump" in after.at.when
    assert before.at.y == pytest.approx(after.at.y, rel=1e-12) and before.at.y[0] > 0.0


def test_a_state_on_the_way_is_that_of_the_run():
    case = filling()
    found = linearise(case, at=0.002)
    model = fvsolve.build(fvsolve.load(case))
    state = advance(model, initial_state(model), 0.002)
    assert found.at.y == pytest.approx(state.y, rel=1e-6)
    drop = 3e6 - found.output_values[0]
    assert found.a[0, 0] == pytest.approx(
        -0.5e-5 * math.sqrt(RHO / (2 * drop)) * K / (RHO * 2e-3), rel=1e-6
    )


def test_a_limited_scheme_is_refused_and_the_way_out_is_named():
    for scheme, way in (("muscl", "--scheme fromm"), ("weno5", "--scheme upwind5")):
        with pytest.raises(FvsolveError, match=way):
            linearise(line(10, scheme=scheme))
        assert linearise(line(10, scheme=scheme), scheme="upwind").a.shape == (20, 20)


def test_a_case_without_a_scheme_is_linearised_with_the_smooth_scheme():
    case = line(10)
    del case["numerics"]["scheme"]
    found = linearise(case)
    assert found.plain()["scheme"] == "upwind5" and np.array_equal(
        found.a, linearise(line(10, scheme="upwind5")).a
    )


def test_a_valve_at_a_drop_of_zero_has_its_laminar_slope_and_none_where_it_is_bare():
    case = scene(
        {"a": reservoir(1e6), "b": chamber(1e-3, 1e6)}, {"v": valve("a", "b", 1e-5)}, 1.0, TIGHT
    )
    found = linearise(case)
    model = found.at.model
    bare, row = model.tables.valves.copy(), model.tables.valves[0]
    assert row["transition"] > 0.0
    laminar = 45 / 32 * row["conductance"] / row["transition"]  # slope of the law at zero drop
    assert found.a[0, 0] == pytest.approx(-laminar * K / (RHO * 1e-3), rel=1e-4)
    bare["transition"] = 0.0
    with pytest.raises(
        FvsolveError, match="b.mass: the slopes there do not converge.*drop of zero"
    ):
        linearise_at(
            replace(found.at, model=replace(model, tables=model.tables._replace(valves=bare)))
        )


@pytest.mark.parametrize(
    "more, error, said",
    [
        ({"inputs": ["v.openning"]}, FvsolveError, 'did you mean "v.opening"'),
        ({"inputs": ["x"]}, FvsolveError, "inputs are"),
        ({"outputs": ["bottle.presure"]}, CaseError, 'did you mean "pressure"'),
        ({"at": -1.0}, FvsolveError, "after the start"),
    ],
)
def test_invalid_requests_are_reported(more, error, said):
    with pytest.raises(error, match=said):
        linearise(filling(), **more)


def test_a_case_without_a_state_is_refused():
    case = scene(
        {"a": reservoir(2e6), "b": reservoir(1e6)}, {"v": valve("a", "b", 1e-4)}, 1.0, TIGHT
    )
    with pytest.raises(FvsolveError, match="has no state"):
        linearise(case)


def test_the_command_writes_matrices_with_names_and_a_single_json_object(
    tmp_path, monkeypatch, fvs
):
    monkeypatch.chdir(tmp_path)
    code, out, _ = fvs(
        "linearise", "chamber-and-orifice", "--inputs", "hole.opening", "--at", "1 s", "--json"
    )
    assert code == 0
    found = json.loads(out)
    assert (
        found["at"] == 1.0
        and found["inputs"] == ["hole.opening"]
        and found["poles"][0]["real"] < 0.0
    )
    with np.load(tmp_path / "runs" / "chamber-and-orifice.linearise" / "linear.npz") as file:
        kept = dict(file)
    assert kept["A"].tolist() == found["A"] and kept["states"].tolist() == found["states"]
    table = (tmp_path / "runs" / "chamber-and-orifice.linearise" / "B.csv").read_text().splitlines()
    assert table[0] == ",hole.opening" and float(table[1].split(",")[1]) == found["B"][0][0]


def test_a_folder_that_is_written_again_is_named(tmp_path, fvs):
    """A second command in a folder reports this and deletes matrices of an earlier case."""
    first = fvs("linearise", "two-tanks", "--out", tmp_path)[2]
    (tmp_path / "A-sparse.csv").write_text("of a larger case")
    again = fvs("linearise", "two-tanks", "--out", tmp_path)[2]
    assert str(tmp_path) not in first and str(tmp_path) in again and "--out" in again
    assert not (tmp_path / "A-sparse.csv").exists()


# ----------------------------------------------------------------------------------------------------------------------
# Linearisation, stability and response of large models, and named refusals.


def masses():
    """Case of two masses on a spring, without fluid."""
    nodes = {name: {"type": "mass", "mass": 10.0} for name in "ab"}
    spring = {"type": "spring", "from": "a", "to": "b", "stiffness": 1e6}
    return scene(nodes, {"s": spring}, 1.0, {"method": "rk4", "step": 1e-3})


def test_of_20000_states_the_slowest_poles_and_the_outputs_are_located_soon():
    found = linearise(line(10000, ["end.pressure", "main.flow@0.5"]))
    assert found.c.shape == (2, 20000) and np.count_nonzero(found.c[0]) < 20
    values = poles_of(found.a, energy_form(found.at.model))
    exact = (2 * np.arange(1, 10) - 1) * 0.5
    assert [p["frequency"] for p in values.poles()[:9]] == pytest.approx(exact, rel=1e-6)
    assert not values.complete and "of 20000: eigenvalues nearest 0" in values.description


def test_outputs_located_by_bisection_are_those_of_every_state_alone(monkeypatch):
    case = line(40, ["end.pressure", "main.flow@0.37", "main.pressure@0.1"])
    found = linearise(case).c
    monkeypatch.setattr(operating_point, "visible_states", lambda at, *more: range(at.model.y_size))
    assert np.array_equal(found, linearise(case).c) and np.count_nonzero(found) > 3


def test_an_eigenvalue_that_is_too_late_is_left_out_with_a_notice():
    found = linearise(line(900))
    e = energy_form(found.at.model).seen(found.a)
    assert eigenvalues_near(e, 1e-3, latest=0.0).size == 0


def test_a_too_long_prediction_is_refused_with_the_alternative(monkeypatch):
    monkeypatch.setattr(work_limit, "TIME_LIMIT", -1.0)
    with pytest.raises(
        FvsolveError,
        match="600 states and 100 steps take longer.*--set links.NAME.cells=100.*--steps",
    ):
        stability(line(300), steps=100)


def test_a_too_long_measurement_is_left_out_with_a_notice(monkeypatch):
    monkeypatch.setattr(real_runs, "TIME_LIMIT", -1.0)
    (row,) = stability(line(8), steps=100).rows
    assert (
        np.isfinite(row.predicted)
        and np.isnan(row.measured)
        and "take longer" in row.left_out["measured"]
    )


def test_runs_that_leave_the_state_where_no_linear_step_fails_are_explained():
    nodes = {"high": chamber(1e-3, 3e5), "low": chamber(1e-3, 2e5)}
    case = scene(
        nodes, {"hole": valve("high", "low", 1e-5)}, 1.0, {"method": "rodas-4", "step": 1.0}
    )
    (row,) = stability(case, steps=100).rows
    assert np.isinf(row.predicted) and 0.0 < row.measured < np.inf
    assert any("leaves the linearised state" in note for note in row.notes)


def test_auto_is_its_first_method_once_with_a_notice():
    found = stability(masses(), methods=["auto", "dormand-prince"], steps=50)
    assert [row.method for row in found.rows] == ["dormand-prince"] and "rodas-5p" in found.notes[0]
    assert stability(masses(), methods=["rk4"], steps=50).notes == ()


@pytest.mark.parametrize("arguments, said", [
    (["--set", "a=1", "--at", "1", "--left-limit"], "--set, --at, --left-limit: needs a case: fvsolve stability CASE"),
    (["chamber-chain", "--cells", "4", "--courant", "1"], "--cells, --courant: not valid with a case, only without"),
    (["chamber-chain", "--method", ""], '--method "" is an empty list'),
    (["--scheme", ","], '--scheme "," is an empty list'),
])  # fmt: skip
def test_options_without_effect_are_refused(arguments, said, monkeypatch, fvs, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, err = fvs("stability", *arguments)
    assert code == 2 and said in err


def test_a_folder_that_cannot_be_written_is_named(monkeypatch, fvs, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("")
    for command in (
        ("stability", "chamber-chain"),
        ("linearise", "chamber-chain"),
        ("stability", "--scheme", "upwind"),
    ):
        code, _, err = fvs(*command, "--out", "taken")
        assert code == 2 and "taken: cannot be written" in err


def test_a_scene_without_pressures_has_no_port():
    with pytest.raises(FvsolveError, match="has no port"):
        response(masses(), "a")


def test_a_sparse_matrix_goes_to_a_file_of_its_own_name(tmp_path):
    from fvsolve.cli.linear_commands import write_matrices

    for cells, name in ((5, "A.csv"), (501, "A-sparse.csv")):
        folder = tmp_path / str(cells)
        folder.mkdir()
        write_matrices(folder, linearise(line(cells)))
        assert [path.name for path in folder.glob("A*.csv")] == [name]


def test_a_train_too_long_for_its_energy_norm_is_refused(monkeypatch):
    from fvsolve.core.model import energy_norm

    monkeypatch.setattr(energy_norm, "MAX_GROUP", 1)
    with pytest.raises(FvsolveError, match="2 positions are joined by springs"):
        stability(masses(), steps=50)
