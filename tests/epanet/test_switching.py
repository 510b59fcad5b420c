"""Formulas of controls and rules: fewer, joined actions have the effect of all actions, at any time and level."""

import bisect
import random

import pytest

from fvsolve.exchange.epanet import switching

END = 100.0
TIMES = (0.0, 2.5, 5.0, 37.5, 60.0, 99.9)
VALUES = {
    ("level", "a"): (0.5, 1.5, 2.5, 4.5),
    ("level", "b"): (0.5, 1.95, 2.05, 3.5),
    ("flow", "p"): (-3.5, 0.5, 2.5),
}


def clause_of(draw, depth=0):
    """Random clause : windows of time, a comparison, or both joined and reversed."""
    kind = draw.random()
    if kind < 0.35:
        ends = sorted(draw.sample(range(-20, 130, 5), 2 * draw.randint(1, 2)))
        spans = zip(map(float, ends[::2]), map(float, ends[1::2]), strict=True)
        return switching.interval_clause(switching.clipped(spans, END))
    if kind < 0.75 or depth > 2:
        relation = draw.choice(["<", ">", "<=", ">=", "=", "<>"])
        return switching.value_clause(
            draw.choice(list(VALUES)), relation, float(draw.randint(1, 4)), 0.1
        )
    parts = [clause_of(draw, depth + 1) for _ in range(draw.randint(1, 3))]
    clause = switching.combined(draw.random() < 0.6, parts)
    return switching.opposite(clause) if draw.random() < 0.3 else clause


def value_of(formula, sources, time, values):
    """Value of a formula in which each source has the name `x` with its index."""
    names = {"t": time, "abs": abs}
    for k, source in enumerate(sources):
        if source[0] == "margin":
            steps = source[1]
            at = max(bisect.bisect_right(steps.time, time) - 1, 0)
            names[f"x{k}"] = steps.value[at] - values[steps.source]
        else:
            names[f"x{k}"] = values[source]
    return eval(formula, {"__builtins__": {}}, names)


def holds(clause, time, values):
    text = clause.text({source: f"x{k}" for k, source in enumerate(clause.sources)})
    return value_of(text, clause.sources, time, values) > 0.5


@pytest.mark.parametrize("seed", range(8))
def test_joined_actions_have_the_effect_of_all_actions(seed):
    draw, found = random.Random(seed), set()
    for _ in range(200):
        actions = [
            (clause_of(draw), draw.choice([0.0, 1.0, 2.0])) for _ in range(draw.randint(1, 6))
        ]
        fewer = switching.simplified(actions)
        sources = list(dict.fromkeys(source for clause, _ in fewer for source in clause.sources))
        formulas = switching.prevailing(
            fewer, {source: f"x{k}" for k, source in enumerate(sources)}
        )
        for _ in range(10):
            time, values = (
                draw.choice(TIMES),
                {source: draw.choice(own) for source, own in VALUES.items()},
            )
            acting = [value for clause, value in actions if holds(clause, time, values)]
            on = [
                value
                for value, formula in formulas.items()
                if value_of(formula, sources, time, values) > 0.5
            ]
            assert on == acting[-1:]  # the last action that holds prevails
            found.add(acting[-1] if acting else None)
    assert found == {0.0, 1.0, 2.0, None}
