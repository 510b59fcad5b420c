"""Notices of unusual values of water with a free surface, one each."""

import pytest
from reference.scenes import lake, scene

import fvsolve

# flow through the side at a depth of 0.5 m and a Froude number of 1 [m3/s]
CRITICAL = 4.0 * (9.80665 * 0.5**3) ** 0.5


def notices(end=1.0, links=None, nodes=None, **basin) -> list[str]:
    """Texts of the notices of the range and of cells of a run with a basin of 20 m x 4 m."""
    pool = {
        "type": "basin",
        "elevation": 0.0,
        "size": [20.0, 4.0],
        "cells": [20, 4],
        "level": 0.5,
        "patches": {},
    }
    case = scene(
        {"pool": pool | basin, **(nodes or {})},
        links or {},
        end,
        {"courant": 0.9},
        ["pool.volume"],
        end,
    )
    return [
        notice.text
        for notice in fvsolve.run(case).warnings
        if notice.kind in ("range", "cells", "slope")
    ]


def inflow(**keys) -> dict:
    return {"up": {"side": "west", **keys}}


def test_usual_values_have_no_notice():
    assert (
        notices(
            manning=0.03, bed="0.01*x", level=1.0, rain="20 mm/h", patches=inflow(discharge=1.0)
        )
        == []
    )


@pytest.mark.parametrize("manning", [0.007, "0.007 + 0*x", 0.31, "0.3 + 0.001*(x > 19)"])
def test_roughness_outside_that_of_beds_has_a_notice(manning):
    (text,) = notices(manning=manning)
    assert "manning" in text and "outside 0.008 to 0.3, smooth plastic to dense grass" in text


def test_rain_is_printed_in_millimetres_an_hour():
    (text,) = notices(rain="501 mm/h")
    assert text == "nodes.pool.rain: 501 mm/h is outside 0.0036 to 500 mm/h, drizzle to cloudburst"
    (text,) = notices(rain={"time": [0.0, 1.0], "value": ["0 mm/h", "20 in/h"]})
    assert "508 mm/h is outside" in text


@pytest.mark.parametrize("rain", ["1.5e-4*x/10", "2e-4*(y > 3) + 1e-5"])
def test_a_formula_of_intense_rain_has_a_notice(rain):
    """Greatest rates: the cells at x = 19.5 m and at y = 3.5 m. A formula of time is compared as a schedule is."""
    (text,) = notices(rain=rain)
    assert (
        text
        == f"nodes.pool.rain: {1053 if 'x' in rain else 756} mm/h is above 500 mm/h, drizzle to cloudburst"
    )
    assert notices(rain=rain.replace("e-4", "e-5")) == []
    (text,) = notices(rain="1.5e-4*sin(3.14159*t)**2 + 1e-6")
    assert (
        text == "nodes.pool.rain: 543.6 mm/h is outside 0.0036 to 500 mm/h, drizzle to cloudburst"
    )


@pytest.mark.parametrize("bed, steep", [("0.11*x", True), ("0.09*x", False), ("0.11*y", True)])
def test_rain_on_steep_beds_has_a_notice(bed, steep):
    found = notices(rain="20 mm/h", bed=bed, level=2.5)
    assert [text for text in found if "rain falls on a bed with slopes up to 0.11" in text] == found
    assert bool(found) is steep
    assert notices(bed=bed, level=2.5) == []


@pytest.mark.parametrize("flow, subcritical", [(0.99 * CRITICAL, True), (1.01 * CRITICAL, False)])
def test_a_subcritical_inflow_with_a_depth_has_a_notice(flow, subcritical):
    found = notices(patches=inflow(discharge=flow, depth=0.5), level=0.1)
    assert any("subcritical at 0 s (Froude number 0.99)" in text for text in found) is subcritical
    assert len(found) == subcritical


def test_an_inflow_held_at_critical_flow_has_a_notice():
    """Down a steep slope the water runs off faster than waves; the same flow into deep water does not."""
    steep = {"bed": "0.05*(20 - x)", "manning": 0.01, "level": -1.0, "elevation": 0.0}
    (text,) = notices(
        10.0,
        patches=inflow(discharge=2.0) | {"down": {"side": "east", "boundary": "open"}},
        **steep,
    )
    assert (
        "pool.up: the inflow of 2 m3/s at 10 s enters at critical depth" in text
        and "give the `depth`" in text
    )
    assert notices(10.0, patches=inflow(discharge=2.0), level=2.0) == []


@pytest.mark.parametrize("width, narrow", [(0.9, True), (1.0, False)])
def test_a_structure_narrower_than_a_cell_has_a_notice(width, narrow):
    weir = {"type": "weir", "from": "pool.up", "to": "pond", "width": width, "crest": 0.4}
    found = notices(
        nodes={"pond": lake(0.3, elevation=-1.0)}, links={"spill": weir}, patches=inflow()
    )
    assert [
        text
        for text in found
        if text.startswith("spill is narrower than the cells at pool.up, 1 m")
    ] == found
    assert bool(found) is narrow


@pytest.mark.parametrize("width, wide", [(4.1, True), (4.0, False)])
@pytest.mark.parametrize("kind", ["weir", "sluice-gate"])
def test_a_structure_wider_than_its_patch_has_a_notice(kind, width, wide):
    keys = {"weir": {"crest": 0.4}, "sluice-gate": {"sill": 0.0, "opening": 0.1}}[kind]
    link = {"type": kind, "from": "pond", "to": "pool.up", "width": width, **keys}
    found = notices(
        nodes={"pond": lake(0.3, elevation=-1.0)},
        links={"x": link},
        patches=inflow(span=[1.0, 3.0]),
    )
    assert [
        text for text in found if text.startswith("x is wider than the side of pool.up, 4 m: ")
    ] == found
    assert bool(found) is wide


@pytest.mark.parametrize(
    "opening, far", [(0.4, False), (2.0, True), ({"time": [0, 1], "value": [0.4, 9]}, False)]
)
def test_a_gate_far_above_the_water_at_the_start_has_a_notice(opening, far):
    gate = {
        "type": "sluice-gate",
        "from": "pool.up",
        "to": "pond",
        "width": 4.0,
        "sill": 0.0,
        "opening": opening,
    }
    found = notices(nodes={"pond": lake(0.3, elevation=-1.0)}, links={"x": gate}, patches=inflow())
    assert [
        "x: the opening of 2 m above the sill is above the water there" in text for text in found
    ] == far * [True]


def test_check_does_not_list_the_cells_behind_a_linked_patch():
    weir = {"type": "weir", "from": "pool.up", "to": "pond", "width": 4.0, "crest": 0.4}
    pool = {
        "type": "basin",
        "elevation": 0.0,
        "size": [20.0, 4.0],
        "cells": [20, 4],
        "level": 0.5,
        "patches": inflow(),
    }
    nodes = {"pool": pool, "pond": lake(0.3, elevation=-1.0)}
    case = fvsolve.load(scene(nodes, {"spill": weir}, 1.0, {"courant": 0.9}, ["spill.flow"], 1.0))
    assert {*fvsolve.build(case).checks["nodes"]} == {"pool.up", "pond"}
