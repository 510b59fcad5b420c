"""Delay lines: exact waves without friction at any step, friction of the telegrapher's equations, closed balances."""

import json

import numpy as np
import pytest
from invariance.result_comparison import broken_off_and_whole
from reference import scenes
from reference.delays import (
    AREA,
    BORE,
    FLOW,
    JUMP,
    LENGTH,
    SPEED,
    STOP,
    TRAVEL,
    between_jumps,
    fork,
    main,
    pipe,
    square,
    turned,
)
from reference.scenes import RHO, junction, lake, ramp, scene, valve
from reference.short_lines import short, vessel

import fvsolve
from fvsolve import studies
from fvsolve.case.text import write
from fvsolve.core.assembly.features import with_slot
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.features.delay_lines import history
from fvsolve.features.delay_lines.kernels.tables import SLOT

METHODS = {
    "euler": {"step": 0.04},
    "rk4": {"step": 0.037},
    "ssp-rk3": {"step": 0.7},
    "implicit-midpoint": {"step": 0.1},
    "gauss-4": {"step": 0.05},
    "radau-iia-5": {"rtol": 1e-5},
    "dormand-prince": {"rtol": 1e-6},
    "rodas-5p": {"rtol": 1e-4},
    "heun": {"courant": 0.9},
    "auto": {"rtol": 1e-5},
}


def known(found, probe):
    """Times and values of a probe, with the last of two rows at a jump."""
    last = np.append(np.diff(found.t) > 0.0, True)
    return found.t[last], found[probe][last]


@pytest.mark.parametrize("method", METHODS)
def test_an_instant_stop_is_exact_at_any_step(method):
    """After an instantaneous stop the pressure is an exact square wave, for every method and step control."""
    found = fvsolve.run(main(numerics={"method": method, **METHODS[method]}))
    assert found.reason == "finished" and found.ledger["mass"]["relative"] < 1e-14
    t, p = known(found, "gate.pressure")
    away = between_jumps(t, 0.5, 2.0 * TRAVEL)
    assert p[0] + JUMP * square(t, 0.5, 4.0 * TRAVEL)[away] == pytest.approx(
        p[away], abs=1e-9 * JUMP
    )
    t, p = known(found, "main.pressure@0.5")
    away = between_jumps(t, 0.5 + 0.5 * TRAVEL, TRAVEL)
    exact = 0.5 * (
        square(t, 0.5 + 0.5 * TRAVEL, 4.0 * TRAVEL) - square(t, 0.5 + 1.5 * TRAVEL, 4.0 * TRAVEL)
    )
    exact += np.where((t > 0.5 + 0.5 * TRAVEL) & (t < 0.5 + 1.5 * TRAVEL), 0.5, 0.0)
    assert (p[0] + JUMP * exact)[away] == pytest.approx(p[away], abs=1e-9 * JUMP)


@pytest.mark.parametrize("method", ["euler", "rk4", "gauss-4", "dormand-prince"])
def test_jumps_pass_a_fork_at_their_own_time(method):
    """Jumps in a fork agree with characteristics at Courant number 1, which are exact with cells of 0.1 s."""
    truth = fvsolve.run(fork({"scheme": "upwind", "method": "euler", "courant": 1.0}, every=0.1))
    found = fvsolve.run(
        fork(
            {
                "pipe_model": "delay-line",
                "delay_tolerance": 1e-6,
                "method": method,
                **METHODS[method],
            },
            every=0.05,
        )
    )
    for probe in ("gate.pressure", "fork.pressure", "dead.pressure"):
        times, right = known(truth, probe)
        t, p = known(found, probe)
        here = np.searchsorted(t, times[:-1] + 0.05 - 1e-9)  # between the jumps
        assert p[here] == pytest.approx(right[:-1], abs=1e-8 * JUMP)


def telegrapher(omega: float, drag: float) -> complex:
    """p / M at the end of a pipe from a reservoir, with M into the pipe, by the telegrapher's equations [Pa s/kg].

    s + drag replaces s in the momentum balance.
    """
    s = 1j * omega
    gamma = np.sqrt(s * (s + drag)) / SPEED
    return (s + drag) / (AREA * gamma) * np.tanh(gamma * LENGTH)


@pytest.mark.parametrize(("friction", "exponent"), [
    ({"model": "steady", "factor": 0.2}, 2.0), ({"model": "hazen-williams", "coefficient": 40}, 1.852),
])  # fmt: skip
def test_friction_is_that_of_telegraphers(friction, exponent):
    """The response to a small oscillation of demand converges to that of the telegrapher's equations."""
    mean, swing, errors = 0.05, 1e-5, []
    for accuracy in (0.05, 0.0125):
        worst = 0.0
        for period in (2.0, 4.6):
            omega = 2.0 * np.pi / period
            demand = {"mean": mean, "amplitude": swing, "period": period}
            numerics = {"step": 0.01, "method": "euler", "delay_tolerance": accuracy}
            found = fvsolve.run(
                main(24.0 * period, numerics, demand, period / 64, friction=friction)
            )
            p, t = found["gate.pressure"], found.t
            late = t > 19.99 * period
            basis = np.column_stack(
                [np.sin(omega * t[late]), np.cos(omega * t[late]), np.ones(late.sum())]
            )
            a, b, _ = np.linalg.lstsq(basis, p[late], rcond=None)[0]
            model = fvsolve.build(fvsolve.load(main(1.0, numerics, mean, friction=friction)))
            drag = exponent * model.tables.pipes["drag"][0] / model.tables.pipes["flow"][0]
            exact = -telegrapher(omega, float(drag)) * swing * RHO
            worst = max(worst, abs(complex(a, b) - exact) / abs(exact))
        errors.append(worst)
    assert errors[1] < 2e-3 and errors[1] < 0.15 * errors[0]


def test_content_of_a_line_is_the_travelling_flow():
    """The mass in a line by its balance equals the integral of both waves along the line."""
    smooth = {
        "time": [0.0, 0.2, 0.9, 9.0],
        "value": [FLOW, FLOW, 0.2 * FLOW, 0.2 * FLOW],
        "kind": "smooth",
    }
    case = main(
        4.3,
        {"method": "dormand-prince", "rtol": 1e-7},
        smooth,
        friction={"model": "steady", "factor": 0.05},
        cells=400,
    )
    model = fvsolve.build(fvsolve.load(case))
    run = Run(model, fvsolve.initial_state(model), MemorySink(model), None)
    ended = run.go()
    assert ended.ledgers["mass"]["relative"] < 1e-14
    out = run.run_data.evaluate(run.loop.t, run.loop.now, np.inf)[1]
    r, l = run.run_data.along(run.loop.t, out)[0]  # noqa: E741
    held = float(np.sum(r + l)) * LENGTH / SPEED / r.size
    assert float(run.loop.now[0]) == pytest.approx(held, rel=2e-3)


def test_envelopes_are_taken_along_the_line():
    """The envelope contains the sum of two waves in the middle of a line, which does not occur at its ends."""
    nodes = {
        "a": {
            "type": "junction",
            "demand": {"time": [0.0, 0.5], "value": [0.0, -FLOW], "kind": "step"},
        },
        "b": {
            "type": "junction",
            "demand": {"time": [0.0, 0.5], "value": [0.0, -FLOW], "kind": "step"},
        },
        "lake": {"type": "reservoir", "pressure": 6e6},
    }
    links = {"main": pipe("a", "b", cells=30), "far": pipe("b", "lake", 30e3)}
    found = fvsolve.run(
        scene(
            nodes,
            links,
            1.2,
            {"method": "euler", "pipe_model": "delay-line", "step": 0.01},
            ["a.pressure"],
        )
    )
    envelope = found.envelope["main"]["max_pressure"]
    assert envelope[14] - found["a.pressure"][0] == pytest.approx(1.5 * JUMP, rel=1e-6)
    assert found.extremes["a.pressure"].maximum < found["a.pressure"][0] + 1.4 * JUMP


def test_lines_shorter_than_a_step_know_each_other():
    """Lines shorter than a step agree with cells of 2.5 ms; the error decreases with the square of the step."""
    truth, errors = (
        fvsolve.run(short("finite-volume", scheme="upwind5", method="rk4", courant=0.8)),
        [],
    )
    for step in (0.02, 0.01):
        found = fvsolve.run(short("delay-line", method="euler", step=step))
        assert found.reason == "finished" and found.ledger["mass"]["relative"] < 1e-14
        errors.append(
            max(
                np.abs(known(found, one)[1] - known(truth, one)[1]).max()
                for one in ("gate.pressure", "c.pressure")
            )
        )
    assert errors[0] < 0.02 * JUMP and errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize(
    "case", [main(), short("delay-line", method="euler", step=0.02)], ids=["long", "short"]
)
def test_tables_of_jumps_have_a_handle_with_and_without_replaced_tables(case):
    with fvsolve.build(fvsolve.load(case)).run_data() as data:
        assert data.handle is not None and np.any(with_slot(data.features, SLOT).sharp)


@pytest.mark.parametrize("method", ["euler", "rk4", "gauss-4", "rodas-5p"])
def test_stores_at_lines_act_as_at_cells(method):
    """A chamber and a tank at the ends of lines follow the solution with cells, under all kinds of methods."""
    nodes = {
        "lake": {"type": "reservoir", "pressure": 6e5},
        "mid": {"type": "chamber", "volume": 0.5},
        "end": {"type": "junction"},
        "pool": {"type": "tank", "area": 0.2, "level": 10.0},
    }
    shut = {"start": 0.2, "duration": 0.6, "value": [1.0, 0.2]}
    links = {
        "up": pipe("lake", "mid", 480.0, cells=160, friction={"model": "steady", "factor": 0.02}),
        "down": pipe("mid", "end", 360.0, cells=120),
        "tap": {"type": "valve", "from": "end", "to": "pool", "area": 1e-3, "opening": shut},
    }
    probes = ["mid.pressure", "end.pressure", "pool.level", "tap.flow"]
    step = (
        {"rtol": 1e-7} if method == "rodas-5p" else {"step": 5e-4 if method == "euler" else 0.005}
    )
    one = fvsolve.run(
        scene(
            nodes, links, 3.0, {"pipe_model": "delay-line", "method": method, **step}, probes, 0.05
        )
    )
    two = fvsolve.run(
        scene(
            nodes, links, 3.0, {"scheme": "upwind5", "method": "rk4", "courant": 0.8}, probes, 0.05
        )
    )
    assert one.reason == "finished" and one.ledger["mass"]["relative"] < 1e-13
    for probe in probes:
        a, b = known(one, probe)[1], known(two, probe)[1]
        assert np.abs(a - b).max() < 3e-3 * np.ptp(b)


@pytest.mark.parametrize("method", ["rk4", "ssp-rk2", "trapezoid"])
def test_a_jump_that_reaches_a_store_within_a_step_is_not_lost(method):
    """A chamber receives a jump within a step as with steps twenty times shorter.

    Without the correction between stages the error would be a tenth of the flow of a step.
    """
    truth = known(fvsolve.run(vessel("rk4", 5e-4)), "v.pressure")[1]
    errors = []
    for step in (0.02, 0.01):
        found = fvsolve.run(vessel(method, step))
        assert found.ledger["mass"]["relative"] < 1e-14
        errors.append(np.abs(known(found, "v.pressure")[1] - truth).max() / np.ptp(truth))
    assert errors[0] < 4e-3 and errors[1] < 2e-3


def case_of(name: str) -> dict:
    """Case to interrupt: with friction and given steps, with short lines, or with error control."""
    if name == "fork":
        return fork(
            {"pipe_model": "delay-line", "method": "rk4", "step": 0.013},
            friction={"model": "steady", "factor": 0.02},
        )
    if name == "short":
        return short("delay-line", method="euler", step=0.01)
    return main(
        6.0,
        {"method": "dormand-prince", "rtol": 1e-5},
        friction={"model": "hazen-williams", "coefficient": 100},
    )


@pytest.mark.parametrize("name", ["fork", "short", "controlled"])
def test_broken_off_and_resumed(name):
    """An interrupted and resumed run agrees with the whole run to the bit: final state, ledgers and envelopes."""
    again, whole = broken_off_and_whole(case_of(name), 0.4)
    assert np.array_equal(again.run_data.envelope, whole.run_data.envelope, equal_nan=True)


def test_advanced_in_pieces():
    """States from `advance` contain the wave history, so a loop of short advances gives the exact wave."""
    model = fvsolve.build(fvsolve.load(main(numerics={"step": 0.01})))
    state = fvsolve.initial_state(model)
    for until in np.arange(0.25, 3.01, 0.25):
        state = fvsolve.advance(model, state, float(until))
    found = model.observe(state)[0] - model.observe(fvsolve.initial_state(model))[0]
    assert found == pytest.approx(-JUMP, rel=1e-6)  # between 2.0 and 3.5 s
    assert model.rhs(state).shape == (1,)


def test_more_steps_than_were_foreseen():
    """The storage for past waves grows if error control takes much shorter steps than expected."""
    case = main(
        3.0,
        {"method": "bogacki-shampine", "rtol": 1e-10},
        {"mean": FLOW, "amplitude": 0.1 * FLOW, "period": 0.1},
        cells=1,
    )
    found = fvsolve.run(case)
    assert found.reason == "finished" and found.summary["steps"] > 2000


def test_drawn_the_other_way():
    one = fvsolve.run(short("delay-line", method="euler", step=0.01))
    other = fvsolve.run(turned(short("delay-line", method="euler", step=0.01)))
    for probe in ("gate.pressure", "c.pressure", "tap.flow"):
        assert other[probe] == pytest.approx(one[probe], rel=1e-12)


def test_other_rows_do_not_change_it():
    few, many = (
        fvsolve.run(
            fork({"pipe_model": "delay-line", "method": "euler", "step": 0.03}, every=every)
        )
        for every in (0.2, 0.05)
    )
    t, p = known(many, "gate.pressure")
    times, right = known(few, "gate.pressure")
    assert np.array_equal(p[np.searchsorted(t, times - 1e-9)], right)


def test_at_rest_nothing_moves():
    """Without an event the pressure of a line with friction does not change by a bit."""
    for friction in (
        {"model": "steady", "factor": 0.02},
        {"model": "quasi-steady", "roughness": 1e-4},
        {"model": "hazen-williams", "coefficient": 120},
    ):
        found = fvsolve.run(main(3.0, demand=FLOW, friction=friction))
        assert np.ptp(found["gate.pressure"]) == 0.0 and np.ptp(found["main.pressure@0.3"]) == 0.0


def test_random_networks_do_not_grow():
    """Pressures in frictionless random networks with short stubs do not grow in 12 s."""
    random = np.random.default_rng(7)
    for _ in range(12):
        many = int(random.integers(3, 7))
        nodes = {f"n{i}": {"type": "junction"} for i in range(many)}
        nodes["lake"] = {"type": "reservoir", "pressure": 6e6}
        nodes["n0"]["demand"] = {"start": 0.1, "duration": 0.05, "value": [FLOW, 0.0]}
        links = {"l0": pipe("lake", f"n{many - 1}", float(random.uniform(20.0, 200.0)), cells=4)}
        for i in range(many - 1):
            links[f"p{i}"] = pipe(
                f"n{i}", f"n{i + 1}", float(10.0 ** random.uniform(0.3, 2.3)), cells=1
            )
        a, b = random.choice(many, 2, replace=False)
        links["loop"] = pipe(f"n{a}", f"n{b}", float(10.0 ** random.uniform(0.3, 2.3)), cells=2)
        found = fvsolve.run(
            scene(
                nodes,
                links,
                12.0,
                {"pipe_model": "delay-line", "method": "euler", "step": 0.01},
                [f"n{i}.pressure" for i in range(many)],
                0.01,
            )
        )
        early, late = (
            [np.abs(found[f"n{i}.pressure"][part] - 6e6).max() for i in range(many)]
            for part in (found.t < 4.0, found.t > 8.0)
        )
        assert (
            found.reason == "finished"
            and max(late) <= 1.05 * max(early)
            and max(early) < 4.0 * JUMP
        )


@pytest.mark.parametrize(
    "control", [{"courant": 0.9, "method": "rk4"}, {"rtol": 1e-5, "method": "rodas-5p"}]
)
def test_inflow_of_a_store_leaves_its_own_line(control):
    """The mass ledger closes at a chamber next to a delay line and a lake, by Courant number and by tolerance."""
    case = vessel("rk4", 0.01)
    del case["numerics"]["step"]
    found = fvsolve.run(case | {"numerics": case["numerics"] | control})
    assert found.reason == "finished" and found.ledger["mass"]["relative"] < 1e-14


def test_jumps_that_find_no_space_are_reported(monkeypatch):
    """A notice reports jumps that do not fit into the storage, here of two jumps per wave."""
    monkeypatch.setattr(history, "LEAST_JUMPS", 2)
    monkeypatch.setattr(history, "TOTAL_JUMPS", 2)
    found = fvsolve.run(
        fork({"pipe_model": "delay-line", "delay_tolerance": 1e-6, "method": "euler", "step": 0.04})
    )
    told = [one for one in found.summary["warnings"] if one["kind"] == "jumps"]
    assert (
        len(told) == 1
        and "numerics.delay_tolerance" in told[0]["text"]
        and 0.0 < told[0]["value"] <= 1.0
    )
    assert found.ledger["mass"]["relative"] < 1e-13


def test_auto_takes_cells_where_a_line_is_too_rough():
    """`auto` selects cells for a pipe with too much friction and lines for others; `checks` states bound and reason."""
    case = fork({"pipe_model": "auto", "method": "rk4", "courant": 0.9, "delay_tolerance": 1e-3})
    case["links"]["down"]["friction"] = {"model": "steady", "factor": 0.5}
    found = fvsolve.build(fvsolve.load(case)).checks["pipes"]
    assert [found[name]["line"] for name in ("up", "down", "side")] == [
        "delay-line",
        "finite-volume",
        "delay-line",
    ]
    assert found["up"]["line_bound"] <= 1e-3 and found["down"]["line_bound"] is None
    assert "numerics.delay_tolerance" in found["down"]["line_why"]
    mixed = fvsolve.run(case | {"numerics": case["numerics"] | {"scheme": "upwind5"}})
    assert mixed.reason == "finished" and mixed.ledger["mass"]["relative"] < 1e-13


def test_check_states_how_pipes_are_modelled(fvs, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(write(main()))
    code, said, _ = fvs("check", path, "--json")
    pipe = json.loads(said)["pipes"]["main"]
    assert (
        code == 0
        and (pipe["line"], pipe["line_bound"]) == ("delay-line", 0.0)
        and "travel along it" in pipe["line_why"]
    )


BAD = {
    "law": ({"fluid": {"name": "Water", "law": "log"}}, 'law = "log" changes waves as they travel'),
    "unsteady": ({}, "unsteady friction depends on the flow history of every cell"),
    "rough": ({}, "friction attenuates"),
}


@pytest.mark.parametrize("which", BAD)
def test_a_pipe_that_cannot_be_a_line(which):
    changes, message = BAD[which]
    case = main(1.0) | changes
    if which == "unsteady":
        case["links"]["main"]["friction"] = {"model": "unsteady", "roughness": 1e-4}
    if which == "rough":
        case["links"]["main"] |= {
            "length": 12.0,
            "minor_loss": 5e5,
            "friction": {"model": "steady", "factor": 0.02},
        }
        case["nodes"]["lake"]["pressure"] = 6e8
    with pytest.raises(CaseError, match="is not possible") as raised:
        fvsolve.build(fvsolve.load(case))
    assert message in str(raised.value)


def test_features_without_lines_are_refused_with_the_reason():
    case = main(1.0)
    model = fvsolve.build(fvsolve.load(case))
    for call in (lambda: model.rhs(0.0, model.start), lambda: model.jacobian(0.0, model.start)):
        with pytest.raises(FvsolveError, match="delay lines"):
            call()


def test_lines_are_linearised_as_cells_up_to_a_stated_frequency():
    """The linearised cells of a line reflect a wave with the error 0.02 up to the stated frequency.

    The exact reflection by the lake is exp(-2 s tau) with the opposite sign of pressure.
    """
    case = main(1.0, demand=FLOW, cells=60)
    case["links"]["main"]["pipe_model"] = "delay-line"
    found = studies.linearise(case, inputs=["gate.demand"], outputs=["gate.pressure"])
    told = float(found.at.when.partition("up to ")[2].split()[0])

    def off(frequency: float) -> float:
        s = 2j * np.pi * frequency
        inside = np.linalg.solve(s * np.eye(len(found.states)) - found.a, found.b)
        # per Joukowsky jump of the flow
        pressure = (found.c @ inside + found.d)[0, 0] / -RHO * AREA / SPEED
        return abs((pressure - 1.0) / (pressure + 1.0) + np.exp(-2.0 * s * TRAVEL))

    assert max(off(told * share) for share in (0.3, 0.61, 0.97)) < 0.02 < off(2.0 * told)


def test_an_unknown_word_and_a_bad_share():
    case = main(1.0)
    case["links"]["main"]["pipe_model"] = "delay-lines"
    case["numerics"]["delay_tolerance"] = 2.0
    with pytest.raises(CaseError) as raised:
        fvsolve.load(case)
    assert 'did you mean "delay-line"?' in str(raised.value) and "numerics.delay_tolerance" in str(
        raised.value
    )


def test_a_line_of_the_case_is_a_model_of_the_ladder():
    from fvsolve.studies.accuracy.model_hierarchy import level_keys, level_names

    case = fvsolve.load(main(1.0) | {"numerics": {"end": 1.0}})
    assert "delay lines" in level_names(case) and level_keys(case, "delay lines") == {
        "links.main.pipe_model": "delay-line"
    }


def test_stops_stated_otherwise_are_the_same():
    """Units, a later start, and the key of the pipe instead of the case give the same run."""
    one = fvsolve.run(main(3.0))
    other = main(3.0, {"step": "40 ms"})
    other["numerics"].pop("pipe_model")
    other["links"]["main"] |= {
        "pipe_model": "delay-line",
        "length": "0.9 km",
        "diameter": f"{1e3 * BORE} mm",
    }
    assert fvsolve.run(other)["gate.pressure"] == pytest.approx(one["gate.pressure"], rel=1e-12)
    later = main(67.0)
    later["numerics"]["start"] = 64.0
    later["nodes"]["gate"]["demand"] = STOP | {"time": [64.0, 64.5]}
    assert fvsolve.run(later)["gate.pressure"] == pytest.approx(
        one["gate.pressure"], abs=1e-9 * JUMP
    )


def test_a_start_from_rest_drives_every_part_of_a_pipe():
    """A start from rest with a pressure difference excludes a delay line, because friction acts at single points.

    The key `delay-line` is a fault with the name of the pipe, and `auto` selects cells.
    """
    nodes = {
        "high": {"type": "reservoir", "pressure": 6e6},
        "low": {"type": "reservoir", "pressure": 5e6},
    }
    links = {"one": pipe("high", "low")}
    case = scene(
        nodes, links, 1.0, {"initial": "rest", "pipe_model": "delay-line"}, ["one.flow"], 0.05
    )
    with pytest.raises(
        CaseError, match="friction does not balance the drop of pressure along the pipe"
    ):
        fvsolve.build(fvsolve.load(case))
    case["numerics"]["pipe_model"] = "auto"
    assert fvsolve.build(fvsolve.load(case)).checks["pipes"]["one"]["line"] == "finite-volume"


def test_steps_by_tolerance_with_cells_of_a_quicker_pipe():
    """Lines shorter than a step agree with cells, next to a pipe with fast cells under error control."""
    case = short("delay-line", method="dormand-prince", rtol=1e-7)
    case["links"]["up"] |= {"pipe_model": "finite-volume", "cells": 400}
    case["numerics"]["scheme"] = "upwind5"
    truth = fvsolve.run(short("finite-volume", scheme="upwind5", method="rk4", courant=0.8))
    found = fvsolve.run(case)
    assert found.reason == "finished"
    assert (
        np.abs(known(found, "gate.pressure")[1] - known(truth, "gate.pressure")[1]).max()
        < 0.02 * JUMP
    )


def opening(**numerics) -> dict:
    """Case of a valve at the end of a rough pipe at rest, which opens within 0.15 s."""
    nodes = {"lake": lake(51.6), "end": junction(), "out": lake(9.6)}
    links = {
        "main": scenes.pipe(
            "lake", "end", 31.8, 0.2229, 530.0, 20, friction={"model": "steady", "factor": 0.025}
        ),
        "gate": valve("end", "out", 0.61 * 0.02519, ramp(0.19, 0.15, 0.0, 0.5624)),
    }
    return scene(nodes, links, 0.68, numerics, ["links.main.flow@0", "links.main.flow@1"], 0.01)


def test_a_line_at_rest_with_growing_flow_states_the_velocity_for_its_stretches():
    """With this velocity as `delay_velocity` its flow is that of fine cells, and there is no notice."""
    cells = opening(scheme="weno5", method="ssp-rk3", courant=0.5)
    cells["links"]["main"]["cells"] = 400
    right = fvsolve.run(cells)["links.main.flow@0"]
    lines = {"pipe_model": "delay-line", "method": "rk4", "step": 5e-4, "delay_tolerance": 1e-3}
    own = fvsolve.run(opening(**lines))
    (notice,) = [n for n in own.warnings if n.kind == "lines"]
    velocity = float(notice.text.rpartition("delay_velocity to ")[2].split()[0])
    area = 0.25 * np.pi * 0.2229**2
    assert velocity == pytest.approx(np.abs(own["links.main.flow@0"]).max() / area, rel=0.02)
    by_velocity = opening(**lines)
    by_velocity["output"]["probes"] = ["links.main.velocity@0"]
    assert [n.text for n in fvsolve.run(by_velocity).warnings if n.kind == "lines"] == [notice.text]
    better = fvsolve.run(opening(**lines, delay_velocity=velocity))
    assert not [n for n in better.warnings if n.kind == "lines"]
    errors = [
        np.abs(run["links.main.flow@0"] - right).max() / np.ptp(right) for run in (own, better)
    ]
    assert errors[0] > 2e-3 and errors[0] < notice.value and errors[1] < 0.2 * errors[0]
