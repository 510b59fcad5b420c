"""Displacement pumps and motors against data sheets, closed forms, SciPy and restatements."""

from math import copysign, pi, sqrt

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebfit, chebval
from reference.folders import CASES
from reference.resumed_runs import killed_and_resumed, same_files
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise

EXACT = 1e-9
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]
RHO, BETA, P0 = 870.0, 1.2e9, 101325.0
CC = 1e-6 / (2.0 * pi)  # cm3 per revolution [m3/rad]
FLUID = {"name": "user", "density": RHO, "bulk_modulus": BETA, "viscosity": "40 mPa s"}
TANK = {"tank": {"type": "reservoir", "pressure": P0}}


def scene(nodes, links, end, probes, **more):
    numerics = {"end": end, "rtol": 1e-11, **more.pop("numerics", {})}
    fluid = FLUID | more.pop("fluid", {})
    return {
        "schema": 1,
        "fluid": fluid,
        "nodes": TANK | nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": end / 20, "probes": probes},
        **more,
    }


def runs(case, method="dormand-prince", **set):
    run = fvsolve.run(case, {"numerics.method": method} | set)
    assert run.ok, run.reason
    return run


def ramp(start, duration, first, last):
    return {"start": start, "duration": duration, "value": [first, last]}


def machine(kind, start, stop, **keys):
    return {"type": f"displacement-{kind}", "from": start, "to": stop, **keys}


# data sheets --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["pump", "motor"])
def test_efficiencies_return_flow_and_torque_of_the_rated_point(kind):
    d, dp, w = 28.0 * CC, 200e5, 1500.0 * pi / 30.0
    ends = ("tank", "high") if kind == "pump" else ("high", "tank")
    given = {
        "displacement": "28 cc/rev",
        "speed": "1500 rpm",
        "volumetric_efficiency": 0.95,
        "mechanical_efficiency": 0.92,
        "rated_pressure": "200 bar",
        "rated_speed": "1500 rpm",
    }
    case = scene(
        {"high": {"type": "reservoir", "pressure": P0 + dp}},
        {"m": machine(kind, *ends, **given)},
        1.0,
        ["m.flow", "m.torque"],
    )
    run = runs(case)
    flow, torque = (
        (d * w * 0.95, d * dp / 0.92) if kind == "pump" else (d * w / 0.95, d * dp * 0.92)
    )
    assert run["m.flow"][-1] == pytest.approx(flow, rel=1e-12)
    assert run["m.torque"][-1] == pytest.approx(torque, rel=1e-12)


def test_torque_losses_are_half_viscous_and_half_dry():
    case = scene(
        {"high": {"type": "reservoir", "pressure": "200 bar"}},
        {
            "m": machine(
                "pump",
                "tank",
                "high",
                displacement="28 cc/rev",
                mechanical_efficiency=0.9,
                rated_pressure="200 bar",
                rated_speed="100 rad/s",
                speed="50 rad/s",
            )
        },
        1.0,
        ["m.torque"],
    )
    ideal, loss = 28.0 * CC * (200e5 - P0), 28.0 * CC * 200e5 * (1.0 / 0.9 - 1.0)
    assert runs(case)["m.torque"][-1] == pytest.approx(ideal + 0.75 * loss, rel=1e-12)


# hydrostatic drive --------------------------------------------------------------------------------------------------

V, J, B, T = 1e-3, 0.5, 0.52, 2.0
D1, D2, L1, L2, W1 = 28.0 * CC, 60.0 * CC, 0.01 / 6e9, 0.02 / 6e9, 1500.0 * pi / 30.0


def drive(**changes):
    """Pump at constant speed, chamber, and a motor with dry friction on a shaft with a viscous load."""
    nodes = {
        "high": {"type": "chamber", "volume": "1 l", "initial_pressure": P0},
        "drum": {"type": "shaft", "inertia": J, "initial_speed": 0.0},
        "frame": {"type": "housing"},
    }
    links = {
        "pump": machine(
            "pump",
            "tank",
            "high",
            speed="1500 rpm",
            displacement="28 cc/rev",
            leakage="0.01 l/min/bar",
            setting=ramp(0.1, 0.5, 0.0, 1.0),
        ),
        "motor": machine(
            "motor",
            "high",
            "tank",
            ports={"shaft": "drum"},
            displacement="60 cc/rev",
            leakage=L2,
            viscous_friction=0.02,
            friction_torque=T,
        ),
        "load": {"type": "bearing", "from": "drum", "to": "frame", "damping": 0.5},
    }
    probes = [
        "high.pressure",
        "drum.speed",
        "motor.torque",
        "motor.flow",
        "pump.flow",
        "pump.torque",
    ]
    return scene(
        nodes | changes.pop("nodes", {}), links | changes.pop("links", {}), 2.0, probes, **changes
    )


def drive_by_scipy():
    """(time at which the motor tears off, pressure, speed at 2 s) by SciPy."""

    def rhs(t, y, slips):
        dp, w, x = y[0] - P0, y[1], min(max((t - 0.1) / 0.5, 0.0), 1.0)
        flow = x * D1 * W1 - L1 * dp - D2 * w - L2 * dp
        return [BETA / V * flow, (D2 * dp - B * w - T) / J if slips else 0.0]

    def torn(t, y, slips):
        return D2 * (y[0] - P0) - T

    torn.terminal, torn.direction = True, 1.0
    tolerance = {"method": "Radau", "rtol": 1e-12, "atol": [1e-4, 1e-11]}
    held = solve_ivp(rhs, (0.1, 0.6), [P0, 0.0], args=(False,), events=torn, **tolerance)
    ramped = solve_ivp(rhs, (held.t[-1], 0.6), held.y[:, -1], args=(True,), **tolerance)
    return held.t[-1], solve_ivp(rhs, (0.6, 2.0), ramped.y[:, -1], args=(True,), **tolerance).y[
        :, -1
    ]


@pytest.mark.parametrize("method", METHODS)
def test_a_hydrostatic_drive_is_that_of_scipy(method):
    torn, (pressure, speed) = drive_by_scipy()
    run = runs(drive(), method)
    assert [(e["name"], e["what"]) for e in run.summary["events"]] == [("motor", "slips forward")]
    assert run.summary["events"][0]["time"] == pytest.approx(torn, abs=2.0 * EXACT)
    assert run["high.pressure"][-1] == pytest.approx(pressure, rel=EXACT)
    assert run["drum.speed"][-1] == pytest.approx(speed, rel=EXACT)
    assert run["motor.torque"][-1] == pytest.approx(
        D2 * (pressure - P0) - 0.02 * speed - T, rel=EXACT
    )
    assert set(run["drum.speed"][: int(torn / 0.1)]) == {0.0}


def test_energy_of_a_drive_closes_and_is_only_lost():
    for case in (
        drive(),
        drive(fluid={"law": "log"}),
        drive(nodes={"drum": {"type": "shaft", "inertia": J, "initial_speed": "40 rad/s"}}),
        load_sensing(),
    ):
        balance = energy(case)
        assert abs(balance.remainder[-1]) < 1e-9 * balance.throughput
        lost = [line[-1] for line in balance.dissipated.values()]
        assert len(lost) >= 2 and min(lost) >= -1e-9 * balance.throughput


def restatements():
    """Name -> case that has the pressure and speed of `drive`."""
    case = drive()
    pump, motor = case["links"]["pump"], case["links"]["motor"]
    yield "order", case | {"links": dict(reversed(case["links"].items()))}
    turned = pump | {"from": "high", "to": "tank", "setting": ramp(0.1, 0.5, 0.0, -1.0)}
    yield "pump drawn the other way", drive(links={"pump": turned})
    yield "pump as motor", drive(links={"pump": pump | {"type": "displacement-motor"}})
    halves = {
        "pump": pump | {"displacement": "14 cc/rev"},
        "second": pump | {"displacement": 14.0 * CC, "leakage": 0.0},
    }
    yield "pump in two halves", drive(links=halves)
    housing = {"type": "housing", "speed": "25 rad/s"}
    gear = {"type": "gear", "from": "prime", "to": "pinion", "ratio": 25.0 / W1}
    geared = {k: v for k, v in pump.items() if k != "speed"} | {"ports": {"shaft": "pinion"}}
    yield (
        "pump on the gear of a housing",
        drive(
            nodes={"prime": housing, "pinion": {"type": "shaft"}},
            links={"gear": gear, "pump": geared},
        ),
    )
    two = {
        "drum": {"type": "shaft", "inertia": "3000 kg cm2", "initial_speed": 0.0},
        "other": {"type": "shaft", "inertia": 0.2},
    }
    yield (
        "shaft in two halves",
        drive(
            nodes=two, links={"join": {"type": "gear", "from": "other", "to": "drum", "ratio": 1.0}}
        ),
    )
    outside = {k: v for k, v in motor.items() if k not in ("viscous_friction", "friction_torque")}
    bearing = {
        "type": "bearing",
        "from": "drum",
        "to": "frame",
        "damping": 0.52,
        "friction_torque": T,
    }
    yield "losses as a bearing", drive(links={"motor": outside, "load": bearing})
    formula = {"setting": "min(max((t - 0.1)/0.5, 0), 1)"}
    yield "setting as a formula", drive(links={"pump": pump | formula})
    block = {
        "x": {
            "type": "function",
            "inputs": {"p": "high.pressure"},
            "unit": "-",
            "formula": "min(max((t - 0.1)/0.5, 0), 1) + 0*p",
            "limits": [0.0, 1.0],
        }
    }
    yield (
        "setting by a control",
        drive(links={"pump": pump | {"setting": {"control": "x"}}}, controls=block),
    )
    speed = {
        "w": {
            "type": "function",
            "inputs": {"p": "high.pressure"},
            "unit": "rad/s",
            "limits": [0.0, 200.0],
            "formula": f"{W1!r}*min(max((t - 0.1)/0.5, 0), 1) + 0*p",
        }
    }
    by_speed = {k: v for k, v in pump.items() if k != "setting"} | {"speed": {"control": "w"}}
    yield "speed by a control", drive(links={"pump": by_speed}, controls=speed)
    by_housing = {k: v for k, v in by_speed.items() if k != "speed"} | {"ports": {"shaft": "prime"}}
    prime = {"prime": {"type": "housing", "speed": {"control": "w"}}}
    yield "housing by a control", drive(nodes=prime, links={"pump": by_housing}, controls=speed)


@pytest.mark.parametrize(
    "name, case", list(restatements()), ids=[name for name, _ in restatements()]
)
def test_restated_drives_have_the_same_end(name, case):
    reference = runs(drive())
    for method in ("dormand-prince", "rodas-5p"):
        run = runs(case, method)
        for probe in ("high.pressure", "drum.speed"):
            assert run[probe][-1] == pytest.approx(reference[probe][-1], rel=1e-9), method


@pytest.mark.parametrize(
    "fluid", [{"law": "log"}, {"law": "mixture", "air_fraction": 1e-6, "vapor_pressure": 100.0}]
)
def test_other_density_laws_change_a_drive_by_the_compressibility_alone(fluid):
    reference, ends = runs(drive()), []
    for method in ("dormand-prince", "radau-iia-5", "rodas-5p"):
        run = runs(drive(fluid=fluid), method, **{"numerics.rtol": 1e-9})
        assert run["drum.speed"][-1] == pytest.approx(reference["drum.speed"][-1], rel=0.02)
        ends.append(run["drum.speed"][-1])
    assert np.ptp(ends) < 1e-7 * ends[0]


@pytest.mark.parametrize("method", METHODS)
def test_a_controller_drives_a_setting_that_lags(method):
    """0.02 s dx/dt = u - x, with the PI output u of the pressure p0 + rho / 2 (x D w / A)^2 before an orifice."""
    flow, area, gain = 20.0 * CC * W1, 0.61 * pi * 0.003**2 / 4.0, 1e-8
    size = {"type": "orifice", "from": "high", "to": "tank", "diameter": "3 mm"}
    pump = machine(
        "pump",
        "tank",
        "high",
        speed="1500 rpm",
        displacement="20 cc/rev",
        setting_time="20 ms",
        setting={"control": "k"},
    )
    block = {
        "type": "pi",
        "input": "high.pressure",
        "setpoint": ramp(0.1, 0.0, 5e6, 8e6),
        "gain": gain,
        "integral_time": "0.1 s",
        "limits": [0.0, 1.0],
    }
    case = scene(
        {"high": {"type": "junction"}},
        {"pump": pump, "orifice": size},
        0.5,
        ["high.pressure", "pump.setting"],
        controls={"k": block},
    )

    def rates(t, y):
        error = 8e6 - P0 - RHO / 2.0 * (y[0] * flow / area) ** 2
        wanted = gain * error + y[1]
        output = min(max(wanted, 0.0), 1.0)
        return [(output - y[0]) / 0.02, (gain * error + output - wanted) / 0.1]

    run, first = runs(case, method), sqrt(2.0 * (5e6 - P0) / RHO) * area / flow
    exact = solve_ivp(
        rates, (0.1, 0.5), [first, first], "DOP853", dense_output=True, rtol=1e-12, atol=1e-13
    ).sol
    assert run["pump.setting"] == pytest.approx(exact(np.maximum(run.t, 0.1))[0], abs=1e-8)


@pytest.mark.parametrize("turns", [0.0, 1.0, -1.0])
def test_swept_flow_has_the_density_of_the_inlet_and_leakage_that_upstream(turns):
    """Two chambers under the law `log`, rho = RHO exp((p - P0) / BETA), beside SciPy."""
    q, leak, high, low = 20e-6 * turns, 0.5e-3 / 60.0 / 1e5, 300e5, 10e5
    nodes = {
        "low": {"type": "chamber", "volume": "2 l", "initial_pressure": low},
        "high": {"type": "chamber", "volume": "1 l", "initial_pressure": high},
    }
    pump = machine(
        "pump", "low", "high", speed=f"{60.0 * turns} rpm", displacement="20 cc/rev", leakage=leak
    )
    case = scene(nodes, {"pump": pump}, 0.02, ["high.pressure", "pump.flow"], fluid={"law": "log"})
    del case["nodes"]["tank"]
    run = runs(case)
    density = lambda p: RHO * np.exp((p - P0) / BETA)  # noqa: E731
    mass_flow = lambda a, b: density(a if q >= 0.0 else b) * q - density(b) * leak * (b - a)  # noqa: E731

    def rates(t, p):
        m = mass_flow(*p)
        return [-m * BETA / 2e-3 / density(p[0]), m * BETA / 1e-3 / density(p[1])]

    exact = solve_ivp(
        rates, (0.0, 0.02), [low, high], "DOP853", run.t.clip(0.0, 0.02), rtol=1e-12, atol=1e-3
    )
    assert run["high.pressure"] == pytest.approx(exact.y[1], rel=EXACT)
    assert run["pump.flow"][0] == pytest.approx(mass_flow(low, high) / density(high), rel=1e-12)


# start --------------------------------------------------------------------------------------------------------------


def test_a_drive_without_initial_speed_starts_in_equilibrium():
    """0.7 D1 w1 - L1 dp = D2 w + L2 dp and D2 dp = B w + T."""
    pump = drive()["links"]["pump"] | {"setting": 0.7}
    nodes = {"drum": {"type": "shaft", "inertia": J}, "high": {"type": "chamber", "volume": "1 l"}}
    w = (0.7 * D1 * W1 * D2 / (L1 + L2) - T) / (D2 * D2 / (L1 + L2) + B)
    assert w > 40.0
    for method in METHODS:
        for law in ("linear", "log"):
            run = runs(drive(nodes=nodes, links={"pump": pump}, fluid={"law": law}), method)
            assert run["drum.speed"][0] == pytest.approx(w, rel=1e-9 if law == "linear" else 2e-2)
            for probe in ("drum.speed", "high.pressure", "motor.flow"):
                assert len(set(run[probe])) == 1, (method, law, probe)


def test_a_drive_that_its_friction_holds_stands():
    pump = drive()["links"]["pump"] | {"setting": 1e-6}
    nodes = {"drum": {"type": "shaft", "inertia": J}, "high": {"type": "chamber", "volume": "1 l"}}
    run = runs(drive(nodes=nodes, links={"pump": pump}))
    assert set(run["drum.speed"]) == {0.0}
    assert run["high.pressure"][0] == pytest.approx(P0 + 1e-6 * D1 * W1 / (L1 + L2), rel=1e-9)


def test_the_linear_system_of_a_drive_is_that_of_its_equations():
    pump = drive()["links"]["pump"] | {"setting": 0.7}
    nodes = {"drum": {"type": "shaft", "inertia": J}, "high": {"type": "chamber", "volume": "1 l"}}
    found = linearise(drive(nodes=nodes, links={"pump": pump}), ["pump.setting"], ["drum.speed"])
    stiff = BETA / V
    a = np.array([[-stiff * (L1 + L2), -stiff * D2], [D2 / J, -B / J]])
    transfer = np.array([0.0, 1.0]) @ np.linalg.solve(-a, np.array([stiff * D1 * W1, 0.0]))
    gain = found.c @ np.linalg.solve(-found.a, found.b) + found.d
    assert gain.item() == pytest.approx(transfer, rel=1e-6)
    assert np.sort_complex(np.linalg.eigvals(found.a)) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(a)), rel=1e-6
    )


# compensators -------------------------------------------------------------------------------------------------------

D, LEAK, LAG, RANGE = 45.0 * CC, 0.01 / 6e9, 0.05, 5e5
AREA, WORK = 0.61 * pi / 4.0 * 6e-3**2, 0.61 * pi / 4.0 * 4e-3**2
LS_OPENINGS = [0.3, 0.3, 0.8, 0.8, 0.3], [0.5, 0.5, 0.05]
LS_TIMES = [0.0, 0.1, 0.2, 0.6, 0.7], [0.0, 0.8, 0.9]


def load_sensing(compensator=None, **more):
    """Pump whose compensator keeps the drop over a metering valve, with a load pressure that rises to its limit."""
    nodes = {
        "high": {"type": "chamber", "volume": "1 l"},
        "load": {"type": "chamber", "volume": "0.5 l"},
    }
    own = {"set_pressure": 210e5 + P0, "range": "5 bar", "senses": "load", "margin": "20 bar"}
    links = {
        "pump": machine(
            "pump",
            "tank",
            "high",
            speed="1500 rpm",
            displacement="45 cc/rev",
            leakage=LEAK,
            setting_time=LAG,
            compensator=compensator or own,
        ),
        "metering": {
            "type": "valve",
            "from": "high",
            "to": "load",
            "diameter": "6 mm",
            "opening": {"time": LS_TIMES[0], "value": LS_OPENINGS[0]},
        },
        "work": {
            "type": "valve",
            "from": "load",
            "to": "tank",
            "diameter": "4 mm",
            "opening": {"time": LS_TIMES[1], "value": LS_OPENINGS[1]},
        },
    }
    return scene(
        nodes, links, 1.4, ["high.pressure", "load.pressure", "pump.setting", "pump.flow"], **more
    )


def load_sensing_by_scipy(start, limit=True, sense=True):
    """States (pressures, setting) at the end by SciPy, piece by piece of the openings."""

    def root(x):
        return copysign(sqrt(2.0 * abs(x) / RHO), x)

    def rhs(t, y, openings, slopes):
        high, load, x = y
        metered = AREA * (openings[0] + slopes[0] * t) * root(high - load)
        drawn = WORK * (openings[1] + slopes[1] * t) * root(load - P0)
        pumped = D * W1 * x - LEAK * (high - P0)
        goal = min(210e5 + P0 if limit else 1e99, load + 20e5 if sense else 1e99)
        target = min(max((goal - high) / RANGE, 0.0), 1.0)
        return [
            BETA / V * (pumped - metered),
            BETA / (0.5 * V) * (metered - drawn),
            (target - x) / LAG,
        ]

    y, breaks = start, sorted({*LS_TIMES[0], *LS_TIMES[1], 1.4})
    for first, last in zip(breaks, breaks[1:], strict=False):
        ends = [np.interp((first, last), *pair) for pair in zip(LS_TIMES, LS_OPENINGS, strict=True)]
        slopes = [float(b - a) / (last - first) for a, b in ends]
        openings = [float(a) - slope * first for (a, _), slope in zip(ends, slopes, strict=True)]
        y = solve_ivp(
            rhs,
            (first, last),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=[1e-3, 1e-3, 1e-10],
            args=(openings, slopes),
        ).y[:, -1]
    return y


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("limit, sense", [(True, True), (True, False), (False, True)])
def test_a_compensated_pump_is_that_of_scipy(method, limit, sense):
    own = {"range": RANGE} | ({"set_pressure": "210 barg"} if limit else {})
    own |= {"senses": "load", "margin": 20e5} if sense else {}
    run = runs(load_sensing(own), method)
    probes = ("high.pressure", "load.pressure", "pump.setting")
    exact = load_sensing_by_scipy([run[probe][0] for probe in probes], limit, sense)
    assert len(run.summary["events"]) >= 4
    for probe, value in zip(probes, exact, strict=True):
        assert run[probe][-1] == pytest.approx(value, rel=20.0 * EXACT), probe


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_load_sensing_pump_starts_at_rest_with_its_margin(law):
    case = load_sensing(fluid={"law": law})
    case["links"]["metering"]["opening"], case["links"]["work"]["opening"] = 0.3, 0.5
    for method in METHODS:
        run = runs(case, method)
        for probe in case["output"]["probes"]:
            moved = np.ptp(run[probe]) / run[probe][0]
            # valves alone move by rounding there
            assert moved == 0.0 if law == "linear" else moved < 1e-12, method
        drop, setting = run["high.pressure"][0] - run["load.pressure"][0], run["pump.setting"][0]
        assert drop == pytest.approx(20e5 - setting * RANGE, rel=1e-9)
        assert 0.0 < setting < 1.0


def test_a_pump_at_its_set_pressure_starts_without_displacement():
    case = load_sensing({"set_pressure": "210 barg", "range": "5 bar"})
    case["links"]["metering"]["opening"] = 0.0
    case["links"]["pump"]["leakage"] = 0.0
    case["nodes"]["high"]["initial_pressure"] = "230 barg"
    run = runs(case)
    assert run["pump.setting"][0] == 0.0
    assert set(run["high.pressure"]) == {run["high.pressure"][0]}


def test_a_setting_with_a_lag_is_a_transfer_function_of_its_schedule():
    pump = drive()["links"]["pump"]
    lagged = runs(drive(links={"pump": pump | {"setting_time": "80 ms"}}))
    ideal = {
        "type": "function",
        "inputs": {},
        "formula": "min(max((t - 0.1)/0.5, 0), 1)",
        "unit": "-",
    }
    lag = {
        "type": "transfer-function",
        "input": "controls.u",
        "numerator": [1.0],
        "denominator": [0.08, 1.0],
    }
    block = {"x": lag, "u": ideal}
    other = runs(drive(links={"pump": pump | {"setting": {"control": "x"}}}, controls=block))
    for probe in ("high.pressure", "drum.speed"):
        assert lagged[probe][-1] == pytest.approx(other[probe][-1], rel=1e-9)


def test_a_run_with_a_compensator_resumes_to_the_bit(tmp_path):
    whole = tmp_path / "whole"
    assert fvsolve.run(load_sensing(), out=whole, pictures=False).ok
    same_files(whole, killed_and_resumed(whole, 0.65))


# bad input ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "link, keys, place, text",
    [
        ("motor", {"setting": 1.5}, "links.motor.setting", "between -1 and 1"),
        ("motor", {"displacement": 0.0}, "links.motor.displacement", "above 0"),
        ("motor", {"volumetric_efficiency": 1.1, "rated_pressure": 1e7, "rated_speed": 10.0},
         "links.motor.volumetric_efficiency", "1 at most"),
        ("motor", {"volumetric_efficiency": 0.9, "rated_pressure": 1e7, "rated_speed": 10.0}, "links.motor.leakage",
         "keep one"),
        ("motor", {"mechanical_efficiency": 0.9, "rated_pressure": 1e7, "rated_speed": 10.0},
         "links.motor.viscous_friction", "keep one"),
        ("motor", {"rated_speed": 10.0}, "links.motor.rated_speed", "no effect"),
        ("motor", {"ports": {"shaft": "frame"}}, "links.motor.ports.shaft", "housing at rest"),
        ("motor", {"ports": {"shaft": "tank"}}, "links.motor.ports.shaft", "rotational places are"),
        ("motor", {"ports": {"shaft": "axle"}}, "links.motor.ports.shaft", "axle has neither an inertia"),
        ("pump", {"ports": {"shaft": "drum"}}, "links.pump.speed", "keep one"),
        ("pump", {"compensator": {"range": "5 bar", "senses": "hihg", "margin": 1e5}},
         "links.pump.compensator.senses", 'did you mean "high"'),
        ("pump", {"compensator": {"range": "5 bar"}}, "links.pump.compensator", "set_pressure, senses"),
        ("pump", {"compensator": {"range": "5 bar", "senses": "high"}}, "links.pump.compensator.senses", "`margin`"),
        ("motor", {"compensator": {"range": "5 bar"}}, "links.motor.compensator", "unknown key"),
    ],
)  # fmt: skip
def test_faults_of_displacement_machines_are_named(link, keys, place, text):
    case = drive(
        nodes={"axle": {"type": "shaft"}},
        links={"more": {"type": "gear", "from": "axle", "to": "drum", "ratio": 2.0}}
        if "axle" not in str(keys)
        else {},
    )
    case["links"][link] = case["links"][link] | keys
    with pytest.raises(CaseError) as caught:
        fvsolve.build(fvsolve.load(case))
    assert any(fault.place == place and text in fault.message for fault in caught.value.faults), (
        str(caught.value)
    )


# shipped cases ------------------------------------------------------------------------------------------------------


class Hose:
    """Waves that arrive at the ends of the hose of the shipped drive: polynomials of what leaves the other end."""

    def __init__(self):
        modulus = 1.0 / (1.0 / BETA + 0.012 / (300e6 * 0.005))
        speed = sqrt(modulus / RHO)
        self.delay, self.impedance = 3.0 / speed, RHO * speed / (pi / 4.0 * 0.012**2)
        self.pieces = []

    def arriving(self, t):
        """Sums of pressure and impedance times flow that arrive at the first and second end."""
        t -= self.delay
        for begin, end, to_first, to_second in self.pieces:
            if t <= end or end == self.pieces[-1][1]:
                s = (2.0 * t - begin - end) / (end - begin)
                return chebval(s, to_first), chebval(s, to_second)
        return P0, P0

    def add(self, begin, end, found):
        """Add the waves that leave both ends, p + Z q = 2 p - arriving wave, from a solution of both pressures."""
        nodes = np.cos(pi * (np.arange(14) + 0.5) / 14)
        times = 0.5 * (begin + end) + 0.5 * (end - begin) * nodes
        waves, pressures = np.array([self.arriving(t) for t in times]).T, found.sol(times)[3:]
        self.pieces.append(
            (
                begin,
                end,
                chebfit(nodes, 2.0 * pressures[1] - waves[1], 13),
                chebfit(nodes, 2.0 * pressures[0] - waves[0], 13),
            )
        )

    def forget(self, t):
        self.pieces = [piece for piece in self.pieces if piece[1] > t - self.delay - 1e-9]


def drive_through_a_hose(end):
    """(times of slipping, speeds, current and pressures) of the shipped drive, by steps of the travel time at most."""
    k, ohm, henry, j1, j2, volume = 0.4, 0.1, 1e-3, 0.01, 0.4, 0.2e-3
    d1, d2, rated, w1, w2 = 11.0 * CC, 60.0 * CC, 150e5, 1500.0 * pi / 30.0, 400.0 * pi / 30.0
    leak1, leak2 = d1 * w1 * 0.06 / rated, d2 * w2 * (1.0 / 0.95 - 1.0) / rated
    dry1, dry2 = 0.5 * d1 * rated * (1.0 / 0.91 - 1.0), 0.5 * d2 * rated * 0.08
    hose = Hose()

    def rhs(t, y, turns):
        pump, drum, current, p1, p2 = y
        waves = hose.arriving(t)
        q1, q2 = (p1 - waves[0]) / hose.impedance, (waves[1] - p2) / hose.impedance
        volt = 48.0 * min(max((t - 0.1) / 0.5, 0.0), 1.0)
        up = (k * current - d1 * (p1 - P0) - dry1 / w1 * pump - dry1) / j1 if turns[0] else 0.0
        down = (d2 * (p2 - P0) - (dry2 / w2 + 1.5) * drum - dry2 - 6.0) / j2 if turns[1] else 0.0
        return [
            up,
            down,
            (volt - ohm * current - k * pump) / henry,
            BETA / volume * (d1 * pump - leak1 * (p1 - P0) - q1),
            BETA / volume * (q2 - d2 * drum - leak2 * (p2 - P0)),
        ]

    def pump_torn(t, y, turns):
        return -1.0 if turns[0] else k * y[2] - d1 * (y[3] - P0) - dry1

    def drum_torn(t, y, turns):
        return -1.0 if turns[1] else d2 * (y[4] - P0) - dry2 - 6.0

    pump_torn.terminal = drum_torn.terminal = True
    t, y, turns, times = 0.0, [0.0, 0.0, 0.0, P0, P0], [False, False], []
    kinks = [0.1, 0.6]
    while t < end:
        hose.forget(t)
        ends = [kink + n * hose.delay for kink in kinks for n in range(5)]
        ends += [end, t + hose.delay, *(piece[1] + hose.delay for piece in hose.pieces)]
        stop = min(x for x in ends if x > t + 1e-12)
        found = solve_ivp(
            rhs,
            (t, stop),
            y,
            "DOP853",
            rtol=1e-11,
            atol=[1e-9, 1e-9, 1e-9, 1e-3, 1e-3],
            events=(pump_torn, drum_torn),
            dense_output=True,
            args=(turns,),
        )
        hose.add(t, found.t[-1], found)
        t, y = found.t[-1], found.y[:, -1]
        if found.status == 1:
            turns = [turns[0] or len(found.t_events[0]) > 0, turns[1] or len(found.t_events[1]) > 0]
            times, kinks = [*times, t], [*kinks, t]
    return times, y


DRIVE = (
    "coupling.speed",
    "drum.speed",
    "electric-motor.current",
    "outlet.pressure",
    "inlet.pressure",
)


def test_the_shipped_drive_is_that_of_dalemberts_waves():
    times, exact = drive_through_a_hose(0.8)
    units = np.array([30.0 / pi, 30.0 / pi, 1.0, 1e-5, 1e-5])
    settings = {"numerics.end": 0.8, "numerics.rtol": 1e-10, "numerics.delay_tolerance": 1e-9}
    for model, tolerance, numbers in (
        ("delay-line", 2e-7, {}),
        ("finite-volume", 2e-6, {"links.hose.cells": 60}),
    ):
        run = runs(
            CASES / "hydrostatic-drive.toml", **settings | numbers | {"numerics.pipe_model": model}
        )
        assert [run[probe][-1] for probe in DRIVE] == pytest.approx(exact * units, rel=tolerance), (
            model
        )
        torn = [run.summary["events"][k]["time"] for k in (0, -1)]
        assert torn == pytest.approx(times, abs=2e-7)


def winch_by_scipy(start, end):
    """State (pressures, setting, speed) of the shipped load-sensing pump at `end`, from its state at the start."""
    d1, d2, area = 28.0 * CC, 60.0 * CC, 0.61 * pi / 4.0 * 6e-3**2
    leak1, leak2 = d1 * W1 * 0.05 / 200e5, 0.01 / 6e9
    steps, opening = [0.2, 0.4, 1.0, 1.05, 2.0, 2.05], ([0.2, 0.4], [0.2, 0.6])
    load = [1.0, 1.05, 2.0, 2.05], [60.0, 120.0, 120.0, 165.0]

    def rhs(t, y, first, slopes):
        supply, load, x, w = y
        metered = (
            area
            * (first[0] + slopes[0] * t)
            * copysign(sqrt(2.0 * abs(supply - load) / RHO), supply - load)
        )
        share = min(max((min(180e5 + P0, load + 18e5) - supply) / 6e5, 0.0), 1.0)
        torque = d2 * (load - P0) - 0.55 * w - (first[1] + slopes[1] * t)
        return [
            BETA / 1e-3 * (d1 * W1 * x - leak1 * (supply - P0) - metered),
            BETA / 0.5e-3 * (metered - d2 * w - leak2 * (load - P0)),
            (share - x) / 0.04,
            torque / 0.2,
        ]

    y, breaks = start, sorted({0.0, end, *(t for t in steps if t < end)})
    for t, stop in zip(breaks, breaks[1:], strict=False):
        ends = [np.interp((t, stop), *pair) for pair in (opening, load)]
        slopes = [float(b - a) / (stop - t) for a, b in ends]
        first = [float(a) - slope * t for (a, _), slope in zip(ends, slopes, strict=True)]
        y = solve_ivp(
            rhs,
            (t, stop),
            y,
            "DOP853",
            rtol=1e-12,
            atol=[1e-3, 1e-3, 1e-10, 1e-8],
            args=(first, slopes),
        ).y[:, -1]
    return y


@pytest.mark.parametrize("method", METHODS)
def test_the_shipped_load_sensing_pump_is_that_of_scipy(method):
    run = runs(CASES / "load-sensing.toml", method, **{"numerics.rtol": 1e-11, "output.units": {}})
    probes = ("supply.pressure", "load.pressure", "pump.setting", "drum.speed")
    exact = winch_by_scipy([run[probe][0] for probe in probes], 3.0)
    assert [run[probe][-1] for probe in probes] == pytest.approx(exact, rel=1e-8)
