"""Days of networks without waves: valves that act at once, sparse solution of the nodes, methods, starts of blocks."""

import math
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from reference.networks_without_waves import (
    DIAMETER,
    FACTOR,
    FALLING,
    LENGTH,
    SIZE,
    pipe,
    reducing,
    town,
)
from reference.scenes import AMBIENT, RHO, WATER
from reference.scenes import GRAVITY as G
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.sparse import csc_array

import fvsolve
from fvsolve.core.kernels.node_clusters import solve_in_order
from fvsolve.core.model.cluster_tables import SparseMatrix
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run, initial_state
from fvsolve.core.steppers import loop_records
from fvsolve.core.steppers.step_control import store_next
from fvsolve.features.controls.feature import blocks_of

LOSS = 8.0 * FACTOR * LENGTH / (math.pi**2 * G * DIAMETER**5)  # head per flow squared [s2/m5]


def run(case):
    found = fvsolve.run(fvsolve.load(case))
    assert found.reason == "finished"
    return found


def signed_root(head):
    return math.copysign(math.sqrt(abs(head) / LOSS), head)


def test_a_reducing_valve_that_acts_at_once_holds_its_set_pressure():
    """The pressure behind the valve is given, so two pipes and the tank remain: their equation is solved by SciPy."""
    found, demand = run(town(reducing())), 0.01

    def fill(level):
        """Flow into the tower: the flow that leaves b less the demand."""

        def imbalance(head):
            return signed_root(45.0 - head) - demand - signed_root(head - 30.0 - level)

        return signed_root(brentq(imbalance, 0.0, 100.0, xtol=1e-13) - 30.0 - level)

    exact = solve_ivp(
        lambda t, y: [fill(y[0]) / 50.0],
        (0.0, 20000.0),
        [3.0],
        rtol=1e-10,
        atol=1e-10,
        t_eval=found.t,
    )
    assert found["tower.level"] == pytest.approx(exact.y[0], abs=1e-6)
    assert found["b.head"] == pytest.approx(np.full(found.t.size, 45.0), abs=1e-9)
    assert found["v.flow"] == pytest.approx(found["p3.flow"] + demand, abs=1e-9)
    full = (
        math.pi / 4.0 * DIAMETER**2 * np.sqrt(2.0 * G * (found["a.head"] - found["b.head"]) / 0.5)
    )
    assert found["v.opening"] == pytest.approx(found["v.flow"] / full, rel=1e-6)
    assert found.summary["steps"] < 100


def test_a_flow_control_valve_that_acts_at_once_holds_its_set_flow():
    valve = {"type": "flow-control", "set_flow": 0.02, "time_constant": 0.0}
    found = run(town(valve))
    assert found["v.flow"] == pytest.approx(np.full(found.t.size, 0.02), abs=1e-9)
    assert found["tower.level"] == pytest.approx(3.0 + (0.02 - 0.01) * found.t / 50.0, abs=1e-6)


def test_a_sustaining_valve_that_acts_at_once_holds_the_upstream_pressure():
    valve = {
        "type": "pressure-sustaining",
        "set_pressure": AMBIENT + 70.0 * RHO * G,
        "time_constant": 0.0,
    }
    found = run(town(valve, end=15000.0))
    assert found["a.head"] == pytest.approx(np.full(found.t.size, 70.0), abs=1e-9)
    assert found["v.flow"] == pytest.approx(np.full(found.t.size, signed_root(10.0)), abs=1e-9)


def test_a_valve_that_acts_at_once_opens_and_shuts_as_a_fast_valve():
    """Its states are those of a valve with a short time constant, and their changes have the same times."""
    found = run(town(reducing(), source=FALLING))
    fast = run(town(reducing(time_constant=0.05), source=FALLING, method="radau-iia-5"))
    assert found["tower.level"] == pytest.approx(fast["tower.level"], abs=1e-4)
    times = [
        {
            event["what"]: event["time"]
            for event in reversed(one.summary["events"])
            if event["name"] == "v"
        }
        for one in (found, fast)
    ]
    # the other valve moves
    assert times[0]["is fully open"] == pytest.approx(times[1]["is fully open"], abs=6.0)
    for what in ("shuts against reversed flow", "opens again"):
        assert times[0][what] == pytest.approx(times[1][what], abs=0.1)
    last = [one.summary["events"][-1] for one in (found, fast)]
    assert [event["what"] for event in last] == ["leaves full opening"] * 2
    assert last[0]["time"] == pytest.approx(last[1]["time"], abs=0.1)


def test_methods_agree_for_a_valve_that_acts_at_once():
    methods = ("dormand-prince", "radau-iia-5", "rodas-5p", "esdirk-5")
    levels = [
        run(town(reducing(), source=FALLING, method=method))["tower.level"] for method in methods
    ]
    for level in levels[1:]:
        assert level == pytest.approx(levels[0], abs=1e-6)


def test_a_valve_acts_at_once_only_between_pipes_without_waves():
    case = town(reducing())
    case["numerics"] = {"end": 1.0, "pipe_model": "finite-volume"}
    for name in ("p1", "p2", "p3"):
        case["links"][name]["wave_speed"] = 1000.0
    with pytest.raises(
        fvsolve.CaseError, match=r"v\.time_constant: 0 s: .*without waves.*quasi-steady"
    ):
        fvsolve.build(fvsolve.load(case))


def test_two_valves_that_act_at_once_cannot_hold_the_same_node():
    case = town(reducing())
    case["links"]["v2"] = {"from": "a", "to": "b", **SIZE, **reducing()}
    with pytest.raises(fvsolve.CaseError, match="both hold the pressure at b"):
        fvsolve.build(fvsolve.load(case))


def test_a_valve_with_a_time_constant_is_stepped_by_an_implicit_method():
    """The rates of waves are unknown here: the stiffness is that of the valve. 10 min took 17 253 explicit steps."""
    found = run(town(reducing(time_constant=5.0), end=600.0, rtol=1e-7))
    assert found.summary["steps"] < 200
    assert [entry["method"] for entry in found.summary["methods"]][-1] == "radau-iia-5"


def test_a_shut_check_valve_stays_shut_at_the_start():
    """If `cb` were open at the start, the flow through it from the high lake would shut `ca`, and nothing opens it."""
    case = town(reducing())
    case["nodes"] |= {
        "high": {"type": "reservoir", "head": 200.0},
        "c": {"type": "junction", "elevation": 0.0},
        "d": {"type": "junction", "elevation": 0.0},
        "j": {"type": "junction", "demand": 0.005, "elevation": 0.0},
        "lower": {"type": "reservoir", "head": 50.0},
    }
    case["links"] |= {
        "pa": pipe("lower", "c"),
        "ca": {"type": "check-valve", "from": "c", "to": "j", **SIZE},
        "pb": pipe("high", "d"),
        "cb": {"type": "check-valve", "from": "j", "to": "d", **SIZE},
    }
    case["links"]["joint"] = pipe("lake", "lower")  # between given heads
    case["numerics"]["end"] = 100.0
    case["output"]["probes"] = ["pa.flow", "pb.flow"]
    found = run(case)
    assert found["pa.flow"] == pytest.approx(np.full(found.t.size, 0.005), abs=1e-9)
    assert found["pb.flow"] == pytest.approx(np.zeros(found.t.size), abs=1e-9)


def latches(count):
    """Blocks that open and shut the valve at the town by the level of the tower, and constants that they read."""
    blocks = {}
    for k in range(count):
        blocks[f"set-{k}"] = {"type": "function", "formula": "0"}
        blocks[f"reset-{k}"] = {
            "type": "function",
            "formula": "(level > 9)",
            "inputs": {"level": "tower.level"},
        }
        blocks[f"latch-{k}"] = {
            "type": "latch",
            "set": f"controls.set-{k}",
            "reset": f"controls.reset-{k}",
            "initial": 1,
        }
    return blocks


@pytest.mark.parametrize("count", [1, 10])
def test_constant_blocks_cost_no_steady_states_at_the_start(count, monkeypatch):
    """The number of steady states that the start needs does not grow with blocks that no key follows at once."""
    build = import_module("fvsolve.core.model.build")
    solved, own = [], build.steady_profile
    monkeypatch.setattr(build, "steady_profile", lambda draft: solved.append(1) or own(draft))
    case = town(reducing())
    case["links"]["v"]["time_constant"] = 5.0
    case["links"]["p3"]["to"] = "end"
    case["nodes"]["end"] = {"type": "junction", "elevation": 0.0}
    case["links"]["gate"] = {
        "type": "valve",
        "from": "end",
        "to": "tower",
        **SIZE,
        "opening": {"control": "inverse"},
    }
    case["controls"] = latches(count) | {
        "inverse": {
            "type": "function",
            "formula": "1 - 0.5*other",
            "inputs": {"other": "controls.latch-0"},
        }
    }
    for k in range(1, count):
        name = f"drain-{k}"
        case["links"][name] = {
            "type": "valve",
            "from": "town",
            "to": "lake",
            "diameter": 0.001,
            "discharge_coefficient": 0.6,
            "opening": {"control": f"latch-{k}"},
        }
    model = fvsolve.build(fvsolve.load(case))
    assert len(solved) <= 3
    start = blocks_of(model)["start"]
    names = list(fvsolve.load(case).controls)
    known = {
        name: value for name, value in zip(model.tables and sorted(names), start, strict=False)
    }
    assert sorted(start) == sorted([0.0] * 2 * count + [1.0] * count + [0.5]) and known


def test_the_sparse_elimination_solves_random_matrices():
    rng = np.random.default_rng(3)
    for n in (1, 2, 7, 60):
        ends = [(int(rng.integers(-1, k)), k) for k in range(n)] + [
            tuple(rng.integers(0, n, 2)) for _ in range(n // 2)
        ]
        ends = [(i, j) for i, j in ends if i != j]
        rows = [{"from_node": i if i >= 0 else n, "to_node": j} for i, j in ends]
        matrix = SparseMatrix(
            SimpleNamespace(valve_table=rows), list(range(n)), list(range(len(rows))), [], {}
        )
        full, values = np.diag(rng.uniform(1.0, 2.0, n)), np.zeros(matrix.size)
        for i, j in ends:
            if i >= 0:
                full[i, i] += 3.0
                full[i, j] -= rng.uniform(0.5, 1.0)
                full[j, i] -= rng.uniform(0.5, 1.0)
            full[j, j] += 3.0
        for (i, j), at in matrix.place.items():
            values[at] = full[i, j]
        right = rng.normal(size=n)
        x, integers = right.copy(), np.array(matrix.integers(), dtype=np.int64)
        assert solve_in_order(values, x, n, integers, 0) == 1.0
        assert x == pytest.approx(np.linalg.solve(full, right), rel=1e-10)


def test_a_demand_opens_the_check_valve_that_isolates_it():
    """A valve shuts at once what supplies the demand, and a check valve from a lower lake opens at the same moment."""
    case = town(reducing())
    case["nodes"] |= {
        "j": {"type": "junction", "demand": 0.005, "elevation": 0.0},
        "c": {"type": "junction", "elevation": 0.0},
        "d": {"type": "junction", "elevation": 0.0},
        "lower": {"type": "reservoir", "head": 50.0},
    }
    opening = {"time": [0, 1000], "value": [1, 0], "kind": "step"}
    case["links"] |= {
        "pa": pipe("lower", "c"),
        "ca": {"type": "check-valve", "from": "c", "to": "j", **SIZE},
        "pb": pipe("lake", "d"),
        "gate": {"type": "valve", "from": "d", "to": "j", **SIZE, "opening": opening},
    }
    case["numerics"]["end"] = 2000.0
    case["output"] = {"every": 100.0, "probes": ["pa.flow", "pb.flow"]}
    found = run(case)
    before, after = found.t < 1000.0, found.t > 1000.0  # there are two rows at 1000 s
    for name, first, last in (("pa.flow", 0.0, 0.005), ("pb.flow", 0.005, 0.0)):
        assert found[name][before] == pytest.approx(np.full(before.sum(), first), abs=1e-9)
        assert found[name][after] == pytest.approx(np.full(after.sum(), last), abs=1e-9)


def test_an_inflow_opens_the_check_valve_that_isolates_it():
    """A valve shuts at once what takes the inflow, and a check valve to a higher lake opens at the same moment."""
    case = town(reducing())
    case["nodes"] |= {
        "j": {"type": "junction", "demand": -0.005, "elevation": 0.0},
        "c": {"type": "junction", "elevation": 0.0},
        "d": {"type": "junction", "elevation": 0.0},
        "upper": {"type": "reservoir", "head": 150.0},
    }
    opening = {"time": [0, 1000], "value": [1, 0], "kind": "step"}
    case["links"] |= {
        "pa": pipe("c", "upper"),
        "ca": {"type": "check-valve", "from": "j", "to": "c", **SIZE},
        "pb": pipe("lake", "d"),
        "gate": {"type": "valve", "from": "d", "to": "j", **SIZE, "opening": opening},
    }
    case["numerics"]["end"] = 2000.0
    case["output"] = {"every": 100.0, "probes": ["pa.flow", "pb.flow"]}
    found = run(case)
    before, after = found.t < 1000.0, found.t > 1000.0  # there are two rows at 1000 s
    for name, first, last in (("pa.flow", 0.0, 0.005), ("pb.flow", -0.005, 0.0)):
        assert found[name][before] == pytest.approx(np.full(before.sum(), first), abs=1e-9)
        assert found[name][after] == pytest.approx(np.full(after.sum(), last), abs=1e-9)


def test_the_sparse_elimination_names_the_unknown_without_a_pivot():
    """Node 2 is joined to nothing: its equation has no term."""
    rows = [{"from_node": 0, "to_node": 1}]
    matrix = SparseMatrix(SimpleNamespace(valve_table=rows), [0, 1, 2], [0], [], {})
    values, right = np.zeros(matrix.size), np.array([7.0, 7.0, 7.0])
    for (i, j), at in matrix.place.items():
        values[at] = 0.0 if i == 2 else 2.0 if i == j else -1.0
    assert solve_in_order(values, right, 3, np.array(matrix.integers(), dtype=np.int64), 0) == 0.0
    assert right[0] == 2.0


# stiffness and events -------------------------------------------------------------------------------------------------


def side_by_side(method, rtol, pattern, length=20.0):
    """Case: an inflow into one of two tanks at one level, joined by a short wide pipe."""
    joint = pipe("left", "right") | {"length": length, "diameter": 0.4}
    flow = {"time": [3600.0 * k for k in range(len(pattern))], "value": pattern, "kind": "step"}
    tank = {"type": "tank", "elevation": 0.0, "level": 5.0, "height": 40.0}
    nodes = {
        "left": tank | {"area": 200.0},
        "right": tank | {"area": 120.0},
        "well": {"type": "inflow", "flow": flow, "elevation": 0.0},
    }
    links = {"p": joint, "in": pipe("well", "left")}
    numerics = {"end": 86400.0, "pipe_model": "quasi-steady", "method": method, "rtol": rtol}
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": 1800.0, "probes": ["left.level", "right.level", "p.flow"]},
    }


@pytest.mark.parametrize("rtol, within", [(1e-6, 1e-4), (1e-8, 2e-5)])
def test_parallel_tanks_move_as_a_single_tank_in_few_steps(rtol, within):
    """Two tanks at one level: the flow between them has a steep slope there. Inflow and areas give its size."""
    pattern = [0.02 * math.sin(0.7 * k) + 0.002 for k in range(24)]
    found = run(side_by_side("auto", rtol, pattern))
    area, volume = 320.0, np.concatenate([[0.0], np.cumsum(pattern) * 3600.0])
    mean = (200.0 * found["left.level"] + 120.0 * found["right.level"]) / area
    added = np.interp(found.t, 3600.0 * np.arange(25), volume)
    assert mean == pytest.approx(5.0 + added / area, abs=1e-8)
    middle = found.t % 3600.0 == 1800.0
    assert found["p.flow"][middle] == pytest.approx(np.array(pattern) * 120.0 / area, abs=within)
    assert found.summary["steps"] < 1500


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["along", "against"])
@pytest.mark.parametrize(
    "method, rtol", [("rodas-5p", 1e-6), ("rodas-5p", 1e-5), ("radau-iia-5", 1e-5), ("auto", 1e-6)]
)
def test_a_trickle_between_tanks_at_a_common_level_takes_few_steps(method, rtol, sign, law):
    """Below the drop that no tolerance shows the law of the pipe is smooth: rodas-5p took 13 420 steps."""
    case = side_by_side(method, rtol, [1e-4] * 4)
    case["numerics"]["end"], case["fluid"] = 7200.0, {**WATER, "law": law}
    if sign < 0.0:
        case["links"]["p"] |= {"from": "right", "to": "left"}
    found = run(case)
    assert found["p.flow"][-1] == pytest.approx(sign * 1e-4 * 120.0 / 320.0, rel=1e-3)
    assert abs(found["left.level"][-1] - found["right.level"][-1]) < 20.0 * rtol * 0.1
    assert found.summary["steps"] < 60


def test_an_event_is_located_in_few_attempts_where_another_jumps_beyond_it():
    """A pump stops at a level; within the same long step another tank would overflow its altitude valve.

    The event functions of that valve jump, so the Illinois rule alone, or bisection, needs 40 attempts.
    """
    case = side_by_side("dormand-prince", 1e-7, [0.0])
    del case["links"]["p"], case["links"]["in"], case["nodes"]["well"]
    case["nodes"] |= {
        "lake": {"type": "reservoir", "head": 30.0},
        "a": {"type": "junction", "elevation": 0.0},
    }
    valve = {"type": "altitude-valve", "from": "a", "to": "right", "full_level": 5.5, **SIZE}
    case["links"] |= {
        "fill": pipe("lake", "left") | {"diameter": 0.1},
        "p": pipe("lake", "a"),
        "v": valve,
        "gate": {
            "type": "valve",
            "from": "lake",
            "to": "left",
            "diameter": 0.05,
            "loss_coefficient": 50.0,
            "opening": {"control": "stop"},
        },
    }
    case["controls"] = {
        "stop": {"type": "relay", "input": "nodes.left.level", "on": 4.0, "off": 5.05, "initial": 1}
    }
    found = run(case)
    events = {event["name"]: event["time"] for event in found.summary["events"]}
    assert events["controls.stop"] < events["v"]
    assert found.summary["rhs"] < 7 * found.summary["steps"] + 7 * 12 * len(found.summary["events"])


@pytest.mark.parametrize("method", ["euler", "rk4", "implicit-midpoint"])
@pytest.mark.parametrize("step", [60.0, 300.0])
def test_given_steps_miss_no_time_after_a_kink_or_an_event(method, step):
    """After a kink between steps, or an event, the time went on to the next multiple of the step without flow."""
    demand = {"time": [0.0, 1234.5], "value": [0.01, 0.015], "kind": "step"}
    check = {"type": "check-valve", **SIZE}
    case = town(check, demand=demand, source=32.0, method=method, step=step, end=20030.0)
    del case["numerics"]["rtol"]
    found = run(case)
    (event,) = [event for event in found.summary["events"] if event["name"] == "v"]
    assert event["what"] == "opens" and event["time"] % 60.0 > 1.0
    drawn = 1234.5 * 0.01 + (20030.0 - 1234.5) * 0.015
    by_node = found.ledger["mass"]["by_node"]
    assert by_node["town"] == pytest.approx(-RHO * drawn, rel=1e-12)
    fallen = 50.0 * (3.0 - found["tower.level"][-1])
    assert fallen == pytest.approx(drawn - by_node["lake"] / RHO, rel=1e-9)


def filled_by_a_relay(method):
    """Case of a tank that a relay fills between two levels, with a demand on the way."""
    case = side_by_side(method, 1e-6, [0.0])
    case["nodes"] = {
        "lake": {"type": "reservoir", "head": 30.0},
        "town": {"type": "junction", "elevation": 0.0, "demand": 0.004},
        "tower": {"type": "tank", "elevation": 15.0, "area": 150.0, "level": 2.0},
    }
    gate = {"type": "valve", "from": "lake", "to": "a", **SIZE, "opening": {"control": "fill"}}
    case["nodes"]["a"] = {"type": "junction", "elevation": 0.0}
    case["links"] = {"gate": gate, "main": pipe("a", "town"), "p": pipe("town", "tower")}
    relay = {"type": "relay", "input": "nodes.tower.level", "on": 1.5, "off": 2.5, "initial": 0}
    case["controls"], case["output"]["probes"] = {"fill": relay}, ["tower.level", "main.flow"]
    case["numerics"]["end"] = 172800.0
    return case


def test_a_step_that_ends_at_an_event_is_not_searched_for_earlier_ones():
    """The level is nearly straight between two switches, so it cannot have reached the threshold earlier."""
    found = run(filled_by_a_relay("rodas-5p"))
    events, tries, stages = (
        len(found.summary["events"]),
        found.summary["steps"] + found.summary["rejections"],
        9,
    )
    assert events == 8 and found["tower.level"].min() == pytest.approx(1.5, abs=0.05)
    assert found.summary["rhs"] < stages * (tries + 4 * events)


def test_a_step_that_an_event_shortens_does_not_shorten_the_next():
    """An event 1e-8 s after another one left a step of 2e-9 s, from which steps grew again by a factor of 8."""
    control, state = np.zeros(1, loop_records.CONTROL)[0], np.zeros(1, loop_records.STATE)[0]
    control["kind"], control["mode"], control["order"] = (
        loop_records.LINEARLY_IMPLICIT,
        loop_records.TOLERANCE,
        5.0,
    )
    # unless its own error is near the tolerance
    for error, expected in ((1e-20, 600.0), (0.99, 0.9 * 1e-8)):
        state["step"], state["last"], state["error_old"], state["steps"] = 600.0, 500.0, 1e-3, 7.0
        getattr(store_next, "py_func", store_next)(control, state, 1e-8, error, True, False, 0.0)
        assert state["step"] == pytest.approx(expected, rel=0.01)


def test_the_jacobian_of_a_run_has_the_derivatives_of_the_converged_network():
    """Its differences take a single step of Newton in the network; central differences of converged flows have errors
    of 1e-7."""
    case = side_by_side("rodas-5p", 1e-6, [0.01])
    case["nodes"]["town"] = {"type": "junction", "elevation": 0.0, "demand": 0.02}
    case["nodes"]["tower"] = {
        "type": "tank",
        "elevation": 0.0,
        "level": 8.0,
        "area": 30.0,
        "height": 40.0,
    }
    case["links"] |= {
        "a": pipe("left", "town"),
        "b": pipe("right", "town"),
        "c": pipe("town", "tower"),
    }
    case["numerics"]["end"] = 3000.0
    model = fvsolve.build(fvsolve.load(case))
    sink, state = MemorySink(model), initial_state(model)
    sink.begin(model, state)
    course = Run(model, state, sink, None, 1)
    assert course.go().reason == "finished"
    stepper = course.loop.stepper
    first = stepper.y[int(stepper.progress["old"][0])]
    matrix = csc_array(
        (
            stepper.jacobian,
            *(getattr(model.structure.pattern, key) for key in ("indices", "indptr")),
        )
    )
    exact = model.jacobian(float(stepper.progress["t_old"][0]), first)
    assert matrix.toarray()[: model.y_size] == pytest.approx(exact, rel=1e-5, abs=1e-9)
