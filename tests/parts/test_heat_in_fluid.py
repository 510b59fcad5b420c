"""Heat in the fluid: dissipation as a source of its temperature, heat exchangers, viscosity by temperature."""

import copy
import math

import numpy as np
import pytest
from pytest import approx
from reference.heated_fluid import CP, METHODS, OIL, ZERO, heated
from reference.jacobians import random_state, stray
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    area,
    chamber,
    junction,
    pipe,
    reservoir,
    tank,
    valve,
)
from scipy.linalg import expm

import fvsolve
from fvsolve.core.fluid import specific_heat
from fvsolve.studies.energy_balance import energy

LAWS = ["linear", "log", "table", "mixture"]
VG46 = [["40 degC", "46 cSt"], ["100 degC", "6.76 cSt"]]


def unit(links=None, nodes=None, **more) -> dict:
    """Pump that circulates oil through a throttle into a closed tank; further links and nodes."""
    own = {
        "pump": {
            "type": "pump",
            "from": "sump",
            "to": "high",
            "curve": {"flow": [0.0, 1e-3], "head": [2e3, 1e3]},
        },
        "throttle": valve("high", "sump", 4e-6),
    }
    places = {"sump": chamber(0.1, AMBIENT), "high": junction()}
    case = {
        "probes": ["sump.temperature", "high.temperature", "throttle.flow"],
        "heat_from": ["throttle"],
        "end": 1e3,
    }
    case |= more
    return heated(places | (nodes or {}), own | (links or {}), case.pop("end"), **case)


MASS = 0.1 * RHO  # of the oil in the sump [kg]


def throttled() -> tuple[float, float]:
    """(flow [m3/s], power [W]) of the throttle in `unit`, from the linear head curve and the square-root law."""
    a, weight = RHO / (2.0 * 4e-6**2), RHO * GRAVITY
    slope = weight * 1e6  # fall of the pressure per flow
    flow = (-slope + math.sqrt(slope**2 + 4.0 * a * weight * 2e3)) / (2.0 * a)
    return flow, a * flow**3


@pytest.mark.parametrize("numerics", METHODS, ids=lambda item: item["method"])
def test_a_throttle_heats_the_oil_by_its_power(numerics):
    flow, power = throttled()
    result = fvsolve.run(unit(numerics=numerics))
    assert result["throttle.flow"][-1] == approx(flow, rel=1e-12)
    assert np.array(result["sump.temperature"]) - 40.0 == approx(
        power * np.array(result.t) / (MASS * CP), rel=1e-9
    )
    book = result.ledger["temperature"]
    assert book["relative"] < 1e-14
    assert book["heat"] == approx({"throttle": 1e3 * power}, rel=1e-9)
    assert book["heated"] == approx(1e3 * power / CP, rel=1e-9)


@pytest.mark.in_turn
@pytest.mark.parametrize("numerics", METHODS, ids=lambda item: item["method"])
@pytest.mark.parametrize(
    "cooler", [{"conductance": "0.4 kW/K"}, {"effectiveness": 0.35}], ids=["G", "e"]
)
def test_a_cooled_tank_follows_its_exponential(cooler, numerics):
    flow, power = throttled()
    links = {"cooler": {"type": "heat-exchanger", "from": "sump", "to": "air", **cooler}}
    nodes = {"air": {"type": "ambient", "temperature": "20 degC"}}
    result = fvsolve.run(
        unit(
            links,
            nodes,
            numerics=numerics,
            probes=["sump.temperature", "cooler.heat", "cooler.entropy_flow"],
        )
    )
    conductance = 400.0 if "conductance" in cooler else 0.35 * RHO * flow * CP
    last, rate = power / conductance, conductance / (MASS * CP)
    exact = last + (20.0 - last) * np.exp(-rate * np.array(result.t))  # above ambient
    assert np.array(result["sump.temperature"]) - 20.0 == approx(exact, rel=1e-9)
    assert np.array(result["cooler.heat"]) == approx(conductance * exact, rel=1e-9)
    assert np.array(result["cooler.entropy_flow"]) == approx(
        conductance * exact / (ZERO + 20.0), rel=1e-9
    )
    book = result.ledger["temperature"]
    assert book["relative"] < 1e-14
    gained = MASS * CP * (exact[-1] - 20.0)
    assert book["heat"]["throttle"] + book["heat"]["cooler"] == approx(gained, rel=1e-9)


def test_an_hour_of_the_hydraulic_power_unit():
    """All power at the relief valve and the throttle becomes heat of the oil, with and without its cooler."""
    for conductance in (250.0, None):
        raw = fvsolve.load("warm-oil").raw | {"expect": {}}
        raw["output"] = {
            "every": 60.0,
            "probes": ["sump.temperature", "high.gauge_pressure", "relief.flow", "throttle.flow"],
        }
        if conductance is None:
            raw["links"] = {name: link for name, link in raw["links"].items() if name != "cooler"}
            raw["nodes"] = {name: node for name, node in raw["nodes"].items() if name != "air"}
        result = fvsolve.run(raw)
        (pressure,), flow = (
            {*result["high.gauge_pressure"]},
            result["relief.flow"] + result["throttle.flow"],
        )
        power, capacity, t = pressure * flow[0], 870.0 * 0.1 * CP, np.array(result.t)
        rise = power * t / capacity
        if conductance is not None:
            rise = -power / conductance * np.expm1(-conductance * t / capacity)
        assert np.array(result["sump.temperature"]) - 20.0 == approx(rise, rel=1e-9)
        book = result.ledger["temperature"]
        assert book["relative"] < 1e-14
        assert book["heat"]["relief"] + book["heat"]["throttle"] == approx(3600.0 * power, rel=1e-9)


def body(capacity=4e3, **more) -> dict:
    return {"type": "heat-capacity", "heat_capacity": capacity, **more}


def test_oil_and_its_cooler_are_two_heat_capacities():
    """A sump at rest cools through the body of a cooler to the air: a linear system of two states."""
    nodes = {
        "sump": chamber(0.01, AMBIENT),
        "lake": reservoir(AMBIENT),
        "cast": body(initial_temperature=300.0),
        "air": {"type": "ambient", "temperature": 290.0},
    }
    links = {
        "rest": valve("lake", "sump", 1e-6),
        "inner": {"type": "heat-exchanger", "from": "sump", "to": "cast", "conductance": 30.0},
        "outer": {
            "type": "convection",
            "from": "cast",
            "to": "air",
            "coefficient": 20.0,
            "area": 0.5,
        },
    }
    rates = np.array([[-30.0 / (10.0 * CP), 30.0 / (10.0 * CP)], [30.0 / 4e3, -40.0 / 4e3]])
    start = np.array([350.0, 300.0]) - 290.0
    for numerics in METHODS[1:]:
        case = heated(
            nodes,
            links,
            900.0,
            (),
            numerics,
            ["sump.temperature", "cast.temperature"],
            unit="K",
            initial=350,
        )
        result = fvsolve.run(case)
        exact = np.array([expm(rates * t) @ start for t in result.t]) + 290.0
        assert np.column_stack([result["sump.temperature"], result["cast.temperature"]]) == approx(
            exact, rel=1e-9
        )
        assert result.ledger["temperature"]["relative"] < 1e-14
    found = energy(case)  # what the fluid gives is supplied to the thermal network
    assert found.supplied["inner"][-1] == approx(
        -result.ledger["temperature"]["heat"]["inner"], rel=1e-8
    )
    assert abs(found.remainder[-1]) < 1e-6 * found.supplied["inner"][-1]


@pytest.mark.parametrize("cooler", [{"conductance": 30.0}, {"effectiveness": 0.6}], ids=["G", "e"])
def test_a_cooler_without_initial_temperature_starts_in_equilibrium(cooler):
    nodes = {"cast": body(), "air": {"type": "ambient", "temperature": "20 degC"}}
    links = {
        "inner": {"type": "heat-exchanger", "from": "sump", "to": "cast", **cooler},
        "outer": {"type": "thermal-conductor", "from": "air", "to": "cast", "conductance": 700.0},
    }
    case = unit(links, nodes, heat_from=[], probes=["cast.temperature", "inner.heat"])
    model = fvsolve.build(fvsolve.load(case))
    conductance = cooler.get("conductance") or 0.6 * RHO * throttled()[0] * CP
    share = conductance / (conductance + 700.0)
    temperature, heat = model.observe(fvsolve.initial_state(model))[:2]
    assert temperature == approx(ZERO + 20.0 + 20.0 * share, rel=1e-9)
    assert heat == approx(700.0 * 20.0 * share, rel=1e-7)
    place = list(model.state_names).index("cast.temperature")
    assert model.evaluate(0.0, model.start)[0][place] == 0.0


def stream(flow=2e-4, **links) -> tuple[dict, dict]:
    """Given inflow of oil through junction `a` and a throttle to junction `b`, and on to a lake."""
    nodes = {
        "in": {"type": "inflow", "flow": flow, "scalars": {"temperature": 50.0}},
        "a": junction(),
        "b": junction(),
        "lake": reservoir(2e5),
    }
    own = {
        "first": valve("in", "a", 1e-4),
        "throttle": valve("a", "b", 1e-5),
        "last": valve("b", "lake", 1e-4),
    }
    return nodes, own | links


def test_a_stream_through_junctions_is_heated_and_cooled_at_once():
    drop = RHO / 2.0 * (2e-4 / 1e-5) ** 2
    air, m = {"air": {"type": "ambient", "temperature": "20 degC"}}, RHO * 2e-4
    for cooler, after in (
        ({"conductance": 250.0}, lambda hot: (m * CP * hot + 250.0 * 20.0) / (m * CP + 250.0)),
        ({"effectiveness": 0.7}, lambda hot: hot - 0.7 * (hot - 20.0)),
        ({"effectiveness": 1.0}, lambda hot: 20.0),
    ):
        nodes, links = stream(cooler={"type": "heat-exchanger", "from": "b", "to": "air", **cooler})
        case = heated(
            nodes | air,
            links,
            1.0,
            ["throttle"],
            None,
            ["a.temperature", "b.temperature", "cooler.heat"],
        )
        result = fvsolve.run(case)
        hot = 50.0 + drop / (RHO * CP)
        assert result["a.temperature"][-1] == 50.0
        assert result["b.temperature"][-1] == approx(after(hot), rel=1e-12)
        assert result["cooler.heat"][-1] == approx(m * CP * (hot - after(hot)), rel=1e-11)
        book = result.ledger["temperature"]
        assert book["relative"] < 1e-12 and book["heat"]["throttle"] == approx(
            drop * 2e-4, rel=1e-9
        )


def test_heat_follows_the_flow_when_it_reverses():
    """A throttle between two tanks heats that into which it flows."""
    for sign in (1.0, -1.0):
        nodes = {"left": chamber(1.0, 1e6), "right": chamber(1.0, 1e6 + sign * 5e5)}
        result = fvsolve.run(
            heated(
                nodes,
                {"v": valve("left", "right", 1e-5)},
                1e3,
                "all",
                None,
                ["left.temperature", "right.temperature"],
            )
        )
        warm, cold = ("left", "right") if sign > 0.0 else ("right", "left")
        assert result[f"{warm}.temperature"][-1] > 40.00002
        assert result[f"{cold}.temperature"][-1] == approx(40.0, abs=1e-9)
        book = result.ledger["temperature"]
        stored = 5e5**2 / (4.0 * OIL["bulk_modulus"])  # elastic energy that is lost, V dp^2 / (4 K)
        assert book["heat"]["v"] == approx(stored, rel=1e-4) and book["relative"] < 1e-14


def test_all_that_a_pump_supplies_becomes_heat():
    case = unit(heat_from="all")
    case["links"]["pump"] |= {"efficiency": 0.7, "rated_speed": "1450 rpm"}
    case["links"]["throttle"]["to"] = "back"
    case["nodes"]["back"] = junction()
    case["links"]["pipework"] = valve("back", "sump", 2e-5)
    result, found = fvsolve.run(case), energy(case)
    book = result.ledger["temperature"]
    assert set(book["heat"]) == {"pump", "throttle", "pipework"} and book["relative"] < 1e-14
    assert sum(book["heat"].values()) == approx(found.supplied["pump"][-1], rel=1e-9)
    for name, heat in book["heat"].items():
        assert heat == approx(found.dissipated[name][-1], rel=1e-9)
    rise = (result["sump.temperature"][-1] - 40.0) * MASS * CP
    assert rise == approx(found.supplied["pump"][-1], rel=1e-9)


LINE = {"friction": {"model": "quasi-steady", "roughness": 1e-5}}


def hammer(
    law="linear", numerics=None, heat_from="all", fluid=None, friction=None, **scalar
) -> dict:
    """Valve behind a pipe that closes partly: flow, heat and pressure waves."""
    nodes = {
        "lake": reservoir(2e6, scalars={"temperature": 50.0}),
        "mid": junction(),
        "end": junction(),
        "low": reservoir(2e5),
    }
    links = {
        "a": pipe("lake", "mid", 6.0, 0.02, 1000.0, 5, **LINE),
        "b": pipe("end", "mid", 4.0, 0.02, 1000.0, 4, **LINE, retardation={"temperature": 1.4}),
        "gate": valve("end", "low", 5e-5, {"time": [0.0, 0.02], "value": [1.0, 0.5]}),
    }
    if friction:
        links["a"]["friction"] = links["b"]["friction"] = friction
    own = {
        "name": "water",
        "law": law,
        "temperature": "50 degC",
        **({"air_fraction": 1e-3} if law == "mixture" else {}),
    }
    probes = ["mid.temperature", "b.temperature@0.5", "gate.flow"]
    numerics = numerics or {"method": "rk4", "scheme": "weno5"}
    return heated(
        nodes, links, 0.05, heat_from, numerics, probes, fluid or own, **{"initial": 50.0, **scalar}
    )


@pytest.mark.parametrize("law", LAWS)
def test_the_ledger_of_heat_closes_under_every_density_law(law):
    found = []
    for numerics in (
        {"method": "rk4", "scheme": "weno5"},
        {"method": "dormand-prince", "rtol": 1e-8},
        {"method": "radau-iia-5", "rtol": 1e-8},
        {"method": "rodas-5p", "rtol": 1e-8},
    ):
        scheme = {} if "scheme" in numerics or law != "mixture" else {"scheme": "muscl"}
        result = fvsolve.run(hammer(law, numerics | scheme))
        book = result.ledger["temperature"]
        assert result.ok and book["relative"] < 1e-12
        assert min(book["heat"].values()) > 0.0 and set(book["heat"]) == {"a", "b", "gate"}
        found.append(sum(book["heat"].values()))
    assert found == approx([found[0]] * 4, rel=2e-3 if law == "mixture" else 1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_a_uniform_temperature_stays_uniform_under_every_density_law(law):
    result = fvsolve.run(hammer(law, heat_from=[]))
    for probe in ("mid.temperature", "b.temperature@0.5"):
        assert np.array(result[probe]) == approx(50.0, rel=1e-13)


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "friction",
    [LINE["friction"], {"model": "unsteady", "roughness": 1e-5}],
    ids=lambda f: f["model"],
)
@pytest.mark.parametrize("law", ["linear", "log"])
def test_every_watt_of_the_energy_ledger_heats_the_fluid(law, friction):
    if law == "log" and friction["model"] == "unsteady":
        case = hammer(law, friction=friction)
        with pytest.raises(fvsolve.CaseError, match="expected quasi-steady friction"):
            fvsolve.build(fvsolve.load(case))
        return
    for scheme in ("upwind", "weno5"):
        case = hammer(law, {"method": "ssp-rk3", "scheme": scheme}, friction=friction)
        book, found = fvsolve.run(case).ledger["temperature"], energy(case)
        for name, heat in book["heat"].items():
            lost = found.dissipated[name if name == "gate" else f"{name} friction"][-1]
            # other laws take other steps there
            assert heat == approx(lost, rel=1e-12 if law == "linear" else 1e-4)


def test_friction_warms_a_stream_along_a_pipe():
    """In steady flow the temperature at the outlet is that of the inlet plus dp / (rho cp)."""
    nodes = {
        "in": {"type": "inflow", "flow": 3e-4, "scalars": {"temperature": 40.0}},
        "lake": reservoir(2e5),
    }
    links = {
        "line": pipe(
            "in", "lake", 2.0, 0.01, 300.0, 10, friction={"model": "steady", "factor": 0.03}
        )
    }
    for back in (False, True):
        if back:
            links["line"] |= {"from": "lake", "to": "in"}
        probe = f"line.temperature@{0 if back else 1}"
        result = fvsolve.run(
            heated(nodes, links, 10.0, ["line"], {"scheme": "muscl", "method": "ssp-rk2"}, [probe])
        )
        drop = 0.03 * 2.0 / 0.01 * RHO / 2.0 * (3e-4 / area(0.01)) ** 2
        assert result[probe][-1] - 40.0 == approx(drop / (RHO * CP) * 1.0, rel=1e-9)
        assert result.ledger["temperature"]["relative"] < 1e-12


def test_units_order_and_direction_do_not_matter():
    nodes = {
        "air": {"type": "ambient", "temperature": "20 degC"},
        "cast": body(initial_temperature="30 degC"),
    }
    links = {
        "cooler": {"type": "heat-exchanger", "from": "high", "to": "cast", "effectiveness": 0.2},
        "outer": {
            "type": "convection",
            "from": "cast",
            "to": "air",
            "coefficient": 50.0,
            "area": 2.0,
        },
        "bath": {"type": "heat-exchanger", "from": "sump", "to": "air", "conductance": "0.05 kW/K"},
    }
    probes = ["sump.temperature", "cooler.heat", "bath.heat"]
    case = unit(links, nodes, heat_from="all", probes=probes)
    first = fvsolve.run(case)
    other = copy.deepcopy(case)
    other["nodes"] = dict(reversed(other["nodes"].items()))
    other["links"] = dict(reversed(other["links"].items()))
    other["links"]["throttle"] |= {"from": "sump", "to": "high"}
    other["links"]["outer"] |= {"from": "air", "to": "cast"}
    other["scalars"]["temperature"] |= {"unit": "K", "initial": 40.0 + ZERO, "specific_heat": 1900}
    second = fvsolve.run(other)
    assert np.array(second["sump.temperature"]) - ZERO == approx(
        np.array(first["sump.temperature"]), rel=1e-8
    )
    for probe in probes[1:]:
        assert np.array(second[probe]) == approx(np.array(first[probe]), rel=1e-7)
    books = [run.ledger["temperature"] for run in (first, second)]
    assert (
        books[0]["heat"] == approx(books[1]["heat"], rel=1e-7)
        and max(b["relative"] for b in books) < 1e-13
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["rk4", "radau-iia-5", "rodas-5p"])
def test_a_scene_at_rest_does_not_move(law, method):
    case = hammer(law, {"method": method, "initial": "rest"})
    case["nodes"]["low"]["pressure"] = 2e6
    case["fluid"]["viscosity"] = {"law": "astm-d341", "points": VG46}
    case["nodes"]["air"] = {"type": "ambient", "temperature": "50 degC"}
    case["links"]["cooler"] = {
        "type": "heat-exchanger",
        "from": "mid",
        "to": "air",
        "conductance": 10.0,
    }
    result = fvsolve.run(case)
    # the node solution of this law leaves a flow of rounding at the start, with or without heat
    if law == "table":
        assert np.abs(result["gate.flow"]).max() < 1e-12
        assert np.array(result["mid.temperature"]) == approx(50.0, rel=1e-13)
        return
    assert {*result["mid.temperature"], *result["b.temperature@0.5"]} == {50.0}
    assert set(result["gate.flow"]) == {0.0}
    assert result.ledger["temperature"]["heated"] == 0.0


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", ["rk4", "radau-iia-5"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(law, method):
    viscosity = {"law": "astm-d341", "points": VG46}
    for friction in (LINE["friction"], {"model": "unsteady", "roughness": 1e-5}):
        case = hammer(law, {"method": method, "scheme": "weno5"}, friction=friction)
        if law == "log" and friction["model"] == "unsteady":
            continue
        case["fluid"]["viscosity"] = viscosity
        case["nodes"] |= {
            "cast": body(initial_temperature=320.0),
            "air": {"type": "ambient", "temperature": 290.0},
            "sump": chamber(0.01),
        }
        case["links"] |= {
            "cooler": {"type": "heat-exchanger", "from": "mid", "to": "cast", "effectiveness": 0.4},
            "bath": {"type": "heat-exchanger", "from": "sump", "to": "cast", "conductance": 9.0},
            "outer": {"type": "thermal-conductor", "from": "cast", "to": "air", "conductance": 3.0},
            "side": valve("mid", "sump", 1e-5),
        }
        model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(4)
        assert (
            max(stray(model, t, model.start + random_state(model, rng)) for t in (0.0, 0.01)) < 1e-8
        )


def test_a_run_that_is_cut_off_goes_on_to_the_bit(tmp_path):
    case = hammer(numerics={"method": "rk4", "scheme": "weno5"})
    case["fluid"]["viscosity"] = {"law": "astm-d341", "points": VG46}
    case["numerics"]["end"], case["output"]["every"] = 1.5, 0.01

    def interrupt(t, seconds, steps):
        if t > 0.3:
            raise KeyboardInterrupt

    assert not fvsolve.run(case, out=tmp_path / "run", progress=interrupt, pictures=False).ok
    again = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert again.ledger["temperature"] == whole.ledger["temperature"]
    assert (tmp_path / "run" / "history.csv").read_bytes() == (
        tmp_path / "whole" / "history.csv"
    ).read_bytes()


# viscosity --------------------------------------------------------------------------------------------------------


def walther(temperature: float) -> float:
    """Kinematic viscosity [m2/s] of `VG46` at a temperature [degC], by its definition."""
    cold, hot = (math.log10(math.log10(nu + 0.7)) for nu in (46.0, 6.76))
    slope = (cold - hot) / (math.log10(ZERO + 100.0) - math.log10(ZERO + 40.0))
    power = cold - slope * (math.log10(ZERO + temperature) - math.log10(ZERO + 40.0))
    return 1e-6 * (10.0 ** (10.0**power) - 0.7)


@pytest.mark.parametrize("law, retardation", [("linear", 1.0), ("log", 1.4)])
def test_warm_oil_flows_through_a_pipe_by_its_viscosity(law, retardation):
    """Laminar flow: warm oil replaces cold oil, the flow rises to that of its viscosity."""
    fluid = {
        "name": "user",
        "density": RHO,
        "bulk_modulus": 1.6e9,
        "temperature": "40 degC",
        "law": law,
        "viscosity": {"law": "astm-d341", "points": VG46},
    }
    warm = {"temperature": {"time": [0.0, 0.2], "value": [30.0, 60.0]}}
    nodes = {"lake": reservoir(AMBIENT + 100.0, scalars=warm), "sea": reservoir(AMBIENT)}
    links = {
        "line": pipe(
            "lake", "sea", 0.2, 0.01, 40.0, 5, **LINE, retardation={"temperature": retardation}
        )
    }
    case = heated(
        nodes,
        links,
        60.0,
        (),
        {"scheme": "muscl", "method": "auto", "rtol": 1e-9},
        ["line.flow@0.5"],
        fluid,
        initial=30.0,
    )
    flow = np.array(fvsolve.run(case)["line.flow@0.5"])

    def poiseuille(temperature):
        """Flow at a drop of 100 Pa; under the law `log` the jet at the outlet takes rho v^2 / 2 of it."""
        a, b = (
            RHO / (2.0 * area(0.01) ** 2),
            128.0 * RHO * walther(temperature) * 0.2 / (math.pi * 0.01**4),
        )
        return 100.0 / b if law == "linear" else (math.sqrt(b * b + 400.0 * a) - b) / (2.0 * a)

    for k, temperature in ((0, 30.0), (-1, 60.0)):
        assert flow[k] == approx(poiseuille(temperature), rel=1e-9 if law == "linear" else 3e-4)
    assert np.all(np.diff(flow) > -1e-12)


def test_the_viscosity_law_agrees_with_the_data_of_oils(tmp_path):
    viscosity = {"law": "astm-d341"}
    for temperature in (20.0, 40.0, 70.0, 100.0):
        own = fvsolve.load(unit(fluid={"name": "ISO VG 46", "temperature": f"{temperature} degC"}))
        law = fvsolve.load(
            unit(
                fluid={
                    "name": "VG 46",
                    "temperature": f"{temperature} degC",
                    "viscosity": viscosity,
                }
            )
        )
        assert law.properties.viscosity == approx(own.properties.viscosity, rel=1e-12)
        assert law.properties.viscosity / law.properties.density == approx(
            walther(temperature), rel=1e-12
        )
    case = fvsolve.load(unit(fluid=OIL | {"viscosity": viscosity | {"points": VG46}}))
    (tmp_path / "again.toml").write_text(case.resolved())
    assert fvsolve.load(tmp_path / "again.toml").properties == case.properties


def test_the_energy_of_friction_follows_the_viscosity():
    """The heat of a pipe is the power of friction at the present viscosity, as in the ledger of energy."""
    case = hammer(
        heat_from=["a", "b"],
        initial=20.0,
        fluid=OIL | {"viscosity": {"law": "astm-d341", "points": VG46}},
    )
    book, found = fvsolve.run(case).ledger["temperature"], energy(case)
    for name in "ab":
        assert book["heat"][name] == approx(found.dissipated[f"{name} friction"][-1], rel=1e-12)
    assert abs(found.remainder[-1]) < 0.02 * sum(book["heat"].values())
    case["scalars"]["temperature"]["initial"] = 19.0
    assert fvsolve.run(case).ledger["temperature"]["heat"]["a"] != book["heat"]["a"]


def test_steady_friction_retains_the_viscosity_of_the_start_with_a_notice():
    case = hammer(friction={"model": "steady", "roughness": 1e-5})
    case["fluid"]["viscosity"] = {"law": "astm-d341", "points": VG46}
    notes = [notice.text for notice in fvsolve.build(fvsolve.load(case)).warnings]
    assert any("its friction keeps the viscosity of the start" in text for text in notes)


# parts of fluid power ---------------------------------------------------------------------------------------------

PORTS = {"P": "a", "T": "b", "A": "c", "B": "d"}
SPOOL = {"type": "spool-valve", "ports": PORTS, "diameter": "2 mm"}
SEVERAL = {
    "position": SPOOL | {"position": 0.5},
    "command": SPOOL | {"command": -0.5, "natural_frequency": "60 Hz", "damping_ratio": 0.8},
    "shuttle": {"type": "shuttle", "ports": {"A": "a", "B": "b", "out": "c"}, "diameter": "2 mm"},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("name", SEVERAL)
@pytest.mark.parametrize("heat_from", ["all", ["several"]], ids=["all", "name"])
def test_all_restrictions_of_a_link_heat_the_fluid(name, heat_from):
    """Their heat is the energy V p^2 / (2 K) that the chambers lose."""
    nodes = {
        place: chamber(5e-3, pressure)
        for place, pressure in zip("abcd", (1e7, 1e6, 2e6, 2e6), strict=True)
    }
    links = {
        "first": valve("c", "d", 1e-6, 0.0),
        "several": SEVERAL[name],
        "last": valve("d", "b", 1e-6, 0.0),
    }
    case = heated(
        nodes,
        links,
        0.5,
        heat_from,
        probes=[f"{place}.pressure" for place in nodes],
        fluid=OIL | {"law": "linear"},
    )
    result = fvsolve.run(case)
    energies = sum(
        5e-3 / (2.0 * 1.6e9) * np.array(result[f"{place}.pressure"]) ** 2 for place in nodes
    )
    book = result.ledger["temperature"]
    assert result.ok and book["heat"]["several"] == approx(energies[0] - energies[-1], rel=1e-6)
    assert book["heat"]["several"] > 40.0 and sum(book["heat"].values()) == book["heat"]["several"]


LOSSES = {
    "displacement": "20 cc/rev",
    "leakage": "0.02 l/min/bar",
    "viscous_friction": 0.02,
    "friction_torque": 5.0,
}


def circuit(kind, drive, **more):
    """Machine between two chambers that a throttle joins; it turns by `speed`, by a housing, or by its inertia."""
    shaft = {"speed": "1500 rpm"} if drive == "speed" else {"ports": {"shaft": "shaft"}}
    ends = ("low", "high") if kind == "pump" else ("high", "low")
    own = {
        "type": f"displacement-{kind}",
        "from": ends[0],
        "to": ends[1],
        **LOSSES,
        **shaft,
        **more,
    }
    turned = {"type": "housing", "speed": "1500 rpm"}
    if drive == "inertia":
        turned = {"type": "shaft", "inertia": 0.5, "initial_speed": "1500 rpm"}
    nodes = {"low": chamber(0.02, 1e7), "high": chamber(1e-3)} | (
        {} if drive == "speed" else {"shaft": turned}
    )
    probes = [
        "low.temperature",
        "high.temperature",
        "low.pressure",
        "high.pressure",
        "machine.torque",
    ]
    probes += ["shaft.speed"] if drive == "inertia" else []
    return heated(
        nodes,
        {"machine": own, "throttle": valve("high", "low", 5e-6)},
        2.0,
        "all",
        probes=probes,
        fluid=OIL | {"law": "linear"},
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("drive", ["speed", "housing", "inertia"])
@pytest.mark.parametrize("kind", ["pump", "motor"])
def test_all_losses_of_a_displacement_machine_heat_the_fluid(kind, drive):
    """The fluid gets the work at the shaft, less what its pressure stores; the network keeps no friction for itself."""
    case, speed = circuit(kind, drive), 1500.0 * math.pi / 30.0
    result = fvsolve.run(case)
    book, found = result.ledger["temperature"], energy(case)
    stored = sum(
        volume / (2.0 * 1.6e9) * np.array(result[f"{place}.pressure"]) ** 2
        for place, volume in (("low", 0.02), ("high", 1e-3))
    )
    if drive == "inertia":
        work = 0.25 * (result["shaft.speed"][0] ** 2 - result["shaft.speed"][-1] ** 2)
        assert result["shaft.speed"][-1] < 0.9 * speed
    else:
        taken = 1.0 if kind == "pump" else -1.0
        assert np.ptp(result["machine.torque"]) < 1e-6
        work = taken * result["machine.torque"][0] * speed * 2.0
    assert result.ok and book["relative"] < 1e-12
    assert sum(book["heat"].values()) == approx(work - stored[-1] + stored[0], rel=1e-6)
    assert abs(found.remainder[-1]) < 1e-7 * found.throughput
    assert sum(line[-1] for line in found.dissipated.values()) == approx(
        sum(book["heat"].values()), rel=1e-6
    )


@pytest.mark.parametrize("drive", ["speed", "inertia"])
def test_the_pattern_of_the_jacobian_has_the_heat_of_a_machine(drive):
    model, rng = fvsolve.build(fvsolve.load(circuit("motor", drive))), np.random.default_rng(1)
    assert stray(model, 0.0, model.scale * rng.normal(scale=0.1, size=model.y_size)) < 1e-7


def test_a_machine_that_stands_still_heats_by_its_leakage_alone():
    case = circuit("motor", "inertia", friction_torque="200 N m")
    case["nodes"]["shaft"]["initial_speed"], case["nodes"]["high"]["initial_pressure"] = 0.0, 2e7
    case["links"]["throttle"]["opening"] = 0.0
    result = fvsolve.run(case)
    p = np.array([result["low.pressure"], result["high.pressure"]])
    stored = np.array([0.02, 1e-3]) @ p**2 / (2.0 * 1.6e9)
    assert np.ptp(result["shaft.speed"]) == 0.0
    assert result.ledger["temperature"]["heat"]["machine"] == approx(
        stored[0] - stored[-1], rel=1e-6
    )


@pytest.mark.parametrize("setting", [0.0, 1e-6])
def test_heat_of_a_junction_without_flow_ends_the_run(setting):
    case = circuit("pump", "speed", leakage=0.0, setting=setting)
    case["nodes"]["high"] = junction()
    case["output"]["probes"] = ["high.temperature"]
    result = fvsolve.run(case)
    assert not result.ok
    for text in (
        "machine heats high by more than 300 K at t = 0 s",
        "too little fluid flows",
        "make it a chamber",
    ):
        assert text in result.reason
    case["nodes"]["high"] = chamber(1e-3)
    result, rate = (
        fvsolve.run(case),
        (0.02 * 50.0 * math.pi + 5.0) * 50.0 * math.pi / (RHO * 1e-3 * CP),
    )
    assert result.ok and result["high.temperature"][-1] - 40.0 == approx(2.0 * rate, rel=1e-2)


# what a case states -----------------------------------------------------------------------------------------------


def test_the_specific_heat_of_the_fluid_is_known():
    from CoolProp.CoolProp import PropsSI

    for name, pressure in (("water", 101325.0), ("INCOMP::T66", 101325.0)):
        case = hammer(
            fluid={
                "name": name,
                "temperature": "50 degC",
                "bulk_modulus": "2 GPa",
                "viscosity": "1 cSt",
            }
        )
        del case["scalars"]["temperature"]["specific_heat"]
        found = fvsolve.load(case).scalars["temperature"].specific_heat
        assert found == approx(PropsSI("C", "T", 323.15, "P", pressure, name), rel=1e-12)
    assert specific_heat("HLP 46", ZERO + 25.0, 1e5) == approx(1895.4, rel=1e-12)


def test_parts_of_a_cut_pipe_heat_the_fluid_together():
    case = hammer(heat_from=["a", "gate"])
    case["nodes"]["tap"] = {"type": "junction", "on": "a", "at": "2 m"}
    case["output"]["probes"] = ["mid.temperature"]
    del case["links"]["a"]["cells"]
    case["numerics"]["cell_time"] = 1e-3
    book = fvsolve.run(case).ledger["temperature"]
    assert set(book["heat"]) == {"a-1", "a-2", "gate"} and book["relative"] < 1e-12


SCALAR, COOLER = ("scalars", "temperature"), ("links", "cooler")
FAULTS = [
    ((*SCALAR, "heat_from"), ["throttel"], 'no part named "throttel"; did you mean "throttle"?'),
    ((*SCALAR, "heat_from"), ["sump"], '"sump" dissipates nothing in the fluid'),
    ((*SCALAR, "heat_from"), "some", 'is not a list of names; expected ["NAME", ...] or "all"'),
    ((*SCALAR, "heat"), False, "heat_from: needs heat = true"),
    ((*SCALAR, "unit"), "degF", '"degF" is not a unit of a temperature with heat; expected K or degC'),
    ((*SCALAR, "specific_heat"), "1.9 kJ/K", "a specific heat"),
    ((*SCALAR, "specific_heat"), None, 'heat without specific heat: a "user" fluid has none'),
    ((*SCALAR, "initial"), -300.0, "initial: -300 is not above absolute zero; expected a temperature above -273.15"),
    (("nodes", "sump", "scalars"), {"temperature": -273.15}, "sump.scalars.temperature: -273.15 is not above"),
    (("scalars", "other"), {"heat": True, "specific_heat": 1.0}, "expected one scalar with heat"),
    ((*COOLER, "conductance"), None, "expected one of conductance, effectiveness"),
    ((*COOLER, "effectiveness"), 0.5, "conductance and effectiveness are given; keep one"),
    ((*COOLER, "conductance"), 0.0, "out of range"),
    ((*COOLER, "from"), "lake", "lake is a reservoir, whose temperature no heat changes"),
    ((*COOLER, "from"), "air", "needs a hydraulic place"),
    ((*COOLER, "to"), "high", "needs a thermal place"),
    (("links", "more"), {"type": "heat-exchanger", "from": "high", "to": "air", "effectiveness": 0.1},
     "expected one heat exchanger at a junction"),
    (("scalars",), {}, "declare one, [scalars.NAME] with heat = true"),
    (("fluid", "viscosity"), {"law": "astm-d342"}, 'did you mean "astm-d341"?'),
    (("fluid", "viscosity"), {"law": "astm-d341"}, "the law needs two points of this fluid"),
    (("fluid", "viscosity"), {"law": "astm-d341", "points": [[300.0, "46 cSt"]]}, "expected [[TEMPERATURE, VISCOSITY]"),
    (("fluid", "viscosity"), {"law": "astm-d341", "points": [[300.0, "46 cSt"], [300.0, "9 cSt"]]}, "same temperature"),
    (("fluid", "viscosity"), {"law": "astm-d341", "points": [[300.0, "6 cSt"], [330.0, "9 cSt"]]}, "rises with"),
    (("fluid", "viscosity"), {"law": "astm-d341", "points": [[300.0, "6 cSt"], [330.0, "0.2 cSt"]]}, "0.3 cSt or less"),
]  # fmt: skip


@pytest.mark.parametrize(
    "keys, value, said",
    FAULTS,
    ids=[f"{'.'.join(keys)}-{k}" for k, (keys, *_) in enumerate(FAULTS)],
)
def test_impossible_settings_are_refused(keys, value, said):
    nodes = {"air": {"type": "ambient", "temperature": 290.0}, "lake": reservoir(AMBIENT)}
    links = {
        "cooler": {"type": "heat-exchanger", "from": "high", "to": "air", "conductance": 5.0},
        "leak": valve("sump", "lake", 1e-6),
    }
    case = unit(links, nodes)
    fvsolve.build(fvsolve.load(case))
    table = case
    for key in keys[:-1]:
        table = table[key]
    if value is None:
        del table[keys[-1]]
    else:
        table[keys[-1]] = value
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)


def test_a_temperature_that_nothing_heats_is_noted():
    notes = [notice.text for notice in fvsolve.build(fvsolve.load(unit(heat_from=[]))).warnings]
    assert any("no part heats or cools the fluid" in text for text in notes)
    notes = [notice.text for notice in fvsolve.build(fvsolve.load(unit())).warnings]
    assert not any("heats or cools" in text for text in notes)


def test_all_faults_are_reported_at_once():
    case = unit()
    case["scalars"]["temperature"] |= {"heat_from": ["pomp", "throtle"]}
    case["links"]["cooler"] = {
        "type": "heat-exchanger",
        "from": "sump",
        "to": "nowhere",
        "effectiveness": 2.0,
    }
    text = str(refused(case))
    assert (
        '"pomp"' in text and '"throtle"' in text and "nowhere" in text and "effectiveness" in text
    )


def test_a_faulty_part_gives_no_second_fault_in_the_heat_of_the_fluid():
    case = unit(
        {"cooler": {"type": "heat-exchanger", "from": "sump", "to": "air", "conductance": 5.0}},
        {"air": {"type": "ambient", "temperature": 290.0}},
    )
    case["links"]["throttle"]["area"] = -1.0
    assert [fault.place for fault in refused(case).faults] == ["links.throttle.area"]
    case["links"]["throttle"]["area"], case["scalars"]["temperature"]["specific_heat"] = 1e-6, -1.0
    assert [fault.place for fault in refused(case).faults] == ["scalars.temperature.specific_heat"]


def test_a_block_that_passes_on_a_temperature_at_once_needs_a_filter():
    nodes = {
        "cast": body(initial_temperature=300.0),
        "air": {"type": "ambient", "temperature": 290.0},
    }
    links = {
        "cooler": {"type": "heat-exchanger", "from": "sump", "to": "cast", "conductance": 5.0},
        "outer": {"type": "thermal-conductor", "from": "cast", "to": "air", "conductance": 5.0},
        "fan": {"type": "heat-source", "to": "cast", "heat": {"control": "fan"}},
    }
    case = unit(links, nodes)
    block = {
        "type": "function",
        "inputs": {"T": "sump.temperature"},
        "formula": "-10*(T - 40)",
        "unit": "W",
    }
    case["controls"] = {"fan": block}
    with pytest.raises(fvsolve.CaseError, match="give \\[controls.fan\\] a `filter`"):
        fvsolve.build(fvsolve.load(case))
    case["controls"]["fan"]["filter"] = "1 s"
    assert fvsolve.run(case).ok


@pytest.mark.parametrize("numerics", [METHODS[0], *METHODS[2:]], ids=lambda item: item["method"])
def test_a_thermostat_switches_at_its_temperature(numerics):
    """A relay that reads the temperature of the sump, and one that reads that of the mixed flow behind the throttle.

    Explicit steps under error control are left out: the wide return valve limits them to 1e-6 s.
    """
    flow, power = throttled()
    warmer = RHO / 2.0 * (flow / 4e-6) ** 2 / (RHO * CP)
    nodes = {
        "cast": body(initial_temperature=300.0),
        "air": {"type": "ambient", "temperature": 290.0},
        "back": junction(),
    }
    links = {
        "throttle": valve("high", "back", 4e-6),
        "return": valve("back", "sump", 1e-2),
        "outer": {"type": "thermal-conductor", "from": "cast", "to": "air", "conductance": 5.0},
    }
    case = unit(links, nodes, numerics=numerics)
    relay = {"type": "relay", "on": 45.0, "off": 44.0, "output": [0.0, 100.0], "initial": 0}
    case["controls"] = {
        "hot": relay | {"input": "sump.temperature"},
        "hotter": relay | {"input": "back.temperature", "on": 47.0 + warmer},
    }
    for name in case["controls"]:
        case["links"][f"fan-{name}"] = {
            "type": "heat-source",
            "to": "cast",
            "heat": {"control": name},
        }
    events = {event["name"]: event["time"] for event in fvsolve.run(case).summary["events"]}
    rate = power / (MASS * CP)
    assert events == approx({"controls.hot": 5.0 / rate, "controls.hotter": 7.0 / rate}, rel=1e-6)


def test_a_tank_with_a_level_is_heated_too():
    case = unit()
    case["nodes"]["sump"] = tank(0.5, 0.2)
    result = fvsolve.run(case)
    power = result.ledger["temperature"]["heat"]["throttle"] / 1e3
    assert result["sump.temperature"][-1] - 40.0 == approx(power * 1e3 / (0.1 * RHO * CP), rel=1e-9)
