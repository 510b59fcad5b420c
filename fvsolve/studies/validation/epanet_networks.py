"""Networks that WNTR ships, at rest and over a day, beside the EPANET 2.2 engine.

A row names NETWORK.heads, the greatest difference of steady heads of all nodes [m], or NETWORK.levels, the greatest
difference of levels of tanks over a day [m] from EPANET at a hydraulic step of 2 s.
"""

import time
from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.case.validation_table import Validation
from fvsolve.core.model.build import build
from fvsolve.core.run import run
from fvsolve.exchange.epanet import import_network, toolkit_run
from fvsolve.exchange.epanet.network_file import read_network
from fvsolve.studies.validation.data_files import network_path
from fvsolve.studies.validation.library import Computed

DAY_STEP = 2  # hydraulic step of EPANET over a day [s]
COARSER_STEP = 60  # of the run from which the error of EPANET's steps follows [s]


def compute(validation: Validation, folder: Path) -> dict[str, Computed]:
    """Values of the rows, which name a network and a quantity; folder : receives the imported cases"""
    result = {}
    for row in validation.compare:
        network, _, quantity = row.computed.partition(".")
        path = network_path(network, folder)
        result[row.computed] = heads(path, folder) if quantity == "heads" else levels(path, folder)
    return result


def heads(path: Path, folder: Path) -> Computed:
    """Greatest difference of heads at hour 0 from EPANET at its least tolerance [m]."""
    imported = import_network(path)
    case = folder / f"{path.stem}-rest.toml"
    case.write_text(imported.text, encoding="utf-8")
    nodes = build(load(case)).checks["nodes"]
    found = imported.solution.head
    gaps = [abs(nodes[own]["head"] - found[name]) for name, own in imported.nodes.items()]
    return Computed(float(max(gaps)), text=f"{len(gaps)} nodes")


def levels(path: Path, folder: Path) -> Computed:
    """Greatest difference of levels of tanks over a day from EPANET [m], and that of EPANET at longer steps."""
    imported = import_network(path, day=True)
    case = folder / f"{path.stem}-day.toml"
    case.write_text(imported.text, encoding="utf-8")
    begun = time.process_time()
    result = run(load(case, {"output.units": {}}), pictures=False)
    own = time.process_time() - begun
    tanks = [tank.name for tank in read_network(path).tanks()]
    begun = time.process_time()
    day = toolkit_run.run(path, tanks, [], DAY_STEP, round(result.t[-1]))
    peer = time.process_time() - begun
    coarse = toolkit_run.run(path, tanks, [], COARSER_STEP, round(result.t[-1]))

    def gap(tank: str, level: np.ndarray) -> float:
        return float(np.abs(level - day.level(tank, result.t)).max())

    ours = max(gap(tank, result[f"nodes.{imported.nodes[tank]}.level"]) for tank in tanks)
    steps = max(gap(tank, coarse.level(tank, result.t)) for tank in tanks)
    text = f"{own:.2g} s of CPU time, EPANET {peer:.2g} s at steps of {DAY_STEP} s"
    return Computed(ours, None, ((f"EPANET at steps of {COARSER_STEP} s", steps),), text)
