"""CPU time of EPANET's Net3 over days or a year with repeated patterns, beside EPANET with a hydraulic step of 10 s.

python benchmarks/network_year.py [--quick] [--days 365]

A first day compiles what is needed, and is left out. The difference of levels is the greatest of the first day.
"""

import time
import tomllib
from pathlib import Path

import numpy as np
import wntr
from measure import parser

import fvsolve
from fvsolve.exchange.epanet import import_network, toolkit_run

DAY, STEP = 86400, 10
NET = Path(wntr.__file__).parent / "library" / "networks" / "Net3.inp"


def repeated(table: dict, days: int) -> dict:
    """Table of a step schedule over a day, repeated over days."""
    times = np.add.outer(DAY * np.arange(days), table["time"]).ravel().tolist()
    return {**table, "time": times, "value": table["value"] * days}


def case_over(days: int) -> dict:
    """Case of Net3 over a number of days; demands, heads and openings repeat those of the first day."""
    case = tomllib.loads(import_network(NET, day=True).text)
    case["signals"] = {name: repeated(table, days) for name, table in case["signals"].items()}
    for part in (*case["nodes"].values(), *case["links"].values()):
        for key, value in part.items():
            if isinstance(value, dict) and value.get("kind") == "step":
                part[key] = repeated(value, days)
    case["numerics"]["end"] = f"{24 * days} h"
    case["output"]["units"] = {}
    return case


def run_days(days: int):
    """(result, CPU time [s]) of a run with its start."""
    began = time.process_time()
    result = fvsolve.run(fvsolve.load(case_over(days)))
    return result, time.process_time() - began


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--days", type=int, default=365)
    given = arguments.parse_args()
    days = 2 if given.quick else given.days
    day, _ = run_days(1)
    result, spent = run_days(days)
    began = time.process_time()
    tanks = wntr.network.WaterNetworkModel(str(NET)).tank_name_list
    known = toolkit_run.run(NET, tanks, [], STEP, DAY)
    epanet = time.process_time() - began
    apart = max(
        np.abs(day[f"nodes.{tank}.level"] - known.level(tank, day.t)).max() for tank in tanks
    )
    print(f"{days} days: {result.reason}, {result.summary['steps']} steps, {spent:.1f} s of CPU")
    print(
        f"EPANET, step {STEP} s: {epanet:.2f} s for a day, so {epanet * days:.0f} s; levels differ by {apart:.2g} m"
    )


if __name__ == "__main__":
    main()
