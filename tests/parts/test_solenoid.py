"""Solenoids against closed forms, SciPy on equations written by hand, and restatements."""

import functools
from copy import deepcopy
from dataclasses import dataclass
from math import pi

import numpy as np
import pytest
from reference.element_networks import GROUND, network, runs, two_port
from reference.jacobians import stray
from reference.resumed_runs import killed_and_resumed, same_files
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.parts.network_elements import network_of
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise

EXACT = 1e-9
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]
MU_0 = 4e-7 * pi
COIL = {
    "type": "solenoid",
    "ports": {"p": "b", "n": "gnd", "armature": "plunger"},
    "turns": 800.0,
    "pole_area": 8e-5,
    "closed_position": 3e-3,
    "core_reluctance": 4e6,
}
OHM, VOLT = 12.0, 24.0


def coil(end=0.05, nodes=None, links=None, probes=None, voltage=VOLT, **keys):
    """Coil with a resistor on a source; its armature is fixed if `nodes` names no other."""
    nodes = (
        GROUND
        | {"a": {"type": "terminal"}, "b": {"type": "terminal"}}
        | (nodes or {"plunger": {"type": "frame"}})
    )
    links = {
        "supply": two_port("voltage-source", "gnd", "a", voltage=voltage),
        "wire": two_port("resistor", "a", "b", resistance=OHM),
        "coil": COIL | keys,
    } | (links or {})
    return deepcopy(
        network(nodes, links, end, probes or ["coil.current", "coil.flux", "coil.force"])
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_current_of_a_locked_armature_is_that_of_a_coil_with_a_resistor(method):
    run = runs(coil(initial_flux=0.0), method)
    reluctance = COIL["core_reluctance"] + 3e-3 / (MU_0 * COIL["pole_area"])
    inductance = COIL["turns"] ** 2 / reluctance
    current = VOLT / OHM * (1.0 - np.exp(-OHM / inductance * np.array(run.t)))
    flux = COIL["turns"] * current / reluctance
    assert np.array(run["coil.current"]) == pytest.approx(current, abs=2.0 * EXACT)
    assert np.array(run["coil.flux"]) == pytest.approx(flux, abs=flux[-1] * EXACT)
    force = flux**2 / (2.0 * MU_0 * COIL["pole_area"])
    assert np.array(run["coil.force"]) == pytest.approx(force, abs=2.0 * force[-1] * EXACT)


MOVING = {
    "plunger": {"type": "mass", "mass": 0.02, "initial_position": -1e-6},
    "wall": {"type": "frame"},
    "base": {"type": "frame", "initial_position": -0.01},
}
PULLED = {
    "spring": two_port("spring", "base", "plunger", stiffness=900.0, preload=-4.0),
    "stop": two_port(
        "end-stop", "wall", "plunger", stiffness=4e6, damping=120.0, minimum=0.0, maximum=2.8e-3
    ),
    "oil": two_port("damper", "wall", "plunger", damping=2.0),
}
SATURATION = 1.5e-4


def moving(end=0.06, **keys):
    """Armature with a spring and stops: it closes when the voltage comes, and opens when it goes."""
    voltage = {"time": [0.0, 0.005, 0.035], "value": [0.0, VOLT, 0.0], "kind": "step"}
    return coil(
        end,
        MOVING,
        PULLED,
        ["coil.current", "coil.flux", "coil.force", "plunger.position", "stop.force"],
        voltage,
        saturation_flux=SATURATION,
        **keys,
    )


@dataclass(frozen=True)
class Armature:
    """Armature with a coil, spring, damper and two stops, in SI units: equations written by hand, for SciPy.

    voltages : (time until which it holds [s], function of the current that gives the voltage at the coil [V])
    """

    voltages: tuple
    turns: float = 800.0
    area: float = 8e-5
    closed: float = 3e-3
    core: float = 4e6
    saturation: float = SATURATION
    mass: float = 0.02
    spring: float = 900.0
    preload: float = 4.0
    stop: float = 4e6
    stop_damping: float = 120.0
    travel: float = 2.8e-3
    damping: float = 2.0

    def current(self, flux, x):
        core = self.core * (1.0 + (flux / self.saturation) ** 2)
        return (core + abs(self.closed - x) / (MU_0 * self.area)) * flux / self.turns

    def rates(self, t, y, voltage, touched):
        """Rates of flux [Wb], position [m] and velocity [m/s]; touched : -1 or 1 on the lower or upper stop, else 0."""
        flux, x, v = y
        force = -self.spring * (x - self.start) - self.preload - self.damping * v
        force += np.sign(self.closed - x) * 0.5 * flux**2 / (MU_0 * self.area)
        if touched == -1:
            force += max(0.0, -self.stop * x - self.stop_damping * v)
        elif touched == 1:
            force -= max(0.0, self.stop * (x - self.travel) + self.stop_damping * v)
        return [voltage(self.current(flux, x)) / self.turns, v, force / self.mass]

    @property
    def start(self):
        """Position at the start, on the lower stop [m]."""
        return -self.preload / self.stop

    @functools.cache  # noqa: B019
    def pieces(self):
        """(first time, last time, dense output) of each piece between events."""

        def end(limit, direction):
            def left(t, y, *_):
                return y[1] - limit

            left.terminal, left.direction = True, direction
            return left

        t, y, found = 0.0, np.array([0.0, self.start, 0.0]), []
        touched = -1
        for high, voltage in self.voltages:
            while t < high:
                ends = {
                    -1: [end(0.0, 1)],
                    0: [end(0.0, -1), end(self.travel, 1)],
                    1: [end(self.travel, -1)],
                }[touched]
                run = solve_ivp(
                    self.rates,
                    (t, high),
                    y,
                    "DOP853",
                    args=(voltage, touched),
                    events=ends,
                    rtol=1e-12,
                    atol=[1e-18, 1e-16, 1e-13],
                    dense_output=True,
                    max_step=1e-4,
                )
                found.append((t, run.t[-1], run.sol))
                t, y = run.t[-1], run.y[:, -1]
                if run.status == 1:
                    touched = 0 if touched else -1 if len(run.t_events[0]) else 1
        return found

    def at(self, times):
        """(flux, position, velocity) at times : float64[3, n]."""
        found = np.empty((3, len(times)))
        for low, high, solution in self.pieces():
            inside = (times >= low) & (times <= high)
            if inside.any():
                found[:, inside] = solution(times[inside])
        return found

    def crossings(self, place):
        """Times at which the armature passes a position [s]."""
        found = []
        for low, high, solution in self.pieces():
            t = np.linspace(low, high, 2000)
            x = solution(t)[1] - place
            x[np.abs(x) < 1e-13] = 0.0  # a piece begins or ends there
            found += [low] if x[0] == 0.0 else []
            found += [
                brentq(lambda t: solution(t)[1] - place, *t[k : k + 2], xtol=1e-16)  # noqa: B023
                for k in np.flatnonzero(x[:-1] * x[1:] < 0.0)
            ]
        return found


PULSED = Armature(
    ((0.005, lambda i: -OHM * i), (0.035, lambda i: VOLT - OHM * i), (0.06, lambda i: -OHM * i))
)


@pytest.mark.parametrize("method", METHODS)
def test_an_armature_closes_and_opens_as_that_of_scipy(method):
    run = runs(moving(), method)
    flux, x, _ = PULSED.at(np.array(run.t))
    current = PULSED.current(flux, x)
    assert x.max() > 2.8e-3 and abs(x[-1]) < 3e-5
    for name, exact in (("coil.flux", flux), ("plunger.position", x), ("coil.current", current)):
        assert np.array(run[name]) == pytest.approx(exact, abs=EXACT * np.abs(exact).max()), name


def reluctance(flux, x):
    core = COIL["core_reluctance"] * (1.0 + (flux / SATURATION) ** 2)
    return core + abs(COIL["closed_position"] - x) / (MU_0 * COIL["pole_area"])


@pytest.mark.parametrize("x", [1e-3, 3.5e-3])
def test_the_force_is_the_slope_of_the_coenergy(x):
    """Coenergy, the integral of the flux linkage over the current, at equal currents on both sides of the position."""
    frame = {"plunger": {"type": "frame", "initial_position": x}}
    run = runs(coil(1e-3, frame, saturation_flux=SATURATION))
    current, turns = VOLT / OHM, COIL["turns"]
    assert run["coil.current"][0] == pytest.approx(current, rel=1e-12)

    def coenergy(place):
        flux = brentq(lambda f: reluctance(f, place) * f / turns - current, 0.0, 1e-3, xtol=1e-20)
        energy = quad(lambda f: reluctance(f, place) * f, 0.0, flux, epsrel=1e-13)[0]
        return current * turns * flux - energy

    step = 1e-6
    slope = (coenergy(x + step) - coenergy(x - step)) / (2.0 * step)
    assert run["coil.force"][0] == pytest.approx(slope, rel=1e-6)
    assert np.sign(run["coil.force"][0]) == np.sign(COIL["closed_position"] - x)


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
@pytest.mark.parametrize("begins", [0.0, 1e-4, 4e-3])
@pytest.mark.parametrize("saturation", [None, 2e-5])
def test_an_equilibrium_start_balances_spring_and_coil(saturation, begins, method):
    """k x = Phi^2 / (2 mu0 A) with the flux of the steady current, from either side of the closed position."""
    nodes = {
        "plunger": {"type": "mass", "mass": 0.02, "initial_position": begins},
        "wall": {"type": "frame"},
        "weight": {"type": "mass", "mass": 0.5, "initial_position": 0.1},
    }
    links = {
        "spring": two_port("spring", "wall", "plunger", stiffness=4e4),
        "rod": two_port("spring", "plunger", "weight", stiffness=1e5, preload=-3.0),
        "push": {"type": "force", "to": "weight", "force": 3.0},
    }
    keys = {} if saturation is None else {"saturation_flux": saturation}
    case = coil(0.1, nodes, links, ["plunger.position", "weight.position", "coil.force"], **keys)
    case["numerics"]["initial"] = "equilibrium"
    run, current = runs(case, method), VOLT / OHM

    def pull(x):
        gap, core = (3e-3 - x) / (MU_0 * COIL["pole_area"]), COIL["core_reluctance"]
        share = 0.0 if saturation is None else saturation**-2

        def law(flux):
            return (core * (1.0 + share * flux * flux) + gap) * flux - COIL["turns"] * current

        return brentq(law, 0.0, 1e-3, xtol=1e-20, rtol=1e-14) ** 2 / (
            2.0 * MU_0 * COIL["pole_area"]
        )

    place = brentq(lambda x: 4e4 * x - 3.0 - pull(x), 0.0, 1e-3, xtol=1e-18)
    for probe, value in (("plunger.position", place), ("weight.position", place + 0.1 - begins)):
        assert np.ptp(run[probe]) < 1e-15 and run[probe][0] == pytest.approx(value, rel=1e-9)
    assert run["coil.force"][0] == pytest.approx(4e4 * place - 3.0, rel=1e-9)


@pytest.mark.parametrize(("share", "holds"), [(1.001, True), (0.999, False)])
def test_a_closed_armature_is_held_down_to_its_holding_current(share, holds):
    """The spring pulls with 4 N + 900 N/m x; the flux for this force needs a current, and that a voltage."""
    place = 2.8e-3
    pull = 4.0 + 900.0 * (place + 1e-6)
    flux = np.sqrt(2.0 * pull * MU_0 * COIL["pole_area"])
    voltage = share * OHM * reluctance(flux, place) * flux / COIL["turns"]
    case = moving(0.5)
    case["links"]["supply"]["voltage"] = float(voltage)
    case["nodes"]["plunger"]["initial_position"] = place
    case["links"]["spring"] = case["links"]["spring"] | {"preload": -pull}
    run = runs(case)
    assert (run["plunger.position"][-1] > 2.79e-3) == holds
    assert holds or run["plunger.position"][-1] < 1e-5


def resting():
    """Closed armature that rests on its stop, with the current of equilibrium."""
    case = moving(0.2)
    case["links"]["supply"]["voltage"] = VOLT
    case["numerics"]["initial"] = "steady"
    x = 2.8e-3
    for _ in range(50):
        flux = brentq(
            lambda f, x=x: reluctance(f, x) * f / COIL["turns"] - VOLT / OHM, 0.0, 1e-3, xtol=1e-22
        )
        force = 0.5 * flux**2 / (MU_0 * COIL["pole_area"])
        x = 2.8e-3 + (force - 10.0) / 4e6
    case["nodes"]["plunger"]["initial_position"] = float(x)
    case["links"]["spring"] = case["links"]["spring"] | {"preload": -10.0}
    return case


@pytest.mark.parametrize("method", METHODS)
def test_a_coil_at_rest_does_not_move_by_a_bit(method):
    case = coil(0.5, saturation_flux=SATURATION)
    run = runs(case, method)
    for name in ("coil.current", "coil.flux", "coil.force"):
        assert len(set(run[name])) == 1
    run = runs(resting(), method)
    assert len(set(run["plunger.position"])) == len(set(run["coil.current"])) == 1
    assert run["coil.current"][-1] == pytest.approx(VOLT / OHM, rel=1e-12)


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
def test_the_energy_of_a_moving_armature_closes(method):
    case = moving()
    case["numerics"] |= {"method": method, "rtol": 1e-9}
    found = energy(case)
    assert abs(found.remainder[-1]) < 1e-9 * found.throughput
    assert found.supplied["supply"][-1] > 0.0 and found.stored["coil"].max() > 1e-3


def restated():
    case = moving()
    links = case["links"]
    yield (
        "order",
        case
        | {"links": dict(reversed(links.items())), "nodes": dict(reversed(case["nodes"].items()))},
        1,
        1,
    )
    turned = links["coil"] | {"ports": {"p": "gnd", "n": "b", "armature": "plunger"}}
    yield "terminals", case | {"links": links | {"coil": turned}}, -1, 1
    units = links["coil"] | {
        "pole_area": "80 mm2",
        "closed_position": "3 mm",
        "core_reluctance": "4e6 A/Wb",
        "saturation_flux": "0.15 mWb",
    }
    yield "units", case | {"links": links | {"coil": units}}, 1, 1
    nodes = case["nodes"] | {
        "plunger": {"type": "mass", "mass": 0.02, "initial_position": 1e-6},
        "base": {"type": "frame", "initial_position": 0.01},
    }
    mirrored = links | {
        "coil": links["coil"] | {"closed_position": -3e-3},
        "spring": two_port("spring", "plunger", "base", stiffness=900.0, preload=-4.0),
        "stop": two_port(
            "end-stop", "plunger", "wall", stiffness=4e6, damping=120.0, minimum=0.0, maximum=2.8e-3
        ),
    }
    yield "mirrored", case | {"nodes": nodes, "links": mirrored}, 1, -1


@pytest.mark.parametrize(("what", "case", "flux", "place"), list(restated()))
def test_restated_solenoids_move_alike(what, case, flux, place):
    one, other = runs(moving(), "rodas-5p"), runs(case, "rodas-5p")
    for probe, sign in (
        ("coil.current", flux),
        ("coil.flux", flux),
        ("plunger.position", place),
        ("coil.force", place),
    ):
        exact = sign * np.array(one[probe])
        assert np.array(other[probe]) == pytest.approx(exact, abs=1e-9 * np.abs(exact).max()), probe


def switched(diode=True, forward=0.7):
    """Coil with a switch that opens at 20 ms and closes again at 60 ms, and a diode beside it."""
    links = {
        "switch": two_port(
            "switch",
            "b",
            "c",
            closed={"time": [0.0, 0.02, 0.06], "value": [1.0, 0.0, 1.0], "kind": "step"},
        ),
        "coil": COIL | {"ports": {"p": "c", "n": "gnd", "armature": "plunger"}},
    }
    if diode:
        links["diode"] = two_port("diode", "gnd", "c", forward_voltage=forward)
    nodes = {"plunger": {"type": "frame"}, "c": {"type": "terminal"}}
    case = coil(
        0.08, nodes, links, ["coil.current", "diode.current"] if diode else ["coil.current"]
    )
    case["links"]["coil"]["initial_flux"] = 0.0
    return case


@pytest.mark.parametrize("method", METHODS)
def test_a_diode_takes_the_current_of_an_opened_coil_until_it_is_zero(method):
    """Linear coil: it charges, then i' = -(forward + r i) / L through the diode; then the circuit is open."""
    run = runs(switched(forward=5.0), method)
    inductance = COIL["turns"] ** 2 / (COIL["core_reluctance"] + 3e-3 / (MU_0 * COIL["pole_area"]))
    contact, t = 1e-3, np.array(run.t)
    ohm = OHM + contact
    top = VOLT / ohm * (1.0 - np.exp(-ohm / inductance * 0.02))
    end = 0.02 + inductance / contact * np.log1p(contact * top / 5.0)
    down = (top + 5.0 / contact) * np.exp(-contact / inductance * (t - 0.02)) - 5.0 / contact
    exact = np.where(
        t < 0.02, VOLT / ohm * (1.0 - np.exp(-ohm / inductance * t)), np.where(t < end, down, 0.0)
    )
    exact = np.where(t > 0.06, VOLT / ohm * (1.0 - np.exp(-ohm / inductance * (t - 0.06))), exact)
    assert np.array(run["coil.current"]) == pytest.approx(exact, abs=4.0 * EXACT)
    events = [(event["name"], event["what"]) for event in run.summary["events"]]
    assert events == [
        ("switch", "opens"),
        ("diode", "conducts"),
        ("diode", "blocks"),
        ("switch", "closes"),
    ]
    assert run.summary["events"][2]["time"] == pytest.approx(end, abs=0.08 * EXACT)


def test_a_switch_that_would_cut_the_current_of_a_coil_ends_the_run_by_name():
    run = fvsolve.run(switched(diode=False), {"numerics.method": "dormand-prince"})
    assert (
        not run.ok
        and "switch would cut the current of coil" in run.reason
        and "diode" in run.reason
    )


def test_an_armature_may_pass_its_closed_position():
    """Without a stop it swings about the closed position, towards which the force acts on either side."""
    case = coil(0.02, {"plunger": {"type": "mass", "mass": 0.02}}, initial_flux=1e-4)
    case["output"]["probes"] = ["plunger.position", "coil.force"]
    run = runs(case)
    x, force = np.array(run["plunger.position"]), np.array(run["coil.force"])
    assert x.max() > 4e-3 and np.all(np.sign(force) == np.sign(3e-3 - x))
    assert {event["what"] for event in run.summary["events"]} == {"passes its closed position"}
    found = energy(case)
    assert abs(found.remainder[-1]) < 1e-9 * found.throughput


def test_the_rates_of_a_coil_at_rest_are_exact():
    found = linearise(coil(), ["supply.voltage"])
    inductance = COIL["turns"] ** 2 / (COIL["core_reluctance"] + 3e-3 / (MU_0 * COIL["pole_area"]))
    assert found.a == pytest.approx(np.array([[-OHM / inductance]]), rel=1e-9)
    assert found.b == pytest.approx(np.array([[1.0]]), rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_control_of_the_current_reaches_its_setpoint(method):
    case = coil(0.2, initial_flux=0.0, saturation_flux=SATURATION)
    case["links"]["supply"]["voltage"] = {"control": "pi"}
    case["controls"] = {
        "pi": {
            "type": "pi",
            "input": "coil.current",
            "setpoint": "0.5 A",
            "gain": "20 V/A",
            "integral_time": "10 ms",
            "initial": 0.0,
        }
    }
    assert runs(case, method)["coil.current"][-1] == pytest.approx(0.5, abs=1e-5)


def test_motions_at_the_start_and_states_are_named():
    model = fvsolve.build(fvsolve.load(coil(initial_flux=2e-5)))
    assert model.steady["moving"][0].startswith("coil.flux changes by 0.0173")
    assert network_of(model).facts()["states"] == ["coil.flux"]


def test_a_run_with_a_solenoid_resumes_to_the_bit(tmp_path):
    case = moving(0.3)
    case["numerics"] |= {"rtol": 1e-9, "method": "dormand-prince"}
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 0.1))


def test_solenoids_keep_to_their_pattern():
    for case in (moving(), switched()):
        model = fvsolve.build(fvsolve.load(case))
        state = model.scale * np.random.default_rng(1).normal(scale=0.1, size=model.y_size)
        assert stray(model, 0.006, state) < 1e-7


FAULTS = [
    ({"links.coil.turns": 0.0}, "links.coil.turns", "above 0"),
    ({"links.coil.pole_area": "-1 cm2"}, "links.coil.pole_area", "above 0"),
    ({"links.coil.core_reluctance": 0.0}, "links.coil.core_reluctance", "above 0"),
    ({"links.coil.saturation_flux": "0 Wb"}, "links.coil.saturation_flux", "above 0"),
    ({"links.coil.core_reluctance": "4e6 H"}, "links.coil.core_reluctance", "a reluctance"),
    (
        {"links.coil.ports": {"p": "plunger", "n": "gnd", "armature": "plunger"}},
        "links.coil.ports.p",
        "electrical place",
    ),
    (
        {"links.coil.ports": {"p": "b", "n": "gnd", "armature": "a"}},
        "links.coil.ports.armature",
        "translational place",
    ),
    ({"links.coil.turn": 3.0}, "links.coil.turn", "did you mean"),
    (
        {"links.wire": two_port("inductor", "a", "b", inductance=1e-3)},
        "links.coil",
        "its flux gives the current, and wire in series gives a current too; put a resistor in parallel",
    ),
    (
        {"links.wire": two_port("current-source", "a", "b", current=1.0)},
        "links.coil",
        "wire in series",
    ),
    (
        {"links.wire": two_port("switch", "a", "b", closed=0.0), "links.coil.initial_flux": 1e-4},
        "links.coil",
        "its current at the start has no way",
    ),
]


@pytest.mark.parametrize(("change", "place", "text"), FAULTS)
def test_faults_of_solenoids_are_named(change, place, text):
    case = coil()
    for key, value in change.items():
        table, keys = case, key.split(".")
        for part in keys[:-1]:
            table = table[part]
        table[keys[-1]] = value
    with pytest.raises(CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert text in str(error.value) and place in str(error.value)


def test_a_coil_without_resistance_needs_its_flux():
    case = coil()
    case["links"]["wire"]["resistance"] = 1.0
    case["links"] = {key: case["links"][key] for key in ("supply", "coil")}
    case["links"]["coil"] = case["links"]["coil"] | {
        "ports": {"p": "a", "n": "gnd", "armature": "plunger"}
    }
    case["nodes"].pop("b")
    with pytest.raises(CaseError, match="no equilibrium of coil.flux"):
        fvsolve.build(fvsolve.load(case))


def test_the_shipped_valve_opens_and_closes_at_the_times_of_scipy():
    """The opening of the valve leaves 0 where the armature passes 0.2 mm, and reaches 1 at 2 mm."""
    valve = Armature(
        (
            (0.01, lambda i: -30.0 * i),
            (0.06, lambda i: 24.0 - 30.001 * i),
            (0.08, lambda i: -0.7 - 30.05 * i),
        ),
        turns=1200.0,
        area=1.2e-4,
        closed=2.2e-3,
        core=3e6,
        saturation=2e-4,
        mass=8e-3,
        spring=1500.0,
        preload=5.0,
        stop=2e6,
        stop_damping=60.0,
        travel=2e-3,
        damping=1.0,
    )
    run = fvsolve.run("solenoid-valve", {"numerics.rtol": 1e-12, "expect": {}, "output.units": {}})
    events = [
        (event["time"], event["what"])
        for event in run.summary["events"]
        if event["name"] == "controls.lift"
    ]
    seat = [t for t, what in events if "lower" in what]
    full = [t for t, what in events if "upper" in what]
    assert seat == pytest.approx(valve.crossings(2e-4), abs=0.12 * EXACT)
    assert full == pytest.approx(valve.crossings(2e-3), abs=0.12 * EXACT)
    t = np.array(run.t)
    inside = (t > 0.0) & (t < 0.08)
    flux, x, _ = valve.at(t[inside])
    assert np.array(run["armature.position"])[inside] == pytest.approx(x, abs=2e-3 * EXACT)
    assert np.array(run["coil.current"])[inside] == pytest.approx(valve.current(flux, x), abs=EXACT)
    print(
        "delays [ms]",
        [round(1e3 * (t - 0.01), 4) for t in (seat[0], full[0])],
        [round(1e3 * (t - 0.06), 4) for t in (full[-1], seat[3])],
    )
