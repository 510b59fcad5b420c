"""EPANET files of many kinds: what EPANET reads is imported, and the case agrees with EPANET or names the cause."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fvsolve

pytest.importorskip("epanet", reason="EPANET's toolkit, the extra `epanet`, is not installed")

from fvsolve.case import load  # noqa: E402
from fvsolve.core.model.build import build  # noqa: E402
from fvsolve.errors import FvsolveError  # noqa: E402
from fvsolve.exchange.epanet import (
    import_network,
    network_file,
    self_check,
    switching,
    toolkit_process,
)  # noqa: E402

OPTIONS = "[OPTIONS]\nUNITS LPS\nHEADLOSS H-W\n[END]\n"
PUMPED = """[JUNCTIONS]
a 5 0
b 8 {demand}
[RESERVOIRS]
lake 10
{source}
[TANKS]
{tank}
[PIPES]
p1 a b 400 250 110 0 Open
{pipe}
[PUMPS]
lift lake a HEAD 1 {speed}
[CURVES]
1 30 {head}
[STATUS]
{status}
[CONTROLS]
{controls}
[RULES]
{rules}
[TIMES]
DURATION 24:00
HYDRAULIC TIMESTEP 1:00
"""
TOWER = {
    "tank": "tower 40 {level} 1 6 12 0",
    "pipe": "p2 b tower 300 200 120 0 Open",
    "source": "",
    "head": 45,
    "demand": 4,
}


def pumped(level=3, **keys):
    """Text of a network with a pump and a tower."""
    given = {"speed": "", "status": "", "controls": "", "rules": ""} | TOWER | keys
    given["tank"] = given["tank"].format(level=level)
    return PUMPED.format(**given) + OPTIONS


def written(tmp_path, text, name="net.inp"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def compared(imported, tmp_path):
    """Comparison of the start with EPANET, without any difference above its limit."""
    case = tmp_path / "case.toml"
    case.write_text(imported.text, encoding="utf-8")
    found = self_check.check_start(imported, load(case))
    assert not found.fault
    return found


def heads(imported, tmp_path):
    """Heads of the case at its start [m], by EPANET's names."""
    case = tmp_path / "case.toml"
    case.write_text(imported.text, encoding="utf-8")
    nodes = build(load(case)).checks["nodes"]
    return {name: nodes[own]["head"] for name, own in imported.nodes.items()}


# what EPANET reads ----------------------------------------------------------------------------------------------------

MAIN = "[JUNCTIONS]\na 10 20\n[RESERVOIRS]\nR 50\n[PIPES]\np1 R a 500 200 110 0 Open\n"
READ = {
    "Windows text": b"[TITLE]\nRed de la Pe\xf1a\n" + MAIN.encode() + OPTIONS.encode(),
    "units SI": MAIN + "[OPTIONS]\nUNITS SI\nHEADLOSS H-W\n[END]\n",
    "no units": MAIN + "[OPTIONS]\nHEADLOSS H-W\n[END]\n",
    "words of quality": MAIN + "[OPTIONS]\nUNITS LPS\nQUALITY Chemical TIME\nHEADLOSS H-W\n[END]\n",
    "default pattern that does not exist": MAIN + "[OPTIONS]\nUNITS LPS\nPATTERN time\n[END]\n",
    "statistic with another ending": MAIN + "[TIMES]\nStatistic Average\n" + OPTIONS,
    "clock without minutes": MAIN
    + "[RULES]\nRULE 1\nIF SYSTEM CLOCKTIME >= 6 AM\nTHEN PIPE p1 STATUS IS OPEN\n"
    + OPTIONS,
    "pressures in kPa": MAIN + "[OPTIONS]\nUNITS LPS\nPRESSURE KPA\n[END]\n",
    "Windows line ends": (MAIN + OPTIONS).replace("\n", "\r\n"),
}


@pytest.mark.parametrize("kind", READ)
def test_every_file_that_epanet_reads_is_imported_with_its_heads(kind, tmp_path):
    imported = import_network(written(tmp_path, READ[kind]))
    assert compared(imported, tmp_path).agrees
    if kind == "Windows text":
        assert "Peña" in imported.text


@pytest.mark.parametrize("law, head", [("40 30", 55.5557), ("60 40 30 25 50", 56.5), ("4.0", None)])
def test_pumps_of_the_first_epanet_are_read(law, head, tmp_path):
    """`head flow`, three points and power; EPANET 2.2 gives the heads, 1.33334 * 40 at zero flow for the first form."""
    text = "[JUNCTIONS]\na 10 0\nb 10 20\n[RESERVOIRS]\nR 10\n[PIPES]\np1 a b 1000 200 110 0 Open\n"
    text += f"[PUMPS]\npu R a {law}\n"
    imported = import_network(written(tmp_path, text + OPTIONS))
    assert compared(imported, tmp_path).agrees and imported.network.rewritten
    if law == "40 30":  # a - b q^2 through (0, 53.3336), (30, 40)
        expected = 10.0 + 1.33334 * 40.0 - (1.33334 - 1.0) * 40.0 * (20.0 / 30.0) ** 2
        assert heads(imported, tmp_path)["a"] == pytest.approx(expected, abs=1e-3)
    if law == "4.0":  # kW
        assert imported.network.links["pu"].power == pytest.approx(4000.0, rel=1e-4)


def test_a_factor_of_the_first_epanet_in_the_demands_is_read(tmp_path):
    text = MAIN.replace("[PIPES]", "[DEMANDS]\nMULTIPLY 0.5\n[PIPES]")
    imported = import_network(written(tmp_path, text + OPTIONS))
    junction = imported.network.nodes["a"]
    assert imported.network.demand_at(junction, 0.0) == pytest.approx(0.010)
    assert imported.network.options["multiplier"] == 0.5


FAULTS = {
    "[PIPES]\np1 R": ("[PIPES]\np1 Q", "net.inp:6: undefined node Q", "expected a node of"),
    "R a 500": ("R a -500", "-500", "expected"),
    "UNITS LPS": ("UNITS FURLONGS", "FURLONGS", "expected"),
}


@pytest.mark.parametrize("good", FAULTS)
def test_a_fault_has_its_line_and_a_remedy(good, tmp_path):
    bad, said, remedy = FAULTS[good]
    path = written(tmp_path, (MAIN + OPTIONS).replace(good, bad, 1))
    with pytest.raises(FvsolveError, match="reported by EPANET") as caught:
        import_network(path)
    assert (
        said in str(caught.value)
        and remedy in str(caught.value)
        and "net.inp:" in str(caught.value)
    )


def test_a_binary_file_is_refused_by_its_kind(tmp_path):
    path = written(tmp_path, b"<EPANET2>\0\1\2")
    with pytest.raises(FvsolveError, match="is not a text file"):
        import_network(path)


def test_a_crash_of_the_toolkit_is_a_message(tmp_path, monkeypatch):
    def crash(*arguments, **keys):
        return subprocess.CompletedProcess(arguments, -11, b"", b"")

    monkeypatch.setattr(network_file.subprocess, "run", crash)
    with pytest.raises(FvsolveError, match="stopped with code -11"):
        import_network(written(tmp_path, MAIN + OPTIONS))


# right at the start ---------------------------------------------------------------------------------------------------


def test_the_section_status_counts_more_than_the_speed_of_a_pump(tmp_path):
    text = pumped(
        tank="",
        pipe="p2 b high 900 200 120 0 Open",
        source="high 50",
        head=70,
        demand=10,
        speed="SPEED 2",
        status="lift 1",
    )
    imported = import_network(written(tmp_path, text))
    assert heads(imported, tmp_path)["a"] == pytest.approx(57.57, abs=0.005)
    assert compared(imported, tmp_path).agrees


def test_an_open_valve_without_loss_has_none_whatever_its_diameter(tmp_path):
    text = """[JUNCTIONS]
a 0 50
b 0 50
[RESERVOIRS]
high 50
low 25
[PIPES]
p1 high a 500 500 100 0 Open
p2 b low 500 500 100 0 Open
[VALVES]
v a b 12 {kind} 0
[STATUS]
v OPEN
"""
    for kind in ("FCV 500", "PRV 10", "PSV 10", "TCV 5", "PBV 3"):
        imported = import_network(written(tmp_path, text.format(kind=kind) + OPTIONS))
        case = load(_case(imported, tmp_path))
        flow = build(case).checks["pipes"]
        assert flow["p1"]["flow"] == pytest.approx(0.662, abs=5e-4) and flow["p2"][
            "flow"
        ] == pytest.approx(0.562, abs=5e-4)


def _case(imported, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(imported.text, encoding="utf-8")
    return path


def test_short_pipes_between_tanks_at_different_heights_end(tmp_path):
    text = """[JUNCTIONS]
chamber 60 0
town 20 5
[TANKS]
upper 70 2 0 4 10 0
lower 50 2 0 4 10 0
[RESERVOIRS]
R 90
[PIPES]
p0 R upper 500 200 110 0 Open
p1 upper chamber 1 200 110 0 Open
p2 chamber lower 1 200 110 0 Open
p3 lower town 500 200 110 0 Open
"""
    imported = import_network(written(tmp_path, text + OPTIONS))
    assert [names for note, names in imported.notes if note.startswith("lengthened")]
    assert compared(imported, tmp_path).agrees


@pytest.mark.parametrize("elevation", ["96.000", "96.0001", "95.999"])
def test_a_pipe_as_long_as_its_rise_is_vertical(elevation, tmp_path):
    text = f"[JUNCTIONS]\na 100.000 0\nb {elevation} 10\n[RESERVOIRS]\nR 900\n[PIPES]\np1 R a 500 8 0.005 0 Open\n"
    text += "p2 a b 4 8 0.005 0 Open\n[OPTIONS]\nUNITS GPM\nHEADLOSS D-W\n[END]\n"
    imported = import_network(written(tmp_path, text))
    assert not compared(imported, tmp_path).fault
    moved = any("elevation changed" in note for note, _ in imported.notes)
    assert moved == (elevation == "95.999")


def test_an_emitter_above_its_pressure_is_named(tmp_path):
    text = "[JUNCTIONS]\nA 10 5\nB 95 0\nC 20 10\n[RESERVOIRS]\nR 90\n[PIPES]\np1 R A 1000 200 110 0 Open\n"
    text += "p2 A B 300 150 110 0 Open\np3 A C 300 150 110 0 Open\n[EMITTERS]\nB 2.0\n"
    imported = import_network(written(tmp_path, text + OPTIONS))
    found = compared(imported, tmp_path)
    assert (
        found.agrees and found.compared[0].above and "emitter above its pressure" in found.causes[0]
    )
    assert "B (" in found.causes[0] or "(B)" in found.causes[0]
    assert heads(imported, tmp_path)["B"] == pytest.approx(88.12, abs=0.01)  # EPANET: 89.35 m
    # EPANET 2.3 can forbid the flow; then both agree
    closed = import_network(
        written(tmp_path, text + OPTIONS.replace("[END]", "BACKFLOW ALLOWED NO\n[END]"))
    )
    assert not closed.causes and not compared(closed, tmp_path).compared[0].above


def test_a_position_control_valve_of_epanet_2_3(tmp_path):
    text = "[JUNCTIONS]\na 0 0\nb 0 20\n[RESERVOIRS]\nR 50\n[PIPES]\np1 R a 500 200 110 0 Open\n[VALVES]\n"
    text += "v a b 200 PCV 40 5 c\n[CURVES]\n;VALVE:\nc 0 0\nc 50 20\nc 100 100\n"
    imported = import_network(written(tmp_path, text + OPTIONS))
    assert compared(imported, tmp_path).agrees
    assert load(_case(imported, tmp_path)).links["v"].opening.first == pytest.approx(0.16)


def test_a_pressure_below_vacuum_is_a_set_head(tmp_path):
    text = "[JUNCTIONS]\na 10 0\nb 60 20\nc 60 0\n[RESERVOIRS]\nR 80\n[PIPES]\np1 R a 500 200 110 0 Open\n"
    text += "p2 c b 50 200 110 0 Open\n[VALVES]\nv a c 200 PRV -30 0\n"
    imported = import_network(written(tmp_path, text + OPTIONS))
    assert compared(imported, tmp_path).agrees
    assert heads(imported, tmp_path)["c"] == pytest.approx(30.0, abs=1e-3)


def test_pressure_dependent_demands_as_in_epanet(tmp_path, fvs):
    text = MAIN.replace("R 50", "R 14")
    path = written(tmp_path, text + OPTIONS)
    plain = import_network(path)
    soft = import_network(path, required_pressure=20.0)
    assert compared(soft, tmp_path).agrees
    assert heads(soft, tmp_path)["a"] > heads(plain, tmp_path)["a"] + 0.1
    written_in_file = import_network(
        written(
            tmp_path,
            text + OPTIONS.replace("[END]", "DEMAND MODEL PDA\nREQUIRED PRESSURE 20\n[END]"),
            "pda.inp",
        )
    )
    assert heads(written_in_file, tmp_path)["a"] == pytest.approx(
        heads(soft, tmp_path)["a"], abs=1e-9
    )
    code, _, err = fvs("import", path, tmp_path / "soft.toml", "--pressure-dependent", "20 mH2O")
    assert code == 0 and "required_pressure" in (tmp_path / "soft.toml").read_text(), err


# right over a day -----------------------------------------------------------------------------------------------------


def day_of(text, tmp_path):
    """Imported day, and its comparison with EPANET at steps of 10 s."""
    imported = import_network(written(tmp_path, text), day=True)
    return imported, self_check.check_day(imported, _case(imported, tmp_path))


SETTINGS = {
    "0 and 1": "LINK lift 0.0 IF NODE tower ABOVE 4.5\nLINK lift 1.0 IF NODE tower BELOW 2.5",
    "words": "LINK lift CLOSED IF NODE tower ABOVE 4.5\nLINK lift OPEN IF NODE tower BELOW 2.5",
    "order": "LINK lift OPEN IF NODE tower BELOW 2.5\nLINK lift CLOSED IF NODE tower ABOVE 4.5",
    "three speeds": "LINK lift 0.9 IF NODE tower BELOW 3.4\nLINK lift 1.0 IF NODE tower BELOW 2.8\n"
    "LINK lift 0 IF NODE tower ABOVE 4.5",
}


@pytest.mark.parametrize("name", SETTINGS)
def test_settings_of_pumps_stop_and_start_them(name, tmp_path):
    _, found = day_of(pumped(controls=SETTINGS[name]), tmp_path)
    assert not found.fault and found.agrees and found.compared[0].difference < 5e-3
    if name == "0 and 1":
        run = fvsolve.run(
            load(_case(import_network(tmp_path / "net.inp", day=True), tmp_path)), pictures=False
        )
        at = int(abs(run.t - 68_700.0 / 3600.0).argmin())  # rows in h
        assert run["nodes.tower.level"][at] == pytest.approx(4.493, abs=2e-3)


def test_a_level_equal_to_its_switch_counts_at_hour_0(tmp_path):
    text = pumped(level=2.5, demand=6, status="lift CLOSED", controls=SETTINGS["words"])
    imported, found = day_of(text, tmp_path)
    assert found.agrees and imported.solution.flow["lift"] > 0.01
    assert compared(imported, tmp_path).agrees


EMPTIED = """[JUNCTIONS]
b 8 {b}
c 12 {c}
end 8 0
[RESERVOIRS]
lake 5
[TANKS]
tower 40 3 0 5 6 0
[PIPES]
p1 tower b 300 200 110 0 Open
p2 b c 300 150 110 0 Open
p3 end b 500 200 110 0 Open
[PUMPS]
lift lake end HEAD h
[CURVES]
h 0 75
h 20 65
h 40 35
[EMITTERS]
{emitters}
[CONTROLS]
LINK lift OPEN AT TIME 10
LINK lift CLOSED AT TIME 16
[STATUS]
lift Closed
[TIMES]
DURATION 24:00
"""


def test_demands_by_pressure_behind_an_empty_tower_end_and_return_as_in_epanet(tmp_path):
    """The pressure of a town that only demands without flow join to ambient is that at its lowest demand."""
    softness = "DEMAND MODEL PDA\nREQUIRED PRESSURE 20\nPRESSURE EXPONENT 0.5\n[END]"
    text = EMPTIED.format(b=6, c=2, emitters="") + OPTIONS.replace("[END]", softness)
    imported, found = day_of(text, tmp_path)
    assert not found.fault and found.agrees and not found.causes
    assert max(item.difference for item in found.compared) < 2e-3
    run = fvsolve.run(
        load(_case(imported, tmp_path), {"output.probes": ["b.head"], "output.units": {}}),
        pictures=False,
    )
    network = network_file.run_epanet(imported.network, 86400, 10, [21600, 82800])
    for solution in network.solutions:
        assert solution.head["b"] == pytest.approx(8.0, abs=1e-3)
        assert run["b.head"][np.searchsorted(run.t, solution.seconds)] == pytest.approx(
            8.0, abs=1e-3
        )
    (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
    assert "tower-altitude (the tank is empty)" in note.text


def test_emitters_that_feed_a_drained_town_in_epanet_are_named(tmp_path):
    """Behind the empty tower the emitter at b leaks 0.57 l/s, which EPANET takes from the emitter above it, at c."""
    _, found = day_of(EMPTIED.format(b=0, c=0, emitters="b 1.0\nc 0.3") + OPTIONS, tmp_path)
    assert found.agrees and found.causes == [
        "EPANET lets emitters above their pressure feed the network (c)"
    ]
    assert found.compared[0].quantity == "levels" and found.compared[0].difference < 2e-3


def test_a_tank_with_inlet_and_outlet_shuts_only_its_inlet(tmp_path):
    text = """[JUNCTIONS]
j 10 5
[RESERVOIRS]
R 100
[TANKS]
T 50 4.5 1 5 10 0
[PIPES]
a R T 1000 150 110 0 Open
c T j 500 150 110 0 Open
[TIMES]
DURATION 24:00
HYDRAULIC TIMESTEP 0:05
"""
    for pipes in (("a R T", "c T j"), ("a T R", "c j T")):
        other = text.replace("a R T", pipes[0]).replace("c T j", pipes[1])
        imported, found = day_of(other + OPTIONS, tmp_path)
        by_name = {item.quantity: item for item in found.compared}
        assert by_name["heads"].difference < 0.01 and by_name["levels"].difference < 0.01
        run = fvsolve.run(load(_case(imported, tmp_path)), pictures=False)
        assert run["nodes.j.head"][-1] == pytest.approx(54.50, abs=0.01)


ALONE = """[JUNCTIONS]
a 10 5
b 10 4
c 12 3
[RESERVOIRS]
R 40
[TANKS]
T 30 3 0 6 8 0
[PIPES]
p1 R a 1000 200 110 0 Open
p2 a T 300 150 110 0 Open
p3 b c 200 150 110 0 Open
[VALVES]
v {ends} 150 {kind} {setting} 0
[PATTERNS]
1 0.3 2.0 1.0 0.3
"""


@pytest.mark.parametrize("ends", ["a b", "a c"])
def test_a_psv_that_alone_supplies_nodes_is_open_over_a_day_as_in_epanet(ends, tmp_path):
    """The head before it falls below its set head in the second hour."""
    text = ALONE.format(kind="PSV", setting=26, ends=ends)
    imported, found = day_of(text + OPTIONS, tmp_path)
    assert (
        found.agrees
        and not imported.causes
        and max(item.difference for item in found.compared) < 5e-3
    )
    assert any("alone supplies" in text and names == ["v"] for text, names in imported.notes)
    beside = text.replace("p3 b c", "p4 T c 900 100 110 0 Open\np3 b c")
    notes = import_network(written(tmp_path, beside + OPTIONS), day=True).notes
    assert not any("alone supplies" in text for text, _ in notes)


def test_a_tank_that_stays_full_is_named_where_its_links_cycle(tmp_path):
    """EPANET lets a full tank give and take in turn at each step; an altitude valve has a differential of 5 mm."""
    text = ALONE.format(kind="PRV", setting=20, ends="a b").replace(
        "T 30 3 0 6 8 0", "T 30 2.9 0 3 2 0"
    )
    text = text.replace("p3 b c", "p5 T b 300 50 110 0 Open\np3 b c")
    imported, found = day_of(text + OPTIONS, tmp_path)
    assert found.agrees and any(
        cause.endswith("in EPANET at each step: T") for cause in found.causes
    )
    planted = replace(
        imported, text=imported.text.replace('full_level = "3 m"', 'full_level = "2.95 m"')
    )
    assert planted.text != imported.text
    wrong = self_check.check_day(planted, _case(planted, tmp_path))
    assert not wrong.agrees and not wrong.causes  # levels differ by 5 cm, which no cycle explains


def test_heads_far_above_every_source_are_named(tmp_path):
    """A pump of constant power with hardly any flow: EPANET states heads of kilometres."""
    imported = import_network(written(tmp_path, pumped()))
    network, solution = imported.network, imported.solution
    powered = replace(network, links={"lift": replace(network.links["lift"], power=3000.0)})
    low, high = (replace(solution, head={**solution.head, "b": head}) for head in (900.0, 6700.0))
    (cause,) = self_check.extreme_heads(powered, [solution, high])
    assert "(lift)" in cause and "6.66e+03 m above every source" in cause
    assert not self_check.extreme_heads(powered, [solution, low]) and not self_check.extreme_heads(
        network, [high]
    )


def test_a_tank_that_gives_water_at_its_least_level_is_named(tmp_path):
    """EPANET lets it do so within a step; limits with an overflow, or within the range of levels, are no cause."""
    imported = import_network(written(tmp_path, pumped()))
    network, solution = imported.network, imported.solution

    def causes(level, inflow, **keys):
        tower = replace(network.nodes["tower"], **keys)
        head = {**solution.head, "tower": tower.elevation + level}
        changed = replace(solution, head=head, demand={**solution.demand, "tower": inflow})
        return self_check.crossed_limits(
            replace(network, nodes=network.nodes | {"tower": tower}), [solution, changed]
        )

    for level, inflow in ((1.0, -1e-4), (6.0, 1e-4)):
        (cause,) = causes(level, inflow)
        assert cause.endswith("greatest level take it: tower")
    assert (
        not causes(1.0, 1e-4)
        and not causes(6.0, -1e-4)
        and not causes(3.0, -1e-4)
        and not causes(1.0, -1e-9)
    )
    assert not causes(6.0, 1e-4, overflow=True)


def test_controls_at_the_limit_of_a_tank_and_late_switches_are_named():
    def event(time, name, what):
        return {"time": time, "name": name, "what": what}

    full = [
        event(60.0, "T-altitude", "shuts: the tank is full"),
        event(60.0, "controls.P", "turns off"),
    ]
    (cause,) = self_check.switches_at_limits([*full, event(70.0, "controls.Q", "turns on")])
    assert cause.endswith("misses by rounding: P")
    assert not self_check.switches_at_limits([full[0], event(61.0, "controls.P", "turns off")])
    assert not self_check.switches_at_limits([event(60.0, "T-altitude", "opens"), full[1]])
    (late,) = self_check.late_switches(0.11, 0.014)
    assert "with steps of 10 s the levels differ by 0.11 m, with 2 s by 0.014 m" in late
    assert not self_check.late_switches(0.11, 0.09)


def test_an_efficiency_at_no_flow_alone_holds_at_every_flow(tmp_path):
    energy = "[ENERGY]\nGlobal Price 0.1\nPump lift Efficiency e\n[CURVES]\ne 0 65\n"
    imported = import_network(
        written(tmp_path, pumped().replace("[OPTIONS]", energy + "[OPTIONS]")), day=True
    )
    assert load(_case(imported, tmp_path)).links["lift"].overall_efficiency is not None
    assert "overall_efficiency = 0.65" in imported.text


def test_a_pump_that_is_off_all_day_does_not_lift_a_set_pressure(tmp_path):
    """Without it no source reaches the set head, and the case reader refused the case of the importer."""
    text = (
        ALONE.format(kind="PRV", setting=60, ends="a b")
        + "[PUMPS]\nboost R a HEAD h\n[CURVES]\nh 10 50\n"
    )
    text += "[STATUS]\nboost Closed\n"
    imported, found = day_of(text + OPTIONS, tmp_path)
    assert found.agrees and any("set head above every source" in note for note, _ in imported.notes)


ACTING = """[JUNCTIONS]
a 10 5
b 10 4
c 10 0
[RESERVOIRS]
R 60
[PIPES]
p1 R a 1000 200 110 0 Open
p2 c b 300 150 110 0 Open
[VALVES]
v a c 150 {kind} {setting} 0
"""


@pytest.mark.parametrize("kind, setting", [("PRV", 30), ("PSV", 45), ("FCV", 3)])
def test_a_valve_that_regulates_is_partly_open_and_sets_no_step(kind, setting, tmp_path):
    """EPANET's open valve has no loss. With it the valve would act within microseconds."""
    text = ACTING.format(kind=kind, setting=setting) + OPTIONS
    if kind != "PRV":
        text = text.replace("R 60", "R 60\nlow 12").replace(
            "p2 c b", "p3 low b 500 100 110 0 Open\np2 c b"
        )
    imported = import_network(written(tmp_path, text))
    assert not compared(imported, tmp_path).compared[0].above
    assert build(load(_case(imported, tmp_path))).checks["step"] > 1e-3
    assert any("30% open at this hour" in note for note, _ in imported.notes)


def test_a_pipe_to_be_designed_has_no_waves(tmp_path):
    """Its friction would make each explicit step unstable: the pipe of 2.5 micrometres stands beside a main."""
    text = MAIN.replace("p1 R a", "none R a 500 0.00254 110 0 Open\np1 R a") + OPTIONS
    imported = import_network(written(tmp_path, text))
    assert any(
        text.startswith("narrower than 1 mm") and names == ["none"]
        for text, names in imported.notes
    )
    case = load(_case(imported, tmp_path))
    stops = {"time": [0.0, 1.0, 5.0], "value": ["20 l/s", "20 l/s", "0 l/s"]}
    run = fvsolve.run(case, {"nodes.a.demand": stops, "numerics.end": 8.0})
    assert run.ok and case.links["none"].pipe_model == "quasi-steady"


@pytest.mark.parametrize("speed, is_named", [(75, True), (1.2, False)])
def test_a_speed_that_is_no_relative_speed_is_named(speed, is_named, tmp_path):
    text = pumped(
        controls=f"LINK lift {speed} IF NODE tower BELOW 1\nLINK lift CLOSED IF NODE tower ABOVE 5.5"
    )
    imported = import_network(written(tmp_path, text), day=True)
    assert (
        any("relative speed above 3" in cause and "lift" in cause for cause in imported.causes)
        == is_named
    )


def test_the_day_of_a_large_network_is_compared_on_request(tmp_path, fvs, monkeypatch):
    monkeypatch.setattr("fvsolve.cli.file_commands.MOST_NODES", 1)
    path = written(tmp_path, pumped())
    for options, is_compared in (((), False), (("--check",), True), (("--no-check",), False)):
        code, _, err = fvs(
            "import", path, tmp_path / f"day{len(options)}{is_compared}.toml", "--day", *options
        )
        assert code == 0 and ("levels, greatest difference" in err) == is_compared
        assert ("is not compared; --check compares it" in err) == (options == ())


def test_rules_read_states_of_links_and_pressures_of_junctions(tmp_path):
    rules = """RULE 1
IF JUNCTION b PRESSURE ABOVE 36.6
THEN PUMP lift STATUS IS CLOSED
RULE 2
IF TANK tower LEVEL BELOW 2.2
THEN PUMP lift STATUS IS OPEN
RULE 3
IF PUMP lift STATUS IS CLOSED
AND SYSTEM TIME >= 1
THEN PIPE p3 STATUS IS CLOSED
ELSE PIPE p3 STATUS IS OPEN
"""
    pipe = TOWER["pipe"] + "\np3 a b 500 80 110 0 Open"
    imported, found = day_of(pumped(rules=rules, pipe=pipe), tmp_path)
    assert not [note for note, _ in imported.notes if note.startswith("not imported")]
    # the switch by pressure is 10 s late in both
    assert not found.fault and found.compared[0].difference < 0.05


def test_the_first_rule_of_equal_priority_prevails_and_the_highest_of_others(tmp_path):
    both = "RULE 1\nIF SYSTEM TIME > 2\nTHEN PIPE p3 STATUS IS CLOSED\n{one}"
    both += "RULE 2\nIF SYSTEM TIME > 2\nTHEN PIPE p3 STATUS IS OPEN\n{two}"
    pipe = TOWER["pipe"] + "\np3 a b 500 80 110 0 Open"
    for one, two, closed in (
        ("", "", True),
        ("PRIORITY 1\n", "PRIORITY 2\n", False),
        ("PRIORITY 2\n", "PRIORITY 1\n", True),
    ):
        imported, found = day_of(pumped(rules=both.format(one=one, two=two), pipe=pipe), tmp_path)
        assert found.agrees and ("p3-shut" in imported.text) == closed


def test_and_and_or_are_read_in_the_order_of_epanet():
    """A AND B OR C is A AND (B OR C), A OR B AND C is (A OR B) AND C."""

    def premise(text):
        word, _, name = text.rpartition(" ")
        return {
            "or": word == "OR",
            "object": "link",
            "name": name,
            "variable": "status",
            "relation": "=",
            "value": "open",
        }

    for text, rule in (
        ("A,AND B,OR C", lambda a, b, c: a and (b or c)),
        ("A,OR B,AND C", lambda a, b, c: (a or b) and c),
    ):
        clause = switching.rule_clause(None, [premise(part) for part in text.split(",")], 86400.0)
        for k in range(8):
            states = [bool(k & 1), bool(k & 2), bool(k & 4)]
            values = {
                ("open", name): float(state) for name, state in zip("ABC", states, strict=True)
            }
            assert clause.holds(values) == rule(*states)


VALVE = """[JUNCTIONS]
a 5 0
b 8 0
c 8 6 day
[RESERVOIRS]
lake 80
[TANKS]
tower 30 3 1 60 12 0
[PIPES]
p1 lake a 400 250 110 0 Open
p2 b c 300 200 120 0 Open
p3 c tower 600 150 120 0 Open
[VALVES]
v a b 200 {valve} 0
[PATTERNS]
day 0.5 0.5 1.5 1.5
[CONTROLS]
{controls}
[TIMES]
DURATION 24:00
HYDRAULIC TIMESTEP 1:00
PATTERN TIMESTEP 6:00
"""
SET = {
    "PRV 40": "LINK v 35 AT TIME 4\nLINK v 42.5 AT TIME 12\nLINK v CLOSED AT TIME 15\nLINK v 38 AT TIME 18\n"
    "LINK v OPEN AT TIME 20",
    "PSV 60": "LINK v 64 AT TIME 4\nLINK v 58 AT TIME 12",
    "FCV 12": "LINK v 8 AT TIME 4\nLINK v 14 AT TIME 12\nLINK v CLOSED AT TIME 20",
    "TCV 40": "LINK v 100 AT TIME 4\nLINK v 10 AT TIME 12\nLINK v CLOSED AT TIME 20",
    # minor loss 20
    "TCV 40 20 ;": "LINK v 100 AT TIME 4\nLINK v 10 AT TIME 8\nLINK v OPEN AT TIME 15",
    # minor loss 20, with a curve of the area
    "PCV 60 20 c ;": "LINK v 90 AT TIME 4\nLINK v 30 AT TIME 12\nLINK v CLOSED AT TIME 20\n"
    "[CURVES]\n;VALVE:\nc 0 0\nc 50 20\nc 100 100",
    "PRV 41": "LINK v 35 IF NODE tower ABOVE 8\nLINK v 42 IF NODE tower BELOW 6",
}


@pytest.mark.parametrize("valve", SET)
def test_settings_of_valves_follow_controls(valve, tmp_path):
    imported, found = day_of(VALVE.format(valve=valve, controls=SET[valve]) + OPTIONS, tmp_path)
    assert not [note for note, _ in imported.notes if note.startswith("not imported")]
    assert not found.fault and found.compared[0].difference < 5e-3 and not found.compared[1].above


def test_prices_and_efficiencies_of_pumps_are_imported(tmp_path):
    energy = "[ENERGY]\nGlobal Efficiency 70\nGlobal Price 0.12\nGlobal Pattern tariff\nDemand Charge 3\n"
    energy += "Pump lift Efficiency e\n"
    patterns = "[PATTERNS]\ntariff 0.5 1 1.5\n[CURVES]\ne 10 50\ne 30 78\ne 50 70\n"
    imported = import_network(
        written(tmp_path, pumped().replace("[OPTIONS]", energy + patterns + "[OPTIONS]")), day=True
    )
    run = fvsolve.run(load(_case(imported, tmp_path)), pictures=False)
    lift, total = run.summary["energy_use"]["pumps"]["lift"], run.summary["energy_use"]["total"]
    # the mean of the tariff is 1
    assert lift["cost"] == pytest.approx(0.12 * lift["energy"] / 3.6e6, rel=0.05)
    assert total["demand_charge"] == pytest.approx(3.0 * lift["peak_power"] / 1e3)
    assert 0.5 < lift["efficiency"] < 0.78  # by the curve, not the global 0.7


# the judge ------------------------------------------------------------------------------------------------------------


def test_the_self_check_finds_planted_differences(tmp_path):
    imported = import_network(written(tmp_path, MAIN + OPTIONS))
    case = load(_case(imported, tmp_path))
    good = self_check.check_start(imported, case)
    assert good.agrees and not good.compared[0].above
    wrong = replace(
        imported, solution=replace(imported.solution, head=imported.solution.head | {"a": 40.0})
    )
    bad = self_check.check_start(wrong, case)
    assert not bad.agrees and bad.compared[0].name == "a" and bad.compared[0].above == ["a"]
    assert any("cause unknown" in line for line in bad.lines())
    named = self_check.check_start(replace(wrong, causes=["a known cause"]), case)
    assert named.agrees and any("a known cause" in line for line in named.lines())
    flows = {name: 2.0 * flow for name, flow in imported.solution.flow.items()}
    doubled = self_check.check_start(
        replace(imported, solution=replace(imported.solution, flow=flows)), case
    )
    assert not doubled.agrees and doubled.compared[1].above == ["p1"]


def test_the_command_prints_the_comparison_and_fails_at_an_unknown_difference(
    tmp_path, fvs, monkeypatch
):
    path = written(tmp_path, MAIN + OPTIONS)
    code, _, err = fvs("import", path, tmp_path / "one.toml")
    assert code == 0 and "self-check: 2 heads, greatest difference" in err
    code, _, err = fvs("import", path, tmp_path / "two.toml", "--no-check")
    assert code == 0 and "self-check" not in err
    monkeypatch.setattr(self_check, "MOST_HEAD", -1.0)
    code, _, err = fvs("import", path, tmp_path / "three.toml")
    assert code == 1 and "cause unknown" in err and (tmp_path / "three.toml").is_file()


def test_a_demand_without_supply_is_reported_with_epanets_heads(tmp_path):
    text = MAIN.replace("a 10 20", "a 10 20\nb 5 3") + "p2 a b 100 100 110 0 Closed\n"
    imported = import_network(written(tmp_path, text + OPTIONS))
    found = self_check.check_start(imported, load(_case(imported, tmp_path)))
    assert (
        not found.agrees
        and "EPANET has no physical solution either" in found.fault
        and "nodes.b" in found.fault
    )


def test_a_valve_that_cannot_sustain_passes_flow_as_in_epanet(tmp_path):
    text = """[JUNCTIONS]
J1 180 0
J2 180 0
J3 180 0
J4 180 100
[RESERVOIRS]
R 250
[PIPES]
p1 R J1 200 250 100 0 Open
p2 J1 J2 200 250 100 0 Open
p3 J3 J4 200 250 100 0 Open
[VALVES]
v J2 J3 250 PSV 70 0
"""
    imported = import_network(written(tmp_path, text + OPTIONS.replace("LPS", "CMH")))
    assert compared(imported, tmp_path).agrees
    assert [names for note, names in imported.notes if note.startswith("PSV cannot sustain")] == [
        ["v"]
    ]


def test_units_of_the_toolkit():
    """Flows of all units against their definitions."""
    assert toolkit_process.FLOW_UNITS["GPM"] == pytest.approx(6.30901964e-5)
    assert toolkit_process.FLOW_UNITS["MGD"] == pytest.approx(0.0438126364)
    assert toolkit_process.FLOW_UNITS["IMGD"] == pytest.approx(0.0526168042)
    assert toolkit_process.FLOW_UNITS["AFD"] == pytest.approx(0.0142764101)
    assert toolkit_process.FLOW_UNITS["CMH"] == pytest.approx(1.0 / 3600.0)


UNITS = {"LPS": 20.0, "LPM": 1200.0, "MLD": 1.728, "CMH": 72.0, "CMD": 1728.0}


@pytest.mark.parametrize("unit", UNITS)
def test_the_same_network_in_other_units_has_the_same_heads(unit, tmp_path):
    text = MAIN.replace("a 10 20", f"a 10 {UNITS[unit]}") + OPTIONS.replace("LPS", unit)
    imported = import_network(written(tmp_path, text))
    assert compared(imported, tmp_path).agrees
    expected = heads(import_network(written(tmp_path, MAIN + OPTIONS)), tmp_path)["a"]
    assert heads(imported, tmp_path)["a"] == pytest.approx(expected, abs=1e-6)


def test_no_file_is_missing():
    with pytest.raises(FvsolveError, match="no such file"):
        import_network(Path("nowhere.inp"))
