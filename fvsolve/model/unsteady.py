"""Weighting functions of unsteady friction and the sums of exponentials that stand for them. Knows no network.

tau = 4 nu t / D^2 is dimensionless time, s the Laplace variable to it. A sum is fitted to the transform of W along
s = i w, which is what a wave of that frequency meets, and over all w that cells resolve and a run is long enough for.
"""

from __future__ import annotations

import functools
import math

import numpy as np

ACCURACY = 1e-4
LAMINAR = 2000.0  # Reynolds number of the start below which Zielke's function is taken
QUICKEST = 1.9  # decay of the quickest term over the time that a wave takes through a cell
MOST_TERMS = 40
STEEP, LOOSE, HIGHEST = 2.0, 0.3, 0.7  # error that is let through at w, 2 (w / top)^3 up to 0.3; last w over top
BOTTOMS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # slowest decay over the lowest frequency
FLAT = 4.0  # frequency below which the transform of Zielke's function is nearly its value at zero, 1/12
ZEROS = 8  # of J_2 that may stand for themselves


def zielke(s: np.ndarray) -> np.ndarray:
    """Transform of Zielke's W = sum of exp(-j^2 tau) over the zeros j of J_2, from the exact laminar profile.

    s (1 + 8/s + 4 W(s)) is the exact laminar s I_0(x) / I_2(x), x = sqrt(s); Zielke, J. Basic Eng. 90 (1968) 109.
    """
    from scipy.special import ive

    x = np.sqrt(np.asarray(s, dtype=complex))
    return 0.25 * (ive(0, x) / ive(2, x) - 1.0 - 8.0 / x**2)


def root(s: np.ndarray) -> np.ndarray:
    """Transform of W = 1 / sqrt(pi tau): of Vardy and Brown's W = A* exp(-B* tau) / sqrt(tau) but for A*, B*."""
    return 1.0 / np.sqrt(np.asarray(s, dtype=complex))


def vardy_brown(reynolds: float, roughness: float) -> tuple[float, float]:
    """(A*, B*) of W = A* exp(-B* tau) / sqrt(tau) in turbulent flow; roughness relative to the diameter.

    Smooth walls, A* = 1 / (2 sqrt(pi)), B* = Re^k / 12.86, k = log10(15.29 / Re^0.0567): Vardy and Brown, J. Sound
    Vib. 259 (2003) 1011. Fully rough walls, A* = 0.0103 sqrt(Re) (e/D)^0.39, B* = 0.352 Re (e/D)^0.41: the same, 270
    (2004) 233. Between, the greater A*.
    """
    smooth = 0.5 / math.sqrt(math.pi), reynolds ** math.log10(15.29 / reynolds**0.0567) / 12.86
    rough = 0.0103 * math.sqrt(reynolds) * roughness**0.39, 0.352 * reynolds * roughness**0.41
    return max(smooth, rough)


def terms(
    weighting: str, reynolds: float, roughness: float, cell: float, span: float, accuracy: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """(m, n) of W = sum of m exp(-n tau), and the highest frequency w up to which it is good, in units of tau.

    cell : time that a wave takes through a cell; span : duration of the run; both as tau
    """
    top = 2.0 ** math.floor(math.log2(QUICKEST / cell))
    top = max(top, 512.0) if weighting == "zielke" else top
    highest = top * (accuracy / STEEP) ** (1.0 / 3.0)
    if weighting == "zielke":
        return *fit("zielke", top, max(_below(1.0 / span), FLAT), accuracy), highest
    a, b = vardy_brown(reynolds, roughness)
    m, n = fit("root", top, _below(max(1.0 / span, 0.25 * b)), accuracy)  # along s = B* + i w, then shifted
    return a * math.sqrt(math.pi) * m, n + b, highest


def _below(x: float) -> float:
    """The power of two next below."""
    return 2.0 ** math.floor(math.log2(x))


@functools.lru_cache(maxsize=256)
def fit(transform: str, top: float, low: float, accuracy: float) -> tuple[np.ndarray, np.ndarray]:
    """Nonnegative m and rising n <= top, as few as meet a transform W(i w) from w = low on.

    Within `accuracy` of itself, and beyond what decays up to `top` can follow within 2 (w / top)^3: top is near the
    time of a cell, so this is third order in the size of cells. Decays in geometric progression, m by nonnegative least
    squares of (sum of m / (s + n)) / W(s) - 1 at s = i w; what is found is checked at every w.
    """
    exact, heads = (zielke, _zeros()) if transform == "zielke" else (root, [np.zeros(0)])
    w = np.geomspace(min(low, 0.01 * top), HIGHEST * top, 32 + int(10 * math.log(max(top / low, 4.0))))
    value, tolerance = exact(1j * w), np.maximum(accuracy, np.minimum(STEEP * (w / top) ** 3, LOOSE))
    for count in range(2, MOST_TERMS + 1):
        tries = (_weights(w, value, tolerance, n) for n in _decays(heads, w[0], top, count))
        error, m, n = min(tries, key=lambda one: one[0])
        if error <= 1.0:
            return m[m > 0.0], n[m > 0.0]
    raise ArithmeticError(f"no sum of {MOST_TERMS} exponentials meets {accuracy:g}")  # pragma: no cover


def _zeros() -> list[np.ndarray]:
    """The first squared zeros of J_2, none to ZEROS of them."""
    from scipy.special import jn_zeros

    found = jn_zeros(2, ZEROS) ** 2
    return [found[:k] for k in range(ZEROS + 1)]


def _decays(heads, low: float, top: float, count: int):
    """Sets of `count` decays: geometric from about `low` to `top`, or from behind a head of given ones."""
    for head in heads:
        if head.size == 0:
            yield from (np.geomspace(bottom * low, top, count) for bottom in BOTTOMS)
        elif head.size < count and head[-1] < top:
            first = head[-1] * (1.0 + 1.3 / (head.size + 0.5))
            yield np.concatenate([head, np.geomspace(first, max(top, 1.01 * first), count - head.size)])


def _weights(w, value, tolerance, n):
    """(greatest relative error over its tolerance, m, n) of the best nonnegative sum with decays n."""
    from scipy.optimize import nnls

    shares = 1.0 / (1j * w[:, None] + n) / (tolerance * value)[:, None]
    wanted = np.concatenate([1.0 / tolerance, np.zeros(w.size)])
    m = nnls(np.vstack([shares.real, shares.imag]), wanted, maxiter=100 * n.size)[0]
    return float(np.max(np.abs(shares @ m - wanted[: w.size]))), m, n


def reserve(draft, row) -> None:
    """Room for the terms of a pipe, which are known once its flow at the start is."""
    row["term"] = len(draft.floats)
    draft.floats += [0.0] * (2 * MOST_TERMS)


def add_terms(draft) -> dict[str, dict]:
    """Terms and states of all pipes with unsteady friction, from the flows of the start; what `check` shows of them."""
    found, settings, floats = {}, draft.tables.settings[0], draft.tables.floats
    numerics, fluid = draft.case.numerics, draft.fluid
    for name, row, mesh in zip(draft.pipe_names, draft.pipe_table, draft.meshes, strict=True):
        law = draft.case.links[name].friction
        if law.model != "unsteady":
            continue
        unit = 4.0 * fluid.viscosity / (fluid.density * mesh.diameter**2)  # tau per time [1/s]
        reynolds = abs(float(row["flow"])) * mesh.diameter / (float(row["area"]) * fluid.viscosity)
        weighting = law.weighting or ("zielke" if reynolds < LAMINAR else "vardy-brown")
        if weighting == "vardy-brown" and reynolds == 0.0:
            what = "vardy-brown is a weighting at the Reynolds number of the start, and nothing flows there"
            draft.fault(f"links.{name}.friction.weighting", f"{what}; give an initial flow, or zielke")
            continue
        cell, span = unit * row["dx"] / row["speed"], unit * (numerics.end - numerics.start)
        accuracy = ACCURACY if law.accuracy is None else law.accuracy
        try:
            m, n, highest = terms(weighting, reynolds, (law.roughness or 0.0) / mesh.diameter, cell, span, accuracy)
        except ArithmeticError as error:
            draft.fault(f"links.{name}.friction.accuracy", f"{error}; give a greater accuracy or more cells")
            continue
        gain, rate = 4.0 * unit * m, unit * n
        floats[row["term"] : row["term"] + 2 * m.size] = np.column_stack([gain, rate]).ravel()
        row["terms"] = m.size
        names = [f"{name}.memory{k}[{i}]" for k in range(m.size) for i in range(mesh.cells)]
        row["memory"] = draft.states(names, 1e5 * row["admittance"])
        waves = row["speed"] / row["dx"] * row["quicker"]  # upwind ones reach twice that, so the rest counts half
        quickest = float(max(waves, 0.5 * rate[-1]) + 0.5 * gain.sum())
        settings["rate"] = max(settings["rate"], quickest)
        found[name] = {
            "weighting": weighting, "terms": m.size, "accuracy": accuracy, "rate": quickest,
            "frequency": highest * unit / (2.0 * math.pi),
        }  # fmt: skip
    return found


def memory_shares(floats: np.ndarray, row) -> np.ndarray:
    """g / n of every term of a pipe: with z it stores (g / n) z^2 / (2 rho A) per length."""
    pairs = floats[row["term"] : row["term"] + 2 * row["terms"]].reshape(-1, 2)
    return pairs[:, 0] / pairs[:, 1]
