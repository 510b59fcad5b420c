"""Equivalent descriptions of networks of delay lines give equal results, as in `test_networks` for cells.

Rounding may decide if a jump is kept or smoothed over a step. The results then differ by such a jump, at most a quarter
of `numerics.delay_tolerance` times the greatest jump, so the tests use a small tolerance.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples

import fvsolve
from invariance import equivalent_networks as equivalent
from invariance.random_scenes import SEEDS, networks, shuffled
from invariance.result_comparison import EXPERIMENTAL, alike, near, outcome_of

pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)
SMALL = 1e-9  # delay_tolerance; smaller jumps than a quarter of it are smoothed
# If several jumps arrive at a valve at once, rounding decides how the change of flow is divided among them, and which
# part is a jump. Ends of steps agree to 1e-12; rows between them differed by 2.3e-8 with round lengths and speeds.
BETWEEN_STEPS = 1e-7


def nearly(case: dict) -> float:
    """Allowed difference between rows of equivalent networks, over the greatest value of the quantity."""
    return max(10.0 * near(case), BETWEEN_STEPS)


def followed(case: dict, line: str) -> dict:
    """Case with delay lines for all pipes, or with the choice of `auto`."""
    return equivalent.changed(
        case, "numerics", pipe_model=line, delay_tolerance=SMALL if line == "delay-line" else 1e-2
    )


def lines(*ways: str) -> st.SearchStrategy[dict]:
    """Strategy for networks under the linear law with delay lines, some shorter than a step."""
    return st.builds(
        followed, networks(laws=("linear",)), st.sampled_from(ways or ("delay-line", "auto"))
    )


def given_steps() -> st.SearchStrategy[dict]:
    """Strategy for networks without error control.

    Errors of interpolation between steps do not enter the error estimate, so rounding would decide where steps end.
    """
    return lines("delay-line").filter(lambda case: "rtol" not in case["numerics"])


def outcome_with_lines(case: dict):
    """Outcome of a run, or None if a delay line is not possible."""
    try:
        return outcome_of(case)
    except fvsolve.CaseError as error:
        if not all("is not possible" in str(fault) for fault in error.faults):
            raise
        return None


def same(one, other, *how, **more) -> None:
    """Assert that both runs are refused, or that they agree."""
    assert (one is None) == (other is None)
    if one is not None:
        alike(one, other, *how, **more)


@examples(5)
@given(case=lines())
def test_run_again(case):
    first = outcome_with_lines(case)
    same(first, outcome_with_lines(case))
    if first is not None and first.result:
        model = fvsolve.build(fvsolve.load(case))
        fvsolve.run(model)
        alike(first, outcome_of(model))


@examples(4)
@given(case=lines())
def test_other_rows(case):
    """Common rows agree to the bit."""
    few = outcome_with_lines(equivalent.changed(case, "output", every=1 / 16))
    many = outcome_with_lines(equivalent.changed(case, "output", every=1 / 64))
    assert (few is None) == (many is None)
    if few is not None and few.result:
        assert few.ended == many.ended
        for name, values in few.rows.items():
            found = dict(zip(many.t, many.rows[name], strict=True))
            wanted = dict(zip(few.t, values, strict=True))
            assert {t: found[t] for t in wanted} == wanted


@examples(4)
@given(case=given_steps(), seed=SEEDS)
def test_other_order(case, seed):
    nodes, links = shuffled(case["nodes"], seed), shuffled(case["links"], seed)
    same(
        outcome_with_lines(case),
        outcome_with_lines(equivalent.reordered(case, nodes, links)),
        nearly(case),
    )


@examples(4)
@given(case=given_steps(), seed=SEEDS)
def test_links_drawn_from_the_other_end(case, seed):
    other, how = equivalent.drawn_from_other_end(case, seed)
    same(outcome_with_lines(case), outcome_with_lines(other), nearly(case), **how)


@examples(3)
@given(case=given_steps(), height=st.sampled_from([16.0, 1000.0]))
def test_everything_higher(case, height):
    same(
        outcome_with_lines(case), outcome_with_lines(equivalent.raised(case, height)), nearly(case)
    )


@examples(3)
@given(case=given_steps())
def test_other_units(case):
    same(
        outcome_with_lines(case), outcome_with_lines(equivalent.in_other_units(case)), nearly(case)
    )
