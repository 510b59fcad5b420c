"""Density law `log` compared with exact solutions, and its distance from `linear`. Soft fluid: c = 10 m/s."""

import numpy as np
import pytest
from reference import scenes
from reference.log_law import LogFluid, Riemann, SimpleWave
from reference.orders import observed_order
from reference.scenes import (
    AMBIENT,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    stiff_pipe,
    valve,
)
from scipy.optimize import brentq

import fvsolve

EXACT = LogFluid(1000.0, 1e5, AMBIENT)
SOFT = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": 1e5,
    "viscosity": 1e-3,
    "vapor_pressure": 100.0,
    "pressure": AMBIENT,
    "law": "log",
}
C = 10.0
LENGTH, DIAMETER, END = 100.0, 0.5, 1.8
AREA = scenes.area(DIAMETER)


def resting_pipe(cells: int, **numerics) -> fvsolve.Model:
    """Model of a closed pipe at reference pressure with a distant reservoir; only its inside is used."""
    nodes = {"left": reservoir(AMBIENT), "right": junction()}
    links = {
        "main": stiff_pipe("left", "right", LENGTH, DIAMETER, cells, friction=scenes.NO_FRICTION)
    }
    case = scene(nodes, links, 10.0, numerics, ["right.pressure"], 0.1, fluid=SOFT)
    return fvsolve.build(fvsolve.load(case))


def fill(state, rho: np.ndarray, flux: np.ndarray) -> None:
    """Set the two deviation waves of the only pipe to cell averages of density and mass flux."""
    n = len(rho)
    dense, flow = C * AREA * (rho - 1000.0), AREA * flux
    state.y[:n], state.y[n : 2 * n] = (dense + flow) / 2, (dense - flow) / 2


def read(state, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell averages of density and mass flux."""
    r, back = state.y[:n], state.y[n : 2 * n]
    return 1000.0 + (r + back) / (C * AREA), (r - back) / AREA


STATES = {
    "two shocks": ((AMBIENT, 0.5), (AMBIENT, -0.5)),
    "two rarefactions": ((AMBIENT, -0.5), (AMBIENT, 0.5)),
    "shock and rarefaction": ((AMBIENT + 1e4, 0.0), (AMBIENT, 0.0)),
    "the mirror image": ((AMBIENT, 0.0), (AMBIENT + 1e4, 0.0)),
    "moving, unequal": ((AMBIENT + 5e3, 1.0), (AMBIENT - 5e3, 0.3)),
}


def riemann_run(name: str, cells: int, scheme: str, method: str = "ssp-rk3"):
    """Places, computed and exact (density, flux), and solution of a Riemann problem at the middle of the pipe."""
    left, right = {**STATES, **STRONG}[name]
    model = resting_pipe(cells, scheme=scheme, method=method, courant=0.5)
    state = fvsolve.initial_state(model)
    half = np.arange(cells) < cells // 2
    rho = np.where(half, EXACT.rho(left[0]), EXACT.rho(right[0]))
    fill(state, rho, rho * np.where(half, left[1], right[1]))
    state = fvsolve.advance(model, state, END)
    x = (np.arange(cells) + 0.5) * LENGTH / cells
    inner = (x > 22) & (x < 78)  # reflections of the wall and the reservoir are outside
    riemann = Riemann(EXACT, left, right)
    sampled = []
    for place in x[inner]:
        rays = [
            (place - LENGTH / 2 + LENGTH / cells * s) / END for s in (np.arange(8) + 0.5) / 8 - 0.5
        ]
        found = np.array([(EXACT.rho(p), EXACT.rho(p) * u) for p, u in map(riemann.at, rays)])
        sampled.append(found.mean(axis=0))
    exact = np.array(sampled).T
    found = np.array(read(state, cells))[:, inner]
    return x[inner] - LENGTH / 2, found, exact, riemann


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("name", STATES)
def test_riemann_problem_reaches_the_exact_middle_state(name, scheme):
    x, found, exact, riemann = riemann_run(name, 400, scheme)
    p, u = riemann.middle()
    inside = np.abs(x / END - u) < 0.5 * C
    jump = max(
        abs(EXACT.rho(s[0]) - EXACT.rho(p)) + EXACT.rho(p) / C * abs(s[1] - u) for s in STATES[name]
    )
    assert inside.sum() > 20
    assert found[0][inside] == pytest.approx(float(EXACT.rho(p)), abs=1e-3 * jump)
    assert found[1][inside] == pytest.approx(float(EXACT.rho(p) * u), abs=1e-3 * jump * C)


STRONG = {
    "two strong shocks": ((AMBIENT, 2.0), (AMBIENT, -2.0)),
    "two strong rarefactions": ((AMBIENT, -2.0), (AMBIENT, 2.0)),
    "strong shock and rarefaction": ((AMBIENT + 2e4, 0.0), (AMBIENT, 0.0)),
    "its mirror image": ((AMBIENT, 0.0), (AMBIENT + 2e4, 0.0)),
}


@pytest.mark.parametrize("name", STRONG)
def test_riemann_problem_converges_to_the_exact_profile(name):
    """The waves are strong enough for fans wider than smeared jumps, and for shocks that steepen."""
    errors = []
    for cells in (400, 800):
        _, found, exact, _ = riemann_run(name, cells, "muscl")
        errors.append(np.mean(np.abs(found[0] - exact[0])) / np.ptp(exact[0]))
    assert errors[1] < 1e-2
    assert observed_order(errors, [2.0, 1.0]) > 0.75


def stopped_run(velocity: float, law: str, cells: int, scheme: str):
    """Run of a stream that stops at a dead end, until shortly before the lake's reflection."""
    nodes = {"lake": reservoir(3 * AMBIENT), "gate": junction()}
    main = stiff_pipe("lake", "gate", LENGTH, DIAMETER, cells, friction=scenes.NO_FRICTION)
    main["initial_flow"] = velocity * AREA
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.8}
    probes = ["gate.pressure", "main.pressure@0.5", "main.velocity@0.5"]
    fluid = {**SOFT, "pressure": 3 * AMBIENT, "law": law}
    return fvsolve.run(scene(nodes, {"main": main}, 8.0, numerics, probes, 0.05, fluid=fluid))


def stopped(velocity: float, law: str, cells: int = 200, scheme: str = "muscl"):
    """Pressure and velocity before the stop, and pressures of the plateau at the gate."""
    result = stopped_run(velocity, law, cells, scheme)
    before = result["main.pressure@0.5"][0], result["main.velocity@0.5"][0]
    return before, result["gate.pressure"][(result.t > 4.0) & (result.t < 8.0)]


@pytest.mark.parametrize("mach", [0.01, 0.05, 0.1])
def test_a_stopped_stream_rises_by_the_exact_shock(mach):
    (p, u), found = stopped(mach * C, "log")
    exact = LogFluid(1000.0, 1e5, 3 * AMBIENT)
    wanted = exact.stopped(p, u)
    assert found == pytest.approx(wanted, abs=1e-4 * (wanted - p))
    joukowsky = float(exact.rho(p) * exact.c(p)) * u
    assert (found.mean() - p) / joukowsky - 1 == pytest.approx(mach / 4, rel=0.02 + mach)


@pytest.mark.parametrize("mach", [0.02, 0.05])
def test_the_gate_feels_the_whole_shock_from_the_first_instant_and_no_more(mach):
    """The first row and the extreme have the exact shock, which differs from that of the linear law by 3 v / 4 c.

    The first row is exact; while the shock forms over ten cells, every scheme oscillates by 0.22 v / c.
    """
    result = stopped_run(mach * C, "log", 200, "muscl")
    p, u = result["main.pressure@0.5"][0], result["main.velocity@0.5"][0]
    rise = LogFluid(1000.0, 1e5, 3 * AMBIENT).stopped(p, u) - p
    assert result["gate.pressure"][0] - p == pytest.approx(rise, rel=0.02 * mach)
    assert result.extremes["gate.pressure"][2] - p == pytest.approx(rise, rel=0.25 * mach)


def test_the_distance_of_linear_to_log_is_of_the_order_of_the_mach_number():
    def distance(mach: float) -> float:
        rises = []
        for law in ("linear", "log"):
            (p, _), found = stopped(mach * C, law)
            rises.append(found.mean() - p)
        return abs(rises[1] / rises[0] - 1)

    far, near = distance(0.04), distance(0.02)
    assert far / near == pytest.approx(2.0, rel=0.15)
    assert far < 0.04


def test_linear_is_classical_water_hammer_at_any_velocity():
    for mach in (0.01, 0.1):
        (p, _), found = stopped(mach * C, "linear")
        assert found.mean() - p == pytest.approx(1000.0 * C * mach * C, rel=1e-6)


def test_a_stream_leaves_the_lake_with_the_lake_s_stagnation_enthalpy():
    """With h = -(beta / rho_0) exp(-(p - p_0) / beta), so that dh = dp / rho, the entrance causes no loss."""
    result = stopped_run(0.1 * C, "log", 50, "muscl")
    p, u = result["main.pressure@0.5"][0], result["main.velocity@0.5"][0]

    def enthalpy(q: float) -> float:
        return -100.0 * np.exp(-(q - 3 * AMBIENT) / 1e5)

    assert enthalpy(p) + u**2 / 2 == pytest.approx(enthalpy(3 * AMBIENT), abs=1e-9 * u**2)


def simple_wave_error(cells: int, scheme: str, height: float = 2.0) -> float:
    """Sum of the relative L1 errors of density and flux after a simple wave of 33 m, half way to its breaking."""
    width, centre, end = 5.0, 27.0, 3.0

    def velocity(x):
        return height * np.exp(-(((x - centre) / width) ** 2))

    wave = SimpleWave(
        EXACT, AMBIENT, velocity, lambda x: -2 * (x - centre) / width**2 * velocity(x)
    )
    edges = np.linspace(0, LENGTH, cells + 1)
    assert 0.4 < end / wave.breaks(edges) < 0.7
    model = resting_pipe(cells, scheme=scheme, method="dormand-prince", courant=0.5)
    state = fvsolve.initial_state(model)
    fill(state, *wave.averages(edges, 0.0))
    state = fvsolve.advance(model, state, end)
    rho, flux = wave.averages(edges, end)
    found = read(state, cells)
    return float(
        np.mean(np.abs(found[0] - rho)) / np.ptp(rho)
        + np.mean(np.abs(found[1] - flux)) / np.ptp(flux)
    )


@pytest.mark.parametrize(
    "scheme, order, cells",
    [
        ("upwind", 1, 800),
        ("muscl", 2, 400),
        ("upwind3", 3, 400),
        ("upwind5", 5, 800),
        ("weno5", 5, 800),
    ],
)
def test_a_smooth_simple_wave_is_followed_at_the_order_of_the_scheme(scheme, order, cells):
    errors = [simple_wave_error(n, scheme) for n in (cells, 2 * cells)]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(order, abs=0.3)


def test_a_simple_wave_leaves_the_other_family_alone():
    """No deviation remains behind the wave; a wrong sign in the invariants would cause one."""
    width, centre = 5.0, 27.0

    def velocity(x):
        return 0.5 * np.exp(-(((x - centre) / width) ** 2))

    wave = SimpleWave(
        EXACT, AMBIENT, velocity, lambda x: -2 * (x - centre) / width**2 * velocity(x)
    )
    model = resting_pipe(200, scheme="upwind5", method="rk4", courant=0.5)
    state = fvsolve.initial_state(model)
    fill(state, *wave.averages(np.linspace(0, LENGTH, 201), 0.0))
    before = np.max(np.abs(read(state, 200)[0] - 1000.0))
    state = fvsolve.advance(model, state, 5.0)
    rho, _ = read(state, 200)
    assert np.max(np.abs(rho[:70] - 1000.0)) < 1e-4 * before


@pytest.mark.parametrize("law", ["linear", "log"])
def test_mass_is_conserved_to_round_off_under_both_laws(law):
    nodes = {"lake": reservoir(3 * AMBIENT), "gate": junction(scenes.step(1.0, 0.05, 0.0))}
    links = {"main": stiff_pipe("lake", "gate", LENGTH, DIAMETER, 100, friction=scenes.NO_FRICTION)}
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}
    fluid = {**SOFT, "pressure": 3 * AMBIENT, "law": law}
    result = fvsolve.run(scene(nodes, links, 60.0, numerics, ["gate.pressure"], 1.0, fluid=fluid))
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_under_the_table_law_a_stopped_stream_rises_along_the_isentrope_of_coolprop():
    from CoolProp.CoolProp import PropsSI

    velocity, start = 20.0, 1e7
    fluid = {"name": "Water", "temperature": 293.15, "pressure": start, "law": "table"}
    nodes = {"lake": reservoir(start), "gate": junction()}
    main = stiff_pipe("lake", "gate", 1000.0, DIAMETER, 800, friction=scenes.NO_FRICTION)
    main["initial_flow"] = velocity * AREA
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}
    probes = ["gate.pressure", "main.pressure@0.5", "main.velocity@0.5"]
    result = fvsolve.run(scene(nodes, {"main": main}, 0.5, numerics, probes, 0.01, fluid=fluid))
    p, u = result["main.pressure@0.5"][0], result["main.velocity@0.5"][0]
    entropy = PropsSI("S", "T", 293.15, "P", start, "Water")

    def volume(q: float) -> float:
        return 1 / PropsSI("D", "P", q, "S", entropy, "Water")

    wanted = brentq(
        lambda q: (q - p) * (volume(p) - volume(q)) - u**2, p + 1e6, p + 1e8, rtol=1e-13
    )
    found = result["gate.pressure"][(result.t > 0.1) & (result.t < 0.5)]
    assert u == pytest.approx(velocity, rel=1e-3)
    assert found - p == pytest.approx(wanted - p, rel=1e-4)


@pytest.mark.parametrize("law", [{"law": "log"}, {"law": "mixture", "air_fraction": 0.01}])
def test_a_valve_without_flow_is_solved_to_the_rounding_of_pressures(law):
    """A chamber behind a valve is in equilibrium with a flowing main; the rounding of its drop causes no flow."""
    rough = {"friction": {"model": "quasi-steady", "roughness": 1e-4}}
    nodes = {
        "hill": lake(60.0),
        "low": lake(40.0),
        "top": junction(elevation=48.0),
        "fork": junction(elevation=5.0),
        "pot": chamber(0.1, elevation=20.0),
    }
    links = {
        "up": pipe("hill", "top", 200.0, 0.1, 1200.0, 12, **rough),
        "down": pipe("top", "fork", 300.0, 0.1, 1100.0, 18, **rough),
        "on": pipe("fork", "low", 150.0, 0.08, 1200.0, 9, **rough),
        "neck": valve("fork", "pot", 1e-4),
    }
    fluid = {
        "name": "user",
        "density": 870.0,
        "bulk_modulus": 1.7e9,
        "viscosity": 0.04,
        "vapor_pressure": 10.0,
        **law,
    }
    case = scene(
        nodes,
        links,
        0.5,
        {"scheme": "weno5", "method": "rk4", "courant": 0.4},
        ["pot.pressure"],
        fluid=fluid,
    )
    done = fvsolve.run(case)
    assert done.ok, done.reason
    assert np.ptp(done["pot.pressure"]) == 0.0


@pytest.mark.parametrize("where", ["inflow", "demand"])
def test_flows_that_are_given_are_volumes_at_the_reference_density(where):
    """At 2000 bar water is 1.095 = exp(2000 bar / 2.2 GPa) times as dense, and a pipe has less volume flow."""
    flow, end, high = 1e-3, 0.5, 2e8 + AMBIENT
    fluid = scenes.WATER | {"law": "log", "pressure": AMBIENT}
    given = {"type": "inflow", "flow": flow} if where == "inflow" else junction(-flow)
    nodes = {"in": given, "lake": reservoir(high)}
    line = pipe("in", "lake", 10.0, 0.1, 1400.0, 5)
    result = fvsolve.run(scene(nodes, {"line": line}, end, {}, ["line.flow@1"], fluid=fluid))
    assert result.ledger["mass"]["inflow"] == pytest.approx(scenes.RHO * flow * end, rel=1e-9)
    assert result["line.flow@1"][-1] == pytest.approx(flow / np.exp(2e8 / 2.2e9), rel=1e-6)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["log", "table"])
@pytest.mark.parametrize("heads", [(60.0, 58.0), (58.0, 60.0), (60.0, 59.99)])
@pytest.mark.parametrize("length, diameter", [(30.0, 0.5), (2.0, 2.0), (1.0, 0.05), (500.0, 1.5)])
def test_a_short_wide_pipe_starts_with_its_friction_and_the_jet_that_leaves_it(
    law, heads, length, diameter
):
    """f L / D v^2 / 2 + v^2 / 2 = g dH, also if the jet takes more than friction, or nearly everything."""
    fluid = {**scenes.WATER, "law": "log"} if law == "log" else {"name": "Water", "law": "table"}
    factor = 0.011
    friction = {"model": "quasi-steady", "factor": factor}
    links = {"main": stiff_pipe("a", "b", length, diameter, 4, friction=friction)}
    model = fvsolve.build(
        fvsolve.load(
            scene(
                {"a": lake(heads[0]), "b": lake(heads[1])},
                links,
                1.0,
                {},
                ["main.flow"],
                0.1,
                fluid=fluid,
            )
        )
    )
    asked = np.sqrt(
        2.0 * scenes.GRAVITY * abs(heads[0] - heads[1]) / (factor * length / diameter + 1.0)
    )
    assert abs(model.checks["pipes"]["main"]["velocity"]) == pytest.approx(asked, rel=1e-3)
    still = np.abs(model.rhs(0.0, fvsolve.initial_state(model).y))
    assert still.max() <= 1e-9 * abs(model.checks["pipes"]["main"]["velocity"]) * 1000.0


def test_heads_beyond_the_range_of_a_law_are_refused_by_the_name_of_the_pipe():
    fluid = {"name": "Water", "law": "table"}
    links = {
        "main": stiff_pipe(
            "a", "b", 1.0, 2.0, 4, friction={"model": "quasi-steady", "factor": 0.01}
        )
    }
    case = scene({"a": lake(1e6), "b": lake(0.0)}, links, 1.0, {}, ["main.flow"], 0.1, fluid=fluid)
    with pytest.raises(fvsolve.FvsolveError, match="main"):
        fvsolve.build(fvsolve.load(case))
