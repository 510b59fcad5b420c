"""Column separation on the Adelaide rig: the case `adelaide` over a measurement, into docs/adelaide.png.

    python benchmarks/adelaide.py MEASURED.csv [PICTURE]

MEASURED.csv : columns t_s and p_gauge_kPa (Bergant and Simpson 1999), comments by #.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

import fvsolve

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = Path(__file__).parent.parent


def main(measured: str, picture: str = str(ROOT / "docs" / "adelaide.png")) -> None:
    rows = [line for line in Path(measured).read_text().splitlines() if line and line[0] in "-0123456789"]
    t, p = np.array([[float(x) for x in row.split(",")] for row in rows]).T
    result = fvsolve.run(ROOT / "cases" / "adelaide.toml", set={"links.main.cells": 200})
    figure, axes = plt.subplots(figsize=(9, 4))
    axes.plot(t, p, ".", color="0.6", markersize=3, label="measured, digitised")
    axes.plot(result.t, result["gate.gauge_pressure"], color="#0f766e", linewidth=1.0, label="fvsolve, 200 cells")
    axes.axhline(-98.99, color="0.3", linewidth=0.6, linestyle=":")
    axes.annotate("vapour pressure", (0.5, -98.99), (0.5, 60.0), fontsize=8, color="0.3")
    axes.set(xlabel="t [s]", ylabel="gauge pressure at the valve [kPa]", xlim=(0.0, 0.8))
    axes.legend(frameon=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.tight_layout()
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(*sys.argv[1:])
