"""Large networks compared with rthym-moc 0.4.1: cells and delay lines of fvsolve on networks of EPANET and on a grid.

    python benchmarks/large_networks.py [net3] [ky4] [trip] [net6] [grid]

In net3 and ky4 the largest demand stops smoothly in 0.2 s; in trip the river pump of Net3 trips. Heads of all junctions
are compared each 50 ms. Errors are in jumps: Joukowsky's jump of the demand, or the greatest change of a head after the
trip. The tables give the greatest error of all, and the rms over junctions at its worst time. net6 runs 20 s in steps
of 10 ms. grid checks and runs 2 000 pipes. Envelopes of delay lines are recorded at all nodes and at each second of
travel, at least in the middle, unless a row states otherwise. Delay lines use Euler's method, because only tanks and,
after the trip, the speed of a pump have states.

The reference is `upwind5` with cells of 2.5 ms and true lengths, stored in the temporary folder. All programs use a
wave speed of 1438.656 m/s (4720 ft/s, rthym-moc's rigid pipe). The heads of rthym-moc drift by 290 m on Net3. Its error
is therefore that of its method of characteristics, with wave speeds changed to fit its step, as computed by fvsolve;
its time is its own. CPU time per simulated second is that of the stepping alone for fvsolve (from its summary), and of
the solve call for rthym-moc; `whole` is that of the whole call `fvsolve.run(model)`.
"""

import hashlib
import json
import subprocess
import sys
import tempfile
import tomllib
import warnings
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from measure import agree, machine, parser, peer_module

import fvsolve
from fvsolve.case import load
from fvsolve.core.model.build import build
from fvsolve.exchange.epanet import import_network

rthym_moc, wntr = peer_module("rthym_moc", "rthym-moc"), peer_module("wntr", "wntr")
NETWORKS = Path(wntr.__file__).parent / "library" / "networks" if wntr else None
SPEED, GRAVITY = 4720 * 0.3048, 9.80665
BEGIN, STOP, EVERY = 0.5, 0.2, 0.05  # start and duration of the event, interval of rows [s]
ENDS = {"Net3": 6.0, "ky4": 4.0}
# travel time of cells of the reference, and between places of envelopes [s]
FINE, FEW, MORE = 2.5e-3, 1.0, 0.1
TODAY = (0.01, 0.025)  # travel times of cells [s]
# steps of delay lines and of rthym-moc [s]
STEPS, PEER = (0.0025, 0.01, 0.0165, 0.02, 0.025, 0.05), (0.0025, 0.01)
ACCURACY = 5e-3  # `delay_tolerance`: half the default, at little cost
ERROR, THIRTIETH, HUNDREDTH, QUARTER = 1.5e-2, 30.0, 100.0, 4.0
REPEATS = 5
SIDE, LINES = 32, ("finite-volume", "delay-line")  # grid: junctions along a side, pipe models


@dataclass
class Row:
    """Result of a program: CPU time per simulated second, of the stepping and of the run [s], and errors in jumps."""

    what: str
    cpu: float
    whole: float = np.nan
    greatest: float = np.nan
    rms: float = np.nan


def town(name, shortest=0.0):
    """Case of an EPANET network that records the heads of all junctions."""
    table = tomllib.loads(
        import_network(NETWORKS / f"{name}.inp", wave_speed=SPEED, shortest=shortest).text
    )
    junctions = [node for node, part in table["nodes"].items() if part["type"] == "junction"]
    table["output"] = {
        "every": EVERY,
        "fields": 0,
        "probes": [f"nodes.{node}.head" for node in junctions],
    }
    return table


def stopped(name, shortest=0.0):
    """Case in which the largest demand stops, and Joukowsky's jump [m]."""
    table = town(name, shortest)
    drawn = {
        node: 1e-3 * float(part["demand"].split()[0])
        for node, part in table["nodes"].items()
        if "demand" in part
    }
    most = max(drawn, key=drawn.get)
    s = np.linspace(0.0, 1.0, 41)
    left = drawn[most] * (1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
    table["nodes"][most]["demand"] = {
        "time": (BEGIN + STOP * s).tolist(),
        "value": left.tolist(),
        "kind": "smooth",
    }
    table["numerics"]["end"] = ENDS[name]
    bores = [
        p["diameter"]
        for p in table["links"].values()
        if p["type"] == "pipe" and most in (p["from"], p["to"])
    ]
    areas = sum(np.pi / 4 * (1e-3 * float(bore.split()[0])) ** 2 for bore in bores)
    return table, SPEED * drawn[most] / areas / GRAVITY


def tripped(name, shortest=0.0):
    """Case in which Net3's river pump trips, and None for the jump."""
    table = town(name, shortest)
    table["links"]["335"] |= {"rated_speed": "890 rpm", "inertia": "47 kg m2", "trip": BEGIN}
    table["numerics"]["end"] = ENDS[name]
    return table, None


def solved(table, repeats=None, **numerics):
    """Least CPU times per simulated second, of the stepping and of the whole run [s], and heads at every row.

    The heads are float64[times, nodes] [m].
    """
    case = load({**table, "numerics": table["numerics"] | numerics})
    model, cpu, whole, repeats = (
        build(case),
        np.inf,
        np.inf,
        REPEATS if repeats is None else repeats,
    )
    for turn in range(repeats + 1):  # the first run may compile
        wall, busy = perf_counter(), process_time()
        result = fvsolve.run(model)
        wall, busy = perf_counter() - wall, process_time() - busy
        if turn or not repeats:
            # without other processes
            cpu = min(cpu, result.summary["seconds"] * min(1.0, busy / wall))
            whole = min(whole, busy)
    if result.reason != "finished":
        raise SystemExit(f"{case.title}: {result.reason}")
    t, times = np.asarray(result.t), EVERY * np.arange(round(case.numerics.end / EVERY) + 1)
    last = np.append(np.diff(t) > 0.0, True)
    heads = np.array([np.asarray(result[probe])[last] for probe in table["output"]["probes"]]).T
    return (
        cpu / case.numerics.end,
        whole / case.numerics.end,
        heads[np.searchsorted(t[last], times - 1e-9)],
    )


def bent(table, step):
    """Case with pipes as characteristics divide them: a whole number of steps long, at a wave speed that fits."""
    links = {}
    for name, part in table["links"].items():
        if part["type"] == "pipe":
            length = float(part["length"].split()[0])
            cells = max(1, round(length / SPEED / step))
            part = part | {"cells": cells, "wave_speed": length / (cells * step)}
        links[name] = part
    return table | {"links": links}


def reference(table):
    """Heads with fine cells [m], read from the temporary folder if an earlier run stored them."""
    numerics = {
        "scheme": "upwind5",
        "method": "rk4",
        "pipe_model": "finite-volume",
        "cell_time": FINE,
    }
    said = json.dumps([table, numerics, fvsolve.__version__], sort_keys=True, default=str)
    kept = (
        Path(tempfile.gettempdir())
        / f"fvsolve-reference-{hashlib.sha256(said.encode()).hexdigest()[:16]}.npy"
    )
    if not kept.exists():
        np.save(kept, solved(table, 0, **numerics)[2])
    return np.load(kept)


def peer(name, step, end):
    """CPU time of rthym-moc per simulated second [s]."""
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder, chdir(folder):
        warnings.simplefilter("ignore")
        solver = rthym_moc.load_inp(
            str(NETWORKS / f"{name}.inp"), stub_length_ft=SPEED / 0.3048 * step
        )
    best = np.inf
    for _ in range(REPEATS):
        begun = process_time()
        solver.run(end, step)
        best = min(best, process_time() - begun)
    return best / end


def event(name, scene, title):
    """Print the rows of all programs for one event."""
    table, jump = scene(name)
    exact = reference(table)
    jump = jump or np.abs(exact - exact[0]).max()
    print(f"\n{name}, {title}: {len(table['links'])} links, a jump is {jump:.3g} m")

    def row(what, cpu, whole, heads):
        off = (heads - exact) / jump
        one = found[what] = Row(
            what, cpu, whole, np.abs(off).max(), np.sqrt((off**2).mean(axis=1)).max()
        )
        print(
            f"  {what:40} {cpu:10.3g} {whole:10.3g} {one.greatest:10.2g} {one.rms:10.2g}",
            flush=True,
        )
        agree(f"greatest error of {what} in jumps", one.greatest, 0.5)

    found = {}
    print(f"  {'':40} {'CPU/s [s]':>10} {'whole':>10} {'greatest':>10} {'rms':>10}")
    for time in TODAY:
        coarse = scene(name, shortest=0.25 * SPEED * time)[0]
        cells = solved(
            coarse, 2, scheme="upwind5", method="rk4", pipe_model="finite-volume", cell_time=time
        )
        row(today(time), *cells)
    for step in STEPS:
        row(delay(step), *delayed(table, step, FEW))
    row("10 ms, envelopes each 0.1 s of travel", *delayed(table, 0.01, MORE))
    for step in PEER if rthym_moc else ():
        cut = solved(
            bent(table, step),
            0,
            scheme="upwind",
            method="euler",
            pipe_model="finite-volume",
            courant=1.0,
        )[2]
        row(
            f"rthym-moc, steps of {1e3 * step:g} ms",
            peer(name, step, table["numerics"]["end"]),
            np.nan,
            cut,
        )
    verdict(found)


def delayed(table, step, places, repeats=None):
    """Results of `solved` for delay lines with a given step.

    Places of envelopes are a travel time of `places` [s] apart.
    """
    return solved(
        table,
        repeats,
        pipe_model="delay-line",
        method="euler",
        step=step,
        cell_time=places,
        delay_tolerance=ACCURACY,
    )


def verdict(found):
    """Print the ratios of CPU times with their goals."""
    if not rthym_moc:
        return
    good = [row for what, row in found.items() if "delay" in what and row.greatest <= ERROR]
    if good:
        best = min(good, key=lambda row: row.cpu)
        peers = [row for what, row in found.items() if "rthym" in what]
        near = min(peers, key=lambda row: abs(np.log(row.greatest / ERROR)))
        print(f"  error {ERROR:g} by {best.what}:")
        for other, goal in ((near, THIRTIETH), (found[today(TODAY[0])], HUNDREDTH)):
            print(f"    {other.cpu / best.cpu:.3g} times less than {other.what} (goal {goal:g})")
    else:
        print(f"  error {ERROR:g}: no step of delay lines reaches it")
    theirs, ours = found["rthym-moc, steps of 10 ms"].cpu, found[delay(0.01)].cpu
    print(f"  both at 10 ms: {theirs / ours:.3g} times less (goal {QUARTER:g})")


def delay(step):
    """Name of the row of delay lines with a step [s]."""
    return f"fvsolve, delay lines, steps of {1e3 * step:g} ms"


def today(time):
    """Name of the row of cells with a travel time [s]."""
    return f"fvsolve, cells of {1e3 * time:g} ms, upwind5 rk4"


def net6():
    """Print the CPU times of Net6 for 20 s in steps of 10 ms."""
    table = town("Net6")
    table["numerics"]["end"], table["output"]["probes"] = 20.0, table["output"]["probes"][:10]
    begun = process_time()
    build(load(table))
    print(f"\nNet6, 20 s of 10 ms steps: read and built in {process_time() - begun:.2f} s of CPU")
    print(
        f"  fvsolve, delay lines {20.0 * delayed(table, 0.01, FEW, repeats=2)[0]:8.2f} s of CPU (goal 1)"
    )
    if rthym_moc:
        print(f"  rthym-moc            {20.0 * peer('Net6', 0.01, 20.0):8.2f} s")


def lattice(side, lakes=16, pipe_model="delay-line"):
    """Case of streets: side x side junctions with a demand each, pipes between neighbours and to lakes.

    With a side of 32 there are 2 000 pipes.
    """
    rng, nodes, links = np.random.default_rng(1), {}, {}

    def join(a, b):
        links[f"p{len(links)}"] = {
            "type": "pipe",
            "from": a,
            "to": b,
            "length": float(rng.uniform(30, 300)),
            "wave_speed": 1200.0,
            "diameter": float(rng.choice([0.1, 0.15, 0.2, 0.3, 0.4])),
            "friction": {"model": "hazen-williams", "coefficient": 110.0},
        }

    for i in range(side):
        for j in range(side):
            nodes[f"n{i}-{j}"] = {
                "type": "junction",
                "elevation": float(rng.uniform(0, 20)),
                "demand": 1e-3,
            }
            if j:
                join(f"n{i}-{j - 1}", f"n{i}-{j}")
            if i:
                join(f"n{i - 1}-{j}", f"n{i}-{j}")
    for k in range(lakes):
        nodes[f"lake{k}"] = {"type": "reservoir", "head": 80.0}
        join(f"lake{k}", f"n{rng.integers(side)}-{rng.integers(side)}")
    middle = f"n{side // 2}-{side // 2}"
    nodes[middle]["demand"] = {"start": 0.5, "duration": STOP, "value": [0.02, 0.0]}
    numerics = {"end": 10.0, "cell_time": 0.01, "pipe_model": pipe_model}
    output = {"every": EVERY, "fields": 0, "probes": [f"nodes.{middle}.head"]}
    fluid = {"name": "Water", "law": "linear", "temperature": "20 degC"}
    return {
        "schema": 1,
        "title": "streets",
        "fluid": fluid,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": output,
    }


def grid():
    """Print the CPU time of `check` as a process, and of a run of the grid of streets."""
    print(f"\na grid of {len(lattice(SIDE)['links'])} pipes, 10 s")
    with tempfile.TemporaryDirectory() as folder:
        for line in LINES:
            case, file = load(lattice(SIDE, pipe_model=line)), Path(folder) / f"{line}.toml"
            file.write_text(case.resolved(), encoding="utf-8")
            spent = []
            for _ in range(min(4, REPEATS)):
                before = children()
                subprocess.run(
                    [sys.executable, "-m", "fvsolve", "check", str(file)],
                    check=True,
                    capture_output=True,
                )
                spent.append(children() - before)
            model, runs = build(case), []
            for _ in range(min(3, REPEATS)):
                begun = process_time()
                fvsolve.run(model)
                runs.append(process_time() - begun)
            print(
                f"  {line:13} check {min(spent):6.2f} s of CPU (goal 2), run {min(runs):7.3f} s (goal 10)",
                flush=True,
            )


def children():
    """CPU time of finished child processes [s]."""
    import resource

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


SCENES = {
    "net3": lambda: event("Net3", stopped, "the largest demand stops in 0.2 s"),
    "ky4": lambda: event("ky4", stopped, "the largest demand stops in 0.2 s"),
    "trip": lambda: event("Net3", tripped, "its river pump trips"),
    "net6": net6,
    "grid": grid,
}


def main():
    """Print the selected tables."""
    global ENDS, FINE, TODAY, STEPS, PEER, REPEATS, SIDE, LINES
    options = parser(__doc__)
    options.add_argument(
        "what",
        nargs="*",
        help=f"tables: {', '.join(SCENES)} (default all, with --quick net3 and grid)",
    )
    given = options.parse_args()
    if given.quick:
        ENDS, FINE, TODAY, STEPS, PEER, REPEATS = {"Net3": 0.6}, 0.025, (0.05,), (0.01,), (0.01,), 1
        SIDE, LINES = 4, LINES[1:]
    print(machine("numpy", "numba", "rthym-moc", "wntr"))
    for name in given.what or (("net3", "grid") if given.quick else SCENES):
        if wntr or name == "grid":  # the other tables read networks of WNTR
            SCENES[name]()


if __name__ == "__main__":
    main()
