"""Check valves with a deceleration curve: slams of evenly decelerated columns, and Joukowsky's jump in a main."""

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import RHO, WATER, area, junction, pipe, reservoir, scene

import fvsolve
from fvsolve.studies.energy.energy_balance import energy

BORE, LENGTH = 0.2, 50.0
RATES, VELOCITIES = [0.5, 2.0, 6.0], [0.02, 0.1, 0.5]
TIGHT = {"method": "dormand-prince", "rtol": 1e-10}


def slamming(start: str, end: str, **more) -> dict:
    """Return a check valve with a deceleration curve and a negligible loss."""
    return {"type": "check-valve", "from": start, "to": end, "diameter": BORE, "loss_coefficient": 1e-7,
            "deceleration": {"rate": RATES, "reverse_velocity": VELOCITIES}, **more}  # fmt: skip


def column(rate: float, numerics: dict, law: str = "linear", against: bool = False, first: float = 1.5) -> dict:
    """Return a case of a rigid column with the velocity `first` [m/s], which its ends decelerate by `rate` [m/s2]."""
    nodes = {"up": reservoir(3e5), "mid": junction(), "town": reservoir(3e5 + rate * RHO * LENGTH)}
    way = {"type": "rigid-column", "from": "mid", "to": "town", "length": LENGTH, "diameter": BORE,
           "friction": {"model": "none"}, "initial_flow": first * area(BORE)}  # fmt: skip
    if against:
        way |= {"from": "town", "to": "mid", "initial_flow": -first * area(BORE)}
    links = {"check": slamming("up", "mid"), "way": way}
    fluid = WATER | {"law": law} | ({"air_fraction": 0.0} if law == "mixture" else {})
    return scene(nodes, links, 6.0, numerics, ["check.flow", "check.opening"], 0.05, fluid=fluid)


def times(result) -> dict[str, float]:
    return {event["what"]: event["time"] for event in result.summary["events"]}


@pytest.mark.parametrize("rate", [0.3, 0.5, 1.1, 2.0, 4.0, 6.0, 9.0])
def test_on_a_column_that_slows_down_evenly_it_returns_its_curve(rate):
    """The flow reverses after v0 / d; the valve shuts v / d later, with v of the curve, constant beyond its ends."""
    result = fvsolve.run(column(rate, TIGHT))
    at = times(result)
    slam = rate * (at["shuts"] - at["flow reverses"])
    assert at["flow reverses"] == pytest.approx(1.5 / rate, rel=1e-6)
    assert slam == pytest.approx(np.interp(rate, RATES, VELOCITIES), rel=1e-6)
    assert ("flow reverses faster than its curve covers" in at) == (rate > 6.0)
    after = result.t > at["shuts"]
    assert not result["check.flow"][after].any() and not result["check.opening"][after].any()


WAYS = [("linear", {"method": "radau-iia-5", "rtol": 1e-8}), ("linear", {"method": "rodas-5p", "rtol": 1e-8}),
        ("linear", {"method": "rk4", "step": 0.01}), ("log", TIGHT), ("mixture", TIGHT)]  # fmt: skip


@pytest.mark.parametrize("against", [False, True], ids=["along", "against"])
@pytest.mark.parametrize("law, numerics", WAYS)
def test_so_it_does_by_every_method_and_law_however_the_column_is_drawn(law, numerics, against):
    at = times(fvsolve.run(column(3.0, numerics, law, against)))
    near = 1e-6 if law == "linear" else 1e-3  # compressibility
    assert 3.0 * (at["shuts"] - at["flow reverses"]) == pytest.approx(np.interp(3.0, RATES, VELOCITIES), rel=near)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_in_a_main_joukowskys_jump_follows_its_slam(law):
    """The pressure falls by rho a d per second, so the velocity by d, until reflections return from the far end."""
    v, d, speed = 0.3, 1.5, 1000.0
    fall = {"time": [0.0, 0.1, 0.6], "value": [9e5, 9e5, 9e5 - 0.5 * RHO * speed * d]}
    nodes = {"up": reservoir(fall), "mid": junction(), "town": junction(v * area(BORE))}
    links = {"check": slamming("up", "mid"), "main": pipe("mid", "town", 500.0, BORE, speed, 500)}
    numerics = {"scheme": "upwind", "method": "euler", "courant": 1.0}
    case = scene(nodes, links, 0.5, numerics, ["check.flow", "mid.pressure"], 1e-3, fluid=WATER | {"law": law})
    result = fvsolve.run(case)
    at, wanted = times(result), float(np.interp(d, RATES, VELOCITIES))
    assert at["flow reverses"] == pytest.approx(0.1 + v / d, abs=2e-3)
    near = 1e-3 if law == "linear" else 0.02
    assert d * (at["shuts"] - at["flow reverses"]) == pytest.approx(wanted, rel=near, abs=2e-3 * d)
    after = (result.t > at["shuts"] + 2e-3) & (result.t < 0.48)
    before = result["mid.pressure"][result.t < at["shuts"]]
    jump = result["mid.pressure"][after] - before[-1]
    assert jump == pytest.approx(RHO * speed * wanted, rel=0.05)
    assert not result["check.flow"][after].any() and abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("end", [0.45, 0.6, 1.0], ids=["open", "turned", "shut"])
def test_resumed_it_is_the_unbroken_run_to_the_bit(tmp_path, end):
    case = column(3.0, {"method": "rk4", "step": 0.05})
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run")
    result, whole = fvsolve.run(case, out=tmp_path / "run", resume=True), fvsolve.run(case)
    assert np.array_equal(result["check.flow"], whole["check.flow"])
    assert result.summary["events"] == whole.summary["events"]


@pytest.mark.parametrize(
    "wrong, said",
    [({"time_constant": 0.1, "overpressure": 1e3}, "define how the valve shuts"),
     ({"deceleration": {"rate": [1.0, 2.0], "reverse_velocity": [0.1]}}, "has length 1, but `rate` has length 2"),
     ({"deceleration": {"rate": [2.0, 1.0], "reverse_velocity": [0.1, 0.2]}}, "rates"),
     ({"deceleration": {"rate": [1.0]}}, "reverse_velocity is missing"),
     ({"deceleration": 3.0}, "is not a table"),
     ({"diameter": None, "loss_coefficient": None, "Kv": 100.0}, "the velocities of this curve refer to a bore")],
)  # fmt: skip
def test_what_is_wrong_with_its_curve_is_said(wrong, said):
    case = column(3.0, TIGHT)
    given = case["links"]["check"] | wrong
    case["links"]["check"] = {key: value for key, value in given.items() if value is not None}
    assert said in str(refused(case))


def test_its_energy_closes_through_a_slam_and_it_only_dissipates():
    nodes = {"up": reservoir({"time": [0.0, 0.05, 0.35], "value": [9e5, 9e5, 3e5]}), "mid": junction()}
    nodes["town"] = junction(0.3 * area(BORE))
    links = {"check": slamming("up", "mid"), "main": pipe("mid", "town", 200.0, BORE, 1000.0, 20)}
    case = scene(nodes, links, 0.6, {"scheme": "upwind3", "method": "dormand-prince", "rtol": 1e-8}, ["check.flow"])
    assert "shuts" in times(fvsolve.run(case))
    found = energy(case)
    scheme = sum(taken[-1] for taken in found.scheme.values())
    assert abs(found.numerical_remainder[-1] - scheme) < 1e-6 * found.throughput
    assert (np.diff(found.dissipated["check check valve"]) >= 0.0).all()
