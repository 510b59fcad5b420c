"""Error bound of the greatest value of a signal, from its local maxima at half, one and twice the resolution.

A local maximum has the values c, m and f at half, one and twice the resolution. Their differences are a = m - c and
b = f - m, with the ratio r = |b| / |a|, limited to the range from 1/4 (order 2) to 0.6 (order 3/4). The remainder of a
maximum bounds the change of m by all finer resolutions. It is 2.15 times the larger of |b| / (1 - r) and
|a| r / (1 - r), with 1 - r = 0.4 if a and b differ in sign. If the differences have the same sign and grow, it is
multiplied by |b| / |a|, at most by 2.

The error bound follows from all local maxima m with their remainders, because a lower maximum may come to exceed the
greatest. Remainders at places other than that of the greatest value are multiplied by 0.6. The ratio of the mean
differences of whole signals shows how far they have converged. If it is small, half of this bound is enough. The bound
is at least the larger of two terms: a fifth of the mean difference of all maxima, and the difference between the
signals at the times of their greatest values, because a moving crest may still grow. Both terms are limited to 16 times
the difference of the greatest value. The ratio r of the greatest value may be small by chance, so the bound is also at
least 1.6 / 2.15 of its remainder with the ratio of whole signals. The constants were chosen so that the bound holds for
random mains (benchmarks/peak_bands.py --random) and its median is least.
"""

from collections.abc import Sequence

import numpy as np

SAFETY = 2.15  # factor on remainders
QUICK, SLOW = 0.25, 0.6  # ratios of differences at order 2, and at the least order that is accepted
GROWTH = 2.0  # greatest factor for differences that grow
OTHER_PLACES = 0.6  # factor on remainders of places other than that of the greatest value
MEAN_FRACTION = 0.2  # fraction of the mean difference of all maxima
MAX_MOVED = 16.0  # limit of the two further terms, in differences of the greatest value
CONVERGED, TRUSTED = (0.35, 0.75), (0.5, 1.0)  # ratios of mean differences of signals -> factor on the bound
MINIMUM_SAFETY = 1.6  # factor on the remainder by that ratio
RISE = 0.002  # drop between two separate maxima, as a fraction of the range of a signal

Signal = tuple[np.ndarray, np.ndarray]  # times and values


def greatest_error(places: Sequence[Sequence[Signal]], triple: Sequence[float], believed: bool = True) -> float:
    """Error bound of the greatest value of several signals at the middle of three resolutions, or the first of two.

    places : for each place in the network, its signals (times, values) at two or three increasing resolutions
    triple : greatest value over all places and steps at each resolution; believed : False if no order of convergence
    may be assumed
    """
    own_maxima, maxima = three_values(np.array([triple], float)), [local_maxima(signals) for signals in places]
    if not places:
        return error_of_maxima(own_maxima, remainders(own_maxima, believed))
    k = int(np.argmax([np.max(signals[-2][1]) for signals in places]))
    rows = [own_maxima, *(values[np.isfinite(values).all(axis=1)] for _, values in maxima)]
    factors = [1.0 if j in (0, k + 1) else OTHER_PLACES for j in range(len(rows))]
    bounds = [remainders(values, believed) * factor for values, factor in zip(rows, factors, strict=True)]
    error = error_of_maxima(np.vstack(rows), np.concatenate(bounds))
    (cuts, _), (middle, fine), most = maxima[k], places[k][-2:], float(np.max(np.abs(np.diff(own_maxima))))
    moved = difference_at_peaks(middle, fine) if greatest_segment(cuts, middle) == greatest_segment(cuts, fine) else 0.0
    mean = MEAN_FRACTION * float(np.mean(np.max(np.abs(np.diff(rows[k + 1], axis=1)), axis=1, initial=0.0)))
    ratio = convergence_ratio(places[k])
    error *= float(np.interp(ratio, CONVERGED, TRUSTED))
    least = MINIMUM_SAFETY * remainder_by_ratio(ratio, own_maxima[0])
    return max(error, min(max(moved, mean), MAX_MOVED * most), least)


def three_values(maxima: np.ndarray) -> np.ndarray:
    """Values at three resolutions : float64[maxima, 3]; from two columns, a coarser one is extrapolated linearly.

    maxima : float64[maxima, 2 or 3], values of local maxima at increasing resolutions
    """
    return maxima if maxima.shape[1] == 3 else np.column_stack([2.0 * maxima[:, 0] - maxima[:, 1], maxima])


def greatest_segment(cuts: np.ndarray, signal: Signal) -> int:
    """Index of the local maximum at which a signal (times, values) is greatest.

    cuts : times that separate the local maxima, as from `local_maxima`
    """
    return int(np.searchsorted(cuts, signal[0][np.argmax(signal[1])]))


def local_maxima(signals: Sequence[Signal]) -> tuple[np.ndarray, np.ndarray]:
    """Local maxima of a signal; signals : (times, values) of this signal at two or three increasing resolutions.

    Returns (times that separate the local maxima of the finest signal, greatest values between these times :
    float64[maxima, 3]). The columns of the values are as from `three_values`; values are not finite in rows where a
    signal has no point between these times.
    """
    t, v = signals[-1]
    cuts = t[troughs(v, RISE * float(np.ptp(v)))]
    greatest = np.full((len(cuts) + 1, len(signals)), -np.inf)
    for k, (times, values) in enumerate(signals):
        np.maximum.at(greatest[:, k], np.searchsorted(cuts, times), values)
    return cuts, three_values(greatest)


def troughs(values: np.ndarray, rise: float) -> list[int]:
    """Indices of the least values between successive maxima, both of which are higher by more than `rise`."""
    turns = np.concatenate([[0], 1 + np.flatnonzero(np.diff(np.sign(np.diff(values)))), [len(values) - 1]])
    positions, rising, high, low = [], True, 0, 0
    for i in turns.tolist():
        if rising and values[i] < values[high] - rise:
            rising, low = False, i
        elif not rising and values[i] > values[low] + rise:
            positions.append(low)
            rising, high = True, i
        high, low = (i if values[i] > values[high] else high), (i if values[i] < values[low] else low)
    return positions


def error_of_maxima(maxima: np.ndarray, off: np.ndarray) -> float:
    """Error bound of the greatest of several local maxima at the middle resolution.

    maxima : float64[maxima, 3]  values at the three resolutions; off : float64[maxima]  bounds of the changes of the
    middle values, as from `remainders`
    """
    c, m, f = maxima.T
    sways, most = (m - c) * (f - m) < 0.0, float(np.max(m))
    above = float(np.max(np.where((f >= m) | sways, m + off, m)))
    below = float(np.max(np.where((f <= m) | sways, m - off, m)))
    return max(above - most, most - below)


def remainders(triples: np.ndarray, believed: bool = True) -> np.ndarray:
    """Bounds of the changes of the middle values by all finer resolutions : float64[values].

    triples : float64[values, 3]  values at three resolutions; believed : False if no order of convergence may be
    assumed
    """
    first, second = np.diff(triples, axis=1).T
    a, b, sways = np.abs(first), np.abs(second), first * second < 0.0
    ratio = np.divide(b, a, out=np.where(b > 0.0, np.inf, 0.0), where=a > 0.0)
    r = np.clip(ratio, QUICK, SLOW) if believed else np.full(len(a), SLOW)
    rest = SAFETY * np.maximum(b, a * r) / (1.0 - np.where(sways, SLOW, r))
    return rest * np.where(sways, 1.0, np.clip(ratio, 1.0, GROWTH))


def remainder_by_ratio(ratio: float, values: np.ndarray) -> float:
    """Bound of the change of the middle value by all finer resolutions, without a safety factor.

    values : float64[3] at three resolutions; ratio : ratio of successive differences, used if it is larger than that of
    the values
    """
    a, b = np.abs(np.diff(values)).tolist()
    r = min(max(b / a if a > 0.0 else 0.0, ratio, QUICK), SLOW)
    return max(b, a * r) / (1.0 - r)


def convergence_ratio(signals: Sequence[Signal]) -> float:
    """Mean difference between the two finest of three signals, divided by that between the two coarsest.

    The result is `SLOW` for only two signals, and if the two coarsest are equal.
    signals : (times, values) at increasing resolutions
    """
    if len(signals) < 3:
        return SLOW
    t = signals[-1][0]
    coarse, middle, fine = (np.interp(t, *signal) for signal in signals)
    before = float(np.mean(np.abs(middle - coarse)))
    return float(np.mean(np.abs(fine - middle))) / before if before > 0.0 else SLOW


def difference_at_peaks(middle: Signal, fine: Signal) -> float:
    """Greatest difference between two signals at two times, those of the greatest values of both signals."""
    times = [signal[0][np.argmax(signal[1])] for signal in (middle, fine)]
    return float(np.max(np.abs(np.interp(times, *fine) - np.interp(times, *middle))))
