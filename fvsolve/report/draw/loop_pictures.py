"""Pictures of a control loop: Bode plot with margins, Nyquist plot, step response of the closed loop, root locus."""

import numpy as np

from fvsolve.report.draw import style

NYQUIST_EXTENT = 3.0  # distance from the origin up to which the Nyquist plot is drawn
# ratio of the drawn part of the root locus to the crossover frequency of the loop
LOCUS_EXTENT = 4.0


@style.without_markup
def bode_figure(loop, title: str = ""):
    """Bode plot of the return ratio L of a loop, with its gain and phase margin. loop : `studies.loops.loop.Loop`"""
    figure = style.figure(5.6)
    axes = figure.subplots(2, 1, sharex=True)
    w = loop.frequency
    size = np.abs(loop.ratio)
    margins = loop.margins
    phase = np.degrees(np.unwrap(np.angle(loop.ratio)))
    middle = phase[int(np.argmin(np.abs(np.log(np.maximum(size, 1e-300)))))]
    phase -= 360.0 * np.round((middle + 90.0) / 360.0)
    for ax, line in zip(axes, (20.0 * np.log10(np.maximum(size, 1e-300)), phase), strict=True):
        style.style_axes(ax)
        ax.plot(w, line, color=style.COLOURS[0], linewidth=1.2)
    shown = (size > 1e-4) & (size < 1e4)
    if shown.any():
        axes[0].set_xlim(w[shown][0], w[shown][-1])
        axes[0].set_ylim(
            max(-80.0, 20 * np.log10(size[shown].min())),
            min(80.0, 20 * np.log10(size[shown].max())) + 5.0,
        )
        low, high = phase[shown].min(), phase[shown].max()
        axes[1].set_ylim(min(max(low, -720.0) - 20.0, -200.0), min(high, 360.0) + 20.0)
    axes[0].set_xscale("log")
    axes[0].axhline(0.0, color=style.MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    axes[1].axhline(-180.0, color=style.MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    if margins.gain_margin_db is not None:
        draw_margin(
            axes[0],
            margins.phase_crossover,
            -margins.gain_margin_db,
            0.0,
            f"gain margin {margins.gain_margin:.4g} ({margins.gain_margin_db:.3g} dB)",
        )
    if margins.phase_margin is not None:
        at = phase[int(np.argmin(np.abs(np.log(w / margins.gain_crossover))))]
        draw_margin(
            axes[1],
            margins.gain_crossover,
            at,
            at - margins.phase_margin,
            f"phase margin {margins.phase_margin:.4g}°",
        )
    style.name_axes(axes[0], y="|L|  [dB]")
    style.name_axes(axes[1], "frequency [rad/s]", "phase of L  [deg]")
    style.title(figure, title)
    return figure


def draw_margin(axes, x: float, start: float, end: float, text: str) -> None:
    """Draw a margin as a vertical line from `start` to `end` at the frequency x, with its text above the panel."""
    axes.plot([x, x], [start, end], color=style.DOUBT, linewidth=1.8)
    axes.plot([x], [start], "o", color=style.DOUBT, markersize=3.5)
    axes.set_title(f"{text} at {x:.4g} rad/s", fontsize=8.5, color=style.INK, loc="left")


@style.without_markup
def nyquist_figure(loop, title: str = ""):
    """Nyquist plot of the return ratio L of a loop, with the point -1 and the circle of the stability margin."""
    from matplotlib.patches import Circle

    figure = style.figure(5.4, width=5.8)
    axes = figure.subplots()
    style.style_axes(axes)
    axes.set_aspect("equal")
    value = np.where(np.abs(loop.ratio) < 10.0 * NYQUIST_EXTENT, loop.ratio, np.nan)
    axes.plot(value.real, value.imag, color=style.COLOURS[0], linewidth=1.2, label="L(jw), w > 0")
    axes.plot(
        value.real,
        -value.imag,
        color=style.COLOURS[0],
        linewidth=0.9,
        linestyle=(0, (3, 2)),
        label="w < 0",
    )
    axes.add_patch(
        Circle(
            (0.0, 0.0), 1.0, fill=False, edgecolor=style.MUTED, linewidth=0.7, linestyle=(0, (4, 3))
        )
    )
    if loop.margins.stability_margin is not None:
        radius = loop.margins.stability_margin
        axes.add_patch(
            Circle((-1.0, 0.0), radius, fill=False, edgecolor=style.DOUBT, linewidth=1.1)
        )
        axes.set_title(
            f"least |1 + L| = {radius:.4g} at {loop.margins.stability_crossover:.4g} rad/s",
            fontsize=8.5,
            color=style.INK,
            loc="left",
        )
    axes.plot([-1.0], [0.0], "+", color=style.INK, markersize=9)
    near = np.abs(
        np.concatenate([value.real, value.imag])[
            np.isfinite(np.concatenate([value.real, value.imag]))
        ]
    )
    extent = min(NYQUIST_EXTENT, max(1.6, 1.1 * float(near.max(initial=0.0))))
    axes.set_xlim(-extent, extent)
    axes.set_ylim(-extent, extent)
    style.name_axes(axes, "Re L", "Im L")
    style.legend(axes)
    style.title(figure, title)
    return figure


@style.without_markup
def step_figure(times: np.ndarray, values: np.ndarray, sampled: bool, title: str = ""):
    """Step response of the closed loop, L / (1 + L), over time [s]; sampled : True for values at samples."""
    figure = style.figure(3.2)
    axes = figure.subplots()
    style.style_axes(axes)
    axes.axhline(1.0, color=style.MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.plot(
        times,
        values,
        color=style.COLOURS[0],
        linewidth=1.2,
        drawstyle="steps-post" if sampled else "default",
    )
    style.name_axes(axes, "time after the step [s]", "response to a step of 1")
    style.title(figure, title)
    return figure


@style.without_markup
def locus_figure(loop, gains: np.ndarray, poles: list[np.ndarray], title: str = ""):
    """Root locus: poles of the closed loop for several factors on L; a darker dot has a greater factor.

    Of a sampled loop these are poles z, with the unit circle as limit, else poles s [1/s]. loop : as for `bode_figure`
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Circle

    figure = style.figure(5.0, width=6.2)
    axes = figure.subplots()
    style.style_axes(axes)
    own = loop.poles
    sampled = loop.period is not None
    margins = loop.margins
    crossover = max(margins.gain_crossover or 0.0, margins.phase_crossover or 0.0)
    extent = LOCUS_EXTENT * crossover or 2.0 * float(np.abs(own).max(initial=0.0)) or 1.0
    if sampled:
        axes.set_aspect("equal")
        axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, edgecolor=style.MUTED, linewidth=0.9))
        extent = 1.3
    else:
        axes.axvline(0.0, color=style.MUTED, linewidth=0.9)
    shades = np.concatenate(
        [np.full(len(values), gain) for values, gain in zip(poles, gains, strict=True)]
    )
    points = np.concatenate(poles)
    seen = np.abs(points) <= 2.0 * extent
    drawn = axes.scatter(
        points.real[seen],
        points.imag[seen],
        s=7,
        c=shades[seen],
        cmap="Blues",
        norm=LogNorm(0.3 * gains[0], gains[-1]),
        linewidths=0.0,
    )
    axes.plot(own.real, own.imag, "x", color=style.DOUBT, markersize=6, label="gain 1")
    axes.set_ylim(-extent, extent)
    axes.set_xlim((-extent, extent) if sampled else (-extent, 0.4 * extent))
    bar = figure.colorbar(drawn, ax=axes, pad=0.02)
    bar.set_label("factor on L", fontsize=8.5, color=style.INK)
    bar.ax.tick_params(labelsize=8, colors=style.MUTED, labelcolor=style.INK)
    style.name_axes(
        axes, "Re z" if sampled else "Re s  [1/s]", "Im z" if sampled else "Im s  [rad/s]"
    )
    style.legend(axes)
    style.title(figure, title)
    return figure
