"""Stiff scenes beside their peers, in one process: `python benchmarks/stiff.py [TABLE]...`, of these:

cylinder: error of a trajectory against wall time, tolerances 1e-3 to 1e-10; also drawn, into stiff.png.
pipe:     acoustics of 1 000 cells, explicit and implicit, beside peers on the same ordinary differential equations.
network:  what a step of Newton's method costs in networks of 1 000 and 10 000 cells.
start:    what the first implicit run of a machine, and every later one, takes longer than an explicit run.
auto:     CPU time of `auto` at equal error beside the best single method, in six cases; no peer is wanted.

`--quick` for few tolerances, methods and repeats, without `start`, which stiff_start.py has. One thread. Wall times are
the best of several, everything compiled before.
"""

from importlib import import_module

from measure import machine, parser

TABLES = ("cylinder", "pipe", "network", "start", "auto")  # each of a module, which imports its peers


def main() -> None:
    """Print the tables asked for."""
    options = parser(__doc__)
    options.add_argument("what", nargs="*", help=f"{', '.join(TABLES)}; all if none is named, by --quick all but start")
    given = options.parse_args()
    print(machine("numpy", "numba", "scipy", "numbalsoda", "scikit-sundae"))
    for name in given.what or [name for name in TABLES if name != "start" or not given.quick]:
        getattr(import_module(f"stiff_{name}"), f"{name}_table")(given.quick)


if __name__ == "__main__":
    main()
