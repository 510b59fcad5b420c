"""Plant small faults in the package, and count how many the quick tests and all tests find.

    python tests/planted_faults.py [--full] [--only TEXT] [--jobs 2] [--draw 40 --seed 1 [--near]]

A fault is a sign, an index or a factor of 1.01. Each is planted alone in a copy of the repository. The quick tests of
its module run first, then all quick tests; with --full all tests run on a fault that these miss. A fault that stops the
import of fvsolve would be found by any test, and is an error of this list. --draw plants faults at drawn places instead
of those of the list (`drawn_faults.py`).
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from drawn_faults import DrawnFault, drawn

TOP = Path(__file__).parents[1]
PACKAGE = TOP / "fvsolve"
QUICK_NEEDED, ALL_NEEDED = 46, 50
DRAWN_NEEDED = 34, 38  # of 40 drawn faults
WITHOUT_OWN_TEST = (
    "--deselect",
    "tests/repository/test_tools_of_tests.py",
)  # fails on every planted fault, so it finds none


@dataclass(frozen=True)
class Fault:
    """Replacement of a text that occurs once in a file of the package.

    path : below fvsolve
    """

    path: str
    old: str
    new: str

    def planted(self, text: str) -> str:
        """Text of the file with the fault; raises ValueError if the old text does not occur exactly once."""
        if text.count(self.old) != 1:
            raise ValueError(
                f"fvsolve/{self.path}: {self.old!r} stands {text.count(self.old)} times, expected once"
            )
        return text.replace(self.old, self.new)

    def shown(self, text: str) -> str:
        """Line number and text of the fault."""
        return f"{text.count(chr(10), 0, text.index(self.old)) + 1}: {self.new}"


FAULTS = [
    Fault(
        "core/kernels/steady_edges.py",
        "potential[k, i] - potential[k, j]",
        "potential[k, j] - potential[k, i]",
    ),
    Fault("core/step_limits/grid_limits.py", "face[:-1] - face[1:]", "1.01 * face[:-1] - face[1:]"),
    Fault(
        "features/motion/lower.py",
        'row["sweep_a"] = a["mass"] / a["volume"] * row["area_a"]',
        'row["sweep_a"] = 1.01 * a["mass"] / a["volume"] * row["area_a"]',
    ),
    Fault(
        "core/assembly/model_draft.py",
        "reynolds * math.pi / 4.0 * diameter",
        "1.01 * reynolds * math.pi / 4.0 * diameter",
    ),
    Fault("core/model/energy_norm.py", "float(np.sqrt(own[i]))", "float(1.01 * np.sqrt(own[i]))"),
    Fault(
        "features/motion/kernels/mass_dynamics.py",
        '- brace["damping"] * (speed - brace["speed"])',
        '+ brace["damping"] * (speed - brace["speed"])',
    ),
    Fault(
        "features/scalars/kernels/scalar_transport.py",
        "c[i] = s[i] / (m[i] + wall)",
        "c[i] = 2.0 * s[i] / (m[i] + wall)",
    ),
    Fault(
        "compile/cache_folders.py",
        'digest.update(path.read_bytes() + b"\\0")',
        'digest.update(b"\\0")',
    ),
    Fault("report/draw/plot.py", "np.argmin(values[a:b])", "np.argmax(values[a:b])"),
    Fault("core/schemes.py", "(k + 1) ** power - k**power", "(k + 1) ** power + k**power"),
    Fault(
        "core/mesh/mesh.py", "angle=float(angle[sharpest])", "angle=float(1.01 * angle[sharpest])"
    ),
    Fault(
        "core/steppers/ros.py", "1.0 / (later - t) if later > t", "-1.0 / (later - t) if later > t"
    ),
    Fault(
        "core/steppers/analysis/trees.py",
        "return nodes * math.prod(",
        "return (nodes + 1) * math.prod(",
    ),
    Fault(
        "core/steppers/numbers/polynomial.py", "x - ratio * y for x, y", "x + ratio * y for x, y"
    ),
    Fault("report/maps/map_classes.py", '"right") - 1', '"left") - 1'),
    Fault("report/cycles.py", "return self.cycles * (", "return 1.01 * self.cycles * ("),
    Fault(
        "studies/validation/row_verdicts.py",
        "max(pair[0] - value, value - pair[1], 0.0)",
        "max(pair[0] - value, 0.0)",
    ),
    Fault(
        "core/kernels/pipes.py",
        "dl[i] = k * (fl[i + 1] - fl[i])",
        "dl[i] = 1.01 * k * (fl[i + 1] - fl[i])",
    ),
    Fault(
        "core/kernels/steady_friction.py",
        "force = loss * (size * flow)",
        "force = 1.01 * loss * (size * flow)",
    ),
    Fault(
        "core/kernels/density/log_law.py",
        'st["reference"] + q / (1.0 / st["beta"] + compliance)',
        'st["reference"] + q / (1.0 / st["beta"] - compliance)',
    ),
    Fault(
        "features/delay_lines/kernels/line_rates.py",
        "per = 1.0 / (1.0 - beta * beta)",
        "per = 1.0 / (1.0 + beta * beta)",
    ),
    Fault(
        "core/kernels/relaxation.py",
        "reference * (0.5 * u - flow / m0)",
        "reference * (0.505 * u - flow / m0)",
    ),
    Fault("core/kernels/moving_frames.py", "rz * fx - rx * fz", "rz * fx + rx * fz"),
    Fault(
        "core/kernels/relaxation.py",
        "return per * taken, per * rate",
        "return per * taken, 1.01 * per * rate",
    ),
    Fault("units.py", "value_si - ambient", "value_si + ambient"),
    Fault("case/sloshing.py", "return 0.25 * np.pi * a * a if", "return 0.2525 * np.pi * a * a if"),
    Fault("core/fluid/oils.py", "(hot - cold)) - 0.7)", "(hot - cold)) - 0.707)"),
    Fault(
        "studies/peak_error.py",
        "v[position - 1] - 2.0 * v[position] + v[position + 1]",
        "v[position - 1] + 2.0 * v[position] + v[position + 1]",
    ),
    Fault(
        "studies/energy_balance.py",
        "change[self.supplied].sum() - change[self.rates].sum()",
        "change[self.supplied].sum() + change[self.rates].sum()",
    ),
    Fault(
        "studies/failure_map.py",
        "turns = change[1:] * change[:-1] < 0.0",
        "turns = change[1:] * change[:-1] > 0.0",
    ),
    Fault(
        "studies/accuracy/fit.py",
        "np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])",
        "np.log(e[:-1] / e[1:]) / np.log(1.01 * h[:-1] / h[1:])",
    ),
    Fault(
        "studies/water_quality/moving_segments.py",
        "entered += goes * supply",
        "entered -= goes * supply",
    ),
    Fault("studies/stability/growth.py", "scaled @ result + x * v", "scaled @ result - x * v"),
    Fault(
        "core/solve/held_inputs.py",
        "value_at(model.tables, target.schedule, t, np.inf) / target.scale",
        "value_at(model.tables, target.schedule, t, np.inf) * target.scale",
    ),
    Fault(
        "exchange/gis/layer_parts.py",
        "0.5 * (z[i] + z[i + 1])",
        "0.5 * (z[i] - z[i + 1])",
    ),
    Fault(
        "exchange/fmi/variables.py",
        "inputs + list({variable.name",
        "inputs[:-1] + list({variable.name",
    ),
    Fault(
        "studies/loops/sampled.py", "self.drive * (1.0 + z[place])", "self.drive * (1.0 - z[place])"
    ),
    Fault(
        "features/networks/elimination.py",
        "scale = (1.0, -1.0, -item.value, item.value)",
        "scale = (1.0, -1.0, item.value, -item.value)",
    ),
    Fault(
        "features/networks/kernels/networks.py",
        "forward = most - torque",
        "forward = 1.01 * most - torque",
    ),
    Fault(
        "features/controls/kernels/input_histories.py",
        "weight *= (time - other) / (histories[here] - other)",
        "weight *= 1.01 * (time - other) / (histories[here] - other)",
    ),
    Fault(
        "features/controls/balance.py",
        "right = -residual - matrix",
        "right = residual - matrix",
    ),
    Fault(
        "features/delay_lines/lower.py",
        '2.0 * beta * pipe["admittance"] /',
        '2.02 * beta * pipe["admittance"] /',
    ),
    Fault(
        "features/scalars/balances.py",
        "decayed = -float(np.sum(decay",
        "decayed = float(np.sum(decay",
    ),
    Fault(
        "studies/ports/positive_real.py",
        "order = n.degree - d.degree",
        "order = d.degree - n.degree",
    ),
    Fault(
        "core/output/csv_files.py",
        'self.along("u", fields), self.along("v", fields)',
        'self.along("u", fields), self.along("u", fields)',
    ),
    Fault(
        "cli/accuracy_commands.py",
        "gain = richest.seconds / cheapest.seconds",
        "gain = cheapest.seconds / richest.seconds",
    ),
    Fault(
        "features/basins/conduit/conduit_cells.py",
        "rough[0] * hydraulic_radius_power",
        "2.0 * hydraulic_radius_power",
    ),
    Fault("features/basins/frame_forces.py", "spin + f1 - p1 * z", "spin + f1 + p1 * z"),
    Fault(
        "features/basins/liquid/liquid_mesh.py",
        "m, pressure = forward - backward, c0 * (forward + backward)\n        mass",
        "m, pressure = forward - backward, 1.01 * c0 * (forward + backward)\n        mass",
    ),
    Fault(
        "features/basins/transport/lower.py",
        "return speed * size / np.pi * np.sin(x) ** 2",
        "return 1.01 * speed * size / np.pi * np.sin(x) ** 2",
    ),
    Fault(
        "features/basins/free_surface/surface_patches.py",
        "dydt[o + i] += (\n            flow * near.flow_weight(",
        "dydt[o + i] -= (\n            flow * near.flow_weight(",
    ),
    Fault(
        "parts/full_pipe.py",
        "DN_NPS.get(number, number / 25.0)",
        "DN_NPS.get(number, number / 25.4)",
    ),
    Fault(
        "parts/accumulator/law.py",
        "rho * (n * p * compressibility * (total - volume) + volume)",
        "rho * (n * p * compressibility * (total - volume) - volume)",
    ),
    Fault(
        "parts/tank.py", "0.5 * s * (area[k + 1] - area[k])", "0.505 * s * (area[k + 1] - area[k])"
    ),
    Fault(
        "parts/pump/law.py",
        "residual = drop + weight * head",
        "residual = drop + 1.01 * weight * head",
    ),
    Fault("core/run/verdicts.py", "compare.t + compare.shift", "compare.t - compare.shift"),
    Fault(
        "exchange/epanet/part_tables.py",
        "2.0 * GRAVITY * drop / velocity**2",
        "2.02 * GRAVITY * drop / velocity**2",
    ),
    Fault(
        "core/solve/run_summary.py",
        'row["inflow"] - row["outflow"] for name',
        'row["inflow"] + row["outflow"] for name',
    ),
    Fault(
        "exact/laminar_line.py", "self.length - places if self.reversed", "places if self.reversed"
    ),
]


def copied(folder: Path) -> Path:
    """Copy of the files that git lists."""
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=TOP,
        capture_output=True,
        check=True,
    ).stdout.decode()
    for name in filter(None, names.split("\0")):
        if (TOP / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TOP / name, folder / name)
    return folder


def tests_fail(folder: Path, jobs: int, *options: str) -> str:
    """Name of the first test that fails, empty if all pass."""
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "MPLBACKEND": "Agg",
        "PYVISTA_OFF_SCREEN": "true",
    }
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-n",
        str(jobs),
        "--dist",
        "worksteal",
        *WITHOUT_OWN_TEST,
        *options,
    ]
    found = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    lines = [line for line in found.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if found.returncode in (0, 5):
        return ""
    if not lines:
        raise RuntimeError(
            f"pytest ended with {found.returncode}: {found.stdout[-2000:]}{found.stderr[-2000:]}"
        )
    return lines[0].split(" - ")[0]


def near(fault: Fault | DrawnFault) -> list[str]:
    """Files of tests that import the module of a fault or have its name, or that of its folder, in their own name.

    Without such files it is the folder of tests of this part of the package, if there is one.
    """
    folder, name = ("", *fault.path.removesuffix(".py").split("/"))[-2:]
    files = [
        str(path.relative_to(TOP))
        for path in sorted((TOP / "tests").glob("*/test_*.py"))
        if f"{folder}.{name} " in (text := path.read_text(encoding="utf-8"))
        or f"from fvsolve.{folder} import {name}" in text
        or name in path.stem
        or (folder and folder in path.stem)
    ]
    part = fault.path.split("/")[0]
    return files or ([f"tests/{part}"] if (TOP / "tests" / part).is_dir() else [])


def searched(
    folder: Path, fault: Fault | DrawnFault, options: argparse.Namespace
) -> tuple[str, str]:
    """Tests that find a fault, "quick", "full" or "", and the first of them that fails."""
    path = folder / "fvsolve" / fault.path
    text, files = path.read_text(encoding="utf-8"), near(fault)
    path.write_text(fault.planted(text), encoding="utf-8")
    try:
        if first := files and tests_fail(folder, options.jobs, "--quick", *files):
            return "quick", first
        if options.near:
            return "", ""
        if first := tests_fail(folder, options.jobs):
            return "quick", first
        first = options.full and tests_fail(folder, options.jobs, "--full")
        return ("full", first) if first else ("", "")
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> None:
    asked = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    asked.add_argument(
        "--full", action="store_true", help="run all tests on faults that the quick tests miss"
    )
    asked.add_argument(
        "--near", action="store_true", help="run the quick tests of the module of a fault only"
    )
    asked.add_argument("--list", action="store_true", help="print the faults and run no tests")
    asked.add_argument(
        "--only", default="", metavar="TEXT", help="only faults whose path contains this text"
    )
    asked.add_argument(
        "--draw",
        type=int,
        default=0,
        metavar="N",
        help="number of drawn faults; those of the list if 0",
    )
    asked.add_argument(
        "--seed", type=int, default=1, metavar="N", help="seed of drawn faults (default 1)"
    )
    asked.add_argument(
        "--jobs",
        type=int,
        default=2,
        metavar="N",
        help="number of processes of a test run (default 2)",
    )
    options = asked.parse_args()
    faults = drawn(options.seed, options.draw) if options.draw else FAULTS
    needed = DRAWN_NEEDED if options.draw else (QUICK_NEEDED, ALL_NEEDED)
    quick = every = count = 0
    with tempfile.TemporaryDirectory(prefix="fvsolve-faults-") as name:
        folder = copied(Path(name))
        for fault in (fault for fault in faults if options.only in fault.path):
            start, line = (
                time.perf_counter(),
                fault.shown((PACKAGE / fault.path).read_text(encoding="utf-8")),
            )
            if options.list:
                print(f"fvsolve/{fault.path}:{line}")
                continue
            by, first = searched(folder, fault, options)
            count, quick, every = count + 1, quick + (by == "quick"), every + bool(by)
            print(
                f"{by or 'MISSED':6s} {time.perf_counter() - start:5.0f} s  {fault.path}:{line}  {first}",
                flush=True,
            )
    if options.list:
        return
    print(f"{count} faults: quick tests find {quick}, expected {needed[0]}")
    if options.full:
        print(f"all tests find {every}, expected {needed[1]}")
    sys.exit(not options.only and (quick < needed[0] or (options.full and every < needed[1])))


if __name__ == "__main__":
    main()
