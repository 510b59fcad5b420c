"""Spool valves: edges, size, spool dynamics and the servo axis, against closed forms and SciPy."""

import tomllib
from math import pi, sqrt

import numpy as np
import pytest
from pytest import approx
from reference import servo_axis
from reference.folders import CASES
from reference.jacobians import random_state, stray
from reference.resumed_runs import killed_and_resumed, same_files
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.loops.loop import loop

OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.2e9, "viscosity": 32e-6 * 870.0}
PRESSURES = {"P": 140e5, "T": 2e5, "A": 60e5, "B": 65e5}
PORTS = {"4/3": "PTAB", "3/2": "PAT", "2/2": "PA"}
W, CLOSE = 2.0 * pi * 60.0, 1e-9
SERVO = {"natural_frequency": 60.0, "damping_ratio": 0.8}
STEP = {"start": 0.01, "duration": 0.0, "value": [0.0, 0.5]}
METHODS = [("dormand-prince", 1e-11), ("radau-iia-5", 1e-10), ("rodas-5p", 1e-9), ("auto", 1e-10)]


def table(*points):
    return {"time": [point[0] for point in points], "value": [point[1] for point in points]}


def valve_between_ports(ways="4/3", end=0.1, held=True, links=(), **spool):
    """Case of a spool valve between reservoirs, or chambers at A and B unless they are `held`."""
    nodes = {}
    for port in PORTS[ways]:
        nodes[port] = {"type": "reservoir", "pressure": PRESSURES[port]}
        if port in "AB" and not held:
            nodes[port] = {"type": "chamber", "volume": 1e-2, "initial_pressure": PRESSURES[port]}
    valve = {
        "type": "spool-valve",
        "ways": ways,
        "ports": {port: port for port in PORTS[ways]},
        "area": 1e-5,
        "laminar_reynolds": 1e-6,
    }
    probes = [*(f"spool.flow_{port}" for port in PORTS[ways]), "spool.position"]
    probes += [] if held else [f"{port}.pressure" for port in PORTS[ways] if port in "AB"]
    return {
        "fluid": OIL,
        "nodes": nodes,
        "links": {"spool": valve | spool, **dict(links)},
        "numerics": {"end": end, "method": "dormand-prince", "rtol": 1e-11},
        "output": {"probes": probes, "every": end / 50},
    }


def sized(case, **size):
    """Case whose valve has other keys for its size."""
    del case["links"]["spool"]["area"]
    case["links"]["spool"] |= size
    return case


def flow(opening, drop, area=0.61e-5):
    return max(opening, 0.0) * area * sqrt(2.0 * abs(drop) / 870.0) * np.sign(drop)


# edges ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [-1.0, -0.5, -0.02, 0.0, 0.03, 0.5, 1.0])
def test_each_edge_opens_beyond_its_own_overlap(x):
    laps = {"P-A": 0.05, "P-B": -0.04, "A-T": 0.1, "B-T": 0.0}
    run = fvsolve.run(valve_between_ports(end=0.01, position=x, overlap=laps))
    openings = {
        edge: (side * x - laps[edge]) / (1.0 - laps[edge])
        for edge, side in (("P-A", 1), ("P-B", -1), ("A-T", -1), ("B-T", 1))
    }
    edges = {
        edge: flow(opening, PRESSURES[edge[0]] - PRESSURES[edge[2]])
        for edge, opening in openings.items()
    }
    sums = {
        port: sum(q * ((edge[0] == port) - (edge[2] == port)) for edge, q in edges.items())
        for port in "PTAB"
    }
    for port in "PTAB":
        assert run[f"spool.flow_{port}"] == approx(sums[port], rel=CLOSE, abs=1e-15)
    assert (run["spool.position"] == x).all()


@pytest.mark.parametrize("ways, x, flows", [
    ("3/2", 0.5, {"P": flow(0.5, 80e5), "A": -flow(0.5, 80e5), "T": 0.0}),
    ("3/2", -0.5, {"P": 0.0, "A": flow(0.5, 58e5), "T": -flow(0.5, 58e5)}),
    ("2/2", 0.5, {"P": flow(0.5, 80e5), "A": -flow(0.5, 80e5)}),
    ("2/2", -0.5, {"P": 0.0, "A": 0.0}),
])  # fmt: skip
@pytest.mark.parametrize("more", [{}, SERVO, {"dead_band": 1e-15}])
def test_valves_with_fewer_ports_have_fewer_edges(ways, x, flows, more):
    key = "command" if more else "position"
    run = fvsolve.run(valve_between_ports(ways, 0.01, **{key: x}, **more))
    assert [str(probe) for probe in run.probes] == [
        *(f"spool.flow_{port}" for port in PORTS[ways]),
        "spool.position",
    ]
    for port, q in flows.items():
        assert run[f"spool.flow_{port}"] == approx(q, rel=CLOSE, abs=1e-15)
    assert run["spool.position"] == approx(0.0 if ways == "2/2" and x < 0 else x, abs=1e-14)


@pytest.mark.parametrize("method, rtol", METHODS)
@pytest.mark.parametrize("keys", [{"key": "position"}, {"key": "command"}, {"key": "command", "dead_band": 0.1}],
                         ids=["position", "command", "dead band"])  # fmt: skip
def test_the_spool_of_a_2_2_valve_stops_at_0(keys, method, rtol):
    """Also with an underlap, with which it stays open there."""
    keys, wave = dict(keys), {"mean": 0.0, "amplitude": 1.0, "period": 0.05}
    run = fvsolve.run(
        valve_between_ports("2/2", 0.1, **{keys.pop("key"): wave}, overlap=-0.1, **keys),
        {"numerics.method": method, "numerics.rtol": rtol},
    )
    u, dead = np.sin(2.0 * pi * np.array(run.t) / 0.05), keys.get("dead_band", 0.0)
    x = np.maximum(u - dead, 0.0) / (1.0 - dead)
    assert run["spool.position"] == approx(x, abs=1e-11)
    assert run["spool.flow_P"] == approx(
        np.array([flow((y + 0.1) / 1.1, 80e5) for y in x]), rel=1e-9
    )
    assert "reaches its lower stop" in {event["what"] for event in run.summary["events"]}


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_rated_flow_passes_an_edge_at_the_rated_drop(law):
    case = sized(valve_between_ports("2/2", 0.01, position=1.0), rated_flow=6.7e-4, rated_drop=80e5)
    case["fluid"] = OIL | {"law": law}
    run = fvsolve.run(case)
    assert run["spool.flow_P"] == approx(6.7e-4, rel=1e-12 if law == "linear" else 1e-2)
    assert energy(case).dissipated["spool.P-A"][-1] == approx(80e5 * 6.7e-4 * 0.01, rel=2e-2)


def test_a_rated_flow_is_the_equal_kv():
    kv = {"Kv": 6.7e-4 * 3600.0 * sqrt(1e5 / 80e5) * sqrt(870.0 / 1000.0)}
    wave = {"mean": 0.1, "amplitude": 0.8, "period": 0.05}
    found = [
        fvsolve.run(sized(valve_between_ports(held=False, position=wave), **size))
        for size in ({"rated_flow": 6.7e-4, "rated_drop": 80e5}, kv)
    ]
    assert found[0]["A.pressure"] == approx(found[1]["A.pressure"], rel=1e-11)


# the spool --------------------------------------------------------------------------------------------------------


def swing(t, zeta, goal):
    """Position of a second-order lag after a step to `goal` at t = 0."""
    t = np.maximum(t, 0.0)
    if zeta == 1.0:
        return goal * (1.0 - (1.0 + W * t) * np.exp(-W * t))
    root = sqrt(abs(1.0 - zeta * zeta))
    if zeta < 1.0:
        return goal * (
            1.0
            - np.exp(-zeta * W * t) * (np.cos(root * W * t) + zeta / root * np.sin(root * W * t))
        )
    fast, slow = W * (zeta + root), W * (zeta - root)
    return goal * (1.0 - (fast * np.exp(-slow * t) - slow * np.exp(-fast * t)) / (fast - slow))


@pytest.mark.parametrize("method, rtol", METHODS)
@pytest.mark.parametrize("zeta", [0.3, 1.0, 2.0])
def test_the_spool_follows_a_step_as_its_closed_form(zeta, method, rtol):
    case = valve_between_ports(command=STEP, natural_frequency=60.0, damping_ratio=zeta)
    run = fvsolve.run(case, {"numerics.method": method, "numerics.rtol": rtol})
    assert run["spool.position"] == approx(swing(run.t - 0.01, zeta, 0.5), abs=CLOSE)
    assert run["spool.flow_P"] == approx(
        np.array([flow(x, 80e5) for x in run["spool.position"]]), abs=1e-12
    )


def test_at_the_natural_frequency_the_position_lags_by_90_degrees():
    for zeta in (0.3, 0.8, 1.5):
        found = fvsolve.studies.linearise(
            valve_between_ports(command=0.2, natural_frequency=60.0, damping_ratio=zeta),
            ["spool.command"],
            ["spool.position"],
        )
        at = (found.c @ np.linalg.solve(1j * W * np.eye(2) - found.a, found.b) + found.d)[0, 0]
        assert at == approx(1.0 / (2j * zeta), abs=1e-8)
    case = valve_between_ports(
        end=1.0,
        command="0.3*sin(120*pi*t)",
        natural_frequency=60.0,
        damping_ratio=0.8,
        overlap=-0.6,
    )
    case["output"]["every"] = 1.0 / 480.0
    run = fvsolve.run(case)
    assert run["spool.position"][-40:] == approx(
        -0.3 / 1.6 * np.cos(120.0 * pi * run.t[-40:]), abs=1e-8
    )


def hybrid(command, times, zeta=0.8, fastest=np.inf, half=0.0, dead=0.0, jumps=()):
    """Position of a spool by SciPy, with the kinks of its law as events; command : function of t"""

    def error(t, y):
        u = command(t)
        e = np.sign(u) * max(0.0, abs(u) - dead) / (1.0 - dead) - y[0]
        return np.sign(e) * max(0.0, abs(e) - half)

    def rates(t, y):
        t = min(t, last)
        push = W * (W * error(t, y) - 2.0 * zeta * y[1])
        return [y[1], 0.0 if abs(y[1]) >= fastest and push * y[1] > 0.0 else push]

    y, t, found = np.zeros(2), 0.0, []
    for end in [*jumps, times[-1]]:
        last = np.nextafter(end, 0.0)
        part = solve_ivp(
            rates, (t, end), y, "DOP853", dense_output=True, rtol=1e-12, atol=1e-13, max_step=1e-4
        )
        found.append(part.sol(times[(times >= t) & (times < end)]))
        t, y = end, part.y[:, -1]
    return np.column_stack([*found, y[:, None]])[0]


MOVES = {  # keys beside those of `SERVO`, and arguments of `hybrid`
    "speed": ({"stroke_time": 0.02}, {"fastest": 50.0}),
    "hysteresis": ({"hysteresis": 0.1}, {"half": 0.05}),
    "dead band": ({"dead_band": 0.1}, {"dead": 0.1}),
    "all": (
        {"stroke_time": 0.02, "hysteresis": 0.1, "dead_band": 0.1},
        {"fastest": 50.0, "half": 0.05, "dead": 0.1},
    ),
}
SLOW_AND_QUICK = table((0.0, 0.0), (0.01, 0.6), (0.02, 0.6), (0.021, -0.7), (0.06, 0.0), (0.1, 0.3))


@pytest.mark.parametrize("name", MOVES)
def test_limits_hysteresis_and_dead_band_follow_scipy(name):
    more, arguments = MOVES[name]
    command = lambda t: np.interp(t, SLOW_AND_QUICK["time"], SLOW_AND_QUICK["value"])  # noqa: E731
    run = fvsolve.run(valve_between_ports(command=SLOW_AND_QUICK, overlap=-0.1, **SERVO, **more))
    truth = hybrid(command, np.asarray(run.t), jumps=SLOW_AND_QUICK["time"][1:-1], **arguments)
    assert run["spool.position"] == approx(truth, abs=3e-9)
    if "stroke_time" in more:
        assert "moves forward at its greatest speed" in [
            event["what"] for event in run.summary["events"]
        ]


def test_a_full_stroke_takes_the_stroke_time():
    command = {"start": 0.0, "duration": 0.0, "value": [0.0, 1.0]}
    case = valve_between_ports(
        command=command, natural_frequency=5e3, damping_ratio=1.0, stroke_time=0.05
    )
    case["output"]["every"] = 1e-3
    run = fvsolve.run(case)
    events = {event["what"]: event["time"] for event in run.summary["events"]}
    assert 0.0 < events["moves forward at its greatest speed"] < 1e-4
    assert 0.049 < events["is slower again"] < 0.05
    assert np.diff(run["spool.position"])[10:40] == approx(1e-3 / 0.05, rel=1e-9)


def test_a_spool_that_swings_beyond_its_stop_rests_there():
    zeta, root = 0.2, sqrt(1.0 - 0.2**2)
    case = valve_between_ports(
        command=table((0.05, 0.9), (0.08, 0.0)), natural_frequency=60.0, damping_ratio=zeta
    )
    case["links"]["spool"]["command"] |= {
        "kind": "step",
        "time": [0.0, 0.01, 0.05],
        "value": [0.0, 0.9, 0.0],
    }
    run = fvsolve.run(case)
    low, high = 0.0, pi / (root * W)  # up to its first peak
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if swing(middle, zeta, 0.9) < 1.0 else (low, middle)
    (reach, leave) = (event for event in run.summary["events"] if "upper stop" in event["what"])
    assert (
        reach["time"] == approx(0.01 + low, abs=1e-9) and reach["what"] == "reaches its upper stop"
    )
    # the command, 0.9, draws it back from rest at once
    assert leave["time"] == approx(reach["time"], abs=1e-6)
    after = (run.t > leave["time"]) & (run.t < 0.05)
    assert run["spool.position"][after] == approx(
        1.0 + swing(run.t[after] - reach["time"], zeta, -0.1), abs=1e-8
    )
    assert run["spool.position"].max() <= 1.0 + 1e-12


def test_a_full_command_holds_the_spool_at_its_stop():
    case = valve_between_ports(
        command=table((0.01, 0.0), (0.011, 1.0), (0.06, 1.0), (0.061, -1.0)),
        natural_frequency=60.0,
        damping_ratio=0.3,
    )
    run = fvsolve.run(case)
    events = [event["what"] for event in run.summary["events"]]
    assert events == ["reaches its upper stop", "leaves its upper stop", "reaches its lower stop"]
    assert (run["spool.position"][(run.t > 0.03) & (run.t < 0.06)] == 1.0).all()
    assert run["spool.position"][-1] == -1.0


@pytest.mark.parametrize("dead", [None, 0.1])
def test_slow_commands_leave_half_the_hysteresis_on_each_side(dead):
    command = table((0.0, 0.0), (5.0, 0.8), (10.0, -0.8), (12.5, 0.0))
    keys = {"hysteresis": 0.06, "stroke_time": 0.02} | ({} if dead is None else {"dead_band": dead})
    case = valve_between_ports(
        end=12.5, command=command, natural_frequency=60.0, damping_ratio=1.0, **keys
    )
    run, d = fvsolve.run(case, {"numerics.rtol": 1e-8, "output.every": 0.25}), dead or 0.0
    for t, u, side in ((4.0, 0.64, 1), (9.0, -0.48, -1), (12.0, -0.16, 1)):
        target = np.sign(u) * (abs(u) - d) / (1.0 - d)
        speed = (0.16 if t < 5 else 0.32) / (1.0 - d)  # a ramp is followed with the lag 2 zeta / w
        assert run["spool.position"][np.searchsorted(run.t, t)] == approx(
            target - side * (0.03 + 2.0 / W * speed), abs=1e-6
        )


@pytest.mark.in_turn
@pytest.mark.parametrize("overlap", [0.0, 0.05, -0.05])
@pytest.mark.parametrize("command", [{"mean": 0.05, "amplitude": 0.5, "period": 0.04},
                                     "0.05 + 0.5*sin(50*pi*t)", SLOW_AND_QUICK])  # fmt: skip
def test_a_dead_band_without_dynamics_acts_at_once(command, overlap):
    run = fvsolve.run(
        valve_between_ports(held=False, command=command, dead_band=0.2, overlap=overlap)
    )
    u = np.interp(run.t, SLOW_AND_QUICK["time"], SLOW_AND_QUICK["value"])
    u = u if command is SLOW_AND_QUICK else 0.05 + 0.5 * np.sin(50.0 * pi * run.t)
    x = np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0) / 0.8
    assert run["spool.position"] == approx(x, abs=1e-14)
    # the same as positions by formula
    text = f"({command})" if isinstance(command, str) else "(0.05 + 0.5*sin(50*pi*t))"
    if command is not SLOW_AND_QUICK:
        by_hand = f"(max(0, {text} - 0.2) - max(0, -{text} - 0.2))/0.8"
        other = fvsolve.run(valve_between_ports(held=False, position=by_hand, overlap=overlap))
        assert run["A.pressure"] == approx(other["A.pressure"], rel=1e-9)


# restatements -----------------------------------------------------------------------------------------------------

WAVE = {"mean": 0.1, "amplitude": 0.5, "period": 0.04}
FORMULA = "0.1 + 0.5*sin(50*pi*t)"
RAMP = {"start": 0.01, "duration": 0.05, "value": [0.6, -0.4]}


@pytest.mark.in_turn
@pytest.mark.parametrize("overlap", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("position, twin", [
    (WAVE, FORMULA), (RAMP, table((0.01, 0.6), (0.06, -0.4))), (RAMP, "0.6 - 20*min(0.05, max(0, t - 0.01))"),
    (WAVE, {"control": "wave"}),
])  # fmt: skip
def test_a_position_in_other_words_is_the_same_run(position, twin, overlap):
    found = []
    for given in (position, twin):
        case = valve_between_ports(held=False, position=given, overlap=overlap)
        case["controls"] = {"wave": {"type": "function", "inputs": {}, "formula": FORMULA}}
        found.append(fvsolve.run(case))
    by_control = isinstance(twin, dict) and "control" in twin  # its kinks are not known ahead
    for probe in ("A.pressure", "B.pressure", "spool.position"):
        near = {"rel": 3e-9, "abs": 1e-9} if by_control else {"rel": 1e-10, "abs": 1e-13}
        assert found[0][probe] == approx(found[1][probe], **near)


@pytest.mark.parametrize("given", [WAVE, FORMULA, RAMP])
def test_a_command_without_dynamics_is_the_position_to_the_bit(given):
    found = [
        fvsolve.run(valve_between_ports(held=False, overlap=0.05, **{key: given}))
        for key in ("position", "command")
    ]
    for probe in ("A.pressure", "B.pressure", "spool.flow_A", "spool.position"):
        assert np.array_equal(found[0][probe], found[1][probe])


def test_a_common_overlap_for_all_edges_is_a_table_of_equal_overlaps_to_the_bit():
    laps = dict.fromkeys(("P-A", "P-B", "A-T", "B-T"), 0.05)
    for more in ({"position": WAVE}, {"command": STEP} | SERVO):
        found = [
            fvsolve.run(valve_between_ports(held=False, overlap=lap, **more))
            for lap in (0.05, laps)
        ]
        assert np.array_equal(found[0]["A.pressure"], found[1]["A.pressure"])


@pytest.mark.in_turn
@pytest.mark.parametrize("overlap", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_spool_valve_is_four_valves(overlap, reverse):
    whole = fvsolve.run(valve_between_ports(held=False, position=FORMULA, overlap=overlap))
    case = valve_between_ports(held=False, position=FORMULA)
    links = {}
    for start, end, side in (("P", "A", 1), ("P", "B", -1), ("A", "T", -1), ("B", "T", 1)):
        opening = f"max(0, ({side}*({FORMULA}) - {overlap})/{1.0 - overlap})"
        ends = (end, start) if reverse else (start, end)
        links[f"{start}{end}"] = {
            "type": "valve",
            "from": ends[0],
            "to": ends[1],
            "area": 1e-5,
            "opening": opening,
            "laminar_reynolds": 1e-6,
        }
    case["links"], case["output"]["probes"] = links, ["A.pressure", "B.pressure", "PA.flow"]
    apart = fvsolve.run(case)
    for port in "AB":
        assert whole[f"{port}.pressure"] == approx(apart[f"{port}.pressure"], rel=1e-9)


@pytest.mark.parametrize(
    "keys", [{}, SERVO | {"stroke_time": 0.02, "hysteresis": 0.04, "dead_band": 0.05}]
)
def test_a_valve_and_its_mirror_image_pass_the_same(keys):
    key, found = "command" if keys else "position", []
    for side, ports in ((1.0, "PTAB"), (-1.0, "PTBA")):
        wave = {"mean": 0.1 * side, "amplitude": 0.5 * side, "period": 0.04}
        laps = {"P-A": 0.05, "B-T": -0.02} if side > 0 else {"P-B": 0.05, "A-T": -0.02}
        case = valve_between_ports(held=False, overlap=laps, **{key: wave}, **keys)
        case["links"]["spool"]["ports"] = dict(zip("PTAB", ports, strict=True))
        found.append(fvsolve.run(case))
    for probe in ("A.pressure", "B.pressure"):
        assert found[0][probe] == approx(found[1][probe], rel=1e-9)
    assert found[0]["spool.position"] == approx(-found[1]["spool.position"], abs=1e-9)


def test_units_and_the_order_of_parts_change_nothing():
    case = valve_between_ports(held=False, command=STEP, stroke_time=0.02, **SERVO)
    other = valve_between_ports(
        held=False, command=STEP, stroke_time="20 ms", natural_frequency="60 Hz", damping_ratio=0.8
    )
    other["nodes"] = dict(reversed(other["nodes"].items()))
    other["links"]["spool"]["area"] = "10 mm2"
    found = [fvsolve.run(given) for given in (case, other)]
    assert found[0]["A.pressure"] == approx(found[1]["A.pressure"], rel=1e-12)


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method, rtol", METHODS[1:])
def test_methods_and_laws_agree(method, rtol, law):
    found = []
    for name, accuracy in (METHODS[0], (method, rtol)):
        case = valve_between_ports(
            held=False, end=0.06, command=SLOW_AND_QUICK, **SERVO, **MOVES["all"][0]
        )
        case["fluid"] = OIL | {"law": law}
        found.append(fvsolve.run(case, {"numerics.method": name, "numerics.rtol": accuracy}))
    assert found[0]["spool.position"] == approx(found[1]["spool.position"], abs=1e-8)
    assert found[0]["A.pressure"] == approx(found[1]["A.pressure"], abs=1.0)


# the rest of the program ------------------------------------------------------------------------------------------


# also under other laws
RESTING = [(0.0, {}), (0.05, {"overlap": -0.1}), (-0.1, {"dead_band": 0.1})]
# chambers at equal pressures
HELD = [(0.3, {"dead_band": 0.1}), (1.0, {}), (-1.0, {"hysteresis": 0.1})]


@pytest.mark.in_turn
@pytest.mark.parametrize("law, command, keys", [(law, *rest) for law in ("linear", "log") for rest in RESTING] +
                         [("linear", *rest) for rest in HELD])  # fmt: skip
@pytest.mark.parametrize("method", ["rk4", "dormand-prince", "radau-iia-5", "rodas-5p", "auto"])
def test_a_valve_at_rest_does_not_change_any_bit(method, law, command, keys):
    case = valve_between_ports(end=0.05, command=command, stroke_time=0.02, **SERVO, **keys)
    del case["links"]["spool"]["laminar_reynolds"]
    level = {"type": "chamber", "volume": 1e-3}
    case["nodes"] |= {"A": {"type": "junction"}, "B": level, "C": level}
    case["links"]["line"] = {
        "type": "pipe",
        "from": "A",
        "to": "C",
        "length": 3.0,
        "diameter": 0.02,
        "friction": {"model": "none"},
        "cells": 5,
    }
    case["output"]["probes"] = ["B.pressure", "C.pressure", "spool.position", "spool.flow_A"]
    numerics = (
        {"numerics.step": 1e-4, "numerics.rtol": None}
        if method == "rk4"
        else {"numerics.rtol": 1e-6}
    )
    if numerics.get("numerics.rtol", 1) is None:
        del case["numerics"]["rtol"], numerics["numerics.rtol"]
    case["fluid"] = OIL | {"law": law}
    run = fvsolve.run(case, {"numerics.method": method, **numerics})
    for probe in case["output"]["probes"]:
        assert np.ptp(run[probe]) == 0.0, probe


@pytest.mark.parametrize("ways", ["4/3", "3/2", "2/2"])
def test_no_rate_depends_on_a_state_that_the_pattern_has_not(ways):
    rng = np.random.default_rng(1)
    case = valve_between_ports(
        ways, held=False, command={"control": "hold"}, overlap=-0.05, **SERVO
    )
    case["nodes"]["A"] = {"type": "junction"}
    case["nodes"]["C"] = {"type": "chamber", "volume": 1e-3, "initial_pressure": 60e5}
    case["links"]["line"] = {
        "type": "pipe",
        "from": "A",
        "to": "C",
        "length": 3.0,
        "diameter": 0.02,
        "cells": 5,
    }
    case["controls"] = {
        "hold": {
            "type": "pi",
            "input": "A.pressure",
            "setpoint": 60e5,
            "gain": 1e-8,
            "integral_time": 0.1,
            "limits": [-1, 1],
            "initial": 0.0,
        }
    }
    case["output"]["probes"] = ["A.pressure"]
    for key, more in (("command", SERVO), ("command", {"dead_band": 0.1}), ("position", {})):
        spool = {
            name: value
            for name, value in case["links"]["spool"].items()
            if name not in ("command", *SERVO)
        }
        filtered = {} if more is SERVO else {"filter": 1e-3}
        case["controls"]["hold"] |= filtered
        given = case | {
            "links": case["links"] | {"spool": spool | {key: {"control": "hold"}} | more}
        }
        model = fvsolve.build(fvsolve.load(given))
        for _ in range(3):
            assert stray(model, 0.0, random_state(model, rng)) < 1e-6


def test_a_pressure_that_the_valve_sets_may_command_its_spool_at_once():
    """The pressure at a junction behind the valve follows from the position, a state: no loop without a state."""
    case = valve_between_ports("2/2", 2.0, command={"control": "hold"}, **SERVO)
    case["nodes"] |= {"A": {"type": "junction"}, "T": {"type": "reservoir", "pressure": 2e5}}
    case["links"]["load"] = {"type": "orifice", "from": "A", "to": "T", "area": 4e-6}
    case["controls"] = {
        "hold": {
            "type": "pi",
            "input": "A.pressure",
            "gain": 2e-8,
            "integral_time": 0.02,
            "setpoint": table((0.1, 60e5), (0.12, 80e5)),
            "limits": [0, 1],
        }
    }
    case["output"]["probes"] = ["A.pressure", "spool.position"]
    run = fvsolve.run(case, {"numerics.rtol": 1e-8})
    assert run["A.pressure"][:2] == approx(60e5, abs=1.0)
    assert run["A.pressure"][-1] == approx(80e5, rel=1e-6)
    share = 0.4 * sqrt((80e5 - 2e5) / (140e5 - 80e5))
    assert run["spool.position"][-1] == approx(share, rel=1e-6)
    del case["links"]["spool"]["natural_frequency"], case["links"]["spool"]["damping_ratio"]
    with pytest.raises(CaseError, match="a loop without a state"):
        fvsolve.build(fvsolve.load(case))


def test_the_position_of_the_spool_is_an_input_of_other_blocks_before_the_nodes():
    case = valve_between_ports(held=False, command=STEP, **SERVO)
    case["controls"] = {
        "half": {"type": "function", "inputs": {"x": "spool.position"}, "formula": "0.5*x"}
    }
    case["links"]["by"] = {
        "type": "valve",
        "from": "A",
        "to": "B",
        "area": 1e-6,
        "opening": {"control": "half"},
    }
    case["output"]["probes"] = ["controls.half.output", "spool.position"]
    run = fvsolve.run(case)
    assert np.array_equal(run["controls.half.output"], 0.5 * run["spool.position"])


@pytest.mark.parametrize("keys", [{}, {"dead_band": 0.1}, SERVO])
def test_a_command_held_by_advance_is_that_of_the_file(keys):
    case = valve_between_ports(held=False, command=0.4, overlap=0.05, **keys)
    states = []
    for command, inputs in (
        (0.0, {"spool.command": 0.4}),
        ({"start": 0.0, "duration": 0.0, "value": [0, 0.4]}, {}),
    ):
        model = fvsolve.build(
            fvsolve.load(case | {"links": {"spool": case["links"]["spool"] | {"command": command}}})
        )
        states.append(fvsolve.advance(model, fvsolve.initial_state(model), 0.05, inputs).y)
    assert states[0] == approx(states[1], rel=1e-8, abs=1e-9) and np.abs(states[0]).max() > 1e-3


def test_a_killed_run_resumes_to_the_bit(tmp_path):
    changes = {
        "numerics.method": "radau-iia-5",
        "numerics.rtol": 1e-9,
        "numerics.end": 0.6,
        "expect": {},
    }
    case = tomllib.loads((CASES / "servo-axis.toml").read_text(encoding="utf-8"))
    fvsolve.run(fvsolve.load(case, changes), out=tmp_path / "whole", pictures=False)
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 0.205))


@pytest.mark.parametrize("key, overlap, noted", [("position", 0.0, False), ("command", 0.0, True),
                                                 ("command", -0.02, False)])  # fmt: skip
def test_a_rigid_column_at_a_spool_that_shuts_is_noted(key, overlap, noted):
    keys = SERVO if key == "command" else {}
    case = valve_between_ports(
        end=0.3, overlap=overlap, **{key: table((0.05, 0.5), (0.1, -0.5))}, **keys
    )
    del case["links"]["spool"]["laminar_reynolds"]
    case["nodes"] |= {"A": {"type": "junction"}, "C": {"type": "reservoir", "pressure": 60e5}}
    case["links"]["line"] = {
        "type": "rigid-column",
        "from": "A",
        "to": "C",
        "length": 2.0,
        "diameter": 0.01,
    }
    case["output"]["probes"] = ["line.flow", "spool.flow_A"]
    model = fvsolve.build(fvsolve.load(case, {"numerics.rtol": 1e-6}))
    assert any("a rigid column ends at a port" in notice.text for notice in model.warnings) == noted
    if not noted:
        run = fvsolve.run(model)
        assert run.ok and run["line.flow"][-1] < -3e-4
        assert run["line.flow"] == approx(-run["spool.flow_A"], abs=1e-7)


@pytest.mark.parametrize("keys", [{"position": WAVE}, {"command": STEP} | SERVO])
def test_the_energy_of_a_spool_valve_closes(keys):
    found = energy(valve_between_ports(held=False, **keys) | {"fluid": OIL | {"law": "log"}})
    assert abs(found.remainder[-1]) < 1e-9 * found.throughput
    assert {"spool.P-A", "spool.B-T"} <= found.dissipated.keys() and "spool" not in found.dissipated


# the servo axis ---------------------------------------------------------------------------------------------------

AXIS = [
    "load.position",
    "load.velocity",
    "cyl.A.pressure",
    "cyl.B.pressure",
    "spool.position",
    "controls.position.output",
]


@pytest.fixture(scope="module")
def axis_truth():
    times = np.linspace(0.0, servo_axis.END, 401)
    return times, servo_axis.trajectory(times)


@pytest.mark.parametrize("method, rtol", [("dormand-prince", 1e-11), ("rodas-5p", 1e-9)])
def test_the_servo_axis_is_that_of_scipy(method, rtol, axis_truth):
    times, truth = axis_truth
    run = fvsolve.run(
        "servo-axis",
        {
            "numerics.method": method,
            "numerics.rtol": rtol,
            "output.probes": AXIS,
            "output.units": {},
            "expect": {},
        },
    )
    kept = np.unique(np.round(run.t, 9), return_index=True)[1]
    x, v, in_a, in_b, s = truth[:5]
    volumes = (
        servo_axis.DEAD + servo_axis.AREA_A * x,
        servo_axis.DEAD + servo_axis.AREA_B * (servo_axis.STROKE - x),
    )
    pressures = [
        servo_axis.AMBIENT + servo_axis.BETA * (mass / (servo_axis.RHO * volume) - 1.0)
        for mass, volume in zip((in_a, in_b), volumes, strict=True)
    ]
    for probe, one, scale in zip(
        AXIS, (x, v, *pressures, s), (0.1, 1.0, 1e7, 1e7, 1.0), strict=False
    ):
        assert run[probe][kept] == approx(one, abs=1e-8 * scale), probe


def test_the_energy_of_the_axis_closes_between_its_events():
    found = energy(
        "servo-axis",
        {"fluid.law": "log", "numerics.initial": "steady", "numerics.rtol": 1e-9, "expect": {}},
    )
    assert found.ok and abs(found.remainder[-1]) < 1e-10 * found.throughput


def axis_with(gain, **more):
    """Servo axis at rest whose set position moves by 1 um at 10 ms, as a table."""
    case = tomllib.loads((CASES / "servo-axis.toml").read_text(encoding="utf-8"))
    del case["expect"]
    case["controls"]["position"] |= {
        "gain": gain,
        "setpoint": {"time": [0.01, 0.011], "value": [0.05, 0.050001]},
    }
    case["links"]["weight"]["force"] = -2800.0
    case["numerics"] |= {"end": 3.0, "rtol": 1e-9} | more
    case["output"] = {"every": 1e-3, "probes": ["load.velocity"]}
    return case


def test_the_axis_begins_to_swing_at_the_predicted_gain_within_a_hundredth():
    found = loop("servo-axis", "position")
    assert found.stable and found.gain_range[0] is None
    for factor, grows in ((0.99, False), (1.01, True)):
        speed = np.abs(fvsolve.run(axis_with(20.0 * factor * found.gain_range[1]))["load.velocity"])
        assert (speed[2000:].max() > speed[500:1500].max()) == grows


# bad input --------------------------------------------------------------------------------------------------------

FAULTS = {
    "ways": ({"ways": "5/2"}, 'links.spool.ways: no type of spool valve named "5/2"'),
    "a port too few": (
        {"ports": {"P": "P", "T": "T", "A": "A"}},
        "links.spool.ports: B is missing",
    ),
    "a port too many": ({"ways": "3/2"}, "links.spool.ports.B: unknown key"),
    "overlap": (
        {"overlap": 1.2},
        "links.spool.overlap: 1.2 is out of range; expected a value below 1",
    ),
    "overlap of an edge": (
        {"overlap": {"P-A": 1.0}},
        "links.spool.overlap.P-A: 1.0 is out of range; expected a value",
    ),
    "no such edge": ({"overlap": {"A-B": 0.1}}, "links.spool.overlap.A-B: unknown key"),
    "two sizes": (
        {"rated_flow": 1e-3, "rated_drop": 35e5},
        "links.spool.area: rated_flow and area are given; keep",
    ),
    "no drop": (
        {"area": None, "rated_flow": 1e-3},
        "links.spool.rated_flow: needs the key `rated_drop`",
    ),
    "no flow": ({"rated_drop": 35e5}, "links.spool.rated_drop: needs the key `rated_flow`"),
    "no size": (
        {"area": None},
        "links.spool: size is missing; expected area, diameter, Kv, Cv or rated_flow",
    ),
    "no position": ({"position": None}, "links.spool: expected one of position, command"),
    "position and command": (
        {"command": 0.1},
        "links.spool.command: position and command are given; keep one",
    ),
    "dynamics of a position": (SERVO, "links.spool.natural_frequency: needs the key `command`"),
    "no damping": (
        {"position": None, "command": 0.1, "natural_frequency": 60.0},
        "links.spool.natural_frequency: needs the key `damping_ratio`",
    ),
    "no frequency": (
        {"position": None, "command": 0.1, "stroke_time": 0.1},
        "links.spool.stroke_time: needs the key `natural_freq",
    ),
    "hysteresis at once": (
        {"position": None, "command": 0.1, "hysteresis": 0.1},
        "links.spool.hysteresis: needs the key `natural_freq",
    ),
    "dead band": (
        {"position": None, "command": 0.1, "dead_band": 1.0},
        "links.spool.dead_band: 1.0 is out of range; expected a value of at least 0 and below 1",
    ),
    "ways of two ports": (
        {"ways": "5/2", "ports": {"P": "P", "A": "A"}},
        'links.spool.ways: no type of spool valve named "5/2"; did you mean "3/2"?',
    ),
    "command": ({"position": None, "command": 1.5}, "links.spool.command: 1.5 is out of range"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_bad_input_has_a_single_fault(name):
    keys, text = FAULTS[name]
    case = valve_between_ports(position=0.1)
    spool = case["links"]["spool"] | keys
    case["links"]["spool"] = {key: value for key, value in spool.items() if value is not None}
    case["output"] = {"probes": ["P.pressure"]}
    case["nodes"] = {
        name: node for name, node in case["nodes"].items() if name in str(case["links"])
    }
    with pytest.raises(CaseError) as error:
        fvsolve.load(case)
    faults = [f"{fault.place}: {fault.message}" for fault in error.value.faults]
    assert len(faults) == 1 and faults[0].startswith(text), faults


def test_a_probe_of_a_port_that_the_valve_has_not_is_refused():
    case = valve_between_ports("3/2", position=0.1)
    case["output"]["probes"] = ["spool.flow_B"]
    with pytest.raises(CaseError, match="flow_B"):
        fvsolve.load(case)


def test_implausible_values_are_noted():
    case = valve_between_ports(
        command=0.1, natural_frequency=1e4, damping_ratio=0.01, dead_band=0.6
    )
    texts = " ".join(notice.text for notice in fvsolve.load(case).notices)
    for key in ("natural_frequency", "damping ratio below 0.1", "dead_band"):
        assert key in texts
