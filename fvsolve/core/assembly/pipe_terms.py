"""Terms of pipes with states of their own: unsteady friction, and Kelvin-Voigt elements of creeping walls.

The weighting function W(tau) depends on the dimensionless time tau = 4 nu t / D^2: kinematic viscosity nu, time t,
diameter D. s is the Laplace variable of tau. A sum is fitted to the transform of W along s = i w, i the imaginary unit,
the value for a wave of dimensionless angular frequency w, over all w that cells resolve and that fit into the run.
"""

import functools
import math

import numpy as np

ACCURACY = 1e-4
LAMINAR = 2000.0  # Reynolds number of the start below which Zielke's function is used
FASTEST_DECAY = 1.9  # decay of the fastest term times the travel time of a cell
MAX_TERMS = 40
# Allowed error at w: 2 (w / top)^3, at most 0.3; last w over top
ERROR_FACTOR, MAX_ERROR, LAST_FREQUENCY = 2.0, 0.3, 0.7
SLOWEST_DECAYS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # slowest decay over the lowest frequency
# frequency below which the transform of Zielke's function is nearly its value at zero, 1/12
FLAT_FREQUENCY = 4.0
MAX_ZEROS = 8  # greatest number of zeros of J_2 that are used as exact decays


def zielke(s: np.ndarray) -> np.ndarray:
    """Laplace transform W(s) of Zielke's weighting function, from the exact laminar velocity profile.

    W(tau) is the sum of exp(-j^2 tau) over the zeros j of the Bessel function J_2. s (1 + 8/s + 4 W(s)) is the exact
    laminar s I_0(x) / I_2(x), x = sqrt(s), with modified Bessel functions I; Zielke, J. Basic Eng. 90 (1968) 109.
    """
    from scipy.special import ive

    x = np.sqrt(np.asarray(s, dtype=complex))
    return 0.25 * (ive(0, x) / ive(2, x) - 1.0 - 8.0 / x**2)


def inverse_root(s: np.ndarray) -> np.ndarray:
    """Laplace transform of W = 1 / sqrt(pi tau), Vardy and Brown's function without its coefficients A* and B*."""
    return 1.0 / np.sqrt(np.asarray(s, dtype=complex))


def vardy_brown(reynolds: float, roughness: float) -> tuple[float, float]:
    """Coefficients (A*, B*) of W = A* exp(-B* tau) / sqrt(tau) in turbulent flow.

    reynolds : Reynolds number Re; roughness : relative to the diameter, e/D. Smooth walls, A* = 1 / (2 sqrt(pi)), B* =
    Re^k / 12.86, k = log10(15.29 / Re^0.0567): Vardy and Brown, J. Sound Vib. 259 (2003) 1011. Fully rough walls, A* =
    0.0103 sqrt(Re) (e/D)^0.39, B* = 0.352 Re (e/D)^0.41: Vardy and Brown, J. Sound Vib. 270 (2004) 233. The result is
    the pair with the greater A*.
    """
    smooth = 0.5 / math.sqrt(math.pi), reynolds ** math.log10(15.29 / reynolds**0.0567) / 12.86
    rough = 0.0103 * math.sqrt(reynolds) * roughness**0.39, 0.352 * reynolds * roughness**0.41
    return max(smooth, rough)


def terms(
    weighting: str, reynolds: float, roughness: float, cell: float, span: float, accuracy: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Terms of W as a sum of m exp(-n tau) : (m, n, highest angular frequency w at which it is accurate).

    w is in units of 1 / tau. weighting : "zielke" or "vardy-brown"; reynolds, roughness : as for `vardy_brown`
    cell : travel time of a wave through a cell, as tau; span : duration of the run, as tau; accuracy : as for `fit`
    """
    top = 2.0 ** math.floor(math.log2(FASTEST_DECAY / cell))
    top = max(top, 512.0) if weighting == "zielke" else top
    highest = top * (accuracy / ERROR_FACTOR) ** (1.0 / 3.0)
    if weighting == "zielke":
        return *fit(
            "zielke", top, max(_power_of_two(1.0 / span), FLAT_FREQUENCY), accuracy
        ), highest
    a, b = vardy_brown(reynolds, roughness)
    # along s = B* + i w, then shifted
    m, n = fit("root", top, _power_of_two(max(1.0 / span, 0.25 * b)), accuracy)
    return a * math.sqrt(math.pi) * m, n + b, highest


def _power_of_two(x: float) -> float:
    """Greatest power of two up to x."""
    return 2.0 ** math.floor(math.log2(x))


@functools.lru_cache(maxsize=256)
def fit(transform: str, top: float, low: float, accuracy: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights and decays (m, n) whose sum of m / (s + n) fits a transform W(s) at s = i w, from w = low on.

    All m are positive, n is increasing, and there are as few terms as possible. The relative error is at most
    `accuracy`; where decays up to `top` cannot follow, at most 2 (w / top)^3 and 0.3. As 1 / top is near the travel
    time of a cell, that is third order in the cell size. Decays are in geometric progression; m follows from
    nonnegative least squares of (sum of m / (s + n)) / W(s) - 1. The result is checked at all samples of w. Raises
    ArithmeticError if MAX_TERMS terms are too few.
    transform : "zielke" or "root" (`inverse_root`)
    """
    exact, heads = (zielke, _zeros()) if transform == "zielke" else (inverse_root, [np.zeros(0)])
    w = np.geomspace(
        min(low, 0.01 * top), LAST_FREQUENCY * top, 32 + int(10 * math.log(max(top / low, 4.0)))
    )
    value = exact(1j * w)
    tolerance = np.maximum(accuracy, np.minimum(ERROR_FACTOR * (w / top) ** 3, MAX_ERROR))
    for count in range(2, MAX_TERMS + 1):
        fits = (_weights(w, value, tolerance, n) for n in _decays(heads, w[0], top, count))
        error, m, n = min(fits, key=lambda candidate: candidate[0])
        if error <= 1.0:
            return m[m > 0.0], n[m > 0.0]
    raise ArithmeticError(
        f"no sum of {MAX_TERMS} exponentials reaches an accuracy of {accuracy:g}"
    )  # pragma: no cover


def _zeros() -> list[np.ndarray]:
    """Squares of the first zeros of the Bessel function J_2: lists of 0 to MAX_ZEROS of them."""
    from scipy.special import jn_zeros

    squares = jn_zeros(2, MAX_ZEROS) ** 2
    return [squares[:k] for k in range(MAX_ZEROS + 1)]


def _decays(starts, low: float, top: float, count: int):
    """Yield sets of `count` decays to try: geometric from about `low` to `top`, or continued from given first decays.

    starts : sets of first decays, which may be empty
    """
    for given in starts:
        if given.size == 0:
            yield from (np.geomspace(bottom * low, top, count) for bottom in SLOWEST_DECAYS)
        elif given.size < count and given[-1] < top:
            first = given[-1] * (1.0 + 1.3 / (given.size + 0.5))
            yield np.concatenate(
                [given, np.geomspace(first, max(top, 1.01 * first), count - given.size)]
            )


def _weights(w, value, tolerance, n):
    """Best nonnegative weights m of a sum with decays n : (greatest relative error over its tolerance, m, n).

    w, value, tolerance : frequencies, and the transform and its tolerance there
    """
    from scipy.optimize import nnls

    shares = 1.0 / (1j * w[:, None] + n) / (tolerance * value)[:, None]
    target = np.concatenate([1.0 / tolerance, np.zeros(w.size)])
    m = nnls(np.vstack([shares.real, shares.imag]), target, maxiter=100 * n.size)[0]
    return float(np.max(np.abs(shares @ m - target[: w.size]))), m, n


def reserve_terms(draft, row) -> None:
    """Reserve space in `floats` for the relaxation terms of unsteady friction of a pipe.

    The terms depend on its flow at the start.
    """
    row["term"] = len(draft.floats)
    draft.floats += [0.0] * (2 * MAX_TERMS)


def add_terms(draft) -> dict[str, dict]:
    """Add terms and states of pipes with unsteady friction, from flows at the start; return facts for `check`.

    The rate that limits explicit steps is increased where terms need it. Adds a fault if the weighting function needs a
    flow at the start, or if no sum of exponentials is accurate enough.
    """
    facts = {}
    settings = draft.tables.settings[0]
    floats = draft.tables.floats
    numerics, fluid = draft.case.numerics, draft.fluid
    for name, row, mesh in zip(draft.pipe_names, draft.pipe_table, draft.meshes, strict=True):
        law = draft.case.conduits[name].friction
        if law.model != "unsteady":
            continue
        unit = 4.0 * fluid.viscosity / (fluid.density * mesh.diameter**2)  # tau per time [1/s]
        reynolds = abs(float(row["flow"])) * mesh.diameter / (float(row["area"]) * fluid.viscosity)
        weighting = law.weighting or ("zielke" if reynolds < LAMINAR else "vardy-brown")
        if weighting == "vardy-brown" and reynolds == 0.0:
            reason = "vardy-brown needs the Reynolds number of the start, but there is no flow"
            draft.fault(
                f"links.{name}.friction.weighting",
                f"{reason}; expected an initial flow, or `zielke`",
            )
            continue
        cell, span = unit * row["dx"] / row["speed"], unit * (numerics.end - numerics.start)
        accuracy = ACCURACY if law.accuracy is None else law.accuracy
        try:
            m, n, highest = terms(
                weighting, reynolds, (law.roughness or 0.0) / mesh.diameter, cell, span, accuracy
            )
        except ArithmeticError as error:
            text = f"{error}; try a greater number for `accuracy`, or more cells"
            draft.fault(f"links.{name}.friction.accuracy", text)
            continue
        gain, rate = 4.0 * unit * m, unit * n
        floats[row["term"] : row["term"] + 2 * m.size] = np.column_stack([gain, rate]).ravel()
        row["terms"] = m.size
        names = [f"{name}.memory{k}[{i}]" for k in range(m.size) for i in range(mesh.cells)]
        row["memory"] = draft.states(names, 1e5 * row["admittance"])
        # upwind schemes reach twice that, so the other terms count half
        waves = row["speed"] / row["dx"] * row["rate_factor"]
        fastest = float(max(waves, 0.5 * rate[-1]) + 0.5 * gain.sum())
        settings["rate"] = max(settings["rate"], fastest)
        facts[name] = {
            "weighting": weighting,
            "terms": m.size,
            "accuracy": accuracy,
            "rate": fastest,
            "frequency": highest * unit / (2.0 * math.pi),
        }
    return facts


def memory_shares(floats: np.ndarray, row) -> np.ndarray:
    """Ratio g / n of gain and rate of every unsteady friction term of a pipe : float64[terms].

    A memory state z [kg/s] stores the energy (g / n) z^2 / (2 rho A) per length, rho the density and A the area.
    """
    pairs = floats[row["term"] : row["term"] + 2 * row["terms"]].reshape(-1, 2)
    return pairs[:, 0] / pairs[:, 1]


def add_creep(draft, name: str, link, row) -> None:
    """Add coefficients and states of a pipe's Kelvin-Voigt elements; add faults where creep is not supported."""
    if not link.creep_elements:
        return
    place = f"links.{name}.wall.creep"
    if draft.case.scalars:
        draft.fault(
            place,
            "takes up liquid, whose scalars are not computed; remove either the scalars or the creep",
        )
    if any(getattr(draft.case.places[end], "on", None) for end in link.ports.values()):
        draft.fault(place, "is not supported for a pipe on a body; remove the creep")
    numbers = np.column_stack(gains(link, draft.fluid.density, float(row["speed"])))
    row["elements"], row["element"] = len(numbers), len(draft.floats)
    draft.floats += numbers.ravel().tolist()
    names = [f"{name}.creep{k}[{i}]" for k in range(len(numbers)) for i in range(link.cells)]
    row["strain"] = draft.states(names, 1e5 * row["admittance"])


def gains(link, density: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of every Kelvin-Voigt element of a pipe : (gain G / tau [1/s], rate 1 / tau [1/s]).

    tau : retardation time [s]. G is the final volume that the element takes up, relative to the volume that wall and
    liquid take up elastically: G = c D K J / e, with restraint factor c, diameter D, effective bulk modulus K = rho
    a^2, creep compliance J, wall thickness e.
    """
    growth, time = np.array(link.creep_elements).T
    return growth * density * speed**2 / time, 1.0 / time


def elements(floats: np.ndarray, row) -> np.ndarray:
    """Gain and rate of every Kelvin-Voigt element of a pipe [1/s] : float64[elements, 2]."""
    return floats[row["element"] : row["element"] + 2 * row["elements"]].reshape(-1, 2)


def mass_in_creep(floats: np.ndarray, row, y: np.ndarray) -> float:
    """Mass in the volume that a wall has gained by creep since the start [kg]."""
    total, n = 0.0, int(row["cells"])
    for k, (gain, rate) in enumerate(elements(floats, row)):
        at = row["strain"] + k * n
        total += gain / rate * float(np.sum(y[at : at + n]))
    return total * float(row["dx"] / row["speed"])


def limit_creep_step(draft, unsteady: dict) -> dict[str, dict]:
    """Increase the rate that limits explicit steps to the greatest rate of a pipe with creep; return facts for `check`.

    unsteady : result of `add_terms`
    The result is name of a pipe -> facts, with the wave speed after complete creep as `slow_speed` [m/s].
    """
    result, settings = {}, draft.tables.settings[0]
    for name, row in zip(draft.pipe_names, draft.pipe_table, strict=True):
        if row["elements"] == 0:
            continue
        gain, rate = elements(draft.tables.floats, row).T
        waves = unsteady.get(name, {}).get("rate", row["speed"] / row["dx"] * row["rate_factor"])
        fastest = float(max(waves, 0.5 * rate.max()) + 0.5 * gain.sum())
        settings["rate"] = max(settings["rate"], fastest)
        slow = float(row["speed"]) / float(np.sqrt(1.0 + (gain / rate).sum()))
        result[name] = {"elements": len(gain), "slow_speed": slow, "rate": fastest}
    return result
