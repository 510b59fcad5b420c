"""Laws of weirs, gates, culverts and manholes in plain Python, written from the formulas of docs/structures.md.

Each law is a function of the levels z1 and z2 at both ends; its flow [m3/s] is positive from 1 to 2.
"""

import math

import numpy as np
from scipy.optimize import brentq, minimize_scalar

G = 9.80665
LINEAR = 1e-3


def both_ways(law):
    """Law of two levels from `law(high, low, first)`, first : True if level 1 is the higher; linear below 1 mm."""

    def flow(z1, z2):
        high, low = max(z1, z2), min(z1, z2)
        share = min((high - low) / LINEAR, 1.0)
        found = share * law(high, min(low, high - LINEAR), z1 >= z2)
        return found if z1 >= z2 else -found

    return flow


def weir(width, crest, coefficient=0.62):
    def law(high, low, first):
        h, r = high - crest, (low - crest) / (high - crest) if high > crest else 0.0
        drowned = (1.0 - r**1.5) ** 0.385 if r > 0.0 else 1.0
        return 2.0 / 3.0 * coefficient * math.sqrt(2.0 * G) * width * max(h, 0.0) ** 1.5 * drowned

    return both_ways(law)


def gate(width, sill, opening, contraction=0.61, coefficient=0.577):
    over, y = weir(width, sill, coefficient), contraction * opening

    def lower_depth(h, q):
        """Depth behind the gate at which a flow q per width has energy and momentum in balance; the greater root."""
        above_jet = h - q * q / (2.0 * G) * (1.0 / y**2 - 1.0 / h**2)
        momentum = 0.5 * above_jet**2 + q * q / (G * y)
        return max(np.roots([0.5, 0.0, -momentum, q * q / G]).real)

    def per_width(h, lower):
        free = y * h * math.sqrt(2.0 * G / (h + y))
        sequent = 0.5 * y * (math.sqrt(1.0 + 8.0 * free * free / (G * y**3)) - 1.0)
        fold = minimize_scalar(
            lambda q: lower_depth(h, q),
            bounds=(0.0, free),
            method="bounded",
            options={"xatol": 1e-9},
        )

        def drowned(depth):
            return brentq(lambda q: lower_depth(h, q) - depth, 0.0, fold.x, xtol=1e-14)

        if lower <= fold.fun:
            return free
        if lower >= sequent:
            return drowned(lower)
        return free + (drowned(sequent) - free) * (lower - fold.fun) / (sequent - fold.fun)

    def law(high, low, first):
        h, over_weir = high - sill, over(high, low)
        return over_weir if h <= y else min(width * per_width(h, low - sill), over_weir)

    return both_ways(law)


def culvert_headwater(diameter, slope, inlet, flow):
    """Headwater [m] of a circular culvert under inlet control; inlet : form, K, M, c, Y, Ks of HDS-5"""
    form, k, m, c, y, ks = inlet
    full = math.pi / 4.0 * diameter**2
    x = 1.811 * flow / (full * math.sqrt(diameter))
    if x >= 4.0:
        return diameter * (c * x * x + y + ks * slope)
    if form == 2:
        return diameter * k * x**m
    depth = critical_depth(diameter, flow)
    area, top, _ = circle(diameter, depth)
    return depth + 0.5 * area / top + diameter * (k * x**m + ks * slope)


def circle(diameter, depth):
    """(area, width of the surface, wetted perimeter) of a circle filled to a depth."""
    angle = 2.0 * math.acos(1.0 - 2.0 * depth / diameter)
    top = diameter * math.sin(0.5 * angle)
    return diameter**2 / 8.0 * (angle - math.sin(angle)), top, 0.5 * diameter * angle


def critical_depth(diameter, flow):
    def imbalance(depth):
        area, top, _ = circle(diameter, depth)
        return area**3 * G - flow**2 * top

    return brentq(imbalance, 1e-6 * diameter, diameter * (1.0 - 1e-12), xtol=1e-15)


def culvert_drowned(diameter, length, manning, losses):
    """Level circular culvert under outlet control, full and with both levels above its crown."""
    area, radius = math.pi / 4.0 * diameter**2, 0.25 * diameter
    factor = (losses + 19.63 * manning**2 * length / radius ** (4.0 / 3.0)) / (2.0 * G * area**2)
    return both_ways(lambda high, low, first: math.sqrt((high - low) / factor))


def manhole(crest, area, perimeter, weir_coefficient=0.54, orifice_coefficient=0.167):
    over = weir(perimeter, crest, weir_coefficient)

    def law(high, low, first):
        drive = max(high - max(low, crest), 0.0)
        orifice = orifice_coefficient * area * math.sqrt(2.0 * G * drive)
        return min(over(high, low), orifice) if first else orifice

    return both_ways(law)
