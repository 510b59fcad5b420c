"""Energy of delay lines: stored energy by quadrature, against closed forms, fine cells and the sum of all powers."""

import numpy as np
import pytest
from reference.scenes import GRAVITY, RHO, area, chamber, junction, lake, pipe, scene, step

from fvsolve.studies import energy

LENGTH, DIAMETER, SPEED, FLOW, HEAD = 600.0, 0.3, 1000.0, 0.05, 50.0
TAU, AREA = LENGTH / SPEED, area(DIAMETER)
LOSSLESS = {"model": "none"}
STEADY = {"model": "steady", "factor": 0.02}


def main(law, gate: dict, method: str, h: float, end: float) -> dict:
    """Case of a lake, a main as delay line, and a given node at its end."""
    nodes = {"lake": lake(HEAD), "gate": gate}
    links = {"main": pipe("lake", "gate", LENGTH, DIAMETER, SPEED, 20, friction=law)}
    return scene(nodes, links, end, {"pipe_model": "delay-line", "method": method, "step": h})


def chain(h: float, method: str = "rk4", law=STEADY) -> dict:
    """Case of two delay lines with a third between them, shorter than a step; the demand falls to 40 % in 1 s."""
    nodes = {"lake": lake(50.0), "a": junction(), "b": junction()}
    nodes["gate"] = junction({"time": [0.5, 1.5], "value": [FLOW, 0.4 * FLOW], "kind": "smooth"})
    links = {
        "long": pipe("lake", "a", LENGTH, DIAMETER, SPEED, 20, friction=law),
        "short": pipe("a", "b", 4.3, 0.25, SPEED, 2, friction=law),
        "last": pipe("b", "gate", 453.7, 0.2, 1100.0, 20, friction=law),
    }
    return scene(nodes, links, 4.0, {"pipe_model": "delay-line", "method": method, "step": h})


@pytest.mark.parametrize("method", ["euler", "rk4", "trapezoid", "rodas-4"])
@pytest.mark.parametrize("share", [0.5, 1.5, 2.5, 4.0])
def test_the_ledger_of_an_instant_closure_is_exact(method, share):
    """Lossless: Joukowsky's wave fills the main and returns; after four travel times the stored energy is as before.

    Steps of 13 ms do not divide the travel time, so jumps reach the lake and the gate within steps.
    """
    found = energy(main(LOSSLESS, junction(step(0.1, FLOW, 0.0)), method, 0.013, 0.1 + share * TAU))
    filled, still = {0.5: (0.5, 0.5), 1.5: (0.5, 0.5), 2.5: (-0.5, 0.5), 4.0: (0.0, 0.0)}[share]
    risen, p = RHO * SPEED * FLOW / AREA, RHO * GRAVITY * HEAD
    elastic = (abs(filled) * risen**2 + 2.0 * filled * risen * p) * AREA / (2.0 * RHO * SPEED**2)
    stored = LENGTH * (elastic - still * RHO * FLOW**2 / (2.0 * AREA))
    assert found.stored["main"][-1] == pytest.approx(stored, abs=1e-12 * found.throughput)
    assert np.max(np.abs(found.numerical_remainder)) < 1e-12 * found.throughput


@pytest.mark.parametrize("h", [0.01, 0.013])
def test_stages_outside_a_step_see_jumps_of_its_neighbours(h):
    """crouzeix-4 has stages outside its steps; after the closure no energy is created, even by jumps at step ends."""
    found = energy(main(LOSSLESS, junction(step(0.1, FLOW, 0.0)), "crouzeix-4", h, 2.0))
    shut = found.numerical_remainder[found.t > 0.12]
    assert np.max(np.abs(shut - shut[0])) < 1e-12 * found.throughput


def test_what_is_stored_and_taken_as_by_fine_cells():
    found, cells = chain(0.0025), chain(0.0025)
    found = energy(found | {"numerics": found["numerics"] | {"delay_tolerance": 1e-3}})
    cells["numerics"] = {"scheme": "upwind5", "method": "rk4", "courant": 0.9, "end": 4.0}
    for name, n in (("long", 140), ("short", 2), ("last", 96)):
        cells["links"][name]["cells"] = n
    truth = energy(cells)
    for name in ("long", "last"):
        assert found.stored[name][-1] == pytest.approx(truth.stored[name][-1], rel=1e-4)
        friction = f"{name} friction"
        assert found.dissipated[friction][-1] == pytest.approx(truth.dissipated[friction][-1], rel=1e-4)
    assert found.supplied["lake"][-1] == pytest.approx(truth.supplied["lake"][-1], rel=1e-4)


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_what_the_steps_take_falls_with_their_square(method):
    """Stored energy by quadrature and the sum of all powers differ only by interpolation between steps."""
    sizes = [abs(float(energy(chain(h, method)).step[-1])) for h in (0.02, 0.01, 0.005)]
    assert sizes[0] > 3.0 * sizes[1] > 9.0 * sizes[2]


def test_a_short_line_takes_and_never_gives():
    """A short line smooths waves: the energy that it removes is a square at each time."""
    found = energy(chain(0.02, law=LOSSLESS))
    taken = found.scheme["short"]
    assert set(found.scheme) == {"short"}
    assert taken[-1] > 0.0
    assert np.min(np.diff(taken)) > -1e-12 * found.throughput


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_from_the_other_end(method):
    one, case = energy(chain(0.01, method)), chain(0.01, method)
    for link in case["links"].values():
        link["from"], link["to"] = link["to"], link["from"]
    other = energy(case)
    for what in ("supplied", "stored", "dissipated", "scheme"):
        for name, values in getattr(one, what).items():
            assert np.max(np.abs(getattr(other, what)[name] - values)) < 1e-9 * one.throughput, (what, name)


def test_a_jump_into_a_store_is_booked_as_the_store_has_it():
    """A jump reaches a chamber between two lossless lines within a step: the remainder is of second order."""
    nodes = {"lake": lake(HEAD), "air": chamber(20.0), "gate": junction(step(0.1, FLOW, 0.0))}
    links = {
        "one": pipe("lake", "air", LENGTH, DIAMETER, SPEED, 20, friction=LOSSLESS),
        "two": pipe("air", "gate", 0.5 * LENGTH, DIAMETER, SPEED, 20, friction=LOSSLESS),
    }
    for h in (0.014, 0.007, 0.0035, 0.0017):
        found = energy(scene(nodes, links, 3.0, {"pipe_model": "delay-line", "method": "rk4", "step": h}))
        assert np.max(np.abs(found.numerical_remainder)) < 30.0 * h**2 * found.throughput
