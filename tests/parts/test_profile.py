"""Pipes along an elevation profile: a straight pipe plus the weight of the fluid, and a chain of pipes."""

import meshio
import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    area,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    step,
    valve,
)

import fvsolve
from fvsolve.report.maps.network_map import network_map

LENGTH, DIAMETER, SPEED, CELLS = 3000.0, 0.4, 1000.0, 60
STEEL = {"model": "quasi-steady", "roughness": 2e-4}
HILL = {
    "chainage": [1200.0, 1950.0, 2400.0, 2500.0, 4200.0],
    "elevation": [30.0, 42.0, 65.0, 31.0, 20.0],
}
LAWS = {"linear": {}, "log": {"law": "log"}, "mixture": {"law": "mixture", "air_fraction": 1e-3}}


def line(links: dict, nodes: dict | None = None, law: str = "linear", **numerics) -> dict:
    """Return a case of a lake, `links` from there to the gate, and a valve that throttles."""
    nodes = {
        "lake": lake(110.0, elevation=30.0),
        "gate": junction(elevation=20.0),
        **(nodes or {}),
        "sea": reservoir(2e5, elevation=20.0),
    }
    links = {**links, "valve": valve("gate", "sea", 0.02 * area(DIAMETER), step(0.5, 1.0, 0.2))}
    given = {"scheme": "weno5", "method": "rk4", "step": 0.02, **numerics}
    case = scene(nodes, links, 8.0, given, ["gate.pressure", "valve.flow"], every=0.1)
    case["fluid"] |= LAWS[law]
    return case


def profiled(profile=HILL, cells: int = CELLS, turned: bool = False, **more) -> dict:
    one = pipe(
        "lake", "gate", LENGTH, DIAMETER, SPEED, cells, friction=STEEL, profile=profile, **more
    )
    if turned:
        one |= {"from": "gate", "to": "lake", "profile": mirrored(profile)}
    return {"main": one}


def mirrored(profile: dict) -> dict:
    chainage = np.array(profile["chainage"])
    return {
        "chainage": (chainage[0] + chainage[-1] - chainage[::-1]).tolist(),
        "elevation": profile["elevation"][::-1],
    }


def height(distance: np.ndarray) -> np.ndarray:
    return np.interp(distance + HILL["chainage"][0], HILL["chainage"], HILL["elevation"])


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5", "line"])
def test_under_linear_it_is_the_straight_pipe_and_the_weight_along_it(scheme: str) -> None:
    numerics = {"pipe_model": "delay-line"} if scheme == "line" else {"scheme": scheme}
    bent = fvsolve.run(line(profiled(), **numerics))
    plain = {key: one for key, one in profiled()["main"].items() if key != "profile"}
    straight = fvsolve.run(line({"main": plain}, **numerics))
    for probe in bent.probes:
        assert np.array_equal(bent[probe], straight[probe])
    one, other = bent.envelope["main"], straight.envelope["main"]
    here = np.isin(one["distance"], other["distance"])
    z = 30.0 - 10.0 * other["distance"] / LENGTH
    for key in ("min_pressure", "max_pressure"):
        off = one[key][here] - other[key] + RHO * GRAVITY * (height(other["distance"]) - z)
        assert np.max(np.abs(off)) <= 1e-12 * 2e6
        assert np.array_equal(one["t_" + key.split("_")[0]][here], other["t_" + key.split("_")[0]])
    assert np.max(np.abs(one["initial_head"][here] - other["initial_head"])) <= 1e-11


def off_chain(law: str, scheme: str, heights: np.ndarray) -> float:
    """Greatest difference of a pipe along a profile from a chain of one-cell pipes, over the range."""
    n = heights.size - 1
    names = ["lake", *(f"n{k}" for k in range(1, n)), "gate"]
    nodes = {
        name: junction(elevation=z) for name, z in zip(names[1:-1], heights[1:-1], strict=True)
    }
    links = {
        f"p{k}": pipe(*names[k : k + 2], LENGTH / n, DIAMETER, SPEED, 1, friction=STEEL)
        for k in range(n)
    }
    points = {"chainage": np.linspace(0.0, LENGTH, n + 1).tolist(), "elevation": heights.tolist()}
    numerics = {"scheme": scheme, "step": 1.2 / n, "method": "rk4", "end": 2.0}
    one = fvsolve.run(line(profiled(points, cells=n), law=law, **numerics))["gate.pressure"]
    chain = fvsolve.run(line(links, nodes, law=law, **numerics))["gate.pressure"]
    return float(np.max(np.abs(one - chain)) / np.ptp(chain))


@pytest.mark.parametrize(
    ("law", "scheme"),
    [("linear", "upwind"), ("linear", "weno5"), ("log", "upwind"), ("mixture", "weno5")],
)
def test_it_is_the_chain_of_300_pipes(law: str, scheme: str) -> None:
    """Equal to rounding for `linear` and `upwind`; otherwise at most 1.5 times the difference of straight pipes."""
    n = 300 if (law, scheme) == ("linear", "upwind") else 60
    hills = height(np.linspace(0.0, LENGTH, n + 1))
    hills[1:-1] += np.random.default_rng(7).uniform(-2.0, 2.0, n - 1)
    if (law, scheme) == ("linear", "upwind"):
        assert off_chain(law, scheme, hills) <= 1e-12
    else:
        straight = off_chain(law, scheme, np.linspace(30.0, 20.0, n + 1))
        assert straight <= 0.01
        assert off_chain(law, scheme, hills) <= 1.5 * straight + 1e-12


@pytest.mark.in_turn
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scheme", ["upwind", "weno5"])
@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
def test_nothing_moves_that_is_left_alone(law: str, scheme: str, method: str) -> None:
    case = line(profiled(), law=law, scheme=scheme, method=method)
    case["links"]["valve"]["opening"] = 1.0
    found = fvsolve.run(case, set={"numerics.end": 1.0})
    for probe in found.probes:
        assert np.ptp(found[probe]) == 0.0
    assert np.array_equal(
        found.envelope["main"]["min_pressure"], found.envelope["main"]["max_pressure"]
    )


@pytest.mark.parametrize("law", LAWS)
def test_drawn_the_other_way_it_is_the_same(law: str) -> None:
    one, other = (fvsolve.run(line(profiled(turned=turned), law=law)) for turned in (False, True))
    for probe in one.probes:
        assert np.allclose(one[probe], other[probe], rtol=1e-10, atol=1e-6)
    for key in ("min_pressure", "max_pressure", "initial_head", "elevation"):
        assert np.allclose(
            one.envelope["main"][key], other.envelope["main"][key][::-1], rtol=1e-9, atol=1e-6
        )


def test_a_closed_line_rests_at_equal_heads_under_every_law() -> None:
    for law in LAWS:
        case = line(profiled(), law=law)
        case["links"]["valve"]["opening"] = 0.0
        found = fvsolve.run(case, set={"numerics.end": 1.0})
        heads = found.envelope["main"]["initial_head"]
        assert np.ptp(heads) <= 1e-6, law
        assert np.max(np.abs(found["valve.flow"])) == 0.0


def test_every_point_is_in_the_envelope_and_the_summit_is_the_lowest_pressure() -> None:
    # cells of 750 m, of which no centre is near the summit at 1200 m
    found = fvsolve.run(line(profiled(cells=4)))
    one = found.envelope["main"]
    points = np.array(HILL["chainage"]) - HILL["chainage"][0]
    assert set(points) <= set(one["distance"])
    at = int(np.argmin(one["min_pressure"]))
    assert (one["distance"][at], one["elevation"][at]) == (1200.0, 65.0)


def test_a_summit_boils_where_no_cell_does() -> None:
    peak = {
        "chainage": [0.0, 1400.0, 1500.0, 1600.0, 3000.0],
        "elevation": [30.0, 30.0, 121.0, 30.0, 20.0],
    }
    case = line(profiled(peak, cells=2))
    case["links"]["valve"]["opening"] = 1.0
    found = fvsolve.run(case, set={"numerics.end": 0.5})
    assert [mark.place for mark in found.marks] == ["links.main"]
    assert found.envelope["main"]["min_pressure"][[1, 5]].min() > 2300.0  # at the cells


def test_length_and_elevations_of_nodes_follow_from_it() -> None:
    said = profiled()
    del said["main"]["length"]
    case = line(said)
    for node in case["nodes"].values():
        node.pop("elevation", None)
    case["nodes"]["sea"]["elevation"] = 20.0
    found = fvsolve.load(case)
    assert found.links["main"].length == LENGTH
    assert (found.nodes["lake"].elevation, found.nodes["gate"].elevation) == (30.0, 20.0)
    assert fvsolve.load(found.table()) == found
    assert np.array_equal(
        fvsolve.run(found)["gate.pressure"], fvsolve.run(line(profiled()))["gate.pressure"]
    )


def test_x_y_and_z_give_the_way_and_files_read_as_lists(tmp_path) -> None:
    z, way = np.array(HILL["elevation"]), np.diff(HILL["chainage"])
    plan = np.sqrt(way**2 - np.diff(z) ** 2)  # along y, so that the length in space is the chainage
    y = np.concatenate([[5.0], 5.0 + np.cumsum(plan)])
    first = fvsolve.run(line(profiled()))
    said = {"x": [7.0] * 5, "y": y.tolist(), "z": z.tolist()}
    route = profiled(said)
    del route["main"]["length"]
    assert np.allclose(fvsolve.run(line(route))["gate.pressure"], first["gate.pressure"], rtol=1e-9)
    rows = "\n".join(
        f"{c / 1000:.5f};{e}" for c, e in zip(HILL["chainage"], HILL["elevation"], strict=True)
    )
    (tmp_path / "line.csv").write_text(
        f"Chainage [km];Elevation [m]\n{rows}\n".replace(".", ","), encoding="utf-16"
    )
    read = fvsolve.run(
        line(profiled({"file": str(tmp_path / "line.csv")})), out=tmp_path / "run", pictures=False
    )
    assert np.array_equal(read["gate.pressure"], first["gate.pressure"])
    again = fvsolve.run(tmp_path / "run" / "case.toml")
    assert np.array_equal(again["gate.pressure"], first["gate.pressure"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"chainage": [0, 900, 800, 3000], "elevation": [30, 40, 50, 20]}, "800 comes after 900"),
        ({"chainage": [0, 3000], "elevation": [30, 19]}, "the elevation of gate is 20 m, and the profile ends at 19 m"),
        ({"chainage": [0, 2900], "elevation": [30, 20]}, "the axis is 2900 m long, and `length` is 3000 m; expected"),
        ({"chainage": [0, 10, 3000], "elevation": [30, 60, 20]}, "10 m from chainage 0 m is too short to rise"),
        ({"chainage": [0, 3000], "elevation": [30, 25, 20]}, "2 of chainage, 3 of elevation"),
        ({"chainage": [0], "elevation": [30]}, "has one point"),
        ({"chainage": [0, "3 kg"], "elevation": [30, 20]}, "is a mass; expected a length"),
        ({"distance": [0, 3000], "elevation": [30, 20]}, "expected chainage and elevation, or x, y, z"),
        ({"x": [0, 0], "y": [0, 0], "z": [30, 30]}, "points 1 and 2 coincide"),
        ([0, 3000], "is not a table; expected for example"),
        ({"file": "nowhere.csv"}, "there is no such file"),
    ],
)  # fmt: skip
def test_faults_are_named(change, told: str) -> None:
    error = refused(line(profiled(change)))
    assert told in str(error)
    assert "links.main.profile" in str(error)


def test_pressure_at_ambient_is_at_the_ground() -> None:
    """A closed line at rest has the head of the lake: p = ambient + rho g (110 m - elevation)."""
    case = line(profiled())
    case["links"]["valve"]["opening"] = 0.0
    found = fvsolve.run(case, set={"numerics.end": 0.1}).envelope["main"]
    assert np.allclose(
        found["min_pressure"], AMBIENT + RHO * GRAVITY * (110.0 - found["elevation"]), rtol=1e-12
    )


def test_frames_and_maps_show_a_pipe_at_its_points_in_space(tmp_path):
    """Points between cells of a pipe with `x, y, z` lie on its axis in frames, and in the plan of the network."""
    length = float(np.sqrt(3000.0**2 - 10.0**2))
    points = {"x": [0.0, 1000.0, 1000.0], "y": [0.0, 0.0, length - 1000.0], "z": [30.0, 30.0, 20.0]}
    route = profiled(points)
    del route["main"]["length"]
    found = fvsolve.run(line(route), out=tmp_path / "run", pictures=False)
    assert found.ok
    frame = meshio.read(sorted((tmp_path / "run" / "fields").glob("*.vtu"))[0]).points
    on_first = np.isclose(frame[:, 1], 0.0) & (frame[:, 0] <= 1000.0 + 1e-9)
    on_second = np.isclose(frame[:, 0], 1000.0) & (frame[:, 1] <= length)
    assert on_first.sum() > 10 and on_second.sum() > 30
    assert (on_first | on_second).sum() >= len(frame) - 1  # the sea states no position
    plan = network_map(found).ends.reshape(-1, 2)
    corner = np.abs(plan - (1000.0, 0.0)).max(axis=1).min()
    assert corner < 60.0  # half a cell
