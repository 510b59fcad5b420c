"""Package, cases, commands and test of docs/own-parts.md, installed and run as they stand."""

import re
import shlex
import tomllib

import pytest
from reference.folders import section
from reference.outside_packages import install, python

from fvsolve.units import DIMENSIONS

TEXT = section("own-parts", "A part with a state")
FILES = dict(re.findall(r"^`([\w./-]+\.\w+)`:\n\n```\w+\n(.*?)```", TEXT, re.DOTALL | re.MULTILINE))
RUNS = re.findall(r"```sh\n(.*?)```\n\n```text\n(.*?)```", TEXT, re.DOTALL)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Folder with the cases and the test of the page, and its installed package."""
    project = tomllib.loads(FILES["pyproject.toml"])["project"]
    files = {name: text for name, text in FILES.items() if name != "pyproject.toml"}
    return install(tmp_path_factory.mktemp("home"), project["name"], files, project["entry-points"])


def test_its_own_test_passes(home):
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "test_tube.py"]
    assert "7 passed" in python(home, *words).stdout


@pytest.mark.parametrize("command, output", RUNS, ids=[command for command, _ in RUNS])
def test_the_commands_of_the_page_print_its_text(command, output, home):
    _, *words = shlex.split(command)
    done = python(home, "-m", "fvsolve", *words, "--force").stdout.splitlines()
    assert [line for line in output.splitlines() if line not in done] == []


def test_a_fault_of_the_part_has_its_key_and_no_valve_may_shut_at_the_end_of_a_given_flow(home):
    words = ["-m", "fvsolve", "check", "u-tube.toml", "--set", "links.joint.length=0.2 m"]
    fault = "links.joint.length: 0.2 m is below the diameter of 0.3 m; expected a tube"
    assert fault in python(home, *words, code=2).stderr
    words = ["-m", "fvsolve", "run", "shut.toml", "--set", "links.joint.type=tube", "--out", "no"]
    assert "stopped" in python(home, *words, code=1).stdout


def test_the_page_lists_all_dimensions_and_all_files_of_the_package():
    listed = re.search(r"The dimensions are\n\n```text\n(.*?)```", TEXT, re.DOTALL)[1]
    assert listed.split(", ") and " ".join(listed.split()).split(", ") == [*DIMENSIONS]
    assert len(FILES) == 11 and len(RUNS) == 2


def test_the_rates_of_a_state_always_have_their_array(home):
    """Without JIT, a law that writes to an empty array would raise IndexError, at rows and in the ledger."""
    words = ["-m", "fvsolve", "energy", "u-tube.toml", "--set", "numerics.end=0.9"]
    done = python(home, *words, "--set", "output.every=0.25", NUMBA_DISABLE_JIT="1")
    assert "finished at t = 0.9 s" in done.stdout


HEATED = """
import fvsolve
from fvsolve.studies import energy

heat = {"heat": True, "initial": 15.0, "unit": "degC", "specific_heat": 4000.0, "heat_from": "all"}
change = {"scalars": {"temperature": heat}, "output.probes": [
    "upper.level", "lower.level", "upper.temperature", "lower.temperature"]}
case = fvsolve.load("u-tube.toml", change)
result = fvsolve.run(case)
upper, lower, *warmer = (result[probe.text] for probe in case.probes)
sizes = 2.0 * upper[-1], 1.0 * lower[-1]
found = sum(size * (values[-1] - values[0]) for size, values in zip(sizes, warmer))
print(found * case.properties.density * 4000.0 / energy("u-tube.toml").dissipated["joint tube"][-1])
"""


def test_dissipated_energy_heats_the_fluid_and_stored_energy_does_not(home):
    """Sum of rho cp volume times the rise of the temperature of both tanks, over the dissipated energy."""
    assert float(python(home, "-c", HEATED).stdout) == pytest.approx(1.0, abs=1e-6)
