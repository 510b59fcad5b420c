"""Liquid basins under the law `table`: against CoolProp's isentrope, pipes under this law, and the law `log`."""

import numpy as np
import pytest
from pytest import approx
from reference import face_fields
from reference.basins import model_of, on_sides
from reference.isentrope import Isentrope, Riemann
from reference.liquid_boxes import RHO, SCHEMES, Box, C, noise
from reference.meshes import boundary, triangles, write
from reference.scenes import NO_FRICTION, junction, ramp, reservoir, scene, stiff_pipe, valve

import fvsolve
from fvsolve.core.fluid import Fluid, FluidTable
from fvsolve.core.kernels import density as law
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import CaseError
from fvsolve.features.basins.liquid import riemann_invariants
from fvsolve.features.basins.liquid.lower import RiemannInvariants

REST = 6e6
# 519 m/s, at 300 bar 697 m/s
FLUID = {"name": "CO2", "temperature": 280.0, "pressure": REST, "law": "table"}
TRUTH = Isentrope("CO2", 280.0, REST, 4.5e6, 6e7)
HOLE = [[3.0, 0.0, 4.0, 1.0]]


def basin(**more) -> dict:
    return {
        "type": "basin",
        "size": [4.0, 2.0],
        "cells": [32, 16],
        "physics": "liquid",
        "pressure": REST,
        "thickness": 0.1,
        **more,
    }


def single(pool: dict, end: float = 1.0, **more):
    """Return the model of a single basin; `more` are numerics."""
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5} | more
    return model_of(scene({"pool": pool}, {}, end, numerics, (), end / 10, fluid=FLUID))


def at_end(model, end: float) -> np.ndarray:
    """Density and mass flow density along x at the end : float64[2, n]."""
    pool = model.meshed[0]
    found = pool.deviations(fvsolve.advance(model, fvsolve.initial_state(model), end).y)
    return np.array([found[0] + pool.density, found[1]])


STATES = {
    "shock and rarefaction": ((3e7, 0.0), (6e6, 0.0)),
    "two shocks": ((8e6, 15.0), (8e6, -15.0)),
    "two rarefactions": ((3e7, -15.0), (3e7, 15.0)),
    "moving": ((6e6, 40.0), (2e7, 10.0)),
}


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["muscl", "weno5"])
@pytest.mark.parametrize("name", STATES)
def test_exact_riemann_problems_of_the_isentrope(name, scheme):
    """L1 errors of density and flow fall as shocks and kinks permit; under the law `log` 0.2 % to 3 % remain."""
    left, right = STATES[name]
    exact, errors, end = Riemann(TRUTH, left, right), [], 0.03
    start = {
        "pressure": f"where(x < 50, {left[0] - REST}, {right[0] - REST})",
        "u": f"where(x < 50, {left[1]}, {right[1]})",
    }
    for n in (100, 200, 400):
        model = single(basin(size=[100.0, 1.0], cells=[n, 1], start=start), end, scheme=scheme)
        pool = model.meshed[0]
        inner = abs(pool.x - 50.0) < 27.0
        rays = (pool.x[inner, None] - 50.0 + 100.0 / n * ((np.arange(8) + 0.5) / 8 - 0.5)) / end
        means = exact.at(rays.ravel()).reshape(2, -1, 8).mean(axis=2)
        errors.append(
            np.abs(at_end(model, end)[:, inner] - means).mean(axis=1)
            / pool.density
            / [1.0, pool.speed]
        )
    assert (errors[0] / errors[2] > 4**0.6).all() and (errors[2] < 4e-4).all()


PULSE = "exp(-((x - 40)/6)^2)"


def pipe_of(n: int, start: np.ndarray, end: float) -> np.ndarray:
    """Density minus that at rest, and mass flow density, at `end` in a pipe of 100 m : float64[2, n]."""
    nodes, numerics = (
        {"left": reservoir(REST), "right": junction()},
        {"scheme": "muscl", "method": "ssp-rk3"},
    )
    links = {"main": stiff_pipe("left", "right", 100.0, 0.5, n, friction=NO_FRICTION)}
    model = model_of(scene(nodes, links, end, numerics | {"courant": 0.5}, (), end, fluid=FLUID))
    state, row = fvsolve.initial_state(model), model.tables.pipes[0]
    c, area = row["speed"], row["area"]
    state.y[: 2 * n] = (
        0.5 * area * np.concatenate([c * start[0] + start[1], c * start[0] - start[1]])
    )
    y = fvsolve.advance(model, state, end).y
    return np.array([(y[:n] + y[n : 2 * n]) / c, y[:n] - y[n : 2 * n]]) / area


def test_a_wave_in_a_row_of_cells_is_that_of_a_pipe_under_the_same_law():
    """For a pulse of 40 bar that divides and steepens, the difference falls at the order of the schemes."""
    apart, end = [], 0.04
    for n in (200, 400):
        pool = basin(
            size=[100.0, 1.0], cells=[n, 1], start={"pressure": f"4e6*{PULSE}", "u": f"3*{PULSE}"}
        )
        model = single(pool, end, limiter="monotonized-central")
        start = model.meshed[0].deviations(model.start)[:2]
        found = at_end(model, end) - [[model.meshed[0].density], [0.0]]
        other = pipe_of(n, start, end)
        # the pulse has moved
        assert np.abs(found - start).max(axis=1) == approx([16.0, 6400.0], rel=0.5)
        apart.append(np.abs(found - other).mean(axis=1) / np.abs(found).mean(axis=1))
    assert (np.log2(apart[0] / apart[1]) > 1.8).all() and (apart[1] < 2e-3).all()


@pytest.mark.parametrize("wave_speed", [None, 400.0])
def test_pressures_are_those_of_the_fluids_own_table(wave_speed):
    """Pressures equal those of pipes, also with elastic walls, and those of CoolProp with rigid walls."""
    model = single(basin(wave_speed=wave_speed) if wave_speed else basin())
    st, floats, pool = model.tables.settings[0], model.tables.floats, model.meshed[0]
    compliance = 1 / (pool.density * pool.speed**2) - law.log_density(st, floats, REST)[1]
    pressures = np.array([-3e7, 1e6, 4.6e6, 5.9e6, 6e6, 6.1e6, 2e7, 5.9e7, 9e7, 1.5e8])
    deviations = pool.deviation(pressures - REST)
    assert pool.pressure(deviations) + REST == approx(pressures, rel=1e-12, abs=1e-3)
    table = model.tables.plane[pool.row["table"] :]
    for p, r in zip(pressures, deviations, strict=True):
        held = np.log1p(r / pool.density)  # over the density at rest, the reference
        assert law.pressure_of_log(st, floats, compliance, held) == approx(p, rel=1e-9, abs=1.0)
        found, square = riemann_invariants.pressure(table, pool.density, r)
        assert found + REST == approx(p, rel=1e-7, abs=1.0)
        if not wave_speed and TRUTH.low < p < TRUTH.high:
            assert r + pool.density == approx(TRUTH.rho(p), rel=1e-9)
            assert square == approx(TRUTH.c(p) ** 2, rel=1e-5)


def of_log(rest: float, rho: float = RHO, c: float = C) -> np.ndarray:
    """Return the table of a fluid with the density of the law `log`, with rho and c at rest."""
    bulk = rho * c**2
    p = rest + bulk * np.linspace(-0.5, 0.5, 33)
    table = FluidTable(p, np.log(rho) + (p - rest) / bulk, np.full(p.size, 1.0 / bulk), 0.0)
    return RiemannInvariants(
        Fluid("x", "table", 300.0, rest, rho, bulk, None, p[0], table, ""), rest
    ).table()


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("reflect", [1.0, 0.3, -1.0])
def test_a_table_of_the_log_law_is_the_log_law(scheme, reflect):
    box = Box(12, 9, scheme, (12, 9), log=True, reflect=reflect)
    state = noise(box, 0.02)  # fifth order amplifies it tenfold beyond a side
    (exact, rate), (found, same) = box.rates(state), box.rates(state, of_log(1e5))
    assert np.abs(found - exact).max(axis=(1, 2)) == approx(0.0, abs=1e-9 * np.abs(exact).max())
    assert same == approx(rate, rel=1e-7)


@pytest.mark.parametrize("scheme", [rec.UPWIND, rec.MUSCL])
def test_so_it_is_on_triangles(scheme, tmp_path):
    field = face_fields.triangles(tmp_path, 10, 8)
    scale = face_fields.RHO * np.array([1.0, face_fields.C, face_fields.C])
    state = (
        0.02 * scale[:, None] * np.random.default_rng(4).uniform(-1.0, 1.0, (3, len(field.area)))
    )
    table = of_log(1e5, face_fields.RHO, face_fields.C)
    (exact, rate), (found, same) = (
        field.liquid(rec.LAW_LOG, scheme, state, table=one) for one in (None, table)
    )
    assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()
    assert same == approx(rate, rel=1e-7)


def test_at_rest_nothing_moves_and_a_mirror_image_has_the_same_bits():
    box, table = Box(12, 9, "weno5", (12, 9), log=True), of_log(1e5)
    assert not box.rates(np.zeros((3, 9, 12)), table)[0].any()
    state, sign = noise(box, 0.2), np.array([1.0, -1.0, 1.0])[:, None, None]
    turned = box.rates(sign * state[:, :, ::-1], table)[0]
    assert np.array_equal(sign * turned[:, :, ::-1], box.rates(state, table)[0])


@pytest.mark.parametrize("path", ["grid", "faces", "triangles"])
def test_a_basin_is_relieved_into_the_network_and_all_of_it_is_booked(path, tmp_path):
    """Outflow is Torricelli's at the density and pressure of the patch, and the mass balance closes."""
    pool = basin(patches={"out": {"side": "east", "span": [1.0, 2.0]}})
    if path == "triangles":
        points, cells = triangles((4.0, 2.0), 0.25)
        east = on_sides(points, boundary(cells), (4.0, 2.0))["east"]
        write(tmp_path / "t.msh", points, cells.tolist(), {"out": east})
        pool = {key: pool[key] for key in ("type", "physics", "pressure", "thickness")}
        pool["mesh"] = {"file": str(tmp_path / "t.msh")}
    pool |= {"holes": HOLE} if path == "faces" else {}
    links = {"tap": valve("pool.out", "end", 1e-3, ramp(0.0, 0.002, 0.0, 1.0))}
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5, "initial": "rest"}
    nodes, probes = (
        {"pool": pool, "end": reservoir(5e6)},
        ["tap.flow", "pool.out.pressure", "pool.out.flow"],
    )
    result = fvsolve.run(scene(nodes, links, 0.01, numerics, probes, 1e-3, fluid=FLUID))
    assert result.ok and abs(result.ledger["mass"]["relative"]) < 1e-13
    p, flow = result["pool.out.pressure"][-1], result["tap.flow"][-1]
    assert 5.1e6 < p < 5.95e6
    assert flow == approx(1e-3 * np.sqrt(2 * (p - 5e6) / TRUTH.rho(p)), rel=2e-3)
    assert -result["pool.out.flow"][-1] == approx(flow, rel=1e-9)


@pytest.mark.parametrize("over", [-1e6, 0.0, 2e7])
def test_the_pressure_of_a_patch_is_that_of_the_cells_behind(over):
    pool = basin(start={"pressure": over}, patches={"out": {"side": "east"}})
    nodes, links = {"pool": pool, "end": reservoir(REST)}, {"tap": valve("pool.out", "end", 1e-4)}
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5, "initial": "rest"}
    probes = ["pool.out.pressure", "pool.pressure@2,1"]
    model = model_of(scene(nodes, links, 1.0, numerics, probes, 0.1, fluid=FLUID))
    assert model.observe(0.0, model.start) == approx([REST + over] * 2, rel=1e-9)
    own, node = model.meshed[0], model.tables.nodes[model.node_names.index("pool.out")]
    stiffness = model.evaluate(0.0, model.start)[1][model.layout["stiffness"] + node["row"]]
    behind = 0.1 * 16 * own.mesh.area[0]  # [m3]
    assert stiffness == approx(TRUTH.c(REST + over) ** 2 / behind, rel=1e-5)
    assert own.deviations(model.start)[0] == approx(
        TRUTH.rho(REST + over) - TRUTH.rho(REST), rel=1e-6, abs=1e-6
    )


@pytest.mark.parametrize("holes", [None, HOLE], ids=["grid", "faces"])
def test_probes_and_frames_have_the_isentropes_pressures(holes):
    places, more = ["1.0625,0.9375", "2.4375,1.1875"], {"holes": holes} if holes else {}
    probes = [f"pool.{field}@{place}" for place in places for field in ("pressure", "u")]
    pool = basin(start={"pressure": "1e6*cos(pi*x/4)", "u": "x"}, **more)
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5}
    model = model_of(scene({"pool": pool}, {}, 1.0, numerics, probes, 0.1, fluid=FLUID))
    frame = model.fields(model.start, model.new_out())["pool"]
    found = model.observe(0.0, model.start)
    own = model.meshed[0]
    for place, (p, u) in zip(places, found.reshape(-1, 2), strict=True):
        x, y = map(float, place.split(","))
        k = int(np.argmin(np.hypot(own.x - x, own.y - y)))
        rho = own.density + own.deviations(model.start)[0, k]
        assert [p, u] == approx([TRUTH.p(rho), x], rel=1e-6)
        assert [frame["pressure"][k], frame["velocity"][k, 0]] == approx([p, u], rel=1e-9)


@pytest.mark.parametrize("holes", [None, HOLE], ids=["grid", "faces"])
def test_implicit_steps_agree_with_explicit_ones(holes):
    pool = basin(
        cells=[8, 4], start={"pressure": "1e6*cos(pi*x/4)"}, **({"holes": holes} if holes else {})
    )
    found = []
    for method, rtol in (("radau-iia-5", 1e-7), ("dormand-prince", 1e-9)):
        numerics = {"scheme": "upwind", "method": method, "rtol": rtol}
        model = model_of(scene({"pool": pool}, {}, 0.004, numerics, (), 1e-3, fluid=FLUID))
        found.append(fvsolve.advance(model, fvsolve.initial_state(model), 0.004).y)
    assert np.abs(found[0] - found[1]).max() < 2e-6 * np.abs(found[1]).max()


@pytest.mark.parametrize("wave_speed", [30.0, 120.0, 1000.0])
def test_walls_with_large_compliance_leave_the_pressure_unchanged(wave_speed):
    """A slope of pressure accelerates the fluid as between rigid walls, and the state returns the given pressure."""
    pool = {
        "type": "basin",
        "physics": "liquid",
        "size": [1.0, 0.2],
        "cells": [10, 2],
        "pressure": 3e5,
        "thickness": 0.1,
        "wave_speed": wave_speed,
        "start": {"pressure": "1000 * (x - 0.5)"},
    }
    fluid = {"name": "Water", "temperature": 293.15, "law": "table"}
    model = model_of(scene({"b": pool}, {}, 1.0, {"scheme": "muscl"}, fluid=fluid))
    basin = model.meshed[0]
    rates = basin.states_of(model.evaluate(0.0, model.start.copy())[0])
    assert rates[1].reshape(2, 10)[:, 2:-2] == approx(-1000.0, rel=1e-5)
    assert basin.fields(basin.deviations(model.start))["pressure"] == approx(
        3e5 + 1000.0 * (basin.x - 0.5), rel=1e-9
    )


def test_walls_make_no_wave_quicker_than_the_fluids_own():
    with pytest.raises(
        CaseError, match="nodes.pool.wave_speed: 600 m/s is faster than sound in the fluid, 519"
    ):
        single(basin(wave_speed=600.0))


def test_a_mixture_is_refused():
    fluid = {"name": "ISO VG 46", "law": "mixture", "air_fraction": 0.01}
    with pytest.raises(
        CaseError, match='"mixture" does not apply to basins; expected "linear", "log" or "table"'
    ):
        fvsolve.load(scene({"pool": basin()}, {}, 1.0, {"scheme": "muscl"}, (), 0.1, fluid=fluid))
