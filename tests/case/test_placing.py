"""Placed parts have the positions of a pipe that is cut by hand."""

import numpy as np
import pytest
from reference.placed_parts import CELLS, GATE, HILL, HOLE, LENGTH, SAFE, VENT, line, main, placed
from reference.refusals import refused
from reference.scenes import junction, valve

import fvsolve
from fvsolve.case.changes import changes
from fvsolve.studies import sweep


def part(start: str, end: str, low: float, high: float) -> dict:
    """Piece of the pipe between two chainages, as written by hand."""
    inner = [x for x in HILL["chainage"] if low < x < high]
    z = np.interp([low, *inner, high], HILL["chainage"], HILL["elevation"]).tolist()
    share = (high - low) / LENGTH
    return main(
        length=high - low,
        cells=round(CELLS * share),
        minor_loss=3.0 * share,
        profile={"chainage": [low, *inner, high], "elevation": z},
    ) | {"from": start, "to": end}


def divided_pipe() -> dict:
    cuts = [1000.0, 1500.0, 2200.0, 2950.0, 3500.0, 4000.0]
    names = [("lake", "a"), ("b", "top"), ("top", "c"), ("c", "d"), ("d", "gate")]
    pipes = {f"p{k}": part(*names[k], cuts[k], cuts[k + 1]) for k in range(5)}
    z = dict(
        zip(
            "abcd",
            np.interp([1500.0, 1500.0, 2950.0, 3500.0], HILL["chainage"], HILL["elevation"]),
            strict=True,
        )
    )
    nodes = {name: junction(elevation=float(one)) for name, one in z.items()} | {
        "top": VENT | {"elevation": 65.0}
    }
    links = pipes | {
        "half": GATE | {"from": "a", "to": "b"},
        "hole": HOLE | {"from": "c"},
        "safe": SAFE | {"from": "d"},
    }
    return line(nodes, links)


def test_the_pipe_equals_a_pipe_divided_manually() -> None:
    one, other = fvsolve.run(placed()), fvsolve.run(divided_pipe())
    for probe in one.probes:
        assert np.allclose(one[probe], other[probe], rtol=1e-10), probe
    assert [leg for leg in one.routes] == ["main"]
    assert np.all(np.diff(one.routes["main"]["chainage"]) >= 0.0)
    assert one.routes["main"]["chainage"][[0, -1]] == pytest.approx([1000.0, 4000.0])


def test_drawn_the_other_way_it_is_the_same() -> None:
    one, other = fvsolve.run(placed()), fvsolve.run(placed(turned=True))
    assert np.allclose(one["gate.pressure"], other["gate.pressure"], rtol=1e-9)


def test_the_resolved_case_is_the_same_case(tmp_path) -> None:
    case = fvsolve.load(placed(limits={"top": {"on": "main", "maximum": "20 bar"}}))
    again = fvsolve.load(case.table())
    assert again == case
    one, other = fvsolve.run(case), fvsolve.run(again)
    assert np.array_equal(one["gate.pressure"], other["gate.pressure"])
    assert one.verdicts[0][:10] == other.verdicts[0][:10] and one.verdicts[0].chainage > 1000.0


def test_keys_of_the_whole_and_of_its_pieces_can_be_set() -> None:
    case = fvsolve.load(placed())
    wide = fvsolve.load(case, {"links.main.diameter": 0.5, "links.main-2.cells": 30})
    assert [wide.links[f"main-{k}"].diameter for k in range(1, 6)] == [0.5] * 5
    assert (wide.links["main-2"].cells, wide.links["main-1"].cells) == (30, 10)
    again = fvsolve.load(wide, {"links.hole.at": "2.8 km"})
    assert again.links["main-2"].cells == 30 and again.links["main-4"].length == pytest.approx(
        700.0
    )
    assert (
        changes(case, "links.main-2.diameter") == changes(case, "links.main.diameter") == "profile"
    )
    assert (
        changes(case, "links.main.length")
        == changes(case, "links.hole.at")
        == changes(case, "nodes.top.at")
        == "shape"
    )
    found = sweep(placed(), {"links.main.diameter": [0.4, 0.5]}, set={"numerics.end": 0.5})
    assert [row["ok"] for row in found.rows] == [True, True]


# not at faces of the whole pipe
STANDS = {"half": 1003.0, "top": 1020.0, "hole": 2951.0, "safe": 3997.5}
RESTATED = {
    "as it is": {},
    "by cell_time": {"cells": None},
    "no profile": {"profile": None},
    "a delay line": {"pipe_model": "delay-line"},
    "a few cells": {"cells": 3},
}


@pytest.mark.parametrize("unit", ["m", "km", "ft"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("change", RESTATED.values(), ids=RESTATED)
def test_every_part_stands_where_it_was_put(change: dict, turned: bool, unit: str) -> None:
    """Each piece has the length between its parts, for any direction, unit and number of cells."""
    case = placed(turned)
    main = case["links"]["main"] = {
        key: one for key, one in (case["links"]["main"] | change).items() if one is not None
    }
    case["numerics"]["cell_time"] = 0.05
    begin, per = 1000.0 if "profile" in main else 0.0, {"m": 1.0, "km": 1e3, "ft": 0.3048}[unit]
    for name, at in STANDS.items():
        along = at - 1000.0
        along = begin + (LENGTH - along if turned else along)
        case["nodes" if name == "top" else "links"][name]["at"] = f"{along / per:.12g} {unit}"
    if "profile" not in main:
        for node in case["nodes"].values():
            node.pop("elevation", None)
    made = fvsolve.load(case)
    found = [made.links[f"main-{k}"] for k in range(1, 6)][:: -1 if turned else 1]
    assert [one.length for one in found] == pytest.approx(
        [3.0, 17.0, 1931.0, 1046.5, 2.5], abs=1e-6
    )
    size = LENGTH / main.get("cells", LENGTH / 50.0)
    assert [one.cells for one in found] == [max(1, int(one.length / size + 0.5)) for one in found]
    assert not [note for note in made.notices if note.key == "at"]


def test_steps_are_hardly_shorter_where_parts_stand_between_cells() -> None:
    """Pieces longer than a few cells have cells of nearly the given size."""
    near = placed()
    near["links"]["half"]["at"], near["links"]["hole"]["at"], near["links"]["safe"]["at"] = (
        1523.0,
        2951.0,
        3489.0,
    )
    found = [link for link in fvsolve.load(near).links.values() if link.kind == "pipe"]
    assert min(one.length / one.cells for one in found) > 0.93 * LENGTH / CELLS
    assert sum(one.cells for one in found) == pytest.approx(CELLS, abs=2)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_junction_that_gives_nothing_changes_nothing(law: str) -> None:
    plain = line({}, {"main": main()})
    cut = line({"spot": {"type": "junction", "on": "main", "at": 2500.0}}, {"main": main()})
    for case in (plain, cut):
        case["fluid"]["law"] = law
        case["numerics"] |= {"scheme": "upwind", "step": 0.01}
    one, other = fvsolve.run(plain), fvsolve.run(cut)
    off = np.max(np.abs(one["gate.pressure"] - other["gate.pressure"])) / np.ptp(
        one["gate.pressure"]
    )
    assert off <= (1e-12 if law == "linear" else 1e-5)


def test_without_a_profile_it_lies_on_the_straight_line() -> None:
    said = main()
    del said["profile"]
    case = fvsolve.load(
        line({"spot": {"type": "junction", "on": "main", "at": "750 m"}}, {"main": said})
    )
    assert case.nodes["spot"].elevation == pytest.approx(27.5)
    flat = line({"spot": {"type": "junction", "on": "main", "at": "750 m"}}, {"main": said})
    for node in flat["nodes"].values():
        node.pop("elevation", None)
    assert fvsolve.load(flat).nodes["spot"].elevation is None


def test_probes_count_along_the_whole_pipe() -> None:
    probes = [
        "main.pressure@0.5",
        "main.pressure@2500 m",
        "main.flow",
        "main-3.head@2.3 km",
        "main.velocity@1",
    ]
    found = fvsolve.run(placed(output={"probes": probes, "every": 0.1}))
    assert np.array_equal(found["main.pressure@0.5"], found["main.pressure@2500 m"])
    whole = fvsolve.run(
        line({}, {"main": main()}, output={"probes": probes[:2] + ["main.flow@1 km"], "every": 0.1})
    )
    assert np.array_equal(whole["main.pressure@0.5"], whole["main.pressure@2500 m"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("half", "at", "900 m"), "links.half.at: \"900 m\" is outside: main runs from 1000 m to 4000 m"),
        (("half", "at", 1000), "links.half.at: 1000 is the end of main at lake; expected a chainage between its ends"),
        (("half", "at", 4000), "links.half.at: 4000 is the end of main at gate; expected a chainage between its ends"),
        (("half", "at", "3 kg"), "is a mass; expected a length"),
        (("half", "on", "mian"), 'links.half.on: no pipe named "mian"; did you mean "main"?'),
        (("half", "on", None), "links.half: `at` is 1500.0, but `on` is missing"),
        (("half", "at", None), "links.half: `at` is missing; expected the chainage along main"),
        (("half", "from", "lake"), "links.half.from: `on` and `at` place this link on a pipe, where it starts"),
        (
            ("hole", "at", 1500.0),
            "links.half.at: hole has the same place; place a junction there and join hole and half to it, or change",
        ),
        (("hole", "at", 2200.0), "hole.at: top has the same place; join hole to top, or change `at`"),
        (("main", "diameter", -1.0), "links.main.diameter: -1.0 is out of range"),
        (("main", "friction", {"model": "steady"}), "links.main.friction"),
    ],
)  # fmt: skip
def test_each_fault_is_named_once(change, told: str) -> None:
    case = placed()
    name, key, value = change
    case["links"][name][key] = value
    if value is None:
        del case["links"][name][key]
    error = refused(case)
    assert told in str(error)
    assert len(error.faults) == 1


def test_two_nodes_at_a_place_become_a_single_node() -> None:
    nodes = {name: {"type": "junction", "on": "main", "at": 2500.0} for name in ("spot", "stop")}
    refused(
        line(nodes, {"main": main()}),
        "spot has the same place; leave out spot or stop, or change `at`",
    )


@pytest.mark.parametrize("cells", [7, 8])
def test_a_part_in_the_middle_of_a_cell_goes_to_the_same_face_from_either_end(cells: int) -> None:
    said = {key: one for key, one in main(cells=cells).items() if key != "profile"}
    for k in range(cells):
        at = (k + 0.5) * LENGTH / cells
        if abs(at - 0.5 * LENGTH) < 1.0:  # both faces are equally near
            continue
        lengths = []
        for turned in (False, True):
            one = said | ({"from": "gate", "to": "lake"} if turned else {})
            spot = {"type": "junction", "on": "main", "at": LENGTH - at if turned else at}
            found = fvsolve.load(line({"spot": spot}, {"main": one})).links
            lengths.append(
                [found[name].length for name in ("main-1", "main-2")][:: -1 if turned else 1]
            )
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-12), k


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda case: case["links"].update({"main-2": valve("gate", "sea", 1e-4)}), "main-2"),
        (lambda case: case["nodes"].update({"hole-at": junction(elevation=20.0)}), "hole joins main at a new node"),
        (
            lambda case: case.update(routes={"main": {"pipes": ["main"]}}),
            "main is cut at the parts and bends on it, and the pieces form a route of that name",
        ),
        (lambda case: case["links"]["main"].update(pieces={"main-9": {"cells": 3}}), "main has no piece of that name"),
        (lambda case: case["links"]["main"].update(pieces=3), "3 is not a table; expected a table"),
        (lambda case: case["links"]["hole"].update(type="laek"), 'unknown type "laek"'),
    ],
)  # fmt: skip
def test_names_are_given_once_and_pieces_are_there(change, told: str) -> None:
    case = placed()
    change(case)
    assert told in str(refused(case))


def test_parts_that_cannot_be_on_a_pipe_are_named() -> None:
    case = line({"m": {"type": "mass", "mass": 1.0, "on": "main", "at": 2000.0}}, {"main": main()})
    refused(case, "a mass cannot be placed on a pipe")
    case = line({}, {"main": main(), "second": main() | {"on": "main", "at": 2000.0}})
    refused(case, "a pipe has a length")
