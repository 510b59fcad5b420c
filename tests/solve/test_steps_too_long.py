"""Steps beyond a limit are judged as they are really taken, also where a run or a segment has a single step."""

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, reservoir, scene, valve

import fvsolve
from fvsolve.core.run import model_of
from fvsolve.core.step_limits.grid_limits import pipe_limit
from fvsolve.core.step_limits.step_notices import first_step, steps_of

STEADY = {"model": "steady", "roughness": 0.26e-3}
SPEED, LENGTH, CELLS = 1200.0, 900.0, 10
CELL_TIME = LENGTH / CELLS / SPEED


def closing(opening: dict, **numerics) -> dict:
    """Main of 900 m in ten cells from a lake at 500 m to a valve that closes partly, for 2 s."""
    nodes = {"lake": lake(500.0), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe("lake", "gate", LENGTH, 0.3, SPEED, CELLS, friction=STEADY),
        "valve": valve("gate", "out", 0.0017, discharge_coefficient=0.6, opening=opening),
    }
    return scene(nodes, links, 2.0, {"scheme": "muscl", **numerics}, ["gate.pressure"], 0.01)


def ramp(start: float, duration: float, end: float) -> dict:
    return {"start": start, "duration": duration, "value": [1.0, end]}


def limit_notices(result) -> list:
    return [one for one in result.warnings if one.kind == "step-limit"]


LONG = [  # opening, method, key, value, greatest stable value of the key or None
    (ramp(1.0, 0.05, 0.5), "euler", "step", 10.0, None),
    (ramp(1.0, 0.05, 0.999), "ssp-rk3", "courant", 1e3, pipe_limit("fromm", "ssp-rk3", CELLS)),
    (ramp(0.0, 2.0, 0.5), "ssp-rk3", "courant", 1e3, pipe_limit("fromm", "ssp-rk3", CELLS)),
    (
        ramp(1.0, 0.05, 0.0),
        "ssp-rk3",
        "step",
        0.1,
        CELL_TIME * pipe_limit("fromm", "ssp-rk3", CELLS),
    ),
]


@pytest.mark.parametrize("opening, method, key, value, limit", LONG)
def test_steps_longer_than_a_segment_or_than_the_run_are_not_ok_and_the_greatest_stable_step_is_named(
    opening, method, key, value, limit
):
    result = fvsolve.run(closing(opening, method=method, **{key: value}))
    (notice,) = limit_notices(result)
    assert result.reason == "finished" and not result.ok and not notice.ok and notice.key == key
    if limit is None:
        assert "waves grow at every Courant number" in notice.text and "ssp-rk3" in notice.text
        return
    named = float(notice.text.rpartition("= ")[2].split()[0])
    assert 0.999 * limit <= named <= limit
    mended = fvsolve.run(closing(opening, method=method, **{key: named}))
    assert mended.ok and not limit_notices(mended)


def test_the_steps_of_a_run_end_at_breaks_and_at_least_a_single_step_is_taken():
    model = model_of(closing(ramp(1.0, 0.05, 0.5), method="euler", step=10.0))
    steps = steps_of(model, first_step(model))
    assert (steps.given, steps.longest, steps.count) == (10.0, 1.0, 3.0)
    steps = steps_of(model, 0.3)
    assert (steps.longest, steps.count) == (0.3, 4.0 + 1.0 + 4.0)


@pytest.mark.parametrize("method", ["euler", "ssp-rk2", "ssp-rk3", "rk4"])
@pytest.mark.parametrize("key", ["step", "courant"])
def test_every_run_beyond_the_limit_is_near_a_fine_run_or_not_ok(method, key):
    opening = ramp(0.1, 0.4, 0.5)
    fine = fvsolve.run(closing(opening, method="rk4", courant=0.2))["gate.pressure"]
    for courant in (1.1, 1.3, 2.0, 4.0, 10.0, 30.0, 300.0, 1e4):
        value = courant * CELL_TIME if key == "step" else courant
        result = fvsolve.run(closing(opening, method=method, **{key: value}))
        found = result["gate.pressure"]
        off = max(abs(found.min() - fine.min()), abs(found.max() - fine.max())) / np.ptp(fine)
        assert off < 0.02 or not result.ok, (courant, off)


@pytest.mark.parametrize("method", ["ssp-rk2", "ssp-rk3", "rk4"])
def test_a_run_within_its_limit_stays_ok(method):
    result = fvsolve.run(closing(ramp(0.1, 0.4, 0.5), method=method, courant=0.8))
    assert result.ok and not result.warnings
