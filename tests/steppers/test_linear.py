"""Factors, solutions and difference quotients of Jacobians for every kind of linear algebra."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csc_array

from fvsolve.core.steppers.linear_sparse import pairs
from fvsolve.core.steppers.structure import Structure, differences, multiply
from fvsolve.errors import FvsolveError

KINDS = ("dense", "banded", "sparse")


def pattern_of(n: int, m: int = 0, density: float = 0.2, seed: int = 0) -> np.ndarray:
    """Random pattern with a full diagonal."""
    found = np.random.default_rng(seed).random((n + m, n)) < density
    found[np.arange(n), np.arange(n)] = True
    return found


def values_on(structure: Structure, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random values by columns, and the dense matrix of n + m rows with these values."""
    values = np.random.default_rng(seed).normal(size=structure.nnz)
    pattern = structure.pattern
    return values, csc_array(
        (values, pattern.indices, pattern.indptr), shape=pattern.shape
    ).toarray()


def solved(structure: Structure, values: np.ndarray, shift, b: np.ndarray) -> np.ndarray:
    """Solution (shift I - J)^-1 b by the compiled functions."""
    number = complex if isinstance(shift, complex) else float
    factor, solve = structure.functions(number is complex)
    store, x = np.full(structure.store_size, np.nan, dtype=number), b.astype(number)
    assert factor(structure.shape, values, shift, store) == 0
    solve(structure.shape, store, x)
    return x


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n, m", [(1, 0), (2, 1), (5, 0), (12, 3), (40, 2)])
@pytest.mark.parametrize("shift", [30.0, 20.0 + 25.0j])
def test_the_solved_matrix_is_the_shifted_matrix(kind, n, m, shift):
    structure = Structure(pattern_of(n, m), kind)
    values, dense = values_on(structure)
    b = np.random.default_rng(1).normal(size=n)
    x = solved(structure, values, shift, b)
    assert (shift * np.eye(n) - dense[:n]) @ x == pytest.approx(b, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_two_by_two_is_solved_by_the_inverse_of_the_course(kind):
    """(a b; c d)^-1 = (d -b; -c a) / (a d - b c), section 2 of the course."""
    structure = Structure(np.ones((2, 2), dtype=bool), kind)
    j, right = np.array([[1.0, 2.0], [-3.0, 4.0]]), np.array([1.0, -2.0])
    (a, b), (c, d) = 7.0 * np.eye(2) - j
    inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    assert solved(structure, j.T.ravel().copy(), 7.0, right) == pytest.approx(
        inverse @ right, rel=1e-14
    )


@pytest.mark.parametrize("kind", ["dense", "banded"])
def test_rows_are_exchanged_where_a_pivot_is_zero(kind):
    structure = Structure(np.ones((3, 3), dtype=bool), kind)
    # shift 1 makes two pivots zero
    j = np.array([[1.0, 2.0, 3.0], [4.0, 1.0, 6.0], [7.0, 8.0, 0.0]])
    b = np.array([1.0, -2.0, 0.5])
    x = solved(structure, j.T.ravel().copy(), 1.0, b)
    assert (np.eye(3) - j) @ x == pytest.approx(b, rel=1e-13)


@pytest.mark.parametrize("width", [1, 2, 5])
def test_rows_are_exchanged_all_along_a_band(width):
    """A band with a zero diagonal is solved, which needs exchanges of rows."""
    n, rng = 60, np.random.default_rng(width)
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    shuffled = rng.permutation(n)
    structure = Structure((distance <= width)[shuffled][:, shuffled], "banded")
    values, dense = values_on(structure)
    pattern = structure.pattern
    values[pattern.indices == np.repeat(np.arange(n), np.diff(pattern.indptr))] = 0.0
    np.fill_diagonal(dense, 0.0)
    b = rng.normal(size=n)
    assert solved(structure, values, 0.0, b) == pytest.approx(np.linalg.solve(-dense, b), rel=1e-8)


def test_sparse_refuses_matrices_that_need_an_exchange_of_rows():
    structure = Structure(np.ones((3, 3), dtype=bool), "sparse")
    factor, _ = structure.functions()
    assert (
        factor(
            structure.shape,
            np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1]),
            1.0,
            np.zeros(structure.store_size),
        )
        > 0
    )


# pattern of the two waves of a pipe: each cell depends on its neighbours and, by friction, on its opposite wave


def pipe_pattern(cells: int, reach: int) -> np.ndarray:
    """Pattern of a pipe, forward waves first; each wave depends on `reach` neighbours of both waves."""
    distance = np.abs(np.subtract.outer(np.arange(cells), np.arange(cells)))
    return np.kron(np.ones((2, 2), dtype=bool), distance <= reach)


def pipe_values(structure: Structure, seed: int = 0) -> np.ndarray:
    """Random slopes with a diagonal equal to minus the sum of the absolute values of its row."""
    pattern, rng = structure.pattern, np.random.default_rng(seed)
    values = rng.normal(size=structure.nnz)
    columns = np.repeat(np.arange(structure.n), np.diff(pattern.indptr))
    others = np.bincount(pattern.indices, np.abs(values), minlength=sum(pattern.shape))
    values[pattern.indices == columns] = -others[: structure.n]
    return values


@pytest.mark.parametrize("reach", [1, 2, 3])
def test_all_kinds_agree_from_long_steps_to_short_ones(reach):
    n, b = 80, np.random.default_rng(2).normal(size=80)
    for shift in (1e-2, 1.0, 1e3, 1e6, 0.5 + 2.0j):
        found = []
        for kind in KINDS:
            structure = Structure(pipe_pattern(n // 2, reach), kind)
            found.append(solved(structure, pipe_values(structure), shift, b))
        assert found[1] == pytest.approx(found[0], rel=1e-10, abs=1e-12 * np.max(np.abs(found[0])))
        assert found[2] == pytest.approx(found[0], rel=1e-10, abs=1e-12 * np.max(np.abs(found[0])))


@pytest.mark.parametrize("reach", [1, 2, 3])
def test_sparse_finds_the_two_waves_of_a_cell(reach):
    cells = 30
    found = pairs(csc_array(pipe_pattern(cells, reach)))
    assert np.array_equal(found, np.column_stack((np.arange(cells), cells + np.arange(cells))))


def test_sparse_pairs_every_state_once():
    found = pairs(csc_array(pattern_of(41, density=0.05)))
    assert sorted(set(found.ravel())) == list(range(41))
    assert sum(1 if a == b else 2 for a, b in found) == 41


def test_sparse_factors_of_a_line_stay_inside_its_band():
    """The sparse factors of two waves with one neighbour per side, a block tridiagonal matrix, have no fill-in."""
    cells = 200
    structure = Structure(pipe_pattern(cells, 1), "sparse")
    assert structure.store_size == 4 * (2 * (cells - 1) + 2 * cells)  # L and U, inverses, work row


def test_the_kind_is_chosen_by_size_and_crowding():
    assert Structure.full(100).kind == "dense"
    assert Structure(np.eye(16, dtype=bool)).kind == "dense"
    assert Structure(np.eye(17, dtype=bool)).kind == "sparse"
    assert Structure(pipe_pattern(40, 3)).kind == "sparse"
    assert Structure(pattern_of(40, density=0.3)).kind == "dense"
    assert Structure(pipe_pattern(40, 3), "banded").kind == "banded"


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", [float, complex])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_a_number_are_never_hidden(kind, number, bad):
    structure = Structure(pattern_of(6, 1, density=0.5), kind)
    factor, _ = structure.functions(number is complex)
    store = np.zeros(structure.store_size, dtype=number)
    for e in np.flatnonzero(structure.pattern.indices < 6):
        values, _ = values_on(structure)
        values[e] = bad
        code = factor(structure.shape, values, number(50.0), store)
        assert 1 <= code <= 6


@pytest.mark.parametrize("kind", KINDS)
def test_a_singular_matrix_is_reported(kind):
    structure = Structure(np.eye(4, dtype=bool), kind)
    factor, _ = structure.functions()
    store = np.zeros(structure.store_size)
    assert factor(structure.shape, np.array([1.0, 2.0, 5.0, 3.0]), 5.0, store) == 3
    assert factor(structure.shape, np.array([1.0, 2.0, 4.0, 3.0]), 5.0, store) == 0
    whole = Structure.full(3)
    rank_one = np.ones(9)
    # shift is an eigenvalue
    assert whole.functions()[0](whole.shape, rank_one, 3.0, np.zeros(whole.store_size)) > 0


def test_a_kind_that_does_not_exist_is_refused():
    with pytest.raises(
        FvsolveError, match='unknown kind of structure "bandad"; did you mean "banded"'
    ):
        Structure(np.eye(2, dtype=bool), "bandad")
    with pytest.raises(FvsolveError, match="fewer rows than states"):
        Structure(np.ones((1, 2), dtype=bool))


# differences ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n, m, density", [(1, 0, 1.0), (7, 2, 0.3), (60, 5, 0.05), (60, 5, 1.0)])
def test_columns_of_equal_color_share_no_row(n, m, density):
    structure = Structure(pattern_of(n, m, density))
    dense = structure.pattern.toarray()
    assert structure.colors.min() == 0
    for color in range(structure.color_count):
        assert np.all(dense[:, structure.colors == color].sum(axis=1) <= 1)


def test_a_band_needs_no_more_colors_than_its_width():
    n = 300
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    assert Structure(distance <= 2).color_count == 5


@pytest.mark.parametrize("n, m, density", [(1, 0, 1.0), (7, 2, 0.3), (40, 4, 0.1)])
def test_differences_agree_with_the_slopes(n, m, density):
    """Difference quotients of the sine of a linear map, and of its ledger, equal the exact slopes."""
    structure = Structure(pattern_of(n, m, density))
    _, a = values_on(structure)
    where = 2

    def evaluate(handle, run, t, y, dydt):
        found = np.sin(a @ y + t)
        dydt[:], run.out[where : where + m] = found[:n], found[n:]

    y = np.random.default_rng(2).normal(size=n)
    f, f_work, jacobian = np.zeros(n), np.zeros(n), np.full(structure.nnz, np.nan)
    run = SimpleNamespace(
        structure=structure.shape,
        scale=np.ones(n),
        moved=np.zeros(n),
        out=np.zeros(where + m),
        jacobian=jacobian,
        control=[{"ledger_offset": where}],
    )
    evaluate(None, run, 0.3, y, f)
    supply = run.out[where:].copy()
    python = getattr(differences, "py_func", differences)
    calls = python(evaluate, None, run, 0.3, y, f, supply, f_work)
    assert calls == structure.color_count
    slope = np.cos(a @ y + 0.3)[:, None] * a
    pattern = structure.pattern
    found = csc_array((jacobian, pattern.indices, pattern.indptr), shape=pattern.shape).toarray()
    assert found == pytest.approx(slope, abs=2e-6)
    x, product = np.random.default_rng(3).normal(size=n), np.zeros(n + m)
    multiply(structure.shape, jacobian, x, product)
    assert product == pytest.approx(found @ x, rel=1e-12, abs=1e-13)
