"""Weirs, sluice gates, culverts and manholes: printed figures of their laws, both directions, continuity; ponds.

Ponds run beside SciPy with the laws of `reference.structures`, which are written from the formulas.
"""

import math

import numpy as np
import pytest
from pytest import approx
from reference import structures as reference
from reference.refusals import refused
from reference.scenes import WATER, junction, lake, pipe, ramp, scene, tank
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.case.case_notices import range_notices
from fvsolve.parts.culvert import law as culvert_law
from fvsolve.parts.culvert.lower import culvert_numbers
from fvsolve.parts.culvert.part import Culvert, inlets
from fvsolve.parts.manhole import law as manhole_law
from fvsolve.parts.sluice_gate import law as gate_law
from fvsolve.parts.weir import law as weir_law
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise

G = reference.G
SQUARE_EDGE = (1, 0.0098, 2.0, 0.0398, 0.67, -0.5)
BROAD = 2.0 / 3.0 * 0.577 * math.sqrt(2.0 * G)


def of(law, numbers, setting=0.0):
    """Compiled law as a function of the levels at both ends."""
    floats = np.array(numbers, dtype=float)

    def flow(z1, z2):
        ahead = z1 >= z2
        found = law.flow(floats, 0, float(setting), ahead, float(max(z1, z2)), float(abs(z1 - z2)))[
            0
        ]
        return float(found if ahead else -found)

    return flow


def culvert(**keys) -> Culvert:
    own = {
        "diameter": 1.2,
        "length": 30.0,
        "inverts": [0.0, 0.0],
        "manning": 0.012,
        "inlet": "circular-concrete-square-edge",
    }
    given = {"from": "a", "to": "b", **own, **keys}
    return Culvert.model_validate({key: value for key, value in given.items() if value is not None})


def culvert_of(**keys):
    return of(culvert_law, culvert_numbers(culvert(**keys), G))


WEIR = of(weir_law, [2.0 / 3.0 * 0.62 * math.sqrt(2.0 * G) * 5.0], 1.0)
GATE = of(gate_law, [1.0, 0.0, 0.61, BROAD, G], 0.4)
LID = [0.2, 2.0 / 3.0 * 0.54 * math.sqrt(2.0 * G) * 1.9, 0.167 * 0.28 * math.sqrt(2.0 * G)]
MANHOLE, TURNED_MANHOLE = of(manhole_law, [*LID, 1.0]), of(manhole_law, [*LID, 0.0])
LAWS = {  # law, level of its crest, a full flow [m3/s]
    "weir": (WEIR, 1.0, 10.0),
    "gate": (GATE, 0.0, 1.5),
    "manhole": (MANHOLE, 0.2, 0.2),
    "culvert": (culvert_of(), 0.0, 4.0),
    "sloping-culvert": (culvert_of(inverts=[0.4, -0.2]), 0.0, 4.0),
    "box-culvert": (
        culvert_of(diameter=None, width=1.5, height=1.0, inlet="box-headwall-chamfered"),
        0.0,
        4.0,
    ),
    "mitred-culvert": (
        culvert_of(inlet="circular-metal-mitred", manning=0.024, inverts=[0.0, 0.9]),
        0.0,
        4.0,
    ),
}


def test_weirs_have_the_flow_of_villemonte():
    expected = [3.23594, 2.73562, 1.99433, 1.18790]
    assert [WEIR(1.5, 1.0 + 0.5 * r) for r in (0.0, 0.5, 0.8, 0.95)] == approx(expected, abs=5e-6)


def test_gates_have_the_flow_of_energy_and_momentum():
    assert GATE(2.0, 1.19190) == approx(1.442726, rel=1e-6)
    assert [GATE(2.0, tail) for tail in (1.4, 1.7, 1.9)] == approx(
        [1.027185, 0.692020, 0.392106], abs=1e-6
    )
    assert GATE(2.0, 1.1919) == GATE(2.0, -1.0) > GATE(2.0, 1.1920)  # the fold at 1.19191 m
    middle = 0.5 * (GATE(2.0, 1.19191) + GATE(2.0, 1.202626))
    # up to the sequent depth
    assert GATE(2.0, 0.5 * (1.19191 + 1.202626)) == approx(middle, rel=1e-5)
    # 1.31 a
    assert (
        GATE(0.4, 0.0) == approx(BROAD * 0.4**1.5) and GATE(0.53, 0.0) < 0.999 * BROAD * 0.53**1.5
    )


def test_inlets_of_culverts_have_the_headwater_of_hds_5():
    numbers = np.array(culvert_numbers(culvert(inverts=[0.3, 0.0]), G))

    def headwater(flow):
        joint = float(numbers[culvert_law.FLOW_FROM])
        return brentq(
            lambda h: culvert_law.inlet_flow(numbers, 0, 0.01, h, joint) - flow,
            1e-3,
            10.0,
            xtol=1e-12,
        )

    found = [headwater(flow) for flow in (1.0, 1.5, 4.0, 6.0)]
    assert found == approx([0.768377, 0.992649, 2.430808, 4.471819], abs=1e-6)
    assert found == approx(
        [reference.culvert_headwater(1.2, 0.01, SQUARE_EDGE, q) for q in (1.0, 1.5, 4.0, 6.0)]
    )


def test_full_culverts_have_the_printed_loss():
    full = culvert_of(entrance_loss=0.5)
    assert full(6.22596, 5.0) == approx(4.0, rel=3e-6)
    assert full(5.2, 5.0) == approx(
        reference.culvert_drowned(1.2, 30.0, 0.012, 1.5)(5.2, 5.0), rel=1e-12
    )
    halved = culvert_of(entrance_loss=0.5, barrels=3, blockage=0.5)
    assert halved(5.2, 5.0) == approx(1.5 * full(5.2, 5.0), rel=1e-12)


def test_outlets_of_culverts_control_long_barrels():
    """Levels for a given flow by critical depth at the outlet and the losses of a full, or of a partly full barrel."""
    law, diameter, factor = culvert_of(length=100.0, manning=0.024), 1.2, 19.63 * 0.024**2 * 100.0

    def loss(flow, depth):
        area, _, perimeter = reference.circle(diameter, depth)
        return (1.5 + factor * (perimeter / area) ** (4.0 / 3.0)) * (flow / area) ** 2 / (2.0 * G)

    def missing(level, flow, critical):
        return level - critical - loss(flow, 0.5 * (level + critical))

    for flow in (1.5, 3.0):
        critical = reference.critical_depth(diameter, flow)
        full = 0.5 * (critical + diameter) + loss(flow, diameter)
        assert full > diameter and law(full, -1.0) == law(full, 0.4) == approx(flow, rel=1e-9)
    for flow in (0.1, 0.4):
        critical = reference.critical_depth(diameter, flow)
        partly = brentq(missing, critical, diameter, args=(flow, critical), xtol=1e-14)
        assert partly < 0.75 * diameter and law(partly, -1.0) == approx(flow, rel=1e-9)
        tail = 0.5 * (critical + partly)
        assert law(partly, tail) == approx(
            ((partly - tail) / loss(1.0, 0.5 * (partly + tail))) ** 0.5, rel=1e-9
        )


def test_manholes_fall_as_weirs_and_orifices_and_rise_as_orifices():
    law = reference.manhole(0.2, 0.28, 1.9)
    for levels in (
        (0.25, -1.0),
        (0.6, -1.0),
        (0.6, 0.5),
        (0.25, 0.24),
        (0.2, 0.7),
        (0.3, 0.7),
        (0.1, 0.19),
    ):
        assert MANHOLE(*levels) == approx(law(*levels), rel=1e-12, abs=1e-15), levels
        assert TURNED_MANHOLE(*levels[::-1]) == -MANHOLE(*levels), levels


def test_all_inlets_of_hds_5_rise_with_the_headwater():
    assert len(inlets()) == 57
    for name, inlet in inlets().items():
        box = name.startswith(("box", "rect", "arch", "pipe"))
        size = {"diameter": None, "width": 1.5, "height": 1.2} if box else {}
        for slope in (-0.1, 0.0, 0.1):
            numbers = np.array(
                culvert_numbers(culvert(inlet=name, inverts=[30.0 * slope, 0.0], **size), G)
            )
            joint = float(numbers[culvert_law.FLOW_FROM])
            flows = [
                culvert_law.inlet_flow(numbers, 0, slope, h, joint)
                for h in np.linspace(0.01, 4.0, 400)
            ]
            assert min(np.diff(flows)) > 0.0, name
        assert 0.2 <= inlet.entrance_loss <= 0.9 and (inlet.slope_factor == 0.7) == (
            "mitred" in name
        )


@pytest.mark.parametrize("name", LAWS)
def test_laws_are_zero_at_equal_levels_and_linear_near_them(name):
    law, crest, _ = LAWS[name]
    for z in (crest - 1.0, crest, crest + 0.7, crest + 3.0):
        assert law(z, z) == 0.0
        for side in (1.0, -1.0):
            small, whole = law(z, z - side * 1e-4), law(z, z - side * 1e-3)
            assert (
                small == approx(0.1 * whole, rel=1e-9) if side > 0.0 else abs(small) <= abs(whole)
            )


@pytest.mark.parametrize("name", ["weir", "gate", "culvert", "box-culvert"])
def test_like_ends_give_the_same_flow_in_both_directions(name):
    law, crest, _ = LAWS[name]
    levels = crest + np.random.default_rng(1).uniform(-0.5, 3.0, (200, 2))
    assert all(law(z1, z2) == -law(z2, z1) for z1, z2 in levels)


def test_a_sloping_culvert_reversed_is_the_culvert_drawn_the_other_way():
    law, other = LAWS["sloping-culvert"][0], culvert_of(inverts=[-0.2, 0.4])
    levels = np.random.default_rng(2).uniform(-0.5, 3.0, (200, 2))
    assert all(law(z1, z2) == -other(z2, z1) for z1, z2 in levels)
    assert law(2.0, 1.0) != -law(1.0, 2.0)


def greatest_jump(law, begin, end, points=400, most=6):
    """Greatest change of the flow within 1e-12 of the way from the levels `begin` to `end`."""
    begin, way = np.array(begin), np.array(end) - np.array(begin)
    at = np.linspace(0.0, 1.0, points)
    flows = np.array([law(*(begin + s * way)) for s in at])
    worst = 0.0
    for k in np.argsort(-np.abs(np.diff(flows)))[:most]:
        low, high = at[k], at[k + 1]
        while high - low > 1e-12:
            middle = 0.5 * (low + high)
            one, two, three = (law(*(begin + s * way)) for s in (low, middle, high))
            low, high = (low, middle) if abs(two - one) > abs(three - two) else (middle, high)
        worst = max(worst, abs(law(*(begin + high * way)) - law(*(begin + low * way))))
    return worst


@pytest.mark.parametrize("name", LAWS)
def test_laws_are_continuous_through_every_change_of_regime(name):
    law, crest, full = LAWS[name]
    for z in crest + np.array([-0.3, 0.05, 0.3, 0.5, 0.85, 0.93, 1.1, 1.5, 2.0, 3.0]):
        for along in (((z, crest - 1.0), (z, crest + 3.0)), ((crest - 1.0, z), (crest + 3.0, z))):
            assert greatest_jump(law, *along) < 1e-9 * full, (name, z)


SPILL = {"type": "weir", "width": 5.0, "crest": 1.0}
SLUICE = {"type": "sluice-gate", "width": 2.0, "sill": 0.5, "opening": 0.3}
UNDER = {
    "type": "culvert",
    "diameter": 0.6,
    "length": 20.0,
    "inverts": [0.0, 0.0],
    "manning": 0.012,
    "inlet": "circular-concrete-square-edge",
}
LID = {"type": "manhole", "crest": 1.2, "area": 0.28, "perimeter": 1.9}
ENDS = {"from": "a", "to": "b"}
PONDS = {  # link, law, levels of both ponds, end [s]
    "weir": (SPILL, reference.weir(5.0, 1.0), (2.0, 0.2), 120.0),
    "gate": (SLUICE, reference.gate(2.0, 0.5, 0.3), (3.0, 2.0), 120.0),  # drowned
    "culvert": (UNDER, reference.culvert_drowned(0.6, 20.0, 0.012, 1.5), (2.4, 1.2), 300.0),
    "manhole": (LID, reference.manhole(1.2, 0.28, 1.9), (2.0, 0.5), 1500.0),
}
AREAS = (60.0, 40.0)
METHODS = [
    {"method": "rk4", "step": 0.05},
    {"method": "bogacki-shampine", "rtol": 1e-7},
    {"method": "radau-iia-5", "rtol": 1e-7},
    {"method": "rodas-5p", "rtol": 1e-7},
]


def ponds(link, levels, numerics, end, every=None, **top):
    nodes = {name: tank(area, level) for name, area, level in zip("ab", AREAS, levels, strict=True)}
    probes = ["a.level", "b.level", "x.flow", "x.regime"]
    return scene(nodes, {"x": {**ENDS, **link}}, end, numerics, probes, every or end / 60.0, **top)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method["method"])
@pytest.mark.parametrize("name", PONDS)
def test_ponds_reach_equal_levels_as_by_scipy(name, method):
    link, law, levels, end = PONDS[name]
    result = fvsolve.run(ponds(link, levels, method, end))
    found = solve_ivp(
        lambda t, z: law(*z) * np.array([-1.0, 1.0]) / AREAS,
        (0.0, end),
        levels,
        method="LSODA",
        t_eval=result.t,
        rtol=1e-8,
        atol=1e-9,
    )
    change = abs(levels[0] - levels[1])
    assert result["a.level"] == approx(found.y[0], abs=1e-3 * change)
    assert result["b.level"] == approx(found.y[1], abs=1e-3 * change)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
    assert result["a.level"][-1] == approx(result["b.level"][-1], abs=1e-5)
    assert result["x.flow"][0] == approx(law(*levels), rel=1e-9)


@pytest.mark.parametrize("name", PONDS)
def test_ponds_at_equal_levels_do_not_move_by_a_bit(name):
    link = PONDS[name][0]
    for level in (2.0, 0.2):  # above and below the crest
        result = fvsolve.run(ponds(link, (level, level), METHODS[1], 10.0))
        assert {*result["a.level"], *result["b.level"]} == {level} and set(result["x.flow"]) == {
            0.0
        }


@pytest.mark.parametrize("name", ["weir", "gate", "culvert"])
def test_a_structure_drawn_the_other_way_has_the_opposite_flow(name):
    link, _, levels, end = PONDS[name]
    one = fvsolve.run(ponds(link, levels, METHODS[1], end))
    other = fvsolve.run(ponds({**link, "from": "b", "to": "a"}, levels, METHODS[1], end))
    assert one["x.flow"] == approx(-other["x.flow"], abs=1e-9) and one["a.level"] == approx(
        other["a.level"], abs=1e-9
    )


def test_the_energy_of_ponds_is_dissipated():
    found = energy(ponds(SPILL, (2.0, 0.2), {"method": "dormand-prince", "rtol": 1e-9}, 120.0))
    weight, (a, b) = 1000.0 * G, AREAS
    end = (2.0 * a + 0.2 * b) / (a + b)
    lost = 0.5 * weight * (a * 2.0**2 + b * 0.2**2 - (a + b) * end**2)
    assert found.ok and found.relative < 1e-9
    assert sum(found.dissipated[name][-1] for name in found.dissipated) == approx(lost, rel=1e-8)


def test_units_of_keys():
    metric = {**SPILL, "width": "500 cm", "crest": "1000 mm"}
    one, other = (fvsolve.run(ponds(link, (2.0, 0.2), METHODS[0], 5.0)) for link in (SPILL, metric))
    assert list(one["a.level"]) == list(other["a.level"])


def test_regimes_and_controls():
    weir = fvsolve.run(ponds(SPILL, (2.0, 0.2), METHODS[1], 120.0, every=0.5))
    regimes = weir["x.regime"]
    assert regimes[0] == 1.0 and set(regimes) == {0.0, 1.0, 2.0}
    assert all((regimes == 2.0) == ((weir["b.level"] > 1.0) & (weir["x.flow"] != 0.0)))
    nodes = {"up": lake({"time": [0.0, 100.0], "value": [-0.2, 4.0]}), "low": lake(-1.0)}
    link = {**UNDER, "from": "up", "to": "low"}
    result = fvsolve.run(
        scene(
            nodes,
            {"x": link},
            100.0,
            {"method": "euler", "step": 1.0},
            ["x.control", "x.flow"],
            1.0,
        )
    )
    controls = result["x.control"].tolist()
    assert set(controls) == {0.0, 1.0, 2.0, 3.0} or set(controls) == {0.0, 2.0, 3.0}
    assert (
        controls[0] == 0.0
        and result["x.flow"][0] == 0.0
        and np.all(np.diff(result["x.flow"]) >= 0.0)
    )


def test_crests_and_openings_follow_schedules():
    lakes = {"a": lake(2.0), "b": lake(0.0)}
    moves = {"time": [0.0, 10.0], "value": [1.0, 1.5]}
    links = {
        "x": {**ENDS, **SPILL, "crest": moves},
        "y": {**ENDS, **SLUICE, "opening": ramp(0.0, 10.0, 0.5, 0.0)},
    }
    result = fvsolve.run(
        scene(lakes, links, 10.0, {"method": "rk4", "step": 0.5}, ["x.flow", "y.flow"], 1.0)
    )
    for t, q, under in zip(result.t, result["x.flow"], result["y.flow"], strict=True):
        assert q == approx(reference.weir(5.0, 1.0 + 0.05 * t)(2.0, 0.0), rel=1e-12)
        opening = 0.5 - 0.05 * t
        assert under == approx(
            reference.gate(2.0, 0.5, opening)(2.0, 0.0) if opening > 1e-9 else 0.0, abs=1e-9
        )


def test_a_junction_between_structures_balances_their_flows():
    nodes = {"a": tank(60.0, 2.0), "m": junction(), "b": tank(40.0, 0.2)}
    links = {"x": {**SPILL, "from": "a", "to": "m"}, "y": {**UNDER, "from": "b", "to": "m"}}
    for numerics in METHODS:
        case = scene(
            nodes, links, 20.0, numerics, ["m.head", "x.flow", "y.flow", "a.level", "b.level"], 1.0
        )
        result = fvsolve.run(case)
        assert result["x.flow"] == approx(-result["y.flow"], abs=1e-9)
        weir = [
            reference.weir(5.0, 1.0)(z1, z2)
            for z1, z2 in zip(result["a.level"], result["m.head"], strict=True)
        ]
        assert result["x.flow"] == approx(weir, rel=1e-6, abs=1e-9)
        assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_structures_join_pipes_columns_and_other_density_laws():
    """A pipe or a column brings water to a weir; its flow in the steady state is that of the level at the junction."""
    ways = {
        "pipe": pipe("up", "m", 50.0, 0.5, 1000.0, 5, friction={"model": "steady", "factor": 0.02}),
        "column": {
            "type": "rigid-column",
            "from": "up",
            "to": "m",
            "length": 50.0,
            "diameter": 0.5,
            "friction": {"model": "steady", "factor": 0.02},
        },
    }
    law = reference.weir(5.0, 1.0)
    for kind, way in ways.items():
        for density in ("linear", "log"):
            nodes = {
                "up": lake({"time": [0.0, 1.0, 2.0], "value": [2.0, 2.0, 2.5]}),
                "m": junction(),
                "b": lake(0.0),
            }
            links = {"way": way, "x": {**SPILL, "from": "m", "to": "b"}}
            fluid = {**WATER, "law": density}
            case = scene(
                nodes,
                links,
                5.0,
                {"method": "rk4", "courant": 0.8},
                ["m.head", "x.flow"],
                0.5,
                fluid=fluid,
            )
            if kind == "column":
                case["numerics"] = {"end": 5.0, "method": "rodas-5p", "rtol": 1e-7}
            result = fvsolve.run(case)
            expected = [law(head, 0.0) for head in result["m.head"]]
            assert result["x.flow"] == approx(expected, rel=1e-4), (kind, density)
            assert (
                result["x.flow"][1] == approx(result["x.flow"][0], rel=1e-6)
                and result["x.flow"][-1] > 0.1
            )


def pool(level: float, **links) -> dict:
    basin = {
        "type": "basin",
        "size": [20.0, 5.0],
        "cells": [20, 5],
        "level": level,
        "elevation": 0.0,
        "patches": {"end": {"side": "east"}},
    }
    nodes = {"pool": basin, "b": tank(40.0, 1.5, elevation=0.0)}
    numerics = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.8}
    return scene(nodes, links, 5.0, numerics, ["pool.end.head", "b.level", "x.flow"], 0.5)


@pytest.mark.parametrize(
    "link", [SPILL, SLUICE, UNDER, {**LID, "crest": 1.0}], ids=lambda link: link["type"]
)
def test_structures_join_patches_of_basins(link):
    """At rest no bit moves; a higher pool loses what the tank gains."""
    joined = {**link, "from": "pool.end", "to": "b"}
    still = fvsolve.run(pool(1.5, x=joined))
    assert (
        set(still["x.flow"]) == {0.0}
        and set(still["b.level"]) == {1.5}
        and len({*still["pool.end.head"]}) == 1
    )
    result = fvsolve.run(pool(1.8, x=joined))
    assert np.all(result["x.flow"] > 0.0) and result["b.level"][-1] > 1.5
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_inputs_of_a_linear_model():
    found = linearise(
        ponds(SPILL, (2.0, 1.5), METHODS[1], 1.0), inputs=["x.crest"], outputs=["x.flow"]
    )
    change = 1e-6
    flows = [reference.weir(5.0, 1.0 + side * change)(2.0, 1.5) for side in (1.0, -1.0)]
    assert found.d[0, 0] == approx((flows[0] - flows[1]) / (2.0 * change), rel=1e-4)


@pytest.mark.parametrize("link", [SPILL, SLUICE, UNDER, LID], ids=lambda link: link["type"])
def test_a_structure_that_water_never_reaches_gives_a_single_notice(link):
    def notices(level: float) -> list[str]:
        nodes = {"a": lake({"time": [0.0, 1.0], "value": [-1.0, level]}), "b": lake(-1.0)}
        model = fvsolve.build(fvsolve.load(scene(nodes, {"x": {**link, **ENDS}}, 1.0, METHODS[0])))
        return [notice.text for notice in model.warnings if "never reach" in notice.text]

    assert len(notices(-0.1)) == 1 and notices(3.0) == []


@pytest.mark.parametrize(
    "opening, above",
    [(1.9, False), (2.1, True), ({"time": [0.0, 1.0], "value": [2.1, 1.9]}, False)],
)
def test_a_gate_that_no_head_of_its_reservoirs_reaches_gives_a_single_notice(opening, above):
    nodes = {"a": lake({"time": [0.0, 1.0], "value": [1.0, 2.0]}), "b": lake(0.5)}
    gate = {**SLUICE, **ENDS, "sill": 0.0, "opening": opening}
    texts = [
        n.text
        for n in fvsolve.build(fvsolve.load(scene(nodes, {"x": gate}, 1.0, METHODS[0]))).warnings
    ]
    assert ["above the water there, 2 m deep at most" in text for text in texts] == above * [True]


@pytest.mark.parametrize("size, of_others", [
    ({"diameter": 1.0}, ["box-headwall-chamfered", "rectangular-tapered-throat"]),
    ({"width": 1.0, "height": 1.0}, ["circular-concrete-square-edge", "circular-tapered-throat-smooth"]),
])  # fmt: skip
def test_an_inlet_of_another_shape_gives_a_notice(size, of_others):
    """HDS-5 has ellipses and arches too; docs/structures.md gives them as a circle or a box."""
    under = {key: value for key, value in UNDER.items() if key != "diameter"} | size | ENDS
    for inlet in inlets():
        case = scene(
            {"a": lake(2.0), "b": lake(1.0)}, {"x": under | {"inlet": inlet}}, 1.0, METHODS[0]
        )
        found = [
            notice.text for notice in range_notices(fvsolve.load(case)) if "inlet" in notice.text
        ]
        other = inlet.startswith("circular" if "width" in size else ("box", "rectangular"))
        assert len(found) == other and (not other or f'"{inlet}" has formulas for' in found[0])
        assert other or inlet not in of_others


def fault(**keys) -> str:
    return str(refused(ponds(keys, (2.0, 1.0), METHODS[1], 1.0)))


def test_faults_of_keys():
    assert "blockage: 1 blocks all of the flow" in fault(**UNDER, blockage=1.0)
    assert "barrels: 0 is out of range" in fault(**UNDER, barrels=0)
    assert "did you mean circular-concrete-square-edge" in fault(
        **{**UNDER, "inlet": "circular-concrete-square"}
    ).replace('"', "")
    assert "size is missing" in fault(
        **{key: value for key, value in UNDER.items() if key != "diameter"}
    )
    assert "slope below 0.5" in fault(**{**UNDER, "inverts": [0.0, 12.0]})
    assert "above 0" in fault(**{**SPILL, "width": 0.0}) and "above 0" in fault(
        **{**UNDER, "diameter": -1.0}
    )
    assert "coefficient" in fault(**SPILL, coefficient=0.6, kind="broad")
    assert "no kind of crest" in fault(**SPILL, kind="round") and "of at least 0" in fault(
        **{**SLUICE, "opening": -0.1}
    )


@pytest.mark.parametrize(
    ("crest", "fault"), [(0.9, True), ([0.2, 0.8], True), ([0.2, 1.2], False), (1.1, False)]
)
def test_a_crest_below_the_beds_of_both_basins_is_refused(crest, fault):
    """Beds 1 m above the elevation of 0 m, and 2 m above that of -0.5 m."""
    pool = {
        "type": "basin",
        "size": [20.0, 4.0],
        "cells": [20, 4],
        "level": 2.5,
        "patches": {"e": {"side": "east"}},
    }
    nodes = {
        "a": pool | {"elevation": 0.0, "bed": "1 + 0*x"},
        "b": pool | {"elevation": -0.5, "bed": "2 + 0*x"},
    }
    crest = {"time": [0.0, 1.0], "value": crest} if isinstance(crest, list) else crest
    weir = {"type": "weir", "width": 2.0, "crest": crest, "from": "a.e", "to": "b.e"}
    case = scene(nodes, {"spill": weir}, 1.0, {"courant": 0.9})
    if fault:
        refused(
            case,
            "links.spill.crest: 0.[89] m above datum is below the bed on both sides, 1 m at a.e and 1.5 m at b.e",
        )
    else:
        fvsolve.load(case)


def test_a_rating_at_a_faulty_bed_is_a_fault_of_the_bed():
    patches = {"e": {"side": "east", "rating": {"level": [0, 1], "flow": [0, 2]}}}
    pool = {
        "type": "basin",
        "elevation": 0.0,
        "size": [20.0, 4.0],
        "cells": [20, 4],
        "level": 2.0,
        "patches": patches,
    }
    refused(
        scene({"a": pool | {"bed": "sqrt(x-5)"}}, {}, 1.0, {"courant": 0.9}),
        r"nodes.a.bed: .sqrt\(x-5\). is not a number",
    )
