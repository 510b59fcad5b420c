"""Charts from which the defaults are chosen: `fvsolve chart` on cases of several kinds, written to docs/charts.

    python benchmarks/accuracy_and_speed.py [--quick] [NAME...]

Results of runs are stored in build/charts, so an interrupted benchmark continues; delete the folder to measure again.
With `--quick` results and pictures are written to a temporary folder.
"""

from __future__ import annotations

import tempfile
from math import exp, log
from pathlib import Path
from time import perf_counter

from measure import agree, parser

from fvsolve.case import shipped
from fvsolve.studies.accuracy.chart import chart
from fvsolve.studies.accuracy.work_precision import Chart, find_crossing, write_chart

ROOT = Path(__file__).resolve().parents[1]
PICTURES, POINTS = ROOT / "docs" / "charts", ROOT / "build" / "charts"
SMOOTH = {
    "time": [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6],
    "value": [1.0, 0.97, 0.8, 0.5, 0.2, 0.03, 0.0],
    "kind": "smooth",
}
# no wave arrives at the time of a row
SUDDEN = {"time": [0.9, 1.0037], "value": [1.0, 0.0], "kind": "step"}
SCENES = {  # name -> (shipped case, overrides, description)
    "closure-smooth": (
        "valve-closure",
        {"links.valve.opening": SMOOTH},
        "one pipe, a smooth closure",
    ),
    "closure-ramp": ("valve-closure", {}, "one pipe, a ramp of 50 ms"),
    "closure-sudden": ("valve-closure", {"links.valve.opening": SUDDEN}, "one pipe, a jump"),
    "gradual-closure": ("gradual-closure", {}, "one pipe, a slow closure with kinks"),
    "three-way-junction": (
        "three-way-junction",
        {},
        "pipes that fit no common step, a ramp of 20 ms",
    ),
    "nine-pipes": (
        "streeter-nine-pipes",
        {"numerics.end": 15.0},
        "a looped network, friction, a closure of 1 s",
    ),
    "pipe-tiny-chamber": ("pipe-tiny-chamber", {}, "a pipe with a stiff end"),
    "two-tanks": ("two-tanks", {}, "no pipe; stiff once it rests"),
    "chamber-and-orifice": ("chamber-and-orifice", {}, "no pipe, one volume"),
    "closed-cylinder": ("closed-cylinder", {}, "no pipe, a swinging mass, not stiff"),
    "chamber-chain": ("chamber-chain", {}, "no pipe, stiff"),
    "cylinder-servo": ("cylinder-servo", {}, "no pipe, stiff, a mass"),
}
QUICK = {  # name -> options of its chart with `--quick`
    "closure-ramp": {"schemes": ["muscl"], "methods": ["ssp-rk3"], "cells": [40, 80]},
}
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def made(name: str, points: Path, pictures: Path, **few) -> Chart:
    """Chart of a scene, whose picture is written.

    few : options of the chart, such as schemes, methods and cells
    """
    case, keys, about = SCENES[name]
    found = chart(shipped.find(case), keys, out=points / name, **few)
    pictures.mkdir(parents=True, exist_ok=True)
    picture = write_chart(found, points / name, title=f"{name}: {about}", dpi=80)[1]
    (pictures / picture.with_stem(name).name).write_bytes(picture.read_bytes())
    return found


def costs(found: Chart, target: float, cost: str = "seconds") -> dict[str, float]:
    """Cost of each curve at a target error; curves that do not reach the target are left out."""
    met, floor = {}, found.floor["trajectory"]
    for name, points in found.curves().items():
        errors = [max(one.trajectory, floor) if one.ok else float("inf") for one in points]
        where = (
            find_crossing(errors, [getattr(one, cost) for one in points], target)
            if target >= floor
            else None
        )
        if where is not None:
            met[name] = where.cost
    return met


def front(name: str, found: Chart, cost: str = "seconds") -> None:
    """Print the cost of each curve at each target over the cheapest, and the cheapest in ms or million updates."""
    targets = [one for one in TARGETS if costs(found, one, cost)]
    at = {one: costs(found, one, cost) for one in targets}
    unit, factor = ("ms", 1e3) if cost == "seconds" else ("million updates", 1e-6)
    print(
        f"\n{name}, {SCENES[name][2]}; floor {found.floor['trajectory']:.1e} ({found.reference}; {found.second})"
    )
    print(
        f"| {unit} | "
        + " | ".join(f"{one:.0e}" for one in targets)
        + " |\n|---" * 1
        + "|---" * len(targets)
        + "|"
    )
    print(
        "| cheapest | "
        + " | ".join(f"{min(at[one].values()) * factor:.3g}" for one in targets)
        + " |"
    )
    for curve in found.curves():
        if any(curve in at[one] for one in targets):
            told = [
                f"{at[one][curve] / min(at[one].values()):.2g}" if curve in at[one] else "-"
                for one in targets
            ]
            print(
                f"| {curve}{' (default)' if curve == found.default else ''} | "
                + " | ".join(told)
                + " |"
            )
    for point in found.failed:
        print(f"failed: {point.setting.name}, {point.setting.fineness}: {point.reason}")


def overshoots(found: Chart) -> None:
    """Print the overshoot of each curve in ranges of the reference, from coarse to fine."""
    print("\novershoot, in ranges, from coarse to fine")
    for curve, points in found.curves().items():
        print(f"{curve:>26}: " + "  ".join(f"{one.overshoot:.1e}" for one in points))


def implied(charts: dict[str, Chart]) -> None:
    """Print for each curve the number of targets reached over the scenes, and its cost relative to other curves.

    The cost is relative to the cheapest curve and to the default.
    """
    asked = [
        (name, target)
        for name, found in charts.items()
        for target in TARGETS[1:]
        if costs(found, target)
    ]
    at = {one: costs(charts[one[0]], one[1]) for one in asked}
    found = next(iter(charts.values()))
    default = found.default
    heads = (
        "curve",
        f"reached of {len(asked)}",
        "times the cheapest, mean",
        "worst",
        "times quicker than default",
        "worst overshoot",
    )
    print("\n| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    rows = []
    for curve in dict.fromkeys(name for one in charts.values() for name in one.curves()):
        met = [one for one in asked if curve in at[one]]
        if not met:
            continue
        beside = [at[one][curve] / min(at[one].values()) for one in met]
        gain = [at[one][default] / at[one][curve] for one in met if default in at[one]]
        over = max(
            p.overshoot for one in charts.values() for p in one.curves().get(curve, []) if p.ok
        )
        rows.append((curve, len(met), _mean(beside), max(beside), _mean(gain), over))
    for curve, reached, beside, worst, gain, over in sorted(
        rows, key=lambda row: (-row[1], row[2])
    ):
        name = f"{curve} (default)" if curve == default else curve
        told = f"{over:.1e}" if found.points[0].setting.scheme else "-"
        print(f"| {name} | {reached} | {beside:.2g} | {worst:.2g} | {gain:.2g} | {told} |")


def _mean(ratios: list[float]) -> float:
    """Geometric mean; nan without numbers."""
    return exp(sum(map(log, ratios)) / len(ratios)) if ratios else float("nan")


def main() -> None:
    """Print the tables of all scenes, or of the given ones."""
    options = parser(__doc__)
    options.add_argument(
        "names", nargs="*", metavar="NAME", help=f"scenes: {', '.join(SCENES)} (default all)"
    )
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        where = (Path(folder), Path(folder)) if given.quick else (POINTS, PICTURES)
        tables(
            given.names or (QUICK if given.quick else SCENES), where, QUICK if given.quick else {}
        )


def tables(names, where: tuple[Path, Path], few: dict) -> None:
    """Print the tables of each scene, and a summary of each group of scenes.

    where : folders of results and of pictures; few : scene -> options of its chart
    """
    charts = {}
    for name in names:
        began = perf_counter()
        charts[name] = found = made(name, *where, **few.get(name, {}))
        front(name, found)
        front(name, found, "updates")
        agree(
            f"least error of {name}",
            min((one.trajectory for one in found.points if one.ok), default=float("nan")),
            0.1,
        )
        if any(one.setting.scheme for one in found.points):
            overshoots(found)
        print(f"{perf_counter() - began:.1f} s", flush=True)
    stiff = {name for name, found in charts.items() if "muscl rodas-5p" in found.curves()}
    piped = {name for name, found in charts.items() if found.points[0].setting.scheme} - stiff
    for about, names in (
        ("pipes", piped),
        ("pipes, stiff", stiff),
        ("no pipes", charts.keys() - piped - stiff),
    ):
        if names:
            print(f"\n{about}: {', '.join(name for name in charts if name in names)}")
            implied({name: found for name, found in charts.items() if name in names})


if __name__ == "__main__":
    main()
