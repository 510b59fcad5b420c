"""Pictures of stability: regions of methods, eigenvalues, frequency responses and maps of failures."""

import math
from collections.abc import Callable

import numpy as np

from fvsolve.report.draw import style

GRID_POINTS = 600  # along each side of the grid
MAX_EXTENT = 60.0  # greatest extent of a region that is drawn in full
DEFAULT_EXTENT = 10.0  # drawn extent of larger or unbounded regions
LEVELS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the amplification factor |R| of a step
SHADES = ("#0b6aa8", "#3f8abc", "#74abd0", "#a9cce3", "#d6e7f2")
VERDICT_COLOURS = {
    "stable": "#12876f",
    "ringing": "#e0b13c",
    "coarse": "#8fc4e8",
    "wrong": "#8a4fa3",
    "blown up": "#c2410c",
    "refused": "#6b7785",
    "not run": "#eef1f4",
}
# verdicts with dark colours, labelled in white
DARK_VERDICTS = ("stable", "wrong", "blown up", "refused")


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
    style.name_axes(axes, "Re hλ", "Im hλ")
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
    if (
        not len(rows)
        or max(np.abs(wide[rows]).max(), np.abs(wide[columns]).max()) > 0.95 * MAX_EXTENT
    ):
        return -DEFAULT_EXTENT, DEFAULT_EXTENT, DEFAULT_EXTENT
    left = wide[columns].min()
    right = wide[columns].max()
    high = np.abs(wide[rows]).max()
    pad = 0.15 * max(right - left, 2.0 * high)
    left = min(left - pad, -pad)
    right = max(right + pad, pad)
    high = high + pad
    spare = max(0.0, high - 0.5 * (right - left))
    return left - spare, right + spare, high


def _amplification(r: Callable, x, y):
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.nan_to_num(np.abs(r(x[None, :] + 1j * y[:, None])), nan=np.inf)


@style.without_markup
def spectrum_figure(
    r: Callable, values: np.ndarray, field: np.ndarray | None = None, title: str = ""
):
    """Figure of eigenvalues times the time step over the stability region |R(s)| <= 1.

    r : stability function R; values : eigenvalues times the time step
    field : boundary of the field of values (numerical range) times the time step, or None
    """
    figure = region_figure(r, title)
    axes = figure.axes[0]
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    if field is not None:
        closed = np.append(field, field[:1])
        axes.plot(
            closed.real, closed.imag, color=style.COLOURS[2], linewidth=1.2, label="field of values"
        )
    inside = (values.real >= low[0]) & (values.real <= high[0]) & (np.abs(values.imag) <= high[1])
    axes.plot(
        values.real, values.imag, ".", color=style.COLOURS[1], markersize=4, label="eigenvalues"
    )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    far = int(np.sum(~inside))
    axes.legend(
        loc="upper left",
        fontsize=8,
        framealpha=0.9,
        edgecolor=style.HAIR,
        labelcolor=style.INK,
        title=f"{far} of {values.size} eigenvalues lie outside" if far else None,
        title_fontsize=8,
    )
    return figure


@style.without_markup
def response_figure(
    w, h, labels: tuple[str, str], dips=(), poles=(), tolerance=0.0, title: str = "", note: str = ""
):
    """Bode plot of a response h over frequency, with the real part Re h below.

    Bands with Re h < 0 are shaded; poles on the imaginary axis are dotted lines.
    w : float64[k]  angular frequency [rad/s]; h : complex128[k]; labels : (name, unit) of h
    dips : (low, high) of bands with Re h < 0 [rad/s]; poles : frequencies of poles [rad/s]
    tolerance : fraction of |h| below which Re h is drawn as zero; note : title of the panel of Re h
    """
    name, unit = labels
    figure = style.figure(7.4)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 3))
    frequency = np.asarray(w) / (2.0 * np.pi)
    shown = np.isfinite(h)
    values = np.where(shown, h, np.nan)
    phase = np.degrees(np.angle(values))
    # rounding at -180 degrees must not draw a jump
    phase = np.where(phase < -179.999, 180.0, phase)
    real = np.where(np.abs(values.real) > tolerance * np.abs(values), values.real, 0.0)
    for ax, line in zip(axes, (np.abs(values), phase, real), strict=True):
        style.style_axes(ax)
        for pole in poles:
            ax.axvline(
                pole / (2.0 * np.pi), color=style.DOUBT, linewidth=0.9, linestyle=(0, (1, 2))
            )
        ax.plot(frequency, line, color=style.COLOURS[0], linewidth=1.2)
        for low, high in dips:
            ax.axvspan(
                max(low / (2.0 * np.pi), frequency[0]),
                min(high / (2.0 * np.pi), frequency[-1]),
                color=style.DOUBT,
                alpha=0.25,
                linewidth=0.8,
            )
    axes[0].set_xscale("log")
    _logarithmic(axes[0], np.abs(values))
    style.name_axes(axes[0], y=f"|{name}|  [{unit}]")
    _phase(axes[1], phase)
    _real(axes[2], real)
    style.name_axes(axes[2], "frequency [Hz]", f"Re {name}  [{unit}]")
    axes[2].set_title(note, fontsize=8.5, color=style.INK, loc="left", wrap=True)
    style.title(figure, title)
    return figure


def _logarithmic(axes, size) -> None:
    """Make the vertical axis logarithmic, over at most six decades below the greatest value of `size`."""
    top, least = np.nanmax(size), np.nanmin(size)
    if not top > 0.0:
        return
    axes.set_yscale("log")
    axes.set_ylim(max(0.8 * least, 1e-6 * top), 1.25 * top)
    axes.tick_params(
        axis="y", which="minor", labelsize=6.5, colors=style.MUTED, labelcolor=style.MUTED
    )


def _phase(axes, phase) -> None:
    """Set the axis of the phase [deg] and draw lines at -90 and 90, the limits for a passive port."""
    for level in (-90.0, 90.0):
        axes.axhline(level, color=style.MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    least, greatest = np.nanmin(phase), np.nanmax(phase)
    axes.set_ylim(min(-100.0, least - 10.0), max(100.0, greatest + 10.0))
    axes.set_yticks(
        [x for x in range(-180, 181, 45) if axes.get_ylim()[0] <= x <= axes.get_ylim()[1]]
    )
    style.name_axes(axes, y="phase [deg]")


def _real(axes, real) -> None:
    """Make the axis of Re h logarithmic over at most six decades, on each side of zero if there are negative values."""
    from matplotlib.ticker import NullLocator

    size = np.abs(real[np.isfinite(real)])
    top = size.max(initial=0.0)
    if top == 0.0:
        axes.set_ylim(-1.0, 1.0)
        axes.set_yticks([0.0])
    elif size.min() > 0.0 and np.nanmin(real) > 0.0:
        _logarithmic(axes, real)
    else:
        small = max(np.min(size[size > 0.0]), 1e-6 * top)
        axes.set_yscale("symlog", linthresh=float(small), linscale=1.0)
        below = np.nanmin(real) < 0.0
        axes.set_ylim(-2.0 * top if below else 0.0, 2.0 * top)
        first, last = int(np.ceil(np.log10(small))) + 1, int(np.floor(np.log10(top)))
        marks = [10.0**k for k in range(last, first - 1, -2)]
        axes.set_yticks([*(-x for x in marks if below), 0.0, *marks])
        axes.yaxis.set_minor_locator(NullLocator())
    if axes.get_yscale() != "log":
        axes.axhline(0.0, color=style.INK, linewidth=0.8)


@style.without_markup
def failure_map_figure(result, title: str = "", head: str = ""):
    """Figure of a failure map with a panel for each scheme.

    A panel has a row for each method, and a column for each time step or value of a key. A bar in a row marks the
    predicted stability limit. head : label of the columns if they are values of a key
    """
    tall = 0.30 * len(result.methods)
    figure = style.figure(
        1.5 + len(result.schemes) * (tall + 0.75), width=max(7.0, 2.3 + 0.68 * len(result.values))
    )
    panels = figure.subplots(len(result.schemes), 1, squeeze=False)[:, 0]
    for axes, scheme in zip(panels, result.schemes, strict=True):
        _panel(axes, result, scheme)
    label = "step, and Courant number" if result.wave_rate else "step"
    style.name_axes(panels[-1], label if result.key == "step" else head or result.key)
    _legend(figure, result)
    style.title(figure, title)
    return figure


def column_labels(result) -> list[str]:
    """Labels of the columns of a failure map: time steps, with Courant numbers on a second line, or values of a key."""
    if result.key != "step":
        return [
            f"{value:.4g}" if isinstance(value, float) else str(value) for value in result.values
        ]
    if not result.wave_rate:
        return [time_text(value) for value in result.values]
    return [f"{time_text(value)}\nC {value * result.wave_rate:.3g}" for value in result.values]


def time_text(value: float) -> str:
    """Text of a time [s] in a suitable unit: 1.4 us, 3.75 ms, 2 s."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if value * factor >= 1.0 or unit == "us":
            return f"{value * factor:.3g} {unit}"
    return f"{value:.3g} s"


def _panel(axes, result, scheme: str) -> None:
    from matplotlib.patches import Rectangle

    for row, method in enumerate(result.methods):
        squares = result.row(scheme, method)
        for square in squares:
            colour = VERDICT_COLOURS[square.verdict]
            hatch = "////" if square.verdict == "not run" else None
            corner = square.column - 0.5, row - 0.5
            axes.add_patch(
                Rectangle(corner, 1, 1, facecolor=colour, edgecolor="white", hatch=hatch, lw=1.2)
            )
            ink = "white" if square.verdict in DARK_VERDICTS else style.INK
            error = square.measures.error
            if math.isfinite(error) and square.verdict not in ("blown up", "refused", "not run"):
                error_text = f"{100 * error:.2g} %"
                axes.text(
                    square.column,
                    row,
                    error_text,
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color=ink,
                )
        place = limit_place(result, squares)
        if place is not None:
            look = "dotted" if scheme in result.limited else "solid"
            for start in (row - 0.5, row + 0.24):  # leaves the number free
                axes.plot(
                    [place] * 2,
                    [start, start + 0.26],
                    color=style.INK,
                    lw=2.2,
                    linestyle=look,
                    zorder=3,
                )
    axes.set_xlim(-0.55, len(result.values) - 0.45)
    axes.set_ylim(len(result.methods) - 0.45, -0.55)
    axes.set_xticks(range(len(result.values)), column_labels(result))
    axes.set_yticks(range(len(result.methods)), result.methods)
    axes.tick_params(colors=style.MUTED, labelcolor=style.INK, labelsize=7.5, length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    if result.wave_rate:
        axes.set_title(scheme, fontsize=9, color=style.INK, loc="left", pad=4)


def limit_place(result, squares) -> float | None:
    """Position of the predicted stability limit in a row, in columns; None if no step exceeds it or it is unknown.

    If all steps exceed their limits, it is -0.5, before the first column. squares : runs of the row
    """
    limits = [square.limit for square in squares]
    if None in limits or any(square.step is None for square in squares):
        return None
    if result.key != "step":
        safe = [square.step <= square.limit for square in squares]
        flips = [k for k in range(1, len(safe)) if safe[k] != safe[k - 1]]
        return flips[0] - 0.5 if flips else (None if all(safe) else -0.5)
    limit, steps = limits[0], np.array([square.step for square in squares])
    if limit >= steps.max():
        return None
    if limit < steps.min():
        return -0.5
    order = np.argsort(steps)
    return float(np.interp(math.log(limit), np.log(steps[order]), np.arange(len(steps))[order]))


def _legend(figure, result) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = {square.verdict for square in result.squares}
    handles = [
        Patch(facecolor=colour, label=word, hatch="////" if word == "not run" else None)
        for word, colour in VERDICT_COLOURS.items()
        if word in seen
    ]
    looks = {"dotted" if scheme in result.limited else "solid" for scheme in result.schemes}
    labels = {
        "solid": "predicted limit",
        "dotted": "predicted limit, with the weights of smooth flow",
    }
    for look in [look for look in labels if look in looks]:
        handles.append(Line2D([], [], color=style.INK, lw=2.2, linestyle=look, label=labels[look]))
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=5 if len(result.values) > 8 else 3,
        frameon=False,
        fontsize=8,
        labelcolor=style.INK,
    )
