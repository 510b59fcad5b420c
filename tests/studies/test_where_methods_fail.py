"""Failures of methods in time: each failure occurs where it is predicted, and its remedy removes it.

The sections of docs/where-methods-fail.md name these tests. Tests of pipes are in
studies/test_where_methods_fail_in_pipes.py.
"""

import math
import re
import shlex
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from reference import folders
from reference.folders import CASES
from reference.lossless_pipes import LENGTH, SPEED, courant_limit, lossless, scaled
from reference.scenes import AMBIENT, RHO, WATER, chamber, ramp, reservoir, scene, step, tank, valve

import fvsolve
from fvsolve.case import load
from fvsolve.cli.app import load_case
from fvsolve.core.steppers import analyse, method_named, seen_frequency, stability_function
from fvsolve.errors import FvsolveError
from fvsolve.studies.failure_map import run_recorded
from fvsolve.studies.outcome import outcome, study_model


def r_of(method: str, z: complex) -> complex:
    return complex(stability_function(method_named(method))(z))


def observed_order(errors: list[float]) -> float:
    """Order from the last two errors at halved steps."""
    return math.log2(errors[-2] / errors[-1])


# a stiff chamber with an explicit method ----------------------------------------------------------------------------


def tiny(method: str, h: float, end: float, **more) -> dict:
    return {
        "numerics.scheme": "upwind",
        "numerics.method": method,
        "numerics.step": h,
        "numerics.end": end,
        "output.every": end,
        "expect": {},
        **more,
    }


def chamber_eigenvalue() -> float:
    """Eigenvalue -(beta / V) (A / (rho a) + q / (2 dp)) of pipe-tiny-chamber before its valve moves [1/s]."""
    beta, volume, density, speed = 1.5e9, 1e-6, 870.0, 1250.0
    section, drop = math.pi / 4 * 0.032**2, 20e5  # no friction: the valve has the whole drop
    flow = 0.6 * 20e-6 * math.sqrt(2 * drop / density)
    return -beta / volume * (section / (density * speed) + flow / (2 * drop))


@pytest.mark.parametrize("method", ["euler", "ssp-rk3", "rk4"])
def test_an_explicit_method_fails_at_the_step_that_the_chambers_eigenvalue_predicts(method):
    case, steps = CASES / "pipe-tiny-chamber.toml", 3000
    rate = chamber_eigenvalue()
    model = study_model(case, tiny(method, 1e-6, 1e-3))
    spectrum = np.linalg.eigvals(model.jacobian(0.0, np.zeros(model.y_size)))
    assert np.abs(spectrum).max() == pytest.approx(abs(rate), rel=2e-3)
    limit = analyse(method).real_interval / np.abs(spectrum).max()
    sizes = []
    for h in (0.99 * limit, 1.01 * limit):
        model = study_model(case, tiny(method, h, steps * h))
        y = np.zeros(model.y_size)
        at = model.state_names.index(
            next(name for name in model.state_names if name.startswith("body"))
        )
        y[at] = 1e-12 * model.scale[at]
        found = outcome(model, y=y)
        sizes.append(abs(found.y[at]) / y[at] if found.ok else math.inf)
    assert sizes[0] < 1.0 and sizes[1] > 1e3


def test_an_implicit_method_takes_the_chamber_at_a_step_hundreds_of_times_longer():
    limit = 2.0 / abs(chamber_eigenvalue())
    case = load(CASES / "pipe-tiny-chamber.toml")
    found = fvsolve.run(case, set={"numerics.step": 500 * limit})
    assert found.ok
    claims = {claim["text"]: claim for claim in found.summary["expectations"]}
    joukowsky = claims["at(body.gauge_pressure, 300 ms)"]
    assert joukowsky["found"] == pytest.approx(joukowsky["claimed"], rel=1e-4)


# A-stable without L-stable: ringing ---------------------------------------------------------------------------------


def bottle(volume: float = 1e-5) -> dict:
    """Case of a bottle of water between two valves; the second valve closes by 1e-4 at once."""
    nodes = {"pump": reservoir(1e6), "body": chamber(volume), "sump": reservoir(AMBIENT)}
    links = {
        "way-in": valve("pump", "body", 1e-5),
        "way-out": valve("body", "sump", 1e-5, step(0.5, 1.0, 0.9999)),
    }
    return scene(nodes, links, 1.0, {"method": "radau-iia-5", "step": 0.01}, ["body.pressure"], 0.1)


def swings(method: str, h: float) -> tuple[np.ndarray, float]:
    """Deviations of the pressure from its final value after each step from the jump on, and h lambda."""
    case = bottle()
    rest = outcome(case, {"numerics.end": 20.0}).rows[-1, 1]
    settings = {
        "numerics.method": method,
        "numerics.step": h,
        "numerics.end": 0.5 + 12 * h,
        "output.every": h,
    }
    found, bursts = run_recorded(case, settings)
    assert found.ok
    after = np.concatenate(bursts)[round(0.5 / h) - 1 :, 0]  # from the last step before the jump
    model = study_model(case)
    at = np.zeros(model.y_size)
    rate = model.jacobian(0.9, at)[0, 0]
    return after - rest, h * rate


@pytest.mark.parametrize("method", ["trapezoid", "implicit-midpoint"])
def test_after_a_stiff_step_an_a_stable_method_rings_by_its_r_and_an_l_stable_method_does_not(
    method,
):
    h = 0.01
    away, z = swings(method, h)
    assert z < -50.0 and r_of(method, z).real < -0.9
    ratios = away[2:8] / away[1:7]
    assert ratios == pytest.approx(r_of(method, z).real, rel=0.01) and np.all(ratios < 0)
    for remedy in ("implicit-euler", "radau-iia-5", "alexander-2"):
        assert analyse(remedy).l_stable and not analyse(method).l_stable
        away, z = swings(remedy, h)
        assert abs(away[1]) < 1.2 * max(abs(r_of(remedy, z)), 1e-3) * abs(away[0])
        assert np.all(np.abs(away[3:]) < 2e-3 * abs(away[0]))


# order reduction ----------------------------------------------------------------------------------------------------


@njit
def stiff_sine(t, y):
    return np.array([-1e6 * (y[0] - np.sin(t)) + np.cos(t)])


@njit
def mild_sine(t, y):
    return np.array([-(y[0] - np.sin(t)) + np.cos(t)])


def sine_error(f, method: str, h: float) -> float:
    t = np.linspace(0.0, 6.0, 13)
    return float(
        np.max(np.abs(fvsolve.integrate(f, [0.0], t, method, step=h)[3:, 0] - np.sin(t[3:])))
    )


@pytest.mark.parametrize(
    ("method", "left"), [("crouzeix-3", 2), ("crouzeix-4", 2), ("gauss-4", 2), ("gauss-6", 4)]
)
def test_stiffness_leaves_a_method_the_order_that_its_stage_order_allows(method, left):
    facts = analyse(method)
    # |R| = 1 at infinity: see the page
    swaps = facts.stage_order % 2 if abs(r_of(method, -1e12)) > 1 - 1e-6 else 1
    assert left == facts.stage_order + swaps
    stiff = observed_order([sine_error(stiff_sine, method, h) for h in (0.125, 0.0625)])
    assert stiff == pytest.approx(left, abs=0.2) and stiff <= facts.order - 0.8
    mild = observed_order([sine_error(mild_sine, method, h) for h in (0.125, 0.0625)])
    assert mild == pytest.approx(facts.order, abs=0.25)


def test_a_stiffly_accurate_method_of_higher_stage_order_is_a_million_times_closer():
    assert analyse("radau-iia-5").stage_order == 3 and analyse("radau-iia-5").stiffly_accurate
    assert sine_error(stiff_sine, "radau-iia-5", 0.125) < 1e-6 * sine_error(
        stiff_sine, "crouzeix-4", 0.125
    )


# aliasing -----------------------------------------------------------------------------------------------------------


def surge(method: str, h: float, steps: int) -> dict:
    """Case of a lake, a rigid column and a bottle: an undamped oscillator of two states after a jump of pressure."""
    nodes = {"lake": reservoir(step(0.0, 1e6, 1.01e6)), "body": chamber(1e-3)}
    column = {
        "type": "rigid-column",
        "from": "lake",
        "to": "body",
        "length": 10.0,
        "diameter": 0.05,
        "friction": {"model": "none"},
    }
    numerics = {"method": method, "step": h}
    return scene(nodes, {"column": column}, steps * h, numerics, ["body.pressure"], h)


def column_frequency() -> float:
    """Natural frequency omega = sqrt(beta A / (V rho L)) [rad/s]."""
    return math.sqrt(WATER["bulk_modulus"] * math.pi / 4 * 0.05**2 / (1e-3 * RHO * 10.0))


def shown_frequency(method: str, h: float) -> float:
    """Frequency that the steps show, from the recurrence p[n+1] + p[n-1] = 2 cos(omega h) p[n]."""
    rows = outcome(surge(method, h, 200)).rows
    p = rows[1:, 1] - 1.01e6
    cosine = np.sum((p[2:] + p[:-2]) * p[1:-1]) / (2 * np.sum(p[1:-1] ** 2))
    return math.acos(np.clip(cosine, -1.0, 1.0)) / h


@pytest.mark.parametrize("method", ["trapezoid", "implicit-midpoint", "gauss-4", "gauss-6"])
def test_a_mode_beyond_pi_over_h_shows_at_the_wrong_frequency_that_is_predicted(method):
    omega = column_frequency()
    h = 3.0 * math.pi / omega
    model = study_model(surge(method, h, 1))
    assert np.abs(np.linalg.eigvals(model.jacobian(0.0, np.zeros(2))).imag).max() == pytest.approx(
        omega, rel=1e-9
    )
    shown = shown_frequency(method, h)
    assert shown == pytest.approx(seen_frequency(method, omega, h), rel=1e-3)
    assert shown <= math.pi / h and shown < 0.4 * omega
    assert shown_frequency(method, 0.05 / omega) == pytest.approx(omega, rel=1e-3)


# the square root at zero drop ----------------------------------------------------------------------------------------

LEVEL = 2.0  # difference of the levels at the start [m]


def levelling(method: str, h: float, end: float, **more) -> dict:
    """Case of two equal tanks joined by an orifice."""
    nodes = {"high": tank(1.0, 3.0 + LEVEL / 2), "low": tank(1.0, 3.0 - LEVEL / 2)}
    links = {"hole": valve("high", "low", 0.01, **more)}
    return scene(nodes, links, end, {"method": method, "step": h}, ["high.level", "low.level"], h)


def root_rate() -> float:
    """Coefficient k of d(dz)/dt = -k sqrt(dz), dz the difference of the levels [m^0.5/s]."""
    return 2.0 * 0.01 * math.sqrt(2 * 9.80665)


def test_a_bare_square_root_chatters_about_zero_drop_by_the_amplitude_that_its_step_predicts():
    k, h = root_rate(), 1.0

    @njit
    def bare(t, y):
        return np.array([-k * np.sign(y[0]) * np.sqrt(np.abs(y[0]))])

    level = 2 * math.sqrt(LEVEL) / k
    t = np.arange(0.0, round(level) + 200.0, h)
    y = fvsolve.integrate(bare, [LEVEL], t, "euler", step=h)[:, 0]
    late = y[t > level + 100.0]
    amplitude = (k * h / 2) ** 2  # a - h k sqrt(a) = -a
    assert np.all(late[1:] * late[:-1] < 0)
    assert np.abs(late) == pytest.approx(amplitude, rel=1e-2)


def slope_at_rest(h: float, reynolds: float) -> float:
    """Eigenvalue |lambda| of the softened law at equal levels [1/s]."""
    model = study_model(levelling("euler", h, 1.0, laminar_reynolds=reynolds))
    equal = np.array([-1.0, 1.0]) * LEVEL / 2 * RHO  # change of masses since the start
    return float(np.abs(np.linalg.eigvals(model.jacobian(0.0, equal))).max())


@pytest.mark.parametrize("times", [20.0, 4.0, 2.1, 1.9, 0.5])
def test_the_softened_law_comes_to_rest_once_the_step_is_below_two_over_its_slope(times):
    h, level = 1.0, 2 * math.sqrt(LEVEL) / root_rate()
    # the slope is proportional to 1 / Reynolds number
    reynolds = 1e4 * h * slope_at_rest(h, 1e4) / times
    assert h * slope_at_rest(h, reynolds) == pytest.approx(times, rel=2e-3)
    rows = outcome(levelling("euler", h, round(level) + 600.0, laminar_reynolds=reynolds)).rows
    gap = (rows[:, 1] - rows[:, 2])[-50:]
    chatters = bool(np.all(gap[1:] * gap[:-1] < 0) and np.abs(gap).min() > 1e-9)
    assert chatters == (times > 2.0)


def test_error_control_shrinks_its_steps_at_a_bare_root_as_the_tolerance_predicts_and_not_at_a_softened_root():
    k, soft, after = root_rate(), 1e-4, 20.0  # odd polynomial in dz below `soft` [m]
    level = 2 * math.sqrt(LEVEL) / k

    @njit
    def bare(t, y):
        return np.array([-k * np.sign(y[0]) * np.sqrt(np.abs(y[0]))])

    @njit
    def softened(t, y):
        x = y[0] / soft
        if abs(x) < 1.0:
            return np.array([-k * np.sqrt(soft) * x * (45.0 + x * x * (5.0 * x * x - 18.0)) / 32.0])
        return np.array([-k * np.sign(y[0]) * np.sqrt(np.abs(y[0]))])

    def steps_at_rest(f, tolerance: float) -> int:
        counted = []
        for end in (level, level + after):
            counts = {}
            fvsolve.integrate(
                f,
                [LEVEL],
                [0.0, end],
                "dormand-prince",
                rtol=tolerance,
                atol=tolerance,
                counts=counts,
            )
            counted.append(counts["steps"] + counts["rejections"])
        return counted[1] - counted[0]

    chatter = {tol: steps_at_rest(bare, tol) for tol in (1e-6, 1e-8, 1e-10)}
    for tol, count in chatter.items():  # (k h / 2)^2 is about the tolerance
        assert 0.2 < count / (after * k / (2 * math.sqrt(tol))) < 2.0
    slope = k * 45 / (32 * math.sqrt(soft))
    for tol in (1e-6, 1e-8):
        assert (
            steps_at_rest(softened, tol)
            < 2 * after * slope / analyse("dormand-prince").real_interval
        )
    assert steps_at_rest(softened, 1e-8) < chatter[1e-8] / 10


# a step that straddles a kink ---------------------------------------------------------------------------------------

RATE, BEND, SHUT = 1.3, 0.3337, 0.7113  # [1/s], [s]


@pytest.mark.parametrize(("kind", "order"), [("bends", 2), ("jumps", 1)])
def test_a_step_across_a_kink_costs_the_order_and_segments_restore_it(kind, order):
    bends = kind == "bends"

    @njit
    def f(t, y):
        if bends:
            s = min(max((t - BEND) / (SHUT - BEND), 0.0), 1.0)
            return np.array([0.2 + 0.8 * s - RATE * y[0]])
        return np.array([(1.0 if t >= BEND else 0.2) - RATE * y[0]])

    pieces, y = [0.0, BEND, SHUT, 1.5], np.array([1.0])
    for a, b in zip(pieces[:-1], pieces[1:], strict=True):  # exact: tight tolerance, piece by piece
        y = fvsolve.integrate(f, y, [a, np.nextafter(b, 0.0)], "verner-7", rtol=1e-13)[-1]
    exact = y[0]
    straddling, landing = [], []
    for n in (33, 65, 129, 257, 513, 1025):
        h = 1.5 / n
        straddling.append(
            abs(fvsolve.integrate(f, [1.0], [0.0, 1.5], "rk4", step=h)[-1, 0] - exact)
        )
        y = np.array([1.0])
        for a, b in zip(pieces[:-1], pieces[1:], strict=True):
            y = fvsolve.integrate(f, y, [a, np.nextafter(b, 0.0)], "rk4", step=h)[-1]
        landing.append(abs(y[0] - exact))
    fitted = np.polyfit(
        np.log(1.5 / np.array([33, 65, 129, 257, 513, 1025])), np.log(straddling), 1
    )[0]
    assert fitted == pytest.approx(order, abs=0.45)
    assert observed_order(landing[:3]) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize(("kind", "order"), [("bends", 2), ("jumps", 1)])
def test_the_program_ends_its_steps_at_kinks_and_jumps_and_retains_the_order_that_its_bare_law_loses(
    kind, order
):
    bends, volume, flow_area, pump = kind == "bends", 50.0, 2e-4, 4e5
    value = ramp(BEND, SHUT - BEND, 0.2, 1.0) if bends else step(BEND, 0.2, 1.0)
    nodes = {"pump": reservoir(pump), "body": chamber(volume), "sump": reservoir(AMBIENT)}
    links = {
        "way-in": valve("pump", "body", flow_area),
        "way-out": valve("body", "sump", flow_area, value),
    }
    gain = WATER["bulk_modulus"] / volume * flow_area * math.sqrt(2.0 / RHO)

    @njit
    def law(t, p):  # equations (79) and (80), without segments
        s = min(max((t - BEND) / (SHUT - BEND), 0.0), 1.0) if bends else (1.0 if t >= BEND else 0.0)
        opening = 0.2 + 0.8 * s
        return np.array([gain * (math.sqrt(pump - p[0]) - opening * math.sqrt(p[0] - AMBIENT))])

    def last(method: str, **steps) -> tuple[float, float]:
        case = scene(nodes, links, 1.5, {"method": method, **steps}, ["body.pressure"], 1.5)
        rows = outcome(case).rows
        return rows[0, 1], rows[-1, 1]

    start, exact = last("verner-7", rtol=1e-12)
    errors = [abs(last("rk4", step=1.5 / n)[1] - exact) for n in (9, 17, 33)]
    assert observed_order(errors) == pytest.approx(4.0, abs=0.5)

    def worst(least: int) -> float:  # for any place of the kink in a step
        counts = range(least, 2 * least, max(1, least // 12))
        ends = [
            fvsolve.integrate(law, [start], [0.0, 1.5], "rk4", step=1.5 / n)[-1, 0] for n in counts
        ]
        return max(abs(p - exact) for p in ends)

    assert math.log2(worst(12) / worst(192)) / 4 == pytest.approx(order, abs=0.15)
    assert worst(24) > 30 * errors[-1]


# ----------------------------------------------------------------------------------------------------------------------
# docs/where-methods-fail.md: its tests exist, its commands run as described, and its table is the computed one.


TESTS = Path(__file__).parent
PAGE = folders.page("where-methods-fail")
WORDS = {"What happens", "Why", "Predicted", "Remedy"}


def sections() -> dict[str, str]:
    parts = re.split(r"^## (.+)$", PAGE, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_section_states_symptom_cause_place_and_remedy_and_names_tests_that_exist():
    written = "".join(path.read_text(encoding="utf-8") for path in TESTS.glob("test_*fail*.py"))
    found = {name: text for name, text in sections().items() if name != "The map"}
    assert len(found) == 14
    for name, text in found.items():
        assert set(re.findall(r"\*\*(.+?)\.\*\*", text)) == WORDS, name
        named = re.findall(r"`(test_\w+)`", text)
        assert named, name
        for test in named:
            assert f"def {test}(" in written, (name, test)


def commands() -> list[list[str]]:
    lines = [line.split("#")[0] for line in PAGE.splitlines() if re.match(r"(    )?fvsolve ", line)]
    return [shlex.split(line) for line in lines]


@pytest.mark.parametrize("words", commands(), ids=lambda words: " ".join(words[1:3]))
def test_every_command_of_the_page_names_a_case_and_settings_that_it_takes(words):
    settings = [value for option, value in zip(words, words[1:], strict=False) if option == "--set"]
    assert load_case(words[2], settings).name == words[2]


@pytest.mark.parametrize(
    "words",
    [words for words in commands() if words[1] == "failure-map"],
    ids=lambda words: words[2],
)
def test_every_map_of_the_page_takes_its_options(words, monkeypatch, tmp_path, fvs):
    asked = []

    def noted(case, *given, **more):
        asked.append(case.name)
        raise FvsolveError("far enough: nothing is run")

    monkeypatch.setattr(import_module("fvsolve.studies.failure_map"), "failure_map", noted)
    code, _, err = fvs(*words[1:], "--out", tmp_path)
    assert code == 2 and "far enough" in err and asked == [words[2]]


def test_the_table_of_courant_limits_contains_computed_values():
    rows = re.findall(r"^\| (`.+?`) \|((?: [\d.]+ \|){6})$", PAGE, flags=re.MULTILINE)
    schemes = ("upwind", "linear-upwind", "fromm", "upwind3", "upwind5", "central")
    assert len(rows) == 5
    cells, travel = 16, LENGTH / 16 / SPEED
    for methods, numbers in rows:
        for method in re.findall(r"`(.+?)`", methods):
            for scheme, number in zip(schemes, numbers.strip(" |").split("|"), strict=True):
                model = lossless(cells, scheme, method, travel)
                unit = travel * scaled(model, model.jacobian(0.0, np.zeros(2 * cells)))
                assert courant_limit(method, unit, 1000) == pytest.approx(
                    float(number), abs=6e-4
                ), (method, scheme)
