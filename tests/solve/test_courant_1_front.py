"""Fronts with friction by the upwind scheme and the Euler method at Courant 1: the method of characteristics."""

import math

import numpy as np
import pytest

import fvsolve

LENGTH, DIAMETER, SPEED, GRAVITY, RHO = 20000.0, 0.4, 1000.0, 9.80665, 1000.0
AREA = math.pi / 4.0 * DIAMETER**2
FRICTION = {
    "steady": {"model": "steady", "factor": 0.02},
    "quasi-steady": {"model": "quasi-steady", "roughness": 1e-4},
    "hazen-williams": {"model": "hazen-williams", "coefficient": 120.0},
}


def main(friction, cells, numerics=None):
    """Case of a main whose demand of 0.1 m3/s at its end stops at 1 s; the front returns from the lake."""
    return {
        "schema": 1,
        "ambient_pressure": 5e7,
        "fluid": {
            "name": "user",
            "density": RHO,
            "bulk_modulus": 2.2e9,
            "viscosity": 1e-3,
            "vapor_pressure": 0.0,
        },
        "nodes": {
            "lake": {"type": "reservoir", "head": 100.0},
            "gate": {
                "type": "junction",
                "demand": {"start": 1.0, "duration": 0.0, "value": [0.1, 0.0]},
            },
        },
        "links": {
            "main": {
                "type": "pipe",
                "from": "lake",
                "to": "gate",
                "length": LENGTH,
                "diameter": DIAMETER,
                "wave_speed": SPEED,
                "cells": cells,
                "friction": FRICTION[friction],
            }
        },
        "numerics": {"end": 30.0, "scheme": "upwind", "method": "euler", "courant": 1.0}
        | (numerics or {}),
        "output": {"fields": 0, "every": 0.1, "probes": ["main.flow@0"]},
    }


def head_loss(friction, flow):
    """Loss of head per length of a flow [m3/s], by the law of the case."""
    v = flow / AREA
    if friction == "hazen-williams":
        return 10.6668 * np.sign(flow) * np.abs(flow) ** 1.852 / (120.0**1.852 * DIAMETER**4.8704)
    factor = 0.02
    if friction == "quasi-steady":
        from fluids.friction import Colebrook

        sizes = np.maximum(np.abs(v) * RHO * DIAMETER / 1e-3, 1.0)
        table = np.geomspace(1.0, 1e7, 400)
        known = [64.0 / re if re < 2000.0 else Colebrook(re, 1e-4 / DIAMETER) for re in table]
        factor = np.interp(np.log(sizes), np.log(table), known)
    return factor * v * np.abs(v) / (2.0 * GRAVITY * DIAMETER)


def least_flow(friction, reaches=800):
    """Least flow at the lake up to 30 s [m3/s], by characteristics with friction by the trapezoidal rule."""
    dx = LENGTH / reaches
    b, flow = SPEED / (GRAVITY * AREA), np.full(reaches + 1, 0.1)
    head = 100.0 - head_loss(friction, flow[:1]) * np.linspace(0.0, LENGTH, reaches + 1)
    least, steps = 0.1, round(29.0 * SPEED / dx)
    for _ in range(steps):
        loss = 0.5 * dx * head_loss(friction, flow)
        plus = head[:-1] + b * flow[:-1] - loss[:-1]  # to the right neighbour
        minus = head[1:] - b * flow[1:] + loss[1:]  # to the left neighbour
        new = flow.copy()
        for _ in range(3):
            own = 0.5 * dx * head_loss(friction, new)
            new[1:-1] = (plus[:-1] - minus[1:]) / (2.0 * b) - own[1:-1] / b
            new[0], new[-1] = (100.0 - minus[0] - own[0]) / b, 0.0
        own = 0.5 * dx * head_loss(friction, new)
        head[1:-1] = 0.5 * (plus[:-1] + minus[1:])
        head[0], head[-1] = 100.0, plus[-1] - own[-1]
        flow = new
        least = min(least, flow[0])
    return least


@pytest.mark.parametrize("friction", FRICTION)
def test_the_first_cell_of_a_front_is_damped(friction):
    """The front decays on its way; with the friction of the old waves of a cell its first cell kept -0.1 m3/s."""
    exact = least_flow(friction)
    errors = [
        abs(np.min(fvsolve.run(main(friction, cells))["main.flow@0"]) - exact)
        for cells in (50, 200)
    ]
    assert errors[0] < 0.02 * abs(exact) and errors[1] < max(0.4 * errors[0], 1e-3 * abs(exact))
    if friction == "steady":
        assert exact == pytest.approx(-0.0657, abs=2e-4)


def test_a_steady_flow_stays_to_the_bit():
    case = main("steady", 50)
    case["nodes"]["gate"]["demand"] = 0.1
    assert np.ptp(fvsolve.run(case)["main.flow@0"]) == 0.0
