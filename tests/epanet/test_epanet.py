"""EPANET networks as cases: steady heads and flows agree with EPANET, nothing drifts, and bad files are explained."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import fvsolve
from fvsolve.case import load
from fvsolve.core.model.build import build

wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")

from fvsolve.exchange.epanet import import_network, network_file  # noqa: E402
from fvsolve.exchange.epanet.importing import cell_time  # noqa: E402

PACKAGE = Path(wntr.__file__).parent
SHIPPED, BROKEN = PACKAGE / "library" / "networks", PACKAGE / "tests" / "networks_for_testing"
NETWORKS = [
    ("Net1", 0),
    ("Net2", 0),
    ("Net2", 31),
    ("Net3", 0),
    ("Net3", 12),
    ("Net6", 0),
    ("ky4", 0),
    ("ky10", 0),
]

# Nodes between a shut valve and a pump of constant power without flow in EPANET; no law gives their head.
DEAD = {"ky10": {"O-Pump-11", "I-RV-4"}}

SMALL = """[TITLE]
Two lakes, a loop
[JUNCTIONS]
a 10 5 day
b 12 3
c 9 0
[DEMANDS]
c 4 day
c 2 night
[RESERVOIRS]
high 60
low 35 tide
[PIPES]
p1 high a 400 250 {r} 0 Open
p2 a b 300 150 {r} 2.5 Open
p3 b c 350 200 {r} 0 Open
p4 a c 500 150 {r} 0 Open
p5 c low 450 200 {r} 10 Open
p6 b low 200 100 {r} 0 Closed
p7 low c 100 150 {r} 0 CV
[VALVES]
[PATTERNS]
day 0.5 1.5 2.0
night 1.2 0.4
tide 1.0 1.02
[TIMES]
DURATION 5:00
PATTERN TIMESTEP 1:00
PATTERN START 1:00
[OPTIONS]
UNITS LPS
HEADLOSS {formula}
PATTERN night
DEMAND MULTIPLIER 1.3
[END]
"""


def truth(path, hour):
    """Heads [m] and flows [m3/s] of EPANET at an hour, at its least tolerance."""
    network = wntr.network.WaterNetworkModel(str(path))
    network.options.hydraulic.accuracy = 1e-5
    network.options.hydraulic.trials = 200
    step = network.options.time.hydraulic_timestep
    network.options.time.duration = 3600 * hour
    network.options.time.report_timestep = step
    found = wntr.sim.EpanetSimulator(network).run_sim(
        file_prefix=str(path.parent / path.stem) + "-truth"
    )
    at = 3600 * hour
    return found.node["head"].loc[at].to_dict(), found.link["flowrate"].loc[at].to_dict()


def differences(path, hour, where, shortest=0.0):
    """Greatest differences of heads [m] and of flows (over the largest flow), and the imported network."""
    made = import_network(path, hour, shortest=shortest)
    case = where / "net.toml"
    case.write_text(made.text, encoding="utf-8")
    model = build(load(case))
    checks = model.checks
    copy = where / path.name
    copy.write_bytes(path.read_bytes())
    heads, flows = truth(copy, hour)
    live = [name for name in made.nodes if name not in DEAD.get(path.stem, ())]
    lost = max(abs(checks["nodes"][made.nodes[name]]["head"] - heads[name]) for name in live)
    pipes = checks["pipes"]
    found = {name: pipes[ours]["flow"] for name, ours in made.links.items() if ours in pipes}
    off = max(abs(flow - flows[name]) for name, flow in found.items()) / max(
        map(abs, flows.values())
    )
    return lost, off, made


@pytest.mark.parametrize("name, hour", NETWORKS, ids=[f"{name}-{hour}" for name, hour in NETWORKS])
def test_steady_heads_and_flows_are_epanets(name, hour, tmp_path):
    lost, off, _ = differences(SHIPPED / f"{name}.inp", hour, tmp_path)
    assert lost < 1e-3 and off < 1e-4  # [m], [-]


@pytest.mark.parametrize("name, hour", [("ky4", 12), ("ky10", 10)])
def test_tanks_that_epanet_fills_to_their_rim_are_read(name, hour):
    """Levels of EPANET exceed the rim by rounding: 31.659582 m in a tank of 31.659576 m."""
    case = load(tomllib.loads(import_network(SHIPPED / f"{name}.inp", hour).text))
    assert any(node.level == node.height for node in case.nodes.values() if node.kind == "tank")


@pytest.mark.parametrize(
    "formula, roughness, within", [("H-W", 110, 1e-3), ("C-M", 0.011, 1e-3), ("D-W", 0.3, 1e-3)]
)
def test_every_head_loss_formula_patterns_minor_losses_and_shut_pipes(
    formula, roughness, within, tmp_path
):
    path = tmp_path / "in" / "small.inp"
    path.parent.mkdir()
    path.write_text(SMALL.format(r=roughness, formula=formula))
    for hour in (0, 1, 4):
        lost, off, made = differences(path, hour, tmp_path)
        assert lost < within and off < 10 * within / 25.0
        links = tomllib.loads(made.text)["links"]
        assert links["p6-shut"]["opening"] == 0.0 and links["p7-check"]["type"] == "check-valve"


def still(made):
    """Case with tanks as reservoirs at their level, so that nothing moves."""
    case = tomllib.loads(made.text)
    for name, node in case["nodes"].items():
        if node["type"] == "tank":
            head = float(node["elevation"].split()[0]) + float(node["level"].split()[0])
            case["nodes"][name] = {"type": "reservoir", "head": head}
    return case


# numerics.pipe_model, and shortest pipe for steps of cells [m]
LINES = [("auto", 0.0), ("finite-volume", 3.0)]


@pytest.mark.in_turn
@pytest.mark.parametrize("line, shortest", LINES)
@pytest.mark.parametrize("name", ["Net2", "Net3"])
def test_without_an_event_no_bit_changes_and_a_closure_moves_the_network(name, line, shortest):
    case = still(import_network(SHIPPED / f"{name}.inp", shortest=shortest))
    case["numerics"]["pipe_model"] = line
    drawn = {
        node: float(part["demand"].split()[0])
        for node, part in case["nodes"].items()
        if "demand" in part
    }
    most = max(drawn, key=drawn.get)
    case["nodes"][most]["demand"] = {
        "start": 20.0,
        "duration": 0.5,
        "value": [drawn[most] * 1e-3, 0.0],
    }
    case["output"] = {
        "every": 0.5,
        "probes": [f"nodes.{node}.head" for node in list(case["nodes"])[::9]],
        "fields": 0,
    }
    case["output"]["probes"].append(f"nodes.{most}.head")
    result = fvsolve.run(
        case, set={"numerics.end": 24.0, "numerics.cell_time": 0.04, "numerics.scheme": "muscl"}
    )
    before = np.asarray(result.t) <= 20.0
    for probe in case["output"]["probes"]:
        assert np.ptp(result[probe][before]) == 0.0, probe
    assert np.ptp(result[f"nodes.{most}.head"]) > 1.0


@pytest.mark.parametrize("line, shortest", LINES)
def test_a_pump_trip_on_net3_moves_nothing_before_and_travels_at_its_wave_speed_after(
    line, shortest
):
    case = still(import_network(SHIPPED / "Net3.inp", shortest=shortest))
    case["numerics"]["pipe_model"] = line
    case["links"]["335"] |= {"rated_speed": "890 rpm", "inertia": "47 kg m2", "trip": 20.0}
    case["output"] = {
        "every": 0.25,
        "fields": 0,
        "probes": ["nodes.61.head", "nodes.123.head", "nodes.15.head"],
    }
    set = {
        "numerics.end": 34.0,
        "numerics.cell_time": 0.04,
        "numerics.scheme": "muscl",
        "numerics.method": "ssp-rk2",
    }
    result = fvsolve.run(case, set=set)
    t = np.asarray(result.t)
    assert all(np.ptp(result[probe][t <= 20.0]) == 0.0 for probe in case["output"]["probes"])
    arrival = 20.0 + 13868.4 / 1200.0  # travel time along the main from 61 to 123
    near, far = (np.asarray(result[f"nodes.{node}.head"]) for node in ("61", "123"))
    assert near[0] - near[t <= arrival].min() > 10.0
    assert np.ptp(far[t <= arrival - 0.5]) < 1e-2 and far[0] - far[-1] > 5.0


def test_a_pipe_shorter_than_requested_is_lengthened_with_its_loss_and_a_notice(tmp_path):
    path = tmp_path / "in" / "short.inp"
    path.parent.mkdir()
    for formula, roughness in (("H-W", 110), ("C-M", 0.011)):
        path.write_text(
            SMALL.format(r=roughness, formula=formula).replace("p3 b c 350", "p3 b c 0.5")
        )
        lost, off, made = differences(path, 0, tmp_path, shortest=3.0)
        assert lost < 0.05
        assert tomllib.loads(made.text)["links"]["p3"]["length"] == "3 m"
        assert ["p3"] in [
            names for what, names in made.notes if what.startswith("lengthened to 3 m")
        ]


@pytest.mark.parametrize("name", ["Net3", "ky4"])
def test_every_pipe_is_as_long_as_in_epanet_and_those_shorter_than_a_cell_are_named(name):
    made = import_network(SHIPPED / f"{name}.inp")
    network, case = (
        wntr.network.WaterNetworkModel(str(SHIPPED / f"{name}.inp")),
        load(tomllib.loads(made.text)),
    )
    lengths = {pipe: link.length for pipe, link in network.pipes()}
    found = {pipe: case.links[made.links[pipe]].length for pipe in lengths}
    assert found == {pipe: pytest.approx(length, rel=1e-9) for pipe, length in lengths.items()}
    assert (
        made.short_pipes
        == [pipe for pipe in sorted(lengths, key=lengths.get) if lengths[pipe] < 12.0]
        != []
    )
    assert (
        f"{len(made.short_pipes)} pipes are shorter than a cell" in made.text
        and made.links[made.short_pipes[0]] in made.text
    )


def test_short_pipes_set_no_step_and_keep_their_own_loss(tmp_path):
    path = tmp_path / "in" / "short.inp"
    path.parent.mkdir()
    path.write_text(SMALL.format(r=110, formula="H-W").replace("p3 b c 350", "p3 b c 0.5"))
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 1e-3 and off < 1e-3 and made.short_pipes == ["p3"]
    steps = {
        line: build(load(tomllib.loads(made.text), {"numerics.pipe_model": line})).checks["step"]
        for line in ("auto", "finite-volume")
    }
    assert steps["auto"] > 10 * steps["finite-volume"]


@pytest.mark.parametrize("units, exponent", [("LPS", 0.5), ("LPS", 0.9), ("GPM", 0.9)])
def test_emitters_draw_the_flow_of_epanet(units, exponent, tmp_path):
    path = tmp_path / "in" / "leaky.inp"
    path.parent.mkdir()
    text = SMALL.format(r=110, formula="H-W").replace(
        "UNITS LPS", f"UNITS {units}\nEMITTER EXPONENT {exponent}"
    )
    path.write_text(text.replace("[VALVES]", "[EMITTERS]\nb 0.7\nc 0.2\n[VALVES]"))
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 2e-3 and off < 1e-3
    assert tomllib.loads(made.text)["links"]["b-emitter"]["type"] == "leak"


FOLLOWS = "DEMAND MODEL PDA\nREQUIRED PRESSURE {required}\nMINIMUM PRESSURE {least}\nPRESSURE EXPONENT 0.6\n"
LEAKY = "[EMITTERS]\nb 0.7\nc 0.2\n[VALVES]"


def written(tmp_path, changes, options=""):
    """File of the small network with replaced texts and added options, in its own folder."""
    path = tmp_path / "in" / "net.inp"
    path.parent.mkdir()
    text = SMALL.format(r=110, formula="H-W")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text.replace("[END]", f"{options}[END]"))
    return path


@pytest.mark.in_turn
@pytest.mark.parametrize("weight", [1.0, 0.8, 1.3])
@pytest.mark.parametrize("leaks", [{}, {"[VALVES]": LEAKY}], ids=["alone", "emitters"])
@pytest.mark.parametrize("units, required, least", [("LPS", 40, 5), ("GPM", 66, 8)])
def test_demands_that_follow_the_pressure_are_parts_that_do(
    weight, leaks, units, required, least, tmp_path
):
    """EPANET reports the sum of demand and emitter flow, and states pressures as heads of water."""
    options = FOLLOWS.format(required=required, least=least) + f"SPECIFIC GRAVITY {weight}\n"
    path = written(tmp_path, {"UNITS LPS": f"UNITS {units}", **leaks}, options)
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 2e-3 and off < 1e-3
    case = load(tomllib.loads(made.text))
    assert (
        case.nodes["a"].required_pressure > case.nodes["a"].minimum_pressure > case.ambient_pressure
    )
    assert not any("pressure" in what for what, _ in made.notes)


BEHIND = {  # links to junction d, whose demand depends on its pressure
    "shut pipe": {"p6 b low": "p8 c d 100 100 110 0 Closed\np6 b low"},
    "shut valve": {"[VALVES]": "[VALVES]\nv1 c d 100 TCV 5 0\n[STATUS]\nv1 CLOSED"},
    "open valve": {"[VALVES]": "[VALVES]\nv1 c d 100 TCV 5 0"},
    "reducing valve": {"[VALVES]": "[VALVES]\nv1 c d 100 PRV 10 0"},
}


@pytest.mark.parametrize("way", BEHIND)
@pytest.mark.parametrize("demand", [2, 0])
def test_a_demand_behind_a_valve_gets_the_flow_that_its_pressure_allows(way, demand, tmp_path):
    changes = {"[DEMANDS]": f"d 8 {demand}\n[DEMANDS]", **BEHIND[way]}
    path = written(tmp_path, changes, FOLLOWS.format(required=40, least=0))
    if demand or not way.startswith("shut"):
        assert differences(path, 0, tmp_path)[0] < 2e-3
    else:  # the pressure behind a shut link is undetermined
        build(load(tomllib.loads(import_network(path).text)))


@pytest.mark.in_turn
@pytest.mark.parametrize("weight", [0.8, 1.0, 1.3])
@pytest.mark.parametrize("units, power", [("LPS", 3), ("GPM", 4)])
def test_a_pump_of_constant_power_lifts_as_in_epanet_whatever_the_fluid_weighs(
    weight, units, power, tmp_path
):
    changes = {
        "[VALVES]": f"[PUMPS]\nq low c POWER {power}\n[VALVES]",
        "UNITS LPS": f"UNITS {units}",
    }
    lost, off, _ = differences(
        written(tmp_path, changes, f"SPECIFIC GRAVITY {weight}\n"), 0, tmp_path
    )
    assert lost < 2e-3 and off < 1e-3


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "weight, setting", [(0.8, 28), (0.8, 33.6), (0.8, 41), (1.3, 54.6), (1.3, 58), (1.3, 68)]
)
@pytest.mark.parametrize("kind", ["PRV", "PSV"])
def test_a_set_pressure_is_a_pressure_of_water_at_any_density_of_the_fluid(
    kind, weight, setting, tmp_path
):
    """Some settings exceed every source; in the second file the import moves the junction, because a pipe is steep."""
    changes = {
        "p4 a c 500 150 110 0 Open\n": "",
        "[VALVES]": f"[VALVES]\nv1 a c 150 {kind} {setting} 2",
    }
    path = written(tmp_path, changes, f"SPECIFIC GRAVITY {weight}\n")
    assert differences(path, 0, tmp_path)[0] < 5e-3
    steep = path.read_text().replace("p3 b c 350", "p3 b c 5").replace("c 9 0", "c 0 0")
    path.write_text(steep)
    assert differences(path, 0, tmp_path)[0] < 5e-3


@pytest.mark.parametrize("follows", [True, False])
def test_where_a_flow_follows_the_pressure_a_steep_pipe_grows_and_no_junction_moves(
    follows, tmp_path
):
    changes = {
        "p3 b c 350": "p3 b c 5",
        "c 9 0": "c 0 0",
        "[VALVES]": "[VALVES]" if follows else LEAKY,
    }
    path = written(tmp_path, changes, FOLLOWS.format(required=60, least=0) if follows else "")
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 2e-3 and off < 1e-3
    assert tomllib.loads(made.text)["nodes"]["c"]["elevation"] == "0 m"
    assert ["p3"] in [
        names for what, names in made.notes if what.startswith("lengthened to 12.12 m")
    ]


VALVES = {
    "TCV": ("v1 a c 150 TCV 40 0", "valve"),
    "TCV below its minor loss": ("v1 a c 150 TCV 4 40", "valve"),
    "TCV without loss": ("v1 a c 150 TCV 0 40", "valve"),
    "FCV": ("v1 a c 150 FCV 5 0", "flow-control"),
    "PRV": ("v1 a c 150 PRV 32 0", "pressure-reducing"),
    "PSV": ("v1 a c 150 PSV 45 0", "pressure-sustaining"),
    "PBV": ("v1 a c 150 PBV 3 0", "loss-curve"),
    "GPV": ("v1 a c 150 GPV g 0\n[CURVES]\ng 0 0\ng 10 2\ng 40 20", "loss-curve"),
}


@pytest.mark.parametrize("kind", VALVES)
def test_valves_of_every_kind_stand_as_epanets_do(kind, tmp_path):
    line, word = VALVES[kind]
    path = tmp_path / "in" / "valve.inp"
    path.parent.mkdir()
    text = SMALL.format(r=110, formula="H-W").replace("p4 a c 500 150 110 0 Open\n", "")
    path.write_text(text.replace("[VALVES]", f"[VALVES]\n{line}"))
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 1e-3 and off < 1e-3
    assert tomllib.loads(made.text)["links"]["v1"]["type"] == word


@pytest.mark.parametrize(
    "line, opening", [("v1 a c 150 PRV 90 2", 1.0), ("v1 a c 150 PSV 90 0", 0.0)]
)
def test_a_valve_set_above_every_source_stands_open_or_shut(line, opening, tmp_path):
    path = tmp_path / "in" / "valve.inp"
    path.parent.mkdir()
    text = SMALL.format(r=110, formula="H-W").replace("p4 a c 500 150 110 0 Open\n", "")
    path.write_text(text.replace("[VALVES]", f"[VALVES]\n{line}"))
    lost, off, made = differences(path, 0, tmp_path)
    assert lost < 5e-3 and off < 1e-3
    assert tomllib.loads(made.text)["links"]["v1"].get("opening", 1.0) == opening


def test_a_valve_that_drives_its_flow_uphill_is_listed(tmp_path):
    """EPANET keeps the drop of a PBV at its setting in both directions, so flow from c to a gains head."""
    path = tmp_path / "in" / "valve.inp"
    path.parent.mkdir()
    text = SMALL.format(r=110, formula="H-W").replace("p4 a c 500 150 110 0 Open\n", "")
    path.write_text(text.replace("[VALVES]", "[VALVES]\nv1 a c 150 PBV 30 0"))
    made = differences(path, 0, tmp_path)[2]
    assert ["v1"] in [
        names for what, names in made.notes if what.startswith("PBV raises the head along its flow")
    ]


def test_cells_grow_only_where_their_number_would_be_too_large():
    assert cell_time([1e4, 2e4], 1200.0) == 0.01
    assert cell_time([1e6], 1000.0) == 0.025


def test_a_climb_steeper_than_the_pipe_moves_the_junction_and_no_head(tmp_path):
    path = tmp_path / "in" / "steep.inp"
    path.parent.mkdir()
    path.write_text(
        SMALL.format(r=110, formula="H-W")
        .replace("p3 b c 350", "p3 b c 5")
        .replace("c 9 0", "c 0 0")
    )
    lost, _, made = differences(path, 0, tmp_path)
    assert lost < 1e-3
    assert ["c"] in [names for what, names in made.notes if what.startswith("elevation changed")]


FAULTS = {
    "[PIPES]": ("[PIPES", "[PIPES"),
    "p2 a b": ("p2 a bb", "undefined node bb"),
    "300 150": ("300 -150", "-150"),
    "UNITS LPS": ("UNITS FURLONGS", "FURLONGS"),
    "[VALVES]": ("[PUMPS]\nq high b HEAD c9", "undefined curve c9"),
    "p1 high a 400": ("p1 high a four", "four"),
    "a 10 5 day": ("a 10 5 dusk", "undefined time pattern dusk"),
}


@pytest.mark.parametrize("good", FAULTS)
def test_a_broken_file_is_reported_by_its_fault(good, tmp_path, fvs):
    bad, said = FAULTS[good]
    path = tmp_path / "bad.inp"
    path.write_text(SMALL.format(r=110, formula="H-W").replace(good, bad, 1))
    code, out, err = fvs("import", path, tmp_path / "x.toml")
    assert code == 2 and said in err and "bad.inp: 1 fault" in err and out == ""
    assert not (tmp_path / "x.toml").exists()


def test_all_faults_that_epanet_lists_are_reported_at_once(tmp_path, fvs):
    path = tmp_path / "bad.inp"
    text = (
        SMALL.format(r=110, formula="H-W")
        .replace("p2 a b", "p2 a bb")
        .replace("500 150", "500 -150")
    )
    path.write_text(text)
    code, _, err = fvs("import", path, tmp_path / "x.toml")
    assert code == 2 and "2 faults" in err and "undefined node bb" in err and "-150" in err


@pytest.mark.parametrize("name, said", [("bad_values", "node1"), ("bad_syntax", "FOO")])
def test_the_broken_files_that_wntr_ships(name, said, tmp_path, fvs):
    if not BROKEN.is_dir():
        pytest.skip("this WNTR ships no test networks")
    code, _, err = fvs("import", BROKEN / f"{name}.inp", tmp_path / "x.toml")
    assert code == 2 and said in err


def test_a_network_without_a_source_or_an_hour_before_its_start(tmp_path, fvs):
    path = tmp_path / "dry.inp"
    path.write_text(
        "[JUNCTIONS]\na 10 5\nb 10 5\n[PIPES]\np1 a b 100 200 100 0 Open\n[OPTIONS]\nUNITS LPS\n[END]\n"
    )
    code, _, err = fvs("import", path, tmp_path / "x.toml")
    assert code == 2 and "no tanks or reservoirs" in err
    code, _, err = fvs("import", SHIPPED / "Net2.inp", tmp_path / "x.toml", "--hour", "-1")
    assert code == 2 and "0 or more" in err


def test_the_command_writes_a_case_that_checks_and_never_writes_over_a_file(tmp_path, fvs):
    to = tmp_path / "town.toml"
    code, out, err = fvs(
        "import", SHIPPED / "Net2.inp", to, "--hour", "7", "--wave-speed", "1000 m/s"
    )
    assert code == 0 and str(to) in out and (tmp_path / "schema.json").exists()
    assert load(to).links["1"].wave_speed == 1000.0
    code, _, err = fvs(
        "import", SHIPPED / "Net2.inp", tmp_path / "long.toml", "--min-pipe-length", "100 m"
    )
    assert (
        code == 0
        and "lengthened to 100 m" in err
        and min(p.length for p in load(tmp_path / "long.toml").links.values()) == 100
    )
    code, _, err = fvs(
        "import", SHIPPED / "Net2.inp", tmp_path / "none.toml", "--min-pipe-length", "0 m"
    )
    assert code == 2 and "--min-pipe-length: 0 m is not positive" in err
    code, out, _ = fvs("check", to)
    assert code == 0 and "step" in out
    code, _, err = fvs("import", SHIPPED / "Net2.inp", to)
    assert code == 2 and "exists" in err
    assert fvs("import", "--hour", "3")[0] == 2


def test_without_the_toolkit_the_message_names_the_package_to_install(monkeypatch, tmp_path, fvs):
    monkeypatch.setattr(network_file, "is_installed", lambda: False)
    code, _, err = fvs("import", SHIPPED / "Net2.inp", tmp_path / "x.toml")
    assert code == 2 and 'pip install "fvsolve[epanet]"' in err
