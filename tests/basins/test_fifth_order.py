"""Formulas of fifth order are exact for polynomials of degree 4: means of ghost cells, and values at faces."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from fvsolve.features.basins.fifth_order import (
    face_difference_linear,
    face_difference_weno,
    ghost_means,
)

DEGREES = range(5)


def mean(polynomial: Polynomial, cell: int) -> float:
    """Mean of a polynomial over the cell from `cell` to `cell` + 1."""
    whole = polynomial.integ()
    return whole(cell + 1.0) - whole(cell)


def polynomials(degree: int) -> list[Polynomial]:
    """A power, and a polynomial of this degree with unequal coefficients."""
    return [Polynomial.basis(degree), Polynomial(np.linspace(1.0, -0.7, degree + 1))]


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("degree", DEGREES)
def test_means_of_ghost_cells_are_exact_up_to_degree_4(degree, known):
    """The side lies at 0, the cells inside begin there."""
    for polynomial in polynomials(degree):
        inside = [mean(polynomial, cell) for cell in range(5)]
        if known:
            inside[4] = 1e3  # not used
        found = ghost_means(known, polynomial(0.0), *inside)
        assert found == pytest.approx(
            (mean(polynomial, -1), mean(polynomial, -2)), abs=1e-12, rel=1e-12
        )


@pytest.mark.parametrize("degree", DEGREES)
def test_the_value_at_a_face_is_exact_up_to_degree_4(degree):
    for polynomial in polynomials(degree):
        means = [mean(polynomial, cell) for cell in range(-2, 3)]
        found = means[2] + face_difference_linear(*np.diff(means))
        assert found == pytest.approx(polynomial(1.0), abs=1e-12)


def test_weno_tends_to_the_linear_value_on_a_smooth_line():
    """The weights differ from the linear ones by the fourth power of the width of a cell at least."""
    errors = []
    for width in (0.1, 0.05):
        ends = 0.3 + width * np.arange(-2, 4)
        means = np.diff(np.sin(ends)) * -1.0 / width
        steps = np.diff(means)
        errors.append(abs(face_difference_weno(*steps) - face_difference_linear(*steps)))
    assert np.log2(errors[0] / errors[1]) > 4.5
