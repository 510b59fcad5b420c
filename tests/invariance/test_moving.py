"""Equivalent descriptions of moving parts give equal results, to the bit for equal arithmetic, else to rounding.

Rosenbrock methods solve one linear system per stage, with a Jacobian by one-sided differences that no iteration
corrects. In a mirror, forward differences become backward differences, and rounding changes an entry by 1e-8. These
methods agree to `BY_DIFFERENCES`, which is below the error of a step in these cases. The differences found are 4e-5
for the power of a liquid, 1e-5 for flows, 1e-6 for basins and 1e-7 for bodies. Implicit methods with Newton iterations
agree to rounding.
"""

from functools import cache

import numpy as np
import pytest
from reference.bodies import OIL, body
from reference.scenes import scene

import fvsolve
from invariance import equivalent_mechanisms as equivalent
from invariance.moving import METHODS, SCENES, machine, piston, stepped
from invariance.result_comparison import (
    Outcome,
    alike,
    broken_off_and_whole,
    outcome_of,
    with_frames,
)

# warning of numba while it compiles
EXPERIMENTAL = "ignore:First-class function type feature is experimental"
# other warnings fail, such as of NaN values
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)
ROUND, BY_DIFFERENCES = 1e-9, 1e-4
EACH = ["rk4", "gauss-4", "rodas-4"]
EXPLICIT, IMPLICIT = (
    ["ssp-rk3", "rk4", "dormand-prince"],
    ["gauss-4", "implicit-midpoint", "radau-iia-5"],
)
IN_SPACE = [
    "machine",
    "machine log",
    "machine table",
    "machine mixture",
    "loop",
    "carried",
    "rocking",
    "frozen",
    "modes",
    "full",
    "full log",
    "full free",
    "full table free",
    "u-tube free",
    "u-tube driven",
]


def with_methods(names: list[str], first: int) -> list[tuple[str, str]]:
    """Each scene with one method of `EACH`, in turn; tests begin at different methods."""
    return [(name, EACH[k % len(EACH)]) for k, name in enumerate(names, start=first)]


def mixed(first: int) -> list[tuple[str, str]]:
    """Each scene with an explicit, an implicit or the Rosenbrock method, in turn; tests begin at different kinds."""
    ways = [(EXPLICIT[k % 3], IMPLICIT[k // 3 % 3], "rodas-4") for k in range(len(SCENES))]
    return [(name, ways[k][(k + first) % 3]) for k, name in enumerate(SCENES)]


SWINGS = (".rate", ".angle", ".travel")


@cache
def first(name: str, method: str) -> Outcome:
    """Outcome of the unchanged case, which must finish and must move."""
    shown = outcome_of(SCENES[name](method))
    assert shown.ended == "finished" and max(np.ptp(values) for values in shown.rows.values()) > 0.0
    return shown


def near(method: str) -> float:
    """Allowed difference between equivalent cases, over the greatest value of the quantity."""
    return {"rodas-4": BY_DIFFERENCES, "dormand-prince": 1e-5}.get(method, ROUND)


@pytest.mark.parametrize("name, method", mixed(0))
def test_run_again_and_with_frames(name, method):
    """Field frames and earlier runs of the model do not change a bit."""
    case = SCENES[name](method)
    case["output"]["fields"] = 3
    model = fvsolve.build(fvsolve.load(case))
    unchanged = first(name, method)
    with with_frames():
        alike(unchanged, outcome_of(model))
    alike(unchanged, outcome_of(model))


@pytest.mark.parametrize("name, method", mixed(1))
def test_broken_off_and_resumed(name, method):
    """An interrupted and resumed run agrees with the whole run to the bit, in its final state and ledgers."""
    case = SCENES[name](method)
    case["output"]["fields"] = 0
    broken_off_and_whole(case, 0.3)


@pytest.mark.parametrize("name, method", mixed(2))
def test_parts_in_the_reverse_order(name, method):
    """A body may precede its carrier in the file, and the mass of a moving wall its basin."""
    alike(first(name, method), outcome_of(equivalent.otherwise(SCENES[name](method))), near(method))


@pytest.mark.parametrize("name, method", with_methods(SCENES, 0))
def test_at_a_later_time(name, method):
    """A delay changes results by rounding of times only, which enters differences of driven joints."""
    alike(
        first(name, method),
        outcome_of(equivalent.at_a_later_time(SCENES[name](method), 64.0)),
        near(method),
        later=64.0,
    )


@pytest.mark.parametrize("name", SCENES)
def test_other_rows(name):
    """More rows do not change the common rows, because rows are interpolated between steps."""
    case = SCENES[name]()
    case["output"]["every"] /= 2.0
    many, few = outcome_of(case), first(name, "rk4")
    for probe, values in few.rows.items():
        found = dict(zip(many.t, many.rows[probe], strict=True))
        assert [found[t] for t in few.t] == values.tolist()


@pytest.mark.parametrize("name, method", with_methods(SCENES, 1))
def test_other_units(name, method):
    """Conversion of units changes results by rounding only."""
    case = SCENES[name](method)
    other = case | {table: equivalent.in_other_units(case[table]) for table in ("nodes", "links")}
    assert other != case
    alike(first(name, method), outcome_of(other), near(method))


@pytest.mark.parametrize(
    "name, method",
    with_methods(
        [name for name in IN_SPACE if not name.startswith(("carried", "full", "u-tube"))], 2
    ),
)
def test_ends_of_links_swapped(name, method):
    alike(first(name, method), outcome_of(equivalent.swapped(SCENES[name](method))), near(method))


@pytest.mark.parametrize("name, method", with_methods(IN_SPACE, 0))
def test_axes_the_other_way(name, method):
    def change(probe, values):
        return -values if probe.endswith(SWINGS) else values

    alike(
        first(name, method),
        outcome_of(equivalent.reversed_axes(SCENES[name](method))),
        near(method),
        change=change,
    )


@pytest.mark.parametrize("name, method", with_methods(IN_SPACE, 1))
def test_turned_about_the_vertical(name, method):
    one = spatial(first(name, method))
    alike(
        one,
        outcome_of(equivalent.turned(SCENES[name](method), 0.7)),
        near(method),
        change=equivalent.as_turned(one, 0.7),
    )


def spatial(one: Outcome) -> Outcome:
    """Outcome without probes of single vector components, because a rotation needs all three."""
    whole = {
        probe: values
        for probe, values in one.rows.items()
        if equivalent.part(probe)[1] == "-"
        or all(f"{probe[:-1]}{axis}" in one.rows for axis in "xyz")
    }
    return Outcome(one.ended, one.t, whole, one.result)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("name, method", with_methods(IN_SPACE, 2))
def test_in_a_mirror(name, method, axis):
    """A mirrored case gives mirrored results; a basin is then drawn from another corner."""
    case = SCENES[name](method)
    sizes = {one: node["size"] for one, node in case["nodes"].items() if node["type"] == "basin"}
    alike(
        first(name, method),
        outcome_of(equivalent.mirrored(case, axis)),
        near(method),
        lambda probe: equivalent.in_mirror(probe, axis, sizes),
        equivalent.as_mirrored(axis),
    )


@pytest.mark.parametrize("name", IN_SPACE)
def test_far_away(name):
    """A displacement of the whole case changes positions only.

    Angular momenta about the origin of the world do change, and are left out.
    """
    by = {"x": 3000.0, "y": -4000.0}
    one = first(name, "rk4")
    rows = {probe: values for probe, values in one.rows.items() if "angular_momentum" not in probe}

    def change(probe, values):
        _, vector, axis = equivalent.part(probe)
        return values + by.get(axis, 0.0) if vector == "" else values

    other = outcome_of(equivalent.shifted(SCENES[name](), [by["x"], by["y"], 0.0]))
    alike(Outcome(one.ended, one.t, rows, one.result), other, ROUND, change=change)


@pytest.mark.in_turn
@pytest.mark.parametrize("form", equivalent.FORMS)
@pytest.mark.parametrize("name", ["machine", "loop", "carried", "rocking"])
def test_attitudes_in_another_form(name, form):
    alike(first(name, "rk4"), outcome_of(equivalent.attitudes(SCENES[name](), form)), ROUND)


@pytest.mark.in_turn
@pytest.mark.parametrize("method", EACH)
@pytest.mark.parametrize("part", ["base", "arm", "slider", "wrist", "plate", "kite"])
def test_a_body_in_two_that_are_fixed_to_each_other(part, method):
    """A body divided into two fixed bodies moves as the whole body.

    Kinetic energy and momenta of the body itself do change, and are left out.
    """
    own = (".kinetic_energy", *(f".angular_momentum_{axis}" for axis in "xyz"))
    one = first("machine", method)
    rows = {probe: values for probe, values in one.rows.items() if not probe.endswith(own)}
    if part == "kite":  # states of a free body refer to its centre of mass
        rows = {
            probe: values for probe, values in rows.items() if not probe.startswith("kite.momentum")
        }
    alike(
        Outcome(one.ended, one.t, rows, one.result),
        outcome_of(equivalent.split(machine(method), part)),
        near(method),
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("method", EACH)
@pytest.mark.parametrize("law", ["", "linear", "log", "table"])
def test_a_wall_of_a_mass_is_that_of_a_body_on_a_prismatic_joint(law, method):
    alike(outcome_of(piston(method, law)), outcome_of(piston(method, law, by="body")), near(method))


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", ["linear", "log", "mixture"])
def test_a_mass_on_a_cylinder_is_a_body_on_a_prismatic_joint(law, method):
    """A mass on the axis moves as a body on an inclined prismatic joint without gravity."""
    cylinder = {
        "type": "cylinder",
        "stroke": 0.5,
        "area_A": 1e-3,
        "area_B": 7e-4,
        "dead_volume_A": 1e-4,
        "dead_volume_B": 2e-4,
        "viscous_friction": 30.0,
        "closed_length": 0.1,
        "initial_pressure_A": 3e6,
        "initial_pressure_B": 3.2e6,
    }
    rest = {
        "spring": {"type": "spring", "stiffness": 5e3, "free_length": 0.2},
        "stop": {"type": "end-stop", "maximum": 0.31, "stiffness": 1e6, "damping": 1e3},
        "brake": {"type": "damper", "damping": 40.0},
    }
    push = {"type": "force", "force": {"mean": 100.0, "amplitude": 500.0, "period": 0.05}}
    probes = [
        "jack.force",
        "jack.position",
        "jack.velocity",
        "jack.A.pressure",
        "jack.B.pressure",
        "spring.force",
        "stop.force",
    ]

    def case(nodes, near, far, **force):
        links = {name: {**one, "from": near, "to": far} for name, one in rest.items()}
        links |= {
            "jack": {**cylinder, "ports": {"case": near, "rod": far}},
            "push": {**push, "to": far, **force},
        }
        made = scene(nodes, links, 0.1, stepped(method, 5e-4), probes, 1 / 128, gravity=0.0)
        return made | {
            "fluid": {**OIL, "law": law, **({"air_fraction": 1e-3} if law == "mixture" else {})}
        }

    one = case(
        {
            "m": {"type": "mass", "mass": 20.0, "initial_position": 0.3, "initial_velocity": 0.4},
            "ground": {"type": "frame"},
        },
        "ground",
        "m",
    )
    way = [0.36, 0.48, 0.8]
    slides = {"kind": "prismatic", "axis": way, "travel": 0.3, "rate": 0.4}
    other = case(
        {
            "m": body(20.0, [1, 1, 1], slides),
            "ground": {"type": "frame", "points": {"eye": [0, 0, 0]}},
        },
        "ground.eye",
        "m",
        direction=way,
    )
    alike(outcome_of(one), outcome_of(other), near(method))


WAVE = {"mean": 0.1, "amplitude": 0.2, "period": 0.9, "phase": 0.4}
SAID = {
    "below": {"mean": 0.1, "amplitude": -0.2, "period": 0.9, "phase": 0.4 - np.pi},
    "a turn on": {"mean": 0.1, "amplitude": 0.2, "period": 0.9, "phase": 0.4 + 2 * np.pi},
    "shared": {"signal": "swing"},
    "in other units": {
        "mean": "5.729577951308232 deg",
        "amplitude": "11.459155902616464 deg",
        "period": "900 ms",
        "phase": "22.91831180523293 deg",
    },
}


@pytest.mark.in_turn
@pytest.mark.parametrize("method", EACH)
@pytest.mark.parametrize("way", SAID)
def test_a_joint_driven_in_other_words(way, method):
    case = machine(method, signals={"swing": WAVE} if way == "shared" else {})
    case["nodes"]["base"]["joint"]["angle"] = SAID[way]
    alike(first("machine", method), outcome_of(case), near(method))


@pytest.mark.parametrize("method", METHODS)
def test_a_slider_that_is_driven_by_a_power_or_by_its_table(method):
    """A ramp x = (1 - t / 2)^2 and its smooth table drive a slider equally, with slope errors of order (0.01 s)^2."""
    found, times = [], np.linspace(-1.0, 3.0, 401)
    for travel in (
        {"start": 0.0, "duration": 2.0, "value": [1.0, 0.0], "exponent": 2},
        {"time": times.tolist(), "value": ((1.0 - times / 2.0) ** 2).tolist(), "kind": "smooth"},
    ):
        nodes = {
            "cart": body(
                3.0, [1, 1, 1], {"kind": "prismatic", "axis": [1, 0, 0], "travel": travel}
            ),
            "bob": body(
                1.0,
                [0.1, 0.1, 0.1],
                {"kind": "revolute", "on": "cart", "axis": [0, 1, 0], "angle": 0.3},
                centre_of_mass=[0, 0, -0.5],
            ),
        }
        found.append(
            outcome_of(scene(nodes, {}, 1.0, stepped(method, 0.01), ["bob.angle", "cart.x"], 0.125))
        )
    alike(*found, 2e-5)
