"""Tableaux: each has the order of its source and not the next, and invalid tableaux are refused."""

import math
import warnings
from fractions import Fraction
from math import cos, pi, sqrt

import numpy as np
import pytest

from fvsolve.core.steppers.analysis.trees import Conditions, density, trees
from fvsolve.core.steppers.tableau import METHODS, estimate_faults, method_named, tableau
from fvsolve.errors import FvsolveError

# stages, order, order of the embedded solution and stage order of the sources
PUBLISHED = {
    "euler": (1, 1, 0, 1),
    "improved-euler": (2, 2, 0, 1),
    "modified-euler": (2, 2, 0, 1),
    "ralston": (2, 2, 0, 1),
    "heun": (3, 3, 0, 1),
    "kutta-3": (3, 3, 0, 1),
    "rk4": (4, 4, 0, 1),
    "three-eighths": (4, 4, 0, 1),
    "ssp-rk2": (2, 2, 0, 1),
    "ssp-rk3": (3, 3, 0, 1),
    "ssp-rk10-4": (10, 4, 0, 1),
    "bogacki-shampine": (4, 3, 2, 1),
    "dormand-prince": (7, 5, 4, 1),
    "tsitouras": (7, 5, 4, 1),
    "verner-7": (10, 7, 6, 1),
    "implicit-euler": (1, 1, 0, 1),
    "implicit-midpoint": (1, 2, 0, 1),
    "gauss-4": (2, 4, 0, 2),
    "gauss-6": (3, 6, 0, 3),
    "trapezoid": (2, 2, 0, 2),
    "lobatto-iiia-4": (3, 4, 0, 3),
    "lobatto-iiia-6": (4, 6, 0, 4),
    "lobatto-iiic-2": (2, 2, 0, 1),
    "lobatto-iiic-4": (3, 4, 0, 2),
    "radau-ia-3": (2, 3, 0, 1),
    "radau-ia-5": (3, 5, 0, 2),
    "radau-iia-3": (2, 3, 0, 2),
    "radau-iia-5": (3, 5, 3, 3),
    "radau-iia-9": (5, 9, 5, 5),
    "alexander-2": (2, 2, 0, 1),
    "alexander-3": (3, 3, 0, 1),
    "crouzeix-3": (2, 3, 0, 1),
    "crouzeix-4": (3, 4, 0, 1),
    "tr-bdf2": (3, 2, 3, 2),
    "esdirk-3": (5, 3, 2, 2),
    "esdirk-4": (6, 4, 3, 2),
    "esdirk-5": (7, 5, 4, 2),
    "rodas-4": (6, 4, 3, 1),
    "rodas-5p": (8, 5, 4, 1),
}
ALIASES = {
    "gauss-2": "implicit-midpoint",
    "radau-iia-1": "implicit-euler",
    "lobatto-iiia-2": "trapezoid",
}


def test_rooted_trees_are_counted_as_in_the_books():
    assert [len(trees(n)) for n in range(1, 11)] == [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]


def test_densities_are_those_of_the_tall_and_the_bushy_tree():
    assert sorted(density((4, i)) for i in range(4)) == [4, 8, 12, 24]


def test_the_published_list_is_whole():
    assert {method.name for method in METHODS.values()} == set(PUBLISHED)


@pytest.mark.parametrize("name", PUBLISHED)
def test_derived_properties_are_the_published_ones(name):
    m = METHODS[name]
    assert (m.stages, m.order, m.error_order, m.stage_order) == PUBLISHED[name]


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_condition_holds_up_to_the_order_and_a_condition_fails_beyond(name):
    m = METHODS[name]
    conditions = (
        Conditions(m.forms[0], m.rounding, m.exact.a)
        if m.kind == "linear"
        else Conditions(m.exact.a, m.rounding)
    )
    assert all(conditions.holds(n, m.exact.b) for n in range(1, m.order + 1))
    assert not conditions.holds(m.order + 1, m.exact.b)


@pytest.mark.parametrize("name", PUBLISHED)
def test_rows_add_up_to_c_as_floats_too(name):
    m = METHODS[name]
    assert m.a.sum(axis=1) == pytest.approx(m.c, abs=4e-14)
    assert m.b.sum() == pytest.approx(1.0, abs=2e-14)


@pytest.mark.parametrize("alias, name", ALIASES.items())
def test_first_members_of_families_are_known_by_both_names(alias, name):
    assert method_named(alias) is method_named(name)


def test_a_coefficient_that_is_off_by_its_last_digit_costs_the_order():
    text = (
        METHODS["esdirk-4"]
        .text.replace("-654441/2922500", "-654442/2922500")
        .replace("5012029/34652500", "x")
    )
    a21 = Fraction(31, 50) - Fraction(1, 4) - Fraction(174375, 388108) + Fraction(654442, 2922500)
    assert tableau_order(text.replace("x", str(a21))) < 4


def tableau_order(text: str) -> int:
    return tableau("changed", text).order


def test_algebraic_numbers_are_those_of_the_books():
    assert METHODS["gauss-6"].c[0] == pytest.approx(0.5 - sqrt(15) / 10, abs=1e-16)
    assert METHODS["radau-iia-5"].a[0, 1] == pytest.approx((296 - 169 * sqrt(6)) / 1800, abs=1e-16)
    assert METHODS["alexander-3"].a[0, 0] == pytest.approx(0.435866521508459, abs=1e-15)
    assert METHODS["crouzeix-4"].a[0, 0] == pytest.approx(0.5 + cos(pi / 18) / sqrt(3), abs=1e-15)
    assert -METHODS["radau-iia-5"].start_error == pytest.approx(
        (6 + 81 ** (1 / 3) - 9 ** (1 / 3)) / 30, abs=1e-15
    )


@pytest.mark.parametrize(
    "name", ["dormand-prince", "tsitouras", "bogacki-shampine", "trapezoid", "esdirk-5"]
)
def test_the_last_rate_is_the_first_of_the_next_step(name):
    assert METHODS[name].first_same_as_last and METHODS[name].stiffly_accurate


@pytest.mark.parametrize("name", ["radau-iia-5", "alexander-2", "lobatto-iiic-4"])
def test_stiffly_accurate_methods_need_not_start_with_the_last_rate(name):
    assert METHODS[name].stiffly_accurate and not METHODS[name].first_same_as_last


@pytest.mark.parametrize("name", [*PUBLISHED])
def test_collocation_is_recognised_and_its_polynomial_passes_through_the_stages(name):
    m = METHODS[name]
    family = name.startswith(
        ("gauss", "radau-iia", "lobatto-iiia", "implicit", "trapezoid", "euler")
    )
    assert (len(m.dense) > 0) == (family or name in ("dormand-prince", "tsitouras"))
    if family:
        powers = m.c[:, None] ** range(1, m.stages + 1)
        assert powers @ m.dense.T == pytest.approx(m.a, abs=1e-14)
    if len(m.dense):
        assert m.dense.sum(axis=1) == pytest.approx(m.b, abs=1e-14)


def test_every_decimal_of_a_published_array_counts():
    assert (METHODS["tsitouras"].digits, METHODS["esdirk-5"].digits, METHODS["rk4"].digits) == (
        40,
        25,
        None,
    )


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("0 |\n1 | 1/2\n--+----\n | 1/2 1/2", "row 2 adds up to 1/2; expected c = 1"),
        ("0 |\n1 | 1\n--+----\n | 1/2 1/4", "weights add up to 3/4; expected 1"),
        ("0 |\n1 | 1 2 -2\n--+----\n | 1/2 1/2", "row 2 has 3 entries; expected at most 2"),
        ("0 |\n1 | x\n--+----\n | 1/2 1/2", 'unknown symbol "x"; known are sqrt(n)'),
        ("0 |\n1 | 1)\n--+----\n | 1/2 1/2", '"1)": unexpected ")"'),
        ("0 |\n1 | 1/0\n--+----\n | 1/2 1/2", '"1/0" divides by zero'),
        ("0 |\n1 | sqrt(2)\n--+----\n | sqrt(3) 1", "sqrt(2) and sqrt(3) are used in one tableau"),
        ("0 |\n1 | sqrt(1/2)\n--+--\n | 1/2 1/2", "expected sqrt(n) of an integer"),
        ("0 |\n1 | sqrt(123456789012)\n--+--\n | 1/2 1/2", "expected sqrt(n) of an integer"),
        ("0 |\n1e99 | 1e99\n--+--\n | 1/2 1/2", '"1e99" is beyond 1e+30'),
        ("0 |", "expected rows, a line of dashes and weights"),
        ("", "expected rows, a line of dashes and weights"),
        ("0\n--+--\n | 1", 'has no "|"'),
        ("0 |\n--+----\n | 1/2 1/2", "one or two rows of 1"),
        (
            "0.123456789 | 0.1234567\n--+--\n | 1",
            "row 1 adds up to 1234567/10000000; expected c = 123456789/1000000000",
        ),
        ("0 |\n1 | 1\n--+----\n | 1/2 1/2\n | 1/2 1/2", "the error estimate is zero"),
        ("0 |\n1 | 1\n1 | 1\n--+----\n | 1/2 1/2 0\n | 1/2 1/4 1/4", "the error estimate is zero"),
        ("1/2 | 1/2\n1/2 | 1/2\n--+----\n | 1/2 1/2\n | 1 0", "the error estimate is zero"),
        (
            "0 |\n0.3333333333333333 | 0.3333333333333333\n--+--\n | 0.25 0.75\n | 0.2500000000000001 0.75",
            "the error estimate is zero",
        ),
    ],
)
def test_a_wrong_array_is_refused_with_its_fault(text, wanted):
    with pytest.raises(FvsolveError) as caught:
        tableau("wrong", text)
    assert wanted in str(caught.value)
    assert "wrong" not in METHODS


def test_all_faults_are_reported_at_once():
    with pytest.raises(FvsolveError) as caught:
        tableau("wrong", "0 | 1/2\n1 | 1/3 1/3\n--+--\n | 1/2 1/3")
    assert str(caught.value).splitlines() == [
        "wrong: 3 faults",
        "  row 1 adds up to 1/2; expected c = 0",
        "  row 2 adds up to 2/3; expected c = 1",
        "  weights add up to 5/6; expected 1",
    ]


HALF, SIXTH = Fraction(1, 2), Fraction(1, 6)
HEUN_2 = [[0, 0], [1, 0]]
FOUR_STAGES = [[0, 0, 0, 0], [HALF, 0, 0, 0], [0, HALF, 0, 0], [HALF, 0, 0, 0]]
FEHLBERG = """
    0    |
    2/27 | 2/27
    1/9  | 1/36 1/12
    1/6  | 1/24 0 1/8
    5/12 | 5/12 0 -25/16 25/16
    1/2  | 1/20 0 0 1/4 1/5
    5/6  | -25/108 0 0 125/108 -65/27 125/54
    1/6  | 31/300 0 0 0 61/225 -2/9 13/900
    2/3  | 2 0 0 -53/6 704/45 -107/9 67/90 3
    1/3  | -91/108 0 0 23/108 -976/135 311/54 -19/60 17/6 -1/12
    1    | 2383/4100 0 0 -341/164 4496/1025 -301/82 2133/4100 45/82 45/164 18/41
    0    | 3/205 0 0 0 0 -6/41 -3/205 -3/41 3/41 6/41 0
    1    | -1777/4100 0 0 -341/164 4496/1025 -289/82 2193/4100 51/82 33/164 12/41 0 1
    -----+----
         | 41/840 0 0 0 0 34/105 9/35 9/35 9/280 9/280 41/840 0 0
         | 0      0 0 0 0 34/105 9/35 9/35 9/280 9/280 0 41/840 41/840
"""
ALL, LINEAR, TIME = "too small", "zero there", "y' = f(t), so the error estimate is zero there"


@pytest.mark.parametrize(
    "arguments, wanted",
    [
        # the scene that was accepted, and gave 60.6 in place of -0.839 for y'' = -y
        (dict(A=HEUN_2, b=[[0.5, 0.5], [0.5, 0.5]]), "the error estimate is zero"),
        # stages that are equal although their rows differ
        (dict(A=[[HALF, 0], [0, HALF]], b=[[HALF, HALF], [1, 0]]), ALL),
        (
            dict(
                A=[
                    [0] * 5,
                    [HALF, 0, 0, 0, 0],
                    [HALF, 0, 0, 0, 0],
                    [0, 1, 0, 0, 0],
                    [0, 0, 1, 0, 0],
                ],
                b=[[SIXTH, 4 * SIXTH, 0, SIXTH, 0], [SIXTH, 4 * SIXTH, 0, 0, SIXTH]],
            ),
            ALL,
        ),
        # f(t, y) is the rate of the first stage, which is the start of the step; or it has no weight
        (dict(text="0 |\n1 | 1\n--+--\n | 1/2 1/2", start_weight="1/2"), ALL),
        (dict(text="0 | 0 0\n1 | 1/2 1/2\n--+--\n | 1/2 1/2", start_weight="1/2"), ALL),
        (dict(text="1 | 1\n--+--\n | 1", start_weight="0"), ALL),
        # equal errors of order h^3, different errors of order h^4: the estimate falls faster than the error
        (dict(A=FOUR_STAGES, b=[[0, 0, 1, 0], [0, 0, 1, 0]]), "the error estimate is zero"),
        # both solutions of y' = lambda y are 1 + z + z^2 / 2
        (
            dict(
                A=[[0, 0, 0], [Fraction(1, 3), 0, 0], [Fraction(2, 3), 0, 0]],
                b=[[Fraction(1, 4), 0, Fraction(3, 4)], [0, HALF, HALF]],
            ),
            "y' = lambda y, so the error estimate is zero there",
        ),
        # the midpoint rule with two different rates at the middle
        (dict(A=[[0, 0, 0], [HALF, 0, 0], [0, HALF, 0]], b=[[0, 1, 0], [0, 0, 1]]), TIME),
        (dict(text=FEHLBERG), TIME),
    ],
)
def test_an_error_estimate_that_is_zero_for_all_problems_of_a_kind_is_refused(arguments, wanted):
    with pytest.raises(FvsolveError) as caught:
        tableau("blind", **arguments)
    assert wanted in str(caught.value) and "expected an embedded solution of another order" in str(
        caught.value
    )
    assert "blind" not in METHODS


def test_an_estimate_of_a_higher_power_than_the_error_is_refused():
    """Of order 1 both, with the same coefficient of h^2 and others of h^3: halving rtol leaves the error as it is."""
    a = [[0, 0, 0], [Fraction(1, 4), 0, 0], [0, HALF, 0]]
    with pytest.raises(FvsolveError, match=r"has the error of order h\^2 of the new state"):
        tableau("blind", a, [[0, 1, 0], [HALF, 0, HALF]])


@pytest.mark.parametrize("name", [name for name in PUBLISHED if PUBLISHED[name][2]])
def test_the_estimates_of_the_published_pairs_see_every_kind_of_problem(name):
    assert estimate_faults(METHODS[name]) == []


def test_a_row_of_weights_of_fehlbergs_pair_is_a_method():
    assert tableau_order(FEHLBERG.rsplit("\n", 2)[0]) == 7


@pytest.mark.parametrize(
    "arguments, wanted",
    [
        (dict(A=[[0, 0], [math.nan, 0]], b=[0.5, 0.5]), "A[1, 0] = nan is not a finite number"),
        (dict(A=[[0, 0], [math.inf, 0]], b=[0.5, 0.5]), "A[1, 0] = inf is not a finite number"),
        (dict(A=[[0, 0], [10**400, 0]], b=[0.5, 0.5]), "is not a finite number"),
        (dict(A=HEUN_2, b=[math.nan, 0.5]), "b[0, 0] = nan is not a finite number"),
        (dict(A=HEUN_2, b=[0.5, 0.5], c=[0, -math.inf]), "c[1] = -inf is not a finite number"),
        (dict(A=np.array([[0, 0], [math.nan, 0]]), b=np.array([0.5, 0.5])), "A[1, 0] = nan"),
        (
            dict(A=[["0", 0], [None, 1j]], b=[0.5, 0.5]),
            'A[0, 0] = "0", A[1, 0] = None, A[1, 1] = 1j are not finite',
        ),
        (dict(A=[[False, 0], [1, 0]], b=[0.5, 0.5]), "A[0, 0] = false is not a finite number"),
        (dict(A=[[0], [1, 0]], b=[0.5, 0.5]), "A has rows of different lengths"),
        (dict(A=[[[0, 0], [1, 0]], [1, 0]], b=[0.5, 0.5]), "A has rows of different lengths"),
        (dict(A=HEUN_2, b=[[0.5, 0.5], [1]]), "b has rows of different lengths"),
        (dict(A=[HEUN_2], b=[0.5, 0.5]), "A has shape (1, 2, 2)"),
        (dict(A=HEUN_2, b=[[0.5, 0.5]] * 3), "b (3, 2); expected"),
        (dict(A=[], b=[]), "A has shape (1, 0)"),
        (dict(A={0: 1}, b=[1]), "is not a finite number"),
        (dict(text="1 | 1\n--\n | 1", digits=0), "digits = 0 is out of range; expected 1 to 75"),
        (dict(text="1 | 1\n--\n | 1", digits=10**9), "digits = 1000000000 is out of range"),
        (dict(text="1 | 1\n--\n | 1", start_weight="nan"), 'start_weight: "nan": unknown symbol'),
        (
            dict(text="1 | 1\n--\n | 1", start_weight="1e400"),
            'start_weight: "1e400" is beyond 1e+30',
        ),
        (
            dict(text="1/2 | 1/2 0\n1/2 | 0 1/2\n--\n | 1 0", start_weight="1/2"),
            "expected stages at different times",
        ),
        (dict(text="0 |\n1 | 1\n--\n | 1/2 1/2", dense=[[1]]), "dense: expected 2 rows"),
        (
            dict(text="0 |\n1 | 1\n--\n | 1/2 1/2", dense=[[1, 0], [1]]),
            "with equal numbers of coefficients",
        ),
        (dict(text="0 |\n1 | 1\n--\n | 1/2 1/2", dense=[1, 2]), "dense: expected 2 rows"),
        (
            dict(text="0 |\n1 | 1\n--\n | 1/2 1/2", dense=[[1, math.nan], [0, 0.5]]),
            'dense, row 1: "nan"',
        ),
        (
            dict(text="0 |\n1 | 1\n--\n | 1/2 1/2", dense=[[1, -1], [0, 0.5]]),
            "it adds up to 0; expected the weight 1/2",
        ),
        (
            dict(text="g | g\n--\n | 1", numbers={"g": ("x^2-2", math.inf)}),
            "expected a name, with a polynomial",
        ),
        (dict(text="g | g\n--\n | 1", numbers={"g": 3}), 'numbers: "g" = 3; expected a name'),
        (dict(text="g | g\n--\n | 1", numbers={7: ("x^2-2", 1.4)}), "numbers: 7 ="),
        (
            dict(text="g | g\n--\n | 1", numbers={"g": ("(x^64)^64-2", 1.0)}),
            "is too large for exact arithmetic",
        ),
        (dict(text="((((2^64)^64)^64)^64)^64 | 1\n--\n | 1"), "is too large for exact arithmetic"),
        (dict(text="(" * 900 + " | 1\n--\n | 1"), "has more than 20 brackets within each other"),
        (dict(text="1" * 5000 + " | 1\n--\n | 1"), "has 5000 characters; expected at most 1000"),
        (dict(text="1 | 1\n" * 10**5 + "--\n | 1"), "more than 100 stages"),
        (dict(text="x" * (10**6 + 1)), "the text has more than 1000000 characters"),
        (dict(text="0 | x\n" * 40 + "--\n | 1"), "and 20 more"),
    ],
)
def test_entries_that_are_no_numbers_and_wrong_shapes_are_refused_by_name(arguments, wanted):
    with pytest.raises(FvsolveError) as caught:
        tableau("wrong", **arguments)
    assert wanted in str(caught.value) and len(str(caught.value)) < 5000
    assert "wrong" not in METHODS


def test_arrays_of_single_precision_count_with_their_own_digits():
    assert (
        tableau(
            "single", np.array([[0, 0], [1 / 3, 0]], np.float32), np.array([-0.5, 1.5], np.float32)
        ).order
        == 2
    )


def test_published_digits_hold_to_their_precision():
    text = "0 |\n0.66666666666667 | 0.66666666666667\n--+--\n | 1/4 3/4"
    assert tableau_order(text) == 2
    with pytest.warns(
        RuntimeWarning,
        match="order 1; with exact numbers in place of decimals of 6 digits it has order 2",
    ):
        assert tableau_order(text.replace("0.66666666666667", "0.666666")) == 1


def test_a_refusal_that_follows_from_rounding_names_the_order_with_exact_numbers():
    """Kutta's method of order 3 has the weights 1/6, 2/3, 1/6, whose four digits add up to 1.0001."""
    with pytest.raises(FvsolveError) as caught:
        tableau("kutta", "0 |\n0.5 | 0.5\n1 | -1 2\n--+--\n | 0.1667 0.6667 0.1667")
    assert (
        "weights add up to 10001/10000; expected 1; with exact numbers in place of decimals of 4 digits it has order 3"
        in (str(caught.value))
    )
    assert "expected fractions, or decimals of 7 digits or more" in str(caught.value)


@pytest.mark.parametrize(
    "row, weights", [("0.5 | 0.5", "0.25 0.75"), ("0.67 | 0.67", "0.25 0.75"), ("1/3 | 1/3", "1 0")]
)
def test_short_decimals_and_low_orders_give_no_warning(row, weights):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert tableau("low", f"0 |\n{row}\n--+--\n | {weights}").rounded_order is None


def test_too_few_digits_prove_no_order():
    """A tableau with entries of 1e6 and few digits has at most order 3."""
    big = "0 |\n1/2 | 1/2\n1 | -1234567.8 1234568.8\n--+--\n | 1/6 2/3 1/6"
    assert tableau_order(big) == 2


def test_a_named_number_is_the_requested_root():
    text = "g | g\n1 | 1-g g\n--+--\n | 1-g g"
    for near in (0.29, 1.7):
        m = tableau("user", text, numbers={"g": ("x^2-2x+1/2", near)})
        assert m.order == 2 and m.a[0, 0] == pytest.approx(near, abs=0.01)


@pytest.mark.parametrize(
    "polynomial, near, wanted",
    [
        ("x+1", 1.0, "not a polynomial in x of degree 2 or more with rational coefficients"),
        ("x^2+y", 1.0, 'unknown symbol "y"'),
        ("x^2+1", 1.0, "no single root near 1"),
    ],
)
def test_a_named_number_that_is_none_is_refused(polynomial, near, wanted):
    with pytest.raises(FvsolveError, match=wanted.replace("(", r"\(")):
        tableau("user", "g | g\n--+--\n | 1", numbers={"g": (polynomial, near)})


def test_a_missing_first_row_and_a_file_in_place_of_a_name_have_a_remedy():
    with pytest.raises(FvsolveError, match="is the first row `0 |` missing"):
        tableau("wrong", "1/2 | 1/2\n--+--\n | 0 1")
    with pytest.raises(FvsolveError, match="For a file: fvsolve.tableau"):
        method_named("heun3.txt")
