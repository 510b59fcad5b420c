"""Error bands contain the true peak where cells or steps miss it, and no verdict contradicts it.

True peaks are from an independent method of characteristics on exact grids (benchmarks/exact_networks.py is another).
"""

from typing import Any

import pytest
from reference.scenes import junction, lake, pipe, scene, valve

import fvsolve
from fvsolve.studies.line_reference import can_be_lines, line_references
from fvsolve.studies.outcome import NO_FIELDS
from fvsolve.studies.peak_error import peak_errors
from fvsolve.studies.resolution import refined_keys

LIQUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 0.0,
}


def drawn(
    nodes: dict,
    links: dict,
    end: float,
    numerics: dict,
    probe: str,
    limits: dict,
    rho: float = 1000.0,
) -> dict:
    """Case under a pressure so high that nothing cavitates."""
    case = scene(nodes, links, end, numerics, [probe], end / 1000.0, limits=limits)
    return case | {"ambient_pressure": 50e6, "fluid": LIQUID | {"density": rho}}


def limit(node: str, **bound: float) -> dict:
    return {"peak": {"on": f"nodes.{node}", "quantity": "head", **bound}}


def pulse() -> dict:
    """Lossless pipe whose valve shuts and opens; muscl cuts the cusp of its reflection."""
    nodes = {
        "lake": lake(94.84, elevation=0.0),
        "n0": junction(elevation=14.2),
        "o0": lake(21.4, elevation=14.2),
    }
    opening = {"time": [1.85, 2.15, 2.45], "value": [1.0, 0.0, 1.0], "kind": "linear"}
    links: dict[str, Any] = {"p0": pipe("n0", "lake", 1173.0, 0.443, 1380.0, 100)}
    links["v0"] = valve("n0", "o0", 0.61 * 0.0185, opening)
    del links["p0"]["cells"]
    numerics = {"scheme": "muscl", "rtol": 1e-4, "method": "auto", "cell_time": 0.0326}
    return drawn(nodes, links, 6.8, numerics, "n0.head", limit("n0", minimum=-14.019689475217575))


def three_pipes() -> dict:
    """Delay lines with steps of an eighth of their travel time, which cut the peak of a ramp of power 1.5."""
    demand = {"start": 0.336, "duration": 0.248, "value": [0.0, 0.0182], "exponent": 1.5}
    nodes = {"lake": lake(88.0), "n0": junction(), "n1": junction(), "n2": junction(demand)}
    rough = {"model": "quasi-steady", "roughness": 0.000298}
    smooth = [{"model": "hazen-williams", "coefficient": c} for c in (144.0, 122.0)]
    links = {
        "p0": pipe("lake", "n0", 65.844, 0.162, 531.0, 1, friction=rough),
        "p1": pipe("n0", "n1", 60.144, 0.0747, 537.0, 1, friction=smooth[0], minor_loss=2.51),
        "p2": pipe("n1", "n2", 120.0, 0.0996, 1250.0, 1, friction=smooth[1]),
    }
    for link in links.values():
        del link["cells"]
    numerics = {"pipe_model": "delay-line", "step": 0.0158, "method": "rk4"}
    return drawn(
        nodes, links, 0.99052, numerics, "n1.head", limit("n1", maximum=167.94438437224153)
    )


def check_valves() -> dict:
    """Pipe between two check valves and a valve that shuts and opens: the peak lasts 1 ms."""
    nodes = {
        "lake": lake(33.21, elevation=0.0),
        "n0": junction(elevation=7.71),
        "n1": junction(elevation=-19.1),
        "n2": junction(elevation=-1.82),
        "o0": lake(3.41, elevation=-1.82),
        "n0x": junction(elevation=7.71),
        "n1x": junction(elevation=-19.1),
    }
    friction = [{"model": "steady", "factor": 0.02109}]
    friction += [{"model": "hazen-williams", "coefficient": c} for c in (88.1, 112.0)]
    links = {
        "p0": pipe("lake", "n0", 130.0, 0.243, 500.0, 1, friction=friction[0]),
        "p1": pipe("n1", "n0x", 283.8, 0.243, 1290.0, 1, friction=friction[1]),
        "p2": pipe("n1x", "n2", 272.0, 0.243, 1360.0, 1, friction=friction[2], minor_loss=4.16),
    }
    for link in links.values():
        del link["cells"]
    opening = {"time": [0.04, 0.06, 0.08], "value": [1.0, 0.0, 1.0], "kind": "linear"}
    links["v0"] = valve("n2", "o0", 0.61 * 0.00768, opening)
    check = {
        "type": "check-valve",
        "from": "n0",
        "to": "n0x",
        "area": 0.00534,
        "cracking_pressure": 6900.0,
    }
    links |= {
        "dn0": check,
        "dn1": {"type": "check-valve", "from": "n1", "to": "n1x", "area": 0.00891},
    }
    numerics = {"pipe_model": "auto", "delay_tolerance": 0.001}
    return drawn(
        nodes, links, 0.7726, numerics, "n1.head", limit("n1", maximum=156.24286977108903), 998.2
    )


TRUE = {
    pulse: ("minimum", -16.2413, 0.0),
    three_pipes: ("maximum", 168.752, 0.006),
    check_valves: ("maximum", 163.599, 0.12),
}


@pytest.mark.parametrize("make", TRUE)
def test_a_peak_that_cells_or_steps_cut_is_in_its_band(make) -> None:
    """Each peak is beyond its limit in truth, and within in the run: the verdict is open, with a reason."""
    case, (side, right, unsure) = make(), TRUE[make]
    found = peak_errors(fvsolve.run(case, pictures=False), fvsolve.load(case))
    (peak,), (verdict,) = found["peaks"].values(), found["verdicts"]
    assert abs(peak[side]["value"] - right) <= peak[side]["error"] + unsure
    assert peak[side]["error"] <= 4.0 * abs(peak[side]["value"] - right)
    assert verdict["state"] == "open" and verdict["margin"] > 0.0


@pytest.mark.parametrize(
    "make, key", [(pulse, "links.p0.cells = "), (check_valves, "links.p0.cells = ")]
)
def test_the_reason_names_the_cells_that_resolve_a_peak(make, key: str) -> None:
    found = peak_errors(fvsolve.run(make(), pictures=False), fvsolve.load(make()))
    ((peak,), side) = found["peaks"].values(), TRUE[make][0]
    assert key in peak[side]["reason"] and "delay lines with short steps" in peak[side]["reason"]


def test_a_pipe_that_auto_computes_with_cells_is_refined() -> None:
    """Its band was that of three runs with the same cells."""
    case = fvsolve.load(check_valves())
    keys = refined_keys(case, 2.0)
    cells = {key for key in keys if key.endswith(".cells")}
    assert cells == {f"links.p{k}.cells" for k in range(3)}
    assert all(keys[key] == 2 * case.links[key.split(".")[1]].cells for key in cells)


def test_a_limit_exceeded_by_less_than_its_error_is_open() -> None:
    """The run exceeds 167.5 m by 0.1 m, and its error is ten times as large."""
    case = three_pipes()
    case["limits"] = limit("n1", maximum=167.5)
    (verdict,) = peak_errors(fvsolve.run(case, pictures=False), fvsolve.load(case))["verdicts"]
    assert (
        verdict["margin"] < 0.0
        and -verdict["margin"] < verdict["error"]
        and verdict["state"] == "open"
    )
    case["limits"] = limit("n1", maximum=140.0)
    (verdict,) = peak_errors(fvsolve.run(case, pictures=False), fvsolve.load(case))["verdicts"]
    assert verdict["state"] == "fails"


def test_only_cases_of_pipes_that_can_be_delay_lines_have_references() -> None:
    linear = fvsolve.load(three_pipes())
    other = fvsolve.load(
        three_pipes() | {"fluid": LIQUID | {"law": "log"}}, {"numerics.pipe_model": "finite-volume"}
    )
    assert can_be_lines(linear) and not can_be_lines(other)
    own = fvsolve.run(linear, pictures=False)
    pair = line_references(own, linear, NO_FIELDS, None)
    steps = [result.summary["steps"] for result in pair.values()]
    assert steps[1] >= 3.9 * steps[0] >= 3.9 * 4 * own.summary["steps"]
    assert line_references(own, other, NO_FIELDS, None) == {}


def test_the_references_of_a_lossless_pipe_are_exact() -> None:
    """Instant closure: Joukowsky's head a v / g, a band of rounding only."""
    nodes = {
        "lake": lake(100.0),
        "end": junction({"start": 0.1, "duration": 0.0, "value": [0.1, 0.0]}),
    }
    links = {"main": pipe("lake", "end", 500.0, 0.4, 1000.0, 50)}
    case = scene(
        nodes, links, 0.9, {"pipe_model": "delay-line", "step": 0.01, "method": "rk4"}, ["end.head"]
    )
    peak = peak_errors(fvsolve.run(case, pictures=False), fvsolve.load(case))["peaks"]["end.head"][
        "maximum"
    ]
    assert peak["error"] <= 1e-5 * peak["value"]


def test_the_error_of_a_limit_includes_the_change_by_steps_that_end_at_other_rows():
    """The run that is compared with references has more rows and other steps: its peak was 6 m higher."""
    sine = {"mean": 0.06376, "amplitude": 0.06376, "period": 3.3298}
    nodes = {
        "lake": lake(58.656),
        "n1": junction(),
        "n2": junction(sine),
        "n3": junction({"start": 5.64, "duration": 1.8, "value": [0.14223, 0.0]}),
        "n4": junction(),
        "o1": lake(11.234),
        "o4": lake(47.452),
    }
    links = {
        "p0": pipe(
            "lake",
            "n1",
            816.0,
            0.45698,
            400.0,
            1,
            friction={"model": "chezy-manning", "coefficient": 0.015004},
        ),
        "p1": pipe(
            "lake",
            "n2",
            1696.8,
            0.45698,
            1010.0,
            1,
            friction={"model": "hazen-williams", "coefficient": 111.6},
        ),
        "p2": pipe("n2", "n3", 3252.6, 0.27419, 1390.0, 1),
        "p3": pipe(
            "n4",
            "n2",
            81.0,
            0.27419,
            450.0,
            1,
            friction={"model": "chezy-manning", "coefficient": 0.0099947},
        ),
        "v1": valve(
            "n1",
            "o1",
            0.61 * 0.011741,
            {"time": [4.56, 4.68, 4.74], "value": [0.0, 1.0, 0.0], "kind": "linear"},
        ),
        "v4": valve("n4", "o4", 0.61 * 0.033287, {"mean": 0.5, "amplitude": 0.5, "period": 2.3561}),
    }
    numerics = {"pipe_model": "delay-line", "method": "dormand-prince", "rtol": 2.61e-5}
    case = drawn(nodes, links, 13.44, numerics, "n1.head", limit("n1", maximum=115.26))
    case["output"]["every"] = 13.44 / 300.0
    fine = case | {
        "numerics": {"end": 13.44, "pipe_model": "delay-line", "method": "rk4", "step": 2e-3}
    }
    right = fvsolve.run(fine, pictures=False).extremes["n1.head"].maximum
    found = peak_errors(fvsolve.run(case, pictures=False), fvsolve.load(case))
    (verdict,), peak = found["verdicts"], found["peaks"]["n1.head"]["maximum"]
    assert abs(verdict["value"] - right) > 3.0
    assert verdict["error"] > abs(verdict["value"] - right) and peak["error"] > abs(
        peak["value"] - right
    )
    assert verdict["state"] == "open"
