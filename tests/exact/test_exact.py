"""Named exact solutions compared with closed forms, with an independent tracer of rays, and with SciPy."""

import numpy as np
import pytest
from pytest import approx
from reference import folders, frictionless, pulses, scenes, vessels
from reference.refusals import refused
from scipy.integrate import quad, solve_ivp

from fvsolve import exact
from fvsolve.case import load
from fvsolve.core.kernels.schedule_pieces import value_with_limit
from fvsolve.core.run import model_of
from fvsolve.errors import CaseError
from fvsolve.exact.solution import averages
from fvsolve.studies.outcome import outcome
from fvsolve.studies.reference import initial_values


def solved(case):
    """Case and its exact solution."""
    case = load(case)
    return case, exact.solution(case, initial_values(model_of(case)))


def probe(case, name: str):
    return next(one for one in case.probes if one.text == name)


# rays -------------------------------------------------------------------------------------------------------------


def fork(opening, **numerics) -> dict:
    """Case of three pipes at a junction, with a valve to ambient at the end of one pipe."""
    nodes = {
        "lake": scenes.reservoir(6e5),
        "fork": scenes.junction(scenes.ramp(0.3, 0.2, 0.01, 0.03)),
        "blind": scenes.junction(),
        "gate": scenes.junction(),
        "out": scenes.reservoir(scenes.AMBIENT),
    }
    valve = scenes.valve("gate", "out", 5e-4, opening)
    links = {
        "supply": scenes.pipe("lake", "fork", 500.0, 0.4, 1230.0, 20),
        "branch": scenes.pipe("fork", "blind", 347.1, 0.3, 1111.0, 16),
        "lower": scenes.pipe("fork", "gate", 271.9, 0.25, 1017.0, 12),
        "valve": valve,
    }
    probes = [
        "gate.pressure",
        "fork.pressure",
        "blind.pressure",
        "valve.flow",
        "lower.flow@0.4",
        "supply.pressure@0.7",
    ]
    given = {**scenes.SMOOTH, **numerics}
    return scenes.scene(nodes, links, 3.0, given, probes, exact={"name": "rays"})


def traced() -> frictionless.Rays:
    """Solution of the case `fork` by the tracer of the tests."""
    area = 5e-4
    flow = area * np.sqrt(2 * (6e5 - scenes.AMBIENT) / scenes.RHO)
    pipes = {
        "supply": frictionless.Pipe("lake", "fork", 500.0, 0.4, 1230.0, flow + 0.01, 6e5),
        "branch": frictionless.Pipe("fork", "blind", 347.1, 0.3, 1111.0, 0.0, 6e5),
        "lower": frictionless.Pipe("fork", "gate", 271.9, 0.25, 1017.0, flow, 6e5),
    }
    closing = lambda t: area * float(np.interp(t, [0.1, 0.4], [1.0, 0.0]))  # noqa: E731
    demand = lambda t: float(np.interp(t, [0.3, 0.5], [0.01, 0.03]))  # noqa: E731
    lake, gate = {"lake": frictionless.held(6e5)}, {"gate": (closing, scenes.AMBIENT)}
    return frictionless.Rays(scenes.RHO, pipes, lake, {"fork": demand}, gate)


def test_rays_in_a_network_with_a_valve_are_those_of_the_other_tracer():
    case, found = solved(fork({"time": [0.1, 0.4], "value": [1.0, 0.0]}))
    truth, t = traced(), np.linspace(0.0, 3.0, 61) + 1.234e-3
    t = t[t < 3.0]
    for node in ("gate", "fork", "blind"):
        told = [truth.pressure(node, s) for s in t]
        assert found.probe(probe(case, f"{node}.pressure"), t) == approx(told, rel=1e-9)
    told = [truth.inside("lower", 0.4, s)[1] for s in t]
    assert found.probe(probe(case, "lower.flow@0.4"), t) == approx(told, rel=1e-9, abs=1e-12)
    told = [truth.inside("supply", 0.7, s)[0] for s in t]
    assert found.probe(probe(case, "supply.pressure@0.7"), t) == approx(told, rel=1e-9)


def test_cell_averages_of_rays_are_integrals_of_the_other_tracer():
    case, found = solved(fork({"time": [0.1, 0.4], "value": [1.0, 0.0]}))
    truth, edges = traced(), np.linspace(0.0, 271.9, 9)
    pressure, flow = found.averages("lower", edges, 2.0)
    for k in (0, 3, 7):
        a, b = edges[k] / 271.9, edges[k + 1] / 271.9
        kinks = np.linspace(a, b, 14)[1:-1]
        for j, mine in ((0, pressure[k]), (1, flow[k])):
            whole = quad(
                lambda x, j=j: truth.inside("lower", x, 2.0)[j],
                a,
                b,
                points=kinks,
                limit=400,
                epsrel=1e-7,
            )[0]
            assert mine == approx(whole / (b - a), rel=3e-7, abs=1e-9)


def test_averages_next_to_a_front_are_exact():
    """A jump of demand by dq causes a pressure jump of rho a dq / A; a cell that the front cuts has a share of it."""
    case, found = solved(pulses.front(end=0.07))
    # the front is at 100 m - 1000 m/s (0.07 s - 0.02 s) = 50 m, within a cell
    edges = np.linspace(0.0, 100.0, 8)
    pressure, _ = found.averages("main", edges, 0.07)
    high = scenes.RHO * 1000.0 * 0.05 / scenes.area(0.5)
    share = np.clip((edges[1:] - 50.0) / np.diff(edges), 0.0, 1.0)
    assert pressure == approx(3e5 + high * share, rel=1e-9)


def test_a_pulse_is_mirrored_as_by_images():
    case, found = solved(pulses.case())
    t = np.linspace(0.0, 0.249, 40)
    told = [pulses.pressure(37.0, s) for s in t]
    assert found.probe(probe(case, "main.pressure@0.37"), t) == approx(
        told, abs=0.05
    )  # of 127 kPa: error of the samples of the pulse


def test_a_closing_valve_is_allievis():
    case, found = solved("cases/gradual-closure.toml")
    weight = case.properties.density * case.gravity
    speed, area = 1200.0, np.pi / 4 * 0.25
    flow = 0.01 * np.sqrt(2 * 9.80665 * 100.0)
    parameter = case.properties.density * speed * flow / area / (2 * weight * 100.0)
    opening = [1.0 - np.clip((k - 1.0) / 4.0, 0.0, 1.0) for k in range(9)]
    heads = 100.0 * np.array(frictionless.relative_drop(parameter, opening))
    assert found.probe(probe(case, "gate.head"), np.arange(9.0)) == approx(heads, abs=1e-6)


def test_elevations_and_a_start_that_is_no_equilibrium_are_traced():
    """From rest, with a linear head between unequal heads, the flow grows as g H A t / L and the heads stay."""
    nodes = {"high": scenes.lake(30.0, elevation=10.0), "low": scenes.lake(20.0, elevation=0.0)}
    links = {"main": scenes.pipe("high", "low", 100.0, 0.5, 1000.0, 20)}
    numerics = {**scenes.SMOOTH, "initial": "rest"}
    case = scenes.scene(
        nodes, links, 0.5, numerics, ["main.flow@0.5", "main.head@0.5"], exact={"name": "rays"}
    )
    case, found = solved(case)
    t = np.array([0.025, 0.1, 0.2, 0.4])
    assert found.probe(probe(case, "main.flow@0.5"), t) == approx(
        9.80665 * 10.0 / 100.0 * scenes.area(0.5) * t
    )
    assert found.probe(probe(case, "main.head@0.5"), t) == approx(np.full(4, 25.0))
    run = outcome(case)
    assert run.rows[:, 1] == approx(
        found.probe(probe(case, "main.flow@0.5"), run.rows[:, 0]), abs=1e-5
    )


# lumped parts -----------------------------------------------------------------------------------------------------


def test_a_draining_tank_is_torricellis():
    case, found = solved("cases/tank-draining.toml")
    t = np.linspace(0.0, 1500.0, 16)
    truth = vessels.prism(2.0, 0.61 * np.pi / 4 * 0.05**2, 3.0, t)
    assert found.probe(probe(case, "tank.level"), t) == approx(truth, abs=1e-12)


def test_a_filling_chamber_is_a_parabola():
    case, found = solved("cases/chamber-and-orifice.toml")
    t = np.linspace(0.0, 5.0, 11)
    left = vessels.filling(0.02, 1.5e9, 0.61 * np.pi / 4 * 1e-6, 870.0, 1e7, t)
    assert found.probe(probe(case, "bottle.gauge_pressure"), t) == approx(1e7 - left, rel=1e-12)


def test_two_tanks_level_by_the_closed_form():
    case, found = solved("cases/two-tanks.toml")
    high, low = (case.nodes[name] for name in ("high", "low"))
    [valve] = case.links.values()
    t = np.linspace(case.numerics.start, case.numerics.end, 9)
    drop = vessels.levelling((high.area, low.area), valve.flow_area(), high.level - low.level, t)
    levels = found.level["high"](t) - found.level["low"](t)
    assert levels == approx(drop, abs=1e-12)
    stored = high.area * found.level["high"](t) + low.area * found.level["low"](t)
    assert stored == approx(np.full(9, stored[0]), rel=1e-12)


def column(initial: float | None, drop: float, factor: float, valve: bool) -> dict:
    """Case of a rigid column between two reservoirs, with a Darcy factor or a valve that opens and half closes."""
    end = "gate" if valve else "low"
    nodes = {"high": scenes.reservoir(3e5), "low": scenes.reservoir(3e5 - drop)}
    friction = {"model": "steady", "factor": factor} if factor else scenes.NO_FRICTION
    more = {} if initial is None else {"initial_flow": initial}
    links = {
        "column": {
            "type": "rigid-column",
            "from": "high",
            "to": end,
            "length": 50.0,
            "diameter": 0.2,
            "friction": friction,
            **more,
        }
    }
    probes = ["column.flow"]
    if valve:
        nodes["gate"] = scenes.junction()
        opening = {"time": [0.0, 1.0, 3.0], "value": [0.3, 1.0, 0.5], "kind": "step"}
        links["valve"] = scenes.valve("gate", "low", 0.01, opening)
        probes += ["gate.pressure", "valve.flow"]
    numerics = {"scheme": "muscl", "method": "dormand-prince", "rtol": 1e-11}
    return scenes.scene(nodes, links, 6.0, numerics, probes, every=0.25, exact={"name": "column"})


COLUMNS = [(0.0, 1e4, 0.02), (0.05, 1e4, 0.02), (0.4, 1e4, 0.02), (-0.08, 1e4, 0.02), (0.05, 0.0, 0.02),
           (0.02, -1e4, 0.02), (0.02, 1e3, 0.0)]  # fmt: skip


@pytest.mark.parametrize(("initial", "drop", "factor"), COLUMNS)
def test_a_rigid_column_moves_as_by_scipy(initial, drop, factor):
    case, found = solved(column(initial, drop, factor, valve=False))
    area, t = scenes.area(0.2), np.linspace(0.0, 6.0, 13)
    loss = factor * 50.0 / 0.2 * scenes.RHO / (2 * area**2)

    def rate(_, q):
        return area / (scenes.RHO * 50.0) * (drop - loss * np.abs(q) * q)

    truth = solve_ivp(
        rate, (0.0, 6.0), [initial], t_eval=t, rtol=1e-11, atol=1e-14, method="DOP853"
    ).y[0]
    assert found.probe(probe(case, "column.flow"), t) == approx(truth, rel=1e-8, abs=1e-10)


def test_a_rigid_column_behind_a_valve_that_jumps_moves_as_by_scipy():
    case, found = solved(column(None, 1e4, 0.0, valve=True))
    area, cd = scenes.area(0.2), 0.01
    t = np.array([0.5, 1.5, 2.9, 3.1, 5.9])

    def opening(s):
        return 0.3 if s < 1.0 else 1.0 if s < 3.0 else 0.5

    def drop(s, q):
        return scenes.RHO / 2 * (q / (cd * opening(s))) ** 2

    q, truth = 0.3 * cd * np.sqrt(2 * 1e4 / scenes.RHO), []
    for a, b in ((0.0, 1.0), (1.0, 3.0), (3.0, 6.0)):
        rate = lambda s, x: area / (scenes.RHO * 50.0) * (1e4 - drop(s, x))  # noqa: E731
        part = solve_ivp(
            rate,
            (a, np.nextafter(b, a)),
            [q],
            dense_output=True,
            rtol=1e-11,
            atol=1e-14,
            method="DOP853",
        )
        truth += [float(part.sol(s)[0]) for s in t if a <= s < b]
        q = float(part.y[0, -1])
    assert found.probe(probe(case, "column.flow"), t) == approx(truth, rel=1e-8)
    assert found.probe(probe(case, "valve.flow"), t) == approx(truth, rel=1e-8)
    pressures = [2.9e5 + drop(s, x) for s, x in zip(t, truth, strict=True)]
    assert found.probe(probe(case, "gate.pressure"), t) == approx(pressures, rel=1e-8)


@pytest.mark.parametrize("lake", [False, True])
def test_an_oscillation_between_tanks_is_that_of_scipy(lake):
    nodes = {"a": scenes.tank(2.0, 3.0), "b": scenes.lake(2.5) if lake else scenes.tank(5.0, 2.5)}
    links = {
        "column": {
            "type": "rigid-column",
            "from": "a",
            "to": "b",
            "length": 30.0,
            "diameter": 0.3,
            "friction": scenes.NO_FRICTION,
            "initial_flow": 0.01,
        }
    }
    numerics = {"scheme": "muscl", "method": "dormand-prince", "rtol": 1e-10}
    probes = ["a.level", "a.pressure", "column.flow"]
    case, found = solved(
        scenes.scene(
            nodes, links, 200.0, numerics, probes, every=5.0, exact={"name": "oscillation"}
        )
    )
    other = 0.0 if lake else 1 / 5.0

    def rates(_, y):
        level, drop, q = y
        return [-q / 2.0, -q * (0.5 + other), 9.80665 * scenes.area(0.3) / 30.0 * drop]

    t = np.linspace(0.0, 200.0, 21)
    truth = solve_ivp(
        rates, (0, 200), [3.0, 0.5, 0.01], t_eval=t, rtol=1e-11, atol=1e-13, method="DOP853"
    ).y
    assert found.probe(probe(case, "a.level"), t) == approx(truth[0], abs=1e-8)
    assert found.probe(probe(case, "column.flow"), t) == approx(truth[2], abs=1e-9)
    run = outcome(case)
    assert run.rows[:, 1] == approx(found.probe(probe(case, "a.level"), run.rows[:, 0]), abs=1e-6)


@pytest.mark.parametrize("damping", [0.0, 40.0, 2 * np.sqrt(4.0 * 900.0), 500.0])
def test_a_mass_on_springs_is_that_of_scipy(damping):
    nodes = {
        "lake": scenes.reservoir(3e5),
        "wall": {"type": "frame"},
        "far": {"type": "frame", "initial_position": 2.0},
        "body": {"type": "mass", "mass": 4.0, "initial_position": 1.0, "initial_velocity": 0.5},
    }
    links = {
        "left": {
            "type": "spring",
            "from": "wall",
            "to": "body",
            "stiffness": 600.0,
            "free_length": 0.9,
        },
        "right": {
            "type": "spring",
            "from": "body",
            "to": "far",
            "stiffness": 300.0,
            "preload": 12.0,
        },
        "push": {"type": "force", "to": "body", "force": 25.0},
    }
    if damping:
        links["oil"] = {"type": "damper", "from": "far", "to": "body", "damping": damping}
    del nodes["lake"]
    numerics = {"scheme": "muscl", "method": "dormand-prince", "rtol": 1e-10}
    probes = ["body.position", "body.velocity"]
    case = scenes.scene(
        nodes, links, 2.0, numerics, probes, every=0.05, exact={"name": "spring-mass"}
    )
    case, found = solved(case)

    def rates(_, y):
        x, v = y
        left, right = -600.0 * (x - 0.9), 12.0 - 300.0 * ((2.0 - x) - 1.0)
        return [v, (left - right + 25.0 - damping * v) / 4.0]

    t = np.linspace(0.0, 2.0, 21)
    truth = solve_ivp(
        rates, (0, 2), [1.0, 0.5], t_eval=t, rtol=1e-12, atol=1e-14, max_step=5e-3, method="DOP853"
    ).y
    assert found.probe(probe(case, "body.position"), t) == approx(truth[0], abs=1e-9)
    assert found.probe(probe(case, "body.velocity"), t) == approx(truth[1], abs=1e-8)
    run = outcome(case)
    assert run.rows[:, 1] == approx(
        found.probe(probe(case, "body.position"), run.rows[:, 0]), abs=1e-7
    )
    case, found = solved(
        load(case, {"numerics.initial": "equilibrium", "nodes.body.initial_velocity": 0})
    )
    rests = 1.0 + (600.0 * -0.1 - 12.0 + 25.0) / 900.0
    assert outcome(case).rows[:, 1] == approx(rests, abs=1e-14)
    assert found.probe(probe(case, "body.position"), t) == approx(rests, abs=1e-14)


# shared functions -------------------------------------------------------------------------------------------------

SCHEDULES = [
    0.4, {"time": [0.1, 0.2, 0.5], "value": [0.1, 0.7, 0.3]}, scenes.ramp(0.1, 0.3, 1.0, 0.2, 1.7),
    {"time": [0.1, 0.2, 0.5], "value": [0.1, 0.7, 0.3], "kind": "step"}, scenes.smooth_ramp(0.1, 0.3, 1.0, 0.2, 40),
]  # fmt: skip


@pytest.mark.parametrize(
    "schedule", SCHEDULES, ids=["constant", "linear", "ramp", "step", "smooth"]
)
def test_schedules_have_the_values_that_kernels_read(schedule):
    case = pulses.front()
    case["nodes"]["gate"] = scenes.junction(schedule)
    model = model_of(load({key: value for key, value in case.items() if key != "exact"}))
    from fvsolve.exact.solution import value

    index = int(model.tables.nodes[model.node_names.index("gate")]["schedule"])
    t = np.array([0.0, 0.1, 0.15, 0.2, 0.33, 0.5, 0.7])
    read = [
        value_with_limit(model.tables.schedules, model.tables.pieces, index, float(s), np.inf)
        / scenes.RHO
        for s in t
    ]
    assert value(model.case.nodes["gate"].demand, t) == approx(read, abs=1e-14)
    assert value(model.case.nodes["gate"].demand, t - 1e-12) == approx(
        value(model.case.nodes["gate"].demand, t, left=True), abs=1e-9
    )


def test_averages_of_a_polynomial_are_exact():
    edges = np.array([0.0, 0.3, 1.0, 1.1])
    (found,) = averages(lambda x: (x**9,), edges)
    assert found == approx(np.diff(edges**10) / 10 / np.diff(edges), rel=1e-12)


def test_a_case_retains_its_exact_solution_when_written_out(tmp_path):
    case = load("cases/gradual-closure.toml")
    (tmp_path / "again.toml").write_text(case.resolved(), encoding="utf-8")
    assert (
        load(tmp_path / "again.toml") == case and load(tmp_path / "again.toml").exact.name == "rays"
    )


def changed(case: dict, where: str, value) -> dict:
    return {**case, "links": {**case["links"], where: {**case["links"][where], **value}}}


PULSE = pulses.case(exact=False)
MISFITS = [
    ("ray", PULSE, 'did you mean "rays"'),
    ("rays", changed(PULSE, "main", {"friction": {"model": "steady", "factor": 0.02}}), "links.main.friction"),
    ("rays", changed(PULSE, "main", {"minor_loss": 1.5}), "links.main.minor_loss"),
    ("rays", {**PULSE, "fluid": {**scenes.WATER, "law": "log"}}, "fluid.law"),
    ("rays", column(None, 1e4, 0.0, True), "rigid-column"),
    ("levelling", PULSE, "does not support a pipe"),
    ("levelling", "cases/chamber-chain.toml", "exactly one"),
    ("column", column(None, 1e4, 0.0, True) | {"nodes": {
        **column(None, 1e4, 0.0, True)["nodes"], "gate": scenes.junction(1e-3)}}, "no demand"),
    ("levelling", {**scenes.scene({"a": scenes.tank(2.0, 3.0), "b": scenes.tank(5.0, 0.1, height=0.9)},
                                  {"hole": scenes.valve("a", "b", 0.1)}, 900.0, {"rtol": 1e-6})}, "overflows"),
    ("levelling", {**scenes.scene({"a": scenes.tank(2.0, 1.0), "b": scenes.lake(-3.0)},
                                  {"hole": scenes.valve("a", "b", 0.1)}, 900.0, {"rtol": 1e-6})}, "runs dry"),
    ("oscillation", column(None, 1e4, 0.02, False), "needs a tank"),
    ("spring-mass", "cases/cylinder-servo.toml", "does not support"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "case", "told"), MISFITS, ids=[f"{m[0]}-{m[2]}" for m in MISFITS])
def test_a_scene_that_a_solution_does_not_hold_for_is_refused_by_name(name, case, told):
    if isinstance(case, dict):
        case = {key: value for key, value in case.items() if key != "exact"}
    assert told in str(refused(case, set={"exact.name": name}))


def test_settings_that_leave_no_exact_solution_take_it_out():
    friction = {"links.main.friction": {"model": "steady", "factor": 0.02}}
    assert load("cases/gradual-closure.toml").exact.name == "rays"
    case = load("cases/gradual-closure.toml", friction)
    assert case.exact is None and "exact" not in case.table()
    assert load(case, {"fluid.law": "log"}).exact is None
    assert load(case, {"links.main.friction": {"model": "none"}}).exact.name == "rays"
    refused(
        "cases/gradual-closure.toml", "without friction", set={**friction, "exact.name": "rays"}
    )


SHIPPED = sorted(path.name for path in folders.CASES.glob("*.toml"))


IN_TURN = [
    (file, [*exact.NAMES][(k + j) % len(exact.NAMES)])
    for k, file in enumerate(SHIPPED)
    for j in range(3)
]


@pytest.mark.parametrize("file, name", IN_TURN)
def test_any_solution_on_any_scene_either_holds_or_is_refused_part_by_part(file, name):
    try:
        case = load(f"cases/{file}", {"exact.name": name})
    except CaseError as error:
        assert f'"{name}"' in str(error) or "without" in str(error)
        return
    found = exact.solution(case, initial_values(model_of(case)))
    assert np.isfinite(found.probe(case.probes[0], np.array([case.numerics.start]))).all()


def unsupported_case(name: str) -> dict:
    """Case that a solution would support except for one link in a wrong place."""
    held = {"a": scenes.reservoir(3e5), "b": scenes.reservoir(2e5)}
    if name == "column":
        main = {"type": "rigid-column", "from": "a", "to": "b", "length": 9.0, "diameter": 0.1}
        links = {
            "main": main | {"friction": scenes.NO_FRICTION},
            "stray": scenes.valve("b", "a", 1e-4),
        }
        return scenes.scene(held, links, 1.0, {}, exact={"name": name})
    bodies = {
        "wall": {"type": "frame", "initial_position": 0.0},
        "far": {"type": "frame", "initial_position": 2.0},
        "load": {"type": "mass", "mass": 1.0, "initial_position": 1.0, "initial_velocity": 0.0},
    }
    spring = {"type": "spring", "stiffness": 100.0, "preload": 0.0}
    links = {
        "own": spring | {"from": "wall", "to": "load"},
        "stray": spring | {"from": "wall", "to": "far"},
    }
    return scenes.scene(bodies, links, 1.0, {}, exact={"name": name})


@pytest.mark.parametrize("name", ["column", "spring-mass"])
def test_a_part_of_a_known_kind_in_the_wrong_place_is_refused(name):
    refused(unsupported_case(name), "links.stray")


# laminar line -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ends, distance", [(("tank", "gate"), [64.0, 64.0]), (("gate", "tank"), [36.0, 36.0])]
)
def test_the_wave_front_in_a_laminar_line_moves_from_the_demand_at_the_wave_speed(ends, distance):
    """The demand jumps at 10 ms; the front is 36 m from it 30 ms later, and on its way back 137 ms later."""
    nodes = {"tank": scenes.reservoir(6e5), "gate": scenes.junction(scenes.step(0.01, 0.0, 1e-4))}
    links = {
        "line": scenes.pipe(
            *ends, 100.0, 0.05, 1200.0, 10, friction={"model": "unsteady", "roughness": 0.0}
        )
    }
    case = scenes.scene(
        nodes,
        links,
        0.2,
        {"method": "rk4", "courant": 0.9},
        ["gate.pressure"],
        exact={"name": "laminar-line"},
    )
    case["fluid"]["viscosity"] = 0.05
    _, truth = solved(case)
    assert truth.kinks("line", 0.009) == approx([])
    found = [truth.kinks("line", 0.01 + travelled / 1200.0) for travelled in (36.0, 164.0)]
    assert np.concatenate(found) == approx(distance, rel=1e-12)
