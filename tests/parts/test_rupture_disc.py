"""Rupture discs: time of bursting and outflow in closed form, balances and resumed runs."""

import math

import numpy as np
import pytest
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, area, junction, pipe, reservoir, scene, tank, valve

import fvsolve
from fvsolve.studies.energy.energy_balance import energy

CDA, BURST, SECTION, FILL = 2e-3, 3.5e4, 0.5, 0.05


def disc(start: str, burst: float = BURST, **more) -> dict:
    return {"type": "rupture-disc", "from": start, "area": CDA, "discharge_coefficient": 1.0, "burst_pressure": burst,
            **more}  # fmt: skip


def filled(numerics: dict, law: str = "linear", **more) -> dict:
    """Return a case of a tank with a rupture disc, which a constant inflow fills from 3 m."""
    nodes = {"in": {"type": "inflow", "flow": FILL}, "t": tank(SECTION, 3.0)}
    links = {"throat": valve("in", "t", 0.05), "disc": disc("t", **more)}
    if "to" in more:
        nodes[more["to"]] = reservoir(AMBIENT)
    return scene(
        nodes, links, 20.0, numerics, ["t.level", "disc.flow", "disc.opening"], 0.5, fluid=WATER | {"law": law}
    )


def emptied(level: float) -> float:
    """Time since the burst [s]: A dz/dt = Q - c sqrt(z), so with s = sqrt(z), dt = 2 A s ds / (Q - c s)."""
    c = CDA * math.sqrt(2.0 * GRAVITY)

    def past(s):
        return -2.0 * SECTION / c * (s + FILL / c * math.log(abs(FILL - c * s)))

    return past(math.sqrt(level)) - past(math.sqrt(BURST / (RHO * GRAVITY)))


METHODS = [{"method": "dormand-prince", "rtol": 1e-10}, {"method": "radau-iia-5", "rtol": 1e-10},
           {"method": "rodas-5p", "rtol": 1e-9}, {"method": "rk4", "step": 0.1}]  # fmt: skip


@pytest.mark.parametrize("more", [{}, {"to": "sump"}], ids=["ambient", "place"])
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("numerics", METHODS, ids=lambda one: one["method"])
def test_it_bursts_when_the_level_says_and_lets_out_what_the_root_says(numerics, law, more):
    result = fvsolve.run(filled(numerics, law, **more))
    ((event),) = result.summary["events"]
    when = SECTION / FILL * (BURST / (RHO * GRAVITY) - 3.0)
    assert (event["name"], event["what"]) == ("disc", "bursts")
    assert event["time"] == pytest.approx(when, rel=1e-12 if law == "linear" else 1e-4)
    t, level, flow = np.asarray(result.t), result["t.level"], result["disc.flow"]
    before, after = t < event["time"], t > event["time"]
    assert not flow[before].any() and np.array_equal(result["disc.opening"], after.astype(float))
    assert flow[after] == pytest.approx(
        CDA * np.sqrt(2.0 * GRAVITY * level[after]), rel=1e-9 if law == "linear" else 1e-4
    )
    past = [when + emptied(z) for z in level[after]]
    assert t[after] == pytest.approx(past, rel=2e-7 if law == "linear" else 1e-3)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("law", ["linear", "log", "mixture"])
@pytest.mark.parametrize("turned", [False, True], ids=["along", "against"])
def test_a_wave_bursts_it_as_it_arrives_and_the_line_gives_what_its_impedance_says(law, turned):
    """The jump rho a v arrives after L / a; then p = 5e5 + rho a v - Z q / 2 = ambient + rho / 2 (q / CdA)^2."""
    v, speed, bore = 1.0, 1000.0, 0.2
    ends = ("gate", "far") if turned else ("far", "gate")
    nodes = {"lake": reservoir(5e5), "far": junction(), "gate": junction({"time": [0.0, 0.1],
             "value": [v * area(bore), 0.0], "kind": "step"})}  # fmt: skip
    links = {"up": pipe("lake", "far", 1000.0, bore, speed, 200), "main": pipe(*ends, 100.0, bore, speed, 20),
             "disc": disc("far", 8e5)}  # fmt: skip
    fluid = WATER | {"law": law} | ({"air_fraction": 0.0} if law == "mixture" else {})
    result = fvsolve.run(scene(nodes, links, 0.4, {"scheme": "upwind", "method": "euler", "courant": 1.0},
                               ["far.pressure", "disc.flow"], 0.01, fluid=fluid))  # fmt: skip
    (event,) = result.summary["events"]
    assert event["time"] == pytest.approx(0.2, abs=6e-3)
    jump, z = RHO * speed * v, RHO * speed / area(bore)
    k, head = RHO / (2.0 * CDA**2), 5e5 + jump - AMBIENT  # pipes on both sides: p = 5e5 + jump - Z q / 2
    q = (-0.5 * z + math.sqrt(0.25 * z**2 + 4.0 * k * head)) / (2.0 * k)
    near = 1e-9 if law == "linear" else 0.03
    after = (np.asarray(result.t) > 0.22) & (np.asarray(result.t) < 0.36)
    assert result["disc.flow"][after] == pytest.approx(q, rel=near)
    assert result["far.pressure"][after] == pytest.approx(AMBIENT + k * q**2, rel=near)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_nothing_comes_back_from_ambient_and_its_energy_closes():
    """The pressure of a lake bursts the disc and then falls below ambient."""
    nodes = {"lake": reservoir({"time": [0.0, 1.0, 3.0, 4.0], "value": [1.2e5, 2e5, 0.6e5, 1.5e5]}), "b": junction()}
    links = {"line": pipe("lake", "b", 10.0, 0.1, 1000.0, 10), "disc": disc("b", 5e4)}
    case = scene(nodes, links, 4.0, {"method": "dormand-prince", "rtol": 1e-7}, ["disc.flow", "b.pressure"])
    result = fvsolve.run(case)
    flow, gauge = result["disc.flow"], result["b.pressure"] - AMBIENT
    assert [event["what"] for event in result.summary["events"]] == ["bursts"]
    assert (gauge < -1e3).any() and not flow[gauge < 0.0].any() and flow[-1] > 0.0
    found = energy(case)
    scheme = sum(taken[-1] for taken in found.scheme.values())
    assert abs(found.numerical_remainder[-1] - scheme) < 1e-8 * found.throughput
    assert (np.diff(found.dissipated["disc rupture disc"]) >= 0.0).all()


@pytest.mark.parametrize("end", [4.0, 8.0], ids=["whole", "burst"])
def test_resumed_before_and_after_it_burst_it_is_the_unbroken_run(tmp_path, end):
    case = filled({"method": "rk4", "step": 0.1})
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run")
    result, whole = fvsolve.run(case, out=tmp_path / "run", resume=True), fvsolve.run(case)
    assert np.array_equal(result["t.level"], whole["t.level"]) and result.summary["events"] == whole.summary["events"]


def test_placed_by_chainage_it_stands_off_the_pipe():
    nodes, links = {"a": reservoir(2e5), "b": junction()}, {"main": pipe("a", "b", 100.0, 0.2, 1000.0, 10)}
    links["disc"] = {key: value for key, value in disc("", 2e5).items() if key != "from"} | {"on": "main", "at": 50.0}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 0.1, {"scheme": "upwind"})))
    assert model.valve_names == ["disc"] and "disc.outside" in model.node_names and len(model.tables.pipes) == 2


@pytest.mark.parametrize(
    "wrong, said",
    [({"burst_pressure": -1.0}, "out of range"), ({"burst_pressure": 2e4}, "would burst the disc; raise `burst_"),
     ({"from": "nowhere"}, "nowhere"), ({"area": None}, "needs area or diameter")],
)  # fmt: skip
def test_what_is_wrong_with_a_disc_is_said(wrong, said):
    case = filled({"rtol": 1e-6})
    given = case["links"]["disc"] | wrong
    case["links"]["disc"] = {key: value for key, value in given.items() if value is not None}
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)
