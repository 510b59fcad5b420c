"""Bodies compared with pinocchio, MuJoCo and exudyn, and the time to compile mechanisms.

python benchmarks/mechanisms.py            the first three of these tables, smaller with --quick
python benchmarks/mechanisms.py rates      accelerations of chains compared with `pin.aba`, both called from Python [us]
python benchmarks/mechanisms.py chain      a chain by rk4 compared with MuJoCo: error and CPU time of the steps
python benchmarks/mechanisms.py arm        an arm on a cylinder compared with exudyn: CPU time at an error of 1e-5 rad
python benchmarks/mechanisms.py compile    time to compile a first pendulum with an empty cache [s]

Times are the best of several, with fvsolve and the peer in turn. Errors of chain and arm are relative to the finest run
of each solver. `python -m pip install pin mujoco exudyn` installs the peers; the table of a missing peer is left out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numba
import numpy as np
import peers_bodies
from measure import agree, machine, parser, peer_module

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
SIZES, CALLS, ROUNDS = (1, 3, 6, 12, 30), 2000, 15
STEPS, FINEST, CLOSE = (1000, 4000, 16000), 64000, 1e-5  # steps of a chain; error of the arm [rad]
ARM = {  # settings of each solver, and its finest setting
    "fvsolve, rtol": ((1e-3, 1e-4, 1e-5, 1e-6, 1e-8), 1e-12),
    "exudyn, steps": ((1000, 2000, 4000, 8000), 32000),
}
WHOLE = "import fvsolve; m = fvsolve.build(fvsolve.load({case!r})); m.rhs(0.0, m.start)"


def chain(many: int) -> dict:
    """Bodies of a chain with revolute joints about random axes, each body on the one before."""
    from reference.bodies import random_tree

    found = random_tree(np.random.default_rng(many), many, "revolute", kinds=("revolute",))
    for k in range(1, many):
        found[f"b{k}"]["joint"]["on"] = f"b{k - 1}"
    return found


def taken(call) -> float:
    """CPU time of a call [us]."""
    began = process_time()
    call()
    return (process_time() - began) * 1e6


def calls(call) -> float:
    """Mean CPU time of CALLS calls from Python [us]."""
    began = process_time()
    for _ in range(CALLS):
        call()
    return (process_time() - began) / CALLS * 1e6


def rates(bodies: dict):
    """Run data of a chain, a call of its compiled rates as a stepper makes it, a loop of such calls, and the rates."""
    from reference.bodies import bodies as scene_of

    import fvsolve
    from fvsolve.core.steppers.run_handle import addresses, call_rhs

    model = fvsolve.build(fvsolve.load(scene_of(bodies, 1.0)))
    y, dydt, out = model.start.copy(), np.zeros(model.y_size), model.new_out()
    with model.run_data() as slate:
        slate.evaluate(0.0, y, np.inf)
        handle, rhs = slate.handle, model.functions.rhs
    at = int(addresses((rhs,))[0])

    @numba.njit
    def many(calls, y, dydt, out, handle):
        for _ in range(calls):
            call_rhs(at, 0.0, y, dydt, out, handle)

    return (
        slate,
        lambda: rhs(0.0, y, dydt, out, handle),
        lambda calls: many(calls, y, dydt, out, handle),
        dydt,
    )


def beside(call, peer) -> tuple[float, float]:
    """Least times of fvsolve and of a peer, called in turn."""
    found = [(call(), peer()) for _ in range(ROUNDS)]
    return min(one for one, _ in found), min(other for _, other in found)


def speed() -> None:
    """Print the times of accelerations of chains."""
    from reference.bodies import pinocchio_of

    print(
        f"{'bodies':>6} {'in a loop':>10} {'from Python':>12} {'pin.aba from Python':>20} {'ratios (goal 0.75)':>20}"
    )
    for many in SIZES:
        bodies = chain(many)
        slate, call, loop, dydt = rates(bodies)
        pin, peer, data, q, v, _ = pinocchio_of(bodies, 9.80665)
        tau = np.zeros(peer.nv)
        loop(10)
        off = np.abs(dydt[1::2] - pin.aba(peer, data, q, v, tau)).max() / max(
            np.abs(data.ddq).max(), 10.0
        )
        agree(f"accelerations of {many} bodies beside pinocchio's", off, 1e-11)
        inside = min(taken(lambda: loop(CALLS)) for _ in range(ROUNDS)) / CALLS  # noqa: B023
        own, peers = beside(
            partial(calls, call), partial(calls, partial(pin.aba, peer, data, q, v, tau))
        )
        print(
            f"{many:6d} {inside:10.2f} {own:12.2f} {peers:20.2f} {inside / peers:13.2f} {own / peers:6.2f}"
        )


def solved(case: dict) -> tuple[np.ndarray, float]:
    """Rows of the probes of a run, and CPU time of its steps [s]."""
    import fvsolve
    from fvsolve.core.output.memory_sink import MemorySink
    from fvsolve.core.solve.solve import initial_state, solve

    model = fvsolve.build(fvsolve.load(case))
    sink = MemorySink(model)
    spent = solve(model, initial_state(model), sink).processor
    return sink.table()[:, 1:].T, spent


def chains() -> None:
    """Print errors and times of a chain, with equal numbers of steps of rk4 in both programs."""

    def own(steps):
        rows, busy = solved(peers_bodies.chain_case(steps))
        return rows[:, -1], busy

    print(
        f"{'steps':>6} {'error':>9} {'us a step':>10} {'MuJoCo error':>13} {'us a step':>10} {'ratio (goal 0.6)':>17}"
    )
    ours, theirs = own(FINEST)[0], peers_bodies.chain_in_mujoco(FINEST)[0]
    for steps in STEPS:
        mine, other = own(steps)[0], peers_bodies.chain_in_mujoco(steps)[0]
        a, b = beside(lambda: own(steps)[1], lambda: peers_bodies.chain_in_mujoco(steps)[1])  # noqa: B023
        wrong, peers = np.abs(mine - ours).max(), np.abs(other - theirs).max()
        print(
            f"{steps:6d} {wrong:9.1e} {1e6 * a / steps:10.2f} {peers:13.1e} {1e6 * b / steps:10.2f} {a / b:17.2f}"
        )
    apart = np.abs(ours - theirs).max()
    print(f"both at their finest, {FINEST} steps: angles {apart:.0e} rad apart")
    agree("angles of the chain beside MuJoCo's [rad]", apart, 1e-4)


def arms() -> None:
    """Print the CPU times of an arm on a cylinder at an error, interpolated log-log between runs."""

    def own(rtol):
        rows, busy = solved(peers_bodies.arm_case(rtol))
        return rows[0], busy

    found = [
        at_error(name, solve, *settings)
        for (name, settings), solve in zip(
            ARM.items(), (own, peers_bodies.arm_in_exudyn), strict=True
        )
    ]
    (time, angles), (other, theirs) = found
    print(
        f"at {CLOSE:g} rad {1e3 * time:.2f} and {1e3 * other:.2f} ms, ratio {time / other:.2f} (goal 0.2)"
    )
    agree(
        "angle of the arm at the end beside exudyn's",
        abs(angles[-1] - theirs[-1]) / np.ptp(angles),
        0.1,
    )


def at_error(name: str, solve, settings, finest) -> tuple[float, np.ndarray]:
    """CPU time of a solver at an error of CLOSE [s], and the angles of its finest run.

    Prints a row for each setting.
    """
    true, errors, least = solve(finest)[0], [], []
    for setting in settings:
        errors.append(np.abs(solve(setting)[0] - true).max())
        least.append(min(solve(setting)[1] for _ in range(ROUNDS)))
        print(f"{name} {setting:<8g} error {errors[-1]:.1e} rad {1e3 * least[-1]:7.2f} ms")
    good = np.argsort(errors)
    errors, least = np.log(errors)[good], np.log(least)[good]
    return float(np.exp(np.interp(np.log(CLOSE), errors, least))), true


def compiling() -> None:
    """Print the time to the first rates of two masses and of a pendulum, each with an empty cache."""
    from reference.bodies import bodies, pendulum
    from reference.scenes import scene

    masses = scene(
        {"a": {"type": "mass", "mass": 1.0}, "b": {"type": "frame"}},
        {"s": {"type": "spring", "from": "b", "to": "a", "stiffness": 1.0}},
        1.0,
        {},
    )
    for name, case in (("two masses", masses), ("a pendulum", bodies({"arm": pendulum()}, 1.0))):
        with tempfile.TemporaryDirectory() as folder:
            began = perf_counter()
            subprocess.run(
                [sys.executable, "-c", WHOLE.format(case=case)],
                check=True,
                env=os.environ | {"FVSOLVE_CACHE": folder},
            )
            print(f"{name}: {perf_counter() - began:.1f} s from an empty cache to the first rates")


TABLES = {
    "rates": (speed, "pinocchio", "pin"),
    "chain": (chains, "mujoco", "mujoco"),
    "arm": (arms, "exudyn", "exudyn"),
}


def main() -> None:
    """Print the selected tables, by default all but `compile`."""
    global SIZES, CALLS, ROUNDS, STEPS, FINEST, ARM
    options = parser(__doc__)
    options.add_argument(
        "what", nargs="*", help=f"tables: {', '.join(TABLES)}, compile (default all but compile)"
    )
    given = options.parse_args()
    if given.quick:
        SIZES, CALLS, ROUNDS, STEPS, FINEST = (6,), 100, 1, (500,), 1000
        ARM = {"fvsolve, rtol": ((1e-3, 1e-6), 1e-8), "exudyn, steps": ((500, 1000), 2000)}
    if "compile" in given.what:
        compiling()
    for name, (table, module, wheel) in TABLES.items():
        if (not given.what or name in given.what) and peer_module(module, wheel):
            print(f"\n{name}: {machine('numba', wheel)}")
            table()


if __name__ == "__main__":
    main()
