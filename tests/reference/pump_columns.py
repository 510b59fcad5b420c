"""Cases of a pump that trips and a rigid column, and their solution by SciPy."""

from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from reference.scenes import GRAVITY, RHO, area, junction, lake, pump, scene

OMEGA, INERTIA, EFFICIENCY = 150.0, 2.0, 0.8
TORQUE = RHO * GRAVITY * 0.1 * 50.0 / EFFICIENCY / OMEGA  # at the rated point
BORE, LENGTH, FACTOR = 0.3, 500.0, 0.02
SECTION = area(BORE)
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}


def head(n, q):
    """Head [m] of the one-point curve, 50 / 3 (4 n^2 - v |v|) with v = q / 0.1, also for reverse flow."""
    return 50.0 / 3.0 * (4.0 * n * n - q * abs(q) / 0.01)


def torque(n, q):
    """Torque [N m]: T_R n^2 (2 + u) / 3 with u = q / (n q_R) limited to 0 to 4; zero if n is not positive."""
    return TORQUE * n * n * (2.0 + min(max(q / (n * 0.1), 0.0), 4.0)) / 3.0 if n > 0.0 else 0.0


def column(lift: float, end: float, probes, numerics=None, **keys) -> dict:
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(lift)}
    rigid = {"type": "rigid-column", "from": "out", "to": "top", "length": LENGTH, "diameter": BORE}
    rigid["friction"] = {"model": "steady", "factor": FACTOR}
    return scene(
        nodes,
        {"pump": pump("sump", "out", **keys), "main": rigid},
        end,
        numerics or TIGHT,
        probes,
        0.05,
    )


def column_truth(lift, n0, q0, trip, end, head=head, torque=torque, check=False):
    """Return SciPy's solution (n, q) of pump, rigid column and lakes after a trip."""
    loss = FACTOR * LENGTH / BORE / (2.0 * GRAVITY * SECTION**2)

    def rate(t, y):
        n, q = y
        dq = GRAVITY * SECTION / LENGTH * (head(n, q) - lift - loss * q * abs(q))
        return [-torque(n, q) / (INERTIA * OMEGA), dq]

    stop = lambda t, y: y[1]  # noqa: E731
    stop.terminal, stop.direction = check, -1
    options = {
        "method": "DOP853",
        "rtol": 1e-12,
        "atol": 1e-14,
        "dense_output": True,
        "events": stop,
    }
    return solve_ivp(rate, (trip, end), [n0, q0], **options)


def operating_flow(lift, f=lambda q: head(1.0, q)):
    loss = FACTOR * LENGTH / BORE / (2.0 * GRAVITY * SECTION**2)
    return brentq(lambda q: f(q) - lift - loss * q * q, 1e-3, 0.25, xtol=1e-15)
