"""Networks of rotation, electricity and heat, against closed forms, SciPy with events, and restatements."""

from math import exp, pi, sqrt

import numpy as np
import pytest
from reference.element_networks import GROUND, network, runs, two_port
from reference.folders import CASES
from reference.resumed_runs import killed_and_resumed, same_files
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import fvsolve
from fvsolve.cli.printing import exit_code
from fvsolve.core.model.energy_norm import energy_form
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.parts.network_elements import network_of
from fvsolve.parts.self_acting.law_check_valve import PRESSURE_MARGIN
from fvsolve.studies import stability
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise
from fvsolve.studies.loops.loop import loop

EXACT = 1e-9
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]


def jump(before, after, time=0.0):
    return {"time": [time - 1.0, time], "value": [before, after], "kind": "step"}


# electricity --------------------------------------------------------------------------------------------------------

R, L, C = 2.0, 3e-3, 1e-4


def resonant(**more):
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=10.0),
        "resistor": two_port("resistor", "a", "b", resistance=R),
        "coil": two_port("inductor", "b", "c", inductance=L, initial_current=0.0),
        "store": two_port("capacitor", "c", "gnd", capacitance=C, initial_voltage=0.0),
    }
    return network("a b c", links, 0.02, **more)


def resonant_voltage(t):
    damping = R / (2.0 * L)
    w = sqrt(1.0 / (L * C) - damping**2)
    return 10.0 * (1.0 - np.exp(-damping * t) * (np.cos(w * t) + damping / w * np.sin(w * t)))


@pytest.mark.parametrize("method", METHODS)
def test_a_series_circuit_rings_as_its_closed_form(method):
    run = runs(resonant(), method)
    t, v = np.array(run.t), np.array(run["c.voltage"])
    assert np.abs(v - resonant_voltage(t)).max() < 10.0 * 10.0 * EXACT
    assert np.array(run["store.current"]) == pytest.approx(np.array(run["coil.current"]), abs=1e-12)
    assert np.array(run["a.voltage"]) == pytest.approx(10.0, abs=0.0)


def test_restated_circuits_have_the_same_voltages():
    """Links drawn the other way, other order, resistor and coil in two halves, other units."""
    case = resonant()
    reference = np.array(runs(case)["c.voltage"])
    turned = case | {"links": dict(reversed(case["links"].items()))}
    assert np.array(runs(turned)["c.voltage"]) == pytest.approx(reference, abs=1e-12)
    other = {
        "source": two_port("voltage-source", "a", "gnd", voltage="-10000 mV"),
        "first": two_port("resistor", "d", "a", resistance="0.5 ohm"),
        "second": two_port("resistor", "d", "b", resistance="1500 mohm"),
        "coil": two_port("inductor", "e", "b", inductance="1 mH", initial_current=0.0),
        "rest": two_port("inductor", "e", "c", inductance="2000 uH"),
        "store": two_port("capacitor", "gnd", "c", capacitance=C / 4.0, initial_voltage=0.0),
        "beside": two_port("capacitor", "c", "gnd", capacitance=0.75 * C),
    }
    split = network(
        "a b c d e",
        other,
        0.02,
        probes=["c.voltage", "rest.current", "store.voltage", "beside.current"],
    )
    run = runs(split)
    assert np.array(run["c.voltage"]) == pytest.approx(reference, abs=1e-9)
    assert np.array(run["store.voltage"]) == pytest.approx(-reference, abs=1e-9)
    current = np.gradient(reference, np.array(run.t)) * C
    assert np.array(run["rest.current"])[2:-2] == pytest.approx(current[2:-2], abs=0.3)
    assert len(fvsolve.build(fvsolve.load(split)).state_names) == 2


@pytest.mark.parametrize("turned", [False, True])
def test_a_current_source_charges_a_capacitor(turned):
    ends, current = (("a", "gnd"), -2.0) if turned else (("gnd", "a"), 2.0)
    links = {
        "source": two_port("current-source", *ends, current=current),
        "load": two_port("resistor", "a", "gnd", resistance=5.0),
        "store": two_port("capacitor", "a", "gnd", capacitance=0.02, initial_voltage=0.0),
    }
    case = network("a", links, 0.3, ["a.voltage", "source.current", "source.power"])
    for method in METHODS:
        run = runs(case, method)
        exact = 10.0 * (1.0 - np.exp(-10.0 * np.array(run.t)))
        assert np.array(run["a.voltage"]) == pytest.approx(exact, abs=10.0 * EXACT)
        assert set(run["source.current"]) == {current}
        assert np.array(run["source.power"]) == pytest.approx(2.0 * exact, abs=20.0 * EXACT)
    assert abs(energy(case).remainder[-1]) < 1e-9 * energy(case).throughput


def test_tied_coils_have_the_rates_of_their_sum():
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=1.0),
        "resistor": two_port("resistor", "a", "b", resistance=2.0),
        "first": two_port("inductor", "b", "c", inductance=1e-3, initial_current=0.0),
        "second": two_port("inductor", "c", "gnd", inductance=3e-3),
    }
    found = linearise(network("a b c", links), ["source.voltage"])
    assert found.a == pytest.approx(np.array([[-500.0]]), rel=1e-9)
    assert found.b == pytest.approx(np.array([[250.0]]), rel=1e-9)


def motor(**more):
    """Motor with the closed form of `motor_state`, from rest at a step of its voltage."""
    links = {
        "supply": two_port("voltage-source", "gnd", "plus", voltage=24.0),
        "motor": {
            "type": "dc-motor",
            "ports": {"p": "plus", "n": "gnd", "shaft": "axle"},
            "torque_constant": 0.12,
            "resistance": 0.8,
            "inductance": 2e-3,
            "initial_current": 0.0,
        },
        "bearing": two_port("bearing", "axle", "frame", damping=1e-3),
    }
    nodes = GROUND | {
        "plus": {"type": "terminal"},
        "frame": {"type": "housing"},
        "axle": {"type": "shaft", "inertia": 3e-3, "initial_speed": 0.0},
    }
    probes = [
        "axle.speed",
        "axle.angle",
        "motor.current",
        "motor.torque",
        "supply.power",
        "bearing.torque",
    ]
    return network(nodes, links, 0.4, probes, **more)


MOTOR = np.array([[-0.8 / 2e-3, -0.12 / 2e-3], [0.12 / 3e-3, -1e-3 / 3e-3]])  # of current and speed


def motor_state(t):
    rest = np.linalg.solve(MOTOR, [24.0 / 2e-3, 0.0])
    return expm(MOTOR * t) @ rest - rest


@pytest.mark.parametrize("method", METHODS)
def test_a_motor_starts_as_its_closed_form(method):
    run = runs(motor(), method)
    exact = np.array([motor_state(t) for t in run.t])
    assert np.array(run["motor.current"]) == pytest.approx(exact[:, 0], abs=30.0 * EXACT)
    assert np.array(run["axle.speed"]) == pytest.approx(exact[:, 1], abs=200.0 * EXACT)
    assert np.array(run["motor.torque"]) == pytest.approx(0.12 * exact[:, 0], abs=30.0 * EXACT)
    assert np.array(run["supply.power"]) == pytest.approx(
        24.0 * exact[:, 0], abs=24.0 * 30.0 * EXACT
    )
    whole = np.linalg.solve(MOTOR, exact[-1] - np.array([24.0 / 2e-3, 0.0]) * run.t[-1])
    assert run["axle.angle"][-1] == pytest.approx(whole[1], rel=1e-8)


@pytest.mark.parametrize(
    "method, long", [("euler", 0.1), ("rk4", 0.01), ("rk4", 0.1), ("rodas-5p", 0.1)]
)
def test_a_run_with_a_step_too_long_for_a_motor_gives_a_notice(method, long):
    """rk4 is stable below 7 ms here; 4 ms is within its limit and right."""
    run = fvsolve.run(motor(), {"numerics.method": method, "numerics.step": long})
    assert not run.ok and exit_code(run) != 0 and run.warnings[0].place == "motor.current"
    short = fvsolve.run(motor(), {"numerics.method": "rk4", "numerics.step": 4e-3})
    assert short.ok and short["axle.speed"][-1] == pytest.approx(motor_state(0.4)[1], rel=1e-8)


def test_a_pump_that_a_motor_starts_has_equal_end_values_under_both_liquid_laws():
    found = [
        fvsolve.run("dc-motor-pump", {"fluid.law": law, "output.units": {}})
        for law in ("linear", "log")
    ]
    for name in ("pump.shaft.speed", "motor.current"):
        # 0.5 bar over 2.2 GPa
        assert found[0][name][-1] == pytest.approx(found[1][name][-1], rel=1e-5)


def test_rates_of_a_motor_are_exact():
    network = network_of(fvsolve.build(fvsolve.load(motor())))
    order = [
        network.columns[f"links.motor{end}" if end else "nodes.axle"] for end in (".inductance", "")
    ]
    rates = dict(zip(network.states, network.terms(()), strict=False))
    found = [[rates[column].get(other, 0.0) for other in order] for column in order]
    assert np.array(found) == pytest.approx(MOTOR, rel=1e-15)
    assert rates[order[0]][network.columns["links.supply"]] == pytest.approx(500.0, rel=1e-15)


def test_the_energy_norm_of_a_network_is_that_of_its_stores():
    """In these coordinates the rates of a passive network have no eigenvalue of their symmetric part above 0."""
    for case in (motor(), resonant(), clutched(), warm()):
        model = fvsolve.build(fvsolve.load(case))
        form = energy_form(model)
        seen = form.seen(model.jacobian(0.0, model.start))
        assert np.linalg.eigvalsh(0.5 * (seen + seen.T)).max() <= 1e-6 * np.abs(seen).max()
    (row,) = stability(motor(), methods=["dormand-prince"]).rows
    assert abs(row.difference) < 0.01


def test_check_names_states_and_ties_and_decides_passivity():
    facts = network_of(fvsolve.build(fvsolve.load(motor()))).facts()
    assert sorted(facts["states"]) == ["axle.speed", "motor.current"] and not facts["tied"]
    assert facts["passive"] and facts["greatest"] == pytest.approx(-2.0 * 1e-3, rel=1e-12)
    links = {"gear": two_port("gear", "a", "b", ratio=5.0)}
    facts = network_of(fvsolve.build(fvsolve.load(shafts(links, ["a.speed"])))).facts()
    assert (
        facts["tied"] == {"a.speed": "5 b.speed"} and facts["passive"] and facts["greatest"] == 0.0
    )


def test_a_motor_at_rest_does_not_move():
    case = motor()
    case["nodes"]["axle"].pop("initial_speed")
    case["links"]["motor"].pop("initial_current")
    at_rest = -np.linalg.solve(MOTOR, [24.0 / 2e-3, 0.0])
    for method in METHODS:
        run = runs(case, method)
        assert set(run["axle.speed"]) == {run["axle.speed"][0]} and set(run["motor.current"]) == {
            run["motor.current"][0]
        }
        assert [run["motor.current"][0], run["axle.speed"][0]] == pytest.approx(at_rest, rel=1e-12)


def rectifier(bridge, **more):
    """Full bridge, or a single diode, from a source of 50 Hz to a capacitor and a load."""
    source = {"formula": "30*sin(2*pi*50*t)", "unit": "V"}
    diode = {"forward_voltage": 0.7, "resistance": 0.1}
    load = {
        "store": two_port("capacitor", "plus", "minus", capacitance=1e-3, initial_voltage=0.0),
        "load": two_port("resistor", "plus", "minus", resistance=20.0),
    }
    if not bridge:
        links = {
            "source": two_port("voltage-source", "gnd", "a", voltage=source),
            "diode": two_port("diode", "a", "plus", **diode),
        } | load
        case = network("a plus", links, 0.05, **more)
        for link in ("store", "load"):
            case["links"][link]["to"] = "gnd"
        return case
    links = {"source": two_port("voltage-source", "a", "b", voltage=source)} | load
    links |= {
        "d1": two_port("diode", "a", "plus", **diode),
        "d2": two_port("diode", "b", "plus", **diode),
        "d3": two_port("diode", "minus", "a", **diode),
        "d4": two_port("diode", "minus", "b", **diode),
        "earth": two_port("resistor", "minus", "gnd", resistance=1.0),
    }
    return network(
        "a b plus minus",
        links,
        0.05,
        probes=["plus.voltage", "minus.voltage", "load.voltage"],
        **more,
    )


def by_events(excess, end, ohm):
    """Voltage of the capacitor, by SciPy with the times at which diodes switch as events."""
    t, v, conducts, parts = 0.0, 0.0, False, []
    while t < end:

        def rates(t, v, conducts=conducts):
            current = (excess(t) - v[0]) / ohm if conducts else 0.0
            return [(current - v[0] / 20.0) / 1e-3]

        def switches(t, v):
            return excess(t) - v[0]

        switches.terminal, switches.direction = True, -1.0 if conducts else 1.0
        found = solve_ivp(
            rates,
            (t, end),
            [v],
            "DOP853",
            rtol=1e-12,
            atol=1e-12,
            events=switches,
            dense_output=True,
            max_step=1e-3,
        )
        parts.append((t, found.t[-1], found.sol))
        t, v, conducts = found.t[-1], found.y[0, -1], not conducts
    return lambda time: next(
        sol(time)[0] for begin, stop, sol in reversed(parts) if begin <= time <= stop
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("bridge", [False, True])
@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p"])
def test_rectifiers_are_those_of_scipy_with_events(bridge, method):
    """In a bridge two diodes conduct at a time."""
    run = runs(rectifier(bridge), method, **{"numerics.rtol": 1e-10})
    excess = (
        (lambda t: abs(30.0 * np.sin(2 * pi * 50 * t)) - 1.4)
        if bridge
        else (lambda t: 30.0 * np.sin(2 * pi * 50 * t) - 0.7)
    )
    exact = by_events(excess, 0.05, 0.2 if bridge else 0.1)
    voltage = np.array(run["load.voltage"] if bridge else run["plus.voltage"])
    assert voltage == pytest.approx([exact(t) for t in run.t], abs=3e-8)
    assert {event["what"] for event in run.summary["events"]} == {"conducts", "blocks"}


def chopper(freewheel=True):
    """Coil fed through a switch that opens at 4 ms, with a diode beside it."""
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=12.0),
        "switch": two_port("switch", "a", "b", closed=jump(1.0, 0.0, 4e-3), resistance=0.01),
        "coil": two_port("inductor", "b", "c", inductance=0.02, initial_current=0.0),
        "load": two_port("resistor", "c", "gnd", resistance=1.0),
    }
    if freewheel:
        links["diode"] = two_port("diode", "gnd", "b", resistance=0.01)
    return network(
        "a b c",
        links,
        0.01,
        probes=["coil.current", "diode.current"] if freewheel else ["coil.current"],
    )


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-5p"])
def test_a_diode_takes_over_the_current_of_an_opened_switch(method):
    run = runs(chopper(), method)
    at_opening = 12.0 / 1.01 * (1.0 - exp(-1.01 / 0.02 * 4e-3))
    exact = [
        12.0 / 1.01 * (1.0 - exp(-1.01 / 0.02 * t))
        if t <= 4e-3
        else at_opening * exp(-1.01 / 0.02 * (t - 4e-3))
        for t in run.t
    ]
    assert np.array(run["coil.current"]) == pytest.approx(exact, abs=12.0 * EXACT)
    assert sorted(event["what"] for event in run.summary["events"]) == ["conducts", "opens"]
    assert (
        run["diode.current"][-1] == pytest.approx(exact[-1], rel=1e-8)
        and run["diode.current"][1] == 0.0
    )


def test_a_switch_that_would_cut_a_current_ends_the_run_by_name():
    run = fvsolve.run(chopper(freewheel=False))
    assert not run.ok and "switch" in run.reason and "coil" in run.reason and "diode" in run.reason
    assert run.t[-1] == pytest.approx(4e-3, abs=3e-4)


def diode(start, stop, **keys):
    return two_port("diode", start, stop, forward_voltage=0.7, **keys)


@pytest.mark.parametrize("order", [1, -1])
def test_diodes_in_series_conduct_together(order):
    source = "10*sin(2*pi*50*t)"
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=source),
        "d1": diode("a", "b"),
        "d2": diode("b", "c"),
        "d3": diode("c", "d"),
        "load": two_port("resistor", "d", "gnd", resistance=7.0),
    }
    run = runs(network("a b c d", dict(list(links.items())[::order]), 0.05, ["load.current"]))
    voltage = 10.0 * np.sin(2.0 * pi * 50.0 * np.array(run.t))
    assert np.array(run["load.current"]) == pytest.approx(
        np.maximum(voltage - 2.1, 0.0) / 7.003, abs=1e-9
    )


@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p"])
def test_a_bridge_of_three_phases_passes_the_greatest_line_voltage(method):
    def phase(k):
        return f"100*sin(2*pi*50*t - {2.0 * pi * k / 3.0!r})"

    links = {
        f"v{k}": two_port("voltage-source", "gnd", f"a{k}", voltage=phase(k)) for k in range(3)
    }
    links |= {f"u{k}": diode(f"a{k}", "p") for k in range(3)} | {
        f"w{k}": diode("n", f"a{k}") for k in range(3)
    }
    links["load"] = two_port("resistor", "p", "n", resistance=5.0)
    run = runs(
        network("a0 a1 a2 p n", links, 0.05, ["load.current"]), method, **{"numerics.rtol": 1e-9}
    )
    phases = np.array(
        [100.0 * np.sin(2.0 * pi * (50.0 * np.array(run.t) - k / 3.0)) for k in range(3)]
    )
    exact = (phases.max(axis=0) - phases.min(axis=0) - 1.4) / 5.002
    # not while two diodes share the current
    apart = np.abs((np.array(run.t) * 300.0 - 0.5) % 1.0 - 0.5) < 0.49
    assert np.array(run["load.current"])[apart] == pytest.approx(exact[apart], rel=1e-6)


def test_a_piece_between_open_switches_has_no_current():
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=10.0),
        "first": two_port("switch", "a", "b", closed=0.0),
        "load": two_port("resistor", "b", "c", resistance=1.0),
        "second": two_port("switch", "c", "gnd", closed=0.0),
    }
    run = runs(network("a b c", links))
    assert np.array(run["load.current"]) == pytest.approx(0.0, abs=1e-12)
    assert run["b.voltage"][0] == pytest.approx(5.0)


# rotation -----------------------------------------------------------------------------------------------------------


def shafts(links, probes, a=None, b=None, end=1.0, **more):
    nodes = {
        "a": {"type": "shaft", "inertia": 2e-3, "initial_speed": 0.0, **(a or {})},
        "b": {"type": "shaft", "inertia": 0.4, **(b or {})},
    }
    joined = [part.get(end) for part in links.values() for end in ("from", "to")]
    nodes |= {"frame": {"type": "housing"}} if "frame" in joined else {}
    if "b" not in joined:
        nodes.pop("b")
    return network(nodes, links, end, probes, **more)


def test_a_bearing_without_friction_does_nothing():
    found = fvsolve.run(
        shafts(
            {"bearing": two_port("bearing", "a", "frame", damping=0.0)},
            ["a.speed"],
            {"initial_speed": 7.0},
        )
    )
    assert np.array(found["a.speed"]) == pytest.approx(7.0, rel=1e-15)


def test_a_misspelt_type_in_a_network_does_not_require_a_fluid():
    case = shafts({"bearing": two_port("bearing", "a", "frame", damping=0.0)}, ["a.speed"])
    case["links"]["drive"], case["nodes"]["c"] = {"type": "toque", "to": "a"}, {"type": "shft"}
    case.pop("fluid", None)
    with pytest.raises(CaseError) as error:
        fvsolve.load(case)
    assert [fault.place for fault in error.value.faults] == ["nodes.c.type", "links.drive.type"]


@pytest.mark.parametrize("ratio", [5.0, -5.0])
def test_a_gear_joins_two_inertias_to_a_single_state(ratio):
    links = {
        "gear": two_port("gear", "a", "b", ratio=ratio),
        "drive": {"type": "torque", "to": "a", "torque": 3.0},
        "bearing": two_port("bearing", "b", "frame", damping=0.05),
    }
    run = runs(shafts(links, ["a.speed", "b.speed", "gear.torque"]))
    inertia = 0.4 + ratio**2 * 2e-3
    rate = 0.05 / inertia
    exact = 3.0 * ratio / 0.05 * (1.0 - np.exp(-rate * np.array(run.t)))
    assert np.array(run["b.speed"]) == pytest.approx(exact, rel=EXACT)
    assert np.array(run["a.speed"]) == pytest.approx(ratio * exact, rel=EXACT)
    acceleration = 3.0 * ratio / inertia * np.exp(-rate * np.array(run.t))
    assert np.array(run["gear.torque"]) == pytest.approx(
        3.0 - 2e-3 * ratio * acceleration, rel=EXACT
    )
    found = linearise(shafts(links, ["b.speed"]), ["drive.torque"])
    assert found.b[0, 0] == pytest.approx(
        ratio / inertia if found.states[0] == "b.speed" else ratio**2 / inertia, rel=1e-12
    )


def test_a_gear_of_ratio_1_and_a_divided_shaft_change_nothing():
    drive = {"type": "torque", "to": "a", "torque": {"formula": "3*sin(9*t)", "unit": "N m"}}
    spring = {"stiffness": 50.0, "damping": 0.2}
    whole = {"spring": two_port("torsion-spring", "a", "b", **spring), "drive": drive}
    reference = runs(shafts(whole, ["b.speed"]))
    halves = {
        "spring": two_port("torsion-spring", "m", "b", **spring),
        "gear": two_port("gear", "c", "m", ratio=1.0),
        "stiff": two_port("gear", "c", "a", ratio=1.0),
        "drive": drive,
    }
    case = shafts(halves, ["b.speed", "m.speed"], {"inertia": 0.5e-3})
    case["nodes"] |= {"c": {"type": "shaft"}, "m": {"type": "shaft", "inertia": 1.5e-3}}
    run = runs(case)
    assert np.array(run["b.speed"]) == pytest.approx(np.array(reference["b.speed"]), abs=1e-9)
    in_series = {
        "first": two_port("torsion-spring", "a", "c", stiffness=100.0, damping=0.4),
        "second": two_port("torsion-spring", "b", "c", stiffness=100.0, damping=0.4),
        "drive": drive,
    }
    case = shafts(in_series, ["b.speed"])
    case["nodes"]["c"] = {"type": "shaft"}
    assert np.array(runs(case)["b.speed"]) == pytest.approx(
        np.array(reference["b.speed"]), abs=1e-8
    )


def test_two_inertias_on_a_spring_swing_at_their_frequency():
    links = {"spring": two_port("torsion-spring", "a", "b", stiffness=50.0, initial_torque=0.0)}
    case = shafts(
        links,
        ["a.speed", "spring.torque"],
        {"inertia": 0.1, "initial_speed": 1.0},
        {"inertia": 0.3, "initial_speed": 0.0},
    )
    run, w = runs(case), sqrt(50.0 * (1.0 / 0.1 + 1.0 / 0.3))
    assert w == pytest.approx(25.8198889747, abs=1e-9)
    exact = 0.25 + 0.75 * np.cos(w * np.array(run.t))
    assert np.array(run["a.speed"]) == pytest.approx(exact, abs=3.0 * EXACT)
    assert np.array(run["spring.torque"]) == pytest.approx(
        0.75 * w * 0.1 * np.sin(w * np.array(run.t)), abs=1e-7
    )


RISING = {"time": [0.0, 6.0, 16.0], "value": [0.0, 0.0, 20.0]}
CLUTCH = {
    "clutch": two_port("clutch", "a", "b", torque=4.0),
    "drive": {"type": "torque", "to": "a", "torque": RISING},
}


def clutched(links=CLUTCH, **more):
    probes = ["a.speed", "b.speed", "clutch.torque", "clutch.slip", "clutch.locked"]
    return shafts(
        links,
        probes,
        {"inertia": 2.0, "initial_speed": 10.0},
        {"inertia": 3.0, "initial_speed": 0.0},
        12.0,
        **more,
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("turned", [False, True])
def test_a_clutch_locks_and_tears_off_at_the_times_of_the_closed_form(method, turned):
    links = CLUTCH | ({"clutch": two_port("clutch", "b", "a", torque=4.0)} if turned else {})
    run = runs(clutched(links), method)
    words = ["sticks", "slips backward" if turned else "slips forward"]
    assert [event["what"] for event in run.summary["events"]] == words
    assert [event["time"] for event in run.summary["events"]] == pytest.approx(
        [3.0, 28.0 / 3.0], abs=12.0 * EXACT
    )
    t = np.array(run.t)
    assert np.interp(5.1, t, run["a.speed"]) == pytest.approx(4.0, abs=4.0 * EXACT)
    assert np.interp(5.1, t, run["b.speed"]) == pytest.approx(4.0, abs=4.0 * EXACT)
    locked = np.array(run["clutch.locked"])
    assert set(locked[(t > 3.1) & (t < 9.3)]) == {1.0} and set(locked[(t < 2.9) | (t > 9.4)]) == {
        0.0
    }
    after = t > 9.4
    begun = 4.0 + (28.0 / 3.0 - 6.0) ** 2 / 5.0
    assert np.array(run["b.speed"])[after] == pytest.approx(
        begun + 4.0 / 3.0 * (t[after] - 28.0 / 3.0), rel=EXACT
    )


def test_a_slipping_clutch_loses_the_energy_of_the_closed_form():
    found = energy(clutched(CLUTCH | {"drive": {"type": "torque", "to": "a", "torque": 0.0}}))
    (lost,) = (values[-1] for values in found.dissipated.values())
    assert lost == pytest.approx(2.0 * 3.0 * 10.0**2 / (2.0 * 5.0), rel=1e-8)


def test_a_static_factor_holds_longer():
    links = CLUTCH | {"clutch": two_port("clutch", "a", "b", torque=4.0, static_factor=1.5)}
    times = [event["time"] for event in runs(clutched(links)).summary["events"]]
    assert times == pytest.approx([3.0, 6.0 + 6.0 * 5.0 / 3.0 / 2.0], abs=12.0 * EXACT)


def friction_case(**bearing):
    links = {
        "bearing": two_port("bearing", "a", "frame", **bearing),
        "drive": {
            "type": "torque",
            "to": "a",
            "torque": {"time": [0.0, 10.0], "value": [0.0, 5.0]},
        },
    }
    case = shafts(
        links, ["a.speed", "bearing.torque"], {"inertia": 0.5, "initial_speed": 0.0}, end=8.0
    )
    return case


def test_two_clutches_to_housings_of_unlike_speeds_slip():
    nodes = {
        "a": {"type": "shaft", "inertia": 1.0, "initial_speed": 2.0},
        "frame": {"type": "housing"},
        "drum": {"type": "housing", "speed": 5.0},
    }
    links = {
        "brake": two_port("clutch", "a", "frame", torque=3.0),
        "drive": two_port("clutch", "drum", "a", torque=4.0),
    }
    run = runs(network(nodes, links, 5.0))
    assert [(event["name"], event["what"]) for event in run.summary["events"]] == [
        ("drive", "sticks")
    ]
    assert (
        run.summary["events"][0]["time"] == pytest.approx(3.0, abs=1e-9)
        and run["a.speed"][-1] == 5.0
    )


@pytest.mark.parametrize("voltage", [1.0, 12.0, 30.0])
def test_the_start_of_a_drive_with_friction_is_an_equilibrium(voltage):
    """Motor on a shaft with dry friction, a clutch and a spring to a second shaft; its loss heats a body."""
    nodes = GROUND | {
        "p": {"type": "terminal"},
        "m": {"type": "terminal"},
        "rotor": {"type": "shaft", "inertia": 0.5},
        "wheel": {"type": "shaft", "inertia": 0.3},
        "frame": {"type": "housing"},
        "body": {"type": "heat-capacity", "heat_capacity": 10.0},
        "room": {"type": "ambient", "temperature": 290.0},
    }
    links = {
        "source": two_port("voltage-source", "gnd", "p", voltage=voltage),
        "wire": two_port("resistor", "p", "m", resistance=0.53, heat_to="body"),
        "motor": {
            "type": "dc-motor",
            "ports": {"p": "m", "n": "gnd", "shaft": "rotor"},
            "torque_constant": 0.41,
            "resistance": 0.7,
        },
        "bearing": two_port("bearing", "rotor", "frame", damping=0.023, friction_torque=0.3),
        "clutch": two_port("clutch", "rotor", "wheel", torque=0.6),
        "spring": two_port("torsion-spring", "wheel", "rotor", stiffness=3.3),
        "air": two_port("thermal-conductor", "body", "room", conductance=0.5),
    }
    run = runs(network(nodes, links, 1.0, ["rotor.speed", "wheel.speed", "body.temperature"]))
    speed = max(0.0, (0.41 * voltage / 1.23 - 0.3) / (0.023 + 0.41**2 / 1.23))
    current = (voltage - 0.41 * speed) / 1.23
    assert set(run["rotor.speed"]) == {run["rotor.speed"][0]} == set(run["wheel.speed"])
    assert run["rotor.speed"][0] == pytest.approx(speed, rel=1e-9, abs=1e-12)
    assert run["body.temperature"][0] == pytest.approx(290.0 + 0.53 * current**2 / 0.5, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_dry_friction_stands_to_the_bit_until_the_torque_exceeds_it(method):
    """Coulomb: free at 2 N m, at 4 s; then J w' = t / 2 - 2."""
    run = runs(friction_case(friction_torque=2.0), method)
    t, speed = np.array(run.t), np.array(run["a.speed"])
    assert set(speed[t <= 4.0]) == {0.0}
    assert speed == pytest.approx(np.where(t > 4.0, 0.5 * (t - 4.0) ** 2, 0.0), abs=8.0 * EXACT)
    assert np.array(run["bearing.torque"])[t <= 4.0] == pytest.approx(0.5 * t[t <= 4.0], abs=1e-12)


def test_stribeck_friction_is_that_of_scipy():
    run = runs(
        friction_case(friction_torque=1.0, static_torque=2.0, stribeck_speed=0.3, damping=0.2)
    )

    def rates(t, w):
        return [(0.5 * t - 0.2 * w[0] - 1.0 - exp(-((w[0] / 0.3) ** 2))) / 0.5]

    exact = solve_ivp(
        rates, (4.0, 8.0), [0.0], "DOP853", rtol=1e-12, atol=1e-13, dense_output=True
    ).sol
    t = np.array(run.t)
    moving = t > 4.0
    assert np.array(run["a.speed"])[moving] == pytest.approx(exact(t[moving])[0], abs=2e-8)
    torque = 0.2 * exact(t[moving])[0] + 1.0 + np.exp(-((exact(t[moving])[0] / 0.3) ** 2))
    assert np.array(run["bearing.torque"])[moving] == pytest.approx(torque, abs=1e-7)


def test_a_stick_slip_oscillator_sticks_twice_a_cycle():
    """A mass on a belt: a shaft on a spring to the frame, driven by dry friction on a turning housing."""
    links = {
        "belt": two_port("bearing", "drum", "a", friction_torque=1.0, static_torque=1.5),
        "spring": two_port("torsion-spring", "a", "frame", stiffness=4.0, initial_torque=0.0),
    }
    case = shafts(
        links, ["a.speed", "spring.torque"], {"inertia": 1.0, "initial_speed": 0.2}, end=20.0
    )
    case["nodes"]["drum"] = {"type": "housing", "speed": 0.2}
    run = runs(case)
    # it sticks up to 1.5 N m; then torque - 1 = cos(2 s) / 2 + 0.4 sin(2 s), until the speed is 0.2 rad/s again
    events = [(event["time"], event["what"]) for event in run.summary["events"]]
    assert events[0] == (pytest.approx(1.5 / 4.0 / 0.2, abs=1e-8), "slips forward")
    assert events[1] == (pytest.approx(1.875 + pi - np.arctan2(0.25, 0.2), abs=1e-8), "sticks")
    stuck = (np.array(run.t) < 1.8) | (
        (np.array(run.t) > events[1][0]) & (np.array(run.t) < events[1][0] + 0.5)
    )
    assert np.array(run["a.speed"])[stuck] == pytest.approx(0.2, abs=1e-12)


def test_a_rack_moves_a_mass_with_its_shaft():
    nodes = {
        "axle": {"type": "shaft", "inertia": 0.02},
        "cart": {"type": "mass", "mass": 5.0, "initial_velocity": 0.0},
        "wall": {"type": "frame"},
    }
    links = {
        "rack": {"type": "rack", "ports": {"shaft": "axle", "mass": "cart"}, "radius": 0.1},
        "drive": {"type": "torque", "to": "axle", "torque": 3.0},
        "damper": two_port("damper", "wall", "cart", damping=4.0),
    }
    case = network(
        nodes, links, 2.0, ["axle.speed", "cart.velocity", "rack.force", "cart.position"]
    )
    for method in METHODS:
        run = runs(case, method)
        mass = 5.0 + 0.02 / 0.1**2
        exact = 30.0 / 4.0 * (1.0 - np.exp(-4.0 / mass * np.array(run.t)))
        assert np.array(run["cart.velocity"]) == pytest.approx(exact, abs=10 * EXACT)
        assert np.array(run["axle.speed"]) == pytest.approx(exact / 0.1, abs=100 * EXACT)
        force = 30.0 - 0.02 / 0.1**2 * 30.0 / mass * np.exp(-4.0 / mass * np.array(run.t))
        assert np.array(run["rack.force"]) == pytest.approx(force, abs=100 * EXACT)


# heat ---------------------------------------------------------------------------------------------------------------


def warm(**more):
    nodes = {
        "body": {
            "type": "heat-capacity",
            "heat_capacity": "2 kJ/K",
            "initial_temperature": "80 degC",
        },
        "room": {"type": "ambient", "temperature": "20 degC"},
        "skin": {"type": "heat-capacity", "heat_capacity": 100.0},
    }
    links = {
        "wall": two_port("thermal-conductor", "body", "skin", conductance=5.0),
        "air": two_port("convection", "skin", "room", coefficient="25 W/m2/K", area=0.4),
    }
    return network(
        nodes,
        links,
        1800.0,
        ["body.temperature", "wall.heat", "wall.entropy_flow", "skin.temperature"],
        **more,
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_body_cools_as_its_closed_form(method):
    case = warm()
    case["nodes"]["skin"]["initial_temperature"] = "40 degC"
    run = runs(case, method)
    matrix = np.array([[-5.0, 5.0], [5.0, -15.0]]) / np.array([[2000.0], [100.0]])
    exact = np.array([expm(matrix * t) @ [60.0, 20.0] for t in run.t]) + 293.15
    assert np.array(run["body.temperature"]) == pytest.approx(exact[:, 0], abs=60.0 * EXACT)
    heat = 5.0 * (exact[:, 0] - exact[:, 1])
    assert np.array(run["wall.heat"]) == pytest.approx(heat, abs=1e-6)
    assert np.array(run["wall.entropy_flow"]) == pytest.approx(heat / exact[:, 0], rel=1e-7)


def test_a_heat_source_warms_a_body_as_its_closed_form():
    nodes = {
        "body": {"type": "heat-capacity", "heat_capacity": 200.0, "initial_temperature": 300.0},
        "room": {"type": "ambient", "temperature": 300.0},
    }
    links = {
        "heater": {"type": "heat-source", "to": "body", "heat": "0.1 kW"},
        "wall": two_port("thermal-conductor", "body", "room", conductance=4.0),
    }
    case = network(
        nodes, links, 100.0, ["body.temperature", "heater.heat", "heater.entropy_flow", "wall.heat"]
    )
    for method in METHODS:
        run = runs(case, method)
        exact = 300.0 + 25.0 * (1.0 - np.exp(-0.02 * np.array(run.t)))
        assert np.array(run["body.temperature"]) == pytest.approx(exact, abs=25.0 * EXACT)
        assert set(run["heater.heat"]) == {100.0}
        assert np.array(run["heater.entropy_flow"]) == pytest.approx(100.0 / exact, rel=1e-9)
    found = energy(case)
    assert found.supplied["heater"][-1] == pytest.approx(1e4, rel=1e-9)
    assert found.supplied["room"][-1] == pytest.approx(-(1e4 - found.stored["body"][-1]), rel=1e-9)
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 50.0, {"heater.heat": 0.0})
    assert model.observe(state)[0] == pytest.approx(300.0, abs=1e-9)


def test_a_scalar_may_have_the_name_of_a_quantity_of_a_network():
    case = fvsolve.load(
        "dc-motor-pump",
        {
            "scalars": {"current": {}, "temperature": {}},
            "expect": {},
            "output": {"probes": ["motor.current", "rise.current"]},
            "numerics.end": 0.5,
        },
    )
    run = fvsolve.run(case)
    assert run.ok and run["motor.current"][-1] > 10.0 and set(run["rise.current"]) == {0.0}


def test_an_unstated_temperature_starts_in_equilibrium():
    run = runs(warm())
    assert run["skin.temperature"][0] == pytest.approx(293.15 + 60.0 / 3.0, abs=1e-9)
    room = warm()
    room["nodes"]["body"].pop("initial_temperature")
    assert len(set(runs(room)["body.temperature"])) == 1
    assert runs(room)["body.temperature"][0] == pytest.approx(293.15, abs=1e-12)


def test_the_loss_of_a_resistor_heats_its_target():
    nodes = GROUND | {
        "a": {"type": "terminal"},
        "body": {"type": "heat-capacity", "heat_capacity": 50.0, "initial_temperature": 300.0},
        "room": {"type": "ambient", "temperature": 300.0},
    }
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=10.0),
        "heater": two_port("resistor", "a", "gnd", resistance=4.0, heat_to="body"),
        "air": two_port("thermal-conductor", "body", "room", conductance=0.5),
    }
    case = network(nodes, links, 200.0, ["body.temperature", "air.heat"])
    for method in METHODS:
        run = runs(case, method)
        exact = 300.0 + 50.0 * (1.0 - np.exp(-0.01 * np.array(run.t)))
        assert np.array(run["body.temperature"]) == pytest.approx(exact, abs=50.0 * EXACT)
    found = energy(case)
    assert not found.dissipated and found.supplied["source"][-1] == pytest.approx(
        25.0 * 200.0, rel=1e-9
    )
    assert abs(found.remainder[-1]) < 1e-9 * 5000.0


@pytest.mark.parametrize("case", [motor(), resonant(), clutched(), warm(), rectifier(True)],
                         ids=["motor", "resonant", "clutch", "heat", "bridge"])  # fmt: skip
def test_energy_of_networks_closes(case):
    found = energy(case)
    assert abs(found.remainder[-1]) < 1e-9 * max(found.throughput, 1.0)


# pumps, turbines, controls -------------------------------------------------------------------------------------------


def motor_pump(t, y, opened):
    """Rates of current and speed of the shipped case, by hand; opened : True once the check valve is open."""
    voltage, rated = 48.0 * min(max(t - 0.1, 0.0), 1.0), 1450.0 * pi / 30.0
    current, n = y[0], y[1] / rated
    head = 4.0 / (2.0 * 9.80665 * (pi / 4.0 * 0.04**2) ** 2)
    flow = sqrt(max(12.0 * n * n - 6.0, 0.0) / (5e5 + head)) if opened else 0.0
    rated_power = 1000.0 * 9.80665 * 2e-3 * 10.0 / 0.6
    power = rated_power * np.interp(
        flow / n if n > 0.0 else 0.0, [0.0, 2e-3, 8e-3], [2.0 / 3.0, 1.0, 2.0]
    )
    torque = n * n * power / rated
    return [(voltage - 0.3 * current - 0.3 * y[1]) / 2e-3, (0.3 * current - torque) / 0.02]


@pytest.mark.parametrize("method", ["auto", "dormand-prince", "rodas-5p"])
def test_a_pump_that_a_motor_starts_is_that_of_scipy(method):
    run = fvsolve.run(
        "dc-motor-pump", {"numerics.method": method, "numerics.rtol": 1e-10, "output.units": {}}
    )
    assert run.ok

    def lifts(t, y):  # the valve opens above this small pressure
        return (
            12.0 * (y[1] / (1450.0 * pi / 30.0)) ** 2 - 6.0 - PRESSURE_MARGIN / (1000.0 * 9.80665)
        )

    lifts.terminal = True
    tight = {
        "method": "LSODA",
        "rtol": 1e-11,
        "atol": 1e-11,
        "dense_output": True,
        "max_step": 0.01,
    }
    first = solve_ivp(
        lambda t, y: motor_pump(t, y, False), (0.1, 3.0), [0.0, 0.0], events=lifts, **tight
    )
    opened = first.t[-1]
    (event,) = run.summary["events"]
    assert event["time"] == pytest.approx(opened, abs=1e-7)
    then = solve_ivp(lambda t, y: motor_pump(t, y, True), (opened, 1.1), first.y[:, -1], **tight)
    last = solve_ivp(lambda t, y: motor_pump(t, y, True), (1.1, 3.0), then.y[:, -1], **tight)
    for t, speed, current in zip(run.t, run["pump.shaft.speed"], run["motor.current"], strict=True):
        part = last if t >= 1.1 else then if t >= opened else first
        exact = part.sol(t) if t > 0.1 else np.zeros(2)
        assert [current, speed] == pytest.approx(exact, rel=1e-6, abs=2e-6)


def test_a_rotor_on_a_gear_is_inertia_of_the_pump():
    """The shaft of the pump is tied to the rotor of the motor: its rate follows from the torque of the water too."""
    probes = ["pump.shaft.speed", "motor.current", "pump.torque"]
    whole = fvsolve.load(
        "dc-motor-pump", {"links.pump.inertia": 0.03, "output.probes": probes, "output.units": {}}
    )
    reference = fvsolve.run(whole)
    raw = fvsolve.load("dc-motor-pump", {"output.probes": probes, "output.units": {}}).raw
    raw["output"]["probes"] = [*probes, "gear.torque", "rotor.speed"]
    raw["nodes"]["rotor"] = {"type": "shaft", "inertia": 0.04, "initial_speed": 0.0}
    raw["links"]["gear"] = two_port("gear", "rotor", "pump.shaft", ratio=-0.5)
    raw["links"]["motor"]["ports"]["shaft"] = "rotor"
    raw["links"]["motor"]["torque_constant"] = -0.6
    run = fvsolve.run(raw)
    assert run.ok
    for probe in probes:
        assert np.array(run[probe]) == pytest.approx(np.array(reference[probe]), rel=1e-6, abs=1e-6)
    assert np.array(run["rotor.speed"]) == pytest.approx(
        -0.5 * np.array(run["pump.shaft.speed"]), abs=1e-12
    )
    found = energy(raw)
    assert abs(found.remainder[-1]) < 1e-8 * found.throughput


def test_two_pumps_on_a_shaft_have_the_speeds_of_their_gear():
    """Both speeds are states of the pumps: they stay side by side, and follow from both torques."""
    raw = fvsolve.load(
        "dc-motor-pump", {"output": {"probes": ["pump.shaft.speed", "motor.current"]}, "expect": {}}
    ).raw
    twin = {"nodes": raw["nodes"] | {"rise2": raw["nodes"]["rise"]}, "links": dict(raw["links"])}
    twin["links"]["pump2"] = raw["links"]["pump"] | {
        "to": "rise2",
        "rated_speed": "2900 rpm",
        "inertia": 0.005,
    }
    twin["links"]["pipework2"] = raw["links"]["pipework"] | {"from": "rise2"}
    twin["links"]["gear"] = two_port("gear", "pump2.shaft", "pump.shaft", ratio=2.0)
    probes = ["pump.shaft.speed", "pump2.shaft.speed", "pump.flow", "pump2.flow"]
    run = fvsolve.run({**raw, **twin, "output": {"probes": probes}})
    assert run.ok
    assert np.array(run["pump2.shaft.speed"]) == pytest.approx(
        2.0 * np.array(run["pump.shaft.speed"]), abs=1e-9
    )
    assert np.array(run["pump2.flow"]) == pytest.approx(np.array(run["pump.flow"]), abs=1e-9)
    assert abs(energy({**raw, **twin}).remainder[-1]) < 1e-8 * energy({**raw, **twin}).throughput
    raw["links"]["pump"]["speed"] = 0.5
    with pytest.raises(CaseError, match="contradicts"):
        fvsolve.build(
            fvsolve.load({**raw, **twin, "links": twin["links"] | {"pump": raw["links"]["pump"]}})
        )


def test_a_generator_on_its_load_brakes_a_turbine_as_a_bearing():
    case = fvsolve.load("hydropower")
    name = next(name for name, link in case.links.items() if link.kind == "turbine")
    shaft = f"{name}.shaft"
    generator = {
        "type": "dc-motor",
        "ports": {"p": "p", "n": "gnd", "shaft": shaft},
        "torque_constant": 100.0,
        "resistance": 0.1,
    }
    brake = {
        "nodes.frame": {"type": "housing"},
        "links.brake": two_port("bearing", shaft, "frame", damping=4e4),
    }
    load = {
        "nodes.gnd": {"type": "ground"},
        "nodes.p": {"type": "terminal"},
        "links.generator": generator,
        "links.load": two_port("resistor", "p", "gnd", resistance=0.15),
    }
    speeds = []
    for parts in (brake, load):
        raw = fvsolve.load("hydropower").raw
        for key, part in parts.items():
            group, _, other = key.partition(".")
            raw[group][other] = part
        raw["links"][name].pop("trip", None)
        raw["links"][name]["hill_chart"] = {"file": str(CASES / "hydropower.csv")}
        raw = {
            key: value
            for key, value in raw.items()
            if key not in ("expect", "compare", "exact", "limits")
        }
        raw["numerics"]["end"] = 5.0
        raw["output"] = {"every": 0.1, "probes": [f"{shaft}.speed"]}
        run = fvsolve.run(raw)
        assert run.ok
        speeds.append(np.array(run[f"{shaft}.speed"]))
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-9) and np.ptp(speeds[0]) > 0.1


def speed_loop(**control):
    case = motor()
    case["links"]["supply"]["voltage"] = {"control": "drive"}
    case["nodes"]["axle"].pop("initial_speed")
    case["links"]["motor"].pop("initial_current")
    case["controls"] = {
        "drive": {
            "type": "pi",
            "input": "axle.speed",
            "setpoint": jump(50.0, 60.0, 0.1),
            "gain": 0.1,
            "integral_time": 0.05,
            **control,
        }
    }
    case["output"]["probes"] = ["axle.speed", "motor.current", "controls.drive.output"]
    return case


@pytest.mark.parametrize("method", METHODS)
def test_a_speed_loop_starts_balanced_and_moves_as_its_closed_form(method):
    run = runs(speed_loop(), method)
    closed = np.zeros((3, 3))
    closed[:2, :2] = MOTOR
    closed[0] += np.array([0.0, -0.1, 1.0]) / 2e-3
    closed[2] = [0.0, -0.1 / 0.05, 0.0]
    drive = np.array([0.1 / 2e-3, 0.0, 0.1 / 0.05]) * 10.0
    for t, speed in zip(run.t, run["axle.speed"], strict=True):
        moved = np.linalg.solve(closed, (expm(closed * max(t - 0.1, 0.0)) - np.eye(3)) @ drive)
        assert speed == pytest.approx(50.0 + moved[1], abs=60.0 * EXACT)
    assert set(np.array(run["axle.speed"])[np.array(run.t) < 0.1]) == {run["axle.speed"][0]}


def test_the_loop_of_a_motor_has_its_closed_return_ratio():
    found = loop(speed_loop(), "drive")
    s = 1j * found.frequency
    exact = 0.1 * (1.0 + 1.0 / (0.05 * s)) * 0.12 / ((2e-3 * s + 0.8) * (3e-3 * s + 1e-3) + 0.12**2)
    assert np.abs(found.ratio / exact - 1.0).max() < 1e-7 and found.stable


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-5p"])
def test_a_thermostat_switches_at_the_times_of_the_closed_form(method):
    nodes = GROUND | {
        "a": {"type": "terminal"},
        "b": {"type": "terminal"},
        "body": {"type": "heat-capacity", "heat_capacity": 100.0, "initial_temperature": 300.0},
        "room": {"type": "ambient", "temperature": 290.0},
    }
    links = {
        "source": two_port("voltage-source", "gnd", "a", voltage=20.0),
        "switch": two_port("switch", "a", "b", closed={"control": "thermostat"}, resistance=1e-3),
        "heater": two_port("resistor", "b", "gnd", resistance=3.999, heat_to="body"),
        "air": two_port("thermal-conductor", "body", "room", conductance=2.0),
    }
    thermostat = {
        "type": "relay",
        "input": "body.temperature",
        "on": 305.0,
        "off": 315.0,
        "initial": 1,
    }
    case = network(nodes, links, 200.0, ["body.temperature"], controls={"thermostat": thermostat})
    run = runs(case, method, **{"numerics.rtol": 1e-10})
    high = 290.0 + 5.0**2 * 3.999 / 2.0
    heats = 50.0 * np.log((high - 300.0) / (high - 315.0))
    cools, again = 50.0 * np.log(25.0 / 15.0), 50.0 * np.log((high - 305.0) / (high - 315.0))
    times = [
        event["time"] for event in run.summary["events"] if event["name"] == "controls.thermostat"
    ]
    assert times[:3] == pytest.approx(
        [heats, heats + cools, heats + cools + again], abs=200.0 * EXACT
    )


def test_a_block_that_follows_a_circuit_at_once_needs_a_filter():
    case = resonant()
    case["links"]["source"]["voltage"] = {"control": "act"}
    case["controls"] = {
        "act": {
            "type": "function",
            "inputs": {"u": "coil.voltage"},
            "formula": "5 - 0.1*u",
            "unit": "V",
        }
    }
    with pytest.raises(CaseError, match="a loop without a state; give .controls.act. a `filter`"):
        fvsolve.build(fvsolve.load(case))
    case["controls"]["act"]["filter"] = 1e-3
    assert runs(case).ok


# start, faults, other programs --------------------------------------------------------------------------------------


def test_a_run_with_switches_resumes_to_the_bit(tmp_path):
    case = rectifier(True)
    case["numerics"] |= {"end": 1.0, "method": "dormand-prince", "rtol": 1e-9}
    case["output"]["every"] = 2e-4
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 0.4))


def test_advance_in_parts_retains_clutch_and_inputs():
    model = fvsolve.build(fvsolve.load(clutched(numerics={"method": "dormand-prince"})))
    state = fvsolve.initial_state(model)
    for k in range(8):
        state = fvsolve.advance(model, state, 0.5 * (k + 1))
    speeds = dict(zip([probe.text for probe in model.probes], model.observe(state), strict=True))
    assert speeds["a.speed"] == pytest.approx(4.0, abs=1e-8) and speeds["clutch.locked"] == 1.0
    state = fvsolve.advance(model, state, 5.0, {"clutch.torque": 0.0, "drive.torque": 1.0})
    speeds = dict(zip([probe.text for probe in model.probes], model.observe(state), strict=True))
    with pytest.raises(FvsolveError, match="at least 0"):
        fvsolve.advance(model, state, 5.5, {"clutch.torque": -3.0})
    assert speeds["a.speed"] == pytest.approx(4.5, abs=1e-8) and speeds["b.speed"] == pytest.approx(
        4.0, abs=1e-8
    )


FAULTS = [
    (
        {"links.store": two_port("capacitor", "a", "gnd", capacitance=C)},
        "links.store",
        "lies on the source",
    ),
    (
        {"links.other": two_port("voltage-source", "gnd", "a", voltage=5.0)},
        "links.",
        "contradict each other",
    ),
    ({"links.resistor.resistance": 0.0}, "links.resistor.resistance", "above 0"),
    ({"links.resistor.heat_to": "oven"}, "links.resistor.heat_to", "no thermal node"),
    ({"links.coil.inductance": "3 ohm"}, "links.coil.inductance", "an inductance"),
    ({"links.coil.to": "gnd2"}, "links.coil.to", "no place named"),
]


@pytest.mark.parametrize(("change", "place", "text"), FAULTS)
def test_faults_of_circuits_are_named(change, place, text):
    case = resonant()
    for key, value in change.items():
        table, keys = case, key.split(".")
        for part in keys[:-1]:
            table = table[part]
        table[keys[-1]] = value
    with pytest.raises(CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert text in str(error.value) and place in str(error.value)


def test_floating_and_tied_networks_are_refused_by_name():
    loose = resonant()
    loose["nodes"]["gnd"] = {"type": "terminal"}
    with pytest.raises(CaseError, match="nothing determines"):
        fvsolve.build(fvsolve.load(loose))
    tied = shafts(
        {"gear": two_port("gear", "a", "b", ratio=5.0)},
        ["a.speed"],
        {"initial_speed": 10.0},
        {"initial_speed": 3.0},
    )
    with pytest.raises(CaseError, match="contradicts"):
        fvsolve.build(fvsolve.load(tied))
    driven = shafts({"gear": two_port("gear", "a", "frame", ratio=2.0)}, ["a.speed"])
    driven["nodes"]["frame"]["speed"] = {"formula": "t", "unit": "rad/s"}
    with pytest.raises(CaseError, match="lies on the source frame"):
        fvsolve.build(fvsolve.load(driven))
    pushed = shafts({"drive": {"type": "torque", "to": "a", "torque": 1.0}}, ["a.speed"])
    pushed["nodes"]["a"].pop("initial_speed")
    with pytest.raises(CaseError, match="no equilibrium of a.speed"):
        fvsolve.build(fvsolve.load(pushed))
    massless = clutched()
    massless["nodes"]["b"] = {"type": "shaft"}
    with pytest.raises(CaseError, match="give the shafts at both ends an `inertia`"):
        fvsolve.build(fvsolve.load(massless))
    with pytest.raises(CaseError, match="a rotational place"):
        fvsolve.load(resonant() | {"nodes": resonant()["nodes"] | {"a": {"type": "shaft"}}})


def part(kind, **keys):
    return {"type": kind, **keys}


def test_a_port_of_a_wrong_domain_is_the_only_fault():
    links = {
        "m": {
            "type": "dc-motor",
            "ports": {"p": "a", "n": "gnd", "shaft": "gnd"},
            "torque_constant": 0.1,
            "resistance": 1,
        },
        "E": two_port("voltage-source", "gnd", "a", voltage=12),
    }
    nodes = {"gnd": part("ground"), "a": part("terminal")}
    with pytest.raises(CaseError, match="needs a rotational place") as error:
        fvsolve.load({"nodes": nodes, "links": links, "numerics": {"end": 1.0}})
    assert len(error.value.faults) == 1


MANY = {
    "nodes": {
        "gnd": part("ground"),
        "a": part("terminal"),
        "b": part("terminal"),
        "c": part("terminal"),
        "s": part("shaft"),
        "h": part("housing"),
        "h2": part("housing", speed=10.0),
        "s1": part("shaft", inertia=1, initial_speed=3),
        "s2": part("shaft", inertia=1, initial_speed=3),
    },
    "links": {
        "E": two_port("voltage-source", "gnd", "a", voltage=12),
        "E2": two_port("voltage-source", "gnd", "a", voltage=24),
        "C": two_port("capacitor", "a", "gnd", capacitance=1e-3),
        "R": two_port("resistor", "b", "c", resistance=10),
        "C2": two_port("capacitor", "b", "c", capacitance=1e-3),
        "T": part("torque", to="s", torque=3),
        "T2": part("torque", to="h", torque=3),
        "G2": two_port("gear", "h", "h2", ratio=2),
        "G": two_port("gear", "s1", "s2", ratio=2),
    },
    "numerics": {"end": 1.0},
}
TEXTS = {
    "links.E": "the voltages of E, E2 contradict each other; put a resistor between them",
    "links.C": "lies on the source E, which gives its voltage; put a resistor between them",
    "links.R": "nothing determines the voltage or current of C2, R; join a ground",
    "links.T": "its torque has no way: nothing at s takes it; give a shaft an `inertia`, or join a bearing",
    "links.T2": "its torque acts on housing h, whose speed is given; join another place",
    "links.G2": "its law contradicts the given speed of h2, and nothing can give way; put a bearing between them, or "
    "leave it out",
    "nodes.s2.initial_speed": "3 rad/s at the start contradicts s1, to which it is tied; expected 1.5 rad/s",
}


def test_independent_faults_of_networks_come_at_once_in_the_words_of_their_domains():
    with pytest.raises(CaseError) as error:
        fvsolve.build(fvsolve.load(MANY))
    assert {fault.place: fault.message for fault in error.value.faults} == TEXTS


def test_independent_faults_of_the_start_of_a_network_come_at_once():
    hot = {name: part("heat-capacity", heat_capacity=3) for name in ("p", "q", "r")}
    links = {
        "P": part("heat-source", to="p", heat=3),
        "Q": part("heat-source", to="q", heat=3),
        "L": two_port("thermal-conductor", "q", "r", conductance=2),
        "G": MANY["links"]["G"],
        "C": two_port("capacitor", "a", "gnd", capacitance=1, initial_voltage=3),
        "C2": two_port("capacitor", "gnd", "a", capacitance=2, initial_voltage=-5),
    }
    nodes = hot | {name: MANY["nodes"][name] for name in ("s1", "s2", "gnd", "a")}
    with pytest.raises(CaseError) as error:
        fvsolve.build(fvsolve.load({"nodes": nodes, "links": links, "numerics": {"end": 1.0}}))
    found = {fault.place: fault.message for fault in error.value.faults}
    assert found.keys() == {
        "nodes.p",
        "nodes.q",
        "nodes.s2.initial_speed",
        "links.C.initial_voltage",
    }
    assert (
        "expected 5 V" in found["links.C.initial_voltage"]
        and "q.temperature, r.temperature" in found["nodes.q"]
    )
