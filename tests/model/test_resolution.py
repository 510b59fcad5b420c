"""Notices for pipes with too few cells, for every scheme."""

from copy import deepcopy

import pytest
from reference.pump_stations import station
from reference.scenes import junction, lake, pipe, ramp, reservoir, scene, step, valve

import fvsolve
from fvsolve.case import load, shipped
from fvsolve.core.model.start_notices import OTHER_CELLS, SCHEME_CELLS
from fvsolve.core.run import model_of

CLOSURE = {"output.fields": 0}
KINDS = ("upwind", "muscl", "upwind3", "upwind5", "weno5")


def opening(duration: float) -> dict:
    return {"links.valve.opening": {"start": 1.0, "duration": duration, "value": [1.0, 0.0]}}


def resolution_notices(case, settings: dict | None = None) -> list:
    """Notices on numbers of cells and on costs."""
    return [
        one
        for one in model_of(load(case, settings or {})).warnings
        if one.key == "cells" or one.kind == "cost"
    ]


def peaks(settings: dict) -> list[float]:
    found = fvsolve.run("valve-closure", set=CLOSURE | settings, pictures=False).summary[
        "extremes"
    ]["gate.pressure"]
    return [found["minimum"], found["maximum"]]


@pytest.mark.parametrize("duration", [0.0, 0.05, 1.5, 4.0])
def test_cells_without_a_notice_give_peaks_to_a_tenth(duration: float) -> None:
    right = peaks(opening(duration) | {"links.main.cells": 400, "numerics.scheme": "weno5"})
    for scheme in KINDS:
        enough = SCHEME_CELLS.get(scheme, OTHER_CELLS)
        chosen = opening(duration) | {"numerics.scheme": scheme, "links.main.cells": enough}
        assert not resolution_notices("valve-closure", chosen)
        off = [
            abs(a - b) / (right[1] - right[0]) for a, b in zip(peaks(chosen), right, strict=True)
        ]
        assert max(off) < 0.1, (scheme, off)
        (note,) = resolution_notices("valve-closure", chosen | {"links.main.cells": enough - 1})
        assert (note.place, note.key, note.value, note.limit) == (
            "links.main",
            "cells",
            enough - 1,
            enough,
        )


@pytest.mark.parametrize("cells", range(1, 9))
def test_a_closure_that_few_cells_flatten_is_noted(cells: int) -> None:
    """A closure on one to eight cells gives a notice; its peaks err by up to 40 %."""
    (note,) = resolution_notices("valve-closure", {"links.main.cells": cells})
    assert (
        note.value == cells
        and f"links.main.cells = {OTHER_CELLS}" in note.text
        and "links.valve.opening" in note.text
    )


def test_slow_or_exact_parts_need_no_cells() -> None:
    assert not resolution_notices(
        "valve-closure", opening(100.0) | {"links.main.cells": 2, "numerics.end": 120.0}
    )
    sharp = {"numerics.scheme": "upwind", "numerics.method": "euler", "numerics.courant": 1.0}
    assert not resolution_notices("valve-closure", sharp | {"links.main.cells": 4})
    assert resolution_notices(
        "valve-closure", sharp | {"links.main.cells": 4, "numerics.courant": 0.5}
    )
    assert not resolution_notices(
        "valve-closure", {"numerics.pipe_model": "delay-line", "links.main.cells": 4}
    )


def behind_a_stub(closure: dict | float, length: float = 8.0, cells: int = 1) -> dict:
    nodes = {"lake": lake(50.0), "j": junction(), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe("lake", "j", 1000.0, 0.3, 1000.0, 100),
        "short": pipe("j", "gate", length, 0.15, 1000.0, cells),
        "tap": valve("gate", "out", 1e-3, closure),
    }
    return scene(
        nodes, links, 2.0, {"scheme": "muscl", "pipe_model": "finite-volume"}, ["gate.head"]
    )


def test_a_short_pipe_counts_next_to_events_quicker_than_its_waves() -> None:
    (note,) = resolution_notices(behind_a_stub(step(0.5, 1.0, 0.0)))
    assert (note.place, note.value, note.limit) == ("links.short", 1, OTHER_CELLS)
    assert not resolution_notices(behind_a_stub(ramp(0.5, 0.05, 1.0, 0.0)))
    assert not resolution_notices(behind_a_stub(step(0.5, 1.0, 0.0), cells=OTHER_CELLS))
    turned = behind_a_stub(step(0.5, 1.0, 0.0))
    turned["links"]["short"] |= {"from": "gate", "to": "j"}
    assert resolution_notices(turned)[0].text == note.text


def test_the_same_event_as_a_table_a_signal_or_a_trip_is_as_quick() -> None:
    case = behind_a_stub(1.0)
    case["links"]["main"]["cells"] = 5
    for said in (
        step(0.5, 1.0, 0.0),
        {"signal": "shut"},
        {"time": [0.4, 0.5, 0.501], "value": [1.0, 0.99, 0.0]},
    ):
        one = deepcopy(case) | (
            {"signals": {"shut": step(0.5, 1.0, 0.0)}} if "signal" in said else {}
        )
        one["links"]["tap"]["opening"] = said
        (note,) = resolution_notices(one)
        assert note.place == "links.main" and "links.tap.opening" in note.text
    burst = deepcopy(case)
    burst["nodes"]["j"]["demand"] = step(0.5, 0.0, 0.01)
    (note,) = resolution_notices(burst)
    assert "nodes.j.demand" in note.text


def test_no_shipped_case_has_too_few_cells() -> None:
    few = {name: resolution_notices(name) for name in shipped.names()}
    assert {
        name for name, notes in few.items() if [one for one in notes if one.limit in (3, 6, 10, 40)]
    } == set()


def test_a_piece_of_1_cell_between_a_check_valve_and_a_vessel_is_noted_once() -> None:
    (note,) = resolution_notices(station())
    assert (note.kind, note.place, note.key, note.value, note.limit) == (
        "cells",
        "links.main-1",
        "cells",
        1,
        3,
    )
    for said in (
        "vessel",
        "flap",
        "chainage 0 m to 20 m of main",
        "links.main.cells = 325",
        "links.main-1.cells = 3",
    ):
        assert said in note.text
    for remedy in ({"links.main.cells": 325}, {"links.main-1.cells": 3}):
        assert not [one for one in resolution_notices(station(), remedy) if one.kind == "cells"], (
            remedy
        )
    assert not [one for one in resolution_notices(station(at="1.2 km")) if one.kind == "cells"]
    (turned,) = resolution_notices(turned_station())
    assert (turned.place, turned.value) == (
        "links.main-2",
        1,
    ) and "chainage 2580 m to 2600 m of main" in turned.text


def turned_station() -> dict:
    case = station(at=2580.0)
    case["links"]["main"] |= {"from": "top", "to": "out"}
    return case


def test_a_pipe_drawn_explicitly_is_noted_as_a_piece_is() -> None:
    case = station()
    del case["nodes"]["vessel"]["on"], case["nodes"]["vessel"]["at"]
    case["nodes"]["vessel"]["elevation"] = 0.4
    main = case["links"]["main"]
    case["links"] |= {
        "main": main | {"to": "vessel", "length": 20.0, "cells": 2},
        "rest": main | {"from": "vessel", "length": 2580.0},
    }
    (note,) = resolution_notices(case)
    assert (note.place, note.value) == ("links.main", 2) and note.text.endswith(
        "links.main.cells = 3 or more"
    )


def test_a_piece_far_shorter_than_a_cell_states_its_cost() -> None:
    case = station(at=0.5)
    case["nodes"]["vessel"] = {"type": "junction", "on": "main", "at": 1300.5}
    case["nodes"]["spot"] = {"type": "junction", "on": "main", "at": 1300.0}
    (note,) = resolution_notices(case)
    assert (note.kind, note.place) == ("cost", "links.main-2") and note.value == pytest.approx(
        2600 / 60 / 0.5, rel=0.02
    )
    assert "chainage 1300 m to 1300.5 m of main" in note.text
    (both,) = resolution_notices(station(at=0.5))
    assert both.kind == "cells" and "steps are 86.7 times shorter" in both.text
