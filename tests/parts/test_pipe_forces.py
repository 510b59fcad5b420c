"""Forces on legs of a pipe: the momentum that their fluid loses, against Joukowsky and the forces on ends and wall."""

import numpy as np
import pytest
from fluids.friction import friction_factor
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    RHO,
    area,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    valve,
)

import fvsolve
from fvsolve.core.model.build import build
from fvsolve.core.solve import initial_state

DIAMETER, SPEED, VELOCITY, SHUT = 0.3, 1200.0, 0.7, 0.1
FORCE = RHO * SPEED * VELOCITY * area(DIAMETER)
ROUGH = {"model": "quasi-steady", "roughness": 1e-4}
UNSTEADY = {"model": "unsteady", "roughness": 1e-4}


def shut(turned: bool = False, **more) -> dict:
    """Return a case of 840 m of pipe with a bend at 600 m, whose demand stops at once; exact at Courant number 1."""
    q = VELOCITY * area(DIAMETER)
    nodes = {"lake": reservoir(20 * AMBIENT), "gate": junction(step(SHUT, q, 0.0))}
    one = pipe("lake", "gate", 840.0, DIAMETER, SPEED, 42, bends=[600.0], initial_flow=q)
    if turned:
        one |= {"from": "gate", "to": "lake", "bends": ["240 m"], "initial_flow": -q}
    numerics = {"scheme": "upwind", "method": "euler", "courant": 1.0}
    legs = ["main-2.force", "main-1.force"] if turned else ["main-1.force", "main-2.force"]
    return scene(nodes, {"main": one}, 0.9, numerics, legs, every=1.0 / 60.0, **more)


@pytest.mark.parametrize("turned", [False, True])
def test_joukowskys_force_on_a_bend_is_exact(turned: bool) -> None:
    """rho a v A on the leg at the gate while the front runs along it, and then on the leg before it."""
    found = fvsolve.run(shut(turned))
    low, high = (found[name] * (-1 if turned else 1) for name in found.probes)
    t = np.asarray(found.t)
    near = np.min(np.abs(t[:, None] - (SHUT + np.array([0.0, 0.2, 0.7]))), axis=1) < 0.035
    on_high, on_low = (t > SHUT) & (t < SHUT + 0.2), (t > SHUT + 0.2) & (t < SHUT + 0.7)
    assert np.allclose(high[on_high & ~near], FORCE, rtol=1e-12)
    assert np.allclose(low[on_low & ~near], FORCE, rtol=1e-12)
    assert np.max(np.abs(high[~on_high & ~near & (t < SHUT + 0.7)])) <= 1e-9 * FORCE
    assert found.extremes["main-1.force"].maximum <= FORCE * (1.0 + 1e-12)


def throttled(law: str, friction: dict, **numerics) -> dict:
    nodes = {
        "lake": lake(60.0, elevation=0.0),
        "gate": junction(elevation=15.0),
        "air": reservoir(AMBIENT, elevation=15.0),
    }
    one = pipe(
        "lake",
        "gate",
        500.0,
        DIAMETER,
        SPEED,
        25,
        friction=friction,
        bends=[300.0],
        profile={"chainage": [0, 300, 400, 500], "elevation": [0.0, 5.0, 30.0, 15.0]},
    )
    tap = valve("gate", "air", 0.03 * area(DIAMETER), ramp(0.1, 0.4, 1.0, 0.2))
    case = scene(
        nodes,
        {"main": one, "tap": tap},
        1.5,
        {"scheme": "weno5", "method": "rk4", "step": 0.01} | numerics,
        ["main-1.force", "main-2.force"],
        every=0.05,
    )
    case["fluid"] |= {"law": law}
    return case


@pytest.mark.in_turn
@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
@pytest.mark.parametrize(
    ("law", "friction"), [("linear", ROUGH), ("linear", UNSTEADY), ("log", ROUGH)]
)
def test_the_ledger_of_momentum_closes(law: str, friction: dict, method: str) -> None:
    """The probe equals minus the rate of the momentum in the cells, from the rates of the model."""
    case = fvsolve.load(throttled(law, friction, method=method))
    model = build(case)
    state = fvsolve.advance(model, initial_state(model), 0.62)
    dydt = model.rhs(state.t, state.y)
    found = dict(zip([probe.text for probe in model.probes], model.observe(state), strict=True))
    for k, row in enumerate(model.tables.pipes):
        n, o = int(row["cells"]), int(row["y"])
        lost = -float(np.sum(dydt[o : o + n] - dydt[o + n : o + 2 * n])) * float(row["dx"])
        assert found[f"main-{k + 1}.force"] == pytest.approx(lost, rel=1e-10, abs=1e-10 * FORCE)
        assert abs(lost) > 1.0


def test_ends_and_wall_carry_the_lost_momentum() -> None:
    """Under the law `linear` the force is the change of A (p_to - p_from) plus wall friction since the start."""
    case, cells = throttled("linear", ROUGH), [(k + 0.5) / 10 for k in range(10)]
    case["output"]["probes"] += [f"main-2.pressure@{x}" for x in (0, 1)] + [
        f"main-2.flow@{x}" for x in cells
    ]
    found = fvsolve.run(case)

    def pull(q):
        v = q / area(DIAMETER)
        reynolds = np.abs(v) * DIAMETER * RHO / 1e-3
        factor = np.array([friction_factor(Re=one, eD=1e-4 / DIAMETER) for one in reynolds])
        return factor * RHO * np.abs(v) * v / (2 * DIAMETER) * area(DIAMETER) * 20.0

    rise = found["main-2.pressure@1"] - found["main-2.pressure@0"]
    wall = sum(pull(found[f"main-2.flow@{x}"]) for x in cells)
    borne = area(DIAMETER) * (rise - rise[0]) + wall - wall[0]
    assert np.max(np.abs(found["main-2.force"] - borne)) <= 2e-3 * np.max(np.abs(borne))


def test_a_limit_on_force_is_held_against_every_step_and_leg() -> None:
    case = shut(limits={"anchor": {"on": "main", "quantity": "force", "maximum": "50 kN"}})
    one = fvsolve.run(case).verdicts[0]
    assert (
        not one.ok
        and one.value == pytest.approx(FORCE)
        and one.unit == "N"
        and one.place in ("main-1", "main-2")
    )
    back = fvsolve.run(
        shut(True, limits={"anchor": {"on": "main", "quantity": "force", "maximum": "90 kN"}})
    ).verdicts[0]
    assert back.ok == (FORCE < 9e4) and back.value == pytest.approx(FORCE)


def test_parts_without_a_force_are_named() -> None:
    with pytest.raises(fvsolve.CaseError, match="a probe reads its force"):
        fvsolve.run(shut(), set={"numerics.pipe_model": "delay-line", "numerics.method": "rk4"})
    case = shut()
    case["links"]["main"]["bends"] = [600.0, 900.0]
    refused(case, "links.main.bends.1.*is outside")
    case["links"]["main"]["bends"] = "600 m"
    refused(case, "links.main.bends")
