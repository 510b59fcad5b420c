"""Additional time of an implicit run over an explicit run of the same scene, as whole processes.

    python benchmarks/stiff_start.py [--quick]

This file also starts itself, with `--run KIND METHOD`. `cold` is the first run with an empty cache. `after` is the
first implicit run after the explicit one, with the same cache. `warm` is any later run. With `--quick` all runs use the
user's own cache.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from measure import machine, parser
from networks import WATER
from start_up import cache

EXPLICIT, IMPLICIT = "ssp-rk3", ("radau-iia-5", "esdirk-4")
GOALS = {"cold": 8.0, "warm": 0.8}  # in addition to the explicit run [s]
# linear algebra -> (pipes, cells of each)
SCENES = {"dense": (1, 5), "banded": (1, 60), "sparse": (3, 30)}
ROOMS = ("irk", "dirk", "newton", "linear_", "structure", "auto")  # of implicit steps


def scene(kind: str, method: str) -> dict:
    """Case of pipes from a lake to one gate, which closes."""
    pipes, cells = SCENES[kind]
    links = {
        f"p{i}": {
            "type": "pipe",
            "from": "lake",
            "to": "gate",
            "length": 100.0 + i,
            "diameter": 0.3,
            "wave_speed": 1000.0,
            "friction": {"model": "none"},
            "cells": cells,
        }
        for i in range(pipes)
    }
    demand = {"start": 0.1, "duration": 0.1, "value": [0.01, 0.0]}
    nodes = {
        "lake": {"type": "reservoir", "head": 50.0},
        "gate": {"type": "junction", "demand": demand},
    }
    numerics = {"end": 0.3, "scheme": "upwind", "method": method, "courant": 0.9}
    output = {"fields": 0, "probes": ["gate.pressure"]}
    made = {"schema": 1, "title": kind, "fluid": dict(WATER), "nodes": nodes, "links": links}
    return made | {"numerics": numerics, "output": output}


def start_table(quick: bool) -> None:
    """Print wall times of first and later runs, and functions of implicit steps in the cache after explicit runs."""
    print("\nStart-up, whole processes [s]; more: beyond the explicit run of the same scene")
    print(
        f"  {'scene':8} {'method':12} {'cold':>6} {'more':>6} {'after':>6} {'more':>6} {'warm':>6} {'more':>6}"
    )
    worst = {"cold": 0.0, "warm": 0.0}
    with tempfile.TemporaryDirectory(prefix="fvsolve-stiff-") as folder:
        for kind in ["sparse"] if quick else SCENES:
            own = cache(Path(folder) / kind, quick)
            base, first = first_and_later(own, kind, EXPLICIT, quick)
            print(
                f"  {kind:8} {EXPLICIT:12} {first:6.2f} {'':6} {'':6} {'':6} {base:6.2f}",
                flush=True,
            )
            if not quick:
                print(
                    f"    functions of implicit steps compiled: {', '.join(compiled_rooms(own)) or 'nothing'}"
                )
            for method in IMPLICIT[: 1 if quick else None]:
                cold = seconds(kind, method, cache(Path(folder) / f"{kind}-{method}", quick))
                warm, after = first_and_later(own, kind, method, quick)
                more = {"cold": cold - first, "after": after - base, "warm": warm - base}
                cells = (
                    f"{cold:6.2f} {more['cold']:6.2f} {after:6.2f} {more['after']:6.2f} "
                    f"{warm:6.2f} {more['warm']:6.2f}"
                )
                print(f"  {kind:8} {method:12} {cells}", flush=True)
                worst = {name: max(worst[name], more[name]) for name in worst}
    for name, most in GOALS.items():
        print(
            f"  {name}: {worst[name]:.2f} s more at worst, goal {most:g}: {'met' if worst[name] <= most else 'missed'}"
        )


def first_and_later(cache: Path, kind: str, method: str, quick: bool) -> tuple[float, float]:
    """Least wall time of later runs, and wall time of the first run, of one scene with one cache [s].

    With `quick` both are that of the first run.
    """
    first = seconds(kind, method, cache)
    return min(
        (seconds(kind, method, cache) for _ in range(0 if quick else 5)), default=first
    ), first


def seconds(kind: str, method: str, cache: Path) -> float:
    """Wall time of one process [s]."""
    import start_up

    return start_up.seconds([sys.executable, __file__, "--run", kind, method], cache)


def compiled_rooms(cache: Path) -> list[str]:
    """Names of cached functions that only implicit steps need."""
    names = {path.name.split("-")[0] for path in cache.rglob("*.nbi")}
    return sorted(name for name in names if name.startswith(ROOMS))


def main() -> None:
    """Print the table, or make one run of it."""
    options = parser(__doc__)
    options.add_argument(
        "--run",
        nargs=2,
        metavar=("KIND", "METHOD"),
        help="scene and method of one run of the table",
    )
    given = options.parse_args()
    if given.run:
        import fvsolve

        found = fvsolve.run(scene(*given.run))
        sys.exit(0 if found.ok else found.reason)
    print(machine("fvsolve", "numba"))
    start_table(given.quick)


if __name__ == "__main__":
    main()
