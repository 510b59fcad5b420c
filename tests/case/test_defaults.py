"""[defaults.pipe]: values for pipes that do not state a key; a fault is reported once, at its place in the file."""

import pytest
from reference.refusals import refused
from reference.scenes import junction, lake, scene

from fvsolve import load
from fvsolve.case.changes import changes
from fvsolve.case.schema import schema
from fvsolve.studies import sweep

TEXT = """
[fluid]
name = "Water"
[defaults.pipe]
diameter = "300 mm"
wall = { youngs_modulus = "170 GPa", thickness = "7 mm" }
friction = { model = "steady", factor = 0.02 }
cells = 30
[nodes.lake]
type = "reservoir"
head = 50
[nodes.mid]
type = "junction"
[nodes.end]
type = "junction"
demand = "10 l/s"
[links.one]
type = "pipe"
from = "lake"
to = "mid"
length = 1000
[links.two]
type = "pipe"
from = "mid"
to = "end"
length = 500
wave_speed = 900
cells = 10
[numerics]
end = 1
"""


@pytest.fixture
def file(tmp_path):
    def written(*changed):
        text = TEXT
        for old, new in changed:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "defaults.toml"
        path.write_text(text)
        return path

    return written


def spelled_out():
    common = {"type": "pipe", "diameter": 0.3, "friction": {"model": "steady", "factor": 0.02}}
    one = {
        "from": "lake",
        "to": "mid",
        "length": 1000,
        "cells": 30,
        "wall": {"youngs_modulus": 170e9, "thickness": 7e-3},
    }
    two = {"from": "mid", "to": "end", "length": 500, "cells": 10, "wave_speed": 900}
    return {"one": common | one, "two": common | two}


def test_defaults_equal_keys_in_every_pipe(file):
    case = load(file())
    nodes = {"lake": lake(50), "mid": junction(), "end": junction(0.01)}
    other = load(scene(nodes, spelled_out(), 1.0, {}, gravity=9.80665, ambient_pressure=101325.0))
    assert case.links == other.links
    assert "defaults" not in case.table() and load(case.table()).links == case.links


def test_a_pipe_s_own_key_wins_and_so_does_its_alternative(file):
    pipes = load(file()).links
    assert pipes["two"].cells == 10 and pipes["one"].cells == 30
    assert (
        pipes["two"].wave_speed == 900
        and pipes["two"].wall is None
        and pipes["one"].wall.thickness == 7e-3
    )
    own = load(file(("length = 500", "length = 500\nnominal = 'DN100'"))).links["two"]
    assert own.diameter == pytest.approx(0.10226)


def test_settings_and_sweeps_reach_them(file):
    case = load(file())
    assert [one.cells for one in load(case, {"defaults.pipe.cells": 7}).links.values()] == [7, 10]
    assert [one.cells for one in load(file(), {"defaults.pipe.cells": 7}).links.values()] == [7, 10]
    moved = load(case, {"links.two.length": 600})
    assert moved.links["two"].length == 600 and moved.links["one"] == case.links["one"]
    stiff = load(case, {"defaults.pipe.wave_speed": 1000}).links["one"]
    # a setting replaces its alternative in the defaults
    assert stiff.wave_speed == 1000 and stiff.wall is None
    assert load(case, {"links.one.wave_speed": 1100}).links["one"].wall is None
    assert (
        changes(case, "defaults.pipe.cells") == "shape"
        and changes(case, "defaults.pipe.friction.factor") == "profile"
    )
    rows = sweep(file(), {"defaults.pipe.cells": [40, 60]}).rows
    assert [row["ok"] for row in rows] == [True, True] and rows[0]["steps"] < rows[1]["steps"]


@pytest.mark.parametrize(("changed", "place", "said"), [
    (("cells = 30", "cels = 30"), "defaults.pipe.cels", 'unknown key; did you mean "cells"?'),
    (("cells = 30", "cells = -1"), "defaults.pipe.cells", "out of range"),
    (("cells = 30", "from = 'lake'"), "defaults.pipe.from", "each pipe states its own"),
    (("cells = 30", "type = 'pipe'"), "defaults.pipe.type", "each pipe states its own"),
    (("7 mm", "7 kg"), "defaults.pipe.wall.thickness", "is a mass; expected a length"),
    (("factor = 0.02", "factr = 0.02"), "defaults.pipe.friction.factr", "unknown key"),
    (("wall = {", "wave_speed = 900\nwall = {"), "defaults.pipe.wall", "wave_speed and wall are given; keep one"),
    (("[defaults.pipe]", "[defaults.pip]"), "defaults.pip", '"pip" is not a type of part; did you mean "pipe"?'),
])  # fmt: skip
def test_a_fault_is_named_where_it_stands_and_once(file, changed, place, said):
    error = refused(file(changed))
    found = [one for one in error.faults if one.place == place and said in one.message]
    assert len(found) == 1, error
    line = 1 + TEXT[: TEXT.index(changed[0])].count("\n") + changed[1].count("\n")
    assert found[0].line == line
    assert [
        one for one in error.faults if one.place.startswith("links.") and said in one.message
    ] == []


def test_the_schema_knows_them():
    found = schema()["properties"]["defaults"]["properties"]["pipe"]
    assert (
        "cells" in found["properties"]
        and "from" not in found["properties"]
        and "required" not in found
    )


def test_pieces_of_a_pipe_that_is_cut_have_them_once(file):
    """A loss in the defaults is shared among the pieces, not given to each of them."""
    placed = (
        '[nodes.end]\ntype = "junction"\n[nodes.gauge]\ntype = "junction"\non = "one"\nat = "400 m"'
    )
    case = load(
        file(
            ('[nodes.end]\ntype = "junction"', placed),
            ("cells = 30", "cells = 30\nminor_loss = 2.0"),
        )
    )
    pieces = [case.links["one-1"], case.links["one-2"]]
    assert [one.cells for one in pieces] == [12, 18] and sum(
        one.minor_loss for one in pieces
    ) == pytest.approx(2.0)
    assert all(one.wall.thickness == 7e-3 for one in pieces)
    error = refused(file(('[nodes.end]\ntype = "junction"', placed), ("7 mm", "7 kg")))
    assert [one.place for one in error.faults] == ["defaults.pipe.wall.thickness"]
