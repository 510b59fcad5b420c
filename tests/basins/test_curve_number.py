"""Infiltration by the curve number of the SCS: closed forms, published runoff, and water that stands."""

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended
from reference.rainfall import field

import fvsolve

BY_METHOD = {
    "ssp-rk2": {"courant": 0.9},
    "rk4": {"courant": 0.9},
    "dormand-prince": {"rtol": 1e-6},
    "tr-bdf2": {"step": 5.0},
    "radau-iia-5": {"rtol": 1e-7},
    "rodas-5p": {"rtol": 1e-7},
}
INCH = 0.0254


def infiltrated(rain, number, loss=0.0):
    """Infiltrated height of a height of rain, all [m]: the loss, then p S / (p + S) of the rest p."""
    storage = INCH * (1000.0 / number - 10.0)
    rest = np.maximum(rain - loss, 0.0)
    return np.minimum(rain, loss) + rest * storage / (rest + storage)


@pytest.mark.in_turn
@pytest.mark.parametrize("method", BY_METHOD)
@pytest.mark.parametrize("loss", [0.0, 0.017])
def test_a_curve_number_under_steady_rain_is_its_closed_form(method, loss):
    soil = {"model": "curve-number", "number": 75, "initial_loss": loss}
    numerics = {"courant": None, "method": method} | BY_METHOD[method]
    found = fvsolve.run(field(7200.0, numerics, rain="50 mm/h", infiltration=soil))
    exact = infiltrated(50e-3 * found.t / 3600.0, 75.0, loss)
    assert found["field.infiltrated"] / 100.0 == approx(exact, rel=1e-4, abs=1e-9)
    assert found.summary["ledgers"]["mass"]["relative"] < 1e-12


@pytest.mark.parametrize(
    "rain, number, runoff", [(5.0, 80, 2.89), (6.0, 75, 3.28), (3.0, 90, 1.98)]
)
def test_runoff_with_a_loss_of_a_fifth_of_the_storage_is_that_of_tr_55(rain, number, runoff):
    """Table 2-1 of TR-55 (USDA 1986), in inches."""
    loss = f"{0.2 * (1000.0 / number - 10.0)} in"
    soil = {"model": "curve-number", "number": number, "initial_loss": loss}
    numerics = {"courant": None, "method": "rodas-5p", "rtol": 1e-7}
    found = fvsolve.run(field(3600.0, numerics, rain=f"{rain} in/h", infiltration=soil))
    assert found["field.volume"][-1] / 100.0 / INCH == approx(runoff, abs=0.005)


def test_curve_numbers_of_cells_are_their_closed_forms():
    soil = {"model": "curve-number", "number": "70 + 2*x", "initial_loss": "0.001*y"}
    numerics = {"courant": None, "method": "rodas-5p", "rtol": 1e-8}
    case = field(3600.0, numerics, level=0.5, rain="50 mm/h", infiltration=soil)
    model, state = ended(case)
    x, y = model.meshed[0].mesh.centre.T
    at = int(model.meshed[0].row["infiltrated"])
    exact = infiltrated(50e-3, 70.0 + 2.0 * x, 0.001 * y)
    assert np.ptp(exact) > 1e-3 and state.y[at : at + 16] == approx(exact, rel=1e-6)


def test_infiltration_depends_on_the_height_of_rain_and_not_on_its_times():
    rain = {"time": [0.0, 600.0, 1800.0, 2400.0], "value": [3e-5, 0.0, 1e-5, 0.0], "kind": "step"}
    soil = {"model": "curve-number", "number": 75}
    numerics = {"courant": None, "method": "dormand-prince", "rtol": 1e-7}
    found = fvsolve.run(field(3600.0, numerics, rain=rain, infiltration=soil))
    exact = infiltrated(600.0 * 4e-5, 75.0)
    assert found["field.infiltrated"][-1] / 100.0 == approx(exact, rel=1e-6)


def test_water_that_stands_without_rain_stays_above_a_soil_with_a_curve_number():
    soil = {"model": "curve-number", "number": 40, "initial_loss": "10 mm"}
    found = fvsolve.run(field(600.0, level=0.1, infiltration=soil))
    assert not found["field.infiltrated"].any() and np.ptp(found["field.volume"]) == 0.0


def test_a_curve_number_of_100_takes_the_initial_loss_alone():
    for loss in (0.0, 0.01):
        soil = {"model": "curve-number", "number": 100, "initial_loss": loss}
        numerics = {"courant": None, "step": 0.5}
        found = fvsolve.run(field(1200.0, numerics, rain="50 mm/h", infiltration=soil))
        assert found["field.infiltrated"][-1] / 100.0 == approx(loss, abs=50e-3 / 3600.0 * 0.5)
        assert found["field.infiltrated"].any() == (loss > 0.0)


FAULTS = {
    "number is missing": {},
    "between 1 and 100": {"number": 101},
    "expected 1 to 100": {"number": "10*(x - 5)"},
    "is not a key of the model": {"number": 75, "rate": 0.0},
    "initial_loss": {"number": 75, "initial_loss": "-1 mm"},
}


@pytest.mark.parametrize("text", FAULTS)
def test_curve_numbers_that_cannot_be_are_named(text):
    soil = {"model": "curve-number", **FAULTS[text]}
    with pytest.raises(fvsolve.FvsolveError, match=text):
        fvsolve.load(field(1.0, infiltration=soil))
