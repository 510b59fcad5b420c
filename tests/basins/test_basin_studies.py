"""Basins in studies: orders, Jacobian patterns and implicit steps, step limits, energy, dispersion, charts."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import PLANE, model_of
from reference.folders import CASES
from reference.jacobians import stray
from reference.scenes import AMBIENT, GRAVITY, RHO, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.core.model import RunData
from fvsolve.core.model.energy_accounts import Accounts
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.errors import FvsolveError
from fvsolve.features.basins.free_surface.lower import FreeSurfaceRows
from fvsolve.features.basins.free_surface.lower_error_checks import on_grid, on_mesh, surface_waves
from fvsolve.studies.accuracy.chart import chart
from fvsolve.studies.accuracy.order import order
from fvsolve.studies.accuracy.refine import refinement_plan, resolutions
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise
from fvsolve.studies.peak_error import description
from fvsolve.studies.resolution import cell_counts, cell_keys_of, project_to, scaled
from fvsolve.studies.stability.stability import stability
from fvsolve.studies.sweep import sweep

SLOSH = "1 + 0.05*cos(0.3141592653589793*x) + 0.03*cos(0.6283185307179586*y)"  # in 10 m by 5 m


def pool(cells, level: str | None = None, size=(10.0, 5.0), depth: float = 1.0, **more) -> dict:
    start = {} if level is None else {"start": {"level": level}}
    return {
        "type": "basin",
        "size": list(size),
        "cells": list(cells),
        "level": depth,
        **start,
        **more,
    }


def alone(basin: dict, end: float, **numerics) -> dict:
    return scene({"pool": basin}, {}, end, PLANE | numerics, every=end / 20)


# order ----------------------------------------------------------------------------------------------------------


def test_errors_of_a_smooth_slosh_fall_at_the_order_of_the_scheme():
    found = order(alone(pool((24, 12), SLOSH), 1.2), levels=4)
    assert found.kind == "richardson" and [row.level.cells for row in found.rows] == [
        288,
        1152,
        4608,
        18432,
    ]
    fit = found.fits["pool at the end: depth"]
    assert fit["L1"].order == approx(2.0, abs=0.25) and fit["L2"].order == approx(2.0, abs=0.25)
    first = order(alone(pool((24, 12), SLOSH), 1.2, scheme="upwind", method="euler"), levels=4)
    assert first.fits["pool at the end: depth"]["L1"].order == approx(1.0, abs=0.2)
    assert found.plain()["rows"][1]["set"]["nodes.pool.cells"] == [48, 24]


def test_a_finer_run_judges_as_rows_judge_each_other():
    case = alone(pool((20, 10), SLOSH), 1.2)
    by_rows, finer = order(case, levels=5), order(case, levels=2, reference="finer")
    for k in range(2):
        name = "pool at the end: flow_y"
        assert finer.rows[k].errors[name]["L1"] == approx(
            by_rows.rows[k].errors[name]["L1"], rel=0.1
        )


def test_a_broken_dam_is_of_first_order_in_the_mean_with_the_reason_in_the_note():
    found = order(alone(pool((50, 2), "where(x < 5, 1, 0.4)", size=(10.0, 0.4)), 0.6), levels=4)
    assert found.fits["pool at the end: depth"]["L1"].order == approx(1.0, abs=0.1)
    assert any("the start jumps" in note and "about 1 in L1" in note for note in found.notes)


def test_only_steps_are_refined_on_a_fixed_mesh():
    found = order(alone(pool((20, 10), SLOSH), 1.2), refine="time", levels=4)
    assert found.fits["pool at the end: depth"]["L1"].order == approx(2.0, abs=0.15)
    assert len({row.level.cells for row in found.rows}) == 1


def test_cells_of_pipes_and_basins_double_together_in_both_directions():
    still = PLANE | {"initial": "rest"}
    nodes = {"lake": reservoir(2e5), "pool": pool((4, 6), patches={"in": {"side": "west"}})}
    case = fvsolve.load(
        scene(nodes, {"main": pipe("lake", "pool.in", 50.0, 0.1, 1000.0, 10)}, 0.1, still)
    )
    assert resolutions(case)["nodes.pool.cells"] == "both"
    rows = refinement_plan(case, levels=3).levels
    assert [row.set["nodes.pool.cells"] for row in rows] == [[4, 6], [8, 12], [16, 24]]
    assert [row.set["links.main.cells"] for row in rows] == [10, 20, 40] and rows[
        2
    ].cells == 16 * 24 + 40
    one = refinement_plan(case, key="nodes.pool.cells", levels=2).levels[1]
    assert one.set["nodes.pool.cells"] == [8, 12] and one.set["links.main.cells"] == 10
    assert cell_keys_of(scaled(cell_counts(case), 0.5)) == {
        "links.main.cells": 5,
        "nodes.pool.cells": [2, 3],
    }


def test_the_content_of_a_basin_is_equal_on_coarser_cells():
    """Projection keeps contents to rounding, also on graded grids and with holes, and approximates the function."""
    for more in ({}, {"grading": [3.0, 0.5]}, {"holes": [[2.5, 1.25, 5.0, 2.5]]}):
        cases = [fvsolve.load(alone(pool(cells, **more), 1.0)) for cells in ((48, 32), (24, 16))]
        fine, coarse = (FreeSurfaceRows(case, "pool") for case in cases)
        value = np.cos(0.3 * fine.x) * np.exp(0.2 * fine.y)
        found = project_to(fine, value[None], coarse)[0]
        assert found @ coarse.mesh.area == approx(value @ fine.mesh.area, rel=1e-14)
        wanted = np.cos(0.3 * coarse.x) * np.exp(0.2 * coarse.y)
        assert np.abs(found - wanted).max() < 5e-3


def test_a_mesh_from_a_file_has_no_finer_mesh(tmp_path):
    import meshio

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    meshio.write(
        tmp_path / "square.vtu",
        meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]),
    )
    basin = {"type": "basin", "mesh": {"file": str(tmp_path / "square.vtu")}, "level": 1.0}
    case = fvsolve.load(scene({"pool": basin}, {}, 1.0, PLANE))
    assert description({1.0: None}, case).startswith(
        "errors are unknown: cells of pool come from files"
    )
    with pytest.raises(FvsolveError, match=r"meshes from files cannot be refined \(pool\)"):
        refinement_plan(case, "both")


# Jacobians and implicit steps ---------------------------------------------------------------------------------------


def fed(scheme: str, end: float = 1.0, **numerics) -> dict:
    """Return a case of a sloshing basin between a pipe with a valve that opens and a valve to a shallower basin."""
    west = pool(
        (6, 4), SLOSH, elevation=0.0, patches={"in": {"side": "west"}, "gate": {"side": "east"}}
    )
    east = pool(
        (4, 3),
        size=(4.0, 3.0),
        depth=0.5,
        elevation=0.0,
        patches={"gate": {"side": "west"}},
        bed="0.2*x",
    )
    links = {
        "main": pipe(
            "lake", "end", 50.0, 0.3, 1000.0, 6, friction={"model": "steady", "factor": 0.02}
        ),
        "tap": valve("end", "west.in", 0.02, ramp(0.0, 0.2, 0.0, 1.0)),
        "hole": valve("west.gate", "east.gate", 0.05),
    }
    nodes = {"west": west, "east": east, "end": {"type": "junction", "elevation": 0.0}}
    nodes["lake"] = reservoir(AMBIENT + 2e4, elevation=0.0)
    return scene(nodes, links, end, PLANE | {"scheme": scheme} | numerics, ["hole.flow"], end / 10)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme):
    model, rng = model_of(fed(scheme)), np.random.default_rng(1)
    for t in (0.0, 0.1, 0.9):
        y = model.start + model.scale * rng.normal(scale=0.2, size=model.y_size)
        assert stray(model, t, y) < 1e-9
    entries = jacobian_pattern(model).nnz
    assert entries < 0.35 * model.y_size**2  # a full pattern would prove nothing


def test_a_cell_feels_its_row_and_column_and_no_corner():
    """A row of the pattern has three quantities of five cells for upwind, and of nine for muscl."""
    for scheme, cells in (("upwind", 5), ("muscl", 9)):
        model = model_of(alone(pool((7, 7)), 1.0, scheme=scheme))
        per_row = np.diff(jacobian_pattern(model).tocsr().indptr)
        assert per_row[24] == 3 * cells


@pytest.mark.parametrize("method", ["radau-iia-5", "esdirk-4", "rodas-5p"])
def test_implicit_steps_come_to_where_explicit_ones_do(method):
    runs = {}
    for name, rtol in ((method, 1e-6), ("dormand-prince", 1e-8)):
        case = fed("muscl", method=name, rtol=rtol, limiter="van-leer")
        del case["numerics"]["courant"]
        model = model_of(case)
        runs[name] = fvsolve.advance(model, fvsolve.initial_state(model), 1.0).y / model.scale
    assert np.abs(runs[method] - runs["dormand-prince"]).max() < 2e-3
    assert fvsolve.run(case).ledger["mass"]["relative"] < 1e-13


def test_implicit_steps_may_cross_several_cells():
    """Implicit steps of Courant number 10 in a closed pool keep the mass."""
    case = alone(pool((16, 8), SLOSH), 4.0, method="radau-iia-5", courant=10.0)
    run = fvsolve.run(case)
    assert run.ok and abs(run.ledger["mass"]["relative"]) < 1e-13
    assert run.summary["steps"] < 100


@pytest.mark.parametrize("physics", ["free-surface", "liquid"])
def test_outflow_through_an_open_side_is_in_the_ledger_of_implicit_steps(physics):
    """The pattern contains the cells at the open side, so implicit steps keep the mass to rounding."""
    case = alone(pool((12, 8), SLOSH), 3.0) if physics == "free-surface" else block((12, 8), 1e-3)
    (basin,) = case["nodes"].values()
    basin["patches"] = {"east": {"side": "east", "boundary": "open"}}
    model = model_of(case)
    assert (
        stray(
            model,
            0.0,
            model.start + 0.05 * model.scale * np.random.default_rng(0).normal(size=model.y_size),
        )
        < 1e-9
    )
    del case["numerics"]["courant"]
    case["numerics"] |= {"method": "radau-iia-5", "rtol": 1e-4}
    assert abs(fvsolve.run(case).ledger["mass"]["relative"]) < 1e-13


# limits of steps -------------------------------------------------------------------------------------------------


def test_a_slosh_blows_up_at_the_predicted_step():
    """Prediction and runs agree to 3e-4 for 16 by 4 cells at rest, and to 1e-2 about a moving slosh."""
    still = stability(alone(pool((16, 4), size=(10.0, 4.0)), 1.0), ["upwind"], ["ssp-rk2"]).rows[0]
    assert still.difference == approx(0.0, abs=3e-4)
    # Courant number 1, which counts half cells, is stable
    assert still.rate * still.predicted > 2.0
    moving = stability(alone(pool((16, 4), SLOSH), 1.0), ["upwind"], ["ssp-rk2"]).rows[0]
    assert moving.difference == approx(0.0, abs=1e-2)
    assert any("the state is not steady" in note for note in moving.notes)


def test_a_limited_basin_is_compared_with_upwind():
    row = stability(alone(pool((16, 4), size=(10.0, 4.0)), 1.0), ["muscl"], ["ssp-rk2"]).rows[0]
    assert row.measured == approx(row.frozen["upwind"], rel=0.01)
    assert any("in basins only the weights of upwind are used" in note for note in row.notes)


def test_a_linearised_basin_sloshes_at_its_natural_frequencies():
    """The lowest frequency of the poles at rest is that of the longest wave, sqrt(g h) k, to 5e-3."""
    depth, size = 1.0, 10.0
    case = alone(pool((24, 2), size=(size, 1.0), depth=depth), 1.0, scheme="upwind")
    found = linearise(case)
    values = np.linalg.eigvals(found.a)
    slowest = values.imag[values.imag > 1e-6].min()
    assert slowest == approx(math.sqrt(GRAVITY * depth) * math.pi / size, rel=5e-3)
    assert found.state_units[0] == "m" and found.state_units[-1] == "m2/s"
    assert values.real.max() < 1e-9 * abs(values).max()
    with pytest.raises(FvsolveError, match="--scheme upwind"):
        linearise(case, scheme="fromm")


# energy ----------------------------------------------------------------------------------------------------------


def scheme_loss(cells: int, **numerics) -> float:
    """Energy that the scheme dissipates in a closed slosh in 1 s [J]."""
    found = energy(alone(pool((2 * cells, cells), SLOSH), 1.0, **numerics))
    assert not found.supplied and not found.dissipated
    return found.scheme["pool"][-1]


def test_loss_of_a_slosh_by_a_scheme_falls_with_its_order():
    """The loss by upwind falls with the width of cells, the loss by limited slopes with its cube."""
    upwind = [scheme_loss(n, scheme="upwind") for n in (8, 16, 32)]
    muscl = [scheme_loss(n) for n in (8, 16, 32)]
    assert min(upwind + muscl) > 0.0
    assert np.log2(upwind[1] / upwind[2]) == approx(1.0, abs=0.15)
    assert np.log2(muscl[1] / muscl[2]) == approx(3.0, abs=0.2)


def test_a_method_that_conserves_squares_leaves_all_the_loss_to_the_scheme():
    """The stored energy is nearly quadratic: the step loss by gauss-4 is below 1e-9 of it, and ssp-rk2 adds energy."""
    case = alone(pool((16, 8), SLOSH), 1.0)
    kept, made = (energy(case, {"numerics.method": method}) for method in ("gauss-4", "ssp-rk2"))
    size = energy_of_slosh()
    assert abs(kept.step[-1]) < 1e-9 * size and made.step[-1] < -1e-5 * size
    assert kept.stored["pool"][-1] == approx(-kept.scheme["pool"][-1], abs=1e-9 * size)


def energy_of_slosh() -> float:
    """Energy of the slosh above that of a lake at rest [J]: rho g a^2 A / 4 for each of its two cosines."""
    return RHO * GRAVITY * (0.05**2 + 0.03**2) / 4.0 * 50.0


def test_the_energy_of_the_start_is_that_of_the_surface_over_the_datum():
    found = energy(alone(pool((64, 32), SLOSH), 0.01))
    still = 0.5 * RHO * GRAVITY * 50.0  # 1 m of water over the datum
    assert found.at_start["pool"] - still == approx(energy_of_slosh(), rel=2e-3)


def test_a_basin_that_drains_supplies_the_valve_as_its_tank_does():
    outlet = {"outlet": {"side": "east", "span": [1.25, 3.75]}}
    shown = {}
    for kind, place, node in (
        ("basin", "pool.outlet", pool((20, 8), patches=outlet, elevation=2.0)),
        ("tank", "pool", {"type": "tank", "area": 50.0, "level": 1.0, "elevation": 2.0}),
    ):
        links = {"tap": valve(place, "out", 0.002, ramp(0.0, 10.0, 0.0, 1.0))}
        numerics = PLANE if kind == "basin" else {}
        case = scene(
            {"pool": node, "out": reservoir(AMBIENT, elevation=0.0)},
            links,
            40.0,
            numerics,
            ["tap.flow"],
            1.0,
        )
        shown[kind] = energy(case)
    basin, twin = shown["basin"], shown["tank"]
    assert basin.dissipated["tap"][-1] == approx(twin.dissipated["tap"][-1], rel=2e-4)
    assert basin.stored["pool"][-1] == approx(twin.stored["pool"][-1], rel=2e-4)
    assert 0.0 < basin.numerical_remainder[-1] < 1e-4 * basin.throughput


@pytest.mark.parametrize(
    "patch", [{"side": "west"}, {"at": [5.0, 1.5], "area": 8.0}], ids=["side", "interior"]
)
@pytest.mark.parametrize("head", [0.5, 3.0], ids=["out", "in"])
def test_flow_through_a_patch_is_no_loss_of_the_scheme(head, patch):
    """The power lost by the scheme in a state is equal to rounding with the valve at the patch open and closed."""
    found = []
    for opening in (0.0, 1.0):
        basin = pool((6, 4), patches={"west": patch}, elevation=0.0, bed="0.1*x")
        nodes = {"pool": basin, "lake": {"type": "reservoir", "head": head, "elevation": 0.0}}
        links = {"tap": valve("pool.west", "lake", 0.2) | {"opening": opening}}
        model = model_of(scene(nodes, links, 1.0, PLANE | {"scheme": "upwind"}, ["tap.flow"]))
        y = model.scale * np.random.default_rng(5).normal(scale=0.5, size=model.y_size)
        accounts = Accounts(RunData(model))
        power = accounts.power_at(0.5, y, np.zeros(model.y_size), model.new_out())
        kinds = {
            (one.category, one.place): value
            for one, value in zip(accounts.accounts, power, strict=True)
        }
        found.append(kinds)
    shut, open_ = found
    assert open_["scheme", "pool"] == approx(shut["scheme", "pool"], rel=1e-9)
    assert abs(open_["rate", "pool"] - shut["rate", "pool"]) > 100.0  # water passes the valve
    assert open_["dissipated", "pool"] >= 0.0


# dispersion ------------------------------------------------------------------------------------------------------


def slower(k: float, depth: float) -> float:
    """Reduction [%] of the speed of small waves (Airy 1845) from that in shallow water."""
    return 100.0 * (1.0 - math.sqrt(math.tanh(k * depth) / (k * depth)))


@pytest.mark.parametrize("more", [{}, {"grading": [2.0, 1.0]}], ids=["even", "graded"])
def test_a_slosh_is_warned_of_where_it_is_short_against_its_depth(more):
    """Half a wave in 10 m gives no notice at a depth of 0.5 m (k h = 0.16), and a notice at 1.8 m."""
    k = math.pi / 10.0
    for depth in (0.5, 1.8):
        basin = pool((32, 8), f"{depth} + 0.01*cos({k!r}*x)", depth=depth, **more)
        said = [one for one in model_of(alone(basin, 1.0)).warnings if "slower" in one.text]
        assert len(said) == (1 if depth > 1.0 else 0)
    assert (
        f"waves about 20 m long in 1.8 m of water (k h = 0.57): real waves are {slower(k, 1.8):.2g} %"
        in (said[0].text)
    )


def test_wavenumbers_are_those_of_the_waves_that_there_are():
    """Exact by cosines, of second order by faces; a dam break in a basin of length L has k = sqrt(12) / L."""
    k = math.hypot(2.0 * math.pi / 10.0, math.pi / 5.0)
    level = f"1 + 0.01*cos({2.0 * math.pi / 10.0!r}*x)*cos({math.pi / 5.0!r}*y)"
    model = model_of(alone(pool((32, 16), level), 1.0))
    (basin,), y = model.meshed, model.start
    assert surface_waves(basin, basin.deviations(y)).k == approx(k, rel=1e-12)
    surface = basin.deviations(y)[0]
    assert on_mesh(basin, surface) == approx(
        on_grid(basin, surface), rel=2.0 * (k * 10.0 / 32.0) ** 2 / 12.0
    )
    dam = model_of(alone(pool((64, 4), "where(x < 5, 1, 0.4)"), 1.0))
    assert surface_waves(dam.meshed[0], dam.meshed[0].deviations(dam.start)).k == approx(
        math.sqrt(12.0) / 10.0, rel=1e-3
    )


def test_waves_that_come_about_in_a_run_are_warned_of_once(tmp_path):
    """Inflow into a deep pool at rest gives no notice at the start and a single notice after the run."""
    nodes = {
        "pool": pool((20, 4), depth=3.0, patches={"in": {"side": "west"}}),
        "lake": {"type": "reservoir", "head": 9},
    }
    case = scene(
        nodes,
        {"tap": valve("lake", "pool.in", 0.3, ramp(0.0, 0.2, 0.0, 1.0))},
        3.0,
        PLANE,
        ["tap.flow"],
        0.1,
    )
    case["output"]["fields"] = 4
    assert not model_of(case).warnings
    said = [
        one["text"] for one in fvsolve.run(case).summary["warnings"] if one["kind"] == "dispersion"
    ]
    assert (
        len(said) == 1
        and said[0].startswith("pool: waves about")
        and " s" in said[0].rsplit("at", 1)[1]
    )


# liquids and scalars ---------------------------------------------------------------------------------------------


def block(cells, end: float, **numerics) -> dict:
    """Return a case of a pressure pulse in a liquid between walls."""
    start = {"pressure": "1e5*exp(-150*((x - 0.4)**2 + (y - 0.2)**2))"}
    given = {
        "size": [1.0, 0.5],
        "cells": list(cells),
        "pressure": 1e6,
        "thickness": 0.1,
        "wave_speed": 1000.0,
    }
    return scene(
        {"block": {"type": "basin", "physics": "liquid", "start": start, **given}},
        {},
        end,
        PLANE | numerics,
    )


def test_fifth_order_shows_on_grids_for_cells_start_from_their_means():
    """A start from averages of cells shows order 5 in a liquid and in a slosh; values at centres show order 2."""
    found = order(block((32, 16), 1e-4, scheme="upwind5", method="rk4", courant=0.4), levels=4)
    assert min(found.fits["block at the end: density"]["L1"].pairwise[:2]) > 3.8
    slosh = alone(
        pool((20, 2), "1 + 0.02*cos(0.3141592653589793*x)"), 1.0, scheme="upwind5", method="rk4"
    )
    assert order(slosh, levels=4).fits["pool at the end: depth"]["L1"].order == approx(5.0, abs=0.2)


def test_energy_of_a_liquid_falls_by_the_loss_of_the_scheme():
    """The loss falls at third order with limited slopes; the energy at the start is that of the pulse."""
    loss = [
        energy(block((n, n // 2), 5e-4, courant=0.5)).scheme["block"][-1] for n in (32, 64, 128)
    ]
    assert loss[0] > loss[1] > loss[2] > 0.0 and np.log2(loss[1] / loss[2]) == approx(3.0, abs=0.6)
    found = energy(block((128, 64), 1e-6, courant=0.5))
    # thickness p^2 / (2 rho a^2), of exp(-300 r^2)
    pulse = 0.1 * 1e10 * math.pi / 300.0 / (2.0 * RHO * 1e6)
    still = 0.1 * 0.5 * (1e6 - AMBIENT) ** 2 / (2.0 * RHO * 1e6)
    rise = 0.1 * (1e6 - AMBIENT) * 1e5 * math.pi / 150.0 / (RHO * 1e6)
    assert found.at_start["block"] == approx(still + rise + pulse, rel=1e-3)


@pytest.mark.parametrize("scheme", ["upwind", "upwind5"])
def test_a_liquid_blows_up_at_the_predicted_step(scheme):
    row = stability(block((12, 4), 1e-3), [scheme], ["rk4"]).rows[0]
    assert row.difference == approx(0.0, abs=3e-4)


def test_friction_of_the_bed_is_accounted_with_its_exact_loss():
    """Manning's friction dissipates what the stored energy loses besides the loss of the scheme, to 1 %."""
    smooth, rough = (
        energy(alone(pool((32, 16), SLOSH, **more), 2.0)) for more in ({}, {"manning": 0.05})
    )
    (taken,) = rough.dissipated.values()
    assert taken[-1] > 0.0 and rough.numerical_remainder[-1] == approx(
        smooth.numerical_remainder[-1], rel=0.01
    )
    left = rough.stored["pool"][-1] - smooth.stored["pool"][-1]
    assert left == approx(-taken[-1], rel=0.01)


def swirl(**numerics) -> dict:
    """Return a case of a dye in a vortex that reverses (LeVeque 1996)."""
    dye = "exp(-60*((x - 0.35)**2 + (y - 0.5)**2))"
    sheet = {
        "type": "basin",
        "physics": "transport",
        "size": [1.0, 1.0],
        "cells": [16, 16],
        "scalars": {"dye": dye},
    }
    sheet["velocity"] = {"expression": "swirl", "period": 1.5}
    return scene(
        {"sheet": sheet},
        {},
        1.5,
        PLANE | {"courant": 0.5} | numerics,
        every=0.5,
        scalars={"dye": {}},
    )


def test_a_dye_in_a_vortex_that_turns_back_stays_within_bounds_and_shows_its_order():
    """The step follows the greatest velocity of the run, so it is not too long after the vortex is at rest."""
    found = order(swirl(), levels=4, cells=32)
    assert found.fits["sheet at the end: dye"]["L1"].order == approx(2.1, abs=0.3)
    for cells in (32, 64):
        model = model_of(
            swirl() | {"nodes": {"sheet": swirl()["nodes"]["sheet"] | {"cells": [cells, cells]}}}
        )
        basin, start = model.meshed[0], model.start
        y = fvsolve.advance(model, fvsolve.initial_state(model), 1.5).y
        assert (
            basin.amounts(y).max() <= basin.amounts(start).max() and basin.amounts(y).min() >= 0.0
        )


def test_a_vortex_stands_still_where_it_is_linearised():
    """The velocity keeps its value at the start, so predicted and measured limits agree."""
    row = stability(swirl(), ["upwind"], ["rk4"]).rows[0]
    assert row.difference == approx(0.0, abs=3e-4)


def test_a_chart_of_a_slosh_lays_error_against_cost():
    """Errors of probes and of all cells fall along each curve, and muscl has smaller errors than upwind."""
    case = alone(pool((16, 8), SLOSH), 1.0)
    case["output"]["probes"] = ["pool.depth@0.3,0.3"]
    found = chart(case, schemes=["upwind", "muscl"], methods=["ssp-rk2"], cells=[8, 16, 32])
    curves = found.curves()
    for name in ("upwind ssp-rk2", "muscl ssp-rk2"):
        errors = [(point.trajectory, point.end) for point in curves[name]]
        assert all(point.ok for point in curves[name]) and len(errors) == 3
        assert (
            errors[0][0] > errors[1][0] > errors[2][0]
            and errors[0][1] > errors[1][1] > errors[2][1]
        )
    assert curves["muscl ssp-rk2"][2].end < 0.3 * curves["upwind ssp-rk2"][2].end
    assert [point.setting.keys["nodes.pool.cells"] for point in curves["muscl ssp-rk2"]] == [
        [8, 4],
        [16, 8],
        [32, 16],
    ]


def test_studies_run_cases_with_lines_and_grids_of_frames():
    case = alone(pool((16, 8), SLOSH), 1.0)
    grid = {"basin": "pool", "fields": ["depth", "max_depth"], "format": "netcdf", "cell": 1.0}
    case["output"] |= {
        "fields": 2,
        "probes": ["pool.depth@0.3,0.3"],
        "grids": {"water": grid},
        "lines": {"axis": {"basin": "pool", "from": [1, 2], "to": [9, 2]}},
    }
    rows = sweep(case, {"numerics.courant": [0.5, 0.9]}).rows
    assert [row["reason"] for row in rows] == ["finished"] * 2
    assert len(order(case, levels=2).rows) == 2
    assert all(
        point.ok
        for point in chart(case, schemes=["muscl"], methods=["ssp-rk2"], cells=[8, 16]).points
    )


def test_a_chart_states_that_cells_of_a_file_are_not_refined():
    with pytest.raises(FvsolveError, match=r"the mesh of plain is a file"):
        chart(CASES / "flooding.toml")
