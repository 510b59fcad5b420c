"""Density laws: all implement every function, differ from each other, and agree with quadrature."""

import inspect
import math
from functools import cache

import numpy as np
import pytest
from pytest import approx
from scipy.integrate import quad

from fvsolve.case.sections import FluidSpec
from fvsolve.core.fluid import LAWS, law_named, properties
from fvsolve.core.fluid.laws import DenseLaw, LinearLaw
from fvsolve.core.kernels import density as kernels
from fvsolve.core.kernels import dtypes as rec

AMBIENT, GRAVITY, REFERENCE = 98000.0, 9.81, 2e5
GIVEN = {"mixture": {"air_fraction": 0.004}}  # further keys of a law
PRESSURES = [3e4, 1e5, 2e5, 7e5, 4e6, 3e7]
DENSE = [name for name in LAWS if issubclass(law_named(name), DenseLaw)]
QUESTIONS = {
    name: one
    for name, one in vars(kernels).items()
    if getattr(one, "__module__", "") == kernels.__name__
}
OF_THE_FLUID = {"log_density", "enthalpy", "pressure_of_log", "pressure_of_enthalpy"}


@cache
def law(name: str):
    """Law of water at 20 degC and 2 bar."""
    fluid = properties("Water", 293.15, REFERENCE, law=name, **GIVEN.get(name, {}))
    return law_named(name)(fluid, AMBIENT, GRAVITY)


def a_pipe(of) -> np.void:
    """Row of a pipe with a wave speed of 1100 m/s."""
    row = np.zeros(1, rec.PIPE)[0]
    row["area"], row["speed"], row["compliance"] = 0.02, 1100.0, of.compliance(1100.0)
    row["admittance"] = row["area"] / row["speed"]
    return row


def integral(f, low: float, high: float) -> float:
    """Integral of f over pressure in ln p, where gas is smooth; a table has kinks of its third derivative."""
    return quad(
        lambda x: math.exp(x) * f(math.exp(x)),
        math.log(low),
        math.log(high),
        epsabs=0,
        epsrel=1e-11,
        limit=2000,
    )[0]


def test_a_case_file_can_name_exactly_these():
    (choice,) = FluidSpec.model_fields["law"].metadata
    assert tuple(choice.words) == tuple(LAWS) and len(
        {law_named(name).code for name in LAWS}
    ) == len(LAWS)


def public(cls) -> set[str]:
    return {name for name in dir(cls) if not name.startswith("_")}


def test_each_answers_the_same_questions():
    for name in LAWS:
        assert public(LinearLaw) <= public(law_named(name)), name
    for name in set(DENSE):
        module = getattr(kernels, f"{name}_law")
        # questions of walls too, if the walls of a law are its own
        answered = QUESTIONS.keys() & vars(module).keys()
        assert answered in (OF_THE_FLUID, QUESTIONS.keys() - {"force_of_mass"}), name
        for question in answered:
            asked = QUESTIONS[question]
            own = inspect.signature(
                getattr(getattr(module, question), "py_func", getattr(module, question))
            )
            assert (
                own.parameters.keys()
                == inspect.signature(getattr(asked, "py_func", asked)).parameters.keys()
            )


@pytest.mark.parametrize("name", LAWS)
def test_density_is_the_slope_of_pressure_over_enthalpy_and_potential(name):
    one = law(name)
    for p in PRESSURES:
        rise = 1e-4 * p
        slope = (
            2.0
            * rise
            * one.rho
            / (one.potential_of(p + rise, 3.0) - one.potential_of(p - rise, 3.0))
        )
        assert slope == approx(one.density(p), rel=2e-7)
        assert one.pressure_of(one.potential_of(p, -40.0), -40.0) == approx(p, rel=1e-12)
        head = one.head(p, 0.0)
        assert one.pressure_under(head) == approx(p, rel=1e-11) and np.isfinite(head)
    assert one.head(AMBIENT, 12.0) == approx(12.0) and one.open_density == approx(
        float(one.density(AMBIENT))
    )


@pytest.mark.parametrize("name", DENSE)
def test_enthalpy_is_the_integral_of_specific_volume(name):
    one = law(name)
    for p in PRESSURES:
        found = integral(
            lambda q: 1.0 / float(one.density(q)), min(p, REFERENCE), max(p, REFERENCE)
        )
        # a table has an error of 1e-9
        assert abs(one.enthalpy(p)) == approx(found, rel=5e-9, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_content_of_a_pipe_leads_back_to_its_pressure(name):
    one = law(name)
    row, p = a_pipe(one), np.array(PRESSURES)
    m = one.density(p) * one.area(row, p)
    row["center"], profile = 0, one.density(np.full(6, REFERENCE)) * row["area"]
    if one.linear:  # its flows have one density: m' = A p' / c^2
        m = profile + row["area"] * (p - REFERENCE) / row["speed"] ** 2
    found = one.cell_pressure(row, np.full(6, REFERENCE), profile, (m - profile) * row["speed"])
    assert found == approx(p, rel=1e-6 if one.linear else 1e-10)
    assert one.mass_in(REFERENCE, 2.0) == approx(2.0 * float(one.density(REFERENCE)), rel=1e-14)


@pytest.mark.parametrize("name", DENSE)
def test_the_compiled_questions_agree_with_quadrature(name):
    one = law(name)
    st, floats, row = one.st, one.floats, a_pipe(law(name))
    for p in PRESSURES:
        m, dm = kernels.mass_of_pressure(st, floats, row, p)
        value, slope = kernels.log_density(st, floats, p)
        area, rise = kernels.wall_area(st, floats, row, p), 1e-4 * p
        assert m == approx(kernels.density(st, floats, p) * area, rel=1e-13)
        near = [kernels.mass_of_pressure(st, floats, row, p + side * rise)[0] for side in (-1, 1)]
        assert dm == approx((near[1] - near[0]) / (2.0 * rise), rel=1e-4)
        assert value == approx(
            math.log(kernels.density(st, floats, p) / one.rho), rel=1e-13, abs=1e-15
        )
        c = math.sqrt(area / dm)
        assert kernels.local_speed(st, floats, row, p) == approx(c, rel=1e-12)
        assert kernels.impedance(st, floats, row, p) == approx(m / area * c, rel=1e-12)
        assert kernels.pressure_of_mass(st, floats, row, m) == approx(p, rel=1e-9)
        assert kernels.force_of_mass(st, floats, row, m) == approx(
            kernels.thrust(st, floats, row, p), rel=1e-9, abs=1e-5
        )
        assert kernels.pressure_of_log(st, floats, 0.0, value) == approx(p, rel=1e-9)
    low, high = 3e5, 4e6
    force = kernels.thrust(st, floats, row, high) - kernels.thrust(st, floats, row, low)
    assert force == approx(
        integral(lambda q: kernels.wall_area(st, floats, row, q), low, high), rel=1e-10
    )
    change = integral(lambda q: 1.0 / kernels.impedance(st, floats, row, q), low, high)
    assert kernels.velocity_change(st, floats, row, low, high) == approx(change, rel=1e-7)


def answers(name: str, code: int | None = None) -> dict[str, np.ndarray]:
    """Results of all compiled functions with the numbers of a law, and with the code of another law if given."""
    one = law(name)
    st, row = one.st.copy(), a_pipe(one)
    st["law"] = st["law"] if code is None else code
    given = {
        "h": 900.0,
        "compliance": 1e-10,
        "q": 1e-4,
        "pipe": row,
        "m": 1.0005 * one.rho * row["area"],
        "p": 1.3e6,
        "p_from": 1e6,
        "p_to": 2e6,
    }
    found = {}
    for question, asked in QUESTIONS.items():
        names = [*inspect.signature(getattr(asked, "py_func", asked)).parameters][2:]
        found[question] = np.atleast_1d(asked(st, one.floats, *(given[key] for key in names)))
    return found


def test_each_differs_from_every_other():
    said = {name: answers(name) for name in DENSE}
    for a in DENSE:
        for b in DENSE[: DENSE.index(a)]:
            for question in set(QUESTIONS) - {"wall_area", "thrust"}:  # properties of the wall
                assert np.all(said[a][question] != said[b][question]), (a, b, question)


@pytest.mark.parametrize("code", [-1, law_named("linear").code, 97])
def test_a_code_that_is_no_law_of_theirs_gives_nan(code):
    assert len(QUESTIONS) == 13
    for question, said in answers("table", code).items():
        assert np.isnan(said).all(), question


def test_a_mixture_with_nothing_mixed_in_is_log():
    fluid = properties("Water", 293.15, REFERENCE, law="mixture")
    plain = law_named("mixture")(fluid, AMBIENT, GRAVITY)
    assert np.array_equal(
        plain.density(np.array(PRESSURES)), law("log").density(np.array(PRESSURES))
    )
    assert plain.family == "barotropic" and not plain.cavitates
