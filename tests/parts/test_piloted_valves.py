"""Counterbalance, pilot check, shuttle and compensator valves against SciPy at 1e-9, and as in catalogues."""

import math
import re
import tomllib

import numpy as np
import pytest
from reference import lifted_valves
from reference.folders import CASES, section
from reference.jacobians import stray
from reference.refusals import refused
from reference.resumed_runs import killed_and_resumed, same_files
from reference.scenes import AMBIENT, WATER, chamber, junction, lake, pipe, reservoir, scene, valve
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.studies.energy_balance import energy

TOP = CASES.parent
RHO, BETA = 860.0, 1.4e9
OIL = {**WATER, "density": RHO, "bulk_modulus": BETA, "viscosity": 1e-5}
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]
DISCS = {"lag": {"time_constant": 0.02}, "swing": {"natural_frequency": 15.0, "damping_ratio": 0.4}}
SMALL, VOLUME = 5e-7, 1e-3  # flow area of all valves [m2], volume of all chambers [m3]
STIFF = BETA / VOLUME


def sized(kind, flow_area=SMALL, **keys):
    return {"type": kind, "area": flow_area, "discharge_coefficient": 1.0, **keys}


def through(drop, area=SMALL):
    return area * math.copysign(math.sqrt(2.0 * abs(drop) / RHO), drop)


def follows(table):
    """Function of time that interpolates a table of a case linearly."""
    return lambda t: float(np.interp(t, table["time"], table["value"]))


def pieces(rates, modes, mode, start, kinks, t):
    """States at t of y' = rates(t, y, mode), and [(time, mode)] of the switches.

    modes : mode -> [(mode that follows, function of (t, y) that is positive from there on)]
    """
    y, now, found, switches = np.array(start, float), t[0], np.zeros((len(start), len(t))), []
    while now < t[-1] - 1e-12:
        end = next(k for k in [*kinks, t[-1]] if k > now + 1e-12)
        watch = [leaving for _, leaving in modes[mode]]
        for one in watch:
            one.terminal, one.direction = True, 1
        step = solve_ivp(
            lambda s, z, m=mode: rates(s, z, m), (now, end), y, events=watch, **lifted_valves.TIGHT
        )
        here = (t >= now - 1e-12) & (t <= step.t[-1] + 1e-12)
        if here.any():
            found[:, here] = step.sol(t[here])
        now, y = step.t[-1], step.y[:, -1]
        if step.status == 1:
            mode = modes[mode][next(k for k, times in enumerate(step.t_events) if len(times))][0]
            switches.append((now, mode))
    return found, switches


# counterbalance valve -------------------------------------------------------------------------------------------

SET, SPAN, RATIO = 2e7, 3e6, 3.0
# pressure behind the valves that keep flows from coming to rest, where a square root has no slope
DRAIN = 1e5
LINE = {"time": [0.0, 0.05, 0.25, 0.35, 0.5], "value": [1.9e6, 1.9e6, 3e7, 3e7, 1.9e6]}
PILOT = {"time": [0.0, 1.0, 1.05, 1.1, 1.15], "value": [1.9e6, 1.9e6, 1.3e7, 1.3e7, 1.9e6]}


def held(numerics=TIGHT, **more):
    """Case of a load that its line raises through a counterbalance valve, that is held, and lowered by the pilot."""
    nodes = {
        "load": chamber(VOLUME, 1.2e6),
        "line": chamber(VOLUME, 1e6),
        "pilot": chamber(VOLUME, 1e6),
        "supply": reservoir(LINE),
        "signal": reservoir(PILOT),
        "drain": reservoir(DRAIN),
    }
    links = {
        "hold": sized(
            "counterbalance",
            **{
                "from": "load",
                "to": "line",
                "pilot": "pilot",
                "pilot_ratio": RATIO,
                "set_pressure": SET,
                "overpressure": SPAN,
                **more,
            },
        ),
        "feed": valve("supply", "line", 2e-6),
        "sense": valve("signal", "pilot", 2e-6),
        "spill": valve("line", "drain", 2e-6),
        "bleed": valve("pilot", "drain", 2e-6),
    }
    probes = ["load.pressure", "line.pressure", "pilot.pressure", "hold.flow", "hold.opening"]
    return scene(nodes, links, 1.4, numerics, probes, 0.02, fluid=OIL)


def lifting(load, pilot):
    """Lift [-] that the pressures set, not limited."""
    return ((load - AMBIENT) + RATIO * (pilot - AMBIENT) - (SET - AMBIENT)) / SPAN


def held_rates(t, load, line, pilot, x):
    out = (1.0 if load < line else min(max(x, 0.0), 1.0)) * through(load - line)
    line, pilot = signals(t, line, pilot)
    return STIFF * -out, STIFF * (out + line), STIFF * pilot


def signals(t, line, pilot):
    """Flows from supply and signal, less those to the drain, into the chambers of line and pilot [m3/s]."""
    tables = (LINE, line), (PILOT, pilot)
    return [through(follows(table)(t) - p, 2e-6) - through(p - DRAIN, 2e-6) for table, p in tables]


START = [1.2e6, 1e6, 1e6]
KINKS = sorted({*LINE["time"], *PILOT["time"]} - {0.0})


def test_a_counterbalance_valve_is_that_of_scipy():
    result = fvsolve.run(held())
    forward = lambda s, z: z[0] - z[1]  # noqa: E731
    lift = lambda s, z: lifting(z[0], z[2])  # noqa: E731
    modes = {
        "shut": [("lifted", lift), ("back", lambda s, z: -forward(s, z))],
        "lifted": [
            ("shut", lambda s, z: -lift(s, z)),
            ("open", lambda s, z: lift(s, z) - 1.0),
            ("back", lambda s, z: -forward(s, z)),
        ],
        "open": [("lifted", lambda s, z: 1.0 - lift(s, z)), ("back", lambda s, z: -forward(s, z))],
        "back": [("shut", forward)],
    }
    opening = {
        "shut": lambda z: -1.0,
        "open": lambda z: 1.0,
        "back": lambda z: 1.0,
        "lifted": lambda z: lift(0.0, z),
    }
    exact, switches = pieces(
        lambda t, z, mode: held_rates(t, *z, opening[mode](z)),
        modes,
        "shut",
        START,
        KINKS,
        result.t,
    )
    assert result.ok and [mode for _, mode in switches][:3] == ["back", "shut", "lifted"]
    for name, values in zip(("load", "line", "pilot"), exact, strict=True):
        assert result[f"{name}.pressure"] == pytest.approx(values, abs=1e-9 * 2e7)
    found = [event["time"] for event in result.summary["events"]]
    assert len(found) <= 8
    for time, _ in switches:
        assert min(abs(np.array(found) - time)) < 1e-9 * 2.0


@pytest.mark.parametrize("disc", DISCS)
def test_a_counterbalance_valve_with_a_disc_is_that_of_scipy(disc):
    w, zeta = 2.0 * math.pi * 15.0, 0.4

    def rates(t, y, stopped):
        load, line, pilot = held_rates(t, y[0], y[3], y[4], y[1])
        drive = lifting(y[0], y[4]) - y[1]
        if disc == "lag":
            return [load, 0.0 if stopped else drive / 0.02, 0.0, line, pilot]
        return [
            load,
            *((0.0, 0.0) if stopped else (y[2], w * w * drive - 2.0 * zeta * w * y[2])),
            line,
            pilot,
        ]

    result = fvsolve.run(held(**DISCS[disc]))
    push = lambda t, y: lifting(y[0], y[4]) - y[1]  # noqa: E731
    exact, _ = lifted_valves.stopped(rates, push, [1.2e6, 0.0, 0.0, 1e6, 1e6], KINKS, result.t)
    assert result.ok and len(result.summary["events"]) <= 20
    for name, values in (("load", exact[0]), ("line", exact[3]), ("pilot", exact[4])):
        assert result[f"{name}.pressure"] == pytest.approx(values, abs=2e-9 * 2e7)
    forward = exact[0] > exact[3]
    assert result["hold.opening"][forward] == pytest.approx(
        np.clip(exact[1], 0.0, 1.0)[forward], abs=1e-8
    )


@pytest.mark.parametrize("more", [{}, *DISCS.values()], ids=["none", *DISCS])
def test_it_raises_holds_and_lowers_a_load(more):
    """Reverse flow is free; without pilot the load does not fall at all; the pilot lowers it."""
    result = fvsolve.run(held({"method": "rodas-5p", "rtol": 1e-8}, **more))
    load, held_now = result["load.pressure"], (result.t > 0.55) & (result.t < 1.0)
    assert load[held_now][0] > 8e6 and load[-1] < 7e6
    assert np.ptp(load[held_now]) == 0.0 and np.all(result["hold.flow"][held_now] == 0.0)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 4.5])
def test_the_pilot_pressure_that_opens_it_falls_with_the_ratio(ratio):
    nodes = {
        "load": reservoir(1.7e7),
        "tank": reservoir(AMBIENT),
        "pilot": reservoir({"time": [0.0, 1.0], "value": [AMBIENT, AMBIENT + 1e7]}),
    }
    hold = sized(
        "counterbalance",
        **{
            "from": "load",
            "to": "tank",
            "pilot": "pilot",
            "pilot_ratio": ratio,
            "set_pressure": SET,
            "overpressure": SPAN,
        },
    )
    nodes["end"] = chamber(VOLUME, AMBIENT)
    links = {"hold": hold, "on": valve("tank", "end", SMALL)}
    result = fvsolve.run(
        scene(nodes, links, 1.0, {"rtol": 1e-9}, ["hold.opening"], 0.01, fluid=OIL)
    )
    opened = next(event["time"] for event in result.summary["events"] if event["what"] == "opens")
    assert opened == pytest.approx((SET - 1.7e7) / ratio / 1e7, rel=1e-9)
    assert result["hold.opening"][-1] == pytest.approx(
        min((ratio * 1e7 - (SET - 1.7e7)) / SPAN, 1.0), abs=1e-9
    )


# pilot check valve ----------------------------------------------------------------------------------------------

CRACKING = 3e5


def locked(numerics=TIGHT, **more):
    """Case of a load that is raised through a pilot check valve, held, and released by the pilot."""
    case = held(numerics)
    case["links"]["hold"] = sized(
        "pilot-check",
        **{
            "from": "line",
            "to": "load",
            "pilot": "pilot",
            "pilot_ratio": 3.0,
            "cracking_pressure": CRACKING,
            **more,
        },
    )
    return case


def test_a_pilot_check_valve_is_that_of_scipy():
    result = fvsolve.run(locked())

    def rates(t, y, mode):
        load, line, pilot = y
        q = through(line - load) if mode == "open" else 0.0
        line, pilot = signals(t, line, pilot)
        return [STIFF * q, STIFF * (line - q), STIFF * pilot]

    pilot = lambda s, z: RATIO * (z[2] - z[1]) - (z[0] - z[1] + CRACKING)  # noqa: E731
    modes = {
        "shut": [("open", lambda s, z: max(z[1] - z[0] - CRACKING, pilot(s, z)))],
        "open": [("shut", lambda s, z: -max((z[1] - z[0]) / 1e5, pilot(s, z) / 1e5))],
    }
    exact, switches = pieces(rates, modes, "shut", START, KINKS, result.t)
    assert result.ok and [mode for _, mode in switches] == ["open", "shut", "open", "shut"]
    for name, values in zip(("load", "line", "pilot"), exact, strict=True):
        assert result[f"{name}.pressure"] == pytest.approx(values, abs=1e-9 * 2e7)
    events = [event for event in result.summary["events"] if event["time"] > 0.0]
    assert [event["what"] for event in events] == ["opens", "shuts", "opens", "shuts"]
    assert [event["time"] for event in events] == pytest.approx(
        [time for time, _ in switches], abs=1e-9 * 2.0
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_pilot_check_valve_holds_a_load_and_releases_it(method):
    result = fvsolve.run(locked({"method": method, "rtol": 1e-8}))
    load, held_now = result["load.pressure"], (result.t > 0.55) & (result.t < 1.0)
    assert np.ptp(load[held_now]) == 0.0 and load[held_now][0] > 8e6
    assert load[-1] < 7e6 and len(result.summary["events"]) <= 5


def test_a_pilot_check_valve_without_a_pilot_is_a_check_valve():
    """With the pilot at the pressure of `to`, nothing opens it against its flow: both valves pass the same flow."""
    case = locked()
    case["nodes"]["pilot"], case["links"]["sense"] = reservoir(1e4), valve("signal", "line", 1e-12)
    twin = fvsolve.run(case)
    case["links"]["hold"] = sized(
        "check-valve", **{"from": "line", "to": "load", "cracking_pressure": CRACKING}
    )
    plain = fvsolve.run(case)
    assert twin["load.pressure"] == pytest.approx(plain["load.pressure"], abs=100.0)


# shuttle valve --------------------------------------------------------------------------------------------------

SIDES = {
    "a": {"time": [0.0, 0.5, 1.0, 2.0], "value": [5e6, 5e6, 1e6, 9e6]},
    "b": {"time": [0.0, 0.4, 1.2, 2.0], "value": [1e6, 3e6, 3e6, 2e6]},
}


def shuttle(numerics=TIGHT, **more):
    nodes = {
        "a": reservoir(SIDES["a"]),
        "b": reservoir(SIDES["b"]),
        "signal": chamber(VOLUME, 3e6),
        "drain": reservoir(DRAIN),
    }
    links = {
        "select": sized("shuttle", ports={"A": "a", "B": "b", "out": "signal"}, **more),
        "bleed": valve("signal", "drain", 1e-7),
    }
    probes = [f"{place}.pressure" for place in ("a", "b", "signal")]
    probes += [f"select.{one}" for one in ("flow_A", "flow_B", "flow_out", "position")]
    return scene(nodes, links, 2.0, numerics, probes, 0.02, fluid=OIL)


def test_a_shuttle_valve_is_that_of_scipy():
    result = fvsolve.run(shuttle())

    a, b = (follows(table) for table in SIDES.values())

    def rates(t, y, mode):
        higher = (a if mode == "A" else b)(t)
        return [STIFF * (through(higher - y[0]) - through(y[0] - DRAIN, 1e-7))]

    modes = {"A": [("B", lambda s, z: b(s) - a(s))], "B": [("A", lambda s, z: a(s) - b(s))]}
    kinks = sorted({*SIDES["a"]["time"], *SIDES["b"]["time"]} - {0.0})
    exact, switches = pieces(rates, modes, "A", [3e6], kinks, result.t)
    assert result.ok and [mode for _, mode in switches] == ["B", "A"]
    assert result["signal.pressure"] == pytest.approx(exact[0], abs=1e-9 * 1e7)
    events = result.summary["events"]
    assert [event["what"] for event in events] == ["switches to B", "switches to A"]
    assert [event["time"] for event in events] == pytest.approx(
        [time for time, _ in switches], abs=1e-9 * 2.0
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_shuttle_valve_joins_out_with_the_higher_side(law):
    case = shuttle({"rtol": 1e-9})
    case["fluid"]["law"] = law
    result = fvsolve.run(case)
    high = result["a.pressure"] > result["b.pressure"]
    assert np.array_equal(result["select.position"][1:], np.where(high, 0.0, 1.0)[1:])
    assert not result["select.flow_B"][high].any() and not result["select.flow_A"][~high].any()
    total = result["select.flow_A"] + result["select.flow_B"] + result["select.flow_out"]
    assert total == pytest.approx(0.0, abs=1e-18)
    lower = np.minimum(result["a.pressure"], result["b.pressure"])
    assert np.mean(result["signal.pressure"] > lower) > 0.8
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_a_shuttle_valve_drawn_with_exchanged_sides_is_the_same_valve():
    case = shuttle()
    first = fvsolve.run(case)
    case["links"]["select"]["ports"] = {"A": "b", "B": "a", "out": "signal"}
    second = fvsolve.run(case)
    assert first["signal.pressure"] == pytest.approx(second["signal.pressure"], abs=1e-9 * 1e7)
    assert first["select.flow_A"] == pytest.approx(second["select.flow_B"], abs=1e-12)


# pressure compensator -------------------------------------------------------------------------------------------

SPOOLS = {
    "lag": {"time_constant": 0.005},
    "swing": {"natural_frequency": 60.0, "damping_ratio": 1.0},
}
DROP = 1e6  # set drop [Pa]; the valve shuts over 5 % of it
LOAD = {"time": [0.0, 0.3, 1.0, 1.5, 1.8, 2.0], "value": [2e6, 2e6, 6e6, 6e6, 1.4e7, 1.2e7]}


def compensated(numerics=TIGHT, **more):
    """Case of a compensator before a metering orifice, whose load pressure triples and rises further."""
    nodes = {
        "pump": reservoir(2e7),
        "in": chamber(VOLUME, 2e7),
        "mid": chamber(VOLUME, 3e6),
        "load": chamber(VOLUME, 2e6),
        "far": reservoir(LOAD),
        "drain": reservoir(DRAIN),
    }
    links = {
        "pipe": valve("pump", "in", 4e-6),
        "spill": valve("in", "drain", 1e-6),
        "meter": valve("mid", "load", 1e-6),
        "out": valve("load", "far", 4e-6),
        "hold": sized(
            "pressure-compensator",
            2e-6,
            **{"from": "in", "to": "mid", "senses": ["mid", "load"], "set_drop": DROP, **more},
        ),
    }
    probes = [
        "in.pressure",
        "mid.pressure",
        "load.pressure",
        "hold.flow",
        "hold.opening",
        "meter.flow",
    ]
    return scene(nodes, links, 2.0, numerics, probes, 0.02, fluid=OIL)


def share(mid, load):
    return 1.0 - (mid - load - DROP) / (0.05 * DROP)


def compensated_rates(t, inlet, mid, load, x):
    q = min(max(x, 0.0), 1.0) * through(inlet - mid, 2e-6)
    meter = through(mid - load, 1e-6)
    supply = through(2e7 - inlet, 4e-6) - through(inlet - DRAIN, 1e-6)
    leaves = through(load - follows(LOAD)(t), 4e-6)
    return STIFF * (supply - q), STIFF * (q - meter), STIFF * (meter - leaves)


KINKS_OF_LOAD = LOAD["time"][1:]


def test_a_compensator_is_that_of_scipy():
    result = fvsolve.run(compensated())
    lift = lambda s, z: share(z[1], z[2])  # noqa: E731
    modes = {
        "shut": [("lifted", lift)],
        "open": [("lifted", lambda s, z: 1.0 - lift(s, z))],
        "lifted": [("shut", lambda s, z: -lift(s, z)), ("open", lambda s, z: lift(s, z) - 1.0)],
    }
    exact, switches = pieces(
        lambda t, z, mode: compensated_rates(
            t, *z, {"shut": 0.0, "open": 1.0}.get(mode, share(z[1], z[2]))
        ),
        modes,
        "lifted",
        [2e7, 3e6, 2e6],
        KINKS_OF_LOAD,
        result.t,
    )
    assert result.ok
    for name, values in zip(("in", "mid", "load"), exact, strict=True):
        assert result[f"{name}.pressure"] == pytest.approx(values, abs=1e-9 * 2.4e7)
    assert len(result.summary["events"]) <= len(switches) + 2


@pytest.mark.parametrize("disc", DISCS)
def test_a_compensator_with_a_spool_is_that_of_scipy(disc):
    w, zeta = 2.0 * math.pi * 60.0, 1.0

    case = compensated(overpressure=5e5, **SPOOLS[disc])
    # away from both stops
    case["numerics"]["end"], begins = 1.4, {"in": 1.815e7, "mid": 3.5e6, "load": 2.09e6}
    for name, pressure in begins.items():
        case["nodes"][name]["initial_pressure"] = pressure
    wide_share = lambda mid, load: 1.0 - (mid - load - DROP) / 5e5  # noqa: E731

    def spooled(t, y, stopped):
        inlet, mid, load = compensated_rates(t, y[0], y[3], y[4], y[1])
        drive = wide_share(y[3], y[4]) - y[1]
        if disc == "lag":
            return [inlet, 0.0 if stopped else drive / 0.005, 0.0, mid, load]
        return [
            inlet,
            *((0.0, 0.0) if stopped else (y[2], w * w * drive - 2.0 * zeta * w * y[2])),
            mid,
            load,
        ]

    result = fvsolve.run(case)
    x = result["hold.opening"][0]
    exact, _ = lifted_valves.stopped(
        spooled,
        lambda t, y: wide_share(y[3], y[4]) - y[1],
        [begins["in"], x, 0.0, begins["mid"], begins["load"]],
        [time for time in KINKS_OF_LOAD if time < 1.4],
        result.t,
    )
    assert result.ok and len(result.summary["events"]) <= 40
    for name, values in (("in", exact[0]), ("mid", exact[3]), ("load", exact[4])):
        assert result[f"{name}.pressure"] == pytest.approx(values, abs=2e-9 * 2.4e7)


def metered(**more):
    """Case of a compensator and an orifice that a junction joins, between given pressures."""
    nodes = {
        "pump": reservoir(2e7),
        "mid": junction(),
        "load": reservoir(LOAD),
        "pot": chamber(VOLUME, 2e6),
    }
    links = {
        "meter": valve("mid", "load", 1e-6),
        "on": valve("load", "pot", 1e-6),
        "hold": sized(
            "pressure-compensator",
            2e-6,
            **{"from": "pump", "to": "mid", "senses": ["mid", "load"], "set_drop": DROP, **more},
        ),
    }
    return scene(
        nodes,
        links,
        1.4,
        {"rtol": 1e-9},
        ["mid.pressure", "hold.flow", "hold.opening"],
        0.05,
        fluid=OIL,
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_its_flow_hardly_changes_while_the_load_triples(law):
    """Before a junction it is solved with the node, here by its closed equation."""
    case = metered()
    case["fluid"]["law"] = law
    result = fvsolve.run(case)
    flow = result["hold.flow"]
    assert result.ok and np.ptp(flow) < 0.03 * flow[0]
    if law == "linear":
        for p, q in zip(np.interp(result.t, LOAD["time"], LOAD["value"]), flow, strict=True):

            def balance(mid, p=p):
                return share(mid, p) * through(2e7 - mid, 2e-6) - through(mid - p, 1e-6)

            mid = brentq(balance, p + DROP, p + 1.05 * DROP, xtol=1e-9)
            assert q == pytest.approx(through(mid - p, 1e-6), rel=1e-9)


@pytest.mark.parametrize(
    "ends", [("pump", "mid"), ("mid", "pump")], ids=["drawn forward", "drawn the other way"]
)
@pytest.mark.parametrize("spool", [{}, *SPOOLS.values()], ids=["at once", *SPOOLS])
@pytest.mark.parametrize("set_drop", [8e5, 4e6])
def test_its_steady_start_follows_its_closed_form(ends, spool, set_drop):
    """Two metering orifices with the drop d each; the valve passes x A(2 d) and is fully open under 40 bar."""
    nodes = {
        "pump": reservoir(6e6),
        "drain": reservoir(DRAIN),
        "mid": chamber(VOLUME),
        "load": chamber(VOLUME),
    }
    links = {
        "meter": valve("mid", "load", 2e-6),
        "out": valve("load", "drain", 2e-6),
        "hold": sized(
            "pressure-compensator",
            8e-6,
            **dict(zip(("from", "to"), ends, strict=True)),
            senses=["mid", "load"],
            set_drop=set_drop,
            **spool,
        ),
    }
    result = fvsolve.run(
        scene(
            nodes,
            links,
            0.1,
            {"rtol": 1e-9},
            ["mid.pressure", "load.pressure", "hold.opening"],
            0.05,
            fluid=OIL,
        )
    )
    opening = lambda d: min(max(1.0 - (d - set_drop) / (0.05 * set_drop), 0.0), 1.0)  # noqa: E731
    balance = lambda d: opening(d) * through(6e6 - DRAIN - 2.0 * d, 8e-6) - through(d, 2e-6)  # noqa: E731
    drop = brentq(balance, 1e3, 2.95e6, xtol=1e-9)
    assert result.ok and (opening(drop) == 1.0) == (set_drop == 4e6)
    assert result["mid.pressure"] == pytest.approx(DRAIN + 2.0 * drop, rel=1e-9)
    assert result["load.pressure"] == pytest.approx(DRAIN + drop, rel=1e-9)
    assert result["hold.opening"] == pytest.approx(opening(drop), abs=1e-8)


# all of them ----------------------------------------------------------------------------------------------------

SCENES = {
    "counterbalance": (held, {}),
    "counterbalance lag": (held, DISCS["lag"]),
    "counterbalance swing": (held, DISCS["swing"]),
    "pilot-check": (locked, {}),
    "shuttle": (shuttle, {}),
    "compensator": (compensated, {}),
    "compensator lag": (compensated, {"overpressure": 5e5, **SPOOLS["lag"]}),
}


@pytest.mark.parametrize("name", SCENES)
def test_it_dissipates_only_and_the_ledgers_close(name):
    make, more = SCENES[name]
    found = energy(make({"rtol": 1e-10}, **more))
    assert found.relative < 1e-7
    for row, values in found.dissipated.items():
        if row.split()[0].partition(".")[0] in ("hold", "select"):
            assert np.all(np.diff(values) >= -1e-9 * max(values[-1], 1.0))


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS[1:])
@pytest.mark.parametrize("name", SCENES)
def test_methods_agree(name, method):
    make, more = SCENES[name]
    first, other = (
        fvsolve.run(make({"method": one, "rtol": 1e-9}, **more)) for one in (METHODS[0], method)
    )
    assert other.ok and len(other.summary["events"]) == len(first.summary["events"])
    for probe in first.probes:
        if probe.endswith("pressure"):
            assert other[probe] == pytest.approx(first[probe], abs=2e-6 * 2.4e7)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("name", SCENES)
def test_the_pattern_of_the_jacobian_is_complete(name, law):
    make, more = SCENES[name]
    case, rng = make(**more), np.random.default_rng(1)
    case["fluid"]["law"] = law
    model = fvsolve.build(fvsolve.load(case))
    assert (
        max(
            stray(model, t, model.scale * rng.normal(scale=0.1, size=model.y_size))
            for t in (0.0, 1.0)
        )
        < 1e-7
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p"])
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("name", SCENES)
def test_at_rest_it_does_not_move_by_a_bit(name, law, method):
    make, more = SCENES[name]
    case = make({"method": method, "rtol": 1e-8}, **more)
    case["numerics"]["end"] *= 0.1 if method == "dormand-prince" else 1.0  # it takes the most steps
    case["fluid"]["law"] = law
    for node in case["nodes"].values():
        node.update({"pressure": 2e6} if node["type"] == "reservoir" else {"initial_pressure": 2e6})
    result = fvsolve.run(case)
    assert result.ok and all(np.ptp(result[probe]) == 0.0 for probe in result.probes)


def test_a_killed_and_resumed_run_is_the_unbroken_run(tmp_path):
    fvsolve.run(
        held({"method": "dormand-prince", "rtol": 1e-9}, **DISCS["lag"]),
        out=tmp_path / "whole",
        pictures=False,
    )
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 0.5))


def test_a_pilot_at_a_junction_of_a_pipe_opens_it():
    """A junction that the flow of the valve does not reach is solved with the valve; its pressure is the pilot's."""
    for law in ("linear", "log"):
        case = held({"method": "rk4", "courant": 0.5})
        case["nodes"]["pilot"], case["fluid"]["law"] = junction(), law
        case["nodes"]["end"] = chamber(VOLUME, 1e6)
        friction = {"model": "quasi-steady", "roughness": 0.0}
        case["links"]["sense"] = pipe("signal", "pilot", 5.0, 0.01, 1200.0, 4, friction=friction)
        case["links"]["leak"] = valve("pilot", "end", 1e-8)
        result = fvsolve.run(case)
        lift = np.clip(
            [
                lifting(*p)
                for p in zip(result["load.pressure"], result["pilot.pressure"], strict=True)
            ],
            0,
            1,
        )
        forward = result["load.pressure"] > result["line.pressure"]
        assert result.ok and np.max(lift[forward]) > 0.1
        assert result["hold.opening"][forward] == pytest.approx(lift[forward], abs=1e-9)


def junction_pilot(**more):
    case = held(**more)
    case["nodes"] |= {"line": junction(), "pilot": junction()}
    case["links"] |= {"sense": valve("line", "pilot", 1e-6), "down": valve("pilot", "signal", 1e-6)}
    return case


def test_a_junction_that_its_flow_reaches_needs_a_time_constant():
    with pytest.raises(
        fvsolve.CaseError, match="senses pilot, a junction .* give the valve a time_constant"
    ):
        fvsolve.build(fvsolve.load(junction_pilot()))
    assert fvsolve.run(junction_pilot(**DISCS["lag"])).ok


@pytest.mark.parametrize(
    "make, change, place, text",
    [
        (held, {"pilot_ratio": 0.0}, "links.hold.pilot_ratio", "expected a value above 0"),
        (held, {"pilot_ratio": -2.0}, "links.hold.pilot_ratio", "expected a value above 0"),
        (held, {"pilot": "lod"}, "links.hold.pilot", 'no place named "lod".*did you mean "load"'),
        (held, {"pilot": "feed"}, "links.hold.pilot", "is a link"),
        (held, {"overpressure": 0.0}, "links.hold.overpressure", "expected a value above 0"),
        (locked, {"pilot_ratio": 0.0}, "links.hold.pilot_ratio", "expected a value above 0"),
        (locked, {"cracking_pressure": -1.0}, "links.hold.cracking_pressure", "expected"),
        (compensated, {"senses": ["mid", "lod"]}, "links.hold.senses", 'no place named "lod"'),
        (compensated, {"senses": ["mid"]}, "links.hold.senses", "expected .place before, place behind."),
        (compensated, {"senses": ["mid", "mid"]}, "links.hold.senses", "expected two places"),
        (compensated, {"set_drop": 0.0}, "links.hold.set_drop", "expected a value above 0"),
        (shuttle, {"ports": {"A": "a", "B": "a", "out": "signal"}}, "links.select.ports", "to itself"),
        (shuttle, {"ports": {"A": "a", "B": "b"}}, "links.select.ports", "out is missing"),
    ],
)  # fmt: skip
def test_bad_keys_are_refused(make, change, place, text):
    case = make()
    case["links"]["select" if make is shuttle else "hold"].update(change)
    error = refused(case, text)
    assert any(fault.place.startswith(place) for fault in error.faults)


def test_a_pilot_of_another_domain_is_refused():
    case = held(pilot="block")
    case["nodes"]["block"] = {"type": "mass", "mass": 1.0}
    case["nodes"]["wall"] = {"type": "frame"}
    case["links"]["hang"] = {"type": "spring", "from": "wall", "to": "block", "stiffness": 10.0}
    refused(case, "needs a hydraulic place")


# circuits of docs/fluid-power.md ----------------------------------------------------------------------------------

PAGE = section("fluid-power", "Circuits")
SECTIONS = (section.partition("\n") for section in re.split(r"^##+ ", PAGE, flags=re.MULTILINE)[1:])
CIRCUITS = {
    title: text.split("```")[1].removeprefix("toml")
    for title, _, text in SECTIONS
    if "```toml" in text
}


def circuit(heading):
    """Results of the case of a section of the page."""
    case = tomllib.loads(CIRCUITS[heading])
    if heading == "Pilot check valve":
        case = tomllib.loads(CIRCUITS["Counterbalance valve"]) | {"output": {}}
        for group, parts in tomllib.loads(CIRCUITS[heading]).items():
            case[group] |= parts
    result = fvsolve.run(case)
    assert result.ok
    return result


@pytest.mark.parametrize("heading", ["Counterbalance valve", "Pilot check valve"])
def test_the_page_holds_and_lowers_a_load(heading):
    result = circuit(heading)
    load = result["load.pressure"]
    held_now = load[(result.t > 0.75) & (result.t < 0.98)]
    assert held_now[0] > 100e5 and np.ptp(held_now) < 1e-6 * held_now[0] and load[-1] < 90e5


def test_the_page_selects_the_higher_pressure():
    result = circuit("Shuttle valve")
    higher = np.maximum(
        np.interp(result.t, [0, 1], [100e5, 20e5]), np.interp(result.t, [0, 1], [10e5, 80e5])
    )
    assert result["signal.pressure"] == pytest.approx(higher, rel=0.02)
    assert (result["select.position"][0], result["select.position"][-1]) == (0.0, 1.0)


def test_flow_of_the_page_stays_while_the_load_triples():
    flow = circuit("Pressure compensator and two-way flow control")["meter.flow"]
    assert np.ptp(flow) < 0.03 * flow[0]


def test_the_page_has_a_sequence_valve():
    result = circuit("Sequence valve")
    first, second = result["first.pressure"], result["second.pressure"]
    assert (
        np.ptp(second[first < 80e5][: np.argmax(first >= 80e5)]) < 1.0
        and second.max() > 100e5
        and second[-1] < 20e5
    )


def test_the_page_has_a_filter_with_bypass():
    result = circuit("Filter with bypass")
    assert result["bypass.flow"][0] == 0.0 and result["bypass.flow"][-1] > 0.5 * 20e-3 / 60.0
    assert result["inlet.pressure"].max() < AMBIENT + 4e5


def test_the_page_has_a_priority_valve():
    result = circuit("Three-way flow control and priority valve")
    flow = result["priority.flow"]
    assert flow[-1] == pytest.approx(flow[0], rel=0.2) and result["bypass.flow"].min() > 0.0


def test_the_page_has_a_brake_valve():
    result = circuit("Brake valve")
    assert result["brake.flow"][0] > 0.9 * 10e-3 / 60.0 and result["return.pressure"][0] < 40e5
    assert result["brake.flow"][-1] == 0.0 and 160e5 < result["return.pressure"].max() < 185e5


@pytest.mark.parametrize(
    "disc", [{}, {"time_constant": 0.01}, {"natural_frequency": 20.0, "damping_ratio": 0.7}]
)
@pytest.mark.parametrize("method", [
    {"method": "ssp-rk3", "courant": 0.5},
    {"method": "euler", "courant": 0.2},
    {"method": "tr-bdf2", "rtol": 1e-6},
    {"method": "dormand-prince", "rtol": 1e-6},
])  # fmt: skip
def test_a_counterbalance_valve_with_reversing_flow_at_half_lift_changes_its_mode_once_each_time(
    disc, method
):
    """At a drop of zero the flow changes with the last digits of the pressures, and so does its sign in each mode."""
    heads = {"time": [0.0, 0.3, 0.5, 0.8], "value": [30.0, 30.0, 12.0, 35.0]}
    nodes = {"up": lake(heads), "down": lake(20.0), "a": junction(), "b": junction()}
    friction = {"model": "steady", "factor": 0.02}
    links = {
        "in": pipe("up", "a", 60.0, 0.1, 1000.0, 4, friction=friction),
        "out": pipe("down", "b", 60.0, 0.1, 1000.0, 4, friction=friction),
        "hold": {
            "type": "counterbalance",
            "from": "a",
            "to": "b",
            "area": 1e-4,
            "set_pressure": 3e5,
            "overpressure": 2e4,
            "pilot": "up",
            "pilot_ratio": 0.5,
            **disc,
        },
    }
    case = scene(
        nodes,
        links,
        1.0,
        {"scheme": "muscl", **method},
        ["links.hold.flow", "links.hold.opening"],
        1e-3,
    )
    result = fvsolve.run(case | {"ambient_pressure": AMBIENT})
    assert result.reason.startswith("finished")
    assert result["links.hold.flow"].min() < -1e-4
    assert result["links.hold.flow"][-1] > 5e-4
    assert len(result.summary["events"]) <= 8
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
