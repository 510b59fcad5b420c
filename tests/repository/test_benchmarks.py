"""Benchmarks: their rates agree with the model, their bands contain the errors, and each script has `--quick`.

Comparison of two dumps of commits: a difference of one bit is found, and the map of renamed keys is applied.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(autouse=True)
def benchmark_modules(monkeypatch):
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


def test_bands_of_delay_lines_contain_the_result_of_eight_times_the_resolution():
    """Each band is at least the difference to eight times the resolution, for each of the three step controls."""
    import line_bands

    listed, controls = [], set()
    for k in (0, 1, 2, 3, 5, 6):
        scene = line_bands.network(np.random.default_rng([1, k]))
        controls |= {"courant", "step", "rtol"} & scene["numerics"].keys()
        listed += line_bands.bands(scene)
    assert controls == {"courant", "step", "rtol"}
    assert len(listed) > 60 and all(off <= band for _, band, off in listed)


def test_networks_that_are_written_twice_have_equal_extremes():
    """Names, order, units and directions change no extreme by more than 1e-6 of its range.

    Earlier versions differed in the networks of seed 1: by jumps that arrive together (5), by probes at joints (23), by
    events at the arrival of several jumps (160, 265), by ratios of steps beside a threshold (135).
    """
    import restated_networks

    models = [*restated_networks.MODELS]
    networks = [(2, number, model) for number, model in enumerate(3 * models)]
    networks += [(1, number, "delay-line") for number in (5, 23, 135, 160, 265)]
    for seed, number, model in networks:
        case = restated_networks.network(seed, number)
        case["numerics"]["pipe_model"] = model
        random = np.random.default_rng(number if seed == 2 else [seed, number, 7])
        other = restated_networks.restated(case, random)
        apart = restated_networks.difference(
            restated_networks.extremes(case), restated_networks.extremes(other)
        )
        assert apart <= restated_networks.BOUND, (seed, number, model)


@pytest.mark.parametrize("model", ["finite-volume", "delay-line", "auto"])
def test_bands_of_random_networks_hold_the_true_peaks(model: str):
    """The truth is that of characteristics on exact grids; networks 1 and 22 missed bands of earlier versions."""
    import exact_networks
    import network_bands

    count = network_bands.Count()
    for k in (1, 22):
        network = exact_networks.random_network((1, k))
        truth = exact_networks.solution(network)
        network_bands.compare(
            count, str(k), network_bands.case_with(network, truth, model, (1, k)), network, truth
        )
    assert count.bands >= 20 and not count.missed and not count.wrong


@pytest.mark.parametrize("seed", [2, 27, 71, 117, 164])
def test_random_streets_run_to_their_end_with_a_closed_ledger(seed, tmp_path):
    """Newton failed where a film passes a trickle (2, 71), between levels without flow (27, 117); 164 made water."""
    import random_streets

    assert random_streets.run_street(seed, tmp_path).fault == ""


@pytest.mark.parametrize("seed", [(2, 52), (1, 44), (2, 71)])
def test_bands_hold_where_the_flow_of_delay_lines_grows_from_rest(seed):
    """One stretch at the start had to carry the friction of all flows, in the run and in both references."""
    import exact_networks
    import network_bands

    count, network = network_bands.Count(), exact_networks.random_network(seed)
    truth = exact_networks.solution(network)
    given = network_bands.case_with(network, truth, "delay-line", seed)
    network_bands.compare(count, str(seed), given, network, truth)
    assert count.bands >= 6 and not count.missed and not count.wrong


def test_every_script_has_quick():
    """`quick.py` needs the option `--quick`; scripts read their options only through `measure.parser`."""
    import quick

    scripts = quick.scripts()
    assert len(scripts) > 20
    for path in scripts:
        text = path.read_text(encoding="utf-8")
        assert "parser(__doc__)" in text and ".quick" in text and "sys.argv" not in text, path.name


def test_quick_states_that_its_figures_are_no_measurement(capsys):
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


BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
SUMMARY = "summary.json"


@pytest.fixture(autouse=True)
def dumps(monkeypatch):
    """Module compare_dumps, which is removed after the test."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import compare_dumps

    yield compare_dumps
    del sys.modules["compare_dumps"]


def run() -> dict:
    """Dump of a small run."""
    return {
        ("start", "dydt"): np.array([[1.0, -0.0], [np.nan, 2.0]]),
        ("history.csv", "gate.pressure [Pa]"): np.array([1e5, 2e5]),
        (SUMMARY, "extremes", "gate.pressure", "least"): 0.1,
        (SUMMARY, "extremes", "gate.pressure", "t_least"): None,
        (SUMMARY, "expectations", "0", "text"): "max(gate.pressure) - min_p",
        (SUMMARY, "warnings", "0", "text"): "the tank is full",
        (SUMMARY, "reason"): "stopped: a value is not finite",
        (SUMMARY, "steps"): 3,
    }


def moved(dump: dict, old: tuple, new: tuple) -> dict:
    """Copy of a dump with a value at another place."""
    return {new if place == old else place: value for place, value in dump.items()}


def test_equal_dumps_have_no_difference(dumps):
    assert dumps.compare(run(), run(), dumps.Names()) == []


@pytest.mark.parametrize(
    "place", [("start", "dydt"), (SUMMARY, "extremes", "gate.pressure", "least")]
)
def test_a_single_bit_is_a_difference(place, dumps):
    new = run()
    new[place] = np.nextafter(new[place], 3.0)
    (listed,) = dumps.compare(run(), new, dumps.Names())
    assert (
        listed.place.startswith("/".join(place))
        and listed.old != listed.new
        and "0x1." in listed.old
    )


def test_the_first_number_that_differs_is_reported(dumps):
    new = run()
    new["start", "dydt"] = np.array([[1.0, 0.0], [np.nan, 3.0]])
    (listed,) = dumps.compare(run(), new, dumps.Names())
    assert listed == ("start/dydt[0, 1] and 1 more", "-0.0 (-0x0.0p+0)", "0.0 (0x0.0p+0)")


def test_kinds_of_numbers_and_shapes_count(dumps):
    new = run() | {(SUMMARY, "steps"): 3.0, ("history.csv", "gate.pressure [Pa]"): np.array([1e5])}
    assert {one.new for one in dumps.compare(run(), new, dumps.Names())} == {
        "3.0 (0x1.8000000000000p+1)",
        "float64[1]",
    }


def test_a_place_that_lacks_is_a_difference_on_either_side(dumps):
    new = run()
    del new[SUMMARY, "steps"]
    assert dumps.compare(run(), new, dumps.Names()) == [(f"{SUMMARY}/steps", "3", "nothing")]
    assert dumps.compare(new, run(), dumps.Names()) == [(f"{SUMMARY}/steps", "nothing", "3")]


def test_names_of_the_map_are_equal(dumps):
    """The map renames a key path, words of a column and of an expression, but not these words under other keys."""
    above = (SUMMARY, "extremes", "gate.pressure")
    new = moved(run(), (*above, "least"), (*above, "minimum"))
    new = moved(new, ("history.csv", "gate.pressure [Pa]"), ("history.csv", "gate.p [Pa]"))
    new[SUMMARY, "expectations", "0", "text"] = "max(gate.p) - min_pressure"
    lines = [
        "# words",
        "",
        "public\textremes.least\textremes.minimum",
        "public\tmin_p\tmin_pressure",
    ]
    names = dumps.Names([*lines, "public\tpressure\tp", "public\tverdicts.least\tverdicts.minimum"])
    assert dumps.compare(run(), new, names) == []
    assert names.unused() == ["verdicts.least"]
    assert len(dumps.compare(run(), new, dumps.Names(lines[:3]))) == 3


def test_a_name_of_the_map_hides_no_number(dumps):
    new = moved(run(), (SUMMARY, "steps"), (SUMMARY, "count"))
    names = dumps.Names(["public\tsteps\tcount"])
    assert dumps.compare(run(), new, names) == []
    assert dumps.compare(run(), new | {(SUMMARY, "count"): 4}, names) == [
        (f"{SUMMARY}/steps ({SUMMARY}/count)", "3", "4")
    ]


def test_names_that_change_places_are_distinguished(dumps):
    names = dumps.Names(["public\ta\tb", "public\tb\ta"])
    assert dumps.compare({("a",): 1, ("b",): 2}, {("b",): 1, ("a",): 2}, names) == []
    assert len(dumps.compare({("a",): 1, ("b",): 2}, {("a",): 1, ("b",): 2}, names)) == 2


def test_texts_for_people_may_have_other_words(dumps):
    new = run() | {
        (SUMMARY, "warnings", "0", "text"): "a full tank",
        (SUMMARY, "reason"): "stopped: look at the step",
    }
    assert dumps.compare(run(), new, dumps.Names()) == []
    assert len(dumps.compare(run(), new | {(SUMMARY, "reason"): "finished"}, dumps.Names())) == 1
    assert (
        len(
            dumps.compare(
                run(), new | {(SUMMARY, "expectations", "0", "text"): "max(x)"}, dumps.Names()
            )
        )
        == 1
    )


def test_names_of_python_are_located_from_both_ends(dumps):
    names = dumps.Names(["member\tModel.evaluate\tModel.rates", "name\trates\tslopes"])
    assert names.spellings("rates") == ["rates", "slopes", "evaluate"]
    assert names.unused() == []


def test_a_faulty_map_states_all_its_faults(dumps):
    lines = ["public\ta", "public\ta.b\tc", "word\ta\tb", "public\ta\tb", "public\ta\tc"]
    with pytest.raises(ValueError) as listed:
        dumps.Names(lines)
    assert [line.partition(":")[0] for line in str(listed.value).splitlines()] == [
        "line 1",
        "line 2",
        "line 3",
        "line 5",
    ]
