"""Valve-controlled cylinder with mass and spring as y' = f(t, y), compiled by numba.

A four-port valve with a small underlap supplies oil through two short hoses of 0.3 cm3 to both sides of a double-acting
cylinder, whose rod moves a mass on a spring. Two strokes: the valve moves as sin(2 pi t / PERIOD). Each of the six
states has a unit that makes it of order one, because LSODA in numbalsoda takes one absolute tolerance for all:
pressures in 10 MPa at the valve's ports A and B and in the chambers A and B, stroke in 0.1 m, velocity in 1 m/s.

Orifices: q = C sign(dp) |dp| / (dp^2 + d^2)^(1/4), C = Cd A sqrt(2/rho), with a finite slope at dp = 0.
"""

from math import pi, sin, sqrt

import numba
import numpy as np

UNITS = np.array([1e7, 1e7, 1e7, 1e7, 0.1, 1.0])  # [Pa, Pa, Pa, Pa, m, m/s]
NAMES = ("hose A", "hose B", "chamber A", "chamber B", "stroke", "velocity")
PERIOD, END = 0.2, 0.2  # [s]
SUPPLY, TANK = 1.5e7, 1e5  # [Pa]
BETA, RHO = 1.2e9, 860.0  # bulk modulus [Pa], density [kg/m3]
# coefficient of a metering edge, fully open [m3/s/sqrt(Pa)]
VALVE = 0.61 * 1.0e-5 * sqrt(2.0 / RHO)
HOSE = 0.61 * 1.5e-5 * sqrt(2.0 / RHO)  # coefficient of the port of a chamber [m3/s/sqrt(Pa)]
SOFT = 2e4  # pressure drop below which orifices are laminar [Pa]
UNDERLAP = 0.02  # fraction of the stroke of the valve
HOSE_VOLUME, DEAD_VOLUME = 3e-7, 1e-5  # [m3]
AREA_A, AREA_B, STROKE = 8e-4, 5e-4, 0.1  # [m2, m2, m]
LEAKAGE = 1e-13  # between the chambers [m3/s/Pa]
MASS, STIFFNESS, DAMPING = 20.0, 2e4, 400.0  # [kg, N/m, N s/m]
START = 0.02  # position at which the spring has no force [m]
P_A = 5e6  # pressure of A at the start, which that of B balances [Pa]


@numba.jit(error_model="numpy")
def orifice(c, dp):
    """Flow [m3/s] through an orifice with coefficient c at a pressure drop dp [Pa]."""
    return c * dp / sqrt(sqrt(dp * dp + SOFT * SOFT))


@numba.jit(error_model="numpy")
def edge(s):
    """Opening of a metering edge at spool position s: nearly s if positive, nearly 0 if negative, smooth between."""
    return 0.5 * (s + sqrt(s * s + UNDERLAP * UNDERLAP))


@numba.jit(error_model="numpy")
def rhs(t, y, dydt):
    """Rates dydt = f(t, y) of the states in UNITS."""
    a = 1e7 * y[0]
    b = 1e7 * y[1]
    p_a = 1e7 * y[2]
    p_b = 1e7 * y[3]
    x, v = 0.1 * y[4], y[5]
    s = sin(2.0 * pi / PERIOD * t)
    up, down = VALVE * edge(s), VALVE * edge(-s)
    into_a = orifice(up, SUPPLY - a) - orifice(down, a - TANK)
    into_b = orifice(down, SUPPLY - b) - orifice(up, b - TANK)
    hose_a, hose_b = orifice(HOSE, a - p_a), orifice(HOSE, b - p_b)
    leak = LEAKAGE * (p_a - p_b)
    dydt[0] = 1e-7 * BETA / HOSE_VOLUME * (into_a - hose_a)
    dydt[1] = 1e-7 * BETA / HOSE_VOLUME * (into_b - hose_b)
    dydt[2] = 1e-7 * BETA / (DEAD_VOLUME + AREA_A * x) * (hose_a - leak - AREA_A * v)
    dydt[3] = 1e-7 * BETA / (DEAD_VOLUME + AREA_B * (STROKE - x)) * (hose_b + leak + AREA_B * v)
    dydt[4] = 10.0 * v
    dydt[5] = (AREA_A * p_a - AREA_B * p_b - STIFFNESS * (x - START) - DAMPING * v) / MASS


def start():
    """State y at t = 0, at rest with balanced forces : float64[6]."""
    p_b = P_A * AREA_A / AREA_B
    return np.array([P_A, p_b, P_A, p_b, START, 0.0]) / UNITS


def jacobian(t, y):
    """Jacobian df/dy by central differences : float64[6, 6] [1/s]."""
    found = np.empty((6, 6))
    high = np.empty(6)
    low = np.empty(6)
    for j in range(6):
        step = np.zeros(6)
        step[j] = 1e-7
        rhs(t, y + step, high)
        rhs(t, y - step, low)
        found[:, j] = (high - low) / 2e-7
    return found


def greatest_eigenvalue(times, states):
    """Largest modulus of an eigenvalue of df/dy along a trajectory [1/s]."""
    return max(
        np.abs(np.linalg.eigvals(jacobian(t, y))).max() for t, y in zip(times, states, strict=True)
    )
