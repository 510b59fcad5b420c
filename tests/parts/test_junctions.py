"""Junctions of pipes: series, branches, dead ends, arbitrary lengths and valves, without growing modes."""

import math

import numpy as np
import pytest
from reference import frictionless, scenes
from reference.orders import gaussian_averages, mean_error, observed_order, scattered
from reference.scenes import (
    AMBIENT,
    RHO,
    SHARP,
    SMOOTH,
    junction,
    pipe,
    ramp,
    reservoir,
    scene,
    smooth_ramp,
    step,
    valve,
)

import fvsolve

SUPPLY = 1e6


def network(
    pipes: dict[str, tuple], demand: dict, end: float, numerics: dict, probes, every=0.01
) -> dict:
    """Return a case of pipes: name -> (from, to, length, diameter, wave speed, cells); `lake` is a reservoir."""
    places = {p for row in pipes.values() for p in row[:2]}
    nodes = {
        p: reservoir(SUPPLY) if p == "lake" else junction(demand.get(p)) for p in sorted(places)
    }
    return scene(nodes, {n: pipe(*row) for n, row in pipes.items()}, end, numerics, probes, every)


def traced(pipes: dict[str, tuple], flows: dict[str, float], demand: dict) -> frictionless.Rays:
    """Exact solution of the case of `network` by ray tracing, from given initial flows."""
    laid = {n: frictionless.Pipe(*row[:5], flows.get(n, 0.0), SUPPLY) for n, row in pipes.items()}
    return frictionless.Rays(RHO, laid, {"lake": frictionless.held(SUPPLY)}, demand)


def clear_of_jumps(
    exact: frictionless.Rays, place: str, t: np.ndarray, width: float, size: float
) -> np.ndarray:
    """Mask of times at which the exact pressure of a node varies by less than `size` [Pa] within `width` [s]."""
    shifts = np.linspace(-width, width, 21)
    around = np.array([[exact.pressure(place, float(s + d)) for d in shifts] for s in t])
    return np.ptp(around, axis=1) < size


SERIES = {
    "up": ("lake", "mid", 400.0, 0.4, 1000.0, 20),
    "down": ("mid", "gate", 240.0, 0.25, 1200.0, 10),
}
TEE = {
    "main": ("lake", "tee", 300.0, 0.4, 1200.0, 20),
    "left": ("tee", "gate", 250.0, 0.3, 1000.0, 20),
    "dead": ("tee", "blind", 187.5, 0.2, 1250.0, 12),
}


@pytest.mark.parametrize("pipes", [SERIES, TEE], ids=["series", "three-way with a dead end"])
def test_pipes_of_cells_with_equal_times_are_exact_at_courant_1(pipes):
    q, shut, dt = 0.05, 0.1, next(iter(pipes.values()))
    dt = dt[2] / dt[5] / dt[4]
    places = sorted({p for row in pipes.values() for p in row[:2]} - {"lake"})
    case = network(
        pipes, {"gate": step(shut, q, 0.0)}, 3.0, SHARP, [f"{p}.pressure" for p in places], dt / 2
    )
    result = fvsolve.run(case)
    exact = traced(
        pipes, dict.fromkeys(set(pipes) - {"dead"}, q), {"gate": frictionless.step(shut, q, 0.0)}
    )
    jump = RHO * 1000.0 * q / scenes.area(0.25)
    t = np.asarray(result.t)
    for place in places:
        wanted = np.array([exact.pressure(place, s) for s in t])
        clear = clear_of_jumps(exact, place, t, 2.02 * dt, 1e-7 * jump)
        assert clear.mean() > 0.2
        assert np.max(np.abs(result[f"{place}.pressure"] - wanted)[clear]) < 1e-10 * jump


ODD = {
    "main": ("lake", "tee", 500.0, 0.5, 1230.0, 150),
    "left": ("tee", "gate", 347.1, 0.4, 1111.0, 113),
    "dead": ("tee", "blind", 271.9, 0.3, 1017.0, 95),
}


@pytest.mark.parametrize("scheme", ["muscl", "weno5"])
def test_plateaus_are_those_of_ray_tracing_whatever_the_lengths(scheme):
    q, shut = 0.1, 0.05
    probes = ["gate.pressure", "tee.pressure", "blind.pressure"]
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.8}
    pipes = {n: (*row[:5], 2 * row[5]) for n, row in ODD.items()}
    result = fvsolve.run(network(pipes, {"gate": step(shut, q, 0.0)}, 1.6, numerics, probes, 0.004))
    exact = traced(ODD, {"main": q, "left": q}, {"gate": frictionless.step(shut, q, 0.0)})
    t, jump = np.asarray(result.t), RHO * 1111.0 * q / scenes.area(0.4)
    for probe in probes:
        wanted = np.array([exact.pressure(probe.split(".")[0], s) for s in t])
        clear = clear_of_jumps(exact, probe.split(".")[0], t, 0.048, 1e-3 * jump)
        assert clear.mean() > 0.3
        assert np.max(np.abs(result[probe] - wanted)[clear]) < 5e-3 * jump
        assert np.mean(np.abs(result[probe] - wanted)) < 2e-2 * jump


def smooth_error(cells_factor: float, q: float = 0.1) -> float:
    """Greatest error at three nodes over the jump, for a demand that ends smoothly within 0.3 s."""
    schedule = smooth_ramp(0.0, 0.3, q, 0.0)
    pipes = {n: (*row[:5], round(row[5] * cells_factor)) for n, row in ODD.items()}
    probes = ["gate.pressure", "tee.pressure", "blind.pressure"]
    result = fvsolve.run(network(pipes, {"gate": schedule}, 2.5, SMOOTH, probes, 0.025))
    exact = traced(
        pipes, {"main": q, "left": q}, {"gate": lambda t: q * (1 - scenes.smooth_step(t, 0.0, 0.3))}
    )
    jump = RHO * 1111.0 * q / scenes.area(0.4)
    errors = [
        np.max(np.abs(result[p] - [exact.pressure(p.split(".")[0], float(s)) for s in result.t]))
        for p in probes
    ]
    return max(errors) / jump


def test_smooth_events_in_lengths_that_share_no_step_converge_fast():
    errors = [smooth_error(f) for f in (0.25, 0.5)]
    assert errors[1] < 1e-4
    assert observed_order(errors, [2.0, 1.0]) > 4.0


def scatter(cells: int, scheme: str, numerics: dict) -> float:
    """L1 error of a bump after a junction of three pipes, relative to the bump."""
    rows = [
        ("blind0", "tee", 100.0, 0.3, 1000.0),
        ("tee", "blind1", 120.0, 0.2, 1200.0),
        ("tee", "blind2", 90.0, 0.25, 900.0),
    ]
    pipes = {f"p{i}": (*row, cells) for i, row in enumerate(rows)}
    case = network(pipes, {}, 1.0, {"scheme": scheme, **numerics}, ["tee.pressure"])
    case["nodes"]["blind1"] = reservoir(SUPPLY)  # a given pressure is required
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.initial_state(model)
    width, centre, end = 9.0, 55.0, 0.09
    # r in the first pipe
    state.y[:cells] = gaussian_averages(np.linspace(0, 100.0, cells + 1), centre, width)
    state = fvsolve.advance(model, state, end)
    back, passed = scattered([row[4] / scenes.area(row[3]) for row in rows])
    exact = np.zeros(6 * cells)
    # the bump reaches the tee at x = L; a wave is pressure over impedance
    z = [row[4] / scenes.area(row[3]) for row in rows]
    at = centre + rows[0][4] * end - rows[0][2]  # distance beyond the tee, in the first pipe [m]
    edges = [np.linspace(0, row[2], cells + 1) for row in rows]
    exact[cells : 2 * cells] = (
        back * gaussian_averages(rows[0][2] - edges[0][::-1], at, width)[::-1]
    )
    for i in (1, 2):
        stretch = rows[i][4] / rows[0][4]
        part = (
            passed[i - 1] * z[0] / z[i] * gaussian_averages(edges[i], at * stretch, width * stretch)
        )
        exact[2 * i * cells : (2 * i + 1) * cells] = part
    return mean_error(state.y, exact)


SCHEMES = {
    "upwind": (1, 1600),
    "linear-upwind": (2, 240),
    "fromm": (2, 120),
    "central": (2, 120),
    "upwind3": (3, 240),
    "upwind5": (5, 60),
    "weno5": (5, 120),
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_order_through_a_junction_is_the_scheme_s_own(scheme):
    order, cells = SCHEMES[scheme]
    errors = [
        scatter(n, scheme, {"method": "dormand-prince", "courant": 0.5}) for n in (cells, 2 * cells)
    ]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(order, abs=0.2)


def test_muscl_retains_its_order_through_a_junction_in_the_mean():
    errors = [scatter(n, "muscl", {"method": "ssp-rk3", "courant": 0.5}) for n in (100, 200)]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(2.0, abs=0.35)


def test_a_dead_end_doubles_a_wave():
    pipes = {"main": ("lake", "gate", 100.0, 0.3, 1000.0, 50)}
    case = network(pipes, {}, 0.2, SHARP, ["gate.pressure"], 0.002)
    case["nodes"]["lake"] = reservoir(step(0.01, SUPPLY, 1.2 * SUPPLY))
    result = fvsolve.run(case)
    plateau = (result.t > 0.12) & (result.t < 0.2)
    assert result["gate.pressure"][plateau] == pytest.approx(1.4 * SUPPLY, rel=1e-12)


def test_a_valve_between_pipes_reflects_and_passes_by_its_equation():
    """At Courant number 1 the flow solves p1 - p2 - 2 Z m = (m / K)^2 at every step."""
    d, a, flow_area, dt = 0.3, 1000.0, 0.01, 0.005
    nodes = {
        "lake": reservoir(SUPPLY),
        "a": junction(),
        "b": junction(),
        "sea": reservoir(0.5 * SUPPLY),
    }
    links = {
        "one": pipe("lake", "a", 100.0, d, a, 20),
        "gap": valve("a", "b", flow_area, step(0.05, 0.0, 1.0)),
        "two": pipe("b", "sea", 100.0, d, a, 20),
    }
    result = fvsolve.run(
        scene(nodes, links, 0.3, SHARP, ["a.pressure", "b.pressure", "gap.flow"], dt)
    )
    z, k = a / scenes.area(d), flow_area * math.sqrt(2 * RHO)
    drop, b = 0.5 * SUPPLY, 2 * z * k
    root = (-b + math.sqrt(b * b + 4 * drop)) / 2
    first = (result.t > 0.06) & (result.t < 0.24)  # before reflections return
    assert result["gap.flow"][first] == pytest.approx(k * root / RHO, rel=1e-12)
    assert result["a.pressure"][first] == pytest.approx(SUPPLY - z * k * root, rel=1e-12)
    assert result["b.pressure"][first] == pytest.approx(0.5 * SUPPLY + z * k * root, rel=1e-12)


def test_valves_in_parallel_act_as_a_valve_of_their_areas():
    def run(areas):
        nodes = {"lake": reservoir(SUPPLY), "gate": junction(), "air": reservoir(AMBIENT)}
        links = {"main": pipe("lake", "gate", 200.0, 0.3, 1000.0, 20)}
        links |= {
            f"v{i}": valve("gate", "air", s, ramp(0.1, 0.3, 1.0, 0.0)) for i, s in enumerate(areas)
        }
        return fvsolve.run(scene(nodes, links, 2.0, SMOOTH, ["gate.pressure"], 0.01))[
            "gate.pressure"
        ]

    assert run([0.001, 0.0005, 0.0025]) == pytest.approx(run([0.004]), abs=1e-9 * SUPPLY)


def test_valves_in_series_act_as_a_valve_of_their_summed_drops():
    def run(areas):
        names = ["gate", *(f"n{i}" for i in range(len(areas) - 1)), "air"]
        nodes = {
            "lake": reservoir(SUPPLY),
            **{n: junction() for n in names[:-1]},
            "air": reservoir(AMBIENT),
        }
        links = {"main": pipe("lake", "gate", 200.0, 0.3, 1000.0, 20)}
        for i, s in enumerate(areas):
            links[f"v{i}"] = valve(names[i], names[i + 1], s, ramp(0.1, 0.3, 1.0, 0.1))
        return fvsolve.run(scene(nodes, links, 2.0, SMOOTH, ["gate.pressure"], 0.01))[
            "gate.pressure"
        ]

    areas = [0.004, 0.006, 0.005]
    one = sum(s**-2 for s in areas) ** -0.5
    assert run(areas) == pytest.approx(run([one]), abs=1e-9 * SUPPLY)


def growth(case: dict) -> float:
    """Greatest real part of the eigenvalues times the least travel time of a cell."""
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.initial_state(model)
    spectrum = np.linalg.eigvals(jacobian(model, state))
    cell = min(p.length / p.cells / p.wave_speed for p in model.pipes)
    return float(np.max(spectrum.real)) * cell


def jacobian(model, state) -> np.ndarray:
    """Jacobian of the rates by differences, which are exact for linear rates."""
    base, size = model.rhs(state.t, state.y), 1e-3
    columns = []
    for i in range(len(state.y)):
        y = state.y.copy()
        y[i] += size
        columns.append((model.rhs(state.t, y) - base) / size)
    return np.array(columns).T


LINEAR = ["upwind", "linear-upwind", "fromm", "central", "upwind3", "upwind5"]


def ended(cells: int, reflection: float, scheme: str) -> dict:
    """Return a case of a pipe whose end reflects pressure by `reflection`, from -1 (fixed) to 1 (dead end).

    For values between, an open valve has the ratio of its slope 2 dp / M to the impedance of the pipe.
    """
    d, a = 0.3, 1000.0
    z = a / scenes.area(d)
    nodes = {"lake": reservoir(SUPPLY), "gate": junction()}
    links = {"main": pipe("lake", "gate", 100.0, d, a, cells)}
    if abs(reflection) == 1:
        nodes["gate"] = junction() if reflection > 0 else reservoir(SUPPLY)
    else:
        resistance = z * (1 + reflection) / (1 - reflection)
        drop = SUPPLY / 2
        mass = 2 * drop / resistance
        nodes["sea"] = reservoir(SUPPLY - drop)
        links["valve"] = valve("gate", "sea", mass / math.sqrt(2 * RHO * drop))
    return scene(
        nodes, links, 1.0, {"scheme": scheme, "method": "rk4", "courant": 0.5}, ["gate.pressure"]
    )


@pytest.mark.parametrize("scheme", LINEAR)
def test_no_mode_grows_in_a_pipe_of_1_to_64_cells_at_any_reflection_of_its_end(scheme):
    worst = {
        (cells, reflection): growth(ended(cells, reflection, scheme))
        for cells in (*range(1, 13), 16, 23, 32, 64)
        for reflection in (-1.0, -0.6, 0.0, 0.5, 1.0)
    }
    assert max(worst.values()) < 1e-8, max(worst, key=worst.get)


@pytest.mark.parametrize("scheme", ["upwind5", "upwind3", "fromm"])
def test_no_mode_grows_in_random_networks(scheme):
    rng = np.random.default_rng(7)
    for _ in range(25):
        count = int(rng.integers(2, 4))
        ends = [
            reservoir(SUPPLY),
            *(junction() if rng.random() < 0.5 else reservoir(SUPPLY) for _ in range(count - 1)),
        ]
        nodes = {"mid": junction(), **{f"end{i}": e for i, e in enumerate(ends)}}
        links = {}
        for i in range(count):
            way = ("mid", f"end{i}") if rng.random() < 0.5 else (f"end{i}", "mid")
            sizes = (
                rng.uniform(20, 500),
                rng.uniform(0.1, 0.8),
                rng.uniform(400, 1400),
                int(rng.integers(1, 30)),
            )
            links[f"p{i}"] = pipe(*way, *map(float, sizes[:3]), sizes[3])
        numerics = {"scheme": scheme, "method": "rk4", "courant": 0.5}
        assert growth(scene(nodes, links, 1.0, numerics, ["mid.pressure"])) < 1e-8, links


def random_network(rng: np.random.Generator, dt: float) -> tuple[dict, dict, frictionless.Rays]:
    """Return (nodes, links, exact solution) of five random pipes with a loop, and events at multiples of the step."""
    rows: dict[str, tuple] = {}
    for k in range(5):
        start = f"n{rng.integers(0, k + 1)}" if k < 4 else "n4"
        end = f"n{k + 1}" if k < 4 else f"n{rng.integers(0, 3)}"
        cells, speed = int(rng.integers(1, 9)), float(rng.uniform(600, 1400))
        ends = (start, end) if rng.random() < 0.5 else (end, start)
        rows[f"p{k}"] = (*ends, cells * speed * dt, float(rng.uniform(0.1, 0.6)), speed, cells)
    when = {name: 5 * dt * int(rng.integers(1, 6)) for name in ("n0", "n1", "n2", "n3")}
    q, area, up = rng.uniform(0.005, 0.05), rng.uniform(0.002, 0.02), rng.uniform(0.7, 1.5)
    length = 10 * dt
    nodes = {
        "n0": reservoir(step(when["n0"], SUPPLY, SUPPLY * up)),
        "n1": junction(step(when["n1"], 0.0, q)),
        "n2": junction(ramp(when["n2"], length, 0.0, q)),
        "n3": junction(),
        "n4": junction(),
        "air": reservoir(AMBIENT),
    }
    links = {n: pipe(*row) for n, row in rows.items()}
    links["out"] = valve("n3", "air", area, ramp(when["n3"], length, 0.0, 1.0))

    def rising(name: str, t: float) -> float:
        return min(max((t - when[name]) / length, 0.0), 1.0)

    exact = frictionless.Rays(
        RHO,
        {n: frictionless.Pipe(*row[:5], 0.0, SUPPLY) for n, row in rows.items()},
        {"n0": frictionless.step(when["n0"] - 1e-9, SUPPLY, SUPPLY * up)},
        {"n1": frictionless.step(when["n1"] - 1e-9, 0.0, q), "n2": lambda t: q * rising("n2", t)},
        {"n3": (lambda t: area * rising("n3", t), AMBIENT)},
    )
    return nodes, links, exact


@pytest.mark.parametrize("seed", range(12))
def test_random_networks_with_loops_and_outlets_are_exact_at_courant_1(seed):
    dt = 0.004
    nodes, links, exact = random_network(np.random.default_rng(seed), dt)
    places = ["n1", "n2", "n3", "n4"]
    case = scene(
        nodes, links, 100 * dt, SHARP, [f"{p}.pressure" for p in places] + ["out.flow"], dt
    )
    result = fvsolve.run(case)
    t = np.asarray(result.t)
    late = np.append(np.diff(t) > 0, True)  # the later of two rows at a jump
    for place in places:
        wanted = np.array([exact.pressure(place, round(s / dt) * dt) for s in t[late]])
        assert np.max(np.abs(result[f"{place}.pressure"][late] - wanted)) < 1e-9 * SUPPLY, place


@pytest.mark.parametrize("scheme", ["muscl", "weno5", "upwind5"])
def test_noise_in_short_frictionless_pipes_does_not_grow_in_a_long_run(scheme):
    rng = np.random.default_rng(5)
    for cells in (1, 2, 3, 4, 5, 7):
        rows = {
            "one": ("lake", "tee", 100.0, 0.3, 1000.0, cells),
            "two": ("tee", "blind", 80.0, 0.2, 900.0, cells),
            "three": ("tee", "shut", 130.0, 0.4, 1200.0, max(1, cells - 1)),
        }
        numerics = {"scheme": scheme, "method": "rk4", "courant": 0.6}
        model = fvsolve.build(fvsolve.load(network(rows, {}, 1.0, numerics, ["tee.pressure"])))
        state = fvsolve.initial_state(model)
        state.y[:] = rng.normal(size=len(state.y))
        before = np.max(np.abs(state.y))
        state = fvsolve.advance(model, state, 300.0)
        assert np.max(np.abs(state.y)) < 1.5 * before, cells


@pytest.mark.parametrize("seed", range(15))
def test_every_valve_of_a_random_bunch_obeys_its_law_and_every_junction_balances(seed):
    """Moving valves join three junctions to given pressures and a pipe."""
    rng = np.random.default_rng(seed)
    nodes = {
        "r0": reservoir(1e6),
        "r1": reservoir(float(rng.uniform(2e5, 2e6))),
        "r2": reservoir(4e5),
    }
    nodes |= {f"j{i}": junction(float(rng.choice([0.0, 1e-3]))) for i in range(3)}
    links = {"main": pipe("r0", "j0", 100.0, 0.2, 1000.0, 10)}
    ways = [("j0", "j1"), ("j1", "j2"), ("j2", "r1"), ("j0", "j2"), ("r2", "j1"), ("j1", "r1")]
    areas = {}
    for k, way in enumerate(ways):
        way = way if rng.random() < 0.5 else way[::-1]
        areas[f"v{k}"] = float(rng.uniform(1e-4, 5e-3))
        before, after = (
            float(rng.uniform(0.1, 1.0)),
            float(rng.choice([0.0, 1.0, rng.uniform(0, 1)])),
        )
        after = after if k != 2 else 0.5  # an outlet stays open for the demands
        links[f"v{k}"] = valve(*way, areas[f"v{k}"], ramp(0.1, 0.3, before, after))
    probes = [f"{n}.pressure" for n in nodes] + [f"{n}.flow" for n in areas] + ["main.flow@1"]
    result = fvsolve.run(scene(nodes, links, 0.8, SMOOTH, probes, 0.01))
    assert result.ok, result.reason
    t = np.asarray(result.t)
    total = {n: -np.full(len(t), nodes[n].get("demand", 0.0)) for n in nodes}
    total["j0"] += result["main.flow@1"]
    for name, flow_area in areas.items():
        link, moved = links[name], np.clip((t - 0.1) / 0.3, 0, 1)
        v0, v1 = link["opening"]["value"]
        opening = v1 + (v0 - v1) * (1 - moved)
        drop = result[f"{link['from']}.pressure"] - result[f"{link['to']}.pressure"]
        law = flow_area * opening * np.sign(drop) * np.sqrt(2 * np.abs(drop) / RHO)
        # below: laminar flow, and rounding of the drop
        clear = (np.abs(drop) > 1.0) | (opening == 0)
        assert result[f"{name}.flow"][clear] == pytest.approx(law[clear], rel=1e-8, abs=1e-11), name
        total[link["from"]] -= result[f"{name}.flow"]
        total[link["to"]] += result[f"{name}.flow"]
    for name in ("j0", "j1", "j2"):
        assert np.max(np.abs(total[name])) < 1e-12, name
