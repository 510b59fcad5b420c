"""`fvsolve response`: ports of cases against closed forms, and verdicts that depend on the scheme."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from pytest import approx
from reference.scenes import NO_FRICTION, RHO, area, junction, lake, pipe, reservoir, scene

from fvsolve.errors import FvsolveError
from fvsolve.studies import (
    LineImpedance,
    Transfer,
    line_positive_real,
    positive_real,
    response,
    state_positive_real,
    sweep_positive_real,
)

BETA, VOLUME, HOLE, CD = 1.5e9, 0.02, 1e-6, 0.61
OIL = {"name": "user", "density": 870.0, "bulk_modulus": BETA, "viscosity": 0.03, "law": "linear"}


def bottle():
    """Case of a chamber filled through an orifice at a drop of 100 bar."""
    nodes = {
        "pump": reservoir(101e5),
        "bottle": {"type": "chamber", "volume": VOLUME, "initial_pressure": 1e5},
    }
    hole = {
        "type": "orifice",
        "from": "pump",
        "to": "bottle",
        "area": HOLE,
        "discharge_coefficient": CD,
    }
    return scene(nodes, {"hole": hole}, 1.0, {"method": "dormand-prince", "rtol": 1e-8}, fluid=OIL)


RESISTANCE = 2.0 * 100e5 / (CD * HOLE * math.sqrt(2.0 * 100e5 / 870.0))  # d dp / dq = 2 dp / q
CAPACITY = VOLUME / BETA
W = np.array([1e-3, 0.1, 0.3, 1.0, 10.0])


def test_chamber_and_orifice_are_a_resistance_and_a_capacity():
    seen, fed = response(bottle(), "pump"), response(bottle(), "bottle")
    s = 1j * W
    assert np.allclose(seen(s), CAPACITY * s / (1.0 + RESISTANCE * CAPACITY * s), rtol=1e-7)
    assert np.allclose(fed(s), RESISTANCE / (1.0 + RESISTANCE * CAPACITY * s), rtol=1e-7)
    assert (seen.kind, fed.kind) == ("admittance", "impedance")
    assert seen.verdict.answer == fed.verdict.answer == "yes"
    assert positive_real([CAPACITY, 0], [RESISTANCE * CAPACITY, 1]) and positive_real(
        [RESISTANCE], [1, 1]
    )


WAVE, LENGTH, DIAMETER, CELLS = 1000.0, 1000.0, 0.5, 30


def response_of_line(scheme, port="gate", cells=CELLS, reverse=False, instead=None):
    """Response of a lossless pipe between a reservoir and a dead end."""
    ends = ("gate", "lake") if reverse else ("lake", "gate")
    pipe = {
        "type": "pipe",
        "from": ends[0],
        "to": ends[1],
        "length": LENGTH,
        "diameter": DIAMETER,
        "wave_speed": WAVE,
        "cells": cells,
        "friction": NO_FRICTION,
    }
    case = scene(
        {"lake": reservoir(1e6), "gate": junction()},
        {"main": pipe},
        1.0,
        {"scheme": scheme, "method": "rk4"},
    )
    return response(case, port, scheme=instead)


Z0 = RHO * WAVE / area(DIAMETER)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_lossless_line_is_its_closed_form(reverse):
    s = 1j * np.array([0.2, 0.9, 1.4, 2.1, 3.0])
    open_, closed = LineImpedance(Z0, LENGTH / WAVE, -1.0), LineImpedance(Z0, LENGTH / WAVE, 1.0)
    assert np.allclose(response_of_line("upwind5", "gate", reverse=reverse)(s), open_(s), rtol=2e-5)
    assert np.allclose(
        response_of_line("upwind5", "lake", reverse=reverse)(s), 1.0 / closed(s), rtol=2e-5
    )


def test_upwind_biased_lines_are_positive_real_or_on_the_boundary_and_upwind_beyond_doubt():
    for port in ("gate", "lake"):
        assert response_of_line("upwind", port).verdict.answer == "yes"
        for scheme in ("fromm", "upwind3", "upwind5"):
            found = response_of_line(scheme, port).verdict
            assert found.positive_real in (True, None) and -1e-9 < found.margin < 1e-7, found.reason


def test_central_differences_break_positive_realness_as_a_direct_solve_confirms():
    found = response_of_line("central")
    dip = found.verdict.dips[0]
    assert found.verdict.answer == "no" and dip.angle < -1e-5
    direct = found.d + found.c @ np.linalg.solve(
        1j * dip.worst * np.eye(len(found.b)) - found.a, found.b.astype(complex)
    )
    assert direct.real == approx(dip.real, rel=1e-6) and direct.real < -1e-5 * abs(direct)


def test_friction_moves_a_line_off_the_boundary():
    pipe = {
        "type": "pipe",
        "from": "lake",
        "to": "gate",
        "length": LENGTH,
        "diameter": DIAMETER,
        "wave_speed": WAVE,
        "cells": CELLS,
        "friction": {"model": "steady", "factor": 0.02},
    }
    valve = {"type": "valve", "from": "gate", "to": "out", "area": 0.01, "opening": 1.0}
    nodes = {"lake": reservoir(1e6), "gate": junction(), "out": reservoir(2e5)}
    case = scene(nodes, {"main": pipe, "valve": valve}, 1.0, {"scheme": "upwind5", "method": "rk4"})
    assert response(case, "gate").verdict.margin > 1e-3
    # s -> 0: pipe and valve in parallel, each d dp / dq = 2 dp / q
    friction, loss = (
        0.02 * LENGTH / DIAMETER * RHO / (2.0 * area(DIAMETER) ** 2),
        RHO / (2.0 * (0.61 * 0.01) ** 2),
    )
    q = math.sqrt(8e5 / (friction + loss))
    assert response(case, "gate")(0.0).real == approx(
        1.0 / (1.0 / (2 * friction * q) + 1.0 / (2 * loss * q)), rel=1e-6
    )


def test_ports_that_are_none_and_cases_that_are_too_large_are_refused():
    with pytest.raises(FvsolveError, match='no port named "gat"; did you mean "gate"'):
        response_of_line("upwind", "gat")
    pool = {"type": "basin", "size": [10.0, 1.0], "cells": [5, 1], "level": 1.0, "elevation": 0.0}
    pool |= {"patches": {"up": {"side": "west", "discharge": 0.0}}}
    with pytest.raises(FvsolveError, match=r"pool\.up joins no link.*linearise"):
        response(scene({"pool": pool}, {}, 1.0, {"scheme": "upwind", "method": "rk4"}), "pool.up")
    with pytest.raises(FvsolveError, match="900 states.*fewer"):
        response_of_line("upwind", cells=450)
    with pytest.raises(FvsolveError, match="limited"):
        response_of_line("muscl")
    assert response_of_line("muscl", instead="fromm").scheme == "fromm"


def test_the_command_prints_a_single_object_and_leaves_table_and_pictures(tmp_path, fvs):
    code, out, _ = fvs(
        "response", "chamber-and-orifice", "--port", "bottle", "--json", "--out", tmp_path
    )
    assert code == 0
    said = json.loads(out)
    assert (
        said["verdict"]["answer"] == "yes" and said["kind"] == "impedance" and len(said["A"]) == 1
    )
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"bottle.response.{ending}" for ending in ("csv", "npz", "png", "svg")}
    rows = (tmp_path / "bottle.response.csv").read_text().splitlines()
    assert (
        rows[0].startswith("frequency [Hz],w [rad/s],real")
        and len(rows) == len(said["frequency"]) + 1
    )


def test_central_differences_are_not_positive_real_however_fine_the_cells():
    firsts, worst = [], []
    for cells in (20, 40):
        nodes = {"top": lake(50.0), "end": junction()}
        made = scene(
            nodes, {"p": pipe("top", "end", 600.0, 0.5, 1200.0, cells)}, 1.0, {"scheme": "central"}
        )
        found = response(made, "top")
        a, eye = found.a, np.eye(len(found.a))
        w = max(found.verdict.dips, key=lambda dip: -dip.angle).worst
        h = found.d + found.c @ np.linalg.solve(1j * w * eye - a, found.b)
        firsts.append(found.verdict.dips[0].angle)
        worst.append(h.real / abs(h))
    assert firsts == pytest.approx([-9.1e-4, -1.146e-4], rel=0.02) and max(worst) < -0.25


# ----------------------------------------------------------------------------------------------------------------------
# State spaces in floats agree with the exact verdict where they decide, and sweeps of lines have a valid bound.


def companion(n, d):
    """State space A, b, c, d of a proper rational function, highest power first, without SciPy's scaling."""
    n, d = np.trim_zeros(np.asarray(n, float), "f"), np.asarray(d, float)
    order = len(d) - 1
    n = np.concatenate([np.zeros(order + 1 - len(n)), n]) / d[0]
    d = d / d[0]
    a = np.zeros((order, order))
    if order:
        a[0], a[1:, :-1] = -d[1:], np.eye(order - 1)
    b = np.zeros(order)
    b[:1] = 1.0
    return Transfer(a, b, n[1:] - n[0] * d[1:], n[0])


def verdict(n, d):
    return state_positive_real(companion(n, d))


def test_a_transfer_function_is_the_result_of_a_direct_solve():
    rng = np.random.default_rng(3)
    a, b, c = (
        rng.normal(size=(9, 9)) * 10.0 ** rng.integers(-3, 3, (9, 1)),
        rng.normal(size=9),
        rng.normal(size=9),
    )
    h = Transfer(a, b, c, 0.7)
    for s in (0.3, 2j, -1 + 5j, 1e3j):
        assert h(s)[0] == approx(
            0.7 + c @ np.linalg.solve(s * np.eye(9) - a, b.astype(complex)), rel=1e-9
        )
    parts = 0.7 + np.sum(h.residues / (2j - h.poles))
    assert h(2j)[0] == approx(parts, rel=1e-9)


@pytest.mark.parametrize(
    "n, d",
    [
        ([1, 2], [1, 1]),
        ([3], [1]),
        ([1, 3], [1, 3, 2]),
        ([1, 0], [1, 1]),
        ([1, 1], [1, 0]),
        ([1, 1.000001, 1], [1, 1, 1]),
    ],
)
def test_functions_positive_real_beyond_doubt_are_reported_as_such(n, d):
    assert verdict(n, d).answer == "yes"


@pytest.mark.parametrize(
    "n, d",
    [
        ([1], [1, 2, 1]), ([1], [1, 0, 0]), ([-1, 0], [1, 0, 1]), ([1], [1, 0, 1]), ([1, 0], [1, 0, 2, 0, 1]),
        ([-1], [1]), ([-1], [1, 0, 0]), ([-2], [1, -1, 0]), ([1], [1, -1]), ([-1], [1, 0]), ([1, 4], [1, 3, 2]),
        ([1, 1], [1, 0, -1]), ([1, 1], [1, 0, 0]),
    ],
)  # fmt: skip
def test_functions_that_are_not_are_reported_as_such(n, d):
    assert verdict(n, d).answer == "no"


@pytest.mark.parametrize(
    "n, d", [([1], [1, 0]), ([1, 0], [1, 0, 1]), ([1, 0, 1], [1, 0, 4, 0]), ([1, 1, 1], [1, 1, 4])]
)
def test_the_boundary_is_called_undecided(n, d):
    found = verdict(n, d)
    assert found.answer == "undecided within 1e-09" and abs(found.margin) < 1e-9
    assert "at the limit of positive realness" in found.reason


def test_a_narrow_band_is_located_without_a_grid():
    # roots of E(x) = x^2 - (b0 + 3) x + 4 b0 with b0 = 1 - 1e-6
    b0 = 1.0 - 1e-6
    found = verdict([1, 1, b0], [1, 1, 4])
    x = np.sort(np.roots([1, -(b0 + 3), 4 * b0]))
    (dip,) = found.dips
    assert (dip.low, dip.high) == (
        approx(math.sqrt(x[0]), rel=1e-9),
        approx(math.sqrt(x[1]), rel=1e-9),
    )
    assert found.positive_real is False and verdict([1, 1, 2 - b0], [1, 1, 4]).positive_real is True


def test_a_narrow_band_of_a_stiff_system_with_a_quick_pole():
    # plus a lag of 1e7 1/s with real part 1e-9, which is less than the dip of 5e-7
    n = np.polyadd(np.polymul([1, 1, 1 - 1e-6], [1e-7, 1]), np.polymul([1e-9], [1, 1, 4]))
    found = verdict(n, np.polymul([1, 1, 4], [1e-7, 1]))
    assert found.positive_real is False and found.dips[0].low < math.sqrt(2) < found.dips[0].high


def test_hidden_unstable_poles_are_reported():
    a = np.diag([-1.0, 2.0])
    found = state_positive_real(Transfer(a, np.array([1.0, 0.0]), np.array([1.0, 1.0]), 0.0))
    assert found.positive_real and found.hidden == (approx(2.0),) and "hidden" in found.reason
    seen = state_positive_real(Transfer(a, np.array([1.0, 0.1]), np.array([1.0, 1.0]), 0.0))
    assert seen.positive_real is False and seen.unstable == (approx(2.0),)


@examples(150)
@given(
    st.lists(st.integers(-4, 6), min_size=1, max_size=5),
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=2, unique=True),
)
def test_where_floats_decide_they_agree_with_exact_arithmetic(n, pairs):
    d = np.array([1])
    for a, b in pairs:
        d = np.polymul(d, [1, 2 * a, a * a + b * b])
    n = n[-len(d) :]
    found, exact = verdict(n, d), positive_real([int(x) for x in n], [int(x) for x in d])
    assert found.positive_real in (None, exact.positive_real), (found.reason, exact.reason)


# lines ----------------------------------------------------------------------------------------------------------

Z_LINE, T = 2.0e6, 0.75


@pytest.mark.parametrize("reflection", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_lossless_line_is_positive_real_whatever_passive_end_it_has(reflection):
    found = line_positive_real(LineImpedance(Z_LINE, T, reflection))
    u = abs(reflection) * math.exp(-2e-3)
    exact = Z_LINE * (1.0 - u) / (1.0 + u)  # the least of Z_LINE (1 - u^2) / |1 - g e|^2
    assert (
        found.positive_real is True
        and found.least == approx(exact, rel=1e-9)
        and 0.0 <= found.floor <= exact
    )


def test_the_closed_forms_of_open_and_closed_ends():
    s = np.array([0.1 + 1j, 2.0, 0.01 + 7j])
    assert np.allclose(LineImpedance(Z_LINE, T, -1.0)(s), Z_LINE * np.tanh(s * T), rtol=1e-12)
    assert np.allclose(LineImpedance(Z_LINE, T, 1.0)(s), Z_LINE / np.tanh(s * T), rtol=1e-12)
    resistance = 5.0e6
    ended = Z_LINE * (resistance + Z_LINE * np.tanh(s * T)) / (Z_LINE + resistance * np.tanh(s * T))
    assert np.allclose(
        LineImpedance(Z_LINE, T, (resistance - Z_LINE) / (resistance + Z_LINE))(s),
        ended,
        rtol=1e-12,
    )


def test_a_line_that_ends_in_a_negative_resistance_is_not_positive_real():
    for resistance in (-0.5 * Z_LINE, -3.0 * Z_LINE):
        found = line_positive_real(
            LineImpedance(Z_LINE, T, (resistance - Z_LINE) / (resistance + Z_LINE))
        )
        assert found.positive_real is False and "a pole with Re s" in found.reason


def test_a_line_on_its_lossless_axis_must_be_evaluated_right_of_its_poles():
    for reflection in (-1.0, 1.0):
        with pytest.raises(FvsolveError, match="greater shift|right of its poles"):
            line_positive_real(LineImpedance(Z_LINE, T, reflection), shift=0.0)


@examples(60)
@given(st.floats(-1, 1), st.floats(1e-3, 1), st.floats(0, 10), st.floats(1e-3, 3))
def test_the_bound_of_the_slope_holds_between_any_two_frequencies(g, shift, low, width):
    line = LineImpedance(1.0, 1.0, g)
    w = np.linspace(low, low + width, 50)
    steepest = np.max(np.abs(np.diff(line(shift + 1j * w))) / np.diff(w))
    assert steepest <= float(line.slope(shift, low, low + width)) * (1 + 1e-9) + 1e-10


def test_a_delayed_element_is_not_positive_real_with_the_frequency_stated():
    found = sweep_positive_real(lambda s: np.exp(-0.3 * s), 0.3, 2.0 * math.pi / 0.3)
    assert (
        found.positive_real is False
        and np.cos(0.3 * found.worst) < 0.0
        and found.least == approx(-1.0, abs=1e-3)
    )


def test_a_delay_under_a_resistance_is_decided_a_millionth_from_the_boundary():
    period = 2.0 * math.pi / 0.3
    for excess, holds in ((1e-3, True), (-1e-6, False)):
        found = sweep_positive_real(lambda s, r=1.0 + excess: r + np.exp(-0.3 * s), 0.3, period)
        assert found.positive_real is holds, found.reason
    touching = sweep_positive_real(lambda s: 1.0 + np.exp(-0.3 * s), 0.3, period)
    assert touching.positive_real is None and "undecided" in touching.reason


def test_a_negative_resistance_is_not_positive_real():
    assert sweep_positive_real(lambda s: -1.0 + 0.0 * s, 0.0, 1.0).positive_real is False


@pytest.mark.parametrize(
    "slope, high, shift", [(math.nan, 1, 0), (math.inf, 1, 0), (-1, 1, 0), (1, 0, 0), (1, 1, -1)]
)
def test_a_sweep_without_a_bound_or_a_range_is_refused(slope, high, shift):
    with pytest.raises(FvsolveError, match="expected|bounded"):
        sweep_positive_real(lambda s: s, slope, high, shift)
