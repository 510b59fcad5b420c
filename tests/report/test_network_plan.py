"""Plan of a network: pieces of pipes with extremes as in the envelope, positions, layouts, and utilisation."""

import copy

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.maps.network_figure import network_figure
from fvsolve.report.maps.network_map import extremes_of_pieces, network_map
from fvsolve.report.report_files import write_report

POSITIONS = {
    "top": [0, 0],
    "fork": [400, 0],
    "left": [400, 300],
    "gate": [400, -250],
    "low": [420, -250],
}


def branched(positions=POSITIONS) -> dict:
    """Main with a dead end to the left and a valve that closes to the right."""
    nodes = {
        "top": lake("60 m"),
        "fork": junction(),
        "left": junction(),
        "gate": junction(),
        "low": lake("20 m"),
    }
    links = {
        "main": pipe("top", "fork", 400.0, 0.3, 1000.0, 20),
        "stub": pipe("fork", "left", 300.0, 0.2, 1000.0, 15),
        "branch": pipe("fork", "gate", 250.0, 0.2, 1000.0, 13),
        "valve": valve("gate", "low", 2e-3, ramp(0.2, 0.1, 1.0, 0.0)),
    }
    case = scene(nodes, links, 2.0, {}, ["gate.pressure"], title="Branches")
    for name, place in positions.items():
        case["nodes"][name]["position"] = place
    case["output"] |= {"fields": 10}
    return case


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    return fvsolve.run(branched(), out=tmp_path_factory.mktemp("runs") / "a", pictures=False)


def test_the_greatest_value_of_a_pipe_is_that_of_its_pieces(closed):
    plan = network_map(closed)
    for key, reduce in (("max_pressure", np.maximum), ("min_pressure", np.minimum)):
        values = extremes_of_pieces(closed, plan, key, reduce)
        for k, name in enumerate(plan.names):
            series = closed.envelope[name][key]
            own = values[plan.pipe == k] * 1e5  # bar
            assert reduce.reduce(own) == pytest.approx(reduce.reduce(series), rel=1e-12)


def test_the_worst_place_is_that_of_the_envelope(closed):
    plan = network_map(closed)
    layer = plan.layers[0]
    worst = max(closed.envelope, key=lambda name: closed.envelope[name]["max_pressure"].max())
    assert plan.names[plan.pipe[layer.worst]] == worst
    figure = network_figure(plan, closed.case)
    bar = closed.envelope[worst]["max_pressure"].max() / 1e5
    assert figure["map"]["layers"][0]["worst"]["text"] == f"{worst}: {bar:.4g} bar"


def test_pieces_lie_between_the_stated_positions(closed):
    plan = network_map(closed)
    assert plan.stated and plan.scaled
    stub = plan.ends[plan.pipe == plan.names.index("stub")]
    assert stub[0, 0].tolist() == [400.0, 0.0] and stub[-1, 1].tolist() == [400.0, 300.0]
    lengths = np.linalg.norm(stub[:, 1] - stub[:, 0], axis=1)
    assert lengths == pytest.approx(np.full(len(stub), 300.0 / len(stub)))


def test_order_and_direction_of_pipes_change_no_value_at_a_place(closed, tmp_path):
    turned = branched()
    turned["links"] = dict(reversed(turned["links"].items()))
    for name in ("main", "stub", "branch"):
        link = turned["links"][name]
        link["from"], link["to"] = link["to"], link["from"]
    other = network_map(fvsolve.run(turned, out=tmp_path / "run", pictures=False))
    plan = network_map(closed)
    assert [layer.name for layer in plan.layers] == [layer.name for layer in other.layers]
    at = [
        {tuple(np.round(ends.mean(axis=0), 6)): k for k, ends in enumerate(each.ends)}
        for each in (plan, other)
    ]
    assert at[0].keys() == at[1].keys()
    for first, second in zip(plan.layers, other.layers, strict=True):
        for place, k in at[0].items():
            assert second.values[at[1][place]] == pytest.approx(first.values[k], rel=1e-9)


def test_pressures_over_time_are_those_of_the_cells(closed):
    plan = network_map(closed)
    assert len(plan.frames) == 11 and plan.times[-1] == 2.0
    gate = plan.frames[-1][plan.pipe == plan.names.index("branch")][-1]
    final = closed.si("gate.pressure")[-1] / 1e5
    assert gate == pytest.approx(final, rel=0.02)


def test_positions_that_disagree_with_lengths_give_no_scale(tmp_path):
    small = {name: [0.01 * x, 0.01 * y] for name, (x, y) in POSITIONS.items()}
    result = fvsolve.run(branched(small), out=tmp_path / "run", pictures=False)
    plan = network_map(result)
    assert plan.stated and not plan.scaled
    page = write_report(tmp_path / "run")[0].read_text()
    assert "they do not agree with the lengths of pipes" in page
    assert '<div class="scale">' not in page


def test_without_positions_the_layout_is_named_as_drawn(tmp_path):
    result = fvsolve.run(branched({}), out=tmp_path / "run", pictures=False)
    plan = network_map(result)
    assert not plan.stated
    drawn = [
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
        for ends in (plan.ends[plan.pipe == k] for k in range(3))
    ]
    assert drawn == pytest.approx([400.0, 300.0, 250.0], rel=0.2)
    assert (
        "Drawn layout: not all nodes state a position."
        in write_report(tmp_path / "run")[0].read_text()
    )


def test_a_chain_of_pipes_without_positions_has_no_plan(tmp_path):
    case = branched({})
    del case["links"]["stub"], case["nodes"]["left"]
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    assert network_map(result) is None
    assert "map-network" not in write_report(tmp_path / "run")[0].read_text()


def test_utilisation_is_the_gauge_pressure_over_the_allowable_pressure(tmp_path):
    case = branched()
    case["links"]["branch"]["allowable_pressure"] = "10 bar"
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    plan = network_map(result)
    used = plan.layers[0]
    branch = plan.pipe == plan.names.index("branch")
    assert used.name == "utilisation of the allowable pressure" and used.classes.unit == "%"
    assert np.isnan(used.values[~branch]).all()
    gauge = result.envelope["branch"]["max_pressure"].max() - 101325.0
    assert used.values[branch].max() == pytest.approx(100.0 * gauge / 10e5)
    assert used.classes.of(used.values)[~branch].tolist() == [-1] * int((~branch).sum())


def test_units_of_the_output_change_the_numbers_of_the_legend_alone(closed, tmp_path):
    case = copy.deepcopy(branched())
    case["output"]["units"] = {"pressure": "kPa", "head": "ft"}
    plan = network_map(fvsolve.run(case, out=tmp_path / "run", pictures=False))
    first = network_map(closed)
    for own, other, factor in zip(
        plan.layers, first.layers, (100.0, 100.0, 1 / 0.3048, 1 / 0.3048), strict=True
    ):
        assert own.values == pytest.approx(factor * other.values)


def test_plot_draws_a_plan_of_each_quantity(closed, fvs, tmp_path):
    code, out, _ = fvs("plot", closed.directory, "--map", "--out", tmp_path)
    names = ("greatest-pressure", "least-pressure", "greatest-head", "least-head")
    assert code == 0
    assert out.split() == [str(tmp_path / f"map-network-{name}.png") for name in names]
