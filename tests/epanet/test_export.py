"""Cases written as EPANET files: EPANET's heads, flows and levels on them are those of the case."""

import tomllib
from pathlib import Path

import pytest

import fvsolve

wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")
pytest.importorskip("epanet", reason="EPANET's toolkit, the extra `epanet`, is not installed")

from fvsolve.case import load  # noqa: E402
from fvsolve.core.model.build import build  # noqa: E402
from fvsolve.errors import FvsolveError  # noqa: E402
from fvsolve.exchange.epanet import import_network, network_text  # noqa: E402
from fvsolve.exchange.epanet.network_file import read_network, run_epanet, solution_at  # noqa: E402

SHIPPED = Path(wntr.__file__).parent / "library" / "networks"
NETWORKS = [
    ("Net1", False),
    ("Net1", True),
    ("Net2", True),
    ("Net3", False),
    ("Net3", True),
    ("ky4", False),
]


def written(text, tmp_path, name="back.inp"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name, day", NETWORKS)
def test_a_network_that_was_imported_returns_with_its_heads(name, day, tmp_path):
    """EPANET's heads on the original file and on the exported file."""
    imported = import_network(SHIPPED / f"{name}.inp", day=day)
    text, _ = network_text(load(tomllib.loads(imported.text)))
    back = solution_at(read_network(written(text, tmp_path)), 0.0).solutions[0]
    gaps = [
        abs(back.head[own] - imported.solution.head[original])
        for original, own in imported.nodes.items()
    ]
    assert max(gaps) < 1e-3


@pytest.mark.parametrize("name", ["Net1", "Net2"])
def test_levels_over_a_day_are_those_of_the_original(name, tmp_path):
    source = SHIPPED / f"{name}.inp"
    imported = import_network(source, day=True)
    text, notes = network_text(load(tomllib.loads(imported.text)))
    assert not notes
    times = list(range(0, 86401, 3600))
    first = run_epanet(read_network(source), 86400, 60, times).solutions
    back = run_epanet(read_network(written(text, tmp_path)), 86400, 60, times).solutions
    for tank in (tank.name for tank in imported.network.tanks()):
        levels = [solution.head[tank] for solution in first]
        assert [solution.head[imported.nodes[tank]] for solution in back] == pytest.approx(
            levels, abs=0.02
        )


SMALL = {
    "fluid": {"name": "Water", "law": "linear", "density": "999.563 kg/m3"},
    "nodes": {
        "lake": {"type": "reservoir", "head": "60 m"},
        "a": {
            "type": "junction",
            "elevation": "10 m",
            "demand": "5 l/s",
            "required_pressure": "2 barg",
        },
        "b": {
            "type": "junction",
            "elevation": "12 m",
            "demand": "3 l/s",
            "required_pressure": "2 barg",
        },
        "c": {"type": "junction", "elevation": "9 m"},
        "tower": {
            "type": "tank",
            "elevation": "40 m",
            "area": "50 m2",
            "level": "3 m",
            "height": "6 m",
        },
    },
    "links": {
        "p1": {
            "type": "pipe",
            "from": "lake",
            "to": "a",
            "length": "400 m",
            "diameter": "250 mm",
            "friction": {"model": "hazen-williams", "coefficient": 110},
            "minor_loss": 2,
        },
        "v1": {
            "type": "valve",
            "from": "a",
            "to": "b",
            "diameter": "150 mm",
            "loss_coefficient": 4,
            "opening": 0.5,
        },
        "r1": {
            "type": "pressure-reducing",
            "from": "b",
            "to": "c",
            "set_pressure": "2.5 barg",
            "diameter": "200 mm",
            "time_constant": "5 s",
            "loss_coefficient": 1,
        },
        "p2": {
            "type": "pipe",
            "from": "c",
            "to": "d",
            "length": "300 m",
            "diameter": "200 mm",
            "friction": {"model": "hazen-williams", "coefficient": 120},
        },
        "k1": {
            "type": "check-valve",
            "from": "d",
            "to": "tower",
            "diameter": "200 mm",
            "loss_coefficient": 2,
        },
        "hole": {"type": "leak", "from": "a", "coefficient": 1e-6, "exponent": 0.5},
    },
    "numerics": {"end": "24 h", "pipe_model": "quasi-steady"},
}
SMALL["nodes"]["d"] = {
    "type": "junction",
    "elevation": "8 m",
    "demand": "4 l/s",
    "required_pressure": "2 barg",
}


def test_valves_leaks_and_demands_of_an_own_case_have_equal_heads(tmp_path):
    case = load(SMALL)
    nodes = build(case).checks["nodes"]
    text, notes = network_text(case)
    solution = solution_at(read_network(written(text, tmp_path)), 0.0).solutions[0]
    assert not notes
    for name, head in solution.head.items():
        assert nodes[name]["head"] == pytest.approx(head, abs=1e-4), name


FRICTIONS = {
    "C-M": {"model": "chezy-manning", "coefficient": 0.011},
    "D-W": {"model": "swamee-jain", "roughness": "0.1 mm"},
    "D-W, smooth": {"model": "swamee-jain", "roughness": 0.0},
    "D-W, Colebrook": {"model": "quasi-steady", "roughness": "0.1 mm"},
}


@pytest.mark.parametrize("gravity", [9.80665, 9.81456])
@pytest.mark.parametrize("name", FRICTIONS)
def test_pipes_of_other_formulas_have_equal_heads(name, gravity, tmp_path):
    """Friction losses of 0.1 m: the gravity of a case matters by 0.08 %, the factor of Colebrook by up to 3 %."""
    frictions = {f"links.{pipe}.friction": FRICTIONS[name] for pipe in ("p1", "p2")}
    case = load(SMALL, {"gravity": gravity, "fluid.viscosity": "1 mPa s", **frictions})
    nodes = build(case).checks["nodes"]
    text, notes = network_text(case)
    solution = solution_at(read_network(written(text, tmp_path)), 0.0).solutions[0]
    worst = max(abs(nodes[place]["head"] - head) for place, head in solution.head.items())
    assert worst < 1e-3 and bool(notes) == (FRICTIONS[name]["model"] == "quasi-steady")
    assert all("Swamee and Jain" in note for note in notes)


def test_features_that_epanet_cannot_express_are_refused_all_at_once():
    case = load(
        SMALL,
        {
            "nodes.c": {"type": "chamber", "volume": "1 m3", "elevation": "9 m"},
            "links.p2.friction": {"model": "steady", "factor": 0.02},
        },
    )
    with pytest.raises(FvsolveError, match="2 parts that EPANET cannot express") as caught:
        network_text(case)
    assert "nodes.c: EPANET has no chamber" in str(caught.value) and "links.p2.friction" in str(
        caught.value
    )


def test_the_command_writes_a_file_that_imports_again(tmp_path, fvs):
    imported = import_network(SHIPPED / "Net1.inp", day=True)
    case = written(imported.text, tmp_path, "net.toml")
    code, out, err = fvs("export", case, "--epanet", tmp_path / "back.inp")
    assert code == 0 and "back.inp" in out and err == ""
    code, _, err = fvs("export", case, "--epanet", tmp_path / "back.inp")
    assert code == 2 and "exists" in err
    assert fvs("export", case)[0] == 2
    again = import_network(tmp_path / "back.inp", day=True)
    levels = [
        fvsolve.run(load(tomllib.loads(item.text), {"output.units": {}}), pictures=False)[
            "nodes.2.level"
        ]
        for item in (imported, again)
    ]
    assert levels[1] == pytest.approx(levels[0], abs=5e-3)
