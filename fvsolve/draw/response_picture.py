"""Picture of a frequency response: magnitude, phase and real part over frequency."""

from __future__ import annotations

import numpy as np

from fvsolve.draw import style


@style.without_markup
def response_figure(w, h, labels: tuple[str, str], dips=(), poles=(), tolerance=0.0, title: str = "", note: str = ""):
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
    phase = np.where(phase < -179.999, 180.0, phase)  # rounding at -180 degrees must not draw a jump
    real = np.where(np.abs(values.real) > tolerance * np.abs(values), values.real, 0.0)
    for ax, line in zip(axes, (np.abs(values), phase, real), strict=True):
        style.style_axes(ax)
        for pole in poles:
            ax.axvline(pole / (2.0 * np.pi), color=style.DOUBT, linewidth=0.9, linestyle=(0, (1, 2)))
        ax.plot(frequency, line, color=style.COLOURS[0], linewidth=1.2)
        for low, high in dips:
            ax.axvspan(max(low / (2.0 * np.pi), frequency[0]), min(high / (2.0 * np.pi), frequency[-1]),
                        color=style.DOUBT, alpha=0.25, linewidth=0.8)  # fmt: skip
    axes[0].set_xscale("log")
    _logarithmic(axes[0], np.abs(values))
    axes[0].set_ylabel(f"|{name}|  [{unit}]", fontsize=8.5, color=style.INK)
    _phase(axes[1], phase)
    _real(axes[2], real)
    axes[2].set_ylabel(f"Re {name}  [{unit}]", fontsize=8.5, color=style.INK)
    axes[2].set_xlabel("frequency [Hz]", fontsize=8.5, color=style.INK)
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
    axes.tick_params(axis="y", which="minor", labelsize=6.5, colors=style.MUTED, labelcolor=style.MUTED)


def _phase(axes, phase) -> None:
    """Set the axis of the phase [deg] and draw lines at -90 and 90, the limits for a passive port."""
    for level in (-90.0, 90.0):
        axes.axhline(level, color=style.MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    least, greatest = np.nanmin(phase), np.nanmax(phase)
    axes.set_ylim(min(-100.0, least - 10.0), max(100.0, greatest + 10.0))
    axes.set_yticks([x for x in range(-180, 181, 45) if axes.get_ylim()[0] <= x <= axes.get_ylim()[1]])
    axes.set_ylabel("phase [deg]", fontsize=8.5, color=style.INK)


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
