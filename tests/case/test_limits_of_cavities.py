"""A limit at vapour pressure fails where a cavity opens, though no pressure is lower; NaN satisfies no limit."""

from __future__ import annotations

import math
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from reference.scenes import AMBIENT, GRAVITY, RHO, SHARP, area, junction, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.output.memory_sink import MemorySink
from fvsolve.report.cycles import cycles
from fvsolve.report.figures import section_figure
from fvsolve.report.long_section import head_window, section_of, section_paths
from fvsolve.report.report_files import write_report
from fvsolve.run import model_of
from fvsolve.run.verdicts import nearest, part_extremes, verdict
from fvsolve.solve import initial_state, solve
from fvsolve.studies.calibrate import calibrate
from fvsolve.studies.closure_optimisation import optimise
from fvsolve.studies.sizing import size

BOILS = 2300.0  # [Pa], vapour pressure of the water in reference/scenes.py
BELOW = (BOILS - AMBIENT) / (RHO * GRAVITY)  # [m], head of the vapour pressure
LEAST = {
    "pressure": BOILS,
    "gauge_pressure": BOILS - AMBIENT,
    "head": -12.0,
    "pressure_head": -12.0,
}  # no head is as low as -12 m


def parting(limits: dict, turned: bool = False, opening: float = 0.1, **more) -> dict:
    """Case of a pipe shut in 0.1 s: 5 m/s times a / g is 510 m, and the column separates at the gate after 2 L / a."""
    nodes = {"lake": lake(20.0, elevation=0.0), "gate": junction(elevation=0.0),
             "air": reservoir(1e5, elevation=0.0)}  # fmt: skip
    ends = ("gate", "lake") if turned else ("lake", "gate")
    links = {"main": pipe(*ends, 300.0, 0.2, 1000.0, 30),
             "tap": valve("gate", "air", opening * area(0.2), ramp(0.1, 0.1, 1.0, 0.0))}  # fmt: skip
    case = scene(nodes, links, 1.2, {}, ["gate.head", "gate.pressure"], limits=limits, **more)
    return case | {"fluid": {**case["fluid"], "law": "mixture", "air_fraction": 1e-7, "cavitation": True}}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("quantity", [*LEAST])
def test_a_limit_at_vapour_pressure_fails_where_a_cavity_opens(quantity: str, turned: bool) -> None:
    limits = {f"{on} {k}": {"on": on, "quantity": quantity, "minimum": least}
              for on in ("main", "gate") for k, least in enumerate(("vapor", LEAST[quantity]))}  # fmt: skip
    result = fvsolve.run(parting(limits, turned))
    (cavity,) = result.summary["cavities"]
    assert result.ok and not result.marks and len(result.verdicts) == 4
    for one in result.verdicts:
        assert one.state == "fails" and not one.ok and one.margin < 0.0, one.name
        assert one.place == one.name.partition(" ")[0]
        assert one.chainage == (pytest.approx(cavity["distance"]) if one.place == "main" else None)


@pytest.mark.parametrize("quantity", [*LEAST])
def test_it_holds_where_none_opens(quantity: str) -> None:
    quiet = fvsolve.run(parting({"a": {"on": "main", "quantity": quantity, "minimum": "vapor"}}, opening=1e-3))
    assert not quiet.summary["cavities"] and quiet.verdicts[0].state == "holds"
    above = {
        "on": "gate",
        "quantity": "pressure",
        "minimum": 1.5 * BOILS,
    }  # above vapour pressure, numbers are compared
    (found,) = fvsolve.run(parting({"a": above})).verdicts
    assert found.limit == 1.5 * BOILS and found.state == "fails"


def test_the_vapour_line_is_drawn_where_cavities_are_followed(tmp_path) -> None:
    result = fvsolve.run(parting({}), out=tmp_path / "run", pictures=False)
    one = section_of(result, section_paths(result)[0])
    assert one.lines["vapour line"] == pytest.approx(one.along["elevation"] + BELOW, abs=1e-3)
    assert "vapour line" in [line["name"] for line in section_figure(one, None, "m", "m", 50)["data"]]
    assert one.cavity_spans and not head_window([one], "m").below
    book = write_report(result.directory, tmp_path / "page.html", xlsx=True)[1]
    with zipfile.ZipFile(book) as parts:
        sheets = [parts.read(name).decode() for name in parts.namelist() if "worksheets/sheet" in name]
    assert any(f"<v>{one.lines['vapour line'][0]:.6g}"[:10] in text for text in sheets)


# values that are not numbers ----------------------------------------------------------------------------------------


def weightless(**more) -> dict:
    """Case without gravity, in which heads are not numbers but pressures are."""
    nodes = {"lake": reservoir(3e5), "gate": junction(), "air": reservoir(1e5)}
    links = {"main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 6),
             "tap": valve("gate", "air", 0.02 * area(0.2), ramp(0.1, 0.5, 1.0, 0.0))}  # fmt: skip
    return scene(nodes, links, 0.8, SHARP, ["gate.head", "gate.pressure"], **more) | {"gravity": 0.0}


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("bounds", [{"minimum": 1e4}, {"maximum": 1e6}, {"minimum": 1e4, "maximum": 1e6}])
def test_a_value_that_is_no_number_never_holds(wrong: float, bounds: dict) -> None:
    """Both extremes of a single place are not numbers; all other places satisfy the limit."""
    model = model_of(weightless(limits={"a": {"on": "main", **bounds}}))
    summary = solve(model, initial_state(model), MemorySink(model))
    limit = model.case.limits["a"]
    (part,) = part_extremes(model, summary, limit.extent)
    spoilt = {
        side: np.where(np.arange(part.minimum.size) == 2, wrong, getattr(part, side)) for side in ("minimum", "maximum")
    }
    states = {one.state for one in nearest(model, summary, limit, replace(part, **spoilt), True)}
    assert "holds" not in states and {one.state for one in nearest(model, summary, limit, part, True)} == {"holds"}
    assert states == {"open"} or not math.isnan(wrong)


def test_a_place_that_is_passed_fails_beside_one_that_is_not_known() -> None:
    rows = [{"name": "a", "quantity": "head", "until": 1.0, "state": state, "margin": margin, "bound": "minimum"}
            for state, margin in (("holds", 1.0), ("open", None), ("fails", -2.0))]  # fmt: skip
    assert verdict(rows)["state"] == "fails" and verdict(rows[:2])["state"] == "open"


def test_a_claim_of_no_number_fails() -> None:
    claims = {text: {"value": 30.0, "atol": 1e9} for text in ("max(gate.head)", "max(main.head)",
              "final(gate.head)", "mean(gate.head)", "at(gate.head, 0.5 s)")}  # fmt: skip
    result = fvsolve.run(weightless(expect=claims))
    assert [one.ok for one in result.expectations] == [False] * 5


def test_a_search_takes_no_peak_that_is_no_number() -> None:
    with pytest.raises(FvsolveError, match="finite"):
        optimise(weightless(), "links.tap.opening", "max(gate.head)", knots=1, runs=9)


def test_a_fit_takes_no_difference_that_is_no_number(tmp_path) -> None:
    (tmp_path / "head.csv").write_text("t [s],head [m]\n0.1,1\n0.2,2\n0.3,3\n")
    compare = {"gate.head": {"file": str(tmp_path / "head.csv")}}
    with pytest.raises(FvsolveError, match="not finite"):
        calibrate(weightless(compare=compare), {"links.main.wave_speed": (900.0, 1100.0)})


def test_cycles_of_no_numbers_last_no_time() -> None:
    with pytest.raises(FvsolveError, match="not finite"):
        cycles(fvsolve.run(weightless()), ["gate.head"])


def test_a_size_counts_a_cavity_as_a_failure() -> None:
    """A quicker closure gives a deeper trough; the least closing time is one without cavity."""
    case = parting({"a": {"on": "main", "minimum": "vapor"}})
    found = size(case, "links.tap.opening.duration", "0.1 s", "20 s", rtol=0.2, set={"numerics.end": 3.0})
    assert found.value is not None and found.value > 0.1
    assert not found.runs[0].ok and not found.runs[0].open and found.runs[0].margin < 0.0
