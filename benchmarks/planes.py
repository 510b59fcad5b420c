"""Basins compared with PyClaw, in one process: `python benchmarks/planes.py [speed] [error] [driven] [start]`.

speed: million cell-steps per second of each physics on grids of 64^2 to 1024^2 and on triangles.
error: CPU time to an L1 error of a swirl that turns back, a hump of water that spreads and a round pulse of pressure.
driven: cost of driven sides, rain, soils, maxima, walls and sections; a driven flood beside PyClaw and ANUGA.
start: first run of each physics on a machine, functions that a scene without basins compiles, memory per cell.

`--quick` runs one small grid of water, without `start`, which planes_start.py contains. One thread, CPU time, the best
of several, everything compiled before. PyClaw (`clawpack` from PyPI, built with gfortran) is left out if it does not
import.
"""

from measure import machine, parser
from planes_driven import driven_table
from planes_error import error_table
from planes_speed import speed_table
from planes_start import start_table

TABLES = {"speed": speed_table, "error": error_table, "driven": driven_table, "start": start_table}


def main() -> None:
    """Print the selected tables."""
    options = parser(__doc__)
    options.add_argument(
        "what",
        nargs="*",
        help=f"tables: {', '.join(TABLES)} (default all, with --quick all but start)",
    )
    given = options.parse_args()
    print(machine("numpy", "numba", "clawpack"))
    for name in given.what or list(TABLES)[: 3 if given.quick else None]:
        TABLES[name](given.quick)


if __name__ == "__main__":
    main()
