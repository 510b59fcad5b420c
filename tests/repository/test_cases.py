"""Shipped cases run, satisfy their expectations and close their mass balance."""

import tomllib

import numpy as np
import pytest
from reference import folders

import fvsolve

CASES = sorted(folders.CASES.glob("*.toml"))


def test_the_promised_cases_are_there():
    assert len(CASES) >= 11


@pytest.mark.parametrize("path", CASES, ids=lambda p: p.stem)
def test_a_shipped_case_keeps_its_claims(path):
    written = tomllib.loads(path.read_text(encoding="utf-8"))
    assert written.get("title") and written.get("expect")
    assert {"scheme", "method"} <= written["numerics"].keys()  # a change of a default must not change results
    result = fvsolve.run(path)
    assert result.ok, result.reason
    assert result.expectations
    assert [e for e in result.expectations if not e.ok] == []
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("path", CASES, ids=lambda p: p.stem)
def test_a_shipped_case_begins(path):
    """Short form for the quick tests: the first hundredth of a case conserves mass and gives finite values."""
    case = fvsolve.load(path)
    numerics = case.numerics
    end = numerics.start + 0.01 * (numerics.end - numerics.start)
    result = fvsolve.run(path, {"numerics.end": end, "expect": {}, "compare": {}})
    assert result.reason == "finished"
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
    assert all(np.isfinite(result[str(probe)]).all() for probe in result.probes)
