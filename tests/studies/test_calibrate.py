"""Calibration finds known values from noisy data of another method, and names keys that the data do not determine."""

import functools
import json

import numpy as np
import pytest
from pytest import approx
from reference.scenes import GRAVITY, junction, lake, pipe, reservoir, scene, tank, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.studies import calibrate

LENGTH, CELLS, SPEED, LEAK, AREA = 600.0, 60, 1130.0, 217.0, 0.0008
FRICTION = {"model": "steady", "factor": 0.02}


def line(leak: float, speed: float, cells: int, numerics: dict) -> dict:
    """Case of a main with a leak and a valve that shuts quickly; the leak reflects the wave."""
    nodes = {
        "lake": reservoir(4e6),
        "hole": junction(),
        "gate": junction(),
        "out": reservoir(101325.0),
    }
    first = max(1, round(cells * leak / LENGTH))
    links = {
        "up": pipe("lake", "hole", leak, 0.2, speed, first, friction=FRICTION),
        "down": pipe("hole", "gate", LENGTH - leak, 0.2, speed, cells - first, friction=FRICTION),
        "leak": {"type": "leak", "from": "hole", "coefficient": 6e-6, "exponent": 0.5},
        "valve": valve(
            "gate", "out", 0.61 * AREA, {"start": 0.1, "duration": 0.1, "value": [1.0, 0.0]}
        ),
    }
    return scene(nodes, links, 4.0, numerics, ["gate.pressure"], every=0.01)


MODEL = {"scheme": "upwind5", "method": "rk4", "courant": 0.9}


@functools.cache
def fine_run():
    """Run of the true case by another scheme on four times the cells."""
    return fvsolve.run(
        line(LEAK, SPEED, 4 * CELLS, {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5})
    )


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Folder with a measured series: `fine_run` with noise of 0.002 of the range."""
    monkeypatch.chdir(tmp_path)
    result = fine_run()
    noise = np.random.default_rng(7).normal(
        0.0, 0.002 * np.ptp(result["gate.pressure"]), result.t.size
    )
    table = np.column_stack([result.t, result["gate.pressure"] + noise])
    np.savetxt(tmp_path / "gate.csv", table, delimiter=",", header="t [s],p [Pa]", comments="")
    return tmp_path


def compared(case: dict) -> dict:
    return case | {
        "compare": {"gate.pressure": {"file": "gate.csv", "time": "t [s]", "value": "p [Pa]"}}
    }


def test_a_wave_speed_is_identified_within_a_thousandth_from_noisy_data(measured):
    free = {"links.down.wave_speed": [900.0, 1300.0], "links.valve.area": [0.0006, 0.001]}
    found, true = calibrate(compared(line(LEAK, SPEED, CELLS, MODEL)), free), [SPEED, AREA]
    assert found.values["links.down.wave_speed"] == approx(SPEED, rel=1e-3)
    assert found.values["links.valve.area"] == approx(AREA, rel=5e-3)
    assert found.doubts == []
    off = [abs(value - own) for value, own in zip(found.values.values(), true, strict=True)]
    assert all(one < 4.0 * sigma for one, sigma in zip(off, found.sigma.values(), strict=True))
    # noise, and error of fronts on few cells
    assert 0.0018 * 3e6 < found.rms["gate.pressure"] < 0.01 * 3e6


def test_a_planted_leak_is_located_within_a_cell_from_noisy_data(measured):
    """Free keys are the size of the leak and the lengths of the pipes beside it."""
    case = compared(line(300.0, SPEED, 40, MODEL))
    free = {
        "links.up.length": [100.0, 500.0],
        "links.down.length": [100.0, 500.0],
        "links.leak.coefficient": [1e-6, 1e-5],
    }
    found = calibrate(case, free, {"numerics.end": 1.6})
    cell = LENGTH / 40
    assert abs(found.values["links.up.length"] - LEAK) < cell
    assert abs(found.values["links.down.length"] - (LENGTH - LEAK)) < cell
    assert found.values["links.leak.coefficient"] == approx(6e-6, rel=0.1)
    assert np.array(found.correlation).shape == (3, 3) and np.diag(found.correlation) == approx(
        np.ones(3)
    )


def test_indistinguishable_and_ineffective_parameters_are_named(measured):
    """Only the product of area and coefficient of a valve matters; the end of the run changes no earlier value."""
    case = compared(line(LEAK, SPEED, CELLS, MODEL))
    free = {
        "links.valve.area": [0.0006, 0.001],
        "links.valve.discharge_coefficient": [0.5, 0.8],
        "numerics.end": [4.0, 4.1],
    }
    found = calibrate(case, free)
    said = "; ".join(found.doubts)
    assert "links.valve.area and links.valve.discharge_coefficient cannot be distinguished" in said
    assert (
        "numerics.end changes nothing that was measured" in said
        and found.plain()["sigma"]["numerics.end"] is None
    )


def test_the_command_prints_values_with_their_sigma(measured, fvs):
    (measured / "line.toml").write_text(write(compared(line(LEAK, SPEED, 20, MODEL))))
    ask = ("calibrate", measured / "line.toml", "--vary", "links.valve.area=0.0006,0.001")
    code, out, _ = fvs(*ask, "--json")
    said = json.loads(out)
    assert code == 0 and said["values"]["links.valve.area"] == approx(AREA, rel=5e-3)
    assert {"values", "sigma", "correlation", "rms", "doubts", "runs"} <= said.keys() and said[
        "correlation"
    ] == [[1.0]]
    code, out, _ = fvs(*ask)
    assert code == 0 and "links.valve.area" in out and "rms of gate.pressure" in out


@pytest.mark.parametrize("ends", [[0.0009, 0.0012], [0.0003, 0.0005]], ids=["lower", "upper"])
def test_a_value_at_an_end_of_its_range_is_named(ends, measured):
    found = calibrate(compared(line(LEAK, SPEED, 20, MODEL)), {"links.valve.area": ends})
    assert found.doubts == ["links.valve.area lies at an end of its range; try a wider range"]


def test_parameters_that_cannot_be_fitted_are_named(measured):
    case = line(LEAK, SPEED, 20, MODEL)
    with pytest.raises(
        FvsolveError,
        match="no measured series to fit to; expected a series under .compare. in the case",
    ):
        calibrate(case, {"links.valve.area": [0.0006, 0.001]})
    with pytest.raises(FvsolveError, match="no key to fit"):
        calibrate(compared(case), {})
    with pytest.raises(FvsolveError, match="LOW below HIGH"):
        calibrate(compared(case), {"links.valve.area": [0.001, 0.0006]})
    with pytest.raises(FvsolveError, match="no run of the sample finished: .*halve the step"):
        calibrate(compared(case), {"links.valve.area": [0.0006, 0.001]}, {"numerics.courant": 5.0})


# ----------------------------------------------------------------------------------------------------------------------
# Each series is weighted by its own scatter, so that sigma of a key follows from the noise of its series.


FLOW_AREA, HEAD, LEVEL = {"a": 0.010, "b": 0.007}, 10.0, 1.0  # [m2], [m]
TIMES = np.arange(1.0, 61.0)  # [s], times of rows, between which a run is taken as linear
DRAWS = 2


def level(flow_area: float, t: np.ndarray) -> np.ndarray:
    """Level of a tank of 1 m2 that a lake fills through an orifice (Torricelli): sqrt(H - h) falls linearly."""
    return HEAD - (np.sqrt(HEAD - LEVEL) - 0.5 * flow_area * np.sqrt(2.0 * GRAVITY) * t) ** 2


def filling(names: str) -> dict:
    """Case of a lake and two tanks, each behind its own orifice, with series in the order of `names`."""
    nodes = {"lake": lake(HEAD, elevation=0.0)} | {
        name: tank(1.0, LEVEL, elevation=0.0) for name in FLOW_AREA
    }
    links = {f"to-{name}": valve("lake", name, 0.61) for name in FLOW_AREA}
    compare = {f"{name}.level": {"file": f"{name}.csv"} for name in names}
    return scene(nodes, links, 60.0, {"rtol": 1e-7}, ["a.level", "b.level"], 1.0, compare=compare)


def sigma_of(name: str, noise: float) -> float:
    """Standard deviation of a key from independent noise: noise / |dh / dkey|."""
    slope = (level(FLOW_AREA[name] * 1.0001, TIMES) - level(FLOW_AREA[name], TIMES)) / (
        1e-4 * FLOW_AREA[name]
    )
    return noise / float(np.linalg.norm(slope))


@pytest.mark.parametrize(
    ("noise", "names"), [((0.01, 0.03), "ab"), ((0.05, 0.002), "ba"), ((0.02, 0.02), "ab")]
)
def test_sigma_of_each_key_is_that_of_its_own_series(noise, names, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng, found = np.random.default_rng(5), []
    free = {
        f"links.to-{name}.discharge_coefficient": [0.5 * one, 1.5 * one]
        for name, one in FLOW_AREA.items()
    }
    case = filling(names)
    for link in case["links"].values():
        link["area"] = 1.0
    for _ in range(DRAWS):
        for name, own in zip(FLOW_AREA, noise, strict=True):
            table = np.column_stack(
                [TIMES, level(FLOW_AREA[name], TIMES) + rng.normal(0.0, own, TIMES.size)]
            )
            np.savetxt(f"{name}.csv", table, delimiter=",", header="t [s],h [m]", comments="")
        found.append(calibrate(case, free))
    for key, (name, true), own in zip(free, FLOW_AREA.items(), noise, strict=True):
        sigma = np.array([one.sigma[key] for one in found])
        assert np.mean(sigma) == pytest.approx(sigma_of(name, own), rel=0.15), (
            name
        )  # 60 points and 2 draws: about 6 % of scatter
        z = [(one.values[key] - true) / one.sigma[key] for one in found]
        assert np.all(np.abs(z) < 3.5), name


def test_a_series_that_fits_to_its_digits_leaves_weight_to_the_others(
    tmp_path, monkeypatch
) -> None:
    """A series without noise has only the scatter of its digits, and the key of the noisy series keeps its sigma."""
    monkeypatch.chdir(tmp_path)
    rng, case = np.random.default_rng(6), filling("ab")
    for link in case["links"].values():
        link["area"] = 1.0
    for name, own in (("a", 0.0), ("b", 0.02)):
        table = np.column_stack(
            [TIMES, level(FLOW_AREA[name], TIMES) + own * rng.normal(0.0, 1.0, TIMES.size)]
        )
        np.savetxt(f"{name}.csv", table, delimiter=",", header="t [s],h [m]", comments="")
    free = {
        f"links.to-{name}.discharge_coefficient": [0.5 * one, 1.5 * one]
        for name, one in FLOW_AREA.items()
    }
    found = calibrate(case, free)
    exact, noisy = free
    assert found.values[exact] == pytest.approx(FLOW_AREA["a"], rel=1e-5)
    assert found.sigma[noisy] == pytest.approx(sigma_of("b", 0.02), rel=0.3)
    assert found.sigma[exact] < 1e-3 * found.sigma[noisy]
