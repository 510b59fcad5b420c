"""Courant limits of linear advection on a uniform grid: closed forms, exact steps of exact waves, random schemes."""

import json
import math
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import Phase, given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference import folders

from fvsolve.cli import main
from fvsolve.core.step_limits.advection_limit import (
    advection_limit,
    advection_limits,
    growth_of,
    limit_of,
    negative_point,
    polynomial_value,
)
from fvsolve.core.step_limits.symbol import WEIGHTS, real_part, square, symbol, weights_of
from fvsolve.core.steppers import METHODS, analyse, method_named
from fvsolve.core.steppers.tableau import tableau
from fvsolve.errors import FvsolveError

EXPLICIT = [name for name, one in METHODS.items() if name == one.name and one.explicit]
IMPLICIT = [name for name, one in METHODS.items() if name == one.name and not one.explicit]
# R(s)
DISTINCT = [
    "euler",
    "ssp-rk2",
    "ssp-rk3",
    "rk4",
    "dormand-prince",
    "ssp-rk10-4",
    "tsitouras",
    "verner-7",
]
RK3_REAL = 2.5127453266183286  # 1 + q - 1 / q, q^3 = 4 + sqrt(17)
KNOWN = [
    ("upwind", "euler", 1.0),
    ("upwind", "ssp-rk2", 1.0),
    ("upwind", "heun", RK3_REAL / 2),
    ("upwind", "rk4", 2.785293563405282 / 2),
    ("upwind", "ssp-rk10-4", 6.0),  # equals its SSP radius
    ("linear-upwind", "ssp-rk2", 0.5),
    ("linear-upwind", "rk4", 2.785293563405282 / 4),
    ("fromm", "ssp-rk2", 1.0),
    # nu^3 = 8 alpha, Re z = -alpha theta^4 + ..., alpha = 1/12
    ("upwind3", "ssp-rk2", (2 / 3) ** (1 / 3)),
    ("central", "ssp-rk3", math.sqrt(3)),
    ("central", "rk4", 2 * math.sqrt(2)),
]
down = (Fraction(0), Fraction(0), Fraction(0), Fraction(1), Fraction(0))


@pytest.mark.parametrize("scheme, method, limit", KNOWN)
def test_limits_that_are_known_in_closed_form(scheme, method, limit):
    assert advection_limit(scheme, method).limit == pytest.approx(limit, rel=1e-10)


@pytest.mark.parametrize("scheme, limit", [("upwind3", 1.626), ("upwind5", 1.435)])
def test_limits_of_the_third_order_method_are_those_of_the_literature(scheme, limit):
    """Wang and Spiteri 2007; Motamed, Macdonald and Ruuth 2011: 1.43 for the linear scheme of WENO5 with SSP-RK3."""
    assert advection_limit(scheme, "ssp-rk3").limit == pytest.approx(limit, abs=1e-3)


@pytest.mark.parametrize("method", EXPLICIT)
def test_central_differences_are_limited_by_the_imaginary_interval(method):
    """With z = -i sin(theta) the limit is the imaginary stability interval, computed by another algorithm."""
    found = advection_limit("central", method)
    assert found.limit == pytest.approx(analyse(method).imaginary_interval, rel=1e-11)
    if found.limit > 0:
        assert (found.wave, found.theta) == ("between", pytest.approx(math.pi / 2, abs=1e-6))


@pytest.mark.parametrize("scheme", [name for name in WEIGHTS if name != "upwind"])
def test_euler_steps_grow_at_any_size_but_with_upwind(scheme):
    found = advection_limit(scheme, "euler")
    assert (found.limit, found.stable, found.wave, found.proved) == (0.0, (), "grows", True)
    assert found.growth > 0.08


@pytest.mark.parametrize("scheme", WEIGHTS)
def test_no_method_that_is_a_stable_has_a_limit(scheme):
    for method in IMPLICIT:
        found = advection_limit(scheme, method)
        assert (
            analyse(method).a_stable
            and found.limit == math.inf
            and found.stable == ((0.0, math.inf),)
        )
        assert found.wave is None and found.growth is None


def test_every_answer_is_proved():
    found = advection_limits()
    assert len(found) >= len(WEIGHTS) * (len(EXPLICIT) + len(IMPLICIT))
    assert all(one.proved for one in found)


def test_some_limits_are_set_by_the_longest_waves_and_no_short_run_shows_them():
    found = {(one.scheme, one.method): one for one in advection_limits(None, DISTINCT)}
    longest = {pair for pair, one in found.items() if one.wave == "longest"}
    assert longest == {("fromm", "ssp-rk2"), ("upwind3", "ssp-rk2")}
    slow = found["upwind3", "ssp-rk2"]  # at 1 % above the limit
    assert slow.theta == 0.0 and 0 < slow.growth < 1e-5 and slow.steps > 1e6
    hidden = found["central", "verner-7"]  # at Courant number 1/2
    assert hidden.limit == 0.0 and 0 < hidden.growth < 1e-8 and hidden.steps > 1e9
    # |R|^2 - 1 is of order theta^4, the damping of order theta^6
    assert found["upwind5", "ssp-rk2"].limit == 0.0


def phase(u: Fraction) -> tuple[Fraction, Fraction]:
    """Cosine and sine of 2 arctan(u), as fractions."""
    return (1 - u * u) / (1 + u * u), 2 * u / (1 + u * u)


def times(a, b):
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def stepped(weights, method, courant: Fraction, u: Fraction) -> Fraction:
    """|y1|^2 after one step of y' = nu z(theta) y from y = 1 by the tableau of an explicit method, in fractions."""
    c, s = phase(u)
    power, terms = (Fraction(1), Fraction(0)), []
    for _ in range(2):
        power = times(power, (c, -s))
    for w in weights:  # exp(i (k - 2) theta)
        terms.append((w * power[0], w * power[1]))
        power = times(power, (c, s))
    face = sum(x for x, _ in terms), sum(y for _, y in terms)
    z = times((-(1 - c), -s), face)
    z = courant * z[0], courant * z[1]
    array, slopes = method_named(method).exact, []
    for row in (*array.a, array.b):
        y = (
            1 + sum((a * k[0] for a, k in zip(row, slopes, strict=False)), Fraction(0)),
            sum((a * k[1] for a, k in zip(row, slopes, strict=False)), Fraction(0)),
        )
        slopes.append(times(z, y))
    return y[0] ** 2 + y[1] ** 2


@pytest.mark.in_turn
@pytest.mark.parametrize("method", DISTINCT)
@pytest.mark.parametrize("scheme", WEIGHTS)
def test_exact_steps_of_exact_waves_do_not_grow_below_the_limit_and_a_wave_does_above(
    scheme, method
):
    found, weights = advection_limit(scheme, method), weights_of(scheme)
    slack = Fraction(1, 10**35) if found.digits else 0  # for rounded published digits
    near = Fraction(math.tan(min(found.theta, 3.1) / 2)).limit_denominator(4096)
    waves = {Fraction(k, 16) for k in range(1, 33)} | {Fraction(1, 2**k) for k in range(5, 22)}
    waves |= {near * Fraction(100 + k, 100) for k in range(-10, 11)} | {
        Fraction(k) for k in (3, 5, 10, 100, 10**4)
    }
    if found.limit:
        below = Fraction(found.limit) * (1 - Fraction(1, 10**6))
        for courant in (below, below / 2, below / 16):
            assert all(stepped(weights, method, courant, u) <= 1 + slack for u in waves if u > 0)
    close = (
        Fraction(math.tan(min(found.theta, math.pi - 1e-7) / 2))
        if found.limit and found.theta
        else near
    )
    above = Fraction(found.limit) * (1 + Fraction(1, 10**6)) or Fraction(1, 1000)
    least = 1 + slack
    assert any(
        stepped(weights, method, above, u) > least for u in {close} | {u for u in waves if u > 0}
    )


@pytest.mark.parametrize("scheme", WEIGHTS)
def test_the_symbol_is_that_of_the_compiled_weights(scheme):
    theta = np.linspace(0, np.pi, 41)
    t = np.sin(theta / 2) ** 2
    z = symbol(weights_of(scheme), theta)
    for polynomial, wanted in ((real_part, z.real), (square, np.abs(z) ** 2)):
        p = polynomial(weights_of(scheme))
        assert [float(p(Fraction(x))) for x in t] == pytest.approx(wanted, abs=1e-13)
    assert symbol(weights_of(scheme), 1e-4) == pytest.approx(-1e-4j, abs=1e-8)  # consistent


# ---- stability above a Courant number


def test_downwind_differences_with_implicit_euler_are_stable_from_1_on():
    """|1 - nu z|^2 - 1 = 2 nu (nu - 1)(1 - cos theta), so implicit Euler is stable from nu = 1 on."""
    found = limit_of(down, "downwind", "implicit-euler")
    assert (
        found.limit == 0.0
        and found.stable == ((pytest.approx(1.0, rel=1e-11), math.inf),)
        and found.proved
    )


@pytest.mark.parametrize("method", ["trapezoid", "gauss-4", "radau-iia-5", "rk4", "alexander-2"])
def test_downwind_differences_grow_at_every_step_with_all_others(method):
    assert limit_of(down, "downwind", method).stable == ()


@pytest.fixture
def less_implicit():
    """Name of the theta method with theta = 2/5, which is not A-stable."""
    return tableau("theta-2-5", "0 | 0 0\n 1 | 3/5 2/5\n ---\n | 3/5 2/5").name


def test_an_implicit_method_that_is_not_a_stable_has_a_limit(less_implicit):
    """The limit with upwind is 1 / (1 - 2 theta); with central differences |R(iy)| > 1 for all y."""
    found = advection_limit("upwind", less_implicit)
    assert found.limit == pytest.approx(5.0, rel=1e-11) and found.proved
    assert advection_limit("central", less_implicit).stable == ()


def brute(weights, method, courant: float) -> float:
    """Greatest |R|^2 - 1 on sampled waves in extended precision."""
    r = analyse(method).stability_function
    theta = np.concatenate([np.geomspace(1e-4, 0.05, 60), np.linspace(0.05, np.pi, 3000)])
    wave = np.exp(1j * theta.astype(np.longdouble))
    z = -(1 - 1 / wave) * sum(
        np.longdouble(w.numerator) / w.denominator * wave ** (k - 2) for k, w in enumerate(weights)
    )
    up, down = (
        [np.longdouble(x.numerator) / x.denominator for x in p.coefficients]
        for p in (r.numerator, r.denominator)
    )
    s = np.longdouble(courant) * z
    over, under = (sum(x * s**k for k, x in enumerate(one)) for one in (up, down))
    return float((np.abs(over) ** 2 / np.abs(under) ** 2).max() - 1)


numbers = st.integers(-12, 12).map(lambda n: Fraction(n, 12))
METHODS_FOR_ANY = [
    "euler",
    "ssp-rk2",
    "rk4",
    "dormand-prince",
    "implicit-euler",
    "radau-iia-3",
    "lobatto-iiic-2",
]


@examples(40, phases=[Phase.generate])
@given(st.tuples(numbers, numbers, numbers, numbers), st.sampled_from(METHODS_FOR_ANY))
def test_ranges_of_any_weights_are_those_that_sampling_shows(four, method):
    weights = (*four[:2], 1 - sum(four), *four[2:])
    found = limit_of(weights, "any", method)
    if not found.proved:
        return  # the result states this
    edges = [x for pair in found.stable for x in pair]
    for low, high in found.stable:
        top = high if math.isfinite(high) else 10 * low + 10
        for part in (0.001, 0.3, 0.7, 0.999):
            assert brute(weights, method, low + part * (top - low)) <= 1e-15
    outside = [0.01, 0.1, 0.5, 1.3, 2.7, 6.1, 20.0] + [
        x * f for x in edges if 0 < x < math.inf for f in (0.97, 1.03)
    ]
    for courant in outside:
        if not any(low <= courant <= high for low, high in found.stable):
            assert brute(weights, method, courant) > 0


# ---- signs of polynomials


def test_a_square_that_touches_zero_at_a_corner_is_not_negative():
    # (x - y)^2
    assert negative_point([[0, 0, 1], [0, -2, 0], [1, 0, 0]], Fraction(0), Fraction(1)) in (
        None,
        "open",
    )
    assert negative_point([[0, 1], [1, 0]], Fraction(0), Fraction(3)) is None  # x + y


@examples(60)
@given(
    st.lists(st.lists(st.integers(-5, 5), min_size=4, max_size=4), min_size=3, max_size=4),
    st.integers(0, 40),
)
def test_a_located_point_is_negative_and_where_none_is_located_none_exists(g, lift):
    g = [list(row) for row in g]
    g[0][0] += lift
    found = negative_point(g, Fraction(0), Fraction(2))
    if isinstance(found, tuple):
        assert polynomial_value(g, *found) < 0
    elif found is None:
        x, y = np.meshgrid(np.linspace(0, 2, 81), np.linspace(0, 1, 81), indexing="ij")
        assert np.polynomial.polynomial.polyval2d(x, y, np.array(g, float)).min() > -1e-9


# ---- output and pages


@pytest.fixture
def command_in_folder(monkeypatch, capsys, tmp_path):
    """Function that runs a command in an empty directory and returns exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fvsolve", *words])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        found = capsys.readouterr()
        return code, found.out, found.err

    return run


def test_the_table_has_every_scheme_and_every_method(command_in_folder):
    code, out, _ = command_in_folder("stability")
    assert code == 0
    assert all(name in out for name in (*WEIGHTS, *EXPLICIT, *IMPLICIT))
    row = next(line.split() for line in out.splitlines() if line.startswith("ssp-rk2"))
    assert row[1:3] == ["1.0000000", "s"] and "0.8735805" in row and row.count("none") == 2


def test_json_equals_the_result_of_python(command_in_folder):
    code, out, _ = command_in_folder(
        "stability", "--scheme", "upwind3,central", "--method", "ssp-rk3,gauss-4", "--json"
    )
    found = json.loads(out)
    assert code == 0 and found.keys() == {"limits", "measured", "limited"}
    assert found["limits"] == json.loads(
        json.dumps(
            [
                one.plain()
                for one in advection_limits(["upwind3", "central"], ["ssp-rk3", "gauss-4"])
            ]
        )
    )
    assert [one["limit"] for one in found["limits"]][2:] == [None, None]


def test_a_single_pair_is_explained(command_in_folder):
    _, out, _ = command_in_folder("stability", "--scheme", "upwind3", "--method", "ssp-rk2")
    assert (
        "0.8735804647" in out
        and "longest waves" in out
        and "thousandfold in 1.137e+06 steps" in out
    )
    _, out, _ = command_in_folder("stability", "--scheme", "upwind3", "--method", "gauss-4")
    assert "stable at every Courant number" in out
    _, out, _ = command_in_folder("stability", "--scheme", "central", "--method", "euler")
    assert "grows at every step" in out


@pytest.mark.parametrize(
    "words, wanted",
    [
        (("--scheme", "upwid"), 'did you mean "upwind"'),
        (("--method", "rk44"), 'did you mean "rk4"'),
        (("--scheme", "muscl", "--method", "gauss-4"), "gauss-4 is implicit"),
        (("--cells", "2"), "expected 6 or more"),
        (("--courant", "-1"), "expected a positive number"),
        (("--steps", "1"), "expected 10 or more"),
    ],
)
def test_impossible_requests_are_refused(command_in_folder, words, wanted):
    code, out, err = command_in_folder("stability", *words)
    assert (code, out) == (2, "") and wanted in err


def test_a_scheme_without_fixed_weights_has_no_exact_limit():
    with pytest.raises(FvsolveError, match="not linear and has no exact limit"):
        advection_limit("weno5", "rk4")


@pytest.mark.parametrize("courant", [0.1, 0.3, 1.7])
def test_growth_is_quoted_on_request(courant, command_in_folder):
    """The growth at a given Courant number is stated; Euler with central differences has |R(iy)|^2 = 1 + nu^2."""
    one = advection_limit("central", "euler", courant)
    assert one.courant == courant and one.growth == pytest.approx(
        math.hypot(1, courant) - 1, rel=1e-12
    )
    assert one.steps == pytest.approx(math.log(1e3) / math.log(math.hypot(1, courant)), rel=1e-9)
    for scheme, method in (("central", "rk4"), ("upwind5", "gauss-4")):
        still = advection_limit(scheme, method, courant)
        assert still.growth == 0.0 and still.steps is None
    _, out, _ = command_in_folder(
        "stability", "--scheme", "upwind5", "--method", "gauss-4", "--courant", str(courant)
    )
    assert f"at Courant number {courant:g} no wave grows" in out


@pytest.mark.parametrize("courant", [0.5, 0.1, 0.01])
def test_growth_below_rounding_is_seen(courant):
    """Growth below the rounding error is computed, with y = nu sin(theta) for central differences.

    SSP-RK2 has |R(iy)|^2 = 1 + y^4 / 4; verner-7 has 1 + C y^8 + ...
    """
    growth, theta = growth_of(weights_of("central"), "ssp-rk2", courant)
    assert growth == pytest.approx(math.expm1(0.5 * math.log1p(courant**4 / 4)), rel=1e-7)
    assert theta == pytest.approx(math.pi / 2, abs=1e-3)
    least, _ = growth_of(weights_of("central"), "verner-7", courant / 10)
    less, _ = growth_of(weights_of("central"), "verner-7", courant / 20)
    assert least > 0 and least / less == pytest.approx(2**8, rel=0.02)


def test_growth_a_step_is_the_greatest_amplification():
    growth, theta = growth_of(weights_of("central"), "euler", 0.5)
    assert growth == pytest.approx(math.sqrt(1.25) - 1, rel=1e-12) and theta == pytest.approx(
        math.pi / 2, abs=1e-6
    )


def test_the_page_shows_computed_values():
    """The first table of docs/stability.md contains the computed limits, and the letters of their waves."""
    page = folders.section("stability", "Uniform periodic grid")
    rows = [
        line.strip("| ").split(" | ")
        for line in page.split("### Runs on")[0].splitlines()
        if line.startswith("| `")
    ]
    shown = {name.strip("` "): row[1:] for row in rows for name in row[0].split(",")}
    assert sorted(shown) == sorted(EXPLICIT)
    for name, cells in shown.items():
        for scheme, cell in zip(WEIGHTS, cells, strict=True):
            one = advection_limit(scheme, name)
            assert cell == (f"{one.limit:.7f} {one.wave[0]}" if one.limit else "none"), (
                scheme,
                name,
            )


def test_all_keys_of_a_limit_are_on_the_page():
    page = folders.section("stability", "Uniform periodic grid")
    assert all(f"`{key}`" in page for key in advection_limit("upwind", "euler").plain())


@pytest.mark.parametrize(
    "numerics, word",
    [
        (("scheme=upwind5", "method=rk4", "courant=1.7"), None),
        (
            ("scheme=upwind5", "method=rk4", "courant=1.8"),
            "the limit is 1.70313 with reflections at the ends of this pipe of 200 cells",
        ),
        (("scheme=central", "method=euler", "courant=0.1"), "waves grow at every Courant number"),
        (("scheme=weno5", "method=ssp-rk3", "step=20 ms"), "which equals upwind5 here"),
        (("scheme=upwind", "method=implicit-euler", "courant=20"), None),
    ],
)
def test_check_warns_of_a_courant_number_beyond_the_limit(fvs, numerics, word):
    words = [part for one in numerics for part in ("--set", f"numerics.{one}")]
    warnings = json.loads(fvs("check", "valve-closure", *words, "--json")[1])["warnings"]
    found = [one["text"] for one in warnings if one["kind"] == "step-limit"]
    assert len(found) == (word is not None) and all(word in text for text in found)
