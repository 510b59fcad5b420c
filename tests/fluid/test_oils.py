"""Hydraulic oils by name, compared with the standards that define them and with tables of a measured oil."""

import math

import pytest
from pytest import approx

from fvsolve.errors import FluidError
from fvsolve.fluid import properties
from fvsolve.fluid.oils import OILS, Oil, oil_name, walther

ATM = 101325.0
C = 273.15


@pytest.mark.parametrize("grade", [32, 46, 68])
def test_an_oil_has_its_grade_at_40_degC_and_viscosity_index_100(grade):
    """ISO 3448 gives the viscosity at 40 degC; at index 100 it is H of ASTM D2270 for the viscosity at 100 degC."""
    oil = properties(f"ISO VG {grade}", 40 + C, ATM)
    assert 1e6 * oil.viscosity / oil.density == approx(grade, rel=1e-12)
    hot = properties(f"ISO VG {grade}", 100 + C, ATM)
    y = 1e6 * hot.viscosity / hot.density
    table = {5.3: 31.40, 5.4: 32.37, 6.7: 45.33, 6.8: 46.44, 8.7: 67.64, 8.8: 68.79}  # D2270, Table 1: H over Y
    low = max(key for key in table if key <= y)
    h = table[low] + (y - low) / 0.1 * (table[round(low + 0.1, 1)] - table[low])
    assert h == approx(grade, rel=2e-3)


def test_walthers_line_through_two_points_meets_a_measured_oil():
    """An HLP 32 with mu = 17.02 mPa s exp(5.428 (50 - t) / (94.72 + t)): 3 % from 20 to 80 degC, 12 % at 0 degC."""

    def measured(t):
        return 1e6 * 1.702e-2 * math.exp(5.428 * (50 - t) / (94.72 + t)) / density(t)

    def density(t):
        return 1047.03 * (1 - 5.761668e-4 * (t + C))

    oil = Oil(measured(40), measured(100), density(15))
    for t, near in ((0, 0.12), (10, 0.06), (20, 0.03), (60, 0.03), (80, 0.03)):
        assert 1e6 * walther(oil, t + C) == approx(measured(t), rel=near)
    named = OILS["ISO VG 32"]
    for t in (0, 20, 40, 60, 100):  # a grade spans 10 % either way
        assert 1e6 * walther(named, t + C) == approx(measured(t), rel=0.12)


def test_density_follows_the_measured_oil_and_the_petroleum_tables():
    for t in (0, 15, 40, 80):
        measured = 1047.03 * (1 - 5.761668e-4 * (t + C))
        assert properties("ISO VG 32", t + C, ATM).density == approx(measured, rel=6e-3)
    assert properties("ISO VG 46", 15 + C, ATM).density == approx(876.0, rel=1e-12)
    squeezed = properties("ISO VG 46", 40 + C, 200e5).density / properties("ISO VG 46", 40 + C, ATM).density
    assert squeezed == approx(1.0128, abs=3e-4)  # Tait with C = 0.0733, b = 1035.6 bar


def test_the_bulk_modulus_is_isentropic_rises_with_pressure_and_falls_with_temperature():
    """K_T = rho / (drho/dp) by differences; K_s / K_T = cp / cv = 1 / (1 - T a^2 K_T / (rho cp))."""
    t, p, step = 40 + C, 100e5, 1e5
    high, low = (properties("ISO VG 46", t, p + s).density for s in (step, -step))
    isothermal = 2 * step / math.log(high / low)
    warm, cold = (properties("ISO VG 46", t + s, ATM).density for s in (1, -1))
    expansion = math.log(cold / warm) / 2
    oil = properties("ISO VG 46", t, p)
    cp = 1895.4 + (2118.1 - 1895.4) * 15 / 55
    ratio = 1 / (1 - t * expansion**2 * isothermal / (oil.density * cp))
    assert oil.bulk_modulus == approx(isothermal * ratio, rel=1e-3)
    assert 1.1 < ratio < 1.25
    for grade in OILS:
        k = [properties(grade, t + C, p).bulk_modulus for t, p in ((20, 1e5), (20, 2e7), (60, 1e5))]
        assert k[1] > 1.1 * k[0] and k[2] < 0.95 * k[0]
        assert 1.4e9 < k[2] < k[0] < 1.9e9  # range of handbooks for mineral oil


def test_an_oil_goes_by_the_spellings_of_the_field():
    for name in ("ISO VG 46", "iso vg 46", "ISO-VG-46", "ISO VG46", "VG 46", "HLP 46", "HLP46", "HM 46"):
        assert oil_name(name) == "ISO VG 46"
    assert oil_name("Water") is None and oil_name("INCOMP::HY45") is None


@pytest.mark.parametrize(
    "name, temperature, pressure, law, key, text",
    [
        ("ISO VG 22", 313.15, ATM, "log", "name", "expected one of ISO VG 32, ISO VG 46, ISO VG 68"),
        ("ISO VG 46", 253.15, ATM, "log", "temperature", "-20 degC is outside the range of ISO VG 46"),
        ("ISO VG 46", 313.15, 2e8, "log", "pressure", "above the range"),
        ("ISO VG 46", 313.15, ATM, "table", "law", "compressible fluid of CoolProp"),
        ("ISO VC 46", 313.15, ATM, "log", "name", 'did you mean "ISO VG 46"?'),
    ],
)
def test_an_oil_outside_what_is_known_is_refused(name, temperature, pressure, law, key, text):
    with pytest.raises(FluidError) as caught:
        properties(name, temperature, pressure, law)
    assert caught.value.key == key and text in caught.value.message
