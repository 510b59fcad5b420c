"""Nodes whose pressure the equations hardly determine are named."""

import pytest
from reference.quasi_steady import main, restated
from reference.scenes import junction, lake, scene, step, valve

import fvsolve
from fvsolve.errors import CaseError


def behind_a_valve(opening: float, count: int = 3) -> dict:
    """Row of junctions from a lake; from the last but one a valve with a given opening supplies the junction far."""
    names = ["lake", *(f"n{k}" for k in range(count))]
    nodes = {"lake": lake(50.0)} | {name: junction(1e-5, elevation=0.0) for name in names[1:]}
    nodes |= {"far": junction(2e-3, elevation=0.0)}
    links = {
        f"p{k}": main(*ends, 100.0, 0.2)
        for k, ends in enumerate(zip(names, names[1:], strict=False))
    }
    links["v"] = valve(names[count - 1], "far", 1e-3, opening)
    return scene(nodes, links, 10.0, {"rtol": 1e-6}, ["far.head"], 1.0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("count", [3, 200], ids=["dense", "sparse"])
def test_a_node_behind_a_valve_that_is_all_but_shut_is_named(count, turned):
    """The note named loops without friction, and the network has none; a start that does not balance is refused."""
    case = behind_a_valve(1e-12, count)
    try:
        model = fvsolve.build(fvsolve.load(restated(case) if turned else case))
    except CaseError as error:
        ((place, text),) = [(fault.place, fault.message) for fault in error.faults]
        assert (
            place == "numerics.initial"
            and "hardly determine the pressure at far; check there" in text
        )
    else:
        notes = [note for note in model.warnings if note.kind == "start"]
        assert [note.place for note in notes] == ["nodes.far"]
        assert notes[0].text.startswith("far: the equations hardly determine the pressure here")


@pytest.mark.parametrize("count", [3, 200], ids=["dense", "sparse"])
def test_an_open_valve_gives_no_such_note(count):
    model = fvsolve.build(fvsolve.load(behind_a_valve(1.0, count)))
    assert not [note for note in model.warnings if "hardly determine" in note.text]


@pytest.mark.parametrize("turned", [False, True])
def test_a_machine_before_a_shut_valve_is_named_by_its_outlet(turned):
    """The run named the first node of all that are solved together, here the inlet or a town far from the machine."""
    nodes = {
        "lake": lake(50.0),
        "town": junction(1e-4, elevation=0.0),
        "inlet": junction(elevation=0.0),
        "outlet": junction(elevation=0.0),
        "hill": lake(60.0),
    }
    machine = {
        "type": "displacement-pump",
        "from": "inlet",
        "to": "outlet",
        "displacement": 1e-5,
        "speed": 100.0,
    }
    links = {
        "p": main("lake", "town", 100.0, 0.2),
        "q": main("town", "inlet", 100.0, 0.2),
        "machine": machine,
        "gate": valve("outlet", "hill", 1e-3, step(5.0, 1.0, 0.0)),
    }
    case = scene(nodes, links, 10.0, {"rtol": 1e-6}, ["town.head"], 1.0)
    run = fvsolve.run(restated(case) if turned else case)
    assert not run.ok and run.reason.startswith(
        "stopped: no pressure at outlet balances the flows there at t = 5 s"
    )


def test_a_pump_of_constant_power_without_flow_determines_no_head():
    """Power over no flow is any head: EPANET's networks ky10 and ky13 have such a pump before a closed link."""
    nodes = {"lake": lake(50.0), "dead": junction(elevation=0.0), "hill": lake(60.0)}
    machine = {"type": "pump", "from": "lake", "to": "dead", "power": 7.5e4, "check_valve": True}
    links = {"machine": machine, "gate": valve("dead", "hill", 1e-3, 0.0)}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 10.0, {"rtol": 1e-6})))
    (note,) = [note for note in model.warnings if note.place == "links.machine"]
    assert (
        "constant power without flow determines no head" in note.text and "opening = 0" in note.text
    )
    links["gate"]["opening"] = 1.0
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 10.0, {"rtol": 1e-6})))
    assert not [note for note in model.warnings if "without flow" in note.text]
