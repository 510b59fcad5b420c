"""Kernels on meshes: orders on distorted triangles, lakes at rest, conservation, reflection and bounds."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.face_fields import FREE, RHO, WIDE, C, Field, G, march, triangles
from reference.log_law import LogFluid, Riemann
from reference.meshes import shaken, write
from reference.orders import observed_order
from scipy.optimize import brentq
from scipy.special import erfc

from fvsolve.core.kernels.dtypes import LAW_LINEAR, LAW_LOG, MUSCL, UPWIND
from fvsolve.core.mesh import read, rectangle


def mixed(path) -> Field:
    return Field(read(write(path / "mixed.vtk", *shaken())))


def hilly(field, level=0.0):
    """Return a bed with islands in a lake, scaled to the mesh."""
    x, y = (field.centre - field.centre.min(0)).T / np.ptp(field.centre, axis=0).max()
    return 0.3 * np.sin(9 * x) * np.cos(7 * y) - level


def test_a_rectangle_agrees_with_its_formula_at_first_order():
    """Reference by NumPy: flux of Harten, Lax and van Leer over the higher bed, summed over faces."""
    field = Field(mesh := rectangle((3.0, 2.0), (9, 7), grading=(3.0, 0.5)))
    rng, n = np.random.default_rng(1), 63
    plan = field.lake(hilly(field))
    h = plan[0] + 0.1 * rng.random(n)
    q = 0.5 * rng.standard_normal((2, n)) * h
    left, right, inner = mesh.left, np.where(mesh.right < 0, mesh.left, mesh.right), mesh.inner
    wall = (mesh.right < 0)[:, None]
    u = (q / h).T
    un, ut = (
        np.sum(u[left] * mesh.normal, 1),
        u[left] - np.sum(u[left] * mesh.normal, 1)[:, None] * mesh.normal,
    )
    vn = np.where(wall[:, 0], -un, np.sum(u[right] * mesh.normal, 1))
    vt = np.where(wall, ut, u[right] - np.sum(u[right] * mesh.normal, 1)[:, None] * mesh.normal)
    bed = np.maximum(plan[1] - plan[0], -np.inf)
    top = np.maximum(bed[left], bed[right])
    a, b = np.maximum(bed[left] + h[left] - top, 0), np.maximum(bed[right] + h[right] - top, 0)
    c = np.sqrt(G * np.maximum(h[left], h[right]))
    low, high = np.minimum(np.minimum(un, vn) - c, 0), np.maximum(np.maximum(un, vn) + c, 0)

    def hll(f, g, one, other):
        return (high * f - low * g + high * low * (other - one)) / (high - low)

    mass = hll(a * un, b * vn, a, b)
    push = hll(a * un**2 + G / 2 * a**2, b * vn**2 + G / 2 * b**2, a * un, b * vn)
    along = mass[:, None] * np.where(mass[:, None] > 0, ut, vt)
    flux = np.column_stack([mass, push[:, None] * mesh.normal + along]) * mesh.length[:, None]
    rates = np.zeros((n, 3))
    step = np.zeros((len(left), 3))
    for cells, water, sign, chosen in (
        (left, a, 1.0, slice(None)),
        (right, b, -1.0, slice(0, inner)),
    ):
        step[:, 1:] = (G / 2 * (h[cells] ** 2 - water**2) * mesh.length)[:, None] * mesh.normal
        np.subtract.at(rates, cells[chosen], sign * (flux + step)[chosen])
    found, _ = field.shallow(UPWIND, plan, np.stack([h - plan[0], *q]))
    assert found == approx((rates / mesh.area[:, None]).T, abs=1e-12 * np.abs(found).max())


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", ["triangles", "quads", "mixed"])
@pytest.mark.parametrize("scheme", [UPWIND, MUSCL], ids=["upwind", "muscl"])
def test_a_lake_with_dry_islands_rests_to_the_bit_and_no_water_is_lost(tmp_path, kind, scheme):
    field = (
        mixed(tmp_path) if kind == "mixed" else triangles(tmp_path, 12, 9, quads=kind == "quads")
    )
    plan = field.lake(hilly(field))
    assert (plan[0] == 0).sum() > 5 and (plan[0] > 0).sum() > 5
    assert not field.shallow(scheme, plan, np.zeros((3, len(plan[0]))))[0].any()
    rng, flow = np.random.default_rng(2), np.full(len(field.mesh.left), np.nan)
    y = np.stack([0.1 * rng.random(len(plan[0])), *rng.standard_normal((2, len(plan[0])))])
    found, _ = field.shallow(scheme, plan, y, flow=flow)
    assert abs(found[0] @ field.area) < 1e-14 * np.abs(found[0] * field.area).sum()
    out = np.zeros(len(plan[0]))
    np.add.at(out, field.mesh.left, flow)
    np.subtract.at(out, field.mesh.right[: field.mesh.inner], flow[: field.mesh.inner])
    assert -out / field.area == approx(found[0], abs=1e-12 * np.abs(found[0]).max())


@pytest.mark.parametrize("kind", ["triangles", "quads"])
def test_no_depth_falls_below_zero_when_a_dam_breaks_over_islands(tmp_path, kind):
    """At the limit for depths, half a cell per step, no depth is negative and no water is lost."""
    field = triangles(tmp_path, 30, 20, (3.0, 2.0), quads=kind == "quads")
    plan = field.lake(hilly(field, 0.05))
    y = np.zeros((3, len(plan[0])))
    y[0, field.centre[:, 0] < 1.0] = 1.0
    lowest, start = [], (plan[0] + y[0]) @ field.area
    end = march(
        lambda y: field.shallow(MUSCL, plan, y),
        y,
        1.5,
        0.5,
        lambda y: lowest.append((plan[0] + y[0]).min()),
    )
    assert min(lowest) >= -1e-16
    assert (plan[0] + end[0]) @ field.area == approx(start, rel=1e-13)


def stoker(x, t, high, low):
    """Depth of a dam break on a wet bed (Stoker 1957) at the distance x from the dam."""
    c = math.sqrt(G * high)
    shock = lambda h: (h - low) * math.sqrt(0.5 * G * (h + low) / (h * low))  # noqa: E731
    h = brentq(lambda h: 2 * (c - math.sqrt(G * h)) - shock(h), low, high, xtol=1e-14)
    u = shock(h)
    fan = (2 * c - x / t) ** 2 / (9 * G)
    return np.select(
        [x < -c * t, x < (u - math.sqrt(G * h)) * t, x < h * u / (h - low) * t], [high, fan, h], low
    )


def test_a_dam_breaks_on_triangles_as_in_the_exact_solution(tmp_path):
    """The L1 error of the depth falls at first order, the limit at a front."""
    errors = []
    for nx in (100, 200):
        field = triangles(tmp_path, nx, nx // 20, (20.0, 1.0))
        y = np.zeros((3, len(field.area)))
        x, plan = field.centre[:, 0] - 10.0, field.lake(np.full(len(field.area), -0.4))
        y[0, x < 0.0] = 0.6
        h = 0.4 + march(lambda y, f=field, p=plan: f.shallow(MUSCL, p, y), y, 1.2, 0.5)[0]
        errors.append(np.abs(h - stoker(x, 1.2, 1.0, 0.4)) @ field.area)
    assert errors[1] < 0.04 and errors[0] / errors[1] > 2.0**0.85


@pytest.mark.parametrize(("scheme", "order"), [(UPWIND, 1), (MUSCL, 2)], ids=["upwind", "muscl"])
def test_a_vortex_stands_over_a_hill_with_the_order_of_its_scheme(tmp_path, scheme, order):
    """u = A r (1 - r^2 / R^2)^3 about the middle, g de/dr = u^2 / r: steady over every axisymmetric bed."""
    errors, sizes = [], (16, 32, 64)
    for n in sizes:
        field = triangles(tmp_path, n, n)
        d = field.centre - 0.5
        s = np.maximum(1 - np.sum(d**2, 1) / 0.16, 0.0)
        plan = field.lake(-1.0 + 0.3 * s**3)
        e, u = -(9.0 * 0.16 / (14 * G)) * s**7, 3.0 * s**3 * np.stack([-d[:, 1], d[:, 0]])
        y = np.stack([e, *((plan[0] + e) * u)])
        z = march(lambda y, f=field, p=plan: f.shallow(scheme, p, y), y, 0.3, 0.5)
        errors.append(np.abs(z - y) @ field.area)
    found = [observed_order([e[k] for e in errors], [1 / n for n in sizes]) for k in range(3)]
    assert min(found) > order - 0.3


@pytest.mark.parametrize(
    ("scheme", "angle"), [(UPWIND, 0.7), (MUSCL, 0.5 * math.pi)], ids=["upwind", "muscl"]
)
def test_a_turned_mesh_gives_turned_rates(tmp_path, scheme, angle):
    """The rotation for muscl is a right angle, because slopes of both components are limited separately."""
    rng = np.random.default_rng(4)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    fields = [triangles(tmp_path, 10, 8, angle=a) for a in (0.0, angle)]
    assert np.array_equal(fields[0].mesh.cells, fields[1].mesh.cells)  # same numbering
    n = len(fields[0].area)
    y = np.stack([0.1 * rng.random(n), *0.3 * rng.standard_normal((2, n))])
    turned = np.stack([y[0], *turn @ y[1:]])
    plan = fields[0].lake(hilly(fields[0]))
    for rates in (
        lambda f, y: f.shallow(scheme, plan, y),
        lambda f, y: f.liquid(LAW_LOG, scheme, 100 * y),
    ):
        (one, fast), (other, fast_too) = rates(fields[0], y), rates(fields[1], turned)
        assert np.stack([one[0], *turn @ one[1:]]) == approx(other, abs=1e-11 * np.abs(one).max())
        assert fast == approx(fast_too, rel=1e-12)


@pytest.mark.parametrize(("scheme", "order"), [(UPWIND, 1), (MUSCL, 2)], ids=["upwind", "muscl"])
def test_a_standing_wave_rings_on_triangles_with_the_order_of_its_scheme(tmp_path, scheme, order):
    """Exact solution between walls: cos(pi x) cos(pi y) cos(sqrt(2) pi c t)."""
    errors, sizes = [], (16, 32, 64)
    for n in sizes:
        field = triangles(tmp_path, n, n)
        x, y = math.pi * field.centre.T
        w, t = math.sqrt(2) * math.pi * C, 0.04
        still, end = np.zeros((3, len(x))), np.empty((3, len(x)))
        still[0] = np.cos(x) * np.cos(y)
        end[0] = still[0] * math.cos(w * t)
        flow = C * math.sin(w * t) / math.sqrt(2)
        end[1], end[2] = flow * np.sin(x) * np.cos(y), flow * np.cos(x) * np.sin(y)
        z = march(lambda y, f=field: f.liquid(LAW_LINEAR, scheme, y), still, t, 0.5)
        errors.append(np.abs(z - end) @ field.area)
    found = [observed_order([e[k] for e in errors], [1 / n for n in sizes]) for k in range(3)]
    assert min(found) > order - 0.3


@pytest.mark.parametrize("reflect", [1.0, 0.0, -1.0, 0.5])
def test_a_plane_wave_comes_back_from_a_side_as_its_share(tmp_path, reflect):
    field = triangles(tmp_path, 80, 4, (1.0, 0.05))
    share = np.where(field.edge[:, 0] > 1.0 - 1e-9, reflect, 1.0)
    x = field.centre[:, 0]
    pulse = np.exp(-(((x - 0.6) / 0.1) ** 2))
    y = np.stack([pulse, C * pulse, 0 * x])
    # 1.4 reflects to 0.6
    end = march(lambda y: field.liquid(LAW_LINEAR, MUSCL, y, share), y, 0.08, 0.5)
    back = np.stack([reflect * pulse, -reflect * C * pulse, 0 * x])
    assert (np.abs(end - back)[0] @ field.area) < 0.03 * (pulse @ field.area)


def test_a_log_liquid_parts_as_in_the_exact_riemann_problem(tmp_path):
    """At a jump of 0.4 of the modulus the fan is a few cells wide, and L1 errors fall at an order above 0.6."""
    fluid, errors = LogFluid(RHO, RHO * C**2, 0.0), []
    exact = Riemann(fluid, (40000.0, 0.0), (0.0, 0.0))
    for nx in (50, 100):
        field = triangles(tmp_path, nx, 4, (1.0, 4.0 / nx))
        x, t = field.centre[:, 0] - 0.5, 0.03
        y = np.zeros((3, len(x)))
        y[0] = np.where(x < 0, fluid.rho(40000.0), RHO) - RHO
        z = march(lambda y, f=field: f.liquid(LAW_LOG, MUSCL, y), y, t, 0.5)
        p, u = np.array([exact.at(xi) for xi in x / t]).T
        errors.append(
            [np.abs(z[0] + RHO - fluid.rho(p)).mean(), np.abs(z[1] - fluid.rho(p) * u).mean()]
        )
    assert (np.array(errors[0]) / errors[1] > 2.0**0.6).all() and errors[1][0] < 0.01 * (
        fluid.rho(40000.0) - RHO
    )


def test_uniform_values_stay_and_no_amount_is_lost(tmp_path):
    field = triangles(tmp_path, 12, 9)
    flow = field.stream(lambda x, y: np.sin(3 * x) * np.cos(2 * y + 1))
    n, b = len(field.area), len(field.edge)
    rng = np.random.default_rng(5)
    depth = 0.5 + rng.random(n)
    for scheme in (UPWIND, MUSCL):
        found, rate = field.advection(
            scheme, flow, 0.7 * depth, np.full(b, 0.7), depth, diffusivity=0.01
        )
        assert np.abs(found).max() < 1e-14 * rate
        closed = np.where(np.arange(len(flow)) < field.mesh.inner, flow, 0.0)
        found, _ = field.advection(scheme, closed, rng.random(n), diffusivity=0.01)
        assert abs(found @ field.area) < 1e-14 * np.abs(found * field.area).sum()


@pytest.mark.parametrize(("scheme", "order"), [(UPWIND, 1), (MUSCL, 2)], ids=["upwind", "muscl"])
def test_a_bump_is_carried_over_triangles_with_the_order_of_its_scheme(tmp_path, scheme, order):
    errors, sizes = [], (16, 32, 64) if scheme == MUSCL else (32, 64, 128)
    for n in sizes:
        field = triangles(tmp_path, n, n)
        flow = field.stream(lambda x, y: 0.8 * y - 0.5 * x)
        bump = lambda x, y: np.cos(math.pi * np.minimum(np.hypot(x, y) / 0.25, 1.0)) / 2 + 0.5  # noqa: E731
        x, y = field.centre.T
        c = march(
            lambda s, f=field, q=flow: f.advection(scheme, q, s), bump(x - 0.3, y - 0.35), 0.4, 0.5
        )
        errors.append(np.abs(c - bump(x - 0.62, y - 0.55)) @ field.area)
    assert observed_order(errors, [1 / n for n in sizes]) > order - 0.3


def slotted(field) -> np.ndarray:
    x, y = field.centre.T
    return ((np.hypot(x - 0.5, y - 0.3) < 0.2) & ~((np.abs(x - 0.5) < 0.05) & (y < 0.35))).astype(
        float
    )


KEEPS = {  # scheme, `wide` of the limiter, bounds, greatest Courant number of Euler steps
    "upwind": (UPWIND, 1.0, FREE, 1.0),
    "narrow": (MUSCL, 1.0, FREE, 2 / 3),
    "narrow, bounded": (MUSCL, 1.0, (0.0, 1.0), 1.0),
    "wide": (MUSCL, WIDE, (0.0, 1.0), 1.0),
}


@pytest.mark.in_turn
@pytest.mark.parametrize("quads", [False, True], ids=["triangles", "quadrilaterals"])
@pytest.mark.parametrize("name", KEEPS)
def test_a_slotted_disk_stays_between_its_bounds(tmp_path, name, quads):
    scheme, wide, bounds, courant = KEEPS[name]
    field = triangles(tmp_path, 40, 40, quads=quads)
    flow = field.stream(lambda x, y: 8 * (x * (1 - x) * y * (1 - y)))
    disk, low, high = slotted(field), [], []
    seen = lambda c: (low.append(c.min()), high.append(c.max()))  # noqa: E731
    rates = lambda s: field.advection(scheme, flow, s, wide=wide, bounds=bounds)  # noqa: E731
    end = march(rates, disk, 1.0, courant, seen)
    assert min(low) > -1e-14 and max(high) < 1.0 + 1e-14
    assert end @ field.area == approx(disk @ field.area, rel=1e-13)


@pytest.mark.parametrize("wide", [1.0, WIDE])
def test_a_step_of_euler_stays_within_bounds_in_random_flows_and_depths(tmp_path, wide):
    """Values start at their bounds, with random flows through faces, which also change depths."""
    for seed in range(40):
        random, field = (
            np.random.default_rng(seed),
            mixed(tmp_path) if seed % 2 else triangles(tmp_path, 9, 7),
        )
        n = len(field.area)
        flow, depth = random.normal(size=len(field.mesh.left)), 0.1 + random.random(n)
        c = random.choice([-0.5, 1.0, random.uniform(-0.5, 1.0)], n)
        outside, bounds = random.uniform(-0.5, 1.0, len(field.edge)), (-0.5, 1.0)
        given = {"depth": depth, "wide": wide, "bounds": bounds}
        rate, quickest = field.advection(MUSCL, flow, c * depth, outside, **given)
        filled, _ = field.advection(
            MUSCL, flow, depth, np.ones(len(field.edge)), **given | {"bounds": FREE}
        )
        after = (c * depth + rate / quickest) / (depth + filled / quickest)
        assert after.min() > -0.5 - 1e-13 and after.max() < 1.0 + 1e-13


@pytest.mark.parametrize("quads", [False, True], ids=["triangles", "quadrilaterals"])
def test_bounds_cost_a_smooth_value_nothing_that_shows(tmp_path, quads):
    bump = lambda x, y: np.exp(-((x / 0.12) ** 2) - (y / 0.12) ** 2)  # noqa: E731

    def off(n, bounds):
        field = triangles(tmp_path, n, n, quads=quads)
        (x, y), flow = field.centre.T, field.stream(lambda x, y: 0.8 * y - 0.5 * x)
        c = march(
            lambda s: field.advection(MUSCL, flow, s, bounds=bounds),
            bump(x - 0.3, y - 0.35),
            0.4,
            0.9,
        )
        return np.abs(c - bump(x - 0.62, y - 0.55)) @ field.area

    kept = [off(n, (0.0, 1.0)) for n in (24, 48)]
    assert all(one < 1.02 * off(n, FREE) for one, n in zip(kept, (24, 48), strict=True))
    assert observed_order(kept, [1 / 24, 1 / 48]) > 1.7


def test_diffusion_damps_a_mode_at_second_order_and_reaches_the_value_of_the_inflow(tmp_path):
    """exp(-2 pi^2 t) cos(pi x) cos(pi y) between walls, and the front of Ogata and Banks (1961) behind an inlet."""
    errors, sizes = [], (16, 32)
    for n in sizes:
        field = triangles(tmp_path, n, n)
        still, mode = np.zeros(len(field.mesh.left)), np.cos(math.pi * field.centre).prod(1)
        s = march(
            lambda s, f=field, q=still: f.advection(MUSCL, q, s, diffusivity=1.0), mode, 0.05, 0.9
        )
        errors.append(np.abs(s - math.exp(-2 * math.pi**2 * 0.05) * mode) @ field.area)
    assert observed_order(errors, [1 / n for n in sizes]) > 1.7
    field = triangles(tmp_path, 40, 3, (1.0, 0.1))
    flow = field.stream(lambda x, y: 0.5 * y)
    rates = lambda s: field.advection(MUSCL, flow, s, np.ones(len(field.edge)), diffusivity=0.1)  # noqa: E731
    s = march(rates, np.zeros(len(field.area)), 0.5, 0.9)
    x, t = field.centre[:, 0], 0.5
    w = 2 * math.sqrt(0.1 * t)
    exact = 0.5 * (erfc((x - 0.5 * t) / w) + np.exp(0.5 * x / 0.1) * erfc((x + 0.5 * t) / w))
    assert s[x < 0.4] == approx(exact[x < 0.4], abs=1e-3)
