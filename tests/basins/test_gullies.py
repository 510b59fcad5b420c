"""Gullies of streets: films dry out around them, crests lie below and above the bed, both directions are the same."""

import numpy as np
import pytest
from pytest import approx
from reference.scenes import scene

import fvsolve

CONDUIT = {
    "type": "conduit",
    "from": "s",
    "to": "river",
    "diameter": 0.4,
    "length": 60.0,
    "inverts": [8.0, 7.3],
    "manning": 0.013,
    "cells": 15,
}
RAIN = {"time": [0.0, 60.0, 240.0, 300.0], "value": ["0 mm/h", "70 mm/h", "70 mm/h", "0 mm/h"]}


def street(crest: float, below: str, end: float, **basin) -> dict:
    """Case of a street of 40 m x 8 m with a gully at (31, 5) m, above a shaft with a conduit or above a river."""
    own = {
        "type": "basin",
        "elevation": 0.0,
        "size": [40.0, 8.0],
        "cells": [20, 4],
        "level": 0.0,
        "manning": 0.016,
        "patches": {
            "gully": {"at": [31.0, 5.0], "area": 4.0},
            "end": {"side": "east", "normal_slope": 0.01},
        },
    }
    nodes = {"street": own | basin, "river": {"type": "reservoir", "elevation": 7.0, "head": 7.5}}
    if below == "s":
        nodes["s"] = {"type": "tank", "area": 1.2, "elevation": 8.0, "level": 0.05}
    links = {
        "m": {
            "type": "manhole",
            "from": "street.gully",
            "to": below,
            "crest": crest,
            "area": 0.3,
            "perimeter": 2.0,
        }
    }
    links |= {"p": CONDUIT} if below == "s" else {}
    return scene(nodes, links, end, {"scheme": "muscl"}, ["m.flow", "street.volume"], 10.0)


NOISY = "10 + 0.01*(40-x) + 0.03*y + 0.02*sin(7*x)*cos(5*y)"


@pytest.mark.parametrize("below", ["river", "s"])
def test_a_film_dries_out_next_to_a_gully_that_passes_nothing(below):
    """Newton's method stopped here at 3556 and 3498 s, at flows of 1e-11 m3/s."""
    found = fvsolve.run(street(10.6, below, 3600.0, bed=NOISY, rain=RAIN))
    assert found.ok and found.summary["ledgers"]["mass"]["relative"] < 1e-12
    assert np.abs(found["m.flow"]).max() == 0.0


@pytest.mark.parametrize("crest", [9.31, 10.3, 10.31, 10.4])
def test_steps_at_a_gully_are_those_of_waves_with_its_crest_at_any_height(crest):
    """A wave runs over a dry street, whose bed is 10.31 m at the gully; the step fell to 0.25 ms."""
    stage = {"time": [0.0, 60.0, 100.0], "value": [9.9, 10.5, 10.5]}
    patches = {"gully": {"at": [31.0, 5.0], "area": 4.0}, "end": {"side": "west", "stage": stage}}
    found, shut = (
        fvsolve.run(street(top, "s", 100.0, bed="10 + 0.01*x", patches=patches))
        for top in (crest, 30.0)
    )
    assert found.ok and found.summary["ledgers"]["mass"]["relative"] < 1e-12
    assert found.summary["steps"] < 2 * shut.summary["steps"]
    assert found["m.flow"][-1] > 0.01


def test_check_prints_a_crest_and_its_bed(fvs, tmp_path):
    from fvsolve.core.run import model_of

    low, high = (
        model_of(street(crest, "river", 1.0, bed="10 + 0.01*x")).meshed[0].chain_texts()
        for crest in (10.3, 10.6)
    )
    assert low == [
        "m: crest 10.3 m, 0.01 m below the lowest bed of street.gully; "
        "surface around it at the start 10.29 m to 10.33 m"
    ]
    assert "0.29 m above the lowest bed of street.gully" in high[0]


LAWS = {
    "manhole": {"crest": 0.1, "area": 0.28, "perimeter": 1.9},
    "weir": {"crest": 0.05, "width": 1.0},
    "sluice-gate": {"sill": 0.02, "width": 0.5, "opening": 0.05},
    "culvert": {
        "diameter": 0.3,
        "length": 5.0,
        "inverts": [-0.1, -0.3],
        "manning": 0.013,
        "inlet": "circular-concrete-square-edge",
    },
    "valve": {"area": 0.02},
}


@pytest.mark.parametrize("level", [0.5, 2.4], ids=["down", "up"])
@pytest.mark.parametrize("kind", LAWS)
def test_a_structure_drawn_from_the_shaft_to_the_street_passes_the_same_water(kind, level):
    """A manhole drawn the other way passed -0.02687 in place of -0.00798 m3/s."""
    results = []
    for turned in (False, True):
        ends = ["shaft", "street.gully"] if turned else ["street.gully", "shaft"]
        keys = dict(LAWS[kind])
        if turned and "inverts" in keys:
            keys["inverts"] = keys["inverts"][::-1]
        nodes = {
            "street": {
                "type": "basin",
                "elevation": 0.0,
                "size": [10.0, 10.0],
                "cells": [10, 10],
                "level": 0.12,
                "patches": {"gully": {"at": [5.0, 5.0], "area": 1.0}},
            },
            "shaft": {"type": "tank", "area": 20.0, "elevation": -2.0, "level": level},
        }
        link = {"type": kind, "from": ends[0], "to": ends[1], **keys}
        results.append(
            fvsolve.run(scene(nodes, {"lid": link}, 5.0, {}, ["lid.flow", "street.volume"], 1.0))
        )
    forward, back = results
    scale = np.abs(forward["lid.flow"]).max()
    assert scale > 1e-4
    assert back["lid.flow"] == approx(-forward["lid.flow"], rel=1e-9, abs=1e-12 * scale)
    assert back["street.volume"] == approx(forward["street.volume"], rel=1e-12)
