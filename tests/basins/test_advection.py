"""Advection of scalars over grids: orders, bounds, closed forms, uniform values, conservation and symmetries."""

import copy

import numpy as np
import pytest
from pytest import approx
from reference.carried import NONE, SCHEMES, Carried, carried, means, ring_rates
from scipy.special import erfc

from fvsolve.core.mesh import rectangle
from fvsolve.features.basins import advection
from fvsolve.features.basins.transport.lower import face_flows, grid_flows

TURN = {"expression": "rotation", "centre": (0.5, 0.5), "angular_velocity": 2.0 * np.pi}
SWIRL = {"expression": "swirl"}
FIFTH = ("upwind5", "weno5")


def difference(case: Carried, one, other) -> float:
    """Mean absolute difference over the area."""
    return float(np.sum(np.abs(one - other) * case.mesh.area) / case.mesh.area.sum())


def order(errors) -> float:
    """Observed order of the errors on n and on 2 n cells."""
    return float(np.log2(errors[0] / errors[1]))


def returned(scheme, cells, velocity, start, factor=lambda t: 1.0, **more) -> float:
    """Difference from the start at 1 s, when the exact solution has returned to the start."""
    case = carried(scheme, cells, velocity, **more)
    s = means(case.mesh, start)
    return difference(
        case, case.run(s, 1.0, 0.4, "rk4" if scheme in FIFTH else "ssp-rk2", factor), s
    )


def mound(x, y):
    """Mound of radius 0.28 with five continuous derivatives, zero outside."""
    return np.maximum(1.0 - ((x - 0.5) ** 2 + (y - 0.7) ** 2) / 0.28**2, 0.0) ** 6


def bump(x, y):
    return np.exp(-((x - 0.4) ** 2 + (y - 0.55) ** 2) / (2.0 * 0.08**2))


def forth_and_back(t):
    return np.cos(np.pi * t)


# Observed orders on 64 and 128 cells per side; upwind and limiters that flatten maxima are pre-asymptotic there.
TURNED = {
    "upwind": 0.54,
    "minmod": 1.75,
    "van-leer": 1.86,
    "monotonized-central": 1.76,
    "upwind5": 4.82,
    "weno5": 4.44,
}
SWIRLED = {
    "upwind": 0.80,
    "minmod": 1.77,
    "van-leer": 2.51,
    "monotonized-central": 2.76,
    "upwind5": 4.89,
    "weno5": 5.1,
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_mound_turned_once_around_comes_back_to_the_order_of_the_scheme(scheme):
    errors = [returned(scheme, n, TURN, mound, bounds=(0.0, 1.0)) for n in (64, 128)]
    assert order(errors) == approx(TURNED[scheme], abs=0.1)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_bump_swirled_forth_and_back_returns_to_the_order_of_the_scheme(scheme):
    errors = [returned(scheme, n, SWIRL, bump, forth_and_back) for n in (64, 128)]
    assert order(errors) == approx(SWIRLED[scheme], abs=0.1)


@pytest.mark.parametrize("scheme", ["van-leer", "monotonized-central", "upwind5", "weno5"])
def test_on_a_graded_grid_the_order_is_two_at_least(scheme):
    errors = [
        returned(scheme, n, SWIRL, bump, forth_and_back, grading=(3.0, 0.5)) for n in (64, 128)
    ]
    assert order(errors) > 2.0


def slotted(x, y):
    """Zalesak's disk (1979), of radius 0.15 at (0.5, 0.75) with a slot 0.05 wide."""
    return np.where(
        (np.hypot(x - 0.5, y - 0.75) < 0.15) & ((np.abs(x - 0.5) > 0.025) | (y > 0.85)), 1.0, 0.0
    )


DISK = {
    "upwind": 1.116,
    "minmod": 0.667,
    "van-leer": 0.480,
    "monotonized-central": 0.405,
    "upwind5": 0.211,
}
DISK |= {"weno5": 0.222}  # difference after a turn over the area of the disk, 100 cells per side


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_slotted_disk_after_a_full_rotation_stays_within_its_bounds(scheme):
    case = carried(scheme, 100, TURN, bounds=(0.0, 1.0))
    start = means(case.mesh, slotted, 8)
    end = case.run(start, 1.0, 0.5)
    inside = end.min() > -1e-14 and end.max() < 1.0 + 1e-14
    assert inside == (scheme != "upwind5")
    assert difference(case, end, start) / start.mean() == approx(DISK[scheme], rel=0.02)


# Greatest Courant numbers of Euler steps: without and with inflow through the boundary.
COURANT = {"upwind": (1.0, 1.0), "minmod": (2 / 3, 1 / 2), "van-leer": (1 / 2, 1 / 3)}
COURANT |= {"monotonized-central": (1 / 2, 1 / 3), "weno5": (1 / 2, 1 / 2)}


def random_case(scheme, seed, through=False, deep=False, **more) -> tuple[Carried, np.ndarray]:
    """Return (case, amounts): a graded grid with random depths, values and stream function."""
    random = np.random.default_rng(seed)
    mesh = rectangle((1.0, 0.7), (11, 9), grading=(3.0, 0.5))
    stream = random.normal(size=len(mesh.points))
    if not through:
        x, y = mesh.points.T
        stream[(x == 0.0) | (x == 1.0) | (y == 0.0) | (y == 0.7)] = 0.0
    flows = grid_flows(mesh, face_flows(mesh, {"stream": stream}))
    depth = random.uniform(0.5, 2.0, len(mesh.cells)) if deep else NONE
    values = random.choice([0.0, 1.0], len(mesh.cells)) + 0.1 * random.random(len(mesh.cells)) * (
        seed % 2
    )
    case = Carried(scheme, mesh, *flows, outside=random.random(2 * (11 + 9)), depth=depth, **more)
    return case, values * (depth if deep else 1.0)


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("through", [False, True])
@pytest.mark.parametrize("scheme", COURANT)
def test_a_step_of_euler_stays_within_the_values_of_neighbours(scheme, through, deep):
    for seed in range(50):
        case, s = random_case(scheme, seed, through, deep, bounds=(0.0, 1.1))
        depth = case.depth if deep else 1.0
        end = (s + COURANT[scheme][through] / case.fastest * case.rates(s)) / depth
        low, high = surroundings(case, s / depth)
        if scheme == "weno5":
            low, high = 0.0, 1.1
        assert np.all(end >= low - 1e-14) and np.all(end <= high + 1e-14)


def surroundings(case, s):
    """Return (least, greatest) of the values of a cell, its four neighbours and boundary faces."""
    ny, nx = case.ny, case.nx
    west, east, south, north = np.split(case.outside, np.cumsum([ny, ny, nx]))
    wide = np.full((ny + 2, nx + 2), np.nan)
    wide[1:-1, 1:-1] = s.reshape(ny, nx)
    wide[1:-1, 0], wide[1:-1, -1], wide[0, 1:-1], wide[-1, 1:-1] = west, east, south, north
    stack = [wide[1:-1, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1]]
    return np.min(stack, axis=0).ravel(), np.max(stack, axis=0).ravel()


def test_the_linear_scheme_leaves_the_bounds():
    case, s = random_case("upwind5", 1)
    assert (s + 0.5 / case.fastest * case.rates(s)).min() < -0.01


def ogata_banks(x, t, u, spread):
    """Value behind an inlet at 1 from t = 0 on (Ogata and Banks 1961)."""
    wide = 2.0 * np.sqrt(spread * t)
    return 0.5 * (erfc((x - u * t) / wide) + np.exp(u * x / spread) * erfc((x + u * t) / wide))


INLET = {
    "upwind": 0.89,
    "minmod": 1.55,
    "van-leer": 1.63,
    "monotonized-central": 1.75,
    "upwind5": 1.89,
    "weno5": 1.88,
}
CLOUD = {
    "upwind": 0.78,
    "minmod": 1.99,
    "van-leer": 2.08,
    "monotonized-central": 2.05,
    "upwind5": 1.84,
    "weno5": 1.91,
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_inlet_with_diffusion_is_that_of_ogata_and_banks(scheme):
    errors = []
    for n in (40, 80):
        along = {"expression": "constant", "u": 1.0, "v": 0.0}
        case = carried(scheme, (n, 2), along, (3.0, 0.1), outside=1.0, diffusivity=0.1)
        end = case.run(np.zeros(2 * n), 0.8, 0.4)
        assert end[:n] == approx(end[n:], abs=1e-12)
        errors.append(
            difference(case, end, means(case.mesh, lambda x, y: ogata_banks(x, 0.8, 1.0, 0.1)))
        )
    assert order(errors) == approx(INLET[scheme], abs=0.1) and errors[1] < (
        0.01 if scheme == "upwind" else 7e-4
    )


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_cloud_that_moves_and_spreads_stays_gaussian(scheme):
    d, u, v = 0.002, 0.6, 0.3

    def cloud(x, y, t):
        wide = 0.05**2 + 2.0 * d * t
        return (
            0.05**2
            / wide
            * np.exp(-((x - 0.3 - u * t) ** 2 + (y - 0.3 - v * t) ** 2) / (2.0 * wide))
        )

    errors = []
    for n in (64, 128):
        across = {"expression": "constant", "u": u, "v": v}
        case = carried(scheme, n, across, diffusivity=d, grading=(2.0, 1.0))
        end = case.run(means(case.mesh, lambda x, y: cloud(x, y, 0.0)), 0.5, 0.4)
        errors.append(difference(case, end, means(case.mesh, lambda x, y: cloud(x, y, 0.5))))
    assert order(errors) == approx(CLOUD[scheme], abs=0.1) and errors[1] < (
        4e-3 if scheme == "upwind" else 4e-4
    )


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_uniform_value_stays_uniform_to_the_bit_in_any_flow_without_divergence(scheme, deep):
    for seed in range(5):
        case, s = random_case(
            scheme, seed, through=True, deep=deep, bounds=(0.0, 1.0), diffusivity=0.01
        )
        case.outside[:] = 0.5
        assert np.all(case.rates(np.full(s.size, 0.5) * (case.depth if deep else 1.0), 0.7) == 0.0)
        if not deep:
            case.outside[:] = 0.3
            assert np.all(case.rates(np.full(s.size, 0.3)) == 0.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_uniform_value_changes_by_itself_times_the_divergence(scheme):
    case, s = random_case(scheme, 3)
    case.flow_x, case.flow_y = case.flow_x**2, case.flow_y**3
    case.outside[:] = 0.3
    x, y = case.flow_x.reshape(case.ny, -1), case.flow_y.reshape(-1, case.nx)
    apart = (case.ky[:, None] * case.kx) * ((x[:, 1:] - x[:, :-1]) + (y[1:] - y[:-1]))
    assert case.rates(np.full(s.size, 0.3)) == approx(-0.3 * apart.ravel(), rel=1e-14, abs=0.0)


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_advected_and_diffused_amount_is_conserved(scheme, deep):
    for seed in range(5):
        case, s = random_case(scheme, seed, deep=deep, bounds=(0.0, 1.1), diffusivity=0.01)
        share = case.rates(s) * case.mesh.area
        assert abs(share.sum()) < 1e-15 * np.abs(share).sum() * np.sqrt(s.size)


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_inflow_through_the_boundary_is_the_gain_of_the_content(scheme, deep):
    for seed in range(5):
        case, s = random_case(
            scheme, seed, through=True, deep=deep, bounds=(0.0, 1.1), diffusivity=0.01
        )
        share, ring, excesses = (
            case.rates(s, -0.7) * case.mesh.area,
            np.empty_like(case.outside),
            (NONE, NONE),
        )
        if scheme in FIFTH:
            first, last = s.size + np.cumsum([0, case.flow_x.size])
            excesses = case.work[first:last], case.work[last : last + case.flow_y.size]
        size, flows = (
            (case.nx, case.ny, case.kx, case.ky),
            (-0.7, case.flow_x, case.flow_y, case.depth, case.outside),
        )
        ring_rates(*size, 0.01, *flows, *excesses, s, ring)
        assert share.sum() == approx(ring.sum(), abs=1e-13 * np.abs(share).sum())


def twin(case, steepness, flows, outside):
    """Return a function (amounts, permutation) that gives the rates of a case on its mirrored or transposed grid."""

    def rates(s, laid):
        other, shape = copy.copy(case), (case.ny, case.nx)
        other.kx, other.ky = map(np.ascontiguousarray, steepness)
        other.nx, other.ny, other.outside = other.kx.size, other.ky.size, outside
        other.flow_x, other.flow_y = (flow.ravel() for flow in flows)
        other.depth = laid(case.depth.reshape(shape)).ravel() if case.depth.size else NONE
        return other.rates(laid(s.reshape(shape)).ravel(), 0.7)

    return rates


@pytest.mark.parametrize("scheme", SCHEMES)
def test_mirrored_and_turned_grids_have_mirrored_and_turned_rates_to_the_bit(scheme):
    more = {"bounds": (0.0, 1.1), "diffusivity": 0.01}
    for seed in range(4):
        case, s = random_case(scheme, seed, through=True, deep=seed > 1, **more)
        nx, ny = case.nx, case.ny
        rate = case.rates(s, 0.7).reshape(ny, nx)
        x, y = case.flow_x.reshape(ny, nx + 1), case.flow_y.reshape(ny + 1, nx)
        west, east, south, north = np.split(case.outside, np.cumsum([ny, ny, nx]))

        ring = np.concatenate([east, west, south[::-1], north[::-1]])
        mirrored = twin(case, (case.kx[::-1], case.ky), (-x[:, ::-1], y[:, ::-1]), ring)(
            s, lambda f: f[:, ::-1]
        )
        assert np.array_equal(mirrored.reshape(ny, nx), rate[:, ::-1])
        ring = np.concatenate([south, north, west, east])
        turned = twin(case, (case.ky, case.kx), (y.T, x.T), ring)(s, lambda f: f.T)
        assert np.array_equal(turned.reshape(nx, ny), rate.T)


@pytest.mark.in_turn
@pytest.mark.parametrize("cells", [(1, 1), (2, 1), (1, 3), (3, 2), (4, 4), (5, 5), (7, 2)])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_grids_of_few_cells_fill_from_their_inlet(scheme, cells):
    along = {"expression": "constant", "u": 1.0, "v": 0.5}
    case = carried(scheme, cells, along, outside=2.0, bounds=(0.0, 2.0))
    assert case.run(np.zeros(cells[0] * cells[1]), 30.0, 0.4) == approx(2.0)


def test_dry_cells_carry_nothing():
    case, s = random_case("van-leer", 2, deep=True, diffusivity=0.1)
    case.depth[::3] = 0.0
    case.flow_x[:], case.flow_y[:] = 0.0, 0.0
    rates = case.rates(s * (case.depth > 0.0))
    assert np.all(np.isfinite(rates)) and np.all(rates[::3] == 0.0)


def test_a_step_of_euler_as_long_as_diffusion_allows_stays_within_bounds():
    for seed in range(20):
        case, s = random_case("upwind", seed, through=True, deep=True)
        rate = np.zeros_like(s)
        most = advection.grid_diffusion(
            case.grid, 0.01, case.flows(), case.depth, s, case.other, rate
        )
        low, high = surroundings(case, s / case.depth)
        after = (s + rate / most) / case.depth
        assert np.all(after > low - 1e-14) and np.all(after < high + 1e-14)


def test_the_rates_that_set_the_step_are_those_of_plain_grids():
    case = carried("upwind", 8, {"expression": "constant", "u": 3.0, "v": -2.0}, size=(4.0, 2.0))
    assert case.fastest == approx(3.0 / 0.5 + 2.0 / 0.25)
    s, flows = np.zeros(64), case.flows(0.0)
    most = advection.grid_diffusion(case.grid, 0.1, flows, NONE, s, case.other, s.copy())
    assert most == approx(2.0 * 0.1 * (1.0 / 0.5**2 + 1.0 / 0.25**2))


def test_decay_leads_to_the_ambient_value():
    depth, s, rate = np.array([1.0, 2.0, 0.0]), np.array([3.0, 4.0, 0.0]), np.ones(3)
    advection.add_decay(0.1, 2.0, depth, s, rate)
    assert rate == approx([1.0 - 0.1, 1.0, 1.0])
    rate = np.zeros(3)
    advection.add_decay(0.1, 2.0, NONE, s, rate)
    assert rate == approx([-0.1, -0.2, 0.2])


def test_the_sense_of_all_flows_can_be_reversed():
    for scheme in SCHEMES:
        case, s = random_case(scheme, 4, through=True, bounds=(0.0, 1.1))
        back = Carried(scheme, case.mesh, -case.flow_x, -case.flow_y, case.outside, case.bounds)
        assert np.array_equal(case.rates(s, -1.0), back.rates(s))
