"""Vessels with a shape: volumes by quadrature, oscillations in closed form and by SciPy, compressors by the gas law."""

import math

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, area, reservoir, scene, valve
from scipy.integrate import quad, solve_ivp

import fvsolve
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.parts.accumulator import law_vessel
from fvsolve.studies.energy_balance import energy

TIGHT = {"method": "dormand-prince", "rtol": 1e-11}
LENGTH, BORE = 20.0, area(0.1)
P0, N, VOLUME, ACROSS = 6e5, 1.3, 0.1, 0.3
INERTIA = RHO * LENGTH / BORE  # inertance of the column, dp = INERTIA dq/dt
RADIUS, LONG = 0.5 * ACROSS, VOLUME / area(ACROSS)
TABLE = {"level": [0.0, 0.5, 1.0], "area": [0.05, 0.1, 0.08]}
SHAPES = {
    "upright": {"diameter": ACROSS, "level": 0.7},
    "sloped": {"diameter": ACROSS, "slope": 0.4, "level": 0.4},
    "lying": {"diameter": ACROSS, "slope": 0.0, "level": 0.18},
    "table": {"area": TABLE, "level": 0.6},
    "prism": {"area": 0.08, "level": 0.6},
}


def surface(shape: str, z: float) -> float:
    """Free surface [m2] of a vessel at the level z [m]."""
    if shape == "upright":
        return area(ACROSS)
    if shape in ("table", "prism"):
        return float(np.interp(z, TABLE["level"], TABLE["area"])) if shape == "table" else 0.08
    return section(0.4 if shape == "sloped" else 0.0, z)


def section(slope: float, z: float, radius: float = RADIUS, length: float = LONG) -> float:
    """Free surface [m2] of a cylinder that is not upright: the integral of its chords at the level z [m]."""
    if slope == 0.0:
        return 2.0 * length * math.sqrt(max(0.0, z * (2.0 * radius - z)))
    low = max(-radius, (z - length * math.sin(slope)) / math.cos(slope) - radius)
    high = min(radius, z / math.cos(slope) - radius)

    def below(w):
        return w * math.sqrt(max(0.0, radius**2 - w * w)) + radius**2 * math.asin(w / radius)

    return (below(high) - below(low)) / math.sin(slope) if high > low else 0.0


def vessel(shape: str = "sloped", **more) -> dict:
    return {
        "type": "accumulator",
        "volume": VOLUME,
        "exponent": N,
        "bottom": 0.5,
        **SHAPES[shape],
        **more,
    }


def swing(
    flow: float, end: float, numerics=TIGHT, law="linear", probes=("a.level", "c.flow"), **more
) -> dict:
    """Return a case of a rigid column between a reservoir and a vessel, with the initial flow `flow` [m3/s]."""
    nodes = {"lake": reservoir(P0), "a": vessel(**more)}
    links = {
        "c": {
            "type": "rigid-column",
            "from": "lake",
            "to": "a",
            "length": LENGTH,
            "diameter": 0.1,
            "initial_flow": flow,
        }
    }
    return scene(nodes, links, end, numerics, probes, fluid=WATER | {"law": law})


def model_of(case):
    return fvsolve.build(fvsolve.load(case))


def at_start(model) -> tuple[float, float]:
    """Return (volume [m3], pressure [Pa]) of the gas at the start, from the tables of a model."""
    numbers = model.tables.floats[model.tables.devices[0]["data"] :]
    return float(numbers[law_vessel.GAS_VOLUME]), float(numbers[law_vessel.GAS_PRESSURE])


@pytest.mark.parametrize("degrees", [0.0, 0.05, 1.0, 20.0, 45.0, 75.0, 89.99])
def test_volume_of_a_cylinder_below_a_level_is_the_quadrature_of_its_sections(degrees):
    radius, length, slope = 1.1, 5.3, math.radians(degrees)
    top, whole = (
        length * math.sin(slope) + 2.0 * radius * math.cos(slope),
        math.pi * radius**2 * length,
    )
    kind = law_vessel.HORIZONTAL_CYLINDER if degrees == 0.0 else law_vessel.INCLINED_CYLINDER
    shape = np.array([kind, top, radius, length, slope])
    bends = sorted((length * math.sin(slope), 2.0 * radius * math.cos(slope)))
    for z in np.linspace(0.01, 0.99, 7) * top:
        edges = [0.0, *(min(max(bend, 0.0), z) for bend in bends), z]
        below, moment = (
            sum(
                quad(
                    lambda h, k=k: h**k * section(slope, h, radius, length),
                    a,
                    b,
                    epsabs=1e-13,
                    epsrel=1e-12,
                )[0]
                for a, b in zip(edges, edges[1:], strict=False)
                if b > a
            )
            for k in (0, 1)
        )
        assert law_vessel.volume_below(shape, 0, z) == pytest.approx(below, abs=1e-12 * whole)
        assert law_vessel.moment_below(shape, 0, z) == pytest.approx(
            moment, abs=1e-12 * whole * top
        )
        assert law_vessel.surface_at(shape, 0, z) == pytest.approx(
            section(slope, z, radius, length), abs=1e-11 * whole
        )
        assert law_vessel.level_at(shape, 0, below) == pytest.approx(z, abs=1e-12 * top)
    assert law_vessel.volume_below(shape, 0, top) == pytest.approx(whole, rel=1e-12)


def test_a_cylinder_of_small_inclination_approaches_a_horizontal_or_an_upright_cylinder():
    for slope, near in ((0.0, 3e-6), (90.0, 89.9999)):
        found = [
            at_start(model_of(swing(0.0, 1.0, slope=f"{one:.12f} deg", level=0.2)))
            for one in (slope, near)
        ]
        assert found[0] == pytest.approx(found[1], rel=1e-5)


@pytest.mark.in_turn
@pytest.mark.parametrize("law, near", [("linear", 1e-8), ("log", 5e-4), ("mixture", 5e-4)])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_small_oscillation_has_its_closed_period(shape, law, near):
    """omega^2 = A / (rho L) (n p / V + rho g / surface); other laws add the compressibility of the fluid inside."""
    model = model_of(swing(0.0, 1.0, law=law, shape=shape))
    gas, p = at_start(model)
    assert p == pytest.approx(
        P0 - RHO * GRAVITY * (0.5 + SHAPES[shape]["level"]), rel=1e-8 if law == "linear" else 1e-4
    )
    exact = math.sqrt(
        (N * p / gas + RHO * GRAVITY / surface(shape, SHAPES[shape]["level"])) / INERTIA
    )
    assert np.linalg.eigvals(model.jacobian(0.0, np.zeros(2))).imag.max() == pytest.approx(
        exact, rel=near
    )
    assert not model.rhs(0.0, np.zeros(2)).any()


def exact_swing(shape: str, flow: float, t, first: float, gas: float) -> np.ndarray:
    """Return (flow, gas volume, level) over time by SciPy; the level is integrated from the surface alone."""

    def rates(now, y):
        p = first * (gas / y[1]) ** N + RHO * GRAVITY * (0.5 + y[2])
        return (P0 - p) / INERTIA, -y[0], y[0] / surface(shape, y[2])

    start = [flow, gas, SHAPES[shape]["level"]]
    return solve_ivp(rates, (0.0, t[-1]), start, "DOP853", t_eval=t, rtol=1e-12, atol=1e-14).y


@pytest.mark.parametrize(
    "shape, numerics, near",
    [
        ("sloped", TIGHT, 1e-8), ("lying", TIGHT, 1e-8), ("table", TIGHT, 1e-7),
        ("sloped", {"method": "gauss-6", "step": 5e-3}, 1e-8),
        ("sloped", {"method": "rodas-5p", "rtol": 1e-9}, 1e-6),
    ],
)  # fmt: skip
def test_a_large_oscillation_follows_scipy(shape, numerics, near):
    """Explicit, implicit and linearly implicit methods; kinks in the surface of a table limit the accuracy."""
    case = swing(0.04, 2.0, numerics, shape=shape, probes=["c.flow", "a.gas_volume", "a.level"])
    result, gas = fvsolve.run(case), at_start(model_of(case))
    exact = exact_swing(shape, 0.04, np.asarray(result.t), gas[1], gas[0])
    for name, true in zip(("c.flow", "a.gas_volume", "a.level"), exact, strict=True):
        assert result[name] == pytest.approx(true, abs=near * np.abs(true).max())


def test_under_a_compressible_law_it_differs_by_the_first_order_of_its_compressibility():
    off = []
    for beta in (2.2e9, 8.8e9):
        one, other = (swing(0.04, 1.0, law=law) for law in ("linear", "log"))
        for case in (one, other):
            case["fluid"] |= {"bulk_modulus": beta, "pressure": P0}
        off.append(np.abs(fvsolve.run(one)["a.level"] - fvsolve.run(other)["a.level"]).max())
    assert off[0] < 1e-3 and off[0] / off[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "mixture"])
@pytest.mark.parametrize("more", [{}, {"shape": "table", "exponent": 1.0}])
def test_its_energy_closes_and_its_compressor_supplies(law, more):
    """The balance contains the potential energy of the fluid, the energy of the gas and the work of the compressor."""
    compressor = {"start": 0.3, "stop": 0.05, "flow": 0.02}
    case = swing(0.02, 1.0, {"method": "gauss-6", "step": 2e-3}, law, compressor=compressor, **more)
    one = energy(case, port="lake")
    column = sum(loss[-1] for loss in one.law.values())  # law loss of the rigid column
    assert abs(one.numerical_remainder[-1] - column) < 1e-10 * one.throughput
    assert sum(one.supplied["a"]) > 0.0 and one.at_start["a"] > 0.0


def test_its_level_gives_the_volume_of_gas_and_its_gas_pressure_holds():
    """A level and the gas volume that it leaves give equal starts; a given gas pressure is kept."""
    model = model_of(swing(0.0, 1.0))
    gas, first = at_start(model)
    by_gas = swing(0.0, 1.0, gas_volume=gas)
    del by_gas["nodes"]["a"]["level"]
    assert at_start(model_of(by_gas)) == pytest.approx((gas, first), rel=1e-14)
    for law in ("linear", "log", "mixture"):
        case = swing(0.0, 1.0, law=law, initial_pressure=4e5)
        del case["links"]["c"]["initial_flow"]
        assert at_start(model_of(case | {"numerics": {**case["numerics"], "initial": "rest"}}))[
            1
        ] == pytest.approx(4e5, rel=1e-12)


def test_higher_by_as_much_as_its_reservoir_it_swings_alike():
    found = []
    for height in (0.0, 200.0):
        case = swing(0.04, 1.0)
        case["nodes"]["lake"] |= {"elevation": height}
        case["nodes"]["a"] |= {"elevation": height}
        found.append(fvsolve.run(case))
    assert found[1]["a.level"] == pytest.approx(found[0]["a.level"], rel=1e-11)


def pumped(flow, end: float, numerics=TIGHT, **more) -> dict:
    """Return a case of a given flow into an upright vessel."""
    nodes = {
        "in": {"type": "inflow", "flow": flow},
        "a": vessel("upright", initial_pressure=P0, **more),
    }
    links = {"gap": {"type": "valve", "from": "in", "to": "a", "area": 1e-3}}
    return scene(nodes, links, end, numerics, ("a.gas_pressure", "a.gas_volume", "a.level"), 0.05)


COMPRESSOR = {"start": 0.8, "stop": 0.75, "flow": 2e-3}
TURN, Q = 12.0, 1e-3
TURNS = {"time": [0.0, TURN], "value": [Q, -Q], "kind": "step"}


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_its_compressor_starts_and_stops_at_its_levels_and_brings_gas_by_its_law(n):
    """(p / p0)^(1/n) p0 V = p0 V0 + p_ambient flow t while the compressor runs between its levels."""
    result = fvsolve.run(pumped(TURNS, 30.0, exponent=n, compressor=COMPRESSOR))
    start, top = 0.1 * area(ACROSS) / Q, 0.7 + Q * TURN / area(ACROSS)
    stop = TURN + (top - 0.75) * area(ACROSS) / Q
    events = [(event["what"], event["time"]) for event in result.summary["events"]]
    assert [what for what, _ in events] == ["compressor starts", "compressor stops"]
    assert [time for _, time in events] == pytest.approx([start, stop], abs=1e-9)
    ran, gas = np.clip(np.asarray(result.t) - start, 0.0, stop - start), VOLUME - 0.7 * area(ACROSS)
    held = P0 * gas + AMBIENT * COMPRESSOR["flow"] * ran
    found = (result["a.gas_pressure"] / P0) ** (1.0 / n) * P0 * result["a.gas_volume"]
    assert found == pytest.approx(held, rel=1e-10)


@pytest.mark.parametrize("end", [9.0, 20.0])
def test_resumed_its_compressor_runs_on(tmp_path, end):
    case = pumped(TURNS, 30.0, {"method": "rk4", "step": 0.05}, compressor=COMPRESSOR)
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run", pictures=False)
    result = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case)
    assert np.array_equal(result["a.gas_pressure"], whole["a.gas_pressure"])
    assert result.summary["events"] == whole.summary["events"]


def test_a_level_above_its_start_at_the_start_lets_it_run_and_a_level_between_does_not():
    for stop, start, runs in ((0.3, 0.6, True), (0.6, 0.9, False)):
        compressor = {"start": start, "stop": stop, "flow": 1e-4}
        result = fvsolve.run(pumped(0.0, 1.0, compressor=compressor))
        assert (result["a.gas_pressure"][-1] > P0 * (1.0 + 1e-6)) == runs


def test_an_empty_vessel_gives_a_notice_and_fills_again():
    result = fvsolve.run(
        swing(-0.04, 4.0, {"rtol": 1e-8}, level=0.02, probes=["a.level", "a.gas_pressure"])
    )
    texts = [event["what"] for event in result.summary["events"]]
    assert result.ok and texts[:2] == ["is empty", "holds fluid again"]
    away = (result.t > result.summary["events"][0]["time"]) & (
        result.t < result.summary["events"][1]["time"]
    )
    assert np.all(result["a.level"][away] == 0.0) and result["a.level"][-1] >= 0.0
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_the_pattern_holds_every_coupling():
    model = model_of(swing(0.01, 1.0, compressor={"start": 0.3, "stop": 0.1, "flow": 1e-3}))
    with model.run_data(1.0):
        pattern = jacobian_pattern(model).toarray()[: model.y_size]
        assert not np.any(
            (np.abs(model.jacobian(0.0, np.array([0.1, 0.3, 0.01]))) > 1e-9) & ~pattern
        )


def test_its_norm_is_the_curvature_of_its_energy():
    """The squared energy norm of a small deviation is the mean energy of the deviation and its opposite."""
    model = model_of(swing(0.0, 1.0, compressor={"start": 0.5, "stop": 0.1, "flow": 1e-3}))
    names, y = list(model.state_names), np.zeros(model.y_size)
    y[names.index("a.mass")], y[names.index("a.gas")] = 2e-3, -3e-5
    ((_, part, device),), (row,) = model.devices, model.tables.devices
    out = model.evaluate(0.0, np.zeros(model.y_size))[1]
    found = sum(
        sum(factor * y[k] for k, factor in one.items()) ** 2
        for one in device.energy_rows(model, part, row, np.zeros(model.y_size), out)
    )
    tables, node = model.tables, model.tables.nodes[row["node"]]
    both = [
        law_vessel.stored_energy_change(
            tables.settings[0],
            tables.floats,
            node,
            int(row["data"]),
            sign * y[node["y"]],
            sign * y[row["y"]],
        )
        for sign in (1.0, -1.0)
    ]
    assert found == pytest.approx(0.5 * sum(both), rel=1e-4)


def test_limits_and_claims_look_at_its_level():
    limits = {
        "full": {"on": "a", "quantity": "level", "maximum": 0.35},
        "empty": {"on": "a", "quantity": "level", "minimum": 0.1},
    }
    case = swing(0.04, 1.0, limits=limits)
    case |= {"limits": limits, "expect": {"max(a.level)": {"value": 0.43, "atol": 0.05}}}
    del case["nodes"]["a"]["limits"]
    result = fvsolve.run(case)
    assert {one["name"]: one["ok"] for one in result.summary["verdicts"]} == {
        "full": False,
        "empty": True,
    }


@pytest.mark.parametrize(
    "wrong, said",
    [
        (
            {"diameter": None, "slope": None},
            "level: has no effect on a vessel without a shape; give the key `diameter` or `area`",
        ),
        ({"gas_volume": 0.05}, "gas_volume and level are given; keep one"),
        ({"level": None}, "no gas; expected one of precharge, gas_volume, level"),
        ({"area": 0.1}, "diameter and area are given; keep one"),
        ({"diameter": None, "area": 0.1}, "slope: applies only with `diameter`"),
        ({"level": None, "precharge": 4e5}, "is not valid with `precharge` (a bladder)"),
        (
            {"slope": 45.0},
            '2578.31 deg is steeper than upright; expected 0 to 90 deg, did you mean "45 deg"',
        ),
        ({"slope": -0.1}, "out of range"),
        ({"level": 5.0}, "5 m leaves no volume for gas; the vessel is full at 0.827"),
        (
            {"compressor": {"start": 0.2, "stop": 0.3, "flow": 1e-3}},
            "compressor.stop: 0.3 m is not below the level `start`",
        ),
        (
            {"compressor": {"start": 2.0, "stop": 0.3, "flow": 1e-3}},
            "2 m is never reached; expected less than",
        ),
        ({"compressor": {"start": 0.2}}, "stop is missing"),
        (
            {"bottom": 70.0},
            "no steady state: the pressure at the node, 600000 Pa, is below that of the fluid column, 70.4 m",
        ),
        ({"inclination": 0.2}, "slope"),
    ],
)
def test_faults_of_a_shape_are_reported(wrong, said):
    case = swing(0.0, 1.0)
    given = case["nodes"]["a"] | wrong
    case["nodes"]["a"] = {key: value for key, value in given.items() if value is not None}
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)


def test_all_faults_are_reported_at_once_and_a_vessel_without_a_shape_has_no_level():
    case = swing(
        0.0, 1.0, slope=2.0, gas_volume=0.2, compressor={"start": 0.1, "stop": 0.2, "flow": -1.0}
    )
    error = refused(case)
    assert all(key in str(error) for key in ("gas_volume", "compressor.flow"))
    bare = swing(0.0, 1.0)
    bare["nodes"]["a"] = {"type": "accumulator", "volume": VOLUME, "gas_volume": 0.05}
    refused(bare, "level")


def test_a_valve_at_its_node_carries_the_flow_of_both_heads():
    """Two isolated vessels equalise until gas pressure plus weight of the fluid are equal at the valve."""
    nodes = {"a": vessel("upright"), "b": vessel("lying", initial_pressure=4e5)}
    nodes["a"]["initial_pressure"] = P0
    result = fvsolve.run(
        scene(
            nodes,
            {"v": valve("a", "b", 1e-3)},
            40.0,
            {"method": "radau-iia-5", "rtol": 1e-8},
            ["a.pressure", "b.pressure", "a.gas_pressure", "a.level"],
            1.0,
        )
    )
    assert result["a.pressure"][-1] == pytest.approx(result["b.pressure"][-1], abs=2.0)
    weight = RHO * GRAVITY * (0.5 + result["a.level"])
    assert result["a.pressure"] == pytest.approx(result["a.gas_pressure"] + weight, rel=1e-12)
