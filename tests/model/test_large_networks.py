"""Linear growth of the work of reading and building a network with its pipes, counted in executed lines of Python."""

import sys
from pathlib import Path

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, scene

import fvsolve

PACKAGE = str(Path(fvsolve.__file__).parent)
HAZEN = {"model": "hazen-williams", "coefficient": 110.0}


def ladder(rungs: int, line: str) -> dict:
    """Case of two rows of junctions, each behind a lake, with cross connections: three pipes per rung."""
    nodes = {f"{side}{k}": junction(1e-4, elevation=0.0) for k in range(rungs) for side in "ab"}
    nodes |= {"lake-a": lake(60.0), "lake-b": lake(60.0)}
    links = {}
    for k in range(rungs):
        for side in "ab":
            before = f"{side}{k - 1}" if k else f"lake-{side}"
            links[f"{side}{k}"] = pipe(before, f"{side}{k}", 60.0, 0.3, 1200.0, 4, friction=HAZEN)
        links[f"r{k}"] = pipe(f"a{k}", f"b{k}", 60.0, 0.2, 1200.0, 4, friction=HAZEN)
    return scene(nodes, links, 1.0, {"pipe_model": line}, ["a0.head"])


def effort(rungs: int, line: str) -> int:
    """Number of lines of the package that are executed to read and build a network."""
    count = 0

    def watch(frame, event, _):
        nonlocal count
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        count += event == "line"
        return watch

    given = ladder(rungs, line)
    before = sys.gettrace()
    sys.settrace(watch)
    try:
        assert fvsolve.build(fvsolve.load(given)).checks["pipes"]
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("line", ["finite-volume", "delay-line"])
def test_four_times_the_pipes_take_less_than_four_times_the_work(line):
    effort(5, line)  # caches
    few, many = effort(12, line), effort(48, line)
    assert many < 3.8 * few  # work proportional to pairs of pipes gives 3.95 and more


def test_a_ladder_of_like_halves_flows_alike_in_both():
    """A symmetric ladder with a large sparse system has no cross flow."""
    model = fvsolve.build(fvsolve.load(ladder(120, "finite-volume")))
    flow = dict(zip([p.name for p in model.pipes], model.tables.pipes["flow"], strict=True))
    rho = model.case.properties.density
    drawn = rho * 1e-4 * np.arange(120, 0, -1)
    assert [flow[f"a{k}"] for k in range(120)] == pytest.approx(drawn, rel=1e-9)
    assert [flow[f"b{k}"] for k in range(120)] == pytest.approx(drawn, rel=1e-9)
    assert max(abs(flow[f"r{k}"]) for k in range(120)) < 1e-9 * drawn[0]
