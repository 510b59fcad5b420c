"""Case file: the case has the values of the file, and the resolved case reads back as an equal case."""

import json
import pickle
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from reference import folders
from reference.case_texts import DETAILED, two_tanks
from reference.refusals import refused

from fvsolve.case import Case, FluidSpec, Numerics, Output, load, schema
from fvsolve.case import sections as defaults
from fvsolve.case.claims import COMPARE_KEYS, expect_keys
from fvsolve.case.key_tables import key_table
from fvsolve.case.schema import full_schema, schema_text
from fvsolve.errors import CaseError
from fvsolve.parts import KINDS, Friction, Wall
from fvsolve.parts.control import Control


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(DETAILED)
    return path


def test_the_text_of_the_design_is_read_into_the_case(scene):
    case = load(scene)
    assert (case.name, case.path, case.schema) == ("scene", scene, 1)
    assert (case.ambient_pressure, case.gravity) == (101325.0, 9.80665)
    assert list(case.nodes) == ["lake", "gate", "outfall"]
    assert case.nodes["lake"].head.constant and case.nodes["lake"].head.first == 45.72
    assert case.nodes["lake"].pressure is None
    assert case.nodes["outfall"].pressure.first == 101325.0
    assert case.nodes["gate"].demand.first == 0.0
    main, valve = case.links["main"], case.links["valve"]
    assert main.kind == "pipe" and main.ports == {"from": "lake", "to": "gate"}
    assert (main.length, main.diameter, main.wave_speed, main.cells) == (914.4, 0.3048, 1219.2, 200)
    assert (main.friction.model, main.friction.roughness, main.friction.factor) == (
        "steady",
        0.00026,
        None,
    )
    assert (main.wall, main.minor_loss, main.initial_flow) == (None, 0.0, None)
    assert valve.flow_area() == 0.6 * 0.001768
    assert valve.opening.kind == "ramp" and valve.opening.exponent == 1.0
    assert valve.opening.time.tolist() == [1.0, 1.05] and valve.opening.value.tolist() == [1.0, 0.0]
    numerics = case.numerics
    assert (numerics.start, numerics.end, numerics.initial, numerics.courant) == (
        0.0,
        10.0,
        "steady",
        0.9,
    )
    assert (numerics.step, numerics.rtol, numerics.cell_time) == (None, None, None)
    assert (numerics.scheme, numerics.limiter, numerics.method) == ("muscl", "van-leer", "ssp-rk3")
    assert numerics.below_vapor == "continue"
    assert (case.output.every, case.output.fields, case.output.units) == (0.01, 50, {})
    assert [probe.text for probe in case.output.probes] == [
        "gate.pressure",
        "gate.head",
        "valve.flow",
        "main.pressure@0.5",
    ]
    half = case.output.probes[3]
    assert (half.part, half.name, half.quantity, half.fraction) == (
        "links",
        "main",
        "pressure",
        0.5,
    )
    claim = case.expect["max(gate.pressure)"]
    assert (claim.function, claim.probe.text, claim.time, claim.value) == (
        "max",
        "gate.pressure",
        None,
        1.0751e6,
    )
    assert (claim.rtol, claim.atol) == (1e-2, 0.0)
    assert case.properties.density == 1000 and case.fluid.viscosity == approx(1e-3)
    assert not case.elevations_stated and case.elevation("gate") == 0.0


def test_the_case_is_frozen(scene):
    case = load(scene)
    for change in (
        lambda: setattr(case, "title", "x"),
        lambda: setattr(case.links["main"], "length", 1.0),
        lambda: setattr(case.numerics, "end", 1.0),
        lambda: case.links["valve"].opening.value.__setitem__(0, 2.0),
    ):
        with pytest.raises((AttributeError, ValueError, TypeError)):
            change()


def dressed(tmp_path, **changes):
    """File of a case that uses nearly every key."""
    (tmp_path / "in").mkdir(exist_ok=True)
    (tmp_path / "in" / "stroke.csv").write_text(
        "# measured\nt [ms],opening [%]\n0,100\n500,40\n900,0\n"
    )
    (tmp_path / "stroke.csv").write_text("t [s];demand [l/s]\n0;1\n2;3\n")
    (tmp_path / "rig.csv").write_text("t [s],H [m],p [barg]\n0,45,4.4\n1,46,4.5\n1,47,4.6\n")
    case = {
        "title": 'A "dressed" case\n\\ of two lines',
        "ambient_pressure": "0.9 bar",
        "gravity": 9.81,
        "fluid": {
            "name": "user",
            "density": 870,
            "bulk_modulus": 1.5e9,
            "viscosity": "32 cSt",
            "law": "log",
        },
        "nodes": {
            "lake": {"type": "reservoir", "head": {"signal": "tide"}},
            "tower": {
                "type": "tank",
                "elevation": 3,
                "area": {"level": [0, 1, 2], "area": [1, 2, "4 m2"]},
                "level": "1.5 m",
                "height": 2,
            },
            "gate": {
                "type": "junction",
                "elevation": 1,
                "demand": {"file": "stroke.csv", "kind": "smooth"},
            },
            "well": {
                "type": "inflow",
                "elevation": 1,
                "flow": {"time": [0, 1], "value": ["1 l/s", 0], "kind": "step"},
            },
            "bell": {
                "type": "chamber",
                "elevation": 0,
                "volume": "50 l",
                "initial_pressure": "2 barg",
            },
        },
        "links": {
            "main": {
                "type": "pipe",
                "from": "lake",
                "to": "gate",
                "length": 100,
                "diameter": 0.1,
                "minor_loss": 2,
                "wall": {"youngs_modulus": "120 GPa", "thickness": "2 mm"},
                "initial_flow": "1 l/s",
                "friction": {"model": "hazen-williams", "coefficient": 120},
            },
            "stiff": {
                "type": "pipe",
                "from": "well",
                "to": "gate",
                "length": 10,
                "diameter": 0.1,
                "wall": "rigid",
            },
            "riser": {
                "type": "rigid-column",
                "from": "gate",
                "to": "tower",
                "length": 10,
                "diameter": 0.1,
            },
            "gate": {
                "type": "valve",
                "from": "gate",
                "to": "bell",
                "Kv": 3,
                "opening": {"file": "in/stroke.csv"},
                "characteristic": {"opening": [0, 0.5, 1], "flow_area": [0, 0.2, 1]},
            },
            "hole": {
                "type": "orifice",
                "from": "bell",
                "to": "tower",
                "loss_coefficient": 2.4,
                "diameter": "10 mm",
                "laminar_reynolds": 10,
                "opening": {"start": 1, "duration": 2, "value": [1, 0], "exponent": 1.5},
                "characteristic": "equal-percentage",
            },
        },
        "signals": {"tide": {"time": [0, 3600], "value": ["4 m", "5 m"], "kind": "smooth"}},
        "numerics": {
            "start": -1,
            "end": "1 min",
            "rtol": 1e-7,
            "cell_time": "2 ms",
            "below_vapor": "stop",
        },
        "output": {
            "units": {"pressure": "barg", "flow": "l/s"},
            "probes": [
                "tower.level",
                "nodes.gate.head",
                "links.gate.flow",
                "main.velocity@0.25",
                "main.flow",
            ],
        },
        "expect": {
            "at(tower.level, 500 ms)": {"value": "1.5 m", "atol": "1 mm"},
            "final(bell.gauge_pressure)": {"value": "2 bar", "atol": "10 mbar"},
        },
        "compare": {
            "nodes.gate.head": {
                "file": "rig.csv",
                "time": "t [s]",
                "value": "H [m]",
                "shift": "12 ms",
            },
            "gate.pressure": {"file": "rig.csv", "value": "p"},
        },
    }
    case.update(changes)
    path = tmp_path / "dressed.toml"
    from fvsolve.case.text import write

    path.write_text(write(case))
    return path


def test_every_form_is_understood(tmp_path):
    case = load(dressed(tmp_path))
    tide, stroke = case.nodes["lake"].head, case.links["gate"].opening
    assert tide.kind == "smooth" and tide.value.tolist() == [4.0, 5.0]
    assert stroke.kind == "linear" and stroke.time.tolist() == approx([0, 0.5, 0.9])
    assert stroke.value.tolist() == approx([1, 0.4, 0])
    demand = case.nodes["gate"].demand
    assert demand.kind == "smooth" and demand.value.tolist() == approx([1e-3, 3e-3])
    assert case.nodes["well"].flow.kind == "step"
    assert case.nodes["bell"].initial_pressure == approx(2.9e5)
    assert case.nodes["tower"].area.area.tolist() == [1, 2, 4]
    assert case.fluid.viscosity == approx(32e-6 * 870)
    hole = case.links["hole"]
    assert (
        hole.kind == "orifice"
        and hole.opening.exponent == 1.5
        and hole.characteristic == "equal-percentage"
    )
    assert hole.flow_area() == approx(np.pi / 4 * 0.01**2 / np.sqrt(2.4))
    assert case.elevations_stated and case.elevation("tower") == 3
    assert case.elevation("lake") == 1  # no elevation stated: that at the far end of its first link
    claim = case.expect["at(tower.level, 500 ms)"]
    assert (claim.function, claim.time, claim.value, claim.atol) == ("at", 0.5, 1.5, 1e-3)
    assert case.expect["final(bell.gauge_pressure)"].value == 2e5
    rig = case.compare["gate.pressure"]
    assert rig.v.tolist() == approx([5.3e5, 5.4e5, 5.5e5]) and (rig.time, rig.value) == (
        "t [s]",
        "p [barg]",
    )
    assert case.compare["nodes.gate.head"].shift == 0.012
    assert case.output.units == {"pressure": "barg", "flow": "l/s", "gauge_pressure": "barg"}
    assert case.numerics.method == "auto"  # default with rtol
    assert case.output.every == 61.0 / 1000
    assert sorted(case.copies) == ["rig.csv", "stroke-2.csv", "stroke.csv"]


def test_wave_speed_and_cells(tmp_path):
    case = load(dressed(tmp_path))
    modulus = 1 / (1 / 1.5e9 + 0.1 / (120e9 * 2e-3))
    assert case.wave_speed("main") == approx(np.sqrt(modulus / 870))
    assert case.wave_speed("stiff") == approx(np.sqrt(1.5e9 / 870))
    assert case.links["main"].cells == round(100 / case.wave_speed("main") / 2e-3)
    alike = load(case, set={"numerics": {"end": 1, "rtol": 1e-6}})
    # equal travel times of cells
    assert (alike.links["main"].cells, alike.links["stiff"].cells) == (100, 8)


def test_the_resolved_case_describes_the_same_case(tmp_path):
    case = load(dressed(tmp_path))
    there = tmp_path / "run"
    there.mkdir()
    for name, path in case.copies.items():
        (there / name).write_bytes(Path(path).read_bytes())
    (there / "case.toml").write_text(case.resolved())
    again = load(there / "case.toml")
    assert again == case
    assert again.resolved() == case.resolved()
    assert again != load(case, set={"gravity": 9.8})


def test_a_dict_and_its_file_give_equal_cases(scene):
    given = tomllib.loads(DETAILED)
    case = load(given)
    assert case == load(scene) and case.path is None and case.name == "case"
    given["links"]["valve"]["opening"] = {
        "time": np.array([0.0, 1.0]),
        "value": np.array([1.0, 0.0]),
    }
    given["links"]["main"]["cells"] = np.int64(10)
    given["fluid"]["density"] = np.float64(999.0)
    case = load(given)
    assert case.links["valve"].opening.value.tolist() == [1, 0] and case.links["main"].cells == 10


def test_a_case_goes_through_pickle_and_back(scene):
    case = load(scene)
    assert pickle.loads(pickle.dumps(case)) == case
    error = CaseError([])
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize(
    "key, text, found",
    [
        ("links.main.cells", "400", lambda case: case.links["main"].cells == 400),
        ("links.main.cells", 400, lambda case: case.links["main"].cells == 400),
        ("links.main.length", "1 km", lambda case: case.links["main"].length == 1000),
        ("links.main.initial_flow", "20 l/s", lambda case: case.links["main"].initial_flow == 0.02),
        (
            "links.main.friction",
            '{ model = "none" }',
            lambda case: case.links["main"].friction.model == "none",
        ),
        (
            "links.main.friction.model",
            "quasi-steady",
            lambda case: case.links["main"].friction.roughness == 0.00026,
        ),
        ("links.valve.opening", "0.5", lambda case: case.links["valve"].opening.first == 0.5),
        (
            "links.valve.opening.duration",
            "2",
            lambda case: case.links["valve"].opening.time[1] == 3.0,
        ),
        ("numerics.scheme", "upwind", lambda case: case.numerics.scheme == "upwind"),
        ("numerics.initial", "rest", lambda case: case.numerics.initial == "rest"),
        ("gravity", "0", lambda case: case.gravity == 0),
        ("output.probes", '["gate.pressure"]', lambda case: len(case.output.probes) == 1),
        ("output.units.flow", "l/s", lambda case: case.output.units["flow"] == "l/s"),
        (
            'expect."max(gate.pressure)".rtol',
            "0.5",
            lambda case: case.expect["max(gate.pressure)"].rtol == 0.5,
        ),
        # a key replaces its alternative
        (
            "numerics.step",
            "1 ms",
            lambda case: case.numerics.step == 1e-3 and case.numerics.courant is None,
        ),
        ("links.main.wall", "rigid", lambda case: case.links["main"].wave_speed is None),
        ("nodes.lake.pressure", "4 barg", lambda case: case.nodes["lake"].head is None),
        (
            "links.main.friction.factor",
            "0.02",
            lambda case: case.links["main"].friction.roughness is None,
        ),
        # a whole part may be added
        (
            "links.bypass",
            {"type": "orifice", "from": "lake", "to": "gate", "Kv": 1},
            lambda case: case.links["bypass"].Kv == 1,
        ),
    ],
)
def test_any_key_can_be_set(scene, key, text, found):
    assert found(load(scene, set={key: text}))
    assert found(load(load(scene), set={key: text}))


def test_setting_leaves_the_source_alone(scene):
    case = load(scene)
    load(case, set={"links.main.cells": 400})
    assert case.links["main"].cells == 200 and load(case) is case


def test_without_pipes_the_error_is_controlled():
    case = load(two_tanks())
    assert (case.numerics.rtol, case.numerics.method, case.numerics.courant) == (1e-6, "auto", None)
    assert [probe.text for probe in case.output.probes] == [
        "a.pressure",
        "a.head",
        "a.level",
        "b.pressure",
        "b.head",
        "b.level",
        "hole.flow",
    ]


def test_a_ramp_without_duration_is_a_jump():
    given = two_tanks()
    given["links"]["hole"]["opening"] = {"start": 2, "duration": 0, "value": [1, 0]}
    opening = load(given).links["hole"].opening
    assert (
        opening.kind == "step" and opening.time[1] == 2.0 and opening.value.tolist() == [1.0, 0.0]
    )
    assert load(load(given).table()) == load(given)


def test_a_single_point_is_a_constant():
    given = two_tanks()
    given["links"]["hole"]["opening"] = {"time": [3], "value": [0.5]}
    assert load(given).links["hole"].opening.constant


@pytest.mark.parametrize(
    "size, flow",
    [
        ({"area": "10 cm2"}, 0.61 * 1e-3 * np.sqrt(2e5 / 1000)),
        ({"diameter": 0.1, "loss_coefficient": 4}, np.pi / 400 / 2 * np.sqrt(2e5 / 1000)),
        ({"Kv": 36}, 0.01),  # m3/h at 1 bar
        # gpm at 1 psi
        ({"Cv": 100}, 100 * 3.785411784e-3 / 60 * np.sqrt(1e5 / 6894.757293168361 * 0.999016)),
    ],
)
def test_every_size_of_a_valve_passes_the_flow_it_names(size, flow):
    given = two_tanks()
    given["links"]["hole"] = {"type": "valve", "from": "a", "to": "b", **size}
    assert load(given).links["hole"].flow_area() * np.sqrt(2 * 1e5 / 1000) == approx(
        flow, rel=1e-12
    )


def test_references_of_the_schema_have_unshared_meanings():
    """All references of the schema are defined and expand to the full schema, and its text reads back as the schema."""
    made, defs, unshared = schema(), schema()["$defs"], full_schema()

    def expanded(part):
        if isinstance(part, dict):
            address = part.get("$ref", "")
            name = address.removeprefix("#/$defs/")
            if name != address and name not in unshared["$defs"]:
                beside = {key: one for key, one in part.items() if key != "$ref"}
                return expanded(defs[name]) | beside
            return {key: expanded(one) for key, one in part.items()}
        return [expanded(inner) for inner in part] if isinstance(part, list) else part

    assert expanded({**made, "$defs": {name: defs[name] for name in unshared["$defs"]}}) == unshared
    assert json.loads(schema_text(made)) == made
    models = [
        *Control.kinds.values(),
        *(model for group in KINDS.values() for model in group.values()),
    ]
    keys = sum(len([*model.keys()]) for model in models)
    # a key of the defaults of a type is a reference of a single line, in a table of five lines
    defaults = made["properties"]["defaults"]["properties"].values()
    references = sum(len(table["properties"]) + 5 for table in defaults)
    text = schema_text(made)
    assert len(text.splitlines()) < 10.1 * keys + references
    assert len(text) < 0.7 * len(schema_text(unshared))


def test_a_parts_key_is_documented_with_its_unit():
    made = schema()
    pipe = next(
        one
        for one in made["properties"]["links"]["additionalProperties"]["anyOf"]
        if one["title"] == "Pipe"
    )
    assert pipe["required"] == [
        "type",
        "from",
        "to",
    ]  # not required: one of length and profile, one of diameter and nominal
    assert pipe["properties"]["length"]["description"] == "length along its axis [m]"
    assert made["anyOf"][0] == {"required": ["numerics", "fluid", "nodes"]}
    assert made["anyOf"][-1] == {"required": ["validation"]}


def test_the_schema_requires_links_except_with_a_basin_or_a_body():
    """`load` requires links on this condition, so editors report no fault in the shipped cases."""
    made = schema()
    assert made["if"]["required"] == ["nodes"] and made["if"]["not"] == {"required": ["controls"]}
    (group,) = made["if"]["properties"]
    excluded = made["if"]["properties"][group]["additionalProperties"]["properties"]["type"]["not"][
        "enum"
    ]
    for path in folders.CASES.glob("*.toml"):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        plain = "controls" not in table and all(
            one["type"] not in excluded for one in table[group].values()
        )
        first, without = made["anyOf"][:2]
        kinds = without["properties"][group]["additionalProperties"]["properties"]["type"]["enum"]
        fluid = first["required"] if "fluid" in table else without["required"]
        assert "fluid" in table or all(one["type"] in kinds for one in table[group].values())
        assert {*fluid, *(made["then"]["required"] if plain else ())} <= {*table}, path.name


def test_the_page_of_the_case_file_names_every_key_and_its_example_reads():
    page = folders.page("case-file")
    models = [
        *KINDS["nodes"].values(),
        *KINDS["links"].values(),
        FluidSpec,
        Numerics,
        Output,
        Friction,
        Wall,
    ]
    keys = (
        {key for model in models for key in model.keys()}
        | set(KINDS["nodes"])
        | set(KINDS["links"])
    )
    assert [key for key in sorted(keys) if not re.search(rf"\b{re.escape(key)}\b", page)] == []
    example = tomllib.loads(re.search(r"```toml\n(.*?)```", page, re.DOTALL)[1])
    assert load({**example, "fluid": tomllib.loads(DETAILED)["fluid"]}).links["main"].cells == 100


def test_the_tables_of_the_pages_of_parts_have_every_key():
    """The site makes the pages of docs/parts of these tables; docs/parts/limits.md states its keys itself."""
    every = {
        "nodes": key_table("every node") + key_table("riding"),
        "links": key_table("every link"),
    }
    models = {
        kind: (model, every[group]) for group in KINDS for kind, model in KINDS[group].items()
    }
    models |= {"numerics": (Numerics, ""), "output": (Output, ""), "friction": (Friction, "")}
    models |= {"wall": (Wall, "")}
    for name, (model, shared) in models.items():
        text = shared + key_table(name)
        text += key_table("valve") if "see [valve]" in text else ""
        text += key_table("check-valve") if "see [check valve]" in text else ""
        assert [
            key for key in model.keys() if not re.search(rf"^\|.*`{key}`.*\|", text, re.MULTILINE)
        ] == [], name
    limits = folders.page("parts/limits")
    assert all(f"`{key}`" in limits for key in [*expect_keys("flow"), *COMPARE_KEYS])


def test_the_tables_of_the_pages_of_parts_have_the_defaults():
    said = {
        name: dict(
            re.findall(
                r"^\| `(\w+)` \| .* \| (.*?) \| (?:value|profile|cells|shape) \|",
                key_table(name),
                re.MULTILINE,
            )
        )
        for name in ("case", "numerics", "output", "valve")
    }
    case = load(two_tanks())
    assert [float(said["case"][key]) for key in ("ambient_pressure", "gravity")] == [
        101325.0,
        case.gravity,
    ]
    told, output = said["numerics"], said["output"]
    for key in ("initial", "limiter", "below_vapor"):
        assert told[key] == f'`"{Numerics.model_fields[key].default}"`'
    assert float(told["start"]) == case.numerics.start
    assert told["scheme"] == f"{defaults.DEFAULT_SCHEME} (with cavitation {defaults.CAVITY_SCHEME})"
    with_rtol, with_cavities = (
        f"with rtol {defaults.DEFAULT_METHOD_RTOL}",
        f"with cavitation {defaults.CAVITY_METHOD}",
    )
    in_basins = f"with scalars or friction in basins {defaults.DEFAULT_METHOD_SSP}"
    assert (
        told["method"] == f"{defaults.DEFAULT_METHOD} ({with_rtol}, {with_cavities}, {in_basins})"
    )
    assert told["courant"].startswith(f"{defaults.DEFAULT_COURANT} ")
    assert told["courant"].endswith(f"(with cavitation {defaults.CAVITY_COURANT})")
    assert float(told["rtol"].split()[0]) == case.numerics.rtol
    assert told["cell_time"].endswith(f"/ {defaults.DEFAULT_CELLS}")
    assert (
        output["every"].endswith(f"/ {defaults.DEFAULT_ROWS}")
        and int(output["fields"]) == case.output.fields
    )
    hole = case.links["hole"]
    assert float(said["valve"]["discharge_coefficient"]) == hole.discharge_coefficient
    assert (
        float(said["valve"]["opening"]) == hole.opening.first
        and said["valve"]["characteristic"] == '`"linear"`'
    )


def test_shipped_cases_point_editors_to_the_schema():
    folder = folders.CASES
    # to update: fvsolve schema > cases/schema.json
    assert json.loads((folder / "schema.json").read_text()) == schema()
    for path in folder.glob("*.toml"):
        assert path.read_text(encoding="utf-8").startswith("#:schema schema.json\n"), path.name


def test_reading_a_case_is_light():
    code = (
        "import sys, fvsolve.case as case; case.schema()\n"
        "heavy = {'numba', 'scipy', 'pint', 'CoolProp', 'matplotlib', 'rich', 'pyvista'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_load_takes_a_case_path_or_dict_alone():
    refused(3, "an int is not a case")
    assert isinstance(load(two_tanks()), Case)
