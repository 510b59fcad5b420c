"""Equivalent descriptions of a network give equal results, to the bit for the same arithmetic, otherwise to rounding.

Rounding is `ROUND` times the greatest value of a quantity, for about a thousand equal steps by Courant number (1e-11 is
found). Under error control rounding may decide if a step is accepted; the results then agree within the tolerance.
"""

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
from invariance.random_scenes import SEEDS, networks, shuffled
from invariance.result_comparison import EXPERIMENTAL, alike, near, outcome_of, with_frames

# other warnings fail, such as of NaN values
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)


@examples(6)
@given(case=networks())
def test_run_again(case):
    """A second run agrees to the bit, with a new model or with a used model."""
    first = outcome_of(case)
    alike(first, outcome_of(case))
    if first.result:
        model = fvsolve.build(fvsolve.load(case))
        fvsolve.run(model)
        alike(first, outcome_of(model))


@examples(6)
@given(case=networks())
def test_other_rows(case):
    """Common rows agree to the bit, because rows are interpolated between steps and 1/32 s is exact in binary."""
    few = outcome_of(equivalent.changed(case, "output", every=1 / 16))
    many = outcome_of(equivalent.changed(case, "output", every=1 / 64))
    assert few.ended == many.ended
    assert set(few.t) <= set(many.t)
    for name, values in few.rows.items():
        found = dict(zip(many.t, many.rows[name], strict=True))  # the later of two rows at one time
        wanted = dict(zip(few.t, values, strict=True))
        assert {t: found[t] for t in wanted} == wanted


@examples(6)
@given(case=networks(), frames=st.integers(1, 9))
def test_other_frames(case, frames):
    one = outcome_of(case)
    if one.ended == "refused":
        return
    with with_frames():
        alike(one, outcome_of(equivalent.changed(case, "output", fields=frames)))


@examples(6)
@given(case=networks())
def test_other_names(case):
    """Names have no effect, even if they change the alphabetical order."""

    def call(name):
        return f"{'zyxw'[len(name) % 4]}{name[::-1]}"

    alike(
        outcome_of(case),
        outcome_of(equivalent.renamed(case, call)),
        name=lambda probe: equivalent.called(probe, call),
    )


@examples(6)
@given(case=networks(), seed=SEEDS)
def test_other_order(case, seed):
    """The order of parts changes sums over the links of a place by rounding only."""
    nodes, links = shuffled(case["nodes"], seed), shuffled(case["links"], seed)
    alike(outcome_of(case), outcome_of(equivalent.reordered(case, nodes, links)), near(case))


@examples(6)
@given(case=networks(), seed=SEEDS)
def test_links_drawn_from_the_other_end(case, seed):
    """Reversed links give the same results with the opposite sign of flows."""
    other, how = equivalent.drawn_from_other_end(case, seed)
    alike(outcome_of(case), outcome_of(other), near(case), **how)


@examples(6)
@given(case=networks(), height=st.sampled_from([16.0, 1000.0, -3.7]))
def test_everything_higher(case, height):
    """A common height changes results by rounding only."""
    alike(outcome_of(case), outcome_of(equivalent.raised(case, height)), near(case))


@examples(6)
@given(case=networks(laws=("linear",)))
def test_without_profiles(case):
    """Under the linear law a profile changes only pressures along its pipe, by the weight of the fluid."""
    weight, links = WATER["density"] * GRAVITY, case["links"]

    def change(probe, values):
        link = links.get(probe.split(".")[1], {}) if probe.endswith("pressure@0.37") else {}
        if "profile" not in link:
            return values
        x, z = link["profile"]["chainage"], link["profile"]["elevation"]
        bent = np.interp(x[0] + 0.37 * link["length"], x, z)
        return values - weight * (bent - (z[0] + 0.37 * (z[-1] - z[0])))

    alike(outcome_of(equivalent.straight(case)), outcome_of(case), near(case), change=change)


@examples(6)
@given(case=networks())
def test_limits_and_points_that_are_watched_change_nothing(case):
    """Design limits do not change a bit of the results."""
    limits = {
        "any": {"on": "pipes", "maximum": "1 GPa"},
        "quick": {"on": "pipes", "quantity": "velocity", "maximum": 1e3},
        "push": {"on": "pipes", "quantity": "force", "maximum": "1 GN"},
    }
    watched = outcome_of(case | {"limits": limits})
    alike(outcome_of(case), watched)
    if watched.result and watched.result.ok:
        # open below vapour pressure
        allowed = {"holds", "open"} if watched.result.marks else {"holds"}
        assert {one.state for one in watched.result.verdicts} <= allowed


@examples(6)
@given(case=networks())
def test_other_units(case):
    """Conversion of units changes results by rounding only."""
    alike(outcome_of(case), outcome_of(equivalent.in_other_units(case)), near(case))


@examples(6)
@given(case=networks())
def test_two_copies_with_a_shut_valve_between(case):
    """Two copies of a network give the same results, except for rounding in norms and larger systems."""
    one = outcome_of(case)
    both = outcome_of(equivalent.twice(case, "n0"))
    alike(one, both, near(case))
    alike(
        one,
        both,
        near(case),
        name=lambda probe: equivalent.called(probe, lambda part: f"{part}-too"),
    )


@examples(6)
@given(case=networks(), wait=st.sampled_from([64.0, 1000.0]))
def test_at_a_later_time(case, wait):
    """A delay changes results by rounding of times, which enters steps and schedules."""
    alike(outcome_of(case), outcome_of(equivalent.later(case, wait)), 1e3 * near(case), later=wait)


@examples(6)
@given(case=networks(laws=("linear", "log")))
def test_a_denser_fluid(case):
    """Twice the density, stiffness, viscosity and pressures give twice the pressures and equal flows."""

    def twice(probe, values):
        return 2.0 * values if ".pressure" in probe else values

    alike(
        outcome_of(equivalent.denser(case, 1.0)),
        outcome_of(equivalent.denser(case, 2.0)),
        near(case),
        change=twice,
    )


@examples(6)
@given(case=networks())
def test_a_demand_is_an_inflow_backwards(case):
    """A negative inflow equals a demand at a junction to the bit."""
    assume(any("demand" in node for node in case["nodes"].values()))
    alike(outcome_of(case), outcome_of(equivalent.drawn_backwards(case)))


@examples(6)
@given(case=networks())
def test_the_resolved_file(case):
    """The resolved file, with all defaults and digits, gives the same run to the bit, here of half a second."""
    case = equivalent.changed(case, "numerics", end=0.5)
    try:
        resolved = tomllib.loads(fvsolve.load(case).resolved())
    except fvsolve.CaseError:
        return
    alike(outcome_of(case), outcome_of(resolved))


@examples(6)
@given(case=networks())
def test_a_file_and_settings(case, tmp_path_factory):
    """Overrides with `set` replace wrong values in the file and give the same run to the bit."""
    wrong = equivalent.changed(case, "numerics", end=77.0)
    wrong["links"]["p0"] |= {"length": 1.0, "cells": 1}
    path = tmp_path_factory.mktemp("said") / "case.toml"
    path.write_text(write(wrong))
    pipe = case["links"]["p0"]
    right = {
        "numerics.end": 1.0,
        "links.p0.length": pipe["length"],
        "links.p0.cells": pipe["cells"],
    }
    alike(outcome_of(case), outcome_of(path, set=right))
