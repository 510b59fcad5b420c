"""How far the greatest value of a signal is off, from its local maxima at half, one and twice the resolution.

A maximum of values c, m, f has the differences a = m - c and b = f - m, and r = |b| / |a|, taken as 1/4 (order 2) to
0.6 (order 3/4). The rest beyond m is |b| / (1 - r) or |a| r / (1 - r), whichever is more, with 1 - r = 0.4 where a and
b differ in sign; times 2.15, and once more by up to 2 where differences grow. Of all maxima those of the middle
resolution with their rests bound the greatest: one that is lower may come to exceed it. What else it may be off by:
a fifth of the differences of all maxima on average; and the differences between the signals at the two times of the
greatest, up to 16 times its own, as a crest that moves has not come to its height.

The ratio of the mean differences of whole signals says how far they have converged: where it is small, half of that
bound is enough; and the rest of the greatest by this ratio, where its own is less by chance, is the least bound. The
numbers are those that hold for random mains (benchmarks/peak_bands.py --random) at the least median.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SAFETY = 2.15  # of the rest
QUICK, SLOW = 0.25, 0.6  # ratios of differences: order 2, and the least order that is believed
GROWTH = 2.0  # at most, of differences that grow
BESIDE = 0.6  # of that safety, of places that are not the greatest
SHARE = 0.2  # of the mean difference of all maxima
MOVED = 16.0  # differences of the greatest, at most, that these and those of signals where it stands count
CONVERGED, TRUSTED = (0.35, 0.75), (0.5, 1.0)  # ratios of mean differences of signals -> share of the bound
FIRM = 1.6  # of the rest by that ratio
RISE = 0.002  # of the range of a signal: what parts two maxima

Signal = tuple[np.ndarray, np.ndarray]  # times and values


def greatest_error(places: Sequence[Sequence[Signal]], triple: Sequence[float], believed: bool = True) -> float:
    """How far the greatest value of all places is off at the middle resolution.

    places : of each the signals at two or three resolutions, rising; triple : the greatest of each over all steps
    believed : False where no order is, whatever differences show
    """
    own, found = three(np.array([triple], float)), [local_maxima(signals) for signals in places]
    if not places:
        return error_of_maxima(own, rests(own, believed))
    k = int(np.argmax([np.max(signals[-2][1]) for signals in places]))
    rows = [own, *(one[np.isfinite(one).all(axis=1)] for _, one in found)]
    off = [rests(one, believed) * (1.0 if j in (0, k + 1) else BESIDE) for j, one in enumerate(rows)]
    error = error_of_maxima(np.vstack(rows), np.concatenate(off))
    (cuts, _), (middle, fine), most = found[k], places[k][-2:], float(np.max(np.abs(np.diff(own))))
    moved = apart(middle, fine) if segment(cuts, middle) == segment(cuts, fine) else 0.0
    mean = SHARE * float(np.mean(np.max(np.abs(np.diff(rows[k + 1], axis=1)), axis=1, initial=0.0)))
    ratio = ratio_of_signals(places[k])
    error *= float(np.interp(ratio, CONVERGED, TRUSTED))
    return max(error, min(max(moved, mean), MOVED * most), FIRM * rest_by(ratio, own[0]))


def three(maxima: np.ndarray) -> np.ndarray:
    """Values at three resolutions; of two the first difference is taken as the second."""
    return maxima if maxima.shape[1] == 3 else np.column_stack([2.0 * maxima[:, 0] - maxima[:, 1], maxima])


def segment(cuts: np.ndarray, signal: Signal) -> int:
    """Which local maximum is the greatest of a signal."""
    return int(np.searchsorted(cuts, signal[0][np.argmax(signal[1])]))


def local_maxima(signals: Sequence[Signal]) -> tuple[np.ndarray, np.ndarray]:
    """Times that part the local maxima of the last signal, and the greatest values between : float64[maxima, 3]."""
    t, v = signals[-1]
    cuts = t[troughs(v, RISE * float(np.ptp(v)))]
    found = np.full((len(cuts) + 1, len(signals)), -np.inf)
    for k, (times, values) in enumerate(signals):
        np.maximum.at(found[:, k], np.searchsorted(cuts, times), values)
    return cuts, three(found)


def troughs(values: np.ndarray, rise: float) -> list[int]:
    """Where the least between two maxima stands that are higher by `rise` at least."""
    turns = np.concatenate([[0], 1 + np.flatnonzero(np.diff(np.sign(np.diff(values)))), [len(values) - 1]])
    found, rising, high, low = [], True, 0, 0
    for i in turns.tolist():
        if rising and values[i] < values[high] - rise:
            rising, low = False, i
        elif not rising and values[i] > values[low] + rise:
            found.append(low)
            rising, high = True, i
        high, low = (i if values[i] > values[high] else high), (i if values[i] < values[low] else low)
    return found


def error_of_maxima(maxima: np.ndarray, off: np.ndarray) -> float:
    """How far the greatest of local maxima may be off, by what may be added to each : float64[maxima, 3]."""
    c, m, f = maxima.T
    sways, most = (m - c) * (f - m) < 0.0, float(np.max(m))
    above = float(np.max(np.where((f >= m) | sways, m + off, m)))
    below = float(np.max(np.where((f <= m) | sways, m - off, m)))
    return max(above - most, most - below)


def rests(triples: np.ndarray, believed: bool = True) -> np.ndarray:
    """What twice the resolution and all beyond may add to the middle one of three values : float64[values, 3]."""
    first, second = np.diff(triples, axis=1).T
    a, b, sways = np.abs(first), np.abs(second), first * second < 0.0
    ratio = np.divide(b, a, out=np.where(b > 0.0, np.inf, 0.0), where=a > 0.0)
    r = np.clip(ratio, QUICK, SLOW) if believed else np.full(len(a), SLOW)
    rest = SAFETY * np.maximum(b, a * r) / (1.0 - np.where(sways, SLOW, r))
    return rest * np.where(sways, 1.0, np.clip(ratio, 1.0, GROWTH))


def rest_by(ratio: float, values: np.ndarray) -> float:
    """What all finer resolutions may add to the second of three values, by its own ratio of differences or this one."""
    a, b = np.abs(np.diff(values)).tolist()
    r = min(max(b / a if a > 0.0 else 0.0, ratio, QUICK), SLOW)
    return max(b, a * r) / (1.0 - r)


def ratio_of_signals(signals: Sequence[Signal]) -> float:
    """Mean difference of the two finest signals over that of the two coarsest, SLOW where there are but two."""
    if len(signals) < 3:
        return SLOW
    t = signals[-1][0]
    coarse, middle, fine = (np.interp(t, *one) for one in signals)
    before = float(np.mean(np.abs(middle - coarse)))
    return float(np.mean(np.abs(fine - middle))) / before if before > 0.0 else SLOW


def apart(middle: Signal, fine: Signal) -> float:
    """How far two signals are from each other where each is greatest."""
    times = [one[0][np.argmax(one[1])] for one in (middle, fine)]
    return float(np.max(np.abs(np.interp(times, *fine) - np.interp(times, *middle))))
