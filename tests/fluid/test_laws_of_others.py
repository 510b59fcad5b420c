"""Density laws of other packages: formulas that become tables, beside built-in laws and exact solutions; refusals."""

import numpy as np
import pytest
from reference import scenes
from reference.scenes import junction, reservoir, scene, stiff_pipe
from scipy.optimize import brentq

from fvsolve import build, load, run
from fvsolve.core.fluid import LAWS, law_named, properties
from fvsolve.core.fluid.fluid_table import hermite_at
from fvsolve.errors import CaseError, FluidError, FvsolveError

FILE = """
import numpy as np

from fvsolve.core.fluid.laws import SampledLaw


class Logarithm(SampledLaw, name="own-log"):
    @classmethod
    def log_density(cls, fluid, pressure):
        strain = (pressure - fluid.pressure) / fluid.bulk_modulus
        return strain, np.full(strain.shape, 1.0 / fluid.bulk_modulus)


class Tait(SampledLaw, name="tait"):
    n = 7.15

    @classmethod
    def log_density(cls, fluid, pressure):
        rise = cls.n * (pressure - fluid.pressure) / fluid.bulk_modulus
        return np.log1p(rise) / cls.n, 1.0 / (fluid.bulk_modulus * (1.0 + rise))


class Stiff(Logarithm, name="stiff"):
    @classmethod
    def log_density(cls, fluid, pressure):
        return tuple(0.5 * values for values in super().log_density(fluid, pressure))


class Slope(Tait, name="slope"):
    @classmethod
    def log_density(cls, fluid, pressure):
        value, slope = super().log_density(fluid, pressure)
        return value, np.full(slope.shape, 1.0 / fluid.bulk_modulus)


class Shifted(Tait, name="shifted"):
    @classmethod
    def log_density(cls, fluid, pressure):
        value, slope = super().log_density(fluid, pressure)
        return value + 0.01, slope


class Falling(SampledLaw, name="falling"):
    @classmethod
    def log_density(cls, fluid, pressure):
        x = (pressure - fluid.pressure) / fluid.bulk_modulus
        return x - 30.0 * x * x, (1.0 - 60.0 * x) / fluid.bulk_modulus


class Empty(SampledLaw, name="empty"):
    pass


class Named:
    def __init_subclass__(cls, name):
        pass


class Stranger(Named, name="stranger"):
    pass
"""
PRESSURE, DENSITY, MODULUS, EXPONENT = 1e5, 1000.0, 2.2e9, 7.15
LENGTH, DIAMETER = 1000.0, 0.5
FLUID = {
    "name": "user",
    "density": DENSITY,
    "bulk_modulus": MODULUS,
    "viscosity": 1e-3,
    "vapor_pressure": 2000.0,
    "pressure": PRESSURE,
}


@pytest.fixture(autouse=True)
def file_of_laws(tmp_path, monkeypatch):
    """File of a user with the laws above."""
    file = tmp_path / "own_laws.py"
    file.write_text(FILE, encoding="utf-8")
    monkeypatch.setenv("FVSOLVE_DENSITY_LAWS", str(file))
    return file


def stopped_stream(law: str, velocity: float, **numerics):
    """Run of a stream that is stopped at once, at pressures far above the reference."""
    start = 1e7
    nodes = {"lake": reservoir(start), "gate": junction()}
    main = stiff_pipe("lake", "gate", LENGTH, DIAMETER, 200, friction=scenes.NO_FRICTION)
    main["initial_flow"] = velocity * scenes.area(DIAMETER)
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8} | numerics
    probes = ["gate.pressure", "main.pressure@0.5", "main.velocity@0.5"]
    fluid = FLUID | {"law": law}
    return run(scene(nodes, {"main": main}, 0.5, numerics, probes, 0.01, fluid=fluid))


def tait_density(p):
    return DENSITY * (1.0 + EXPONENT * (p - PRESSURE) / MODULUS) ** (1.0 / EXPONENT)


def test_the_index_lists_laws_of_others_behind_its_own():
    assert list(LAWS)[:4] == ["linear", "log", "table", "mixture"]
    assert "tait" in LAWS and law_named("tait").__name__ == "Tait"


def test_density_and_enthalpy_are_those_of_the_formula():
    nodes = {"lake": reservoir(PRESSURE), "gate": junction()}
    main = stiff_pipe("lake", "gate", LENGTH, DIAMETER, 10, friction=scenes.NO_FRICTION)
    case = scene(nodes, {"main": main}, 1.0, {}, ["gate.pressure"], fluid=FLUID | {"law": "tait"})
    law = load(case).law
    p = np.array([2e3, 5e4, 1e5, 3.3e6, 2e7, 9.9e7])
    assert law.density(p) == pytest.approx(tait_density(p), rel=1e-9)
    power = 1.0 - 1.0 / EXPONENT
    root = (1.0 + EXPONENT * (p - PRESSURE) / MODULUS) ** power - 1.0
    enthalpy = MODULUS / (DENSITY * EXPONENT * power) * root
    assert law.enthalpy(p) == pytest.approx(enthalpy, rel=1e-8, abs=1e-6)
    assert law.pressure_of_enthalpy(law.enthalpy(p)) == pytest.approx(p, rel=1e-10)


def test_the_formula_of_a_built_in_law_gives_its_results():
    own, built_in = (stopped_stream(law, 2.0) for law in ("own-log", "log"))
    for name in ("gate.pressure", "main.velocity@0.5"):
        size = np.abs(built_in[name]).max()
        assert own[name] == pytest.approx(built_in[name], abs=1e-7 * size)


@pytest.mark.parametrize("numerics", [{}, {"method": "trapezoid"}, {"method": "rodas-5p"}])
def test_a_stopped_stream_rises_to_the_shock_of_rankine_and_hugoniot(numerics):
    result = stopped_stream("tait", 20.0, **numerics)
    p, u = result["main.pressure@0.5"][0], result["main.velocity@0.5"][0]

    def rise(density):
        """Pressure rise by the conditions of Rankine and Hugoniot."""

        def balance(q):
            return (q - p) * (1.0 / density(p) - 1.0 / density(q)) - u**2

        return brentq(balance, p + 1e6, p + 1e8, rtol=1e-13) - p

    found = result["gate.pressure"][(result.t > 0.3) & (result.t < 0.5)] - p
    wanted = rise(tait_density)
    assert found == pytest.approx(wanted, rel=1e-4)
    assert abs(result.ledger["mass"]["relative"]) < 1e-11
    # The law `log` lies far from it, so the test can tell them apart.
    other = rise(lambda q: DENSITY * np.exp((q - PRESSURE) / MODULUS))
    assert abs(found[-1] - wanted) < 0.02 * abs(other - wanted)


@pytest.mark.parametrize(
    "law, text",
    [
        ("stiff", "its bulk modulus is 4.4e+09 Pa at the reference pressure; expected that of"),
        ("slope", "its slope is not that of its values"),
        ("shifted", "is 0.01 at the reference pressure; expected 0"),
        ("falling", "its density does not rise with pressure"),
        ("empty", '"empty" has no method `log_density`'),
    ],
)
def test_a_formula_that_contradicts_the_fluid_or_itself_is_refused(law, text):
    with pytest.raises(FluidError) as caught:
        properties("user", 293.15, PRESSURE, law, density=DENSITY, bulk_modulus=MODULUS)
    assert caught.value.key == "law" and text in str(caught.value)


@pytest.mark.parametrize("pressure", [20.0, 8e7])
def test_a_reference_outside_the_usual_pressures_lies_within_the_table(pressure):
    given = {"density": DENSITY, "bulk_modulus": MODULUS}
    table = properties("user", 293.15, pressure, "tait", **given).table
    assert table.pressure[0] <= pressure <= table.pressure[-1] / 2.0
    found = hermite_at(table.pressure, table.log_density, table.compressibility, pressure)
    assert np.exp(found) == pytest.approx(DENSITY, rel=1e-9)


def test_a_class_that_is_no_density_law_is_refused(file_of_laws):
    with pytest.raises(FvsolveError) as caught:
        law_named("stranger")
    assert "FVSOLVE_DENSITY_LAWS" in str(caught.value) and "SampledLaw" in str(caught.value)


def test_a_law_of_others_in_a_basin_of_liquid_is_refused():
    box = {"type": "basin", "physics": "liquid", "size": [1.0, 1.0], "cells": [4, 4]}
    box |= {"pressure": PRESSURE, "thickness": 0.1}
    case = scene({"box": box}, {}, 1.0, {}, [], fluid=FLUID | {"law": "tait"})
    with pytest.raises(CaseError, match="does not apply to"):
        build(load(case))
