"""First runs of each physics, as whole processes; what a scene without basins compiles; memory per cell.

This file runs itself, `python benchmarks/planes_start.py KIND CELLS FOLDER`. Cold is the first run in an empty cache;
`after` the first run in a cache where a scene of two tanks has been, which has neither basins nor pipes; warm every run
from then on. `compile` is cold less warm, `own` after less warm.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from planes_scenes import BASINS, of_triangles, scene, square
from start_up import seconds

CASES = Path(__file__).resolve().parent.parent / "cases"
GOAL = 10.0  # [s] that compiling a physics adds
KINDS = {
    "transport": ("advection", {}),
    "transport, weno5": ("advection", {"scheme": "weno5"}),
    "free surface": ("free surface with bed", {}),
    "liquid": ("liquid", {}),
    "free surface, triangles": ("free surface with bed", {}),
}
SMALL, LARGE = 8, 512  # cells along a side


def case(kind: str, cells: int, folder: Path) -> dict:
    """A scene of a kind that ends after a step or two."""
    basin, numerics = KINDS[kind]
    shape = of_triangles(folder / f"{cells}.msh", cells) if "triangles" in kind else square(cells)
    return scene(shape | BASINS[basin], 1e-5, **numerics)


def start_table(quick: bool) -> None:
    """Times of first and later runs; what a cache holds after a scene of a pipe; bytes per cell."""
    print("\nStart-up, whole processes, wall (CPU) [s]")
    print(f"| physics | cold | after | warm | compile | own, goal {GOAL:g} |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="fvsolve-planes-") as name:
        folder = Path(name)
        run = [sys.executable, "-m", "fvsolve", "run", "--force", "--out", str(folder / "out")]
        spent([*run, str(CASES / "two-tanks.toml")], folder / "tanks")
        for k, kind in enumerate(KINDS):
            command, colds, afters = [sys.executable, __file__, kind, str(SMALL), name], [], []
            for i in range(1 if quick else 3):
                shutil.copytree(folder / "tanks", folder / f"{k}-{i}-after")
                colds.append(spent(command, folder / f"{k}-{i}"))
                afters.append(spent(command, folder / f"{k}-{i}-after"))
            cold, after, warm = min(colds), min(afters), min(spent(command, folder / f"{k}-0") for _ in range(3))
            times = " | ".join(f"{wall:.1f} ({cpu:.1f})" for wall, cpu in (cold, after, warm))
            whole, own = (f"{one[0] - warm[0]:.1f} ({one[1] - warm[1]:.1f})" for one in (cold, after))
            verdict = "met" if after[0] - warm[0] < GOAL else "missed"
            print(f"| {kind} | {times} | {whole} | {own}, {verdict} |", flush=True)
        spent([*run, str(CASES / "valve-closure.toml")], folder / "pipe")
        files = list((folder / "pipe").rglob("*.nbi"))
        strays = sorted({path.name.split("-")[0] for path in files if path.parent.name.startswith("plane_")})
        print(f"\nOf {len(files)} functions that a scene of one pipe compiles, of the plane: {strays or 'none'}")
        print("Threads: there are none yet.\n\nMemory [bytes per cell]")
        for kind in KINDS:
            cells = LARGE // 2 if "triangles" in kind else LARGE
            command = [sys.executable, __file__, kind, str(cells), name]
            for _ in range(1 + ("triangles" in kind)):  # making these takes more memory than running on them
                told = subprocess.run(command, check=True, capture_output=True, text=True)
            print(f"  {kind}: {told.stdout.strip()}", flush=True)


def spent(command: list[str], cache: Path) -> tuple[float, float]:
    """(wall, CPU) time of a process and those it starts [s]."""

    def busy() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before = busy()
    return seconds(command, cache), busy() - before


def memory(kind: str, cells: int, folder: Path) -> str:
    """A run's arrays and the peak of its process beyond a small run's, per cell."""
    import fvsolve
    from fvsolve.solve.loop import Loop

    def arrays(owner) -> int:
        return sum(one.nbytes for one in owner if hasattr(one, "nbytes"))

    def peak() -> int:
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    fvsolve.run(case(kind, SMALL, folder))
    before, given = peak(), case(kind, cells, folder)
    model = fvsolve.build(fvsolve.load(given))
    n, state = model.basins[0].mesh.area.size, fvsolve.initial_state(model)
    loop = Loop(model)
    fvsolve.advance(model, state, 1e-5)
    held = arrays(model.tables), arrays(loop.slate.written) + arrays(vars(loop.stepper).values())
    return f"tables {held[0] / n:.0f}, loop {held[1] / n:.0f}, peak of the process {(peak() - before) / n:.0f}"


if __name__ == "__main__":
    print(memory(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])))
