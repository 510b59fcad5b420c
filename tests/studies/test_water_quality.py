"""Water age and source tracing: closed forms of pipes, tanks and junctions, conservation, EPANET, refusals."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from reference.scenes import area, junction, lake, scene, tank

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.studies import water_quality

HOUR = 3600.0


def pipe(start, end, length=600.0, diameter=0.2):
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": length,
        "diameter": diameter,
        "friction": {"model": "hazen-williams", "coefficient": 120.0},
        "pipe_model": "quasi-steady",
    }


def line(demand, end=4 * HOUR, **more):
    nodes = {"lake": lake(60.0, elevation=50.0), "end": junction(demand, elevation=10.0)}
    return scene(nodes, {"main": pipe("lake", "end"), **more}, end, {"rtol": 1e-8}, [], 100.0)


def test_the_age_at_the_end_of_a_pipe_is_its_length_over_the_velocity():
    """Water of the start is as old as the run until the first water of the lake arrives; no dispersion."""
    found = water_quality(line(0.004), ["lake"], step=70.0)
    delay = area(0.2) * 600.0 / 0.004
    age, share = found.of("end"), found.of("end", "lake")
    early, late = found.t < delay - 70.0, found.t > delay + 70.0
    assert age[early] == pytest.approx(found.t[early], rel=1e-12)
    assert age[late] == pytest.approx(delay, rel=1e-9)
    assert np.all(share[early] == 0.0) and share[late] == pytest.approx(1.0, rel=1e-12)
    assert np.sum((share > 0.0) & (share < 1.0)) <= 1  # the front is in one step
    assert np.all(np.abs(found.of("lake")) < 1e-9)
    assert found.error < 1e-12


def test_water_that_returns_is_the_water_that_left():
    """A demand that turns to an inflow pushes the water of the lake back: its front passes the middle twice."""
    step = {"time": [0.0, 2 * HOUR], "value": [0.004, -0.004], "kind": "step"}
    case = line(step, end=4 * HOUR)
    case["nodes"]["mid"] = junction(elevation=20.0)
    case["links"] = {"a": pipe("lake", "mid", 300.0), "b": pipe("mid", "end", 800.0)}
    found = water_quality(case, ["lake"], step=60.0)
    delay = area(0.2) * 300.0 / 0.004
    share = found.of("mid", "lake")
    away = (found.t > delay + 60.0) & (found.t < 4 * HOUR - delay - 60.0)
    assert share[away] == pytest.approx(1.0) and delay < 0.9 * 2 * HOUR
    assert share[found.t > 4 * HOUR - delay + 60.0] == pytest.approx(0.0, abs=1e-9)
    age = found.of("mid")
    # the water entered the pipe at 4 h - t - delay, and passes at t
    back = away & (found.t > 2 * HOUR)
    assert age[back] == pytest.approx(found.t[back] - (4 * HOUR - found.t[back] - delay), abs=1e-6)
    assert found.error < 1e-12


def test_a_tank_mixes_all_its_water():
    """A tank of constant volume: A = V/q (1 - exp(-q t / V)), and the share 1 - exp(-q t / V) of the source."""
    pump = {"type": "pump", "from": "lake", "to": "tower", "power": 5000.0}
    nodes = {
        "lake": lake(10.0, elevation=5.0),
        "tower": tank(20.0, 3.0, elevation=40.0),
        "end": junction(elevation=10.0),
    }
    case = scene(
        nodes,
        {"lift": pump, "main": pipe("tower", "end", 50.0)},
        10 * HOUR,
        {"rtol": 1e-8},
        [],
        100.0,
    )
    flow = 5000.0 / (1000.0 * 9.80665 * 33.0)
    case["nodes"]["end"] = junction(flow, elevation=10.0)
    run = fvsolve.run(case | {"output": {"probes": ["lift.flow", "tower.level"], "every": 600.0}})
    assert np.ptp(run["tower.level"]) < 1e-3  # the pump supplies what leaves
    errors = []
    for step in (120.0, 60.0):
        found = water_quality(case, ["lake"], step=step)
        rate = flow / 60.0
        age, share = found.of("tower"), found.of("tower", "lake")
        exact = (1.0 - np.exp(-rate * found.t)) / rate
        errors.append(np.abs(age - exact).max() / exact[-1])
        assert share == pytest.approx(1.0 - np.exp(-rate * found.t), abs=2.0 * rate * step)
        assert found.error < 1e-12
    assert errors[1] < 4e-3 and errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)


def test_shares_of_two_sources_mix_by_their_flows_in_short_pipes():
    """Pipes much shorter than the way of the water in a step; sources, and a check of the sum."""
    nodes = {
        "east": lake(60.0, elevation=10.0),
        "west": lake(60.05, elevation=10.0),
        "mid": junction(elevation=10.0),
        "end": junction(0.02, elevation=10.0),
    }
    links = {
        "a": pipe("east", "mid", 20.0),
        "b": pipe("west", "mid", 30.0),
        "c": pipe("mid", "end", 5.0),
    }
    case = scene(nodes, links, HOUR, {"rtol": 1e-8}, ["a.flow", "b.flow"], 100.0)
    run = fvsolve.run(case)
    found = water_quality(case, ["east", "west"], step=300.0)
    share = run["a.flow"][-1] / (run["a.flow"][-1] + run["b.flow"][-1])
    assert found.of("end", "east")[-1] == pytest.approx(share, rel=1e-9)
    both = found.of("end", "east") + found.of("end", "west")
    assert both[2:] == pytest.approx(1.0, rel=1e-12)  # the water of the start has left
    assert found.of("end", "west")[-1] == pytest.approx(1.0 - share, rel=1e-9)


def test_other_parts_wrong_nodes_and_steps_are_refused():
    case = line(0.004)
    with pytest.raises(FvsolveError, match='trace "lak": unknown node; did you mean "lake"'):
        water_quality(case, ["lak"])
    with pytest.raises(FvsolveError, match="step = 0.0 s is out of range"):
        water_quality(case, step=0.0)
    case["links"]["main"]["pipe_model"] = "finite-volume"
    with pytest.raises(
        FvsolveError, match='main: not supported; expected a network .* pipe_model = "quasi-steady"'
    ):
        water_quality(case)


def epanet_quality(text: str, kind: str, folder: Path):
    """(times [s], names, values : float64[times, nodes]) of a quality run of EPANET with steps of 20 s."""
    toolkit = pytest.importorskip(
        "wntr.epanet.toolkit", reason="WNTR, the extra `epanet`, is not installed"
    )
    keys = r"(?im)^\s*(hydraulic timestep|quality timestep|duration|quality|tolerance|report timestep)\s.*$"
    text = re.sub(keys, "", text)
    times = "[TIMES]\n Hydraulic Timestep 0:00:20\n Quality Timestep 0:00:20\n Duration 24:00\n"
    text = re.sub(r"\[QUALITY\][^\[]*", "", text)  # ages and shares at the start
    text = text.replace("[TIMES]", times).replace(
        "[OPTIONS]", f"[OPTIONS]\n Quality {kind}\n Tolerance 0.0001"
    )
    files = [str(folder / f"net.{ending}") for ending in ("inp", "rpt", "bin")]
    Path(files[0]).write_text(text)
    epanet = toolkit.ENepanet()
    epanet.ENopen(*files)
    epanet.ENsolveH()
    epanet.ENopenQ()
    epanet.ENinitQ(0)
    count = epanet.ENgetcount(0)
    t, values = [], []
    while True:
        t.append(epanet.ENrunQ())
        values.append([epanet.ENgetnodevalue(i + 1, 12) for i in range(count)])
        if epanet.ENnextQ() <= 0:
            break
    names = [epanet.ENgetnodeid(i + 1) for i in range(count)]
    epanet.ENcloseQ()
    epanet.ENclose()
    return np.array(t, dtype=float), names, np.array(values)


@pytest.mark.parametrize("kind, source, unit", [("Age", "", HOUR), ("Trace 9", "9", 0.01)])
def test_age_and_trace_of_net1_are_those_of_epanet(kind, source, unit, tmp_path):
    """Over a day: means over time within 0.02 h and 0.3 %; a front may pass a step earlier or later."""
    wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")
    from fvsolve.exchange.epanet import import_network

    path = Path(wntr.__file__).parent / "library" / "networks" / "Net1.inp"
    (tmp_path / "day.toml").write_text(import_network(path, day=True).text)
    found = water_quality(tmp_path / "day.toml", ["9"], step=60.0)
    assert found.error < 1e-12
    t, names, values = epanet_quality(path.read_text(), kind, tmp_path)
    inside = t > 120.0
    for k, name in enumerate(names):
        off = np.abs(np.interp(t, found.t, found.of(name, source) / unit) - values[:, k])[inside]
        assert off.mean() < (0.02 if kind == "Age" else 0.3), name
        assert math.isfinite(off.max()) and np.median(off) < (0.01 if kind == "Age" else 0.05), name
