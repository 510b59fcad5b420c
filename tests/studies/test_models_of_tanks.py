"""Water in moving tanks as frozen mass, modes or cells: the hierarchy of models states which form a case needs."""

import pytest
from reference.scenes import scene

from fvsolve.errors import FvsolveError
from fvsolve.studies import ladder


def rolling(rate: float, level: float = 0.2, **basin):
    """Case of a rolling hull with an initial rate, and a basin across it."""
    nodes = {
        "hull": {"type": "body", "mass": 3000.0, "inertia": [2e4] * 3,
                 "joint": {"kind": "revolute", "axis": [1, 0, 0], "rate": rate, "stiffness": 8e4}},
        "tank": {"type": "basin", "on": "hull", "at": [-0.5, -1.5, 0.3], "size": [1.0, 3.0], "cells": [1, 40],
                 "level": level, **basin},
    }  # fmt: skip
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.7}
    return scene(nodes, {}, 8.0, numerics, ["hull.angle", "tank.depth@0.5,0.1", "tank.u@0.5,0.1"], every=0.05)


def named(found, name):
    return next(one for one in found.rungs if one.name == name)


def test_small_waves_need_modes_and_great_ones_cells():
    small, great = ladder(rolling(1e-4), target=0.05), ladder(rolling(0.3), target=0.05)
    assert [one.name for one in small.rungs[:3]] == ["frozen", "modes", "cells"]
    assert small.cheapest.name == "modes" and named(small, "frozen").error > 0.3
    assert great.cheapest.name.endswith("cells") and named(great, "modes").error > 0.05
    assert set(named(small, "modes").errors) == {"hull.angle", "tank.depth@0.5,0.1"}
    assert set(named(small, "frozen").errors) == {"hull.angle"}


def test_it_says_how_far_from_shallow_a_tank_is():
    found = ladder(rolling(1e-4, level=1.0), target=0.05)
    (said,) = found.shallow_water
    assert (
        said == "tank: its slowest wave, with k h = 1 (wave number times depth), is 16 % too fast in shallow-water "
        "theory, more than the target: modes are more accurate for small waves"
    )


def test_a_rung_that_cannot_say_the_scene_is_skipped_with_its_reason():
    found = ladder(rolling(1e-4, manning=0.02))
    assert "modes have no friction" in named(found, "modes").reason
    assert named(found, "cells").error is not None


def test_a_scene_said_by_modes_has_the_same_rungs():
    case = rolling(1e-4, sloshing="modes")
    case["output"]["probes"] = ["hull.angle"]
    case["numerics"] = {"end": 8.0, "method": "rk4", "step": 0.02}
    found = ladder(case, target=0.05)
    assert [one.name for one in found.rungs[:3]] == ["frozen", "modes", "cells"] and found.cheapest.name == "modes"


def test_basins_that_do_not_ride_are_refused_by_name():
    case = rolling(1e-4)
    case["nodes"]["pond"] = {"type": "basin", "size": [1, 1], "cells": [4, 4], "level": 0.1}
    with pytest.raises(FvsolveError, match="does not support basins yet; the case has pond"):
        ladder(case)


def test_a_liquid_that_rides_is_no_tank_that_sloshes():
    """A liquid has no level, so a basin of it is refused by name."""
    liquid = {"physics": "liquid", "cells": [4, 4], "pressure": 5e5, "thickness": 0.1}
    case = rolling(1e-4, **liquid)
    case["output"]["probes"] = ["hull.angle"]
    del case["nodes"]["tank"]["level"]
    with pytest.raises(FvsolveError, match="chart --models does not support basins yet; the case has tank"):
        ladder(case, target=0.05)
