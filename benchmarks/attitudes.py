"""Methods to step an attitude: errors of spinning tops, drift of invariants, and failure of angles near their pole.

python benchmarks/attitudes.py [--quick]

The reference of the tops is SciPy's DOP853 at 1e-13. The reference of the turn past a pitch of 90 degrees is a rotation
about a fixed axis (43).
"""

from __future__ import annotations

import numpy as np
from measure import agree, parser
from scipy.integrate import solve_ivp

from fvsolve import attitude, integrate
from fvsolve.core.steppers import METHODS

INERTIA = np.array([1.0, 2.0, 3.0])  # [kg m2]
START = attitude.euler_parameters(attitude.of_axis([0.6, 0.8, 0.0], 0.6))
TOPS = {  # weight times lever arm [N m], angular velocity in the body [rad/s], time [s], steps
    "torque-free": (0.0, np.array([0.3, 0.05, 1.2]), 20.0, (400, 1600)),
    "heavy": (5.0, np.array([0.1, 0.2, 6.0]), 10.0, (400, 1600)),
}
DELTAS, STEPS = (0.3, 0.1, 0.03, 0.01, 0.003), (0.05, 0.02, 0.005)
# angular velocity about the y axis of a body rolled by delta [rad/s]
TURN = np.array([0.0, 1.0, 0.0])
WAYS = ("e, R of e/|e|", "e renormalised", "roll-pitch-yaw", "e by gauss-4")


def spin_rate(w, up, weight):
    """dw/dt of a body held at a point on its z axis (68).

    up : vertical direction in the axes of the body
    """
    torque = weight * np.array([up[1], -up[0], 0.0])
    return (torque - np.cross(w, INERTIA * w)) / INERTIA


def by_parameters(weight):
    """Function f(t, y) of Euler parameters e and angular velocity w, with R from e / |e|."""
    return lambda t, y: np.concatenate(
        [
            attitude.euler_parameters_rate(y[:4], y[4:]),
            spin_rate(y[4:], attitude.of_euler_parameters(y[:4])[2], weight),
        ]
    )


def angle_rates(angles, w):
    """Rates of roll, pitch and yaw, E^-1 R w (53), which grow like 1 / cos(pitch)."""
    rotation = attitude.of_roll_pitch_yaw(*angles)
    return np.linalg.solve(attitude.jacobian_roll_pitch_yaw(angles[1], angles[2]), rotation @ w)


def by_angles(weight):
    """Function f(t, y) of roll, pitch, yaw and w."""
    return lambda t, y: np.concatenate(
        [angle_rates(y[:3], y[3:]), spin_rate(y[3:], attitude.of_roll_pitch_yaw(*y[:3])[2], weight)]
    )


def stepped(f, y, end, steps, method="rk4"):
    """State at the end, after equal steps of a method."""
    return integrate(f, y, [0.0, end], method, step=end / steps)[-1]


def renormalised(f, y, end, steps):
    """State at the end, after equal steps of rk4 with e scaled to length 1 after each step."""
    method, h = METHODS["rk4"], end / steps
    for _ in range(steps):
        k = np.zeros((method.stages, y.size))
        for i in range(method.stages):
            k[i] = f(0.0, y + h * (method.a[i] @ k))
        y = y + h * (method.b @ k)
        y[:4] = attitude.unit(y[:4])
    return y


def ends(weight, w, end, steps):
    """Rotations at the end, in the order of WAYS."""
    f, y, of = by_parameters(weight), np.concatenate([START, w]), attitude.of_euler_parameters
    angles = np.concatenate([attitude.roll_pitch_yaw(of(START)), w])
    yield of(stepped(f, y, end, steps)[:4])
    yield of(renormalised(f, y, end, steps)[:4])
    yield attitude.of_roll_pitch_yaw(*stepped(by_angles(weight), angles, end, steps)[:3])
    yield of(stepped(f, y, end, steps, "gauss-4")[:4])


def tops(quick):
    """Rows of the first table: name, steps, largest error of R for each of WAYS; with `quick` a single top for 1 s."""
    for name, (weight, w, end, many) in (
        {"heavy": (*TOPS["heavy"][:2], 1.0, (40,))}.items() if quick else TOPS.items()
    ):
        found = solve_ivp(
            by_parameters(weight), (0.0, end), [*START, *w], "DOP853", rtol=1e-13, atol=1e-14
        ).y[:, -1]
        exact = attitude.of_euler_parameters(found[:4])
        for steps in many:
            yield (
                name,
                steps,
                [float(np.abs(one - exact).max()) for one in ends(weight, w, end, steps)],
            )


def drifts(steps, h=0.05):
    """Rows of the second table: method, relative changes of |e|, energy and moment of momentum of a torque-free top."""
    w = TOPS["torque-free"][1]
    for method in ("rk4", "gauss-4"):
        y = stepped(by_parameters(0.0), np.concatenate([START, w]), steps * h, steps, method)
        sizes = [(np.sqrt(y[:4] @ y[:4]), 1.0)]
        sizes += [
            (of(y[4:]), of(w))
            for of in (lambda v: v @ (INERTIA * v), lambda v: np.linalg.norm(INERTIA * v))
        ]
        yield method, [float(a / b - 1.0) for a, b in sizes]


def past_the_pole(deltas, lengths):
    """Rows of the third table: delta, and for each length of steps the errors of R by angles and by parameters."""
    end = 3.0
    for delta in deltas:
        start = attitude.about_x(delta)
        exact, errors = start @ attitude.of_axis(TURN, end), []
        for h in lengths:
            steps, e = round(end / h), attitude.euler_parameters(start)
            angles = stepped(lambda t, y: angle_rates(y, TURN), [delta, 0.0, 0.0], end, steps)
            e = stepped(lambda t, y: attitude.euler_parameters_rate(y, TURN), e, end, steps)
            found = attitude.of_roll_pitch_yaw(*angles), attitude.of_euler_parameters(e)
            errors += [float(np.abs(one - exact).max()) for one in found]
        yield delta, errors


def main() -> None:
    """Print the three tables."""
    quick = parser(__doc__).parse_args().quick
    steps, deltas, lengths = (40, DELTAS[:1], STEPS[:1]) if quick else (4000, DELTAS, STEPS)
    print(f"largest error of R    steps  {'  '.join(f'{way:>14}' for way in WAYS)}")
    for name, steps, errors in tops(quick):
        agree(f"error of R, {name} top", max(errors) if quick else 0.0, 5e-4)
        print(f"{name:<20}{steps:>7}  {'  '.join(f'{one:14.1e}' for one in errors)}")
    print(f"\n{steps} steps of 0.05 s, torque-free:  |e| - 1    energy  |moment of momentum|")
    for method, found in drifts(steps):
        print(f"{method:<32}{found[0]:>11.1e}{found[1]:>10.1e}{found[2]:>14.1e}")
    print("\npast a pitch of 90 degrees: error of R by roll-pitch-yaw, by Euler parameters")
    print(f"{'delta [rad]':<14}{''.join(f'h = {h:<20g}' for h in lengths)}")
    for delta, errors in past_the_pole(deltas, lengths):
        agree(
            f"error of R past a pitch of 90 degrees, roll of {delta:g} rad", max(errors[1::2]), 1e-7
        )
        pairs = [
            f"{a:.0e}  {b:.0e}".ljust(24) for a, b in zip(errors[::2], errors[1::2], strict=True)
        ]
        print(f"{delta:<14g}{''.join(pairs)}".rstrip())


if __name__ == "__main__":
    main()
