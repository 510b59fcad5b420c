"""Physics of basins from outside: a folder that is declared, checked, lowered, compiled, run and read."""

import json
import subprocess
import sys
from math import exp, factorial
from pathlib import Path
from typing import Annotated

import pytest
from pytest import approx
from reference.scenes import WATER

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.features.basins.lower import rows_class
from fvsolve.features.basins.lower_basin import BasinRows
from fvsolve.parts import Basin
from fvsolve.parts.basin import BasinStart, Physics
from fvsolve.parts.value import Quantity

SOURCES = {
    "part.py": '''
"""Heat on a belt. Knows its keys."""
from typing import Annotated, ClassVar
from fvsolve.parts.basin import Physics
from fvsolve.parts.formula import SpatialField, SpatialFieldKey
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import Quantity, positive

class Warm(Table):
    """What it starts from."""
    heat: Annotated[SpatialField | None, SpatialFieldKey("number", "of the belt")] = None

class Belt(Physics, name="belt"):
    """T_t + v T_x = 0."""
    states: ClassVar[dict[str, str]] = {"heat": "K"}
    fields: ClassVar[dict[str, str]] = {"heat": "number"}
    starts: ClassVar[type[Table]] = Warm
    laws: ClassVar[tuple[str, ...]] = ("linear",)
    joined: ClassVar[bool] = False
    carries: ClassVar[bool] = False
    pace: Annotated[float, Quantity("velocity", positive, "along x [m/s]")]
''',
    "rates.py": '''
"""Rates of the cells of a belt, and what probes read there."""
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.jit import njit
from fvsolve.features.basins.tables import open_basins
from fvsolve.core.kernels.dtypes import CELL_FIELD, RATE

OWN_CODE = physics_code(__package__)

@njit
def carry(t, y, dydt, out, handle):
    """By upwind, cold where the belt begins."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] != OWN_CODE:
            continue
        rate, o, nx = basin["speed"] * tables.plane[basin["spacing"]], basin["y"], basin["nx"]
        out[RATE] = max(out[RATE], rate)
        for i in range(basin["n"] if dydt.size > 0 else 0):
            dydt[o + i] = rate * ((y[o + i - 1] if i % nx > 0 else 0.0) - y[o + i])

@njit
def read(t, y, out, handle, values):
    """values[k] of its probes."""
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_FIELD and tables.basins[probe["index"]]["kind"] == OWN_CODE:
            values[k] = 0.0
            for m in range(probe["count"]):
                at = tables.basins[probe["index"]]["y"] + tables.integers[probe["cell"] + m]
                values[k] += tables.floats[probe["weights"] + m] * y[at]
''',
    "lower.py": '''
"""A belt lowered to rows of tables."""
import numpy as np
from fvsolve.features.basins.lower_basin import BasinRows
from fvsolve.core.kernels.rhs_assembly import RhsTerms

class BeltRows(BasinRows):
    """One state a cell."""
    units = {"heat": "K"}

    def pieces(self, valves):
        yield RhsTerms(package=__package__, rates="rates: carry", observe="rates: read")

    def lower(self, draft, row):
        row["speed"] = self.part.pace

    def start(self):
        return self.formula(self.part.start.heat)[None]

    def fields(self, y):
        return {"heat": y[0]}

    def speeds(self, y):
        return np.tile([self.part.pace, 0.0, 0.0], (self.n, 1)), np.zeros(self.n)

    def lower_probe(self, row, field, cells, weights):
        pass
''',
}
NUMERICS = {"end": 2.0, "scheme": "upwind", "method": "euler", "courant": 1.0}
BELT = {
    "type": "basin",
    "physics": "belt",
    "size": [10.0, 2.0],
    "cells": [10, 2],
    "pace": "2 m/s",
    "start": {"heat": "(x > 1) * (x < 3) * (300 + y)"},
}
SAYS = """
import json, sys
import numpy as np
import fvsolve
from fvsolve.case.schema import schema
from fvsolve.core.model.jacobian_pattern import jacobian_pattern as sparsity

case = json.loads(sys.argv[2])

def faults(**more):
    try:
        fvsolve.load({**case, **more})
    except fvsolve.CaseError as error:
        return str(error)

basin = case["nodes"]["belt"]
said = {"unknown": faults()}
fvsolve.register_part(sys.argv[1])
slowly = {**case["numerics"], "method": "radau-iia-5", "courant": 0.5}
for name, numerics in {"exact": case["numerics"], "implicit": slowly}.items():
    run = fvsolve.run({**case, "numerics": numerics})
    said[name] = [run.t.tolist(), run["belt.heat@6.5,0.5"].tolist()]
model = fvsolve.build(fvsolve.load(case))
hangs = model.jacobian(0.0, model.start) != 0.0
said["missed"] = int((hangs & ~sparsity(model)[: model.y_size].toarray()).sum())
said["path"] = model.checks["basins"]["belt"]["path"]
said["schema"] = "pace" in json.dumps(schema())
said["missing"] = faults(nodes={"belt": {key: value for key, value in basin.items() if key != "pace"}})
said["other"] = faults(nodes={"belt": {**basin, "level": 1.0}})
said["start"] = faults(nodes={"belt": {**basin, "start": {"heat": 1.0, "u": 1.0}}})
said["law"] = faults(fluid={**case["fluid"], "law": "log"})
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def process_results(tmp_path_factory) -> dict:
    """Results of a process in which the folder of the physics `belt` is registered."""
    folder = tmp_path_factory.mktemp("others") / "belt"
    folder.mkdir()
    for name, text in SOURCES.items():
        (folder / name).write_text(text)
    output = {"every": 0.5, "probes": ["belt.heat@6.5,0.5"]}
    case = {"fluid": dict(WATER), "nodes": {"belt": BELT}, "numerics": NUMERICS, "output": output}
    found = subprocess.run(
        [sys.executable, "-c", SAYS, str(folder), json.dumps(case)], capture_output=True, text=True
    )
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout.splitlines()[-1])


def test_it_runs_exactly(process_results):
    """Euler steps of Courant number 1 move upwind values by one cell each, to the bit."""
    assert process_results["exact"] == [[0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 0.0, 0.0, 0.0, 300.5]]


def test_it_is_stepped_implicitly(process_results):
    """Upwind rates 2 (T[i - 1] - T[i]) weight the start k cells upstream by exp(-2 t) (2 t)^k / k!."""
    times, found = process_results["implicit"]
    share = [sum((2.0 * t) ** k / factorial(k) * exp(-2.0 * t) for k in (4, 5)) for t in times]
    assert found == approx([300.5 * one for one in share], abs=0.01)
    assert process_results["missed"] == 0  # dependences outside the pattern


def test_it_is_checked_by_its_own_declaration(process_results):
    assert (
        'no physics named "belt"; expected one of free-surface, liquid, transport'
        in process_results["unknown"]
    )
    assert "nodes.belt: pace is missing" in process_results["missing"]
    assert (
        'nodes.belt.level: is not a key of physics "belt"; it belongs to free-surface'
        in process_results["other"]
    )
    assert 'nodes.belt.start.u: does not apply to physics "belt"' in process_results["start"]
    assert 'fluid.law: "log" does not apply to basins; expected "linear"' in process_results["law"]
    assert process_results["path"] == "grid" and process_results["schema"]


def test_every_physics_is_a_folder_that_lowers_itself():
    """Each physics has a folder of basins with `part.py` and `lower.py`, and a basin has all its keys."""
    folders = {
        path.parent.name
        for path in (Path(fvsolve.__file__).parent / "features" / "basins").glob("*/part.py")
    }
    assert {one.__module__.split(".")[-2] for one in Physics.kinds.values()} == folders
    for one in Physics.kinds.values():
        assert set(one.model_fields) <= set(Basin.model_fields)
        assert set(one.starts.model_fields) <= set(BasinStart.keys())
        assert issubclass(rows_class(one), BasinRows) and rows_class(one) is not BasinRows


@pytest.mark.parametrize("key", ["pressure", "size"])  # keys of liquids and of all basins
def test_a_key_that_exists_retains_its_meaning(key):
    keys = {"__annotations__": {key: Annotated[float, Quantity("time")]}, "__module__": __name__}
    with pytest.raises(
        FvsolveError, match=f'"clock" declares {key} differently from the existing key of a basin'
    ):
        type(Physics)("Clock", (Physics,), keys, name="clock")
    assert "clock" not in Physics.kinds and Basin.keys().count(key) == 1


FIRST = """
from typing import Annotated
from fvsolve.parts.basin import Physics
from fvsolve.parts.value import Quantity
keys = {"__annotations__": {"pressure": Annotated[float, Quantity("time")]}, "__module__": "clocks"}
try:
    type(Physics)("Clock", (Physics,), keys, name="clock")
except Exception as error:
    print(error)
print(Physics.kinds["liquid"].__name__)
"""


def test_a_key_retains_its_meaning_in_a_process_that_has_not_loaded_its_physics():
    found = subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True)
    message, liquid = found.stdout.splitlines()
    assert 'physics "clock" declares pressure differently' in message and liquid == "Liquid"


def test_a_name_that_is_there_is_taken():
    with pytest.raises(FvsolveError, match='physics "liquid" exists already'):
        type(Physics)("Other", (Physics,), {"__module__": __name__}, name="liquid")
