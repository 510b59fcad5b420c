"""Pressure cycles are counted as in ASTM E1049, and the used share of the fatigue strength follows from them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from reference.scenes import reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.report.cycles import FatigueStrength, count_cycles, cycles

ASTM = np.array([-2, 1, -3, 5, -1, 3, -4, 4, -2], float)  # ASTM E1049-85, figure 6
RANGES = {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}  # its table


def test_the_standards_example_is_counted_as_its_table_has_it() -> None:
    assert dict(count_cycles(ASTM, bins=9)) == RANGES
    assert dict(count_cycles(np.repeat(ASTM, 3), bins=9)) == RANGES
    assert count_cycles(np.full(10, 3.0)) == [] and count_cycles(np.zeros(1)) == []


def swung() -> dict:
    """Case of a valve between two reservoirs, one of which oscillates 20 times by 2 bar."""
    swing = {"mean": 5e5, "amplitude": 1e5, "period": 0.5}
    nodes = {"swung": reservoir(swing), "still": reservoir(4e5)}
    return scene(nodes, {"tap": valve("swung", "still", 1e-4)}, 10.0, {"method": "rk4", "step": 0.01},
                 ["swung.pressure", "still.pressure", "tap.flow"], every=0.0125)  # fmt: skip


def test_a_swing_uses_its_share() -> None:
    found = {one["probe"]: one for one in cycles(fvsolve.run(swung()), None, FatigueStrength(4e5, 1e6, 3.0))}
    assert set(found) == {"swung.pressure", "still.pressure"}
    (size, count), *small = found["swung.pressure"]["cycles"]
    assert size == pytest.approx(2e5, rel=1e-3) and count == pytest.approx(20.0, abs=0.6)
    assert sum(many for _, many in small) <= 1.0
    assert found["swung.pressure"]["share"] == pytest.approx(20.0 / 8e6, rel=0.05)
    assert found["still.pressure"] == {"probe": "still.pressure", "unit": "Pa", "cycles": [], "share": 0.0}


def test_the_command_says_how_long_it_lasts(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swung.toml").write_text(write(swung()))
    fvs("run", "swung.toml", "--no-pictures")
    ask = (
        "fatigue",
        "runs/swung",
        "--probes",
        "swung.pressure",
        "--range",
        "4e5",
        "--allowable-range",
        "1e6",
        "--slope",
        "3",
    )
    status, text, _ = fvs(*ask, "--per-day", "100")
    assert status == 0 and "years" in text and "range up to" in text
    assert json.loads(fvs(*ask, "--json")[1])["probes"][0]["share"] == pytest.approx(20.0 / 8e6, rel=0.05)
    assert fvs("fatigue", "runs/swung", "--range", "4e5")[0] == 2
    assert fvs("fatigue", "runs/nowhere")[0] == 2


def test_what_has_no_cycles_is_named() -> None:
    with pytest.raises(FvsolveError, match='did you mean "swung.pressure"'):
        cycles(fvsolve.run(swung()), ["swung.presure"])


def test_endured_cycles_are_those_of_basquins_law() -> None:
    assert FatigueStrength(4e5, 1e6, 3.0).allowed(4e5) == 1e6
    assert FatigueStrength(4e5, 1e6, 3.0).allowed(2e5) == 8e6
