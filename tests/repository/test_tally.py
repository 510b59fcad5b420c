"""The tally of the quick tests lists schemes, methods, parts, laws, commands and tests that did not run."""

from __future__ import annotations

from reference.scenes import lake, pipe, reservoir, scene
from tally import Tally, expected

import fvsolve


def test_a_name_that_was_not_run_is_missing():
    tally = Tally()
    tally.add({kind: sorted(names) for kind, names in expected().items()})
    assert tally.missing() == []
    tally.names["scheme"].remove("weno5")
    tally.names["command"] -= {"run", "check"}
    assert tally.missing() == ["scheme: weno5", "command: check, run"]


def test_a_listed_test_that_is_not_there_is_named():
    tally = Tally()
    tally.add({kind: sorted(names) for kind, names in expected().items()} | {"unknown": ["tests/a.py::test_gone"]})
    assert tally.missing() == ["tests/durations.json: tests/a.py::test_gone is not a test"]


def test_a_run_counts_its_parts_scheme_method_and_law(request):
    from conftest import TALLY

    tally = request.config.stash[TALLY]
    before, tally.names = tally.names, Tally().names
    try:
        nodes = {"a": lake(30.0), "b": reservoir(2e5)}
        links = {"p": pipe("a", "b", 100.0, 0.1, 1000.0, 4, initial_flow=0.0)}
        fvsolve.run(scene(nodes, links, 0.1, {"scheme": "fromm", "method": "heun", "courant": 0.4}))
        assert tally.plain() == {
            "law": ["linear"], "method": ["heun"], "part": ["pipe", "reservoir"], "scheme": ["fromm"]
        }  # fmt: skip
    finally:
        for kind, names in tally.names.items():
            before[kind] |= names
        tally.names = before
