"""Stiff scenes compared with other solvers, in one process: `python benchmarks/stiff.py [TABLE]...`.

cylinder: error of a trajectory against wall time, tolerances 1e-3 to 1e-10; also drawn, in stiff.png.
pipe:     acoustics of 1 000 cells, explicit and implicit, and peers on the same ordinary differential equations.
network:  cost of a step of Newton's method in networks of 1 000 and 10 000 cells.
start:    additional time of the first implicit run of a machine, and of later ones, over an explicit run.
auto:     CPU time of `auto` at equal error over the best single method, in six cases, without peers.

`--quick` uses few tolerances, methods and repeats, without `start`, which stiff_start.py contains. One thread. Wall
times are the best of several, everything compiled before.
"""

from importlib import import_module

from measure import machine, parser

# each table has a module, which imports its peers
TABLES = ("cylinder", "pipe", "network", "start", "auto")


def main() -> None:
    """Print the selected tables."""
    options = parser(__doc__)
    options.add_argument(
        "what",
        nargs="*",
        help=f"tables: {', '.join(TABLES)} (default all, with --quick all but start)",
    )
    given = options.parse_args()
    print(machine("numpy", "numba", "scipy", "numbalsoda", "scikit-sundae"))
    for name in given.what or [name for name in TABLES if name != "start" or not given.quick]:
        getattr(import_module(f"stiff_{name}"), f"{name}_table")(given.quick)


if __name__ == "__main__":
    main()
