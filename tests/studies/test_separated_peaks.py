"""Bands of peaks after column separation: the start is exact, vapour bounds minima, the first peak has its own band."""

import math

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, scene

import fvsolve
from fvsolve.studies.peak_error import peak_errors, troughs
from fvsolve.studies.resolution import refined_keys
from fvsolve.studies.separated_peaks import (
    first_peak,
    remainders_beyond,
    separate_maxima,
    separated_error,
)


def stopped_column(cells: int = 24) -> dict:
    """Column of 100 m that leaves a closing end, separates, and returns twice."""
    water = {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 2300.0,
        "cavitation": True,
    }
    flow = 0.25 * math.pi * 0.1**2 * 0.8
    nodes = {"lake": lake(30.0, elevation=0.0)}
    nodes["end"] = junction({"start": 0.1, "duration": 0.02, "value": [flow, 0.0]}, elevation=0.0)
    links = {
        "main": pipe(
            "lake", "end", 100.0, 0.1, 1000.0, cells, friction={"model": "steady", "factor": 0.02}
        )
    }
    limits = {"vacuum": {"on": "main", "quantity": "gauge_pressure", "minimum": "-0.4 bar"}}
    case = scene(
        nodes, links, 1.4, {}, ["end.pressure", "end.head", "main.flow@1"], 0.005, limits=limits
    )
    return case | {"fluid": water}


def test_bands_of_a_separated_column() -> None:
    case = fvsolve.load(stopped_column())
    found = peak_errors(fvsolve.run(case, pictures=False), case)
    fine = fvsolve.run(case, set=refined_keys(case, 8.0), pictures=False)
    pressure, head, flow = found["peaks"].values()
    assert found["cavities"]
    # the start: flow and head of the steady state
    assert (
        flow["maximum"]["error"] <= 1e-4 * flow["maximum"]["value"]
        and flow["maximum"]["first"]["error"] == 0.0
    )
    # vapour: no pressure is below 2300 Pa, and no head below that of this pressure
    assert pressure["minimum"]["error"] <= pressure["minimum"]["value"] - 2300.0 + 1.0
    assert head["minimum"]["error"] <= 0.05
    assert found["verdicts"][0]["state"] == "fails"
    # the first peak after the collapse
    first = pressure["maximum"]["first"]
    near = abs(fine.t - first["time"]) < 0.15
    true = abs(float(fine["end.pressure"][near].max()) - first["value"])
    assert true <= first["error"] <= 3.0 * true
    assert (
        abs(fine.extremes["end.pressure"].maximum - pressure["maximum"]["value"])
        <= pressure["maximum"]["error"]
    )


@pytest.mark.parametrize("order", [0.75, 1.0, 2.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_it_holds_an_error_of_any_order_and_is_at_most_twice_as_large(
    order: float, sign: float
) -> None:
    values = [3.0 + sign * 0.1 * h**order for h in (1.0, 0.5, 0.25)]
    found = separated_error(values, np.array([values]))
    assert 0.1 <= found <= 0.2


def test_no_value_is_above_the_ceiling() -> None:
    rising = np.array([[1.0, 1.2, 1.3]])
    assert separated_error([1.0, 1.2, 1.3], rising, 1.1) == pytest.approx(0.1)
    assert separated_error([1.0, 1.0, 1.0], rising, 1.0) == 0.0
    assert remainders_beyond(np.array([[1.0, 1.0, 1.0]])) == 0.0


def bumps(late: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a signal that falls from 1, and has peaks of 1.5 and `height` at 2 s and 4 s."""
    t = np.linspace(0.0, 6.0, 6001)
    peaks = 1.5 * np.exp(-(((t - 2.0 - late) / 0.2) ** 2)) + height * np.exp(
        -(((t - 4.0 - late) / 0.2) ** 2)
    )
    return t, np.maximum(1.0 - 2.0 * t, 0.0) + peaks


def test_later_peaks_do_not_widen_the_band_of_the_first() -> None:
    signals = [bumps(late, height) for late, height in ((0.1, 1.2), (0.05, 1.6), (0.02, 2.2))]
    first = first_peak(signals, troughs)
    assert (
        first["value"] == pytest.approx(1.5)
        and first["time"] == pytest.approx(2.1)
        and first["error"] < 1e-6
    )
    values, times = separate_maxima(signals, troughs)
    # the start, and both peaks
    assert len(values) == 3 and times[:, 0] == pytest.approx([0.0, 2.1, 4.1])
    assert separated_error([1.5, 1.6, 2.2], values) >= 0.7


def test_a_signal_that_falls_from_its_start_has_its_peak_there() -> None:
    t = np.linspace(0.0, 1.0, 101)
    falling = [(t, np.exp(-t * (1.0 + k))) for k in range(3)]
    assert first_peak(falling, troughs) == {"value": 1.0, "time": 0.0, "error": 0.0}
