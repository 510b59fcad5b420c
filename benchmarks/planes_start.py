"""First runs of each physics, as whole processes; functions that a scene without basins compiles; memory per cell.

    python benchmarks/planes_start.py [--quick]

This file also starts itself, with `--memory KIND CELLS FOLDER`. `cold` is the first run with an empty cache. `after` is
the first run after that of a scene of two tanks, which has neither basins nor pipes, with the same cache. `warm` is any
later run. `compile` is cold less warm, `own` after less warm. With `--quick` all runs use the user's own cache.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import machine, parser
from planes_scenes import BASINS, of_triangles, scene, square
from start_up import cache, seconds

CASES = Path(__file__).resolve().parent.parent / "cases"
GOAL = 10.0  # additional time to compile a physics [s]
KINDS = {
    "transport": ("advection", {}),
    "transport, weno5": ("advection", {"scheme": "weno5"}),
    "free surface": ("free surface with bed", {}),
    "liquid": ("liquid", {}),
    "free surface, triangles": ("free surface with bed", {}),
}
SMALL, LARGE = 8, 512  # cells along a side


def case(kind: str, cells: int, folder: Path) -> dict:
    """Case of a kind that ends after one or two steps."""
    basin, numerics = KINDS[kind]
    shape = of_triangles(folder / f"{cells}.msh", cells) if "triangles" in kind else square(cells)
    return scene(shape | BASINS[basin], 1e-5, **numerics)


def start_table(quick: bool) -> None:
    """Print times of first and later runs, functions in the cache after a scene of a pipe, and bytes per cell."""
    print("\nStart-up, whole processes, wall (CPU) [s]")
    print(
        f"| physics | cold | after | warm | compile | own, goal {GOAL:g} |\n|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory(prefix="fvsolve-planes-") as name:
        folder = Path(name)
        run = [sys.executable, "-m", "fvsolve", "run", "--force", "--out", str(folder / "out")]
        if not quick:
            spent([*run, str(CASES / "two-tanks.toml")], folder / "tanks")
        kinds = ("free surface",) if quick else KINDS
        for k, kind in enumerate(kinds):
            command, colds, afters = (
                [sys.executable, __file__, "--memory", kind, str(SMALL), name],
                [],
                [],
            )
            for i in range(1 if quick else 3):
                colds.append(spent(command, cache(folder / f"{k}-{i}", quick)))
                if not quick:
                    shutil.copytree(folder / "tanks", folder / f"{k}-{i}-after")
                    afters.append(spent(command, folder / f"{k}-{i}-after"))
            warm = min(
                spent(command, cache(folder / f"{k}-0", quick)) for _ in range(1 if quick else 3)
            )
            cold, after = min(colds), min(afters or colds)
            times = " | ".join(f"{wall:.1f} ({cpu:.1f})" for wall, cpu in (cold, after, warm))
            whole, own = (
                f"{one[0] - warm[0]:.1f} ({one[1] - warm[1]:.1f})" for one in (cold, after)
            )
            verdict = "met" if after[0] - warm[0] < GOAL else "missed"
            print(f"| {kind} | {times} | {whole} | {own}, {verdict} |", flush=True)
        if not quick:
            spent([*run, str(CASES / "valve-closure.toml")], folder / "pipe")
            files = list((folder / "pipe").rglob("*.nbi"))
            strays = sorted(
                {path.name.split("-")[0] for path in files if path.parent.name.startswith("plane_")}
            )
            print(
                f"\nOf {len(files)} functions that a scene of one pipe compiles, of the plane: {strays or 'none'}"
            )
        print("\nMemory [bytes per cell]")
        for kind in kinds:
            cells = (2 * SMALL if quick else LARGE) // (2 if "triangles" in kind else 1)
            command = [sys.executable, __file__, "--memory", kind, str(cells), name]
            # a mesh needs more memory to make than to run
            for _ in range(1 + ("triangles" in kind)):
                told = subprocess.run(command, check=True, capture_output=True, text=True)
            print(f"  {kind}: {told.stdout.strip()}", flush=True)


def spent(command: list[str], cache: Path) -> tuple[float, float]:
    """Wall and CPU time of a process with its child processes [s]."""

    def busy() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before = busy()
    return seconds(command, cache), busy() - before


def memory(kind: str, cells: int, folder: Path) -> str:
    """Bytes per cell of the tables, of the time loop, and of the peak of the process above a small run, as text."""
    import fvsolve
    from fvsolve.core.solve.run_loop import RunLoop

    def arrays(owner) -> int:
        return sum(one.nbytes for one in owner if hasattr(one, "nbytes"))

    def peak() -> int:
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    fvsolve.run(case(kind, SMALL, folder))
    before, given = peak(), case(kind, cells, folder)
    model = fvsolve.build(fvsolve.load(given))
    n, state = model.meshed[0].mesh.area.size, fvsolve.initial_state(model)
    loop = RunLoop(model)
    fvsolve.advance(model, state, 1e-5)
    held = arrays(model.tables), arrays(loop.run_data.written) + arrays(vars(loop.stepper).values())
    return f"tables {held[0] / n:.0f}, loop {held[1] / n:.0f}, peak of the process {(peak() - before) / n:.0f}"


def main() -> None:
    """Print the tables, or the memory of one run."""
    options = parser(__doc__)
    options.add_argument(
        "--memory",
        nargs=3,
        metavar=("KIND", "CELLS", "FOLDER"),
        help="one run, whose memory is printed",
    )
    given = options.parse_args()
    if given.memory:
        kind, cells, folder = given.memory
        print(memory(kind, int(cells), Path(folder)))
    else:
        print(machine("fvsolve", "numba"))
        start_table(given.quick)


if __name__ == "__main__":
    main()
