"""Walls that creep: waves against Laplace transforms by every kind of method; energy, mass and faults."""

import numpy as np
import pytest
from pytest import approx
from reference import stopped_lines
from reference.jacobians import random_state, stray
from reference.refusals import refused
from reference.scenes import WATER, area, junction, reservoir, scene

import fvsolve
from fvsolve import exact
from fvsolve.errors import CaseError
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.ports.response import response
from fvsolve.studies.reference import initial_values

LENGTH, BORE, WALL, FLOW, START = 400.0, 0.05, 0.0063, 1e-3, 0.1
ELEMENTS = {"compliance": [1e-10, 2e-10, 3e-10], "time": [0.05, 0.5, 3.0]}


def line(
    cells: int = 50, kind: str = "smooth", end: float = 4.0, creep=ELEMENTS, **numerics
) -> dict:
    """Return a case of a plastic pipe between a reservoir and a demand that stops."""
    s = np.linspace(0.0, 1.0, 400)
    stop = 1.0 - s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
    demand = {"time": (START + 0.4 * s).tolist(), "value": (FLOW * stop).tolist(), "kind": "smooth"}
    if kind == "step":
        demand = {"time": [0.0, START], "value": [FLOW, 0.0], "kind": "step"}
    wall = {"youngs_modulus": 1.43e9, "thickness": WALL} | (
        {} if creep is None else {"creep": creep}
    )
    pipe = {
        "type": "pipe",
        "from": "lake",
        "to": "gate",
        "length": LENGTH,
        "diameter": BORE,
        "cells": cells,
        "wall": wall,
        "friction": {"model": "none"},
    }
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8} | numerics
    numerics = {key: value for key, value in numerics.items() if value is not None}
    nodes = {"lake": reservoir(1e6, elevation=0.0), "gate": junction(demand, elevation=0.0)}
    probes = ["gate.pressure", "main.flow@0.3"]
    return scene(nodes, {"main": pipe}, end, numerics, probes, 0.02)


def solved(case: dict):
    """Return (run, function (k, t) of the exact value of probe k, Joukowsky jump [Pa], travel time [s])."""
    model = fvsolve.build(fvsolve.load({**case, "exact": {"name": "creeping-line"}}))
    truth = exact.solution(model.case, initial_values(model))
    speed = model.case.wave_speed("main")
    jump = WATER["density"] * speed * FLOW / area(BORE)
    return fvsolve.run(model), lambda k, t: truth.probe(model.probes[k], t), jump, LENGTH / speed


def error(*given, **more) -> float:
    """Greatest pressure error at the gate over the Joukowsky jump; for a sudden closure, away from wave fronts."""
    run, probe, jump, travel = solved(line(*given, **more))
    phase = ((run.t - START) / travel + 1.0) % 2.0 - 1.0
    far = np.abs(phase) > (0.1 if "step" in given else -1.0)
    return float(np.max(np.abs(run["gate.pressure"] - probe(0, run.t))[far])) / jump


def test_the_exact_line_is_that_of_another_inversion():
    run, probe, jump, travel = solved(line(5, "step"))
    share = [
        (BORE / WALL * WATER["density"] * (LENGTH / travel) ** 2 * compliance, time / travel)
        for compliance, time in zip(*ELEMENTS.values(), strict=True)
    ]
    ages = np.array([0.01, 0.5, 1.9, 2.1, 3.3])
    found = (probe(0, START + ages * travel) - float(run["gate.pressure"][0])) / jump
    assert found == approx([stopped_lines.creep_jump(share, age) for age in ages], abs=1e-8)


def test_a_smooth_and_a_sudden_closure_are_within_1e_3_of_the_jump():
    assert error(100) < 1e-4 and error(200, "step") < 1e-3


def test_heads_come_nearer_in_the_order_of_the_scheme():
    found = [error(cells) for cells in (25, 50, 100)]
    assert all(finer < coarser / 15.0 for coarser, finer in zip(found, found[1:], strict=False))


@pytest.mark.parametrize(
    "numerics",
    [{"method": "radau-iia-5", "rtol": 1e-7, "courant": None}, {"method": "rodas-5p", "rtol": 1e-7, "courant": None},
     {"method": "auto", "rtol": 1e-7, "courant": None}, {"scheme": "weno5"}],
    ids=["implicit", "rosenbrock", "auto", "weno5"],
)  # fmt: skip
def test_other_methods_and_schemes_find_the_same(numerics):
    assert error(60, end=1.5, **numerics) < 1e-3


@pytest.mark.parametrize(("law", "cells"), [("log", 40), ("table", 40), ("mixture", 160)])
def test_under_other_laws_small_waves_are_those_of_the_linear_law(law, cells):
    fluid = {"name": "Water", "temperature": 293.15, "law": "linear"}
    of_law = {**fluid, "law": law} | (
        {"air_fraction": 1e-7, "cavitation": True} if law == "mixture" else {}
    )
    found = []
    for one in (fluid, of_law):
        case = {**line(cells, end=3.0, scheme="muscl", method="ssp-rk3", courant=0.5), "fluid": one}
        case["nodes"]["lake"]["pressure"] = 101325.0
        demand = case["nodes"]["gate"]["demand"]
        demand["value"] = [1e-2 * value for value in demand["value"]]
        found.append(fvsolve.run(case))
    linear, other = (np.array(run["gate.pressure"]) for run in found)
    assert other == approx(linear, abs=1e-3 * np.ptp(linear))
    assert found[1].ledger["mass"]["relative"] < 1e-13


def test_a_wall_that_creeps_shrinks_about_a_cavity_and_no_liquid_is_lost():
    case = line(40, end=3.0, scheme="muscl", method="ssp-rk2", courant=0.5)
    case["fluid"] = {
        "name": "Water",
        "temperature": 293.15,
        "law": "mixture",
        "air_fraction": 1e-6,
        "cavitation": True,
    }
    case["nodes"]["lake"]["pressure"] = 2e5
    demand = case["nodes"]["gate"]["demand"]
    demand["value"] = [value - FLOW for value in demand["value"]]  # flow out of the line begins
    demand["value"] = [-2.0 * value for value in demand["value"]]
    run = fvsolve.run(case)
    assert run.ok and run["gate.pressure"].min() == approx(2339.0, rel=0.1)
    assert run.ledger["mass"]["relative"] < 1e-13
    taken = np.array(energy(case).dissipated["main creep"])
    assert taken[-1] > 0.0 and np.all(np.diff(taken) >= 0.0)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("scheme", ["upwind", "upwind5", "muscl"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme, law):
    case = line(9, scheme=scheme)
    case["fluid"]["law"] = law
    model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(0)
    assert model.y_size == 9 * 5 and model.creeps
    assert stray(model, 0.3, random_state(model, rng)) < 1e-7


def falling_line(cells: int, law: str) -> dict:
    """Return a case of a falling line, in which swelling of the bore also stores potential energy."""
    case = line(cells, end=2.0)
    case["nodes"]["gate"]["elevation"], case["fluid"]["law"] = -30.0, law
    return case


def test_its_energy_is_accounted_and_never_created():
    """The remainder falls with the order of the scheme, so stored and dissipated energies are complete."""
    found = []
    for cells in (30, 60):
        found.append(energy(falling_line(cells, "linear")))
    assert found[1].relative < 2e-6 and found[1].relative < found[0].relative / 8.0
    taken = np.array(found[1].dissipated["main creep"])
    assert taken[-1] > 0.0 and np.all(np.diff(taken) >= 0.0)


def test_under_other_laws_too_and_the_residual_of_a_law_has_a_line_of_its_own():
    """The law loss belongs to liquid of reference density in the wider bore; the scheme loss falls with the cells."""
    linear, *other = [
        energy(falling_line(cells, law))
        for cells, law in ((60, "linear"), (30, "log"), (60, "log"))
    ]
    taken = np.array(other[1].dissipated["main creep"])
    assert taken[-1] == approx(linear.dissipated["main creep"][-1], rel=0.02) and np.all(
        np.diff(taken) >= 0.0
    )
    left = [one.scheme["main"][-1] for one in other]
    assert abs(left[1]) < abs(left[0]) / 8.0 and abs(left[1]) < 2e-6 * other[1].throughput
    law = other[1].law["main"][-1]
    assert abs(law) < 5e-3 * taken[-1] and law == approx(other[0].law["main"][-1], rel=1e-3)
    assert other[1].remainder[-1] == approx(
        law + left[1] + other[1].step[-1] + other[1].newton[-1], abs=1e-9
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_energy_stored_in_the_wall_is_part_of_the_available_energy(law):
    cases = [line(10, end=0.1, creep=creep) for creep in (ELEMENTS, None)]
    held = [
        energy(case | {"fluid": case["fluid"] | {"law": law}}).at_start["main"] for case in cases
    ]
    volume, elastic = area(BORE) * LENGTH, 1e6 - 101325.0
    if law == "log":
        elastic -= 0.5 * WATER["density"] * (FLOW / area(BORE)) ** 2  # dynamic pressure
    more = 0.5 * volume * elastic**2 * BORE / WALL * sum(ELEMENTS["compliance"])
    assert held[0] - held[1] == approx(more, rel=1e-5 if law == "log" else 1e-6)


def test_mass_that_swells_the_bore_is_in_the_ledger():
    for method in ("rk4", "radau-iia-5"):
        run = fvsolve.run(line(20, end=1.0, method=method))
        assert run.ledger["mass"]["relative"] < 1e-13


def test_its_port_is_the_impedance_of_the_exact_line_and_passive():
    found = response(line(40), "gate")
    case = fvsolve.load(line(40))
    speed = case.wave_speed("main")
    s = 1j * np.array([0.2, 0.7, 1.5, 2.3]) * speed / LENGTH
    share = BORE / WALL * WATER["density"] * speed**2
    swelling = 1.0 + sum(
        share * j / (1.0 + tau * s) for j, tau in zip(*ELEMENTS.values(), strict=True)
    )
    root = np.sqrt(swelling)
    exact_z = WATER["density"] * speed / area(BORE) / root * np.tanh(s * LENGTH / speed * root)
    assert found.transfer(s) == approx(exact_z, rel=1e-4)
    # lossless at frequencies 0 and inf
    assert found.verdict.positive_real is not False and not found.verdict.dips


@pytest.mark.parametrize("law", ["linear", "log"])
def test_without_an_event_no_bit_moves(law):
    case = line(20)
    case["fluid"]["law"] = law
    case["nodes"]["gate"] = junction(1e-4, elevation=12.0)
    run = fvsolve.run(case)
    assert np.all(run["gate.pressure"] == run["gate.pressure"][0])


def test_a_resumed_run_is_the_uninterrupted_run_to_the_bit(tmp_path):
    whole = fvsolve.run(line(20, end=1.0))
    fvsolve.run(line(20, end=0.5), out=tmp_path / "half", pictures=False)
    later = fvsolve.run(line(20, end=1.0), out=tmp_path / "half", resume=True, pictures=False)
    assert np.array_equal(np.array(later["gate.pressure"]), np.array(whole["gate.pressure"]))


def test_a_wall_of_no_elements_has_no_state_and_elements_that_give_nothing_change_nothing():
    none = fvsolve.build(fvsolve.load(line(9, creep=None)))
    assert none.y_size == 18 and not none.creeps
    small = {"compliance": ["1e-21 1/GPa"], "time": [1.0]}
    one, other = (
        np.array(fvsolve.run(line(20, end=1.0, creep=creep))["gate.pressure"])
        for creep in (None, small)
    )
    assert one == approx(other, rel=1e-12)


@pytest.mark.parametrize(("change", "words"), [
    (lambda case: case.update(scalars={"salt": {}}), "takes up liquid, whose scalars are not computed"),
    (lambda case: case["links"]["main"].update(pipe_model="delay-line"),
     '"delay-line" is not possible .* its wall creeps in every cell'),
    (lambda case: case["links"]["main"].update(lining={"youngs_modulus": 2e10, "thickness": 0.004}),
     "for a lined wall"),
    (lambda case: case["links"]["main"]["wall"].update(creep={"compliance": [1e-10], "time": [1, 2]}),
     "one compliance and one time for each element"),
    (lambda case: case["links"]["main"]["wall"].update(creep={"compliance": [0], "time": [1]}), "a value above 0"),
    (lambda case: case["links"]["main"]["wall"].update(creep={"complience": [1]}), "unknown key"),
    (lambda case: case["links"]["main"]["wall"].update(creep=3), "3 is not a table; expected"),
])  # fmt: skip
def test_faults(change, words):
    case = line(9)
    change(case)
    with pytest.raises(CaseError, match=words):
        fvsolve.build(fvsolve.load(case))


def test_exact_solutions_of_elastic_walls_refuse_it():
    for name in ("rays", "laminar-line"):
        refused({**line(9), "exact": {"name": name}}, "walls without creep")


def test_laminar_friction_that_remembers_and_a_wall_that_creeps_are_exact_together():
    case = line(60, end=2.5)
    case["fluid"] = {**case["fluid"], "viscosity": 0.2}
    case["links"]["main"]["friction"] = {"model": "unsteady", "roughness": 0.0, "accuracy": 1e-5}
    run, probe, jump, _ = solved(case)
    assert np.max(np.abs(run["gate.pressure"] - probe(0, run.t))) < 1e-3 * jump


def test_the_exact_line_requires_a_wall_that_creeps():
    refused({**line(9, creep=None), "exact": {"name": "creeping-line"}}, "needs a wall with creep")


def test_the_shipped_main_without_friction_is_the_transform_of_two_lines_in_series():
    case = fvsolve.load("plastic-main", {"defaults.pipe.friction": {"model": "none"}, "expect": {}})
    run, flow = fvsolve.run(case), 0.012

    def line_of(name, s):
        pipe, speed = case.links[name], case.wave_speed(name)
        share = [
            (growth * case.properties.density * speed**2, time)
            for growth, time in pipe.creep_elements
        ]
        root = np.sqrt(1.0 + sum(one / (1.0 + time * s) for one, time in share))
        return case.properties.density * speed / area(pipe.diameter) / root, np.tanh(
            s * pipe.length / speed * root
        )

    def gate(s):
        (upper, first), (lower, second) = line_of("upper", s), line_of("lower", s)
        seen = upper * first
        impedance = lower * (seen + lower * second) / (lower + seen * second)
        return impedance * flow * (np.exp(-s) - np.exp(-3.0 * s)) / (2.0 * s**2)

    start, jump = float(run["gate.gauge_pressure"][0]), np.ptp(run["gate.gauge_pressure"])
    for t in (2.5, 5.0, 9.0, 11.0, 18.0, 33.0):
        found = float(np.interp(t, run.t, run["gate.gauge_pressure"])) - start
        assert found == approx(1e-5 * stopped_lines.euler(gate, t, 2000), abs=1e-3 * jump)
