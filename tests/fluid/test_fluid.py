"""Fluid properties compared with published values and CoolProp; error of the table, refused input, and the cache."""

import dataclasses
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from CoolProp.CoolProp import PropsSI
from pytest import approx
from scipy.optimize import brentq

from fvsolve import jit
from fvsolve.core.fluid import properties
from fvsolve.core.fluid.oils import OILS, Oil, oil_name, walther
from fvsolve.errors import FluidError

ATM = 101325.0
ROOM = 293.15


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    """Path of the fluids in an empty cache folder of the test, so that no result is an old one."""
    monkeypatch.setenv("FVSOLVE_CACHE", str(tmp_path / "cache"))
    jit.cache_folder.cache_clear()
    yield tmp_path / "cache" / "fluids"
    jit.cache_folder.cache_clear()


def hermite(table, pressure):
    """ln rho by cubic Hermite interpolation, written independently from the textbook."""
    p, f, d = table.pressure, table.log_density, table.compressibility
    h = p[1] - p[0]
    i = np.clip(((pressure - p[0]) / h).astype(int), 0, p.size - 2)
    s = (pressure - p[i]) / h
    ends = f[i] * (1 + 2 * s) * (1 - s) ** 2 + f[i + 1] * s**2 * (3 - 2 * s)
    return ends + h * (d[i] * s * (1 - s) ** 2 + d[i + 1] * s**2 * (s - 1))


def isentropic_density(name, temperature, pressure, reached) -> float:
    """Density at `reached` from the temperature of equal entropy (CoolProp's own flash has errors up to 1e-9)."""
    entropy = PropsSI("S", "T", temperature, "P", pressure, name)
    span = (temperature - 5.0, temperature + 60.0)
    found = brentq(
        lambda t: PropsSI("S", "T", t, "P", reached, name) - entropy, *span, xtol=1e-11, rtol=1e-14
    )
    return PropsSI("D", "T", found, "P", reached, name)


def refusal(*arguments, **keys) -> tuple[str, str]:
    with pytest.raises(FluidError) as caught:
        properties(*arguments, **keys)
    return caught.value.key, caught.value.message


def test_water_at_20_degC_is_the_water_of_the_tables():
    water = properties("Water", ROOM, ATM)
    assert water.density == approx(998.207, rel=1e-6)  # IAPWS-95, Wagner and Pruss 2002
    assert water.sound_speed == approx(1482.35, rel=1e-5)
    assert water.viscosity == approx(1.0016e-3, rel=1e-4)  # IAPWS 2008
    assert water.vapor_pressure == approx(2339.3, rel=1e-4)
    assert water.bulk_modulus == approx(2.193e9, rel=1e-3)


@pytest.mark.parametrize("name, ratio, rel", [("Water", 1.007, 1e-3), ("n-Dodecane", 1.22, 1e-2)])
def test_bulk_modulus_is_isentropic_not_isothermal(name, ratio, rel):
    isothermal = 1.0 / PropsSI("isothermal_compressibility", "T", ROOM, "P", ATM, name)
    assert properties(name, ROOM, ATM).bulk_modulus / isothermal == approx(ratio, rel=rel)


@pytest.mark.parametrize("name", ["Water", "n-Dodecane", "Ammonia", "Toluene", "Ethanol", "R134a"])
def test_any_pure_liquid_agrees_with_coolprop(name):
    temperature, pressure = 300.0, 3e6
    fluid = properties(name, temperature, pressure, law="log")
    density = PropsSI("D", "T", temperature, "P", pressure, name)
    sound_speed = PropsSI("A", "T", temperature, "P", pressure, name)
    assert fluid.density == approx(density, rel=1e-12)
    assert fluid.bulk_modulus == approx(density * sound_speed**2, rel=1e-10)
    assert fluid.viscosity == approx(PropsSI("V", "T", temperature, "P", pressure, name), rel=1e-10)
    assert fluid.vapor_pressure == approx(PropsSI("P", "T", temperature, "Q", 0, name), rel=1e-8)
    assert fluid.table is None and fluid.source.startswith("CoolProp ")


@pytest.mark.parametrize(
    "name, temperature, pressure",
    [
        ("Water", ROOM, ATM),
        ("Water", 473.15, 3e6),
        ("n-Dodecane", ROOM, ATM),
        ("Propane", 320.0, 3e6),
    ],
)
def test_table_follows_the_isentrope_within_its_stated_error(name, temperature, pressure):
    table = properties(name, temperature, pressure, law="table").table
    between = np.random.default_rng(1).uniform(
        table.pressure[0] * 1.001 + 1.0, table.pressure[-1], 100
    )
    truth = np.array([isentropic_density(name, temperature, pressure, p) for p in between])
    assert 0.0 < table.error < 1e-9
    assert np.max(np.abs(np.exp(hermite(table, between)) / truth - 1.0)) < table.error + 1e-11


def test_table_passes_through_the_reference_state():
    water = properties("Water", ROOM, ATM, law="table")
    assert np.exp(hermite(water.table, np.array([ATM])))[0] == approx(water.density, rel=1e-10)
    assert water.table.compressibility[0] * water.bulk_modulus == approx(1.0, rel=1e-3)


def test_table_is_a_rising_uniform_grid_from_the_vapour_pressure_to_1000_bar():
    water = properties("Water", ROOM, ATM, law="table")
    p, f, d = water.table.pressure, water.table.log_density, water.table.compressibility
    assert (p[0], p[-1]) == (approx(water.vapor_pressure), 1e8)
    assert np.diff(p) == approx(np.full(p.size - 1, p[1] - p[0]), rel=1e-12)
    fine = hermite(water.table, np.linspace(p[0], p[-1], 20 * p.size))
    assert np.all(np.diff(fine) > 0.0) and np.all(np.diff(f) > 0.0)
    assert np.all(d > 0.0) and np.all(np.diff(d) < 0.0), "water grows stiffer under pressure"


def test_table_ends_where_coolprop_does_and_reaches_above_a_high_reference():
    assert properties("R161", 300.0, 2e6, law="table").table.pressure[-1] == PropsSI("PMAX", "R161")
    assert properties("Water", ROOM, 2e8, law="table").table.pressure[-1] == approx(4e8)


def test_constant_modulus_is_more_than_5_kg_too_dense_at_1000_bar():
    water = properties("Water", ROOM, ATM, law="table")
    constant = water.density * math.exp((1e8 - ATM) / water.bulk_modulus)
    excess = constant - isentropic_density("Water", ROOM, ATM, 1e8)
    assert constant - math.exp(water.table.log_density[-1]) == approx(excess, abs=1e-6)
    assert 5.0 < excess < 6.0  # 5.4 kg/m3


def test_given_keys_stand_in_place_of_coolprops():
    water = properties(
        "Water", ROOM, ATM, density=1000.0, bulk_modulus=2e9, viscosity=1e-3, vapor_pressure=0.0
    )
    values = (water.density, water.bulk_modulus, water.viscosity, water.vapor_pressure)
    assert values == (1000.0, 2e9, 1e-3, 0.0)


def test_user_fluid_is_its_numbers():
    fluid = properties("user", ROOM, ATM, density=870.0, bulk_modulus=1.5e9)
    assert (fluid.density, fluid.bulk_modulus, fluid.vapor_pressure) == (870.0, 1.5e9, 0.0)
    assert (fluid.viscosity, fluid.source) == (None, "user"), "a viscosity is never invented"


def test_incompressible_fluid_takes_density_and_viscosity_from_coolprop():
    glycol = properties("INCOMP::MEG[0.2]", ROOM, 2e6, bulk_modulus=2.4e9)
    assert glycol.density == PropsSI("D", "T", ROOM, "P", 2e6, "INCOMP::MEG[0.2]")
    assert glycol.viscosity == PropsSI("V", "T", ROOM, "P", 2e6, "INCOMP::MEG[0.2]")
    assert glycol.vapor_pressure == 0.0, "CoolProp has none for it at 20 degC"
    oil = properties("INCOMP::DowQ", 560.0, 2e6, bulk_modulus=1e9)
    assert oil.vapor_pressure == PropsSI("P", "T", 560.0, "Q", 0, "INCOMP::DowQ")


def test_a_viscosity_coolprop_does_not_have_is_none():
    assert properties("INCOMP::LiBr[0.23]", 300.0, 1e6, bulk_modulus=2e9).viscosity is None
    assert properties("R1234ze(Z)", 300.0, 1e6).viscosity is None


@pytest.mark.parametrize(
    "arguments, keys, key, words",
    [
        (("Watr", ROOM, ATM), {}, "name", 'did you mean "Water"?'),
        (("water2", ROOM, ATM), {}, "name", 'did you mean "Water"?'),
        (("n-Dodecan", ROOM, ATM), {}, "name", 'did you mean "n-Dodecane"?'),
        (("DowQ", ROOM, ATM), {}, "name", 'did you mean "INCOMP::DowQ"?'),
        (("INCOMP::DowK", ROOM, ATM), {}, "name", 'did you mean "INCOMP::Dow'),
        (("INCOMP::MEG", ROOM, ATM), {}, "name", "between 0 and 0.6"),
        (("", ROOM, ATM), {}, "name", "is not a CoolProp fluid"),
        (("Water&Ethanol", ROOM, ATM), {}, "name", "is a mixture"),
        (("Water[0.5]&Ethanol[0.5]", ROOM, ATM), {}, "name", "is a mixture"),
        (("R410A.mix", ROOM, ATM), {}, "name", "is a mixture"),
        (("REFPROP::Water", ROOM, ATM), {}, "name", "without a prefix"),
        (("Water", 270.0, ATM), {}, "temperature", "0.01 degC to 1726.85 degC"),
        (("Water", 3000.0, ATM), {}, "temperature", "outside the range of Water"),
        (("INCOMP::HC20", 600.0, ATM), {}, "temperature", "-20 degC to 210 degC"),
        (("INCOMP::MEG2[0.2]", 250.0, ATM), {}, "temperature", "freezing"),
        (("Water", ROOM, 9.5e8), {}, "temperature", "is solid"),
        (("Water", ROOM, 2e9), {}, "pressure", "above the range"),
        (("Water", ROOM, 2000.0), {}, "pressure", "2339.3"),
        (("R134a", ROOM, ATM), {}, "pressure", "expected a liquid"),
        (("Water", 373.1242958476844, ATM + 1e-3), {}, "pressure", "two-phase"),
        (
            ("user", ROOM, ATM),
            dict(density=1e3, bulk_modulus=2e9, vapor_pressure=2e5),
            "pressure",
            "vapour",
        ),
        (("INCOMP::DowQ", ROOM, ATM), {}, "bulk_modulus", "no compressibility"),
        (("user", ROOM, ATM), dict(density=870.0), "bulk_modulus", "`bulk_modulus` is missing"),
        (("user", ROOM, ATM), dict(bulk_modulus=1e9), "density", "`density` is missing"),
        (
            ("user", ROOM, ATM),
            dict(density=-1.0, bulk_modulus=1e9),
            "density",
            "expected a finite number above 0",
        ),
        (("Water", ROOM, math.nan), {}, "pressure", "expected a finite number above 0"),
        (("Water", ROOM, ATM, "tabel"), {}, "law", 'did you mean "table"?'),
        (("user", ROOM, ATM, "table"), dict(density=1e3, bulk_modulus=2e9), "law", 'not "user"'),
        (("INCOMP::DowQ", ROOM, ATM, "table"), dict(bulk_modulus=2e9), "law", 'not "INCOMP::DowQ"'),
        (
            ("Water", ROOM, ATM, "table"),
            dict(bulk_modulus=2e9),
            "bulk_modulus",
            "leave out the key `bulk_modulus`",
        ),
        (("Nitrogen", ROOM, ATM, "table"), {}, "law", "needs a liquid"),
    ],
)
def test_refusals_name_the_key_and_the_reason(arguments, keys, key, words):
    blamed, message = refusal(*arguments, **keys)
    assert (blamed, words in message) == (key, True), message


def test_a_table_too_near_the_critical_point_is_refused_not_coarse():
    critical = PropsSI("TCRIT", "Water"), PropsSI("PCRIT", "Water")
    key, message = refusal("Water", critical[0] * 0.999999, critical[1] * 1.0001, "table")
    assert key == "law" and "log" in message


def test_a_second_process_imports_neither_coolprop_nor_scipy(empty_cache):
    code = """
import json, sys
from fvsolve.core.fluid import properties
water = properties("Water", 293.15, 101325.0, law="table")
numbers = [water.density, *water.table.log_density.tolist()]
print(json.dumps([numbers, "CoolProp" in sys.modules, "scipy" in sys.modules]))
"""

    def process_output():
        return json.loads(
            subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout
        )

    cold, warm = process_output(), process_output()
    assert cold[1] is True
    assert warm[1:] == [False, False]
    assert cold[0] == warm[0], "the cache gives back the same bits"


def test_equal_questions_give_equal_fluids_and_unequal_ones_unequal(empty_cache):
    cold = properties("Water", ROOM, ATM, law="table")
    assert properties("Water", ROOM, ATM, law="table") == cold
    assert properties("Water", ROOM + 1e-9, ATM, law="table") != cold
    assert len(list(empty_cache.iterdir())) == 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        cold.density = 1.0
    with pytest.raises(ValueError):
        cold.table.log_density[0] = 1.0


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("998.2", "989.2", 1),
    ],
)
def test_a_damaged_cache_file_is_computed_again(empty_cache, damage):
    density = properties("Water", ROOM, ATM).density
    (file,) = empty_cache.iterdir()
    file.write_text(damage(file.read_text()))
    assert properties("Water", ROOM, ATM).density == density
    assert str(density) in file.read_text()


def test_a_new_version_of_coolprop_is_evaluated_again(empty_cache, monkeypatch):
    properties("Water", ROOM, ATM)
    monkeypatch.setattr("fvsolve.core.fluid.property_cache.coolprop_version", lambda: "99.0")
    assert properties("Water", ROOM, ATM).source == "CoolProp 99.0"
    assert len(list(empty_cache.iterdir())) == 2


@pytest.mark.skipif(
    os.name == "nt", reason="a file in the folder's place is a different error on Windows"
)
def test_a_cache_that_cannot_be_written_costs_only_time(empty_cache):
    empty_cache.parent.mkdir(parents=True, exist_ok=True)
    empty_cache.touch()
    assert properties("Water", ROOM, ATM).density == approx(998.207, rel=1e-6)


C = 273.15


@pytest.mark.parametrize("grade", [32, 46, 68])
def test_an_oil_has_its_grade_at_40_degC_and_viscosity_index_100(grade):
    """ISO 3448 gives the viscosity at 40 degC; at index 100 it is H of ASTM D2270 for the viscosity at 100 degC."""
    oil = properties(f"ISO VG {grade}", 40 + C, ATM)
    assert 1e6 * oil.viscosity / oil.density == approx(grade, rel=1e-12)
    hot = properties(f"ISO VG {grade}", 100 + C, ATM)
    y = 1e6 * hot.viscosity / hot.density
    # D2270, Table 1: H over Y
    table = {5.3: 31.40, 5.4: 32.37, 6.7: 45.33, 6.8: 46.44, 8.7: 67.64, 8.8: 68.79}
    low = max(key for key in table if key <= y)
    h = table[low] + (y - low) / 0.1 * (table[round(low + 0.1, 1)] - table[low])
    assert h == approx(grade, rel=2e-3)


def test_walthers_line_through_two_points_agrees_with_a_measured_oil():
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
    squeezed = (
        properties("ISO VG 46", 40 + C, 200e5).density
        / properties("ISO VG 46", 40 + C, ATM).density
    )
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
    for name in (
        "ISO VG 46",
        "iso vg 46",
        "ISO-VG-46",
        "ISO VG46",
        "VG 46",
        "HLP 46",
        "HLP46",
        "HM 46",
    ):
        assert oil_name(name) == "ISO VG 46"
    assert oil_name("Water") is None and oil_name("INCOMP::HY45") is None


@pytest.mark.parametrize(
    "name, temperature, pressure, law, key, text",
    [
        (
            "ISO VG 22",
            313.15,
            ATM,
            "log",
            "name",
            "expected one of ISO VG 32, ISO VG 46, ISO VG 68",
        ),
        (
            "ISO VG 46",
            253.15,
            ATM,
            "log",
            "temperature",
            "-20 degC is outside the range of ISO VG 46",
        ),
        ("ISO VG 46", 313.15, 2e8, "log", "pressure", "above the range"),
        ("ISO VG 46", 313.15, ATM, "table", "law", "compressible fluid of CoolProp"),
        ("ISO VC 46", 313.15, ATM, "log", "name", 'did you mean "ISO VG 46"?'),
    ],
)
def test_an_oil_outside_the_known_range_is_refused(name, temperature, pressure, law, key, text):
    with pytest.raises(FluidError) as caught:
        properties(name, temperature, pressure, law)
    assert caught.value.key == key and text in caught.value.message
