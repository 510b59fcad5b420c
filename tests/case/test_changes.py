"""Each kind of key changes no more of a model than its class states, in up to two shipped cases."""

import copy
from collections import Counter
from functools import cache, partial

import pytest
from reference.changed_keys import DYED, LARGE, NAMES, OTHERS, leaves, others, raw_case, spoken
from reference.folders import CASES
from reference.scenes import pipe, reservoir, scene

import fvsolve
from fvsolve.case.changes import CLASSES, changes, declaration_of
from fvsolve.errors import FvsolveError
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.parts.network_elements import network_of
from fvsolve.parts.value import SHAPE

# keys of class `shape` that do not change the shape of the shipped case; a separate test shows that they can
ALIKE = {"loss_in", "loss_out", "time_constant"}


def moved(table: dict, keys: tuple, to) -> dict:
    table = copy.deepcopy(table)
    inner = table
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = to
    return table


def form(model) -> tuple:
    """Sizes, names and integers of a model."""
    motion = motion_of(model)
    all_tables = model.tables._asdict()
    with model.run_data() as data:
        for own in filter(None, data.feature_tables()):
            all_tables |= own._asdict()
    tables = {
        name: (table.shape, *(table[column].tobytes() for column in whole_columns(table)))
        for name, table in all_tables.items()
    }
    tables["integers"] = model.tables.integers.tobytes()
    if (network := network_of(model)) is not None:
        tables["network"] = network.arrays(network.conducting)[0].tobytes()
    names = (
        model.state_names,
        model.node_names,
        model.link_names,
        model.valve_names,
        model.column_names,
        () if motion is None else (motion.piston_names, motion.mass_names),
        model.events,
        [probe.text for probe in model.probes],
    )
    return tables, names, model.shapes


def whole_columns(table) -> list[str]:
    return [name for name in table.dtype.names or () if table.dtype[name].kind in "iub"]


def start(model) -> list[bytes]:
    """Start of a run as bytes: states, and pressures and flows of the starting profile."""
    tables = model.tables
    flows = [table["flow"].tobytes() for table in (tables.pipes, tables.columns, tables.valves)]
    profile = [profile.tobytes() for _, profile in sorted(model.profiles.items())]
    flows += [] if network_of(model) is None else [network_of(model).values.tobytes()]
    return [model.start.tobytes(), tables.nodes["pressure"].tobytes(), *flows, *profile]


def observed_class(before, after) -> str:
    if form(before) != form(after):
        return "shape"
    return "value" if start(before) == start(after) else "profile"


class Trial:
    """Trial of changed keys in cases: wrong classes, and for each key of class `shape` if it changed the shape."""

    def __init__(self, every: bool) -> None:
        # every : a ninth of the kinds of keys in two cases, others in one; in large cases only kinds of no other case.
        # Each key then gets one value, which is far from the given one if the case allows it. Keys of class `shape`
        # are left out, because no change is more than theirs.
        self.every, self.wrong, self.done = every, [], set()
        self.cases: Counter = Counter()  # number of cases for each kind of key
        self.told: dict[int, bool] = {}
        self.names: dict[int, str] = {}
        self.of_signals: dict[tuple, object] = {}  # declarations of signals are new for each signal
        self.values: list = []  # keeps objects alive, so that their ids stay unique

    def case(self, name: str, given: dict | None = None) -> None:
        table = given or raw_case(name)
        case = fvsolve.load(table)
        before, often = fvsolve.build(case), Counter()
        declaration = cache(partial(declaration_of, table))
        for keys, _ in leaves(table):
            words = tuple(key for key in keys if isinstance(key, str))
            declared = declaration(words)
            value = (
                self.of_signals.setdefault(words[2:], declared)
                if words[0] == "signals"
                else declared
            )
            self.values.append(value)
            often[id(value)] += 1
            several = (
                self.every
                and name not in LARGE
                and often[id(value)] == 1
                and self.cases[id(value)] < 2
            )
            several = several and len(self.done) % 9 == 0
            new = name not in LARGE or not self.cases[id(value)]
            if several or (id(value) not in self.done and new):
                self.cases[id(value)] += 1
                self.key(name, table, before, changes(case, spoken(words)), keys, value)

    def key(self, name: str, table: dict, before, said: str, keys: tuple, value) -> None:
        values = others(table, keys, value, self.every)
        for to in (
            () if self.every and said == SHAPE else reversed(values) if self.every else values
        ):
            try:
                found = observed_class(before, fvsolve.build(fvsolve.load(moved(table, keys, to))))
            except FvsolveError:
                continue
            place = f"{name}: {spoken(keys)}"
            if CLASSES.index(found) > CLASSES.index(said):
                self.wrong.append(f"{place} = {to} changes the {found}, not only the {said}")
            self.names[id(value)] = place
            if value.changes == SHAPE:
                self.told[id(value)] = self.told.get(id(value), False) or found == "shape"
            if value.changes != SHAPE or found == "shape":
                self.done.add(id(value))
                if self.every or found == "shape":
                    return

    def never(self) -> list[str]:
        """Keys of class `shape` that never changed the shape."""
        return [self.names[key] for key, told in self.told.items() if not told]


@pytest.fixture(autouse=True)
def in_folder_of_cases(monkeypatch):
    monkeypatch.chdir(CASES)


def test_a_key_changes_no_more_than_declared_and_each_key_of_shape_does():
    """Each kind of key in one case; a test below takes two cases."""
    trial = Trial(every=False)
    for name in NAMES:
        if name not in LARGE:
            trial.case(name)
    assert trial.wrong == []
    assert {place.split(".")[-1] for place in trial.never()} <= ALIKE
    assert len(trial.names) > 100


def test_keys_of_no_shipped_case_change_no_more_than_declared():
    trial = Trial(every=False)
    trial.case("others", OTHERS)
    trial.case("dyed", DYED)
    assert trial.wrong == []
    assert len(trial.names) > 60


def test_losses_alike_are_another_shape_where_a_pipe_joins():
    """With equal losses in both directions the root has a closed form; in the shipped case a column joins the tank."""
    tank = {
        "type": "tank",
        "area": 2.0,
        "level": 3.0,
        "connection": {"diameter": 0.1, "loss_in": 1.0, "loss_out": 1.5},
    }
    case = scene(
        {"lake": reservoir(2e5), "tank": tank},
        {"main": pipe("lake", "tank", 100.0, 0.1, 1000.0, 4)},
        1.0,
        {},
    )
    before = fvsolve.build(fvsolve.load(case))
    for key, other in (("loss_in", 1.5), ("loss_out", 1.0)):
        after = fvsolve.build(
            fvsolve.load(moved(case, ("nodes", "tank", "connection", key), other))
        )
        assert (
            observed_class(before, after)
            == "shape"
            == changes(before.case, f"nodes.tank.connection.{key}")
        )


def test_a_regulating_valve_that_acts_at_once_is_another_shape():
    """With `time_constant = 0` the valve has no state; the shipped cases have none of it."""
    flat = {"model": "hazen-williams", "coefficient": 110}
    ends = {"length": 100.0, "diameter": 0.1, "friction": flat}
    links = {
        "a": {"type": "pipe", "from": "lake", "to": "j", **ends},
        "v": {
            "type": "pressure-reducing",
            "from": "j",
            "to": "k",
            "set_pressure": "1.5 bar",
            "time_constant": 5.0,
            "diameter": 0.1,
            "loss_coefficient": 1.0,
        },
        "b": {"type": "pipe", "from": "k", "to": "sea", **ends},
    }
    nodes = {
        "lake": reservoir(3e5),
        "j": {"type": "junction"},
        "k": {"type": "junction"},
        "sea": reservoir(1.2e5),
    }
    case = scene(nodes, links, 1.0, {"pipe_model": "quasi-steady"})
    after = fvsolve.build(fvsolve.load(moved(case, ("links", "v", "time_constant"), 0.0)))
    before = fvsolve.build(fvsolve.load(case))
    assert observed_class(before, after) == "shape" == changes(before.case, "links.v.time_constant")


def test_no_key_of_any_shipped_case_changes_more_than_declared():
    """The start of load-sensing takes 0.2 s; its keys are changed by the test above."""
    trial = Trial(every=True)
    for name in NAMES:
        if name != "load-sensing":
            trial.case(name)
    assert trial.wrong == []


def test_effect_of_a_key_depends_on_the_case_where_its_part_states_so():
    """Classes depend on stated cells, on the target of a signal, and on unsteady friction."""
    case = fvsolve.load("valve-closure")
    for key, said in {
        "links.valve.area": "profile",
        "links.main.length": "profile",
        "links.main.cells": "shape",
        "title": "value",
        "links.valve.discharge_coefficient": "profile",
        "fluid.bulk_modulus": "profile",
        "nodes.gate.position": "value",
        "links.main.friction.model": "shape",
        "numerics.courant": "value",
        "links.valve.opening.start": "profile",
        '"expect"."max(gate.pressure)".value': "value",
    }.items():
        assert changes(case, key) == said, key
    left_out = raw_case("valve-closure")
    del left_out["links"]["main"]["cells"]
    assert changes(fvsolve.load(left_out), "links.main.length") == "shape"
    past = fvsolve.load("laminar-line")
    assert (
        changes(past, "fluid.viscosity") == "shape" and changes(past, "numerics.courant") == "value"
    )
    assert changes(fvsolve.load("rigid-column"), "signals.stroke.value") == "profile"


def test_a_key_that_is_not_there_changes_nothing_but_is_named():
    with pytest.raises(
        FvsolveError, match='unknown key "links.valve.aera"; expected a key of the case'
    ):
        changes(fvsolve.load("valve-closure"), "links.valve.aera")
    with pytest.raises(FvsolveError, match='unknown key "signals.strok.value"'):
        changes(fvsolve.load("rigid-column"), "signals.strok.value")
