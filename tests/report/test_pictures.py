"""`fvsolve plot` draws the requested pictures and names all unknown names at once."""

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.pictures import parse_probes, write_pictures


@pytest.fixture(scope="module")
def closure(tmp_path_factory):
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {"main": pipe("top", "gate", 900.0, 0.3, 1200.0, 40),
             "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0))}  # fmt: skip
    case = scene(nodes, links, 1.0, {}, ["gate.head", "main.head@0.5", "valve.flow"], title="A main for $5")
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "closure", pictures=False)


def test_what_is_asked_for_is_drawn(closure, tmp_path):
    from matplotlib.image import imread

    def drawn(**asked):
        return [path.name for path in write_pictures(closure.directory, out=tmp_path, **asked)]

    assert drawn() == drawn(route="main") == ["section.png"]
    assert drawn(probes="gate.head,valve.flow", phases=["valve.flow:gate.head"]) == ["probes.png", "phase.png"]
    for name in ("section.png", "probes.png", "phase.png"):
        assert np.ptp(imread(tmp_path / name)[..., :3], axis=(0, 1)).min() > 0.5


def test_names_that_are_none_are_told_at_once_with_what_was_meant(closure, fvs):
    code, _, said = fvs(
        "plot", closure.directory, "--probes", "gate.had,valve.flow", "--phase", "valve.flow", "--route", "mian"
    )
    assert code == 2 and said.splitlines() == [
        '"gate.had": unknown probe; did you mean "gate.head"?', '--phase "valve.flow": expected two probes, X:Y',
        '"mian": unknown route; did you mean "main"?',
    ]  # fmt: skip


def test_names_of_probes_may_have_commas():
    class Run:
        units = dict.fromkeys(["pool.depth@10,2.5", "a.head", "pool.depth@10"], "m")

    faults = []
    assert parse_probes(Run, "pool.depth@10,2.5,a.head, pool.depth@10", faults) == [*Run.units] and not faults
