"""A model is read-only, so that several runs share it one after another or at once.

A model with changed keys by `vary` equals to the bit a model from a new reading, without traces of earlier runs.
"""

import copy
import hashlib
import pickle
import subprocess
import sys
import threading
import tomllib

import numpy as np
import pytest
from reference.changed_keys import DYED, LARGE, OTHERS, leaves, others, raw_case, spoken
from reference.changed_keys import NAMES as EVERY
from reference.folders import CASES

import fvsolve
from fvsolve.case.changes import declaration_of
from fvsolve.core.model import Model, RunData
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.core.steppers import loop_records
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.outcome import outcome

NAMES = [name for name in EVERY if name not in LARGE]


@pytest.fixture(autouse=True)
def in_folder_of_cases(monkeypatch):
    monkeypatch.chdir(CASES)


def model_bytes(model) -> dict[str, bytes]:
    """Contents of a model as bytes."""
    tables = {
        name: table.tobytes()
        for name, table in zip(model.tables._fields, model.tables, strict=True)
    }
    for own in model.features:
        found = {name: value for name, value in vars(own).items() if isinstance(value, np.ndarray)}
        tables |= {f"{own.slot}.{name}": value.tobytes() for name, value in found.items()}
    with model.run_data() as data:
        for slot, own in enumerate(data.feature_tables()):
            found = own._asdict() if own else {}
            tables |= {f"table {slot}.{name}": table.tobytes() for name, table in found.items()}
    arrays = {
        "scale": model.scale,
        "start": model.start,
        "profiles": np.concatenate([[0.0], *model.profiles.values()]),
    }
    words = (
        model.breaks,
        model.step_max,
        model.shapes,
        model.state_names,
        model.node_names,
        model.link_names,
        model.events,
        model.laws,
        model.elevation,
        [probe.text for probe in model.probes],
        model.steady,
        [one.plain() for one in model.warnings],
        model.case.table(),
        model.case.copies,
    )
    numbers = {name: array.tobytes() for name, array in arrays.items()}
    return tables | numbers | {"words": pickle.dumps(repr(words))}


def outcome_of(make) -> tuple:
    """Outcome of making a model: its contents, or its faults line by line."""
    try:
        return "made", model_bytes(make())
    except CaseError as error:
        return "faults", [str(fault) for fault in error.faults]
    except FvsolveError as error:
        return "refused", str(error)


def settings(table: dict, keys: tuple, to) -> dict:
    """Override of a single key, or of the whole list that contains it."""
    words = tuple(key for key in keys if isinstance(key, str))
    if words == keys:
        return {spoken(keys): to}
    at = next(k for k, key in enumerate(keys) if not isinstance(key, str))
    found = table
    for key in keys[:at]:
        found = found[key]
    found = copy.deepcopy(found)
    inner = found
    for key in keys[at:-1]:
        inner = inner[key]
    inner[keys[-1]] = to
    return {spoken(keys[:at]): found}


def compare(name: str, table: dict, done: set, every: bool, turn: int = 0) -> list[str]:
    """Overrides for which `vary` differs from a new reading.

    One key of each kind is tested: of all cases together, or of each case with `every`.
    turn : with `every`, number that selects a twelfth of the kinds of keys
    """
    model, wrong = fvsolve.build(fvsolve.load(table)), []
    for keys, _ in leaves(table):
        value = declaration_of(table, tuple(key for key in keys if isinstance(key, str)))
        kind = (name if every else "", str(type(value)), getattr(value, "about", ""), keys[-1])
        if kind in done:
            continue
        done.add(kind)
        if every and (len(done) + turn) % 12:
            continue
        for to in others(table, keys, value, far=True)[:1]:
            given = settings(table, keys, to)
            anew = outcome_of(lambda given=given: fvsolve.build(fvsolve.load(table, given)))
            if outcome_of(lambda given=given: fvsolve.vary(model, given)) != anew:
                wrong.append(f"{name}: {given}")
    return wrong


def test_each_kind_of_key_of_the_shipped_cases_gives_the_model_of_a_fresh_reading():
    """The case load-sensing starts at rest, because its steady start takes 0.2 s; the test below varies that start."""
    done: set = set()
    tables = {name: raw_case(name) for name in NAMES}
    tables["load-sensing"]["numerics"]["initial"] = "rest"
    assert [line for name in NAMES for line in compare(name, tables[name], done, every=False)] == []
    assert [
        line for table in (OTHERS, DYED) for line in compare("others", table, done, every=False)
    ] == []
    assert len(done) > 150


@pytest.mark.parametrize("turn, name", list(enumerate(NAMES)), ids=NAMES)
def test_every_key_of_every_shipped_case_gives_the_model_of_a_fresh_reading(turn, name):
    """A twelfth of the kinds of keys of each case, in rotation, gives the model of a new reading."""
    assert compare(name, raw_case(name), set(), every=True, turn=turn) == []


SMALL = {"links.main.cells": 12, "numerics.end": 2.0, "output.fields": 0, "expect": {}}
MOVES = [
    {"links.valve.area": 0.001},
    {"links.valve.opening.duration": 0.3},
    {"nodes.lake.head": "30 m"},
    {"links.main.cells": 7},
    {"numerics.method": "rk4", "numerics.courant": 0.5},
    {"ambient_pressure": "0.9 atm"},
    {"links.main.friction": {"model": "none"}, "links.main.initial_flow": 0.02},
    {"fluid.temperature": 300.0},
    {"output.probes": ["gate.pressure"]},
]


def test_consecutive_runs_leave_nothing_to_each_other():
    """A sequence of variants gives runs equal to the bit to new runs: rows and summaries except times."""
    model = fvsolve.build(fvsolve.load("valve-closure", SMALL))
    before = model_bytes(model)
    for move in (*MOVES, *reversed(MOVES)):
        ours, fresh = (
            fvsolve.run(fvsolve.vary(model, move)),
            fvsolve.run("valve-closure", SMALL | move),
        )
        assert ours._table.tobytes() == fresh._table.tobytes(), move
        for key, value in fresh.summary.items():
            if key not in ("ended", "seconds", "seconds_setup", "cost"):
                assert repr(ours.summary[key]) == repr(value), (move, key)
    assert model_bytes(model) == before


def test_a_model_follows_from_a_model_that_was_varied_itself():
    model = fvsolve.build(fvsolve.load("valve-closure", SMALL))
    twice = fvsolve.vary(
        fvsolve.vary(model, {"links.valve.area": 0.001}), {"nodes.lake.head": 30.0}
    )
    once = fvsolve.build(
        fvsolve.load("valve-closure", SMALL | {"links.valve.area": 0.001, "nodes.lake.head": 30.0})
    )
    assert model_bytes(twice) == model_bytes(once)


def test_variants_of_a_model_with_unsteady_friction_do_not_share_its_states():
    more = SMALL | {"links.main.friction": {"model": "unsteady", "roughness": "0.26 mm"}}
    model = fvsolve.build(fvsolve.load("valve-closure", more))
    before = model_bytes(model)
    for area in (0.001, 0.0012):
        for key in ("links.valve.area", "links.valve.laminar_reynolds"):
            fresh = fvsolve.build(fvsolve.load("valve-closure", more | {key: area}))
            assert model_bytes(fvsolve.vary(model, {key: area})) == model_bytes(fresh), (key, area)
    assert model_bytes(model) == before


def test_sizes_of_restrictions_are_written_into_the_tables_that_were_there(monkeypatch):
    """`vary` writes new sizes of restrictions into copied tables, and builds new tables for other changes."""
    table = raw_case("valve-closure")
    table["nodes"]["sump"] = {"type": "reservoir", "pressure": "0 barg"}
    table["links"]["hole"] = {"type": "orifice", "from": "gate", "to": "sump", "diameter": "1 mm"}
    table["links"]["bleed"] = {"type": "orifice", "from": "lake", "to": "sump", "diameter": "2 mm"}
    model, room = fvsolve.build(fvsolve.load(table, SMALL)), sys.modules["fvsolve.core.model.build"]
    before, found = model_bytes(model), []
    taken = room.with_new_sizes
    monkeypatch.setattr(
        room, "with_new_sizes", lambda *given: found.append(taken(*given)) or found[-1]
    )
    for move, in_place in (
        ({"links.valve.area": 0.001}, True),
        ({"links.hole.diameter": "3 mm", "links.bleed.discharge_coefficient": 0.7}, True),
        (
            {
                "links.bleed.diameter": 1e-3,
                "links.valve.area": 2e-3,
                "links.valve.discharge_coefficient": 0.5,
            },
            True,
        ),
        ({"links.valve.laminar_reynolds": 100.0}, False),
        ({"links.valve.opening.duration": 0.3}, False),
        ({"links.hole.diameter": "3 mm", "nodes.lake.head": 30.0}, False),
    ):
        ours = fvsolve.vary(model, move)
        assert model_bytes(ours) == model_bytes(fvsolve.build(fvsolve.load(table, SMALL | move))), (
            move
        )
        assert (found[-1] is not None) == in_place, move
        assert model_bytes(model) == before, move


def test_contents_of_files_and_signals_are_read_again(tmp_path):
    """`vary` reads files and signals again, because a file may have changed since the model was built."""
    closing = tmp_path / "closing.csv"
    closing.write_text("t [s],opening [-]\n0,1\n1,1\n1.5,0\n")
    table = raw_case("valve-closure")
    table["links"]["valve"]["opening"] = {"file": str(closing)}
    model = fvsolve.build(fvsolve.load(table, SMALL))
    closing.write_text("t [s],opening [-]\n0,1\n1,1\n1.2,0\n")
    moved = SMALL | {"nodes.lake.head": 30.0}
    assert model_bytes(fvsolve.vary(model, {"nodes.lake.head": 30.0})) == model_bytes(
        fvsolve.build(fvsolve.load(table, moved))
    )
    driven = fvsolve.build(fvsolve.load("rigid-column"))
    for move in ({"signals.stroke.value": [1.0, 0.5]}, {"nodes.lake.head": 30.0}):
        assert outcome_of(lambda move=move: fvsolve.vary(driven, move)) == outcome_of(
            lambda move=move: fvsolve.build(fvsolve.load("rigid-column", move))
        )


def test_faults_are_those_of_a_fresh_run():
    model = fvsolve.build(fvsolve.load("valve-closure", SMALL))
    for move in (
        {"links.valve.area": -1.0},
        {"links.valve.aera": 1.0},
        {"links.valv.area": 1.0},
        {"links.main.cells": 2.5},
        {"links.main.cells": True},
        {"numerics.end": -1.0, "links.main.length": "3 kg"},
        {"output.probes": ["x.y"]},
        {"links.main.friction": {"model": "rough"}},
        {"links.main.initial_flow": "1 m"},
        {"expect": {"max(x.y)": {"value": 1}}},
    ):
        fresh = outcome_of(
            lambda move=move: fvsolve.build(fvsolve.load("valve-closure", SMALL | move))
        )
        assert (
            fresh[0] != "made" and outcome_of(lambda move=move: fvsolve.vary(model, move)) == fresh
        )


def test_arguments_that_are_no_model_and_no_table_are_named():
    with pytest.raises(FvsolveError, match="model = .*; expected a Model"):
        fvsolve.vary(fvsolve.load("valve-closure"), {"links.valve.area": 1.0})
    with pytest.raises(FvsolveError, match="expected a dict, for example"):
        fvsolve.vary(fvsolve.build(fvsolve.load("valve-closure", SMALL)), ["links.valve.area"])


# pipes; flags and marks of devices; cells and work arrays of a basin; scalars; Newton's method
SCENES = {
    "nine pipes": ("streeter-nine-pipes", {"numerics.end": 5.0}),
    "nine pipes, log": ("streeter-nine-pipes", {"numerics.end": 0.5, "fluid.law": "log"}),
    "check valve": ("check-valve-slam", {}),
    "relief valve": ("relief-on-closed-main", {}),
    "pump with its vessel": ("pump-trip-air-vessel", {}),
    "basin": ("dam-break", {}),
    "tracer in a basin": ("tracer-basin", {"numerics.end": 20.0}),
    "cylinder": ("cylinder-servo", {"numerics.end": 0.1}),
}


def built(scene: str) -> Model:
    name, set = SCENES[scene]
    case = tomllib.loads((CASES / f"{name}.toml").read_text(encoding="utf-8"))
    case = {key: part for key, part in case.items() if key not in ("expect", "compare")}
    return fvsolve.build(fvsolve.load(case, {"output.fields": 0, "output.lines": {}, **set}))


def bits(model: Model) -> str:
    """Hash of the bytes of all arrays of a model, including the structure of its Jacobian."""
    arrays = (
        *model.tables,
        model.scale,
        model.start,
        *model.profiles.values(),
        model.structure.shape,
    )
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def written(run) -> list[np.ndarray]:
    """Rows, final state, event flags, marks, envelopes and extremes of a run."""
    slate = run.run_data
    return [run.rows, run.y, slate.armed, slate.marks, slate.envelope, slate.extremes]


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("scene", SCENES)
def test_a_run_leaves_its_model_as_it_was(scene):
    """A run does not change a byte of its model, and a second run gives equal results."""
    model = built(scene)
    before = bits(model)
    first = written(outcome(model))
    rates = model.rhs(model.case.numerics.start, model.start)
    assert bits(model) == before
    assert same(written(outcome(model)), first)
    assert np.array_equal(model.rhs(model.case.numerics.start, model.start), rates)


def test_a_model_is_read_only():
    model = built("check valve")
    for array in (*model.tables, model.scale, model.start, *model.profiles.values()):
        assert not array.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        model.tables.nodes["pressure"] = 0.0


@pytest.mark.parametrize("scene", SCENES)
def test_simultaneous_runs_of_a_model_are_the_separate_runs(scene):
    """Three threads with one model, one from another state, give the results of single runs."""
    model = built(scene)
    moved = model.start + 1e-3 * model.scale
    alone = [written(outcome(model)), written(outcome(model, y=moved))]
    starts, found, together = [None, moved, None], {}, threading.Barrier(3)

    def run(k: int) -> None:
        together.wait()
        found[k] = written(outcome(model, y=starts[k]))

    threads = [threading.Thread(target=run, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert same(found[0], alone[0]) and same(found[2], alone[0]) and same(found[1], alone[1])
    assert not same(alone[0], alone[1])


@pytest.mark.parametrize("scene", SCENES)
def test_interleaved_runs_of_a_model_are_the_separate_runs(scene):
    """Two runs of one model with alternating steps give the states of single runs."""
    model, states = built(scene), []
    moved = model.start + 1e-3 * model.scale
    for loops in (
        [begun(model, model.start)],
        [begun(model, moved)],
        [begun(model, y) for y in (model.start, moved)],
    ):
        for _ in range(60):
            for loop in loops:
                assert loop.run(1.0) == loop_records.BUDGET_SPENT
        states += [loop.now.copy() for loop in loops]
    assert np.array_equal(states[0], states[2]) and np.array_equal(states[1], states[3])
    assert not np.array_equal(states[0], states[1])


def begun(model: Model, y: np.ndarray) -> RunLoop:
    """Time loop from a state at the start time, before its first step."""
    loop = RunLoop(model)
    loop.now[:] = y
    loop.state["t"] = model.case.numerics.start
    loop.begin(model.case.numerics.end, NO_LIMIT)
    return loop


def test_threads_that_request_compiled_code_at_once_get_it():
    """Two threads of a new process compile at once and give equal results."""
    code = """
import sys, threading, fvsolve
together, found = threading.Barrier(2), {}
def run(k):
    together.wait()
    found[k] = fvsolve.run(sys.argv[1], {"numerics.method": "esdirk-4", "output.fields": 0}).extremes
threads = [threading.Thread(target=run, args=(k,)) for k in range(2)]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert found[0] == found[1]
"""
    subprocess.run([sys.executable, "-c", code, str(CASES / "check-valve-slam.toml")], check=True)


def test_run_data_of_a_model_share_no_array_that_is_written():
    model = built("tracer in a basin")
    one, other = RunData(model), RunData(model)
    assert not any(np.shares_memory(a, b) for a, b in zip(one.written, other.written, strict=True))
