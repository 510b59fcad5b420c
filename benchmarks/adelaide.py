"""Picture of the case `adelaide` and measured pressures, column separation on the Adelaide rig: docs/adelaide.png.

    python benchmarks/adelaide.py [--quick] [MEASURED.csv [PICTURE]]

MEASURED.csv : columns t_s and p_gauge_kPa (Bergant and Simpson 1999), with comment lines that begin with #. With
`--quick` the pressures that the case expects replace the measurement, and the picture is in a temporary folder.
"""

import tempfile
from pathlib import Path

import matplotlib
import numpy as np
from measure import agree, parser

import fvsolve

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = Path(__file__).parent.parent
EXPECTED = "0.04,2080\n0.2,-98.99\n0.405,1965\n0.6,-98.99\n"  # cases/adelaide.toml


def main() -> None:
    """Draw the picture of a measurement, or of the pressures that the case expects."""
    options = parser(__doc__)
    options.add_argument(
        "measured", nargs="?", type=Path, metavar="MEASURED.csv", help="measured pressures"
    )
    options.add_argument(
        "picture", nargs="?", type=Path, default=ROOT / "docs" / "adelaide.png", help="file to draw"
    )
    given = options.parse_args()
    if given.quick:
        with tempfile.TemporaryDirectory() as folder:
            off = draw(EXPECTED, Path(folder) / "adelaide.png", 40)
        agree("difference to the pressures that the case expects [kPa]", off, 300.0)
    elif given.measured:
        draw(given.measured.read_text(), given.picture, 200)
    else:
        options.error("expected MEASURED.csv, or --quick")


def draw(measured: str, picture: Path, cells: int) -> float:
    """Draw measured and computed pressures, and return their greatest difference [kPa].

    measured : lines of time [s] and gauge pressure [kPa]
    """
    rows = [line for line in measured.splitlines() if line and line[0] in "-0123456789"]
    t, p = np.array([[float(x) for x in row.split(",")] for row in rows]).T
    result = fvsolve.run(ROOT / "cases" / "adelaide.toml", set={"links.main.cells": cells})
    figure, axes = plt.subplots(figsize=(9, 4))
    axes.plot(t, p, ".", color="0.6", markersize=3, label="measured, digitised")
    axes.plot(
        result.t,
        result["gate.gauge_pressure"],
        color="#0f766e",
        linewidth=1.0,
        label=f"fvsolve, {cells} cells",
    )
    axes.axhline(-98.99, color="0.3", linewidth=0.6, linestyle=":")
    axes.annotate("vapour pressure", (0.5, -98.99), (0.5, 60.0), fontsize=8, color="0.3")
    axes.set(xlabel="t [s]", ylabel="gauge pressure at the valve [kPa]", xlim=(0.0, 0.8))
    axes.legend(frameon=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.tight_layout()
    figure.savefig(picture, dpi=120)
    return float(np.abs(np.interp(t, result.t, result["gate.gauge_pressure"]) - p).max())


if __name__ == "__main__":
    main()
