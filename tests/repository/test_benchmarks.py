"""Benchmarks: their rates agree with the model, their bands contain the errors, and each script has `--quick`."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(autouse=True)
def found(monkeypatch):
    """Import modules of benchmarks/ instead of test folders with equal names, and undo this after the test."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    names = [path.stem for path in BENCHMARKS.glob("*.py")]
    kept = {name: sys.modules.pop(name) for name in names if name in sys.modules}
    yield
    for name in names:
        sys.modules.pop(name, None)
    sys.modules.update(kept)


def test_acoustics_have_the_rates_of_their_model():
    from acoustics import Acoustics

    pulse = Acoustics(12)
    y, rates, mixed = pulse.start.y, np.empty(24), np.empty(24)
    pulse.rhs(0.0, y, rates)
    pulse.rhs_mixed(0.0, y[pulse.mixed], mixed)
    assert np.array_equal(rates, pulse.model.rhs(0.0, y)) and np.abs(rates).max() > 0.1
    assert np.array_equal(mixed, rates[pulse.mixed])


@pytest.mark.skipif(find_spec("pinocchio") is None, reason="peers are not installed")
def test_mechanisms_call_rates_in_a_loop():
    import mechanisms

    slate, once, many, dydt = mechanisms.rates(mechanisms.chain(1))
    once(), many(3)
    assert slate is not None and np.abs(dydt).max() > 0.0


def test_bands_of_delay_lines_hold_what_eight_times_the_resolution_gives():
    """Each band is at least the difference to eight times the resolution, for each of the three step controls."""
    import line_bands

    found, controls = [], set()
    for k in (0, 1, 2, 3, 5, 6):
        scene = line_bands.network(np.random.default_rng([1, k]))
        controls |= {"courant", "step", "rtol"} & scene["numerics"].keys()
        found += line_bands.bands(scene)
    assert controls == {"courant", "step", "rtol"}
    assert len(found) > 60 and all(off <= band for _, band, off in found)


def test_every_script_has_quick():
    """`quick.py` needs the option `--quick`; scripts read their options only through `measure.parser`."""
    import quick

    scripts = quick.scripts()
    assert len(scripts) > 20
    for path in scripts:
        text = path.read_text(encoding="utf-8")
        assert "parser(__doc__)" in text and ".quick" in text and "sys.argv" not in text, path.name


def test_quick_says_that_its_figures_are_no_measurement(capsys):
    import measure

    assert measure.parser("A table.").parse_args(["--quick"]).quick
    assert measure.QUICK in capsys.readouterr().out


def test_a_missing_peer_is_a_line_and_a_difference_an_error(capsys):
    import measure

    assert measure.peer_module("no_such_peer.part", "no-such-peer") is None
    assert capsys.readouterr().out == f"no-such-peer is not installed: {measure.SKIPPED}\n"
    measure.agree("heads", 1e-9, 1e-6)
    for difference in (1e-3, np.nan):
        with pytest.raises(SystemExit, match="heads: .*, expected at most 1e-06"):
            measure.agree("heads", difference, 1e-6)
