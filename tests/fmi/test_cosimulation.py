"""Slave of an FMU without a host: variables and their units, bits of `advance`, states, and faults in words.

PythonFMU is needed for export only, so these tests run without the extra `fmi`.
"""

import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from reference.scenes import lake, scene, tank, valve

import fvsolve
from fvsolve import CaseError, FvsolveError, advance, initial_state
from fvsolve.core.solve.held_inputs import hold
from fvsolve.exchange.fmi.cosimulation import CoSimulation
from fvsolve.exchange.fmi.export import case_files, write_fmu
from fvsolve.exchange.fmi.model_description import base_exponents, model_description
from fvsolve.exchange.fmi.variables import variables_of


class Slave(CoSimulation):
    """Slave with the attributes that PythonFMU's `Fmi2Slave` has."""

    def __init__(self, case, folder):
        self.resources, self.instance_name, self.logged = str(folder), "slave", []
        for name, data in case_files(case).items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
        self.start()
        self.reference = {variable.name: k for k, variable in enumerate(self.variables)}

    def log(self, text, status, category):
        self.logged.append((status, category, text))

    def set(self, name, value):
        self.set_real([self.reference[name]], [value])

    def get(self, *names):
        return self.get_real([self.reference[name] for name in names])

    @property
    def outputs(self):
        return self.get(*(variable.name for variable in self.variables if not variable.is_input))


@pytest.fixture
def slave(tmp_path):
    return lambda name, changes=None: Slave(fvsolve.load(name, changes), tmp_path)


CASES = {
    "two-tanks": ("hole.opening", 0.5, 0.05, 1.0),
    "governor": ("controls.governor.setpoint", 1.01, -0.002, 0.02),
    "cylinder-servo": ("spool.position", 0.1, 0.05, 0.002),
    "digital-pressure": ("town.demand", 0.03, 0.001, 0.3),
}


@pytest.mark.parametrize("name", CASES)
def test_steps_are_those_of_advance_to_the_bit(name, slave):
    key, first, change, step = CASES[name]
    running, model, held = slave(name), fvsolve.build(fvsolve.load(name)), {}
    state = initial_state(model)
    for k in range(8):
        if k > 2:
            held = {key: first + change * k}
            running.set(key, held[key])
            assert running.outputs == hold(model, held).observe(state).tolist()
        assert running.do_step(k * step, step)
        state = advance(model, state, k * step + step, held)
        assert running.outputs == hold(model, held).observe(state).tolist()
    assert np.array_equal(running.state.y, state.y) and running.get(key) == [held[key]]


@pytest.mark.parametrize("name", CASES)
def test_a_state_from_bytes_continues_with_the_same_bits(name, slave):
    key, first, change, step = CASES[name]
    running = slave(name)
    running.set(key, first)
    for k in range(3):
        running.do_step(k * step, step)
    stored = running._get_fmu_state()
    data = running._fmu_state_to_bytes(stored)
    assert (
        data
        == running._fmu_state_to_bytes(stored)
        == running._fmu_state_to_bytes(running._get_fmu_state())
    )

    def last() -> tuple:
        for k in range(3, 6):
            running.do_step(k * step, step)
        return running.outputs, running.state.y.tobytes(), dict(running.held)

    expected = last()
    running.set(key, first + change)
    for again in (stored, running._fmu_state_from_bytes(data)):
        running._set_fmu_state(again)
        assert last() == expected


def description_of(case) -> ElementTree.Element:
    model = fvsolve.build(case)
    return ElementTree.fromstring(model_description(case, variables_of(model), "x", "y", "0", "z"))


def test_the_description_states_variables_units_and_ranges():
    case = fvsolve.load("governor", {"output.units": {"angular_velocity": "rpm", "length": "ft"}})
    root = description_of(case)
    real = {entry.get("name"): entry.find("Real").attrib for entry in root.iter("ScalarVariable")}
    causality = {entry.get("name"): entry.get("causality") for entry in root.iter("ScalarVariable")}
    assert [name for name in real if causality[name] == "output"] == [
        probe.text for probe in case.probes
    ]
    assert real["lake.head"]["unit"] == "m" and float(real["lake.head"]["start"]) == pytest.approx(
        112.0
    )
    assert real["generator.torque"] == {"start": "-600000.0", "unit": "N m"}
    assert real["unit.speed"] == {"unit": "rad/s", "displayUnit": "rpm"}
    # a control drives both
    assert "unit.opening" not in real and "controls.governor.output" not in real
    assert real["controls.governor.setpoint"] == {"start": "1.0", "unit": "1"}
    unit = {entry.get("name"): entry for entry in root.iter("Unit")}
    assert unit["Pa"].find("BaseUnit").attrib == {"kg": "1", "m": "-1", "s": "-2"}
    assert unit["rad/s"].find("BaseUnit").attrib == {"s": "-1", "rad": "1"}
    rpm = unit["rad/s"].find("DisplayUnit")
    assert (
        float(rpm.get("factor")) == pytest.approx(30.0 / np.pi) and float(rpm.get("offset")) == 0.0
    )
    unknowns = [entry.get("index") for entry in root.iter("Unknown")]
    # Outputs, then InitialUnknowns
    assert unknowns[: len(unknowns) // 2] == unknowns[len(unknowns) // 2 :]


def test_a_gauge_unit_of_the_output_has_an_offset():
    root = description_of(fvsolve.load("valve-closure", {"output.units": {"pressure": "barg"}}))
    pascal = next(entry for entry in root.iter("Unit") if entry.get("name") == "Pa")
    display = pascal.find("DisplayUnit[@name='barg']")
    assert float(display.get("factor")) == pytest.approx(1e-5)
    assert float(display.get("offset")) == pytest.approx(-1.01325)
    opening = next(
        entry for entry in root.iter("ScalarVariable") if entry.get("name") == "valve.opening"
    )
    assert opening.find("Real").attrib == {"start": "1.0", "min": "0.0", "max": "1.0", "unit": "1"}


@pytest.mark.parametrize("unit", ["1", "m3/s/Pa", "W/m2/K", "N m/rad", "ohm", "kg m2/s"])
def test_base_units_multiply_to_the_unit(unit):
    known = {
        "1": {},
        "m3/s/Pa": {"m": "4", "s": "1", "kg": "-1"},
        "W/m2/K": {"kg": "1", "s": "-3", "K": "-1"},
        "N m/rad": {"kg": "1", "m": "2", "s": "-2", "rad": "-1"},
        "ohm": {"kg": "1", "m": "2", "s": "-3", "A": "-2"},
        "kg m2/s": {"kg": "1", "m": "2", "s": "-1"},
    }
    assert base_exponents(unit) == known[unit]


def test_names_that_an_input_and_a_probe_share_are_refused_together(fvs, tmp_path):
    with pytest.raises(CaseError) as refused:
        variables_of(fvsolve.build(fvsolve.load("hydropower")))
    assert [fault.place for fault in refused.value.faults] == ["output.probes"] * 2
    for name in ("unit.speed", "unit.opening"):
        assert f'"{name}" is the name of an input and of a probe' in str(refused.value)
        assert f'expected "links.{name}" for the probe' in str(refused.value)
    probes = {"output.probes": ["spiral.head", "links.unit.speed", "links.unit.opening"]}
    names = [
        variable.name
        for variable in variables_of(fvsolve.build(fvsolve.load("hydropower", probes)))
    ]
    assert len({*names}) == len(names) and {"unit.speed", "links.unit.speed"} <= {*names}


def test_an_input_without_effect_is_none():
    """Torques drive the shaft of the turbine, so nothing reads the schedule of its speed."""
    model = fvsolve.build(fvsolve.load("governor"))
    with pytest.raises(FvsolveError, match="no input named"):
        advance(model, initial_state(model), 0.1, {"unit.speed": 30.0})


def test_the_head_and_the_pressure_of_a_reservoir_are_held_by_the_last_value(slave):
    running = slave("valve-closure")
    start = dict(
        zip(("lake.head", "lake.pressure"), running.get("lake.head", "lake.pressure"), strict=True)
    )
    running.set("lake.pressure", 7e5)
    running.set("lake.head", 50.0)
    assert running.held == {"lake.head": 50.0}
    assert running.get("lake.head", "lake.pressure") == [50.0, start["lake.pressure"]]


def test_values_out_of_range_and_outputs_are_refused_in_words(slave, capsys):
    running = slave("valve-closure")
    for name, value, words in (
        (
            "valve.opening",
            1.5,
            "valve.opening = 1.5 is out of range; expected a number from 0, shut, to 1, open",
        ),
        ("lake.pressure", np.nan, "lake.pressure = nan is not finite"),
        ("gate.head", 1.0, "gate.head is an output of the FMU"),
    ):
        with pytest.raises(FvsolveError, match=words):
            running.set(name, value)
        assert f"fvsolve FMU slave: {words}" in capsys.readouterr().err
        assert running.logged[-1][:2] == (3, "logStatusError") and words in running.logged[-1][2]
    assert running.held == {}


def test_times_of_the_host_are_checked_in_words(slave, capsys):
    running = slave("two-tanks")
    running.setup_experiment(0.0, 320.0, None)
    assert capsys.readouterr().err == ""
    with pytest.raises(
        FvsolveError,
        match="the start time is 5 s, but the case starts at 0 s; expected startTime = 0",
    ):
        running.setup_experiment(5.0, None, None)
    capsys.readouterr()
    running.setup_experiment(0.0, 400.0, None)
    assert "the stop time is 400 s" in capsys.readouterr().err and running.logged[-1][0] == 1
    with pytest.raises(FvsolveError, match="the host is at t = 3 s, and the FMU at 0 s"):
        running.do_step(3.0, 1.0)


def test_a_step_that_cannot_be_taken_leaves_the_state(slave, capsys):
    nodes = {"a": lake(10.0), "b": tank(1.0, 1.0, height=1.5)}
    numerics = {"scheme": "upwind", "method": "rk4", "step": 0.01}
    running = slave(scene(nodes, {"v": valve("a", "b", 0.01)}, 10.0, numerics, ["b.level"]))
    before = running.state
    running.held["a.head"] = -50.0  # as a host could not set it
    assert not running.do_step(0.0, 0.1) and running.state is before
    assert "a.head = -50 is" in capsys.readouterr().err
    running.held.clear()
    assert running.do_step(0.0, 0.1)


def test_a_case_that_the_host_cannot_read_is_stated(slave, tmp_path, capsys):
    slave("two-tanks")
    path = tmp_path / "case/two-tanks.toml"
    path.write_text(path.read_text().replace('type = "orifice"', 'type = "part-of-another-place"'))
    second = CoSimulation()
    second.resources, second.instance_name, second.log = str(tmp_path), "second", lambda *_: None
    with pytest.raises(FvsolveError, match="part-of-another-place"):
        second.start()
    assert "fvsolve FMU second: two-tanks.toml: 1 fault" in capsys.readouterr().err


def test_a_missing_package_is_named_with_its_remedy(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "pythonfmu", None)
    code, printed, error = fvs("fmu", "two-tanks")
    assert (
        code == 2
        and error.strip() == 'an FMU needs the package PythonFMU: pip install "fvsolve[fmi]"'
    )
    assert not [*tmp_path.glob("*.fmu")]


def test_a_name_of_another_type_is_refused(tmp_path):
    with pytest.raises(
        FvsolveError, match=r"tanks.zip: unknown type of file; expected a name that ends in .fmu"
    ):
        write_fmu(fvsolve.load("two-tanks"), str(tmp_path / "tanks.zip"))
