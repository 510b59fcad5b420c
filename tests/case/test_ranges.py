"""Valid values outside the usual range give one notice, with the unit that was probably intended."""

import math
import re
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from reference import folders, scenes
from reference.case_texts import SCENE

from fvsolve import run
from fvsolve.case import load
from fvsolve.case.case_notices import range_notices
from fvsolve.case.sections import FluidSpec
from fvsolve.core.run import model_of
from fvsolve.errors import listing
from fvsolve.parts import KINDS

CASES = sorted(folders.CASES.glob("*.toml"))
EXAMPLES = {  # TOML blocks in the docs
    f"{page.stem}-{at}": text
    for page in sorted(folders.DOCS.glob("*.md"))
    for at, text in enumerate(
        re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    )
}

SLIPS = {  # settings -> (place, key, value, limit, part of the text)
    "per cent of a class": (
        {"links.main.allowable_pressure": 1e6, "limits.top": {"on": "main", "class_fraction": 100}},
        "limits.top", "class_fraction", 100.0, 3.0, "1 is the class itself",
    ),
    "diameter in mm": ({"links.main.diameter": 304.8}, "links.main", "diameter", 304.8, 14.0, '"304.8 mm"'),
    "diameter with its unit": ({"links.main.diameter": "300 m"}, "links.main", "diameter", 300.0, 14.0, '"300 mm"'),
    "wider than long": ({"links.main.length": 0.2}, "links.main", "diameter", 0.3048, 0.2, "the length of 0.2 m"),
    "roughness": (
        {"links.main.friction.roughness": "400 mm"},
        "links.main", "friction.roughness", 0.4, 0.05 * 0.3048, '"0.4 mm"',
    ),
    "roughness in mm": (
        {"links.main.friction.roughness": 0.26},
        "links.main", "friction.roughness", 0.26, 0.05 * 0.3048, '"0.26 mm"',
    ),
    "modulus": (
        {"links.main.wall": {"youngs_modulus": "170 MPa", "thickness": "8 mm"}},
        "links.main", "wall.youngs_modulus", 170e6, 2e8, "is the unit GPa?",
    ),
    "modulus of steel": (
        {"links.main.wall": {"youngs_modulus": "210 MPa", "thickness": "8 mm"}},
        "links.main", "wall.youngs_modulus", 210e6, 4e8, "is the unit GPa?",
    ),
    "modulus in GPa": (
        {"links.main.wall": {"youngs_modulus": 170, "thickness": "8 mm"}},
        "links.main", "wall.youngs_modulus", 170.0, 1e5, '"170 GPa"',
    ),
    "thickness": (
        {"links.main.wall": {"youngs_modulus": "170 GPa", "thickness": 8}},
        "links.main", "wall.thickness", 8.0, 2.0, '"8 mm"',
    ),
    "wave speed": ({"links.main.wave_speed": 12}, "links.main", "wave_speed", 12.0, 30.0, "soft hoses"),
    "wave speed in km/s": ({"links.main.wave_speed": 1.2}, "links.main", "wave_speed", 1.2, 30.0, '"1.2 km/s"'),
    "wave speed of another wall": (
        {"links.main": {"type": "pipe", "from": "lake", "to": "gate", "length": 900, "nominal": "DN300",
                        "class": "SDR11", "material": "PE100", "wave_speed": 1200, "friction": {"model": "none"}}},
        "links.main", "wave_speed", 1200.0, (998.0 * (1 / 2.2e9 + 9 / 1.3e9)) ** -0.5,
        "the wall of PE100 SDR11 DN300",
    ),
    "loose tolerance": ({"numerics.rtol": 0.1}, "numerics", "rtol", 0.1, 0.01, "errors of a few percent"),
    "smooth through two": (
        {"links.valve.opening": {"time": [1, 2], "value": [1, 0], "kind": "smooth"}},
        "links.valve", "opening", 2.0, 3.0, "a straight line",
    ),
    "Darcy factor": (
        {"links.main.friction": {"model": "steady", "factor": 2}},
        "links.main", "friction.factor", 2.0, 0.5, "Moody",
    ),
    "Hazen-Williams": (
        {"links.main.friction": {"model": "hazen-williams", "coefficient": 0.012}},
        "links.main", "friction.coefficient", 0.012, 40.0, 'did you mean model = "chezy-manning"?',
    ),
    "Manning": (
        {"links.main.friction": {"model": "chezy-manning", "coefficient": 130}},
        "links.main", "friction.coefficient", 130.0, 0.06, 'did you mean model = "hazen-williams"?',
    ),
    "viscosity": ({"fluid.viscosity": 32}, "fluid", "viscosity", 32.0, 5.0, '"32 mPa s" or "32 cSt"'),
    "density": ({"fluid.density": 0.998}, "fluid", "density", 0.998, 60.0, '"0.998 g/cm3"'),
    "bulk modulus": ({"fluid.bulk_modulus": "2.2 MPa"}, "fluid", "bulk_modulus", 2.2e6, 1e7, '"2.2 GPa"'),
    "temperature": ({"fluid.temperature": 20}, "fluid", "temperature", 20.0, 60.0, '"20 degC"'),
    "gravity": ({"gravity": 9806.65}, "", "gravity", 9806.65, 30.0, "the Moon to Jupiter"),
    "a valve's area": ({"links.valve.area": 1768}, "links.valve", "area", 1768.0, 200.0, '"1768 mm2"'),
}  # fmt: skip


NETWORK_SLIPS = [  # part, key, value, part of the text
    ({"type": "heat-capacity", "heat_capacity": 3}, "initial_temperature", 20, '"20 degC"'),
    ({"type": "ambient"}, "temperature", 25, '"25 degC"'),
    ({"type": "shaft", "inertia": 1}, "initial_speed", 1500, '"1500 rpm"'),
    ({"type": "housing"}, "speed", 1500, '"1500 rpm"'),
    ({"type": "voltage-source", "from": "a", "to": "b"}, "voltage", 24e6, "to transmission lines"),
    ({"type": "resistor", "from": "a", "to": "b"}, "resistance", 1e-7, "contacts to insulation"),
    ({"type": "capacitor", "from": "a", "to": "b"}, "capacitance", 100, '"100 uF"'),
    ({"type": "inductor", "from": "a", "to": "b"}, "inductance", 200, '"200 mH"'),
]
MACHINE = {
    "type": "displacement-pump",
    "from": "lake",
    "to": "gate",
    "displacement": "28 cm3/rev",
    "speed": "1500 rpm",
}
MACHINE_SLIPS = [
    ({}, "speed", 1500, '"1500 rpm"'),
    ({"volumetric_efficiency": 0.9, "rated_speed": "1500 rpm"}, "rated_pressure", 180, '"180 bar"'),
    (
        {"volumetric_efficiency": 0.9, "rated_pressure": "180 bar"},
        "rated_speed",
        1500,
        '"1500 rpm"',
    ),
]


@pytest.mark.parametrize(
    "part, key, value, says", NETWORK_SLIPS, ids=[item[0]["type"] for item in NETWORK_SLIPS]
)
def test_a_slip_of_units_in_a_network_is_noted(part, key, value, says):
    group = "links" if "from" in part else "nodes"
    given = {name: item for name, item in (part | {key: value}).items() if name != "type"}
    said = {
        **load(tomllib.loads(SCENE)).__dict__,
        "raw": {group: {"x": part | {key: value}}},
        "nodes": {},
        "links": {},
    }
    said[group] = {"x": KINDS[group][part["type"]].model_validate(given)}
    (note,) = range_notices(SimpleNamespace(**said))
    assert (note.place, note.key) == (f"{group}.x", key) and says in note.text


@pytest.mark.parametrize(
    "more, key, value, says", MACHINE_SLIPS, ids=[item[1] for item in MACHINE_SLIPS]
)
def test_a_slip_of_units_in_a_displacement_machine_is_noted(more, key, value, says):
    (note,) = load(tomllib.loads(SCENE), {"links.x": MACHINE | more | {key: value}}).notices
    assert (note.place, note.key) == ("links.x", key) and says in note.text


def test_slips_of_units_in_tables_are_noted():
    compensator = {"set_pressure": 180, "range": "10 bar"}
    (note,) = load(
        tomllib.loads(SCENE), {"links.x": MACHINE | {"compensator": compensator}}
    ).notices
    assert note.key == "compensator.set_pressure" and '"180 bar"' in note.text
    law = {"law": "astm-d341", "points": [[40, "46 cSt"], [100, "6.8 cSt"]]}
    notes = load(tomllib.loads(SCENE), {"fluid.viscosity": law}).notices
    assert [note.text.partition("mean ")[2] for note in notes] == ['"40 degC"?', '"100 degC"?']


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_of_units_is_noted_once_with_the_likely_unit(name):
    settings, place, key, value, limit, says = SLIPS[name]
    (note,) = load(tomllib.loads(SCENE), settings).notices
    assert (note.kind, note.place, note.key, note.ok) == ("range", place, key, True)
    assert (note.value, note.limit) == (pytest.approx(value), pytest.approx(limit))
    assert says in note.text and (f"{place}.{key}" if place else key) in note.text


def test_notes_of_ranges_reach_check_and_summary():
    case = load(tomllib.loads(SCENE), {"links.main.wave_speed": 12, "numerics.end": 1})
    for said in (model_of(case).checks["warnings"], run(case).summary["warnings"]):
        (note,) = [one for one in said if one["kind"] == "range"]
        assert (note["place"], note["key"], note["value"], note["limit"]) == (
            "links.main",
            "wave_speed",
            12.0,
            30.0,
        )


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_shipped_cases_are_within_ranges_of_practice(path):
    assert not [note.text for note in model_of(load(path)).warnings if note.kind == "range"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_of_the_docs_are_within_ranges_of_practice(name):
    try:
        raw = tomllib.loads(EXAMPLES[name])
    except tomllib.TOMLDecodeError:
        pytest.skip("it shows a choice")
    said = {**load(tomllib.loads(SCENE)).__dict__, "raw": raw, "nodes": {}, "links": {}}
    for group in ("nodes", "links"):
        for part, given in raw.get(group, {}).items():
            kind = KINDS[group].get(given.get("type")) if isinstance(given, dict) else None
            try:
                rest = {key: value for key, value in given.items() if key != "type"}
                said[group] |= {part: kind.model_validate(rest)} if kind else {}
            except ValueError:  # the example names a file or a signal that it lacks
                continue
    if isinstance(raw.get("fluid"), dict) and "name" in raw["fluid"]:
        said["fluid"] = FluidSpec.model_validate(raw["fluid"])
    assert not [note.text for note in range_notices(SimpleNamespace(**said))]


@pytest.mark.parametrize(
    "settings",
    [
        {"links.main.wave_speed": 50},  # a hose
        # rubber
        {
            "links.main.wall": {"youngs_modulus": "5 MPa", "thickness": "4 mm"},
            "links.main.diameter": "20 mm",
        },
        # low-density polyethylene, SDR 17
        {"links.main.wall": {"youngs_modulus": "0.25 GPa", "thickness": "20 mm"}},
        {
            "links.main.diameter": "0.1 mm",
            "links.main.friction.roughness": 0,
            "links.main.length": "0.1 m",
        },
        {"links.main.diameter": "12 m"},  # a penstock
        {"fluid.density": 13534, "fluid.bulk_modulus": "28 GPa"},  # mercury
        {"fluid.density": 870, "fluid.viscosity": "680 cSt"},
        {"gravity": 0},
    ],
)
def test_hoses_capillaries_penstocks_and_their_liquids_are_within(settings):
    assert not load(tomllib.loads(SCENE), settings).notices


def main(flow: float, viscosity: float = 1e-3, density: float = 1000.0, **pipe) -> dict:
    """Case of a pipe of 0.3 m with a given flow."""
    said = {"cells": 10, "friction": {"model": "quasi-steady", "roughness": 1e-4}, **pipe}
    fluid = {**scenes.WATER, "viscosity": viscosity, "density": density}
    links = {"main": scenes.pipe("lake", "end", 1000.0, 0.3, 1200.0, **said)}
    return scenes.scene(
        {"lake": scenes.lake(50.0), "end": scenes.junction(flow)},
        links,
        1.0,
        scenes.SMOOTH,
        fluid=fluid,
    )


def noted(case: dict) -> list:
    return [one for one in model_of(load(case)).warnings if one.kind == "range"]


def rigid(case: dict) -> dict:
    """Case with a rigid column into a tank in place of the pipe, at equal flow."""
    pipe, flow = case["links"]["main"], case["nodes"]["end"]["demand"]
    kept = {key: pipe[key] for key in ("from", "to", "length", "diameter", "friction")}
    column = {"type": "rigid-column", **kept, "initial_flow": flow}
    nodes = {"lake": scenes.lake(50.0), "end": scenes.tank(10.0, 50.0)}
    return {**case, "nodes": nodes, "links": {"main": column}, "numerics": {"end": 1.0}}


@pytest.mark.parametrize("made", [dict, rigid])
@pytest.mark.parametrize(("flow", "viscosity"), [(0.03, 1.0), (3e-5, 1e-3)])
def test_laminar_water_in_a_main_is_noted(flow, viscosity, made):
    (note,) = noted(made(main(flow, viscosity)))
    reynolds = 1000.0 * flow / (math.pi / 4.0 * 0.3**2) * 0.3 / viscosity
    assert (note.place, note.key) == ("links.main", "reynolds") and note.value == pytest.approx(
        reynolds
    )
    assert f"{reynolds:.4g}" in note.text


def test_oil_may_be_laminar_and_water_at_rest():
    assert not noted(main(0.03, 1.0, density=870.0))
    assert not noted(main(0.0))
    assert not noted(main(0.03))


def test_a_flow_that_no_pipe_carries_is_noted():
    case = main(30.0, friction={"model": "none"})
    for same in (case, rigid(case)):
        (note,) = noted(same)
        assert note.key == "flow" and note.value == pytest.approx(30.0 / (math.pi / 4.0 * 0.3**2))


@pytest.mark.parametrize("cells", [1, 2])
def test_too_few_cells_are_noted_where_they_matter(cells):
    case = main(0.03, cells=cells)
    for scheme, enough in (("upwind", 40), ("muscl", 10), ("weno5", 6)):
        case["numerics"] = {**case["numerics"], "scheme": scheme}
        (note,) = noted(case)
        assert (note.place, note.key, note.value, note.limit) == (
            "links.main",
            "cells",
            cells,
            enough,
        )
    case["links"]["main"]["cells"] = 100
    case["links"]["main"]["to"] = "stub"
    case["nodes"]["stub"] = scenes.junction()
    case["links"]["stub"] = scenes.pipe("stub", "end", 10.0, 0.3, 1200.0, cells)
    assert not noted(case)


def test_a_list_never_hides_two():
    for count in range(1, 40):
        said = listing([f"n{k:02}" for k in range(count)])
        assert "in all" not in said or count - said.count("n") + 1 >= 3


@pytest.mark.parametrize("law", ["linear", "log"])
def test_loops_without_friction_are_named_once(law):
    case = main(0.03)
    case["fluid"] = {**case["fluid"], "law": law}
    case["nodes"] |= {
        "a": scenes.junction(),
        "b": scenes.junction(),
        "out": case["nodes"].pop("end"),
    }
    case["links"]["main"]["to"] = "a"
    case["links"] |= {
        name: scenes.pipe("a", "b", 100.0, 0.3, 1200.0, 5) for name in ("left", "right")
    }
    case["links"]["stub"] = scenes.pipe("b", "out", 100.0, 0.3, 1200.0, 5)
    (note,) = [one for one in model_of(load(case)).warnings if "loops" in one.text]
    assert note.place == "links.left" and note.text.startswith(
        "left, right: flow in loops without friction"
    )


@pytest.mark.parametrize(
    "other, equal", [("tank", False), ("chamber", False), ("lake", False), ("tank", True)]
)
def test_a_column_without_friction_between_two_vessels_is_no_loop(other, equal):
    """Unequal heads start an oscillation: a 50 m column between a lake and a tank has w^2 = g A / (L F)."""
    height, head = (
        0.0 if equal else 1.0,
        101325.0 + 1000.0 * 9.80665 * (31.0 if not equal else 30.0),
    )
    end = {
        "tank": scenes.tank(0.2, 30.0 + height),
        "chamber": scenes.chamber(1.0, head),
        "lake": scenes.lake(31.0),
    }
    column = {
        "type": "rigid-column",
        "from": "lake",
        "to": "end",
        "length": 50.0,
        "diameter": 0.3,
        "friction": {"model": "none"},
    }
    nodes = {"lake": scenes.lake(30.0), "end": end[other]}
    case = scenes.scene(
        nodes, {"way": column}, 20.0, {"method": "dormand-prince", "rtol": 1e-9}, ["way.flow"], 0.5
    )
    result = run(case)
    said = [one for one in result.warnings if one.kind == "start"]
    assert result.ok and [one.place for one in said] == ([] if equal else ["links.way"])
    for one in said:
        assert "starts from rest, and oscillates or grows" in one.text and "loop" not in one.text
    assert result["way.flow"][0] == 0.0
    if other == "tank":
        omega = math.sqrt(9.80665 * math.pi / 4 * 0.09 / (50.0 * 0.2))
        assert result["way.flow"] == pytest.approx(
            -height * 0.2 * omega * np.sin(omega * result.t), abs=1e-6
        )


def test_check_summary_and_resolved_case_hold_the_fluid():
    case = load(tomllib.loads(SCENE), {"numerics.end": 0.1, "fluid.name": "Water"})
    said = model_of(case).checks["fluid"]
    assert said == run(case).summary["fluid"]
    assert list(said) == [
        "name",
        "density",
        "bulk_modulus",
        "sound_speed",
        "viscosity",
        "vapor_pressure",
        "source",
    ]
    assert (said["name"], said["density"], said["vapor_pressure"]) == ("Water", 998.0, 2339.0)
    assert said["sound_speed"] == pytest.approx(math.sqrt(2.2e9 / 998.0), rel=1e-15)
    assert re.fullmatch(
        r"CoolProp [0-9.]+; density, bulk_modulus, viscosity, vapor_pressure given", said["source"]
    )
    text = case.resolved()
    for key in ("density", "bulk_modulus", "sound_speed", "viscosity", "vapor_pressure"):
        assert f"\n# {key} = {said[key]!r}\n" in text
    again = load(tomllib.loads(text))
    assert again == case and again.properties == case.properties


def ladder(pipes: int) -> dict:
    """Case of pipes in a row; the seventh is narrower, and the ninth has a higher wave speed."""
    nodes = {"lake": scenes.lake(50.0)} | {
        f"n{k}": scenes.junction(0.01 if k == pipes else None) for k in range(1, pipes + 1)
    }
    friction = {"model": "quasi-steady", "roughness": 1e-4}
    links = {
        f"p{k}": scenes.pipe(
            "lake" if k == 1 else f"n{k - 1}",
            f"n{k}",
            10.0,
            0.3 - 0.1 * (k == 7),
            1200.0,
            3,
            friction=friction,
        )
        for k in range(1, pipes + 1)
    }
    links["p9"]["wave_speed"] = 2500.0
    return scenes.scene(
        nodes, links, 0.1, scenes.SMOOTH, output={"units": {"pressure": "barg", "velocity": "cm/s"}}
    )


def test_check_shows_outliers_in_the_units_of_the_output(capsys):
    from fvsolve.cli import printing
    from fvsolve.cli.terminal import show

    model = model_of(load(ladder(50)))
    show(printing.check_text(model.case, model.checks))
    short = capsys.readouterr().out
    show(printing.check_text(model.case, model.checks, every=True))
    whole = capsys.readouterr().out

    def rows(text):
        return {line.split()[0] for line in text.splitlines() if re.match(r" *[pn]\d+ ", line)}

    assert {f"p{k}" for k in range(1, 51)} | {f"n{k}" for k in range(1, 51)} == rows(whole)
    assert {"p7", "p9", "p1", "p50", "n50"} <= rows(short) and len(rows(short)) < 20
    assert "more of 50" in short and "--all" in short and "more of" not in whole
    assert "pressure [barg]" in short and "velocity [cm/s]" in short
    (fluid,) = [line for line in short.splitlines() if line.startswith("fluid user:")]
    assert "bulk modulus 22000 bar" in fluid and "vapor pressure -0.99025 barg" in fluid
    assert "sound speed 148324 cm/s" in fluid and "viscosity 0.001 Pa s" in fluid
