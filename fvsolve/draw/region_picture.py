"""Picture of the stability region of a method in the complex plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fvsolve.draw import style

GRID_POINTS = 600  # along each side of the grid
MAX_EXTENT = 60.0  # greatest extent of a region that is drawn in full
DEFAULT_EXTENT = 10.0  # drawn extent of larger or unbounded regions
LEVELS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the amplification factor |R| of a step
SHADES = ("#0b6aa8", "#3f8abc", "#74abd0", "#a9cce3", "#d6e7f2")


@style.without_markup
def region_figure(r: Callable, title: str = ""):
    """Figure of the stability region |R(s)| <= 1, s = h lambda; colours are darker where a step damps more.

    r : stability function R for complex arrays; h : time step, lambda : eigenvalue
    """
    left, right, high = _window(r)
    x, y = np.linspace(left, right, GRID_POINTS), np.linspace(-high, high, GRID_POINTS)
    size = _amplification(r, x, y)
    figure = style.figure(5.2, width=6.0)
    axes = figure.subplots()
    style.style_axes(axes)
    axes.set_aspect("equal")
    filled = axes.contourf(x, y, size, levels=LEVELS, colors=SHADES)
    axes.contour(x, y, size, levels=[1.0], colors=[style.INK], linewidths=1.0)
    for line in (axes.axhline, axes.axvline):
        line(0.0, color=style.MUTED, linewidth=0.6)
    axes.set_xlabel("Re hλ", fontsize=8.5, color=style.INK)
    axes.set_ylabel("Im hλ", fontsize=8.5, color=style.INK)
    axes.ticklabel_format(style="plain")
    bar = figure.colorbar(filled, ax=axes, shrink=0.6, pad=0.02)
    bar.set_label("|R|", fontsize=8.5, color=style.INK)
    bar.ax.tick_params(labelsize=8, colors=style.MUTED, labelcolor=style.INK)
    bar.outline.set_visible(False)
    style.title(figure, title)
    return figure


def _window(r: Callable) -> tuple[float, float, float]:
    """Left, right and upper end of the drawn window.

    It contains the boundary |R| = 1 if there is one and its coordinates are at most 0.95 `MAX_EXTENT` in size.
    Otherwise the window reaches `DEFAULT_EXTENT` in each direction.
    """
    wide = np.linspace(-MAX_EXTENT, MAX_EXTENT, 2 * GRID_POINTS)
    stable = _amplification(r, wide, wide) <= 1.0
    edge = stable[1:, 1:] != stable[:-1, 1:]
    edge |= stable[1:, 1:] != stable[1:, :-1]
    rows, columns = np.nonzero(edge)
    if not len(rows) or max(np.abs(wide[rows]).max(), np.abs(wide[columns]).max()) > 0.95 * MAX_EXTENT:
        return -DEFAULT_EXTENT, DEFAULT_EXTENT, DEFAULT_EXTENT
    left, right, high = wide[columns].min(), wide[columns].max(), np.abs(wide[rows]).max()
    pad = 0.15 * max(right - left, 2.0 * high)
    left, right, high = min(left - pad, -pad), max(right + pad, pad), high + pad
    spare = max(0.0, high - 0.5 * (right - left))
    return left - spare, right + spare, high


def _amplification(r: Callable, x, y):
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.nan_to_num(np.abs(r(x[None, :] + 1j * y[:, None])), nan=np.inf)
