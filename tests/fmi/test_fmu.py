"""FMU in FMPy: nothing to find for its validation, bits of `advance`, and faults of the host in words."""

import os
import subprocess
import sys
import zipfile

import pytest
from reference.folders import page, python_of

import fvsolve
from fvsolve import advance, initial_state
from fvsolve.core.solve.held_inputs import hold
from fvsolve.exchange.fmi.export import write_fmu

pytest.importorskip("pythonfmu", reason="PythonFMU is in the extra fmi")
fmpy = pytest.importorskip("fmpy", reason="FMPy is in the extra fmi")
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

CASES = {
    "two-tanks": ("hole.opening", 0.5, 1.0),
    "governor": ("controls.governor.setpoint", 0.99, 0.02),
    "cylinder-servo": ("spool.position", 0.2, 0.001),
}


class Host:
    """FMU that FMPy has loaded, with its variables by name."""

    def __init__(self, path, folder, name="host"):
        self.description = fmpy.read_model_description(str(path))
        unpacked = fmpy.extract(str(path), str(folder))
        identifier = self.description.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=unpacked,
            modelIdentifier=identifier,
            instanceName=name,
        )
        variables = self.description.modelVariables
        self.reference = {variable.name: variable.valueReference for variable in variables}
        self.listed = [
            variable.valueReference for variable in variables if variable.causality == "output"
        ]
        self.fmu.instantiate()
        self.begin()

    def begin(self):
        self.fmu.setupExperiment(startTime=float(self.description.defaultExperiment.startTime))
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    @property
    def outputs(self) -> list[float]:
        return [float(value) for value in self.fmu.getReal(self.listed)]

    def set(self, name, value):
        self.fmu.setReal([self.reference[name]], [value])


@pytest.fixture
def host(tmp_path):
    """Function that loads the FMU of a case: host("two-tanks") -> Host."""
    hosts = []

    def load(name, changes=None):
        path, _ = write_fmu(fvsolve.load(name, changes), tmp_path / f"{name}-{len(hosts)}.fmu")
        hosts.append(Host(path, tmp_path / f"{name}-{len(hosts)}", f"{name}-{len(hosts)}"))
        return hosts[-1]

    yield load
    for running in hosts:
        running.fmu.terminate()
        running.fmu.freeInstance()


@pytest.mark.parametrize(
    "name", [*CASES, "valve-closure", "digital-pressure", "dc-motor-pump", "tracer-basin"]
)
def test_validation_finds_nothing(name, tmp_path):
    path, variables = write_fmu(fvsolve.load(name), tmp_path / f"{name}.fmu")
    assert validate_fmu(str(path)) == []
    description = fmpy.read_model_description(str(path))
    assert [variable.name for variable in description.modelVariables] == [
        variable.name for variable in variables
    ]


@pytest.mark.parametrize("name", CASES)
def test_the_bits_are_those_of_advance_also_from_stored_states(name, host):
    key, value, step = CASES[name]
    running, model, held = host(name), fvsolve.build(fvsolve.load(name)), {}
    state, rows = initial_state(model), []
    for k in range(8):
        if k == 2:
            held = {key: value}
            running.set(key, value)
        if k == 4:
            stored = running.fmu.getFMUstate()
            data = running.fmu.serializeFMUstate(stored)
        running.fmu.doStep(k * step, step)
        state = advance(model, state, k * step + step, held)
        rows.append(running.outputs)
        assert rows[-1] == hold(model, held).observe(state).tolist()
    for again in (stored, running.fmu.deSerializeFMUstate(data)):
        running.fmu.setFMUstate(again)
        for k in range(4, 8):
            running.fmu.doStep(k * step, step)
            assert running.outputs == rows[k]
        running.fmu.freeFMUstate(again)
    running.fmu.reset()
    running.begin()
    running.fmu.doStep(0.0, step)
    assert running.outputs == rows[0]


def test_two_fmus_share_a_process(host):
    low, high = host("two-tanks"), host("two-tanks", {"nodes.high.level": 5.0})
    for k in range(3):
        low.fmu.doStep(k, 1.0)
        high.fmu.doStep(k, 1.0)
    assert low.outputs[0] < 4.0 < high.outputs[0] < 5.0


def test_the_driver_of_fmpy_reaches_the_end_of_the_case(tmp_path):
    path, _ = write_fmu(fvsolve.load("two-tanks"), tmp_path / "two-tanks.fmu")
    result = fmpy.simulate_fmu(str(path))
    assert result["time"][-1] == pytest.approx(320.0) and result["high.level"][-1] == pytest.approx(
        3.0, abs=1e-6
    )


def test_the_same_case_gives_the_same_file_with_the_files_of_the_case(tmp_path):
    paths = [write_fmu(fvsolve.load("governor"), tmp_path / name)[0] for name in ("a.fmu", "b.fmu")]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with zipfile.ZipFile(paths[0]) as archive:
        names = {*archive.namelist()}
        assert {
            "resources/case/governor.toml",
            "resources/case/hydropower.csv",
            "binaries/linux64/governor.so",
            "binaries/win64/governor.dll",
            "documentation/index.html",
        } <= names
        assert b"needs Python 3.11 or later with fvsolve" in archive.read("modelDescription.xml")


BEFORE = {
    "another version": "import fvsolve; fvsolve.__version__ = '0.0.9'",
    "no fvsolve": "import sys; sys.modules['fvsolve'] = None",
}
FOUND = {
    "another version": "the host has fvsolve 0.0.9",
    "no fvsolve": "fvsolve cannot be imported",
}


@pytest.mark.parametrize("before", BEFORE)
def test_a_host_with_a_wrong_fvsolve_gets_a_message(before, tmp_path):
    path, _ = write_fmu(fvsolve.load("two-tanks"), tmp_path / "two-tanks.fmu")
    code = f"{BEFORE[before]}\nimport fmpy\nfmpy.simulate_fmu({str(path)!r}, stop_time=2.0)"
    known = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=known, capture_output=True, text=True)
    assert done.returncode == 1 and FOUND[before] in done.stderr
    assert f"needs fvsolve {fvsolve.__version__} in the Python of the host" in done.stderr
    assert f"pip install fvsolve=={fvsolve.__version__}" in done.stderr


def test_the_command_writes_the_file_and_prints_the_variables(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, printed, _ = fvs("fmu", "two-tanks")
    assert code == 0 and (tmp_path / "two-tanks.fmu").is_file()
    assert "hole.opening" in printed and "m3/s" in printed and "two-tanks.fmu" in printed
    assert (
        fvs("fmu", "two-tanks", "--out", "folder/tanks.fmu")[0] == 0
        and (tmp_path / "folder/tanks.fmu").is_file()
    )
    code, _, error = fvs("fmu", "hydropower")
    assert code == 2 and "hydropower.toml: 2 faults" in error


def test_the_example_of_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(python_of(page("fmu")), found)
    assert found["pressure"] > 5e5
