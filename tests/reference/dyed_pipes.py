"""Cases of pipes with a dye, and the solution of Ogata and Banks."""

import math

import numpy as np
from scipy.special import erfc

import fvsolve
from reference.scenes import AMBIENT, area, chamber, junction, pipe, ramp, reservoir, scene, valve

MUSCL = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2", "courant": 0.9}
# flow [m/s], bore of pipes [m], waves [m/s] (slow, for few steps)
SPEED, BORE, SLOW = 1.0, 0.1, 20.0
FLOW = SPEED * area(BORE)


def given(**dye) -> dict:
    """Return a reservoir at the pressure at which pipes have their stated area."""
    return reservoir(AMBIENT, **({"scalars": dye} if dye else {}))


def line(start, end, length=10.0, cells=100, **more) -> dict:
    return pipe(start, end, length, BORE, SLOW, cells, **more)


def case_of(nodes, links, end, numerics=None, probes=(), **dye) -> dict:
    return scene(
        nodes, links, end, {**MUSCL, **(numerics or {})}, probes, end / 50, scalars={"dye": dye}
    )


def at_end(case: dict) -> tuple:
    """Return (model, fields of the last state)."""
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.advance(model, fvsolve.initial_state(model), case["numerics"]["end"])
    return model, model.fields(state.y, model.evaluate(state.t, state.y)[1])


def ogata_banks(x, t, d):
    """Value in a semi-infinite pipe with the inlet at 1 from t = 0 on (Ogata and Banks 1961)."""
    width = 2.0 * math.sqrt(d * t)
    back = np.exp(SPEED * x / d) * erfc((x + SPEED * t) / width)
    return 0.5 * (erfc((x - SPEED * t) / width) + back)


HAMMER = {
    "lake": reservoir(5e5),
    "mid": junction(),
    "gate": junction(),
    "box": chamber(0.05),
    "sea": reservoir(1e5),
}


def hammer(scheme: str, friction: dict, **dye) -> dict:
    links = {
        "a": pipe("lake", "mid", 60.0, 0.1, 1000.0, 30, friction=friction),
        "b": pipe(
            "gate", "mid", 40.0, 0.1, 1200.0, 17, friction=friction, retardation={"dye": 1.288}
        ),
        "side": pipe("mid", "box", 10.0, 0.05, 1000.0, 4, friction=friction),
        "v": valve("gate", "sea", 0.003, opening=ramp(0.05, 0.1, 1.0, 0.0)),
    }
    case = case_of(
        HAMMER,
        links,
        1.5,
        {"scheme": scheme, "method": "ssp-rk3"},
        ["gate.dye", "gate.pressure"],
        **dye,
    )
    return case
