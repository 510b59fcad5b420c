"""EPANET's Net3 without events for 20 s: CPU time and drift of fvsolve and of rthym-moc, which reads the same file.

Both use a wave speed of 1438.656 m/s (4720 ft/s, rthym-moc's rigid pipe). rthym-moc divides every pipe by its wave
speed times its step. With cells the step of fvsolve follows the shortest pipe, 2.5 ms long here; therefore rthym-moc
runs twice, at that step and at the same length of cells. Delay lines keep true lengths at any step.
"""

import tomllib
import warnings
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from measure import agree, parser, peer_module

import fvsolve
from fvsolve.case import load
from fvsolve.core.model.build import build
from fvsolve.exchange.epanet import import_network

rthym_moc, wntr = peer_module("rthym_moc", "rthym-moc"), peer_module("wntr", "wntr")
NET = Path(wntr.__file__).parent / "library" / "networks" / "Net3.inp" if wntr else None
SPEED, END, REPEATS = 4720 * 0.3048, 20.0, 3
SETTINGS = [("upwind", "euler"), ("muscl", "ssp-rk2"), ("upwind5", "rk4")]
SHORTEST = 2.5e-3 * SPEED  # shortest pipe with cells [m]


def rthym(dt):
    """CPU time [s], greatest and median drift of a head [m], and number of rows of rthym-moc."""
    # rthym-moc writes temp.inp and more
    with warnings.catch_warnings(), TemporaryDirectory() as folder, chdir(folder):
        warnings.simplefilter("ignore")
        solver = rthym_moc.load_inp(str(NET), stub_length_ft=4720 * dt)
    best = np.inf
    for _ in range(REPEATS):
        start = process_time()
        found = solver.run(END, dt)
        best = min(best, process_time() - start)
    heads = [
        np.asarray(head) for name, head in found["node_head"].items() if not name.startswith("_")
    ]
    drift = np.array([np.max(np.abs(head - head[0])) for head in heads]) * 0.3048
    return best, drift.max(), np.median(drift), len(found["time"])


def ours(shortest, **numerics):
    """CPU time [s], greatest and median drift of a head [m], steps, and number of cells of fvsolve."""
    table = tomllib.loads(import_network(NET, wave_speed=SPEED, shortest=shortest).text)
    table["numerics"] |= {"end": END, **numerics}
    names = [name for name, node in table["nodes"].items() if node["type"] == "junction"]
    table["output"] = {
        "every": 0.5,
        "fields": 0,
        "probes": [f"nodes.{name}.head" for name in names],
    }
    model = build(load(table))
    best = np.inf
    fvsolve.run(model)
    for _ in range(REPEATS):
        start = process_time()
        result = fvsolve.run(model)
        best = min(best, process_time() - start)
    drift = np.array(
        [np.max(np.abs(result[probe] - result[probe][0])) for probe in table["output"]["probes"]]
    )
    return best, drift.max(), np.median(drift), result.summary["steps"], model.cells


def row(name, cpu, most, median, steps, cells=""):
    """Print a row; exit if the drift of fvsolve is above 0.1 m.

    Drifts of fvsolve are millimetres, those of rthym-moc hundreds of metres.
    """
    print(
        f"{name:36} {1e3 * END / steps:9.3g} {cpu:8.3f} {1e6 * cpu / steps:9.1f} {most:10.2g} {median:10.2g} {cells}"
    )
    agree(f"drift of {name} [m]", most if name.startswith("fvsolve") else 0.0, 0.1)


def main():
    global END, REPEATS, SETTINGS
    quick = parser(__doc__).parse_args().quick
    if quick:
        END, REPEATS, SETTINGS = 1.0, 1, SETTINGS[:1]
    if not wntr:
        return
    print(
        f"{'':36} {'step [ms]':>9} {'CPU [s]':>8} {'us/step':>9} {'drift [m]':>10} {'median':>10} cells"
    )
    for cell_time in (0.02,) if quick else (0.01, 0.02):
        for scheme, method in SETTINGS:
            found = ours(
                SHORTEST,
                pipe_model="finite-volume",
                cell_time=cell_time,
                scheme=scheme,
                method=method,
            )
            row(f"fvsolve {scheme} {method}, {1e3 * cell_time:g} ms cells", *found)
        if rthym_moc:
            row("rthym-moc at that step", *rthym(END / found[3]))
        row(
            f"fvsolve delay lines, {1e3 * cell_time:g} ms steps",
            *ours(0.0, pipe_model="delay-line", step=cell_time)[:4],
        )
        if rthym_moc:
            row("rthym-moc at that length of cells", *rthym(cell_time))


if __name__ == "__main__":
    main()
