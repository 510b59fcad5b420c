"""Unsteady friction as the step halves: `python benchmarks/unsteady_friction.py`.

A valve closes at the end of the 914 m main of cases/valve-closure.toml (Reynolds 131 000), in 50 ms and at once.
By Joukowsky's jump and the friction head, the head at the gate rises to 326 ft; unsteady friction may add 1 %. The
peers are rthym-moc 0.4.1 with unsteady friction and its defaults (usf_tau 0.5 s, Vardy-Brown coefficient; its closure
is a demand that ends), and TSNet 0.3.1 with friction "unsteady"; a peer that is not installed is skipped. All programs
use the same step. The tables give the head of the first plateau, 1 s after the closure, and the greatest head over 9 s
from the closure on.
"""

import contextlib
import io
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
import peer_moc
from measure import agree, parser, peer_module

import fvsolve

FOOT = 0.3048
BOUND = 326.0  # [ft]
CASE = Path(__file__).parent.parent / "cases" / "valve-closure.toml"
REACHES = (26, 50, 100, 200, 400)
TSNET = peer_module("tsnet", "tsnet")
END, SHUT = 10.0, 1.0  # [s]


@dataclass
class Main:
    """Main of the case in SI units, with the attributes that `peer_moc` reads."""

    length: float = 914.4
    diameter: float = 0.3048
    wave_speed: float = 1219.2
    head: float = 45.72
    flow: float = 0.031555
    factor: float = 0.02111
    duration: float = 0.05


def by_fvsolve(reaches, duration):
    """Times from the closure [s], heads at the gate [ft] and CPU time [s] of fvsolve."""
    keys = {
        "links.main.cells": reaches,
        "links.main.friction": {"model": "unsteady", "roughness": "0.26 mm"},
        "links.valve.opening": {"start": SHUT, "duration": duration, "value": [1.0, 0.0]},
    }
    begin = process_time()
    run = fvsolve.run(CASE, keys)
    return run.t - SHUT, np.asarray(run["gate.head"]) / FOOT, process_time() - begin


def by_rthym(reaches, duration):
    """Times from the closure [s], heads at the gate [ft] and CPU time [s] of rthym-moc.

    The demand ends at the start.
    """
    begin, step = process_time(), Main.length / Main.wave_speed / reaches
    trace = peer_moc.uniform_pipe(
        Main(duration=max(duration, step)),
        reaches,
        int(9.0 * 1219.2 / 914.4 * reaches),
        friction=(0.5, -1.0),
    )
    return trace.time, trace.head / FOOT, process_time() - begin


def numbers(solve):
    """Function of TSNet with arrays of one element converted to numbers, which numpy 2 does not do by itself."""

    def wrapped(*given):
        return tuple(float(np.ravel(one)[0]) for one in solve(*given))

    return wrapped


def stepped(tm, reaches):
    """Set the step of a TSNet model, because its own `set_time` leaves arrays of one element."""
    for _, pipe in tm.pipes():
        pipe.number_of_segments = reaches // 2
    tm.simulation_period, tm.time_step = END, Main.length / Main.wave_speed / reaches


def by_tsnet(reaches, duration):
    """Times from the closure [s], heads at the gate [ft] and CPU time [s] of TSNet.

    The main is in two halves, because TSNet does not support a single pipe.
    """
    import tsnet
    import wntr
    from tsnet.simulation import single, solver

    single.add_leakage = numbers(solver.add_leakage)
    main = Main()
    net = wntr.network.WaterNetworkModel()
    net.add_reservoir("lake", base_head=main.head)
    net.add_reservoir("out", base_head=0.0)
    net.add_junction("gate", elevation=0.0)
    loss = main.head - 45.116  # by Hazen and Williams, h = 10.67 L q^1.852 / (C^1.852 D^4.8704)
    c = (10.67 * main.length * main.flow**1.852 / (loss * main.diameter**4.8704)) ** (1.0 / 1.852)
    net.add_junction("middle", elevation=0.0)
    for name, ends in (("upper", ("lake", "middle")), ("lower", ("middle", "gate"))):
        net.add_pipe(name, *ends, main.length / 2, main.diameter, roughness=c)
    speed = main.flow / (np.pi / 4 * main.diameter**2)
    net.add_valve("valve", "gate", "out", main.diameter, "TCV", 0.0, 45.116 * 2 * 9.81 / speed**2)
    net.options.time.duration = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        path = str(Path(folder) / "main.inp")
        wntr.network.write_inpfile(net, path)
        begin = process_time()
        tm = tsnet.network.TransientModel(path)
        tm.set_wavespeed(main.wave_speed)
        stepped(tm, reaches)
        tm.valve_closure("valve", [max(duration, tm.time_step), SHUT, 0, 1])
        tm = tsnet.simulation.Initializer(tm, 0, "DD")
        tm = tsnet.simulation.MOCSimulator(tm, str(Path(folder) / "results"), "unsteady")
        busy = process_time() - begin
    return (
        np.asarray(tm.simulation_timestamps) - SHUT,
        np.asarray(tm.get_node("gate").head) / FOOT,
        busy,
    )


def table(duration):
    """Print the results of all programs for a closure."""
    print("peer       reaches  plateau  change  greatest  over 326 ft  CPU [s]")
    peers = (("rthym-moc", by_rthym),) * bool(peer_moc.rthym_moc) + (("TSNet", by_tsnet),) * bool(
        TSNET
    )
    for name, solve in (("fvsolve", by_fvsolve), *peers):
        before = None
        for reaches in REACHES[:4] if name == "TSNet" else REACHES:
            t, head, cpu = solve(reaches, duration)
            plateau = float(np.interp(1.0, t, head))
            change = "" if before is None else f"{plateau - before:+.3f}"
            more = 100.0 * (head.max() / BOUND - 1.0)
            print(
                f"{name:10s} {reaches:7d}  {plateau:7.2f} {change:>7s}  {head.max():8.1f}  {more:9.1f} %  {cpu:7.2f}"
            )
            if name != "rthym-moc":  # its plateau is far above
                agree(f"plateau of {name} beside {BOUND:g} ft", abs(plateau / BOUND - 1.0), 0.02)
            before = plateau


def main():
    """Print both tables."""
    global REACHES
    if parser(__doc__).parse_args().quick:
        REACHES = (26, 50)
    for words, duration in (("in 50 ms", 0.05), ("at once (peers: within one step)", 0.0)):
        print(
            f"The valve shuts {words}: head at the gate of the 914 m main [ft]; Joukowsky and friction head: 326"
        )
        table(duration)


if __name__ == "__main__":
    main()
