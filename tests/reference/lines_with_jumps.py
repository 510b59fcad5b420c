"""Delay lines of cases with sudden changes."""

from reference.scenes import NO_FRICTION

SPEED = 1000.0
EXACT = {"pipe_model": "finite-volume", "scheme": "upwind", "method": "euler", "courant": 1.0}


def line(one: str, other: str, length: float, bore: float = 0.3, **keys) -> dict:
    return {
        "type": "pipe",
        "from": one,
        "to": other,
        "length": length,
        "diameter": bore,
        "wave_speed": SPEED,
        "friction": NO_FRICTION,
        "cells": 10,
        **keys,
    }
