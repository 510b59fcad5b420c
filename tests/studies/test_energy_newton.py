"""The residual of Newton's method has its own account: it is no supplied energy and no loss of schemes or steps."""

import numpy as np
import pytest
from reference.scenes import AMBIENT, WATER, chamber, reservoir, scene, valve

import fvsolve
from fvsolve.studies.energy_balance import energy, measure_pairs

VOLUME, P0, P1 = 0.02, 5e5, 50e5  # pressures above ambient
PER = VOLUME / WATER["bulk_modulus"]


def filled(method: str, **numerics) -> dict:
    """Case of a chamber that an orifice fills within 2 s and that then stays at zero drop."""
    nodes = {"src": reservoir(AMBIENT + P1), "pot": chamber(VOLUME, AMBIENT + P0)}
    return scene(nodes, {"hole": valve("src", "pot", 6e-7)}, 20.0, {"method": method, **numerics})


@pytest.mark.parametrize("method", ["gauss-2", "gauss-4", "tr-bdf2", "radau-iia-5"])
def test_a_chamber_that_has_filled_is_supplied_what_it_took_and_creates_nothing(method):
    found = energy(filled(method, step=0.01))
    assert found.supplied["src"][-1] == pytest.approx(PER * P1 * (P1 - P0), rel=1e-6)
    assert found.stored["pot"][-1] == pytest.approx(0.5 * PER * (P1**2 - P0**2), rel=1e-6)
    assert found.dissipated["hole"][-1] == pytest.approx(0.5 * PER * (P1 - P0) ** 2, rel=3e-5)
    assert found.remainder == pytest.approx(found.step + found.newton, abs=1e-12 * found.throughput)
    assert np.abs(found.newton).max() < 1e-12 * found.throughput
    if method.startswith("gauss"):  # Gauss methods conserve squares, so the step loss is rounding
        assert np.abs(found.step).max() < 1e-12 * found.throughput
        assert found.verdict == "rounding"
    elif method == "radau-iia-5":
        assert found.verdict != "the numbers create energy"


def test_what_newton_leaves_is_a_part_of_its_own_and_condemns_no_method():
    """With rtol, Newton's method stops at a tolerance."""
    case = fvsolve.load(filled("radau-iia-5", rtol=1e-3))
    found = energy(case)
    assert found.newton_counts
    assert list(found.numerical()) == ["step", "newton", "remainder"]
    assert found.plain()["newton_loss"] == found.newton[-1]
    (row,) = measure_pairs(case, None, ["radau-iia-5"])
    assert not row["creates"]
    assert row["newton_loss"] == found.newton[-1]


def test_beside_newton_gauss_leaves_rounding_in_a_network_of_pipes():
    from fvsolve.case import shipped

    found = energy(shipped.find("three-way-junction"), {"numerics.method": "gauss-4", "numerics.end": 1.0})
    assert max(np.abs(found.newton).max(), np.abs(found.step).max()) < 1e-13 * found.throughput


def test_steps_of_second_order_book_the_orifice_to_one_per_cent_where_the_state_is_exact():
    """The mass of the chamber is a parabola in time, so error control sees only the error of the powers."""
    found = energy(filled("tr-bdf2", rtol=1e-6))
    lost = 0.5 * PER * (P1 - P0) ** 2
    assert found.supplied["src"][-1] == pytest.approx(PER * P1 * (P1 - P0), rel=1e-6)
    assert found.dissipated["hole"][-1] == pytest.approx(lost, rel=0.01)
    assert found.step[-1] == pytest.approx(lost - found.dissipated["hole"][-1], rel=1e-6)


@pytest.mark.parametrize("method", ["rk4", "rodas-4"])
def test_methods_without_newton_leave_none(method):
    found = energy(filled(method, step=0.02))
    assert not found.newton.any()
