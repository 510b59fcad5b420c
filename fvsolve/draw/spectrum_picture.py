"""Picture of eigenvalues in the stability region of a method."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fvsolve.draw import style
from fvsolve.draw.region_picture import region_figure


@style.without_markup
def spectrum_figure(r: Callable, values: np.ndarray, field: np.ndarray | None = None, title: str = ""):
    """Figure of eigenvalues times the time step over the stability region |R(s)| <= 1.

    r : stability function R; values : eigenvalues times the time step
    field : boundary of the field of values (numerical range) times the time step, or None
    """
    figure = region_figure(r, title)
    axes = figure.axes[0]
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    if field is not None:
        axes.plot(*closed_line(field), color=style.COLOURS[2], linewidth=1.2, label="field of values")
    inside = (values.real >= low[0]) & (values.real <= high[0]) & (np.abs(values.imag) <= high[1])
    axes.plot(values.real, values.imag, ".", color=style.COLOURS[1], markersize=4, label="eigenvalues")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    far = int(np.sum(~inside))
    axes.legend(
        loc="upper left", fontsize=8, framealpha=0.9, edgecolor=style.HAIR, labelcolor=style.INK,
        title=f"{far} of {values.size} eigenvalues lie outside" if far else None, title_fontsize=8,
    )  # fmt: skip
    return figure


def closed_line(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Real and imaginary parts of complex points, with the first point repeated at the end."""
    line = np.append(points, points[:1])
    return line.real, line.imag
