"""Rates of chains of bodies beside pinocchio's forward dynamics, and what the room of mechanisms compiles.

python benchmarks/mechanisms.py            microseconds a call and their ratio, best of several
python benchmarks/mechanisms.py --compile  seconds that a first pendulum compiles, in an empty cache
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
SIZES, CALLS, ROUNDS = (1, 3, 6, 12, 30), 2000, 15
WHOLE = "import fvsolve; m = fvsolve.build(fvsolve.load({case!r})); m.rhs(0.0, m.start)"


def chain(many: int) -> dict:
    """Revolute joints about random axes, each body on the one before."""
    from truth.trees import random_tree

    found = random_tree(np.random.default_rng(many), many, "revolute", kinds=("revolute",))
    for k in range(1, many):
        found[f"b{k}"]["joint"]["on"] = f"b{k - 1}"
    return found


def best(call) -> float:
    """Least CPU time of a call [us]."""
    found = []
    for _ in range(ROUNDS):
        began = process_time()
        for _ in range(CALLS):
            call()
        found.append((process_time() - began) / CALLS * 1e6)
    return min(found)


def rates(bodies: dict):
    """A call of the compiled rates of a chain, as a stepper makes it."""
    from truth.bodies import bodies as scene_of

    import fvsolve
    from fvsolve.jit import njit

    model = fvsolve.build(fvsolve.load(scene_of(bodies, 1.0)))
    y, dydt, out = model.start.copy(), np.zeros(model.y_size), model.new_out()
    with model.slate() as slate:
        slate.evaluate(0.0, y, np.inf)
        handle, rhs = slate.handle, model.functions.rhs

    @njit(cache=False)
    def many(calls, y, dydt, out, handle):
        for _ in range(calls):
            rhs(0.0, y, dydt, out, handle)

    return slate, lambda: rhs(0.0, y, dydt, out, handle), lambda calls: many(calls, y, dydt, out, handle)


def speed() -> None:
    from truth.trees import pinocchio_of

    print(f"{'bodies':>6} {'rates in a loop':>16} {'from Python':>12} {'pin.aba from Python':>20} {'ratio':>6}  [us]")
    for many in SIZES:
        bodies = chain(many)
        slate, call, loop = rates(bodies)
        pin, peer, data, q, v, _ = pinocchio_of(bodies, 9.80665)
        tau = np.zeros(peer.nv)
        loop(10)
        inside = []
        for _ in range(ROUNDS):
            began = process_time()
            loop(CALLS)
            inside.append((process_time() - began) / CALLS * 1e6)
        own, peers = min(inside), best(lambda: pin.aba(peer, data, q, v, tau))  # noqa: B023
        print(f"{many:6d} {own:16.2f} {best(call):12.2f} {peers:20.2f} {own / peers:6.2f}")


def compiling() -> None:
    """A pendulum in an empty cache, beside a scene of two masses there."""
    from truth.bodies import bodies, pendulum
    from truth.scenes import scene

    masses = scene({"a": {"type": "mass", "mass": 1.0}, "b": {"type": "frame"}},
                   {"s": {"type": "spring", "from": "b", "to": "a", "stiffness": 1.0}}, 1.0, {})  # fmt: skip
    for name, case in (("two masses", masses), ("a pendulum", bodies({"arm": pendulum()}, 1.0))):
        with tempfile.TemporaryDirectory() as folder:
            began = perf_counter()
            subprocess.run([sys.executable, "-c", WHOLE.format(case=case)], check=True,
                           env=os.environ | {"FVSOLVE_CACHE": folder})  # fmt: skip
            print(f"{name}: {perf_counter() - began:.1f} s from an empty cache to the first rates")


if __name__ == "__main__":
    compiling() if "--compile" in sys.argv else speed()
