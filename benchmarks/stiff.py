"""Stiff scenes beside their peers, in one process: `python benchmarks/stiff.py [cylinder] [pipe] [network] [start]`.

cylinder: error of a trajectory against wall time, tolerances 1e-3 to 1e-10; also drawn, into stiff.png.
pipe:     acoustics of 1 000 cells, explicit and implicit, beside peers on the same ordinary differential equations.
network:  what a step of Newton's method costs in networks of 1 000 and 10 000 cells.
start:    what the first implicit run of a machine, and every later one, takes longer than an explicit run.

`--quick` for fewer tolerances and repeats. One thread. Wall times are the best of several, everything compiled before.
"""

import argparse

from measure import machine
from stiff_cylinder import cylinder_table
from stiff_network import network_table
from stiff_pipe import pipe_table
from stiff_start import start_table

TABLES = {"cylinder": cylinder_table, "pipe": pipe_table, "network": network_table, "start": start_table}


def main() -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="*", help=f"{', '.join(TABLES)}; all if none is named")
    parser.add_argument("--quick", action="store_true", help="fewer tolerances and repeats")
    arguments = parser.parse_args()
    print(machine("numpy", "numba", "scipy", "numbalsoda", "scikit-sundae"))
    for name in arguments.what or TABLES:
        TABLES[name](arguments.quick)


if __name__ == "__main__":
    main()
