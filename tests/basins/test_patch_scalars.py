"""Scalars in the flow of links through patches of water, against closed forms and other arrangements."""

import math
from importlib import import_module

import numpy as np
import pytest
from pytest import approx
from reference.basins import assert_equal_files, ended, halved, model_of, run_in_two_parts
from reference.jacobians import stray
from reference.meshes import boundary, triangles, write
from reference.scenes import GRAVITY as G
from reference.scenes import inflow, lake, scene

import fvsolve

LONG, WIDE, DEEP, FLOW = 20.0, 2.0, 1.0, 1.0  # [m], [m], [m], [m3/s]
METHODS = {
    "ssp-rk3": {},
    "dormand-prince": {"rtol": 1e-7, "courant": None},
    "radau-iia-5": {"rtol": 1e-7, "courant": None},
    "rodas-5p": {"rtol": 1e-7, "courant": None},
}
DYE = {"dye": {"initial": 0.2}}


def orifice(start, end, area=0.5):
    return {"type": "orifice", "from": start, "to": end, "area": area, "discharge_coefficient": 0.6}


def on_mesh(basin: dict, folder) -> dict:
    """The same basin with the halves of its cells, or with triangles of equal size if it has an interior patch."""
    patches = {name: patch["side"] for name, patch in basin["patches"].items() if "side" in patch}
    if patches:
        points, cells, lines = halved(basin["size"], basin["cells"])
        groups = {name: lines[side] for name, side in patches.items()}
    else:
        points, cells = triangles(tuple(basin["size"]), 0.5)
        cells, groups = cells.tolist(), {"rim": boundary(cells)}
    write(folder / "t.msh", points, cells, groups)
    kept = {
        key: value
        for key, value in basin.items()
        if key not in ("size", "cells", *(["patches"] if patches else []))
    }
    return kept | {"mesh": {"file": str(folder / "t.msh")}}


def channel(dye, cells=40, numerics=None, sides=("west", "east"), turned=False):
    """Steady flow along a channel between an inflow with a dye and an orifice."""
    along, forward = sides[0] in ("west", "east"), sides[0] in ("west", "south")
    speed = (1.0 if forward else -1.0) * FLOW / (WIDE * DEEP)
    reach = {
        "type": "basin",
        "size": [LONG, WIDE] if along else [WIDE, LONG],
        "elevation": 0.0,
        "level": DEEP,
        "cells": [cells, 2] if along else [2, cells],
        "start": {"u" if along else "v": speed},
        "patches": {"inlet": {"side": sides[0]}, "outlet": {"side": sides[1]}},
    }
    head = DEEP - (FLOW / 0.3) ** 2 / (2.0 * G)  # passes FLOW through the orifice
    nodes = {
        "works": inflow(FLOW, elevation=0.0, scalars={"dye": dye}),
        "reach": reach,
        "river": lake(head, elevation=0.0),
    }
    ends = ("river", "reach.outlet") if turned else ("reach.outlet", "river")
    links = {"feed": orifice("works", "reach.inlet"), "gate": orifice(*ends)}
    given = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk3", "courant": 0.9} | (
        numerics or {}
    )
    given = {key: value for key, value in given.items() if value is not None}
    return scene(nodes, links, 80.0, given, ["reach.outlet.dye", "gate.flow"], 1.0, scalars=DYE)


TIMES = np.linspace(0.0, 40.0, 401)
PULSE = {"time": TIMES.tolist(), "value": (0.2 + 0.8 * np.sin(np.pi * TIMES / 40.0) ** 4).tolist()}


def delayed(t: np.ndarray) -> np.ndarray:
    """Dye that leaves: that of the inflow, later by volume over flow."""
    return np.interp(t - LONG * WIDE * DEEP / FLOW, PULSE["time"], PULSE["value"], left=0.2)


@pytest.mark.parametrize("method", METHODS)
def test_a_dye_passes_a_channel_in_its_volume_over_the_flow(method):
    numerics = {"method": method, **METHODS[method]}
    errors = []
    for cells in (40, 80):
        found = fvsolve.run(channel(PULSE, cells, numerics))
        errors.append(np.abs(found["reach.outlet.dye"] - delayed(found.t)).mean())
        assert found["gate.flow"] == approx(FLOW, rel=1e-6)
        assert all(abs(found.ledger[name]["relative"]) < 1e-12 for name in ("mass", "dye"))
    assert errors[1] < 2e-3 and math.log2(errors[0] / errors[1]) > 1.7


@pytest.mark.parametrize("path", ["east", "south", "turned", "triangles"])
def test_a_restated_channel_carries_the_same_dye(path, tmp_path):
    here = fvsolve.run(channel(PULSE))
    if path == "triangles":
        case = channel(PULSE)
        case["nodes"]["reach"] = on_mesh(case["nodes"]["reach"], tmp_path)
        there = fvsolve.run(case)
        assert np.abs(there["reach.outlet.dye"] - delayed(there.t)).mean() < 5e-3
        assert abs(there.ledger["dye"]["relative"]) < 1e-12
        return
    sides = {"east": ("east", "west"), "south": ("south", "north")}.get(path, ("west", "east"))
    there = fvsolve.run(channel(PULSE, sides=sides, turned=path == "turned"))
    assert there["reach.outlet.dye"] == approx(here["reach.outlet.dye"], abs=1e-10)


ROUGH = "0.3*sin(1.7*x)*cos(2.3*y) + 0.08*x"  # with dry cells at the level 0.6 m
TIDE = {"time": [0, 3, 6, 9, 12], "value": [0.6, 0.9, 0.2, 0.8, 0.1]}
SALT = {"time": [0, 6, 6.5, 12], "value": [1.0, 1.0, 0.0, 0.5]}
PLACES = {"side": {"side": "west"}, "interior": {"at": [4.5, 2.5], "area": 4.0}}


def pond(place, scheme="muscl", dye=SALT, start=0.5, bed=ROUGH, numerics=None, **basin):
    """Pond over a rough bed with dry cells that a tide fills and empties through an orifice."""
    own = {
        "type": "basin",
        "size": [8.0, 6.0],
        "cells": [16, 12],
        "level": 0.6,
        "bed": bed,
        "elevation": 0.0,
        "patches": {"hole": place},
        **basin,
    }
    nodes = {"pond": own, "sea": lake(TIDE, elevation=0.0, scalars={"dye": dye})}
    given = {"scheme": scheme, "limiter": "minmod", "method": "ssp-rk3", "courant": 0.9} | (
        numerics or {}
    )
    given = {key: value for key, value in given.items() if value is not None}
    probes = ["gate.flow", "pond.hole.dye"]
    return scene(
        {**nodes},
        {"gate": orifice("sea", "pond.hole")},
        12.0,
        given,
        probes,
        0.25,
        scalars={"dye": {"initial": start}},
    )


@pytest.mark.parametrize("path", ["grid", "triangles"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("place", PLACES)
def test_a_tide_conserves_amount_and_bounds_of_a_dye_and_uniform_values(
    place, scheme, path, tmp_path
):
    """Bounds over a dry bed; uniform values over a wet one, because values fade in films of less than a micron."""
    for dye, bed in ((SALT, ROUGH), (0.5, "0.02*x + 0.02*sin(3*x)*cos(2*y)")):
        case = pond(PLACES[place], scheme, dye, 0.5, bed)
        if path == "triangles":
            case["nodes"]["pond"] = on_mesh(case["nodes"]["pond"], tmp_path)
        found = fvsolve.run(case)
        assert found["gate.flow"].max() > 0.3 and found["gate.flow"].min() < -0.3
        assert all(abs(found.ledger[name]["relative"]) < 1e-12 for name in ("mass", "dye"))
        model, state = ended(case)
        values = model.meshed[0].values(state.y)["dye"]
        if dye is SALT:
            assert values.min() > -1e-12 and values.max() < 1.0 + 1e-12
        else:
            assert values == approx(0.5, abs=1e-12) and found["pond.hole.dye"] == approx(
                0.5, abs=1e-12
            )


@pytest.mark.parametrize("method", ["implicit-midpoint", "tr-bdf2", "radau-iia-5", "rodas-5p"])
@pytest.mark.parametrize("place", PLACES)
def test_implicit_methods_carry_the_same_as_explicit_methods(place, method):
    own = {"step": 0.02} if method == "implicit-midpoint" else {"rtol": 1e-6}
    flat = {"bed": "0", "scheme": "upwind"}
    found = fvsolve.run(
        pond(PLACES[place], numerics={"method": method, "courant": None, **own}, **flat)
    )
    exact = fvsolve.run(pond(PLACES[place], numerics={"method": "rk4", "courant": 0.3}, **flat))
    assert found["pond.hole.dye"] == approx(exact["pond.hole.dye"], abs=2e-3)
    assert all(abs(found.ledger[name]["relative"]) < 1e-12 for name in ("mass", "dye"))


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("place", PLACES)
def test_rates_of_a_dye_keep_to_their_pattern(place, scheme):
    numerics = {"method": "radau-iia-5", "step": 0.1, "courant": None}
    model = model_of(pond(PLACES[place], scheme, bed="0", numerics=numerics))
    for seed in range(3):
        y = model.start + model.scale * np.random.default_rng(seed).normal(
            scale=0.05, size=model.y_size
        )
        assert stray(model, 1.0, y) < 1e-7


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("path", ["grid", "triangles"])
def test_at_rest_not_a_bit_moves(path, place, tmp_path):
    case = pond(PLACES[place], dye=1.0)
    case["nodes"]["sea"]["head"] = 0.6
    if path == "triangles":
        case["nodes"]["pond"] = on_mesh(case["nodes"]["pond"], tmp_path)
    model = model_of(case)
    dydt, out = model.evaluate(0.0, model.start)
    assert not dydt.any() and not out[model.layout["supply"] :][: model.ledgers].any()


@pytest.mark.parametrize("drawn", [0.3, 0.8])
def test_links_at_a_patch_exchange_the_mean_of_their_inflows(drawn):
    """A feed of 0.5 m3/s with dye 1, and a demand behind another link; the pond has dye 0."""
    case = pond(PLACES["side"], bed="0", dye=1.0, start=0.0, numerics={"scheme": "upwind"})
    nodes, links = case["nodes"], case["links"]
    nodes["sea"] = inflow(0.5, elevation=0.0, scalars={"dye": 1.0})
    nodes["use"] = {"type": "junction", "elevation": 0.0, "demand": drawn}
    links["out"] = orifice("pond.hole", "use")
    case["output"]["probes"], case["numerics"]["end"] = ["use.dye"], 0.5
    found = fvsolve.run(case)
    assert found["use.dye"] == approx(min(0.5 / drawn, 1.0), rel=1e-12)
    assert abs(found.ledger["dye"]["relative"]) < 1e-12


@pytest.mark.parametrize("method", ["ssp-rk3", "radau-iia-5", "rodas-5p"])
@pytest.mark.parametrize("place", PLACES)
def test_a_pond_fills_a_shaft_with_its_dye_and_gets_it_back(place, method):
    """A stirred shaft has the mean of its first water and of what entered: 1 - V0 / V until the flow turns."""
    own = {"rtol": 1e-7, "courant": None} if method != "ssp-rk3" else {}
    case = pond(
        PLACES[place], bed="0", start=1.0, numerics={"scheme": "upwind", "method": method, **own}
    )
    nodes, links = case["nodes"], case["links"]
    nodes["shaft"] = {
        "type": "tank",
        "area": 2.0,
        "elevation": -2.0,
        "level": 0.5,
        "scalars": {"dye": 0.0},
    }
    del nodes["sea"]
    links["gate"] = {
        "type": "manhole",
        "from": "pond.hole",
        "to": "shaft",
        "crest": 0.1,
        "area": 0.28,
        "perimeter": 1.9,
    }
    case["output"]["probes"] = ["shaft.dye", "shaft.level", "gate.flow"]
    found = fvsolve.run(case)
    assert found["gate.flow"].min() > 0.0
    assert found["shaft.dye"] == approx(1.0 - 0.5 / found["shaft.level"], abs=1e-6)
    assert all(abs(found.ledger[name]["relative"]) < 1e-12 for name in ("mass", "dye"))
    nodes["shaft"] |= {"level": 4.0}
    back = fvsolve.run(case)
    entered = 2.0 * (4.0 - back["shaft.level"][-1]) * 1000.0
    assert back["gate.flow"].max() < 0.0 and back["shaft.dye"] == approx(0.0, abs=1e-12)
    assert (
        back.ledger["dye"]["final"] == approx(back.ledger["dye"]["initial"], rel=1e-12)
        and entered > 100.0
    )


@pytest.mark.parametrize("method", ["ssp-rk3", "radau-iia-5", "rodas-5p"])
def test_a_spring_brings_its_dye(method):
    """The amount that enters is flow times value times time; what a sink draws has the value of the pond."""
    own = {"rtol": 1e-7, "courant": None} if method != "ssp-rk3" else {}
    amounts = []
    for flow in (0.02, -0.02):
        spring = {**PLACES["interior"], "discharge": flow, "scalars": {"dye": 0.8}}
        case = pond(
            spring, bed="0", start=0.1, numerics={"scheme": "upwind", "method": method, **own}
        )
        case["links"], case["nodes"], case["output"]["probes"] = (
            {},
            {"pond": case["nodes"]["pond"]},
            ["pond.hole.dye"],
        )
        ledger = fvsolve.run(case).ledger["dye"]
        assert abs(ledger["relative"]) < 1e-12 and list(ledger["by_node"]) == ["pond.hole"]
        amounts.append(ledger["by_node"]["pond.hole"])
    assert amounts == approx([0.02 * 12.0 * 0.8 * 1000.0, -0.02 * 12.0 * 0.1 * 1000.0], rel=1e-10)


def test_street_manhole_shaft_and_sewer_keep_their_dye():
    street = {
        "type": "basin",
        "size": [40.0, 8.0],
        "cells": [40, 8],
        "level": 0.05,
        "elevation": 0.0,
        "bed": "0.002*(40 - x)",
        "manning": 0.015,
        "patches": {"hole": {"at": [35, 4], "area": 4}},
    }
    tide = {"time": [0, 60, 180, 300], "value": [-1.5, -1.5, 1.0, 1.0]}
    nodes = {
        "street": street,
        "shaft": {"type": "tank", "area": 0.8, "elevation": -2.0, "level": 0.5},
        "river": lake(tide, elevation=0.0, scalars={"dye": 0.0}),
    }
    links = {
        "lid": {
            "type": "manhole",
            "from": "street.hole",
            "to": "shaft",
            "crest": 0.01,
            "area": 0.28,
            "perimeter": 1.9,
        },
        "sewer": {
            "type": "pipe",
            "from": "shaft",
            "to": "river",
            "length": 50.0,
            "diameter": 0.3,
            "wave_speed": 400.0,
            "cells": 5,
            "friction": {"model": "steady", "factor": 0.02},
        },
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.4}
    dye = {"dye": {"initial": 1.0}}
    case = scene(nodes, links, 250.0, numerics, ["lid.flow", "street.hole.dye"], 1.0, scalars=dye)
    found = fvsolve.run(case)
    assert found.ok and all(abs(found.ledger[name]["relative"]) < 1e-12 for name in ("mass", "dye"))
    assert found["lid.flow"].max() > 0.0 > found["lid.flow"].min()
    values = found["street.hole.dye"]
    assert values.min() > -1e-12 and values.max() < 1.0 + 1e-12


@pytest.mark.parametrize("place", PLACES)
def test_threads_and_a_resumed_run_give_the_same_bits(place, tmp_path, monkeypatch):
    one, three = (fvsolve.run(pond(PLACES[place]), threads=count) for count in (1, 3))
    for name in ("gate.flow", "pond.hole.dye"):
        assert (one[name] == three[name]).all()
    assert three.summary["threads"] == 3
    for name in ("CHECKPOINT_SECONDS", "CHUNK_SECONDS"):  # checkpoints after 1000, 1250, ... steps
        monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), name, 0.0)
    run_in_two_parts(pond(PLACES[place], numerics={"step": 5e-3, "courant": None}), tmp_path, 8.0)
    assert_equal_files(tmp_path, ["history.csv"])
