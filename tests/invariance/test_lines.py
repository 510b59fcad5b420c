"""Networks of delay lines said in another way tell the same, as those of cells do (`test_networks`).

Where what is rounded decides whether a jump is kept as one, or smoothed over a step, the two are answers that differ by
such a jump, a quarter of `numerics.delay_tolerance` of the greatest: it is asked to be small.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples

import fvsolve
from invariance import equivalent_networks as equivalent
from invariance.random_scenes import SEEDS, networks, shuffled, some_of
from invariance.result_comparison import alike, told
from invariance.test_networks import EXPERIMENTAL, near

pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)
SMALL = 1e-9  # accuracy: jumps are kept down to a quarter of it
# Of jumps that arrive at a valve at once rounding decides which changes its flow by how much, and so what of a step is
# a jump. Ends of steps agree to 1e-12; rows between them differed by 2.3e-8 where lengths and speeds are round numbers.
BETWEEN_STEPS = 1e-7


def nearly(case: dict) -> float:
    """How far rows of two equivalent_networks may be apart."""
    return max(10.0 * near(case), BETWEEN_STEPS)


def followed(case: dict, line: str) -> dict:
    """All pipes as lines, or as `auto` finds them."""
    return equivalent.changed(
        case, "numerics", pipe_model=line, delay_tolerance=SMALL if line == "delay-line" else 1e-2
    )


def lines(*ways: str) -> st.SearchStrategy[dict]:
    """Networks under the law that lines know, some of whose pipes are shorter than a step."""
    return st.builds(followed, networks(laws=("linear",)), st.sampled_from(ways or ("delay-line", "auto")))


def given_steps() -> st.SearchStrategy[dict]:
    """Without error control: it sees nothing of what is read between steps, and rounding decides which these are."""
    return lines("delay-line").filter(lambda case: "rtol" not in case["numerics"])


def told_lines(case: dict):
    """What a scene tells, refused where friction is too much for a line of a single step."""
    try:
        return told(case)
    except fvsolve.CaseError as error:
        if not all("is not possible" in str(fault) for fault in error.faults):
            raise
        return None


def same(one, other, *how, **more) -> None:
    """Both are refused, or tell the same."""
    assert (one is None) == (other is None)
    if one is not None:
        alike(one, other, *how, **more)


@examples(5)
@given(case=lines())
def test_run_again(case):
    first = told_lines(case)
    same(first, told_lines(case))
    if first is not None and first.result:
        model = fvsolve.build(fvsolve.load(case))
        fvsolve.run(model)
        alike(first, told(model))


@examples(4)
@given(case=lines())
def test_other_rows(case):
    """Common ones agree to the bit."""
    few = told_lines(equivalent.changed(case, "output", every=1 / 16))
    many = told_lines(equivalent.changed(case, "output", every=1 / 64))
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
    same(told_lines(case), told_lines(equivalent.reordered(case, nodes, links)), nearly(case))


@examples(4)
@given(case=given_steps(), seed=SEEDS)
def test_links_drawn_from_the_other_end(case, seed):
    able = [name for name, link in case["links"].items() if link["type"] in equivalent.STRAIGHT]
    chosen = some_of(able, seed)

    def sign(probe, values):
        return -values if ".flow" in probe and probe.split(".")[1] in chosen else values

    def name(probe):
        return equivalent.from_other_end(probe, case, chosen)

    same(told_lines(case), told_lines(equivalent.swapped(case, chosen)), nearly(case), name=name, change=sign)


@examples(3)
@given(case=given_steps(), height=st.sampled_from([16.0, 1000.0]))
def test_everything_higher(case, height):
    same(told_lines(case), told_lines(equivalent.raised(case, height)), nearly(case))


@examples(3)
@given(case=given_steps())
def test_other_units(case):
    same(told_lines(case), told_lines(equivalent.in_other_units(case)), nearly(case))
