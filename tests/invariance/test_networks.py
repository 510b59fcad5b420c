"""A network said in another way tells the same: to the bit where the arithmetic is the same, else to round-off.

Round-off is `ROUND` of the greatest value of a quantity: steps by Courant number are the same steps, a thousand of them
(1e-11 is found). Under error control a step may be taken or refused by what was rounded: the two are then two answers
within the tolerance.
"""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import GRAVITY, WATER

import fvsolve
from fvsolve.case.text import write
from invariance import equivalent_networks as equivalent
from invariance.random_scenes import IMPLICIT, SEEDS, networks, shuffled, some_of
from invariance.result_comparison import IN_PARTS, alike, told

EXPERIMENTAL = "ignore:First-class function type feature is experimental"  # numba says so where it compiles
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)  # of numbers that are none
ROUND = 1e-9


def near(case: dict) -> float:
    """How far apart the same in other words may be, over the greatest value of the quantity.

    An implicit step with weno5 may have two roots, apart by what it errs by, and rounding chooses (one seen: both are
    right to 5e-12, and 1.4e-6 apart).
    """
    if case["numerics"]["scheme"] == "weno5" and case["numerics"]["method"] in IMPLICIT:
        return IN_PARTS
    return 10 * case["numerics"].get("rtol", 0.1 * ROUND)


@examples(6)
@given(case=networks())
def test_run_again(case):
    """The same arithmetic: the same bits, by a model of its own and by one that has run."""
    first = told(case)
    alike(first, told(case))
    if first.result:
        model = fvsolve.build(fvsolve.load(case))
        fvsolve.run(model)
        alike(first, told(model))


@examples(6)
@given(case=networks())
def test_other_rows(case):
    """Rows are read between steps and do not shorten them: common ones agree to the bit, as 1/32 s is exact."""
    few = told(equivalent.changed(case, "output", every=1 / 16))
    many = told(equivalent.changed(case, "output", every=1 / 64))
    assert few.ended == many.ended
    assert set(few.t) <= set(many.t)
    for name, values in few.rows.items():
        found = dict(zip(many.t, many.rows[name], strict=True))  # of two rows at one time the later
        wanted = dict(zip(few.t, values, strict=True))
        assert {t: found[t] for t in wanted} == wanted


@examples(6)
@given(case=networks(), frames=st.integers(1, 9))
def test_other_frames(case, frames):
    alike(told(case), told(equivalent.changed(case, "output", fields=frames)))


@examples(6)
@given(case=networks())
def test_other_names(case):
    """Names are indices in the order of the file: nothing but they changes, also where they sort otherwise."""

    def call(name):
        return f"{'zyxw'[len(name) % 4]}{name[::-1]}"

    alike(
        told(case),
        told(equivalent.renamed(case, call)),
        name=lambda probe: equivalent.called(probe, call),
    )


@examples(6)
@given(case=networks(), seed=SEEDS)
def test_other_order(case, seed):
    """Sums over the links of a place are taken in another order."""
    nodes, links = shuffled(case["nodes"], seed), shuffled(case["links"], seed)
    alike(told(case), told(equivalent.reordered(case, nodes, links)), near(case))


@examples(6)
@given(case=networks(), seed=SEEDS)
def test_links_drawn_from_the_other_end(case, seed):
    """Cells and faces are the same, counted from the other end: fluxes change sign."""
    able = [name for name, link in case["links"].items() if link["type"] in equivalent.STRAIGHT]
    chosen = some_of(able, seed)

    def sign(probe, values):
        return -values if ".flow" in probe and probe.split(".")[1] in chosen else values

    def name(probe):
        return equivalent.from_other_end(probe, case, chosen)

    alike(told(case), told(equivalent.swapped(case, chosen)), near(case), name, sign)


@examples(6)
@given(case=networks(), height=st.sampled_from([16.0, 1000.0, -3.7]))
def test_everything_higher(case, height):
    """Only differences of elevation drive; these are rounded by the height."""
    alike(told(case), told(equivalent.raised(case, height)), near(case))


@examples(6)
@given(case=networks(laws=("linear",)))
def test_without_profiles(case):
    """Under the linear law flows, and pressures at nodes, do not know of them; along pipes the weight below is all."""
    weight, links = WATER["density"] * GRAVITY, case["links"]

    def change(probe, values):
        link = links.get(probe.split(".")[1], {}) if probe.endswith("pressure@0.37") else {}
        if "profile" not in link:
            return values
        x, z = link["profile"]["chainage"], link["profile"]["elevation"]
        bent = np.interp(x[0] + 0.37 * link["length"], x, z)
        return values - weight * (bent - (z[0] + 0.37 * (z[-1] - z[0])))

    alike(told(equivalent.straight(case)), told(case), near(case), change=change)


@examples(6)
@given(case=networks())
def test_limits_and_points_that_are_watched_change_nothing(case):
    """What is followed for its extremes alone is read off states, never written into them."""
    limits = {"any": {"on": "pipes", "maximum": "1 GPa"},
              "quick": {"on": "pipes", "quantity": "velocity", "maximum": 1e3},
              "push": {"on": "pipes", "quantity": "force", "maximum": "1 GN"}}  # fmt: skip
    watched = told(case | {"limits": limits})
    alike(told(case), watched)
    if watched.result and watched.result.ok:
        allowed = {"holds", "open"} if watched.result.marks else {"holds"}  # open below the pressure of vapour
        assert {one.state for one in watched.result.verdicts} <= allowed


@examples(6)
@given(case=networks())
def test_other_units(case):
    """The factors of units round once."""
    alike(told(case), told(equivalent.in_other_units(case)), near(case))


@examples(6)
@given(case=networks())
def test_two_copies_with_a_shut_valve_between(case):
    """Norms over twice as many states and systems of twice the size round otherwise."""
    one = told(case)
    both = told(equivalent.twice(case, "n0"))
    alike(one, both, near(case))
    alike(one, both, near(case), name=lambda probe: equivalent.called(probe, lambda part: f"{part}-too"))


@examples(6)
@given(case=networks(), wait=st.sampled_from([64.0, 1000.0]))
def test_at_a_later_time(case, wait):
    """Times are rounded by their size, and with them lengths of steps and what schedules say."""
    alike(told(case), told(equivalent.later(case, wait)), 1e3 * near(case), later=wait)


@examples(6)
@given(case=networks(laws=("linear", "log")))
def test_a_denser_fluid(case):
    """Twice the density, stiffness, viscosity and pressures: twice the pressures. A factor of two rounds nothing."""

    def twice(probe, values):
        return 2.0 * values if ".pressure" in probe else values

    alike(
        told(equivalent.denser(case, 1.0)),
        told(equivalent.denser(case, 2.0)),
        near(case),
        change=twice,
    )


@examples(6)
@given(case=networks())
def test_a_demand_is_an_inflow_backwards(case):
    """The same junction by another name."""
    assume(any("demand" in node for node in case["nodes"].values()))
    alike(told(case), told(equivalent.drawn_backwards(case)))


@examples(6)
@given(case=networks())
def test_the_resolved_file(case):
    """Every default said, every number printed to its last digit."""
    try:
        resolved = tomllib.loads(fvsolve.load(case).resolved())
    except fvsolve.CaseError:
        return
    alike(told(case), told(resolved))


@examples(6)
@given(case=networks())
def test_a_file_and_settings(case, tmp_path_factory):
    """What the file says otherwise and `set` puts right."""
    wrong = equivalent.changed(case, "numerics", end=77.0)
    wrong["links"]["p0"] |= {"length": 1.0, "cells": 1}
    path = tmp_path_factory.mktemp("said") / "case.toml"
    path.write_text(write(wrong))
    pipe = case["links"]["p0"]
    right = {"numerics.end": 1.0, "links.p0.length": pipe["length"], "links.p0.cells": pipe["cells"]}
    alike(told(case), told(path, set=right))
