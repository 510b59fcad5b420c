"""Friction: Hazen-Williams by Decimal and quadrature, signs to the bit; Swamee and Jain by fluids."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from fluids.friction import Swamee_Jain_1976
from scipy.integrate import quad

from fvsolve.core.kernels.dtypes import FRICTION_HAZEN
from fvsolve.core.kernels.pipes import subtract_friction_hazen
from fvsolve.core.kernels.steady_friction import (
    drag,
    factor_times_reynolds,
    power_of_square,
    signed_roughness,
)

FLOWS = [
    *2.0 ** np.random.default_rng(5).uniform(-490.0, 490.0, 300),
    *np.linspace(0.99, 2.01, 103),
    1e-150,
    1e150,
]


def exact(flow: float) -> Decimal:
    """|M|^0.852 M to 50 digits."""
    with localcontext() as context:
        context.prec = 50
        size = abs(Decimal(float(flow)))
        return (size ** Decimal("1.852")).copy_sign(Decimal(float(flow)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_drag_is_the_power_of_the_flow_over_three_hundred_decades(sign):
    found = [
        Decimal(float(drag(FRICTION_HAZEN, 0.0, 1.0, 0.0, 1.0, sign * flow))) for flow in FLOWS
    ]
    wanted = [exact(sign * flow) for flow in FLOWS]
    assert max(abs(a / b - 1) for a, b in zip(found, wanted, strict=True)) < 2e-14


def test_zero_flow_has_no_drag_and_values_that_are_not_finite_stay_so():
    assert drag(FRICTION_HAZEN, 3.0, 2.0, 0.0, 1.0, 0.0) == 0.0
    assert not np.isfinite(power_of_square(np.inf)) and not np.isfinite(power_of_square(np.nan))


def test_the_drag_is_odd_to_the_bit():
    for flow in FLOWS:
        forth, back = (
            drag(FRICTION_HAZEN, 0.3, 1.7, 0.0, 1.0, sign * flow) for sign in (1.0, -1.0)
        )
        assert forth == -back


def rubbed(flows, leans, loss=0.0, rough=1.0):
    """Mean drag over cells with these flows at their middles; leans : half differences of the flows at their ends."""
    forward, backward = np.array(flows, dtype=float), np.zeros(len(flows))
    dr, dl = np.array(leans, dtype=float), np.zeros(len(flows))
    before = dr.copy()
    # lean = 2 GAUSS (dr + dl): leans are half differences
    subtract_friction_hazen(0.5, 0.0, loss, rough, 0.0, forward, backward, dr, dl)
    assert before - dr == pytest.approx(dl, rel=1e-9)
    return 2.0 * dl


def test_a_cell_with_uniform_flow_has_the_drag_of_that_flow_to_the_bit_at_any_place_of_a_pipe():
    """Vectors of cells, the last cells and a single cell round alike, so that steady states stay."""
    for n in (1, 3, 4, 7, 47):
        flow = 7.3 * 1.9 ** np.arange(n)
        alone = [drag(FRICTION_HAZEN, 0.3, 1.7, 0.0, 1.0, m) for m in flow]
        assert rubbed(flow, np.zeros(n), 0.3, 1.7).tolist() == alone


def test_the_mean_over_a_cell_is_fourth_order_in_its_slope():
    leans = np.array([0.4, 0.2, 0.1])  # half difference of the flows at both ends
    wanted = [
        quad(lambda x, e=e: abs(1 + e * x) ** 0.852 * (1 + e * x), -1, 1, epsabs=1e-14)[0] / 2
        for e in leans
    ]
    error = np.abs(rubbed(np.ones(3), leans) - wanted)
    assert np.log2(error[:-1] / error[1:]) == pytest.approx([4.0, 4.0], abs=0.2)
    assert error[0] < 2e-3


def test_where_the_flow_turns_within_a_cell_the_mean_is_within_3_percent_of_the_greatest_drag_there():
    """Two points are within 2.4 %."""
    for m in np.linspace(-1.5, 1.5, 13):
        wanted = (
            quad(lambda x, m=m: abs(m + x) ** 0.852 * (m + x), -1, 1, epsabs=1e-14, limit=200)[0]
            / 2
        )
        assert abs(rubbed([m], [1.0])[0] - wanted) < 0.03 * (abs(m) + 1) ** 1.852


def test_a_mirrored_pipe_rubs_the_same_to_the_bit():
    rng = np.random.default_rng(2)
    ahead = list(rng.normal(size=(4, 47)))  # both waves, then their rates
    mirrored = [ahead[k][::-1].copy() for k in (1, 0, 3, 2)]
    subtract_friction_hazen(0.7, 0.2, 0.3, 1.7, 0.1, *ahead)
    subtract_friction_hazen(0.7, -0.2, 0.3, 1.7, -0.1, *mirrored)
    assert np.array_equal(ahead[2], mirrored[3][::-1]) and np.array_equal(
        ahead[3], mirrored[2][::-1]
    )


def swamee_jain(reynolds, roughness):
    """Darcy factor of the friction model swamee-jain."""
    return factor_times_reynolds(reynolds, signed_roughness(roughness, "swamee-jain")) / reynolds


ROUGH = (0.0, 1e-6, 1e-4, 1e-2)


@pytest.mark.parametrize("roughness", ROUGH)
def test_the_factor_above_reynolds_4000_is_that_of_swamee_and_jain_by_fluids(roughness):
    for reynolds in (4000.0, 1e4, 1e5, 1e8):
        # fluids has the rounded constants -4 log10(e / 3.7 + (6.97 / Re)^0.9) of 1976
        assert swamee_jain(reynolds, roughness) == pytest.approx(
            Swamee_Jain_1976(reynolds, roughness), rel=2e-4
        )
        exact = 0.25 / math.log10(max(roughness, 1e-12) / 3.7 + 5.74 / reynolds**0.9) ** 2
        assert swamee_jain(reynolds, roughness) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("roughness", ROUGH)
def test_between_laminar_and_turbulent_flow_the_factor_has_the_values_and_slopes_of_both(roughness):
    assert swamee_jain(2000.0, roughness) == 0.032
    for place in (2000.0, 4000.0):
        slopes = [
            (swamee_jain(place + d, roughness) - swamee_jain(place, roughness)) / d
            for d in (0.01, -0.01)
        ]
        assert slopes[0] == pytest.approx(slopes[1], rel=2e-3)
        assert swamee_jain(place + 1e-9, roughness) == pytest.approx(
            swamee_jain(place - 1e-9, roughness), rel=1e-6
        )


def test_the_factor_is_within_about_3_percent_of_colebrook_and_the_drop_grows_with_the_flow():
    for roughness in ROUGH:
        reynolds = np.geomspace(4000.0, 1e8, 200)
        ratio = [
            swamee_jain(re, roughness) * re / factor_times_reynolds(re, roughness)
            for re in reynolds
        ]
        assert 0.97 < min(ratio) and max(ratio) < 1.032
        drops = [swamee_jain(re, roughness) * re * re for re in np.linspace(1000.0, 6000.0, 500)]
        assert np.all(np.diff(drops) > 0.0)
