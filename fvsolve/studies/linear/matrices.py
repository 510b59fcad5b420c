"""A and C of a frozen state, by differences that are checked. Knows models and patterns; knows no input."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.kernels import records as rec
from fvsolve.studies.linear.frozen import Frozen
from fvsolve.studies.linear.slopes import FINER, NOISE, SMOOTH, STEPS, central, hidden_kinks, kinks, settled

DENSE = 1000  # states up to which A is a full array
LONGEST, LARGEST = 20.0, 10_000_000  # that C may take [s], entries that it may have
ROUNDING = 1e-10  # of the quickest rate per deviation: rows below that are what sums have left of their terms
DIRECTIONS = 3  # at random, along which the whole of A is tried


def responses(at: Frozen, y: np.ndarray, outputs: int) -> np.ndarray:
    """dy/dt, then the first probes, with y in place of the state : float64[n + outputs]."""
    model, t = at.model, float(at.t)
    with model.slate(at.armed) as slate:
        dydt, out = slate.evaluate(t, y, np.inf)
        values = slate.observe(t, y, out)[:outputs] if outputs else np.zeros(0)
    if out[rec.STATUS] != rec.OK or not np.all(np.isfinite(dydt)):
        place = f" at {model.node_names[int(out[rec.WHERE])]}" if out[rec.WHERE] >= 0 else ""
        raise FvsolveError(
            f"the state cannot be linearised: no flow meets what is asked{place}; every way to it is shut"
        )
    return np.concatenate([dydt, values])


def widths(at: Frozen) -> np.ndarray:
    """What counts as a small deviation of each state."""
    return np.maximum(at.model.scale, np.abs(at.y))


def state_matrix(at: Frozen) -> tuple[Any, np.ndarray, float, np.ndarray]:
    """(A, size of each rate, error, steps of the differences): colour by colour of the pattern of the model.

    size : float64[n]  sum of |A_ij| times the small deviation of state j
    """
    from scipy.sparse import csc_array

    model, n, width = at.model, at.model.y_size, widths(at)
    pattern = model.structure.pattern[:n].tocsc()
    pattern.sort_indices()
    rows, starts = pattern.indices, pattern.indptr[:-1]
    columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
    for steps in (STEPS, FINER):
        slopes, sides = entries(at, width, rows, columns, steps)
        size = np.bincount(rows, np.abs(slopes[len(steps) // 2]), n)
        size = np.maximum(size, ROUNDING * width * np.max(size / width, initial=0.0))
        row_size = np.where(size > 0.0, size, 1.0)[rows]
        values, errors = settled(slopes, row_size, starts)
        coarse = np.bincount(rows, np.abs(slopes[0]), n)[rows]
        hidden = hidden_kinks(sides, coarse, row_size, starts, steps) & ~in_basins(model)
        bent = kinks(sides, row_size, starts) + hidden
        if max(np.max(errors), np.max(bent)) <= SMOOTH:
            break
    else:
        what = "slope" if np.max(errors) > SMOOTH else "kink"
        refuse(model, int(np.argmax(errors if what == "slope" else bent)), what)
    a = csc_array((values / width[columns], rows, pattern.indptr), shape=(n, n))
    try_directions(at, a, width, size, steps)
    return (a if n > DENSE else a.toarray()), size, float(np.max(errors)), steps


def entries(at: Frozen, width, rows, columns, steps) -> tuple[np.ndarray, np.ndarray]:
    """(slopes, sides) of the entries at `rows` and `columns` : float64[steps, entries], per small deviation."""
    structure, slopes, sides = at.model.structure, [], []
    base = responses(at, at.y, 0)
    for color in range(structure.color_count):
        direction = np.where(structure.colors == color, width, 0.0)
        slope, side = central(lambda y: responses(at, y, 0), at.y, direction, base, steps)
        slopes.append(slope)
        sides.append(side)
    picked = (slice(None), structure.colors[columns], rows)
    return np.array(slopes).transpose(1, 0, 2)[picked], np.array(sides).transpose(1, 0, 2)[picked]


def in_basins(model) -> np.ndarray:
    """True for states of basins : bool[n]; upwind fluxes of still water bend by some 1e-4 of their row."""
    ahead = tuple(f"{basin.name}." for basin in model.basins)
    return np.array([name.startswith(ahead) for name in model.state_names]) if ahead else np.zeros(model.y_size, bool)


def refuse(model, j: int, what: str) -> None:
    """Raise for a state along which there is no derivative."""
    basin = next((one for one in model.basins if model.state_names[j].startswith(f"{one.name}.")), None)
    if basin is not None:
        text = (
            "fluxes of this basin have a kink so near its state (waves as quick from both sides, cells that fall dry)"
        )
        raise FvsolveError(f"the state cannot be linearised along {model.state_names[j]}: {text}; wanted another state")
    why = {
        "slope": "its slope has no end there, as that of a valve at a drop of zero: give the valve "
                 "laminar_reynolds, or linearise while it flows (--at)",
        "kink": "its slope differs from side to side there (a tank dry or full, an end-stop or a seat just touched): "
                "another time with --at",
    }[what]  # fmt: skip
    raise FvsolveError(f"the state cannot be linearised along {model.state_names[j]}: {why}")


def try_directions(at: Frozen, a, width: np.ndarray, size: np.ndarray, steps: np.ndarray) -> None:
    """Whether A says what happens along whole directions too: raises where f is homogeneous but not linear."""
    model, rng = at.model, np.random.default_rng(1)
    base = responses(at, at.y, 0)
    for _ in range(DIRECTIONS):
        direction = width * rng.choice([-1.0, 1.0], width.size)
        slope, _ = central(lambda y: responses(at, y, 0), at.y, direction, base, steps)
        apart = np.abs(slope - a @ direction) / np.where(size > 0.0, size, 1.0)
        worst = np.min(apart, axis=0)
        if np.max(worst) > SMOOTH:
            where = model.state_names[int(np.argmax(worst))]
            raise FvsolveError(f"the state cannot be linearised: the rate of {where} is no linear function of small "
                               "deviations together; choose another time with --at")  # fmt: skip


def output_matrix(at: Frozen, outputs: int, steps: np.ndarray) -> tuple[np.ndarray, float]:
    """(C, error), state by state of those that an output hangs on."""
    n, width = at.model.y_size, widths(at)
    if outputs == 0:
        return np.zeros((0, n)), 0.0
    if n * outputs > LARGEST:
        raise too_large(n, outputs)
    latest, base = time.monotonic() + LONGEST, responses(at, at.y, outputs)
    slopes, sides = np.zeros((2, len(steps), n, outputs))
    for j in seen(at, outputs, base[n:], width):
        if time.monotonic() > latest:
            raise too_large(n, outputs)
        direction = np.zeros(n)
        direction[j] = width[j]
        found = central(lambda y: responses(at, y, outputs), at.y, direction, base, steps)
        slopes[:, j], sides[:, j] = (one[:, n:] for one in found)
    size = np.sum(np.abs(slopes[len(steps) // 2]), axis=0)
    size = np.maximum(size, NOISE / steps[0] * np.abs(base[n:]))
    row_size = np.tile(np.where(size > 0.0, size, 1.0), n)
    each = np.arange(n * outputs)  # with a step of its own: what a hose wants rounds off what a valve says
    values, errors = settled(slopes.reshape(len(steps), -1), row_size, each)
    bent = np.maximum(kinks(sides.reshape(len(steps), -1), row_size, each), errors)
    if np.max(bent) > SMOOTH:
        j, k = divmod(int(np.argmax(bent)), outputs)
        raise FvsolveError(f"{at.model.case.probes[k].text} cannot be linearised along {at.model.state_names[j]}: its "
                           "slope differs there from side to side, or with every step; leave it out of --outputs, or "
                           "choose another time with --at")  # fmt: skip
    return values.reshape(n, outputs).T / width, float(np.max(errors))


def too_large(n: int, outputs: int) -> FvsolveError:
    """What to say of a C that is not found."""
    return FvsolveError(f"C of {n} states and {outputs} outputs is too large, or takes longer than {LONGEST:g} s: ask "
                        "for fewer --outputs, or give pipes or basins fewer cells, --set links.NAME.cells=100 or "
                        "nodes.NAME.cells=[20,20]")  # fmt: skip


def seen(at: Frozen, outputs: int, base: np.ndarray, width: np.ndarray) -> Iterator[int]:
    """States that move some output, found by halves: of a half that moves none by one bit none does."""
    rng, n = np.random.default_rng(2), width.size
    direction = rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n) * width * STEPS[0]
    halves = [(0, n)]
    while halves:
        low, high = halves.pop()
        part = np.zeros(n)
        part[low:high] = direction[low:high]
        ends = (responses(at, at.y + sign * part, outputs)[n:] for sign in (1.0, -1.0))
        if all(np.array_equal(end, base) for end in ends):
            continue
        if high - low == 1:
            yield low
        else:
            middle = (low + high) // 2
            halves += [(middle, high), (low, middle)]
