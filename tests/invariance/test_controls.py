"""Shipped cases with controls: restated, they have the same result."""

import copy
import tomllib

import numpy as np
import pytest
from reference.folders import CASES

import fvsolve

TURNED = {
    "tank-level-pi": [],
    "governor": ["penstock", "headrace"],
    "tank-relay": ["main"],
    "digital-pressure": ["main"],
}
METHODS = ("dormand-prince", "radau-iia-5", "rodas-5p", "auto")


@pytest.fixture(autouse=True)
def in_folder_of_cases(monkeypatch):
    monkeypatch.chdir(CASES)


def shipped(name: str) -> dict:
    return tomllib.loads((CASES / f"{name}.toml").read_text(encoding="utf-8"))


def difference(first, other) -> float:
    """Greatest difference of the probes of two runs, each over its greatest value."""
    assert first.ok and other.ok and np.array_equal(first.t, other.t)
    return max(
        np.max(np.abs(first[p] - other[p])) / np.max(np.abs(first[p]))
        for p in map(str, first.probes)
    )


@pytest.mark.parametrize("name", TURNED)
def test_order_of_parts_and_blocks_and_direction_of_links(name):
    case = shipped(name)
    plain = fvsolve.run(case)
    reordered = case | {
        group: dict(reversed(case[group].items())) for group in ("nodes", "links", "controls")
    }
    assert difference(plain, fvsolve.run(reordered)) == 0.0
    turned = copy.deepcopy(case)
    for link in TURNED[name]:
        ends = turned["links"][link]
        ends["from"], ends["to"] = ends["to"], ends["from"]
    assert difference(plain, fvsolve.run(turned)) < 1e-13


@pytest.mark.in_turn
@pytest.mark.parametrize("rtol", [1e-8, 1e-9])
@pytest.mark.parametrize("name", TURNED)
def test_methods_agree_within_five_tolerances(name, rtol):
    case = shipped(name)
    case["numerics"] = {"end": case["numerics"]["end"], "scheme": "upwind5", "rtol": rtol}
    runs = [fvsolve.run(case, set={"numerics.method": method}) for method in METHODS]
    assert max(difference(runs[0], other) for other in runs[1:]) < 5.0 * rtol
