"""Surge-anticipating valves against valves that follow the same opening by schedule, and tanks in closed form."""

import math

import numpy as np
import pytest
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, junction, pipe, reservoir, scene, tank, valve
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.studies.energy.energy_balance import energy

OPENS, HOLD, SHUTS = 0.4, 1.5, 2.5
TIGHT = {"method": "dormand-prince", "rtol": 1e-10}
FALL = {"time": [0.0, 1.0, 2.0, 3.0], "value": [5e5, 5e5, 2e5, 5e5]}


def anticipating(start: str, flow_area: float = 2e-3, **more) -> dict:
    return {"type": "surge-anticipating", "from": start, "area": flow_area, "discharge_coefficient": 1.0,
            "opening_time": OPENS, "hold": HOLD, "closing_time": SHUTS, **more}  # fmt: skip


def main(links: dict, numerics: dict, law: str = "linear", turned: bool = False, end: float = 7.0, **more) -> dict:
    """Return a case of a main from a reservoir that falls and rises to a valve, with `links` at its middle."""
    ends = ("mid", "up") if turned else ("up", "mid")
    nodes = {
        "up": reservoir(FALL), "mid": junction(), "town": reservoir(2e5), "end": junction(), "sump": reservoir(1.2e5),
    }  # fmt: skip
    ways = {"one": pipe(*ends, 200.0, 0.2, 1000.0, 8), "two": pipe("mid", "end", 100.0, 0.2, 1000.0, 4),
            "tap": valve("end", "town", 1e-3)}  # fmt: skip
    probes = [f"{name}.flow" for name in links] + ["mid.pressure", "end.pressure"]
    probes += [f"{name}.opening" for name, link in links.items() if link["type"] != "valve"]
    fluid = WATER | {"law": law} | ({"air_fraction": 1e-4} if law == "mixture" else {})
    return scene(nodes, ways | links, end, {"scheme": "upwind3", **numerics}, probes, 0.05, fluid=fluid, **more)


CASES = [(TIGHT, "linear", False), (TIGHT, "log", True), (TIGHT, "mixture", False),
         ({"method": "radau-iia-5", "rtol": 1e-8}, "linear", True),
         ({"method": "rodas-5p", "rtol": 1e-8}, "log", False)]  # fmt: skip


@pytest.mark.parametrize("numerics, law, turned", CASES)
def test_it_is_the_valve_whose_schedule_says_what_it_does(numerics, law, turned):
    own = fvsolve.run(main({"sav": anticipating("mid", to="sump", low_set=3e5)}, numerics, law, turned))
    events = [(event["what"], event["time"]) for event in own.summary["events"] if event["name"] == "sav"]
    assert [what for what, _ in events] == ["opens", "is fully open", "begins to shut", "is shut"]
    first = events[0][1]
    times = [first, first + OPENS, first + OPENS + HOLD, first + OPENS + HOLD + SHUTS]
    assert [time for _, time in events] == pytest.approx(times, abs=1e-11)
    opening = {"time": [0.0, *times], "value": [0.0, 0.0, 1.0, 1.0, 0.0]}
    given = fvsolve.run(main({"sav": valve("mid", "sump", 2e-3, opening)}, numerics, law, turned))
    assert own["sav.opening"] == pytest.approx(np.interp(own.t, opening["time"], opening["value"]), abs=1e-10)
    near = 1e-7 if numerics is TIGHT else 1e-5
    for probe, scale in (("sav.flow", 0.04), ("mid.pressure", 5e5), ("end.pressure", 5e5)):
        assert own[probe] == pytest.approx(given[probe], abs=near * scale)
    assert abs(own.ledger["mass"]["relative"]) < 1e-12


SECTION, LEVEL, FILL = 0.8, 6.0, 0.02
LUMPED = [{"method": "dormand-prince", "rtol": 1e-11}, {"method": "radau-iia-5", "rtol": 1e-10},
          {"method": "rodas-5p", "rtol": 1e-10}]  # fmt: skip


def vessel(numerics: dict, law: str = "linear", end: float = 6.0, fill: float = 0.0, flow_area=0.01, **more) -> dict:
    """Return a case of a tank with an inflow and the valve from its foot to ambient."""
    nodes = {"in": {"type": "inflow", "flow": fill}, "t": tank(SECTION, LEVEL)}
    links = {"throat": valve("in", "t", 0.05), "sav": anticipating("t", flow_area, **more)}
    probes = ["t.level", "sav.flow", "sav.opening"]
    return scene(nodes, links, end, numerics, probes, 0.1, fluid=WATER | {"law": law})


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("numerics", LUMPED, ids=lambda one: one["method"])
def test_tripped_it_drains_a_tank_by_the_integral_of_its_opening(numerics, law):
    """2 A (sqrt z0 - sqrt z) = CdA sqrt(2 g) times the integral of the opening."""
    result = fvsolve.run(vessel(numerics, law, trip=0.7))
    times = np.cumsum([0.7, OPENS, HOLD, SHUTS])
    assert [event["time"] for event in result.summary["events"]] == pytest.approx(times, abs=1e-11)
    t = np.asarray(result.t)
    up, down = np.clip(t - times[0], 0.0, OPENS), np.clip(t - times[2], 0.0, SHUTS)
    whole = up**2 / (2.0 * OPENS) + np.clip(t - times[1], 0.0, HOLD) + down - down**2 / (2.0 * SHUTS)
    root = math.sqrt(LEVEL) - 0.01 * math.sqrt(2.0 * GRAVITY) / (2.0 * SECTION) * whole
    near = 1e-9 if law == "linear" else 1e-4
    assert result["t.level"] == pytest.approx(root**2, rel=near)
    assert not result["sav.flow"][(t < times[0] - 1e-6) | (t > times[3] + 1e-6)].any()
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_a_high_pressure_opens_it_for_as_long_as_it_lasts_whatever_hold_says():
    """A constant inflow fills the tank to high_set repeatedly; the event times of a cycle follow SciPy."""
    high = LEVEL + 0.5
    result = fvsolve.run(vessel(LUMPED[0], end=60.0, fill=FILL, high_set=AMBIENT + RHO * GRAVITY * high))
    what, times = zip(*((event["what"], event["time"]) for event in result.summary["events"]), strict=True)
    assert what[:5] == ("opens", "is fully open", "begins to shut", "is shut", "opens")
    assert times[0] == pytest.approx(0.5 * SECTION / FILL, rel=1e-12)
    c, now, z = 0.01 * math.sqrt(2.0 * GRAVITY), times[0], high

    def piece(opening, end, falls=True):
        """Return (time, level) at which the level passes high_set, or at `end`, from `now` on."""
        passes = lambda t, y: y[0] - high  # noqa: E731
        passes.terminal, passes.direction = True, -1.0 if falls else 1.0
        rate = lambda t, y: [(FILL - c * opening(t) * math.sqrt(y[0])) / SECTION]  # noqa: E731
        found = solve_ivp(rate, (now, end), [z], rtol=1e-12, atol=1e-13, events=passes, max_step=0.1)
        return found.t[-1], found.y[0, -1]

    passed, _ = piece(lambda t: (t - times[0]) / OPENS, times[0] + OPENS)
    assert passed < times[1]  # below high_set again: at full opening it begins to shut at once
    passes = solve_ivp(lambda t, y: [(FILL - c * (t - now) / OPENS * math.sqrt(y[0])) / SECTION], (now, now + OPENS),
                       [z], rtol=1e-12, atol=1e-13)  # fmt: skip
    z, now = passes.y[0, -1], now + OPENS
    assert times[1:4] == pytest.approx([now, now, now + SHUTS], abs=1e-10)
    again, z = piece(lambda t: max(1.0 - (t - times[2]) / SHUTS, 0.0), 60.0, falls=False)
    assert times[4] == pytest.approx(again, rel=1e-9)


def test_shut_it_waits_for_a_pressure_above_low_set_before_it_opens_again():
    """The pressure at the drained tank stays below low_set, so the valve opens only once."""
    result = fvsolve.run(vessel(LUMPED[0], end=12.0, fill=1e-3, low_set=AMBIENT + RHO * GRAVITY * (LEVEL + 0.1)))
    assert result.summary["events"] == []
    assert "only after the pressure has exceeded low_set" in str(result.summary["warnings"])
    low = AMBIENT + RHO * GRAVITY * (LEVEL - 0.1)
    once = fvsolve.run(vessel(LUMPED[0], end=12.0, fill=0.0, low_set=low, trip=1.0))
    assert [event["what"] for event in once.summary["events"]].count("opens") == 1


@pytest.mark.parametrize("end", [0.9, 2.0, 4.0], ids=["opening", "open", "shutting"])
def test_resumed_in_the_midst_of_a_stroke_it_is_the_unbroken_run(tmp_path, end):
    case = vessel({"method": "rk4", "step": 0.1}, trip=0.7)
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run")
    result, whole = fvsolve.run(case, out=tmp_path / "run", resume=True), fvsolve.run(case)
    assert np.array_equal(result["t.level"], whole["t.level"]) and result.summary["events"] == whole.summary["events"]


def test_its_energy_closes_and_it_only_dissipates():
    found = energy(vessel({"method": "dormand-prince", "rtol": 1e-8}, trip=0.7))
    assert abs(found.numerical_remainder[-1]) < 1e-7 * found.throughput
    assert (np.diff(found.dissipated["sav surge anticipating"]) >= 0.0).all()


@pytest.mark.parametrize(
    "wrong, said",
    [({"trip": None}, "nothing opens the valve; expected the key `low_set`, `high_set` or `trip`"),
     ({"hold": -1.0}, "out of range"),
     ({"trip": -3.0}, "lies before the start"), ({"low_set": 4e5, "high_set": 3e5}, "is not above low_set"),
     ({"senses": "tt"}, 'unknown place of the fluid "tt"'), ({"closing_time": None}, "closing_time is missing")],
)  # fmt: skip
def test_what_is_wrong_with_one_is_said(wrong, said):
    case = vessel({"rtol": 1e-6}, trip=1.0)
    given = case["links"]["sav"] | wrong
    case["links"]["sav"] = {key: value for key, value in given.items() if value is not None}
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)
