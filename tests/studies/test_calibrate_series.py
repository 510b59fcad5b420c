"""Each series is weighted by its own scatter, so that sigma of a key follows from the noise of its series."""

import numpy as np
import pytest
from reference.scenes import GRAVITY, lake, scene, tank, valve

from fvsolve.studies import calibrate

FLOW_AREA, HEAD, LEVEL = {"a": 0.010, "b": 0.007}, 10.0, 1.0  # [m2], [m]
TIMES = np.arange(1.0, 61.0)  # [s], times of rows, between which a run is taken as linear
DRAWS = 2


def level(flow_area: float, t: np.ndarray) -> np.ndarray:
    """Level of a tank of 1 m2 that a lake fills through an orifice (Torricelli): sqrt(H - h) falls linearly."""
    return HEAD - (np.sqrt(HEAD - LEVEL) - 0.5 * flow_area * np.sqrt(2.0 * GRAVITY) * t) ** 2


def filling(names: str) -> dict:
    """Case of a lake and two tanks, each behind its own orifice, with series in the order of `names`."""
    nodes = {"lake": lake(HEAD, elevation=0.0)} | {name: tank(1.0, LEVEL, elevation=0.0) for name in FLOW_AREA}
    links = {f"to-{name}": valve("lake", name, 0.61) for name in FLOW_AREA}
    compare = {f"{name}.level": {"file": f"{name}.csv"} for name in names}
    return scene(nodes, links, 60.0, {"rtol": 1e-7}, ["a.level", "b.level"], 1.0, compare=compare)


def sigma_of(name: str, noise: float) -> float:
    """Standard deviation of a key from independent noise: noise / |dh / dkey|."""
    slope = (level(FLOW_AREA[name] * 1.0001, TIMES) - level(FLOW_AREA[name], TIMES)) / (1e-4 * FLOW_AREA[name])
    return noise / float(np.linalg.norm(slope))


@pytest.mark.parametrize(("noise", "names"), [((0.01, 0.03), "ab"), ((0.05, 0.002), "ba"), ((0.02, 0.02), "ab")])
def test_sigma_of_each_key_is_that_of_its_own_series(noise, names, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng, found = np.random.default_rng(5), []
    free = {f"links.to-{name}.discharge_coefficient": [0.5 * one, 1.5 * one] for name, one in FLOW_AREA.items()}
    case = filling(names)
    for link in case["links"].values():
        link["area"] = 1.0
    for _ in range(DRAWS):
        for name, own in zip(FLOW_AREA, noise, strict=True):
            table = np.column_stack([TIMES, level(FLOW_AREA[name], TIMES) + rng.normal(0.0, own, TIMES.size)])
            np.savetxt(f"{name}.csv", table, delimiter=",", header="t [s],h [m]", comments="")
        found.append(calibrate(case, free))
    for key, (name, true), own in zip(free, FLOW_AREA.items(), noise, strict=True):
        sigma = np.array([one.sigma[key] for one in found])
        assert np.mean(sigma) == pytest.approx(sigma_of(name, own), rel=0.15), (
            name
        )  # 60 points and 2 draws: about 6 % of scatter
        z = [(one.values[key] - true) / one.sigma[key] for one in found]
        assert np.all(np.abs(z) < 3.5), name


def test_a_series_that_fits_to_its_digits_leaves_the_other_its_say(tmp_path, monkeypatch) -> None:
    """A series without noise has only the scatter of its digits, and the key of the noisy series keeps its sigma."""
    monkeypatch.chdir(tmp_path)
    rng, case = np.random.default_rng(6), filling("ab")
    for link in case["links"].values():
        link["area"] = 1.0
    for name, own in (("a", 0.0), ("b", 0.02)):
        table = np.column_stack([TIMES, level(FLOW_AREA[name], TIMES) + own * rng.normal(0.0, 1.0, TIMES.size)])
        np.savetxt(f"{name}.csv", table, delimiter=",", header="t [s],h [m]", comments="")
    free = {f"links.to-{name}.discharge_coefficient": [0.5 * one, 1.5 * one] for name, one in FLOW_AREA.items()}
    found = calibrate(case, free)
    exact, noisy = free
    assert found.values[exact] == pytest.approx(FLOW_AREA["a"], rel=1e-5)
    assert found.sigma[noisy] == pytest.approx(sigma_of("b", 0.02), rel=0.3)
    assert found.sigma[exact] < 1e-3 * found.sigma[noisy]
