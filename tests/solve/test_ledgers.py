"""Mass ledger: gross amounts, amounts by node, and accuracy, for every family of methods."""

import functools
import math

import numpy as np
import pytest
from reference import scenes, vessels
from reference.basins import straight, turning
from reference.scenes import AMBIENT, GRAVITY, lake, reservoir, scene, tank, valve
from scipy.integrate import solve_ivp

import fvsolve

ADAPTIVE = (
    "auto",
    "rodas-5p",
    "rodas-4",
    "radau-iia-5",
    "tr-bdf2",
    "esdirk-4",
    "dormand-prince",
    "bogacki-shampine",
)
FIXED = (
    "rk4",
    "ssp-rk3",
    "trapezoid",
    "implicit-midpoint",
    "alexander-3",
    "gauss-4",
    "lobatto-iiic-4",
)


def settings(method: str, step: float, rtol: float = 1e-6) -> dict:
    return {"method": method, "step": step} if method in FIXED else {"method": method, "rtol": rtol}


def drains(section: float, bore: float, numerics: dict, level: float = 3.0, end: float = 1500.0):
    nodes = {"vat": tank(section, level), "air": reservoir(AMBIENT)}
    links = {"hole": {"type": "orifice", "from": "vat", "to": "air", "diameter": bore}}
    return fvsolve.run(scene(nodes, links, end, numerics, ["hole.flow"], 1.0))


@pytest.mark.parametrize(
    "method", ["auto", "rodas-5p", "rodas-4", "radau-iia-5", "esdirk-4", "rk4"]
)
def test_a_tank_that_runs_empty_makes_up_no_water(method):
    # steps of 0.25 s; few steps; more steps
    near = {"rk4": 5e-6, "rodas-5p": 2e-6}.get(method, 2e-7)
    for section in (0.5, 1.0, 2.0, 3.0, 5.0):
        for bore in (0.05, 0.08, 0.1):
            result = drains(section, bore, settings(method, 0.25))
            mass, contents = result.ledger["mass"], 3000.0 * section
            left = vessels.prism(section, 0.61 * scenes.area(bore), 3.0, np.array([1500.0]))[0]
            assert result.ok and not result.marks
            assert mass["outflow"] == pytest.approx(contents - mass["final"], abs=1e-8 * contents)
            assert mass["final"] == pytest.approx(1000.0 * section * left, abs=near * contents)
            assert max(mass["made_up"], mass["spilled"], mass["inflow"]) <= 1e-8 * contents
            assert min(mass["made_up"], mass["spilled"], mass["inflow"]) >= 0.0
            assert abs(mass["remainder"]) <= 1e-12 * contents


def test_an_explicit_method_makes_up_none_either():
    mass = drains(2.0, 0.08, settings("dormand-prince", 0.25), end=600.0).ledger["mass"]
    assert (
        mass["outflow"] == pytest.approx(6000.0, rel=1e-6)
        and mass["made_up"] <= 6e-8
        and mass["spilled"] <= 6e-8
    )


@pytest.mark.parametrize("method", [*ADAPTIVE, *FIXED])
def test_spill_and_make_up_are_rows_of_their_own(method):
    flow = {"time": [0.0, 100.0], "value": [0.01, -0.03], "kind": "step"}
    nodes = {"mouth": {"type": "inflow", "flow": flow}, "vat": tank(1.0, 1.9, height=2.0)}
    links = {"way": {"type": "valve", "from": "mouth", "to": "vat", "diameter": 0.1}}
    result = fvsolve.run(scene(nodes, links, 200.0, settings(method, 0.3), ["vat.level"], 1.0))
    mass = result.ledger["mass"]
    truth = {"inflow": 1000.0, "outflow": 3000.0, "spilled": 900.0, "made_up": 1000.0}
    assert {key: mass[key] for key in truth} == pytest.approx(truth, rel=1e-9)
    assert mass["nodes"]["mouth"] == pytest.approx({"inflow": 1000.0, "outflow": 3000.0}, rel=1e-9)
    assert mass["nodes"]["vat"] == pytest.approx({"spilled": 900.0, "made_up": 1000.0}, rel=1e-9)
    assert mass["by_node"] == pytest.approx({"mouth": -2000.0}, rel=1e-9)
    assert abs(mass["remainder"]) < 1e-9
    assert [(mark.what, mark.time) for mark in result.marks] == [
        ("dry", pytest.approx(100.0 + 2000.0 / 30.0))
    ]
    (note,) = (one for one in result.warnings if one.kind == "spilling")
    assert (note.place, note.key, note.value, note.ok) == (
        "nodes.vat",
        "height",
        pytest.approx(10.0),
        True,
    )


@pytest.mark.parametrize("method", [*ADAPTIVE, *FIXED])
def test_a_dry_tank_fills_again_and_a_full_tank_empties(method):
    """A tank of 300 l under triangular flows of 500 l in turn spills and runs dry by exact amounts."""
    times = [0.0, *np.arange(25.0, 400.0, 50.0).tolist(), 400.0]
    flow = {"time": times, "value": [0.0, *(4 * [0.02, -0.02]), 0.0]}
    nodes = {"mouth": {"type": "inflow", "flow": flow}, "vat": tank(1.0, 0.1, height=0.3)}
    links = {"way": {"type": "valve", "from": "mouth", "to": "vat", "diameter": 0.3}}
    mass = fvsolve.run(
        scene(nodes, links, 400.0, settings(method, 0.25), ["vat.level"], 1.0)
    ).ledger["mass"]
    truth = {
        "inflow": 2000.0,
        "outflow": 2000.0,
        "spilled": 300.0 + 3 * 200.0,
        "made_up": 4 * 200.0,
        "final": 0.0,
    }
    assert {key: mass[key] for key in truth} == pytest.approx(truth, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("method", [*ADAPTIVE, *FIXED])
def test_flow_to_and_fro_counts_on_both_sides(method):
    """A column between a lake and a tank carries 2 z0 A in each direction per period.

    The level is z = z0 cos(w t) with w^2 = g A_c / (L A).
    """
    section, bore, length, swing, periods = 0.5, 0.3, 100.0, 0.4, 3
    period = 2 * math.pi / math.sqrt(GRAVITY * scenes.area(bore) / (length * section))
    nodes = {"lake": lake(2.0, elevation=0.0), "vat": tank(section, 2.0 + swing, elevation=0.0)}
    links = {
        "way": {
            "type": "rigid-column",
            "from": "lake",
            "to": "vat",
            "length": length,
            "diameter": bore,
            "friction": scenes.NO_FRICTION,
        }
    }
    numerics = settings(method, period / 2000, 1e-9)
    mass = fvsolve.run(
        scene(nodes, links, periods * period, numerics, ["way.flow"], period)
    ).ledger["mass"]
    each = 2 * 1000.0 * section * swing * periods
    near = 1e-5 if method in ("trapezoid", "implicit-midpoint") else 1e-6
    assert mass["inflow"] == pytest.approx(each, rel=near) and mass["outflow"] == pytest.approx(
        each, rel=near
    )


def test_a_reservoir_reached_by_waves_counts_the_flow_of_its_pipe():
    case = scene(
        {"lake": reservoir("5 barg"), "gate": scenes.junction(), "air": reservoir(AMBIENT)},
        {
            "main": {
                "type": "pipe",
                "from": "lake",
                "to": "gate",
                "length": 500.0,
                "diameter": 0.3,
                "wave_speed": 1000.0,
                "cells": 40,
                "friction": {"model": "steady", "factor": 0.02},
            },
            "tap": {
                **valve("gate", "air", 0.002),
                "opening": {"start": 0.2, "duration": 1.0, "value": [1.0, 0.0]},
            },
        },
        8.0,
        {"courant": 0.8, "scheme": "upwind5", "method": "rk4"},
        ["main.flow@0"],
        0.001,
    )
    result = fvsolve.run(case)
    flow, node = 1000.0 * result["main.flow@0"], result.ledger["mass"]["nodes"]["lake"]
    assert node["inflow"] == pytest.approx(np.trapezoid(np.maximum(flow, 0.0), result.t), rel=1e-5)
    assert node["outflow"] == pytest.approx(
        np.trapezoid(np.maximum(-flow, 0.0), result.t), rel=1e-4
    )


@pytest.mark.parametrize("method", [*ADAPTIVE, "rk4"])
def test_the_throughput_of_a_scene_without_a_state_is_as_accurate_as_its_tolerance(method):
    """The ledger of a case without states equals the integral of its flow.

    The supply pressure falls, so that a pressure-dependent demand gets all, a part and none of its flow (Wagner).
    """
    nodes = {
        "lake": reservoir({"time": [0.0, 100.0], "value": [AMBIENT + 6e4, AMBIENT - 1e4]}),
        "town": scenes.junction(
            0.02, required_pressure=AMBIENT + 4e4, minimum_pressure=AMBIENT + 2e4
        ),
    }
    case = scene(
        nodes,
        {"way": valve("lake", "town", 0.01)},
        100.0,
        settings(method, 0.02),
        ["way.flow"],
        0.01,
    )
    result = fvsolve.run(case)
    mass, flowed = result.ledger["mass"], np.trapezoid(1000.0 * result["way.flow"], result.t)
    near = 5e-6 if method == "tr-bdf2" else 1e-6  # order 2: many steps with an error of rtol each
    for word in ("inflow", "outflow"):
        assert mass[word] == pytest.approx(flowed, rel=near)
    assert (
        mass["nodes"]["lake"]["outflow"] == 0.0
        and mass["nodes"]["town.demand.outside"]["inflow"] == 0.0
    )


def swung(section: float, level: float, gap: float, times: list, gauges: list) -> dict:
    """Reference amounts [kg] of a tank behind a valve under a pressure that alternates, by SciPy.

    dm/dt = q, and the tank stays at 0 while it is dry and q < 0.
    """
    amounts, held, t = np.array([section * level * 1000.0, 0.0, 0.0]), False, times[0]

    def flow(t, mass):
        drop = np.interp(t, times, gauges) - GRAVITY * mass / section
        return gap * math.sqrt(2000.0 * abs(drop)) * math.copysign(1.0, drop)

    def rates(t, y):
        q = flow(t, 0.0 if held else y[0])
        return [0.0 if held else q, max(q, 0.0), max(-q, 0.0)]

    def turns(t, y):
        return flow(t, 0.0) + 1e-9 if held else y[0] + 1e-9

    turns.terminal, made_up = True, 0.0
    for end in times[1:]:
        while t < end:
            turns.direction = 1 if held else -1
            found = solve_ivp(
                rates,
                (t, end),
                amounts,
                "DOP853",
                events=turns,
                rtol=1e-10,
                atol=1e-7,
                max_step=0.5,
            )
            made_up += found.y[2, -1] - amounts[2] if held else 0.0
            t, amounts = found.t[-1], found.y[:, -1]
            held ^= found.status == 1
    return {"final": amounts[0], "inflow": amounts[1], "outflow": amounts[2], "made_up": made_up}


@functools.cache
def seesaw() -> dict:
    return swung(0.5, 1.0, 0.002, SEESAW, GAUGES)


SEESAW, GAUGES = [0.0, 100.0, 200.0, 300.0, 400.0], [3e4, -3e4, 3e4, -3e4, 1e4]


@pytest.mark.parametrize("method", [*ADAPTIVE, "esdirk-3", "rk4", "trapezoid", "gauss-4"])
def test_the_deficit_of_a_dry_tank_is_as_accurate_as_its_content(method):
    """The made-up amount of a dry tank is accurate although no state depends on it.

    Its quadrature therefore has error control, and steps are short where a flow starts as a root.
    """
    nodes = {
        "lake": reservoir({"time": SEESAW, "value": [AMBIENT + p for p in GAUGES]}),
        "vat": tank(0.5, 1.0),
    }
    case = scene(
        nodes,
        {"way": valve("lake", "vat", 0.002)},
        400.0,
        settings(method, 0.02),
        ["way.flow"],
        1.0,
    )
    mass = fvsolve.run(case).ledger["mass"]
    assert {key: mass[key] for key in seesaw()} == pytest.approx(seesaw(), rel=7e-5)
    assert abs(mass["remainder"]) < 1e-8


def sucked(method: str, scheme: str = "muscl", rtol: float = 1e-6, **more):
    """Run of a basin on a slope whose shallow side runs dry by suction at a patch that continues to draw.

    The basin is on a body at rest, so its cells take the flow of the link, not the faces of the patch.
    """
    outlet = {"outlet": {"side": "east", "span": [0.0, 4.0]}}
    nodes = {
        "pool": {
            "type": "basin",
            "size": [6.0, 4.0],
            "cells": [6, 4],
            "level": 0.2,
            "bed": "0.02*x",
            "patches": outlet,
            "on": "floor",
            **more,
        },
        "floor": turning(straight(0.0)),
        "out": reservoir(AMBIENT - 1e4, at=[6.0, 2.0, 0.11], on="floor"),
    }
    numerics = {"scheme": scheme, "method": method, "rtol": rtol}
    links = {"tap": valve("pool.outlet", "out", 0.05)}
    return fvsolve.run(scene(nodes, links, 10.0, numerics, ["tap.flow"], 0.01))


ISLAND = [[1.0, 1.0, 2.0, 2.0]]


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "method", ["dormand-prince", "auto", "rodas-5p", "radau-iia-5", "tr-bdf2", "esdirk-4"]
)
@pytest.mark.parametrize("more", [{}, {"holes": ISLAND}], ids=["grid", "faces"])
def test_a_patch_that_runs_dry_accounts_its_content_and_its_make_up(method, more):
    result = sucked(method, **more)
    mass, flowed = result.ledger["mass"], 1000.0 * np.trapezoid(result["tap.flow"], result.t)
    fine, first = (
        sucked("dormand-prince", *how, **more).ledger["mass"]
        for how in (("muscl", 1e-9), ("upwind",))
    )
    assert result.ok and mass["inflow"] == 0.0 and 0.0 <= mass["spilled"] <= 1e-8 * mass["initial"]
    assert mass["outflow"] == pytest.approx(flowed, rel=1e-6)
    assert mass["made_up"] == pytest.approx(fine["made_up"], rel=1e-4)
    assert mass["made_up"] == pytest.approx(first["made_up"], rel=0.15)
    assert abs(mass["remainder"]) <= 1e-12 * mass["initial"]
