"""fvsolve compared with rthym-moc 0.4.1: `python benchmarks/peers_water_hammer.py [rate] [three] [nine]`.

rate:         one uniform pipe with friction, Courant 1: node-steps per second.
three, nine:  networks whose lengths have no common step: CPU time against error of the heads (exact.py).

CPU time is the best of several: of the stepping alone for fvsolve (from its summary), of the solve call for rthym-moc;
`whole` is that of the whole call fvsolve.run(dict) after compilation. One thread. `error` is the difference from the
exact heads at gate and junction over the run, in Joukowsky jumps: the greatest for the smooth closure, the mean for
ramp and instant closure.
"""

from dataclasses import dataclass, replace
from time import perf_counter, process_time

import networks
import numpy as np
import peer_moc
from exact import exact_heads, impulse_response
from measure import agree, machine, parser
from price import price

import fvsolve

EVERY = 0.02  # interval of the compared rows [s]
RATES = ((100, 500_000), (1_000, 100_000), (10_000, 40_000))  # nodes, steps
REPEATS, CLOSURES = 7, networks.CLOSURES
GOALS = {
    "smooth": ((1e-3, 500), (1e-4, 10_000)),
    "ramp": ((1e-3, 2), (1e-4, 500)),
    "instant": ((1e-2, 1), (3e-3, 1)),
}
PEER_STEPS = {"three": 8e-3 / 2.0 ** np.arange(8), "nine": 8e-3 / 2.0 ** np.arange(7)}  # [s]
UPWIND5 = dict(scheme="upwind5", method="rk4", courant=0.9)
UPWIND = dict(scheme="upwind", method="euler", courant=1.0)
MUSCL = dict(scheme="muscl", limiter="van-leer", method="ssp-rk3", courant=0.9)
DELAY = [
    dict(pipe_model="delay-line", method="euler", courant=1.0, delay_tolerance=share)
    for share in (1e-2, 2e-2, 5e-2)
]
SCHEMES = {  # closure: (numerics, cell times [s]), the best pair and one for comparison
    "smooth": ((UPWIND5, 0.04 / 2 ** (0.5 * np.arange(8))), (UPWIND, 0.01 / 2.0 ** np.arange(5))),
    "ramp": ((UPWIND, 0.01 / 2.0 ** np.arange(6)), (UPWIND5, 0.02 / 2.0 ** np.arange(5))),
    "instant": ((UPWIND, 0.01 / 2.0 ** np.arange(6)), (MUSCL, 0.02 / 2.0 ** np.arange(5))),
}
LINES = 0.16 / 2.0 ** np.arange(6)  # steps of delay lines [s]
for closure in SCHEMES:
    SCHEMES[closure] += tuple(
        (numerics, LINES) for numerics in (DELAY if closure == "instant" else DELAY[:1])
    )


@dataclass
class Run:
    """Run of a program: cell time or step [s], cells, CPU time [s], greatest and mean error, whole call [s]."""

    size: float
    cells: int
    cpu: float
    greatest: float
    mean: float
    whole: float = np.nan


def solved(case, repeats):
    """Fastest of `repeats` runs of a case: result, CPU time of its stepping and of the whole call [s]."""
    best, cpu, whole = None, np.inf, np.inf
    for _ in range(repeats):
        wall, busy = perf_counter(), process_time()
        result = fvsolve.run(case)
        wall, busy = perf_counter() - wall, process_time() - busy
        # not `ok`: with friction upwind grows at Courant 1, at an equal rate
        if result.reason != "finished":
            raise SystemExit(f"{case['title']}: {result.reason}")
        whole = min(whole, busy)
        # without the time of other processes on this core
        stepping = result.summary["seconds"] * min(1.0, busy / wall)
        if stepping < cpu:
            best, cpu = result, stepping
    return best, cpu, whole


def by_cells(network, closure, response, cell_time, **numerics):
    """Run of fvsolve with cells, or with steps of delay lines, of `cell_time` [s]."""
    case = networks.case(network, closure, cell_time, EVERY, **numerics)
    result, cpu, whole = solved(case, REPEATS if cell_time > 1e-3 else 3)
    last = np.append(np.diff(result.t) > 0, True)  # the row after a jump
    exact = exact_heads(network, closure, result.t[last], response)
    found = (
        np.array([np.abs(result[f"{p}.head"][last] - exact[p]) for p in network.probes])
        / network.jump
    )
    return Run(cell_time, result.summary["cells"], cpu, found.max(), found.mean(), whole)


def by_characteristics(network, closure, response, dt):
    """Run of rthym-moc with steps of dt [s]."""
    cpu, times, heads = peer_moc.heads(
        network, closure, dt, repeats=min(5, REPEATS) if dt > 4e-4 else 1
    )
    stride = max(1, round(EVERY / dt))
    exact = exact_heads(network, closure, times[stride - 1 :: stride], response)
    found = (
        np.array([np.abs(heads[p][stride - 1 :: stride] - exact[p]) for p in network.probes])
        / network.jump
    )
    cells = sum(max(1, round(p.travel / dt)) for p in network.pipes)
    return Run(dt, cells, cpu, found.max(), found.mean())


def fitting_step(network, dt):
    """Step within a factor sqrt(2) of dt that changes the wave speeds least [s]."""
    steps = np.geomspace(dt / 2**0.5, dt * 2**0.5, 20_001)
    travel = np.array([p.travel for p in network.pipes])[:, None]
    bend = np.abs(np.maximum(1, np.round(travel / steps)) * steps / travel - 1).max(axis=0)
    return steps[bend.argmin()]


def table(title, runs, unit):
    """Print the runs of one program."""
    print(f"  {title}")
    print(f"    {unit:>11} {'cells':>7} {'CPU ms':>10} {'greatest':>9} {'mean':>9} {'whole ms':>9}")
    for r in runs:
        whole = f"{r.whole * 1e3:9.1f}" if np.isfinite(r.whole) else " " * 9
        row = f"{r.size * 1e3:8.4f} ms {r.cells:7d} {r.cpu * 1e3:10.2f} {r.greatest:9.1e} {r.mean:9.1e} {whole}"
        print(f"    {row}")


def verdict(name, own, peer):
    """Print the costs at the errors of the goals, and their ratio; own, peer: (runs halved, runs picked to fit)."""

    def error(r):
        return r.greatest if name == "smooth" else r.mean

    for target, goal in GOALS[name]:
        print(f"  error {target:.0e}, goal {goal}:")
        for title, ours, theirs in zip(("halved", "picked to fit"), own, peer, strict=True):
            (a, how), (b, mark) = (
                price([(r.cpu, error(r)) for r in runs], target) for runs in (ours, theirs)
            )
            row = (
                f"fvsolve {how or ' '}{a * 1e3:9.2f} ms, rthym-moc {mark or ' '}{b * 1e3:11.1f} ms"
            )
            print(f"    {title:>13}: {row}, {b / a:9.1f} times less")


def network_table(network):
    """Print the runs of both programs for all closures of one network."""
    response = impulse_response(network)
    paths = ", ".join(f"{len(w)} pulses at {p}" for p, (_, w) in response.items())
    print(f"\n{network.name} pipes, {network.end} s; exact: {paths}; jump {network.jump:.3f} m")
    peer = peer_moc.rthym_moc is not None
    if peer:
        agreement(network)
    for name, closure in CLOSURES.items():
        print(f"\n {network.name} pipes, {name} closure")
        theirs, ours = [[], []], [[], []]
        for k, title in enumerate(
            ("halved", f"picked within a factor {2**0.5:.1f} to fit the pipes best")
        ):
            steps = [fitting_step(network, t) if k else t for t in PEER_STEPS[network.name] if peer]
            theirs[k] = [
                by_characteristics(network, closure, response, t) for t in dict.fromkeys(steps)
            ]
            if peer:
                table(f"rthym-moc, steps {title}", theirs[k], "step")
            for numerics, times in SCHEMES[name]:
                sizes = [fitting_step(network, t) if k else t for t in times]
                runs = [
                    by_cells(network, closure, response, t, **numerics)
                    for t in dict.fromkeys(sizes)
                ]
                table(
                    f"fvsolve, {' '.join(map(str, numerics.values()))}, cells {title}",
                    runs,
                    "cell time",
                )
                ours[k] += runs
        agree("least of the mean errors [jumps]", min(run.mean for run in sum(ours, [])), 0.02)
        if peer:
            verdict(name, ours, theirs)


def agreement(network, dt=1e-3):
    """Print the difference of rthym-moc from the exact heads where every pipe has a whole number of steps."""
    pipes = (replace(p, length=round(p.travel / dt) * dt * p.wave_speed) for p in network.pipes)
    whole = replace(network, pipes=tuple(pipes))
    worst = max(
        by_characteristics(whole, networks.CLOSURES[name], impulse_response(whole), dt).greatest
        for name in ("smooth", "ramp")
    )
    print(
        f"  where every length is a whole number of steps, rthym-moc and exact.py differ by {worst:.1e} jumps"
    )
    agree("rthym-moc beside exact.py [jumps]", worst, 1e-3)


def rate_table():
    """Print the node-steps per second of both programs on one pipe with friction at Courant 1."""
    print("\nOne pipe with friction, Courant 1, unsteady friction off")
    print(
        f"  {'nodes':>6} {'steps':>8} {'rthym-moc':>12} {'fvsolve':>12} {'factor':>7} {'difference':>11}"
    )
    for nodes, steps in RATES if peer_moc.rthym_moc else ():
        peer = peer_moc.uniform_pipe(networks.UNIFORM, nodes, steps, repeats=3)
        case = networks.uniform_case(networks.UNIFORM, nodes, steps)
        result, cpu, _ = solved(case, 3)
        last = np.append(np.diff(result.t) > 0, True)
        other = np.interp(result.t[last], peer.time, peer.head)
        apart = np.abs(result["gate.head"][last] - other)[1:].mean() / networks.UNIFORM.jump
        theirs, ours = nodes * steps / peer.cpu, nodes * result.summary["steps"] / cpu
        row = f"{nodes:6d} {steps:8d} {theirs / 1e6:8.0f} M/s {ours / 1e6:8.0f} M/s {ours / theirs:7.2f}"
        print(f"  {row} {apart:11.1e}")
        agree("difference of the heads [jumps]", apart, 0.02)
    print(
        "  goal: 3 times from 1 000 nodes up. difference: mean of the heads at the gate, in jumps."
    )


def main():
    """Print the selected tables."""
    global RATES, REPEATS, CLOSURES, PEER_STEPS, SCHEMES
    options = parser(__doc__)
    options.add_argument(
        "what",
        nargs="*",
        help="tables: rate, three, nine (default all, with --quick rate and three)",
    )
    given = options.parse_args()
    what = given.what or ["rate", "three", "nine"][: 2 if given.quick else None]
    if given.quick:
        RATES, REPEATS, CLOSURES = ((100, 2_000),), 1, {"smooth": CLOSURES["smooth"]}
        PEER_STEPS = {name: steps[1:3] for name, steps in PEER_STEPS.items()}
        SCHEMES = {
            name: [(numerics, times[1:3]) for numerics, times in rows]
            for name, rows in SCHEMES.items()
        }
    print(machine("numpy", "numba", "rthym-moc"))
    if "rate" in what:
        rate_table()
    if "three" in what:
        network_table(networks.THREE)
    if "nine" in what:
        network_table(networks.NINE)


if __name__ == "__main__":
    main()
