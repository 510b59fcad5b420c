"""Faults: one bad file for each message, with line, key path, value found and value expected."""

import re
import tomllib

import pytest
from reference.case_texts import CHAMBER, SCENE, TANK
from reference.refusals import refused

from fvsolve import run
from fvsolve.case import load
from fvsolve.errors import CaseError, FvsolveError, nearest


def faults(text, folder, set=None):
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return str(refused(folder / "scene.toml", set=set))


def test_the_example_of_the_design(tmp_path):
    text = (
        SCENE.replace("opening =", "openning =")
        .replace('"304.8 mm"', '"304.8 kg"')
        .replace('"gate"\nlen', '"gat"\nlen')
    )
    assert faults(text, tmp_path).splitlines() == [
        "scene.toml: 3 faults",
        '  line 25: links.main.to: no place named "gat"; places are gate, lake, outfall; did you mean "gate"?',
        '  line 27: links.main.diameter: "304.8 kg" is a mass; expected a length, for example "300 mm"',
        '  line 38: links.valve.openning: unknown key; did you mean "opening"?',
    ]


def swap(old, new):
    assert old in SCENE, old
    return SCENE.replace(old, new, 1)


def add(table, lines):
    return swap(f"[{table}]\n", f"[{table}]\n{lines}\n")


OPENING = 'opening = { start = "1 s", duration = "0.05 s", value = [1.0, 0.0] }'
ISLAND = """
[nodes.c]
type = "reservoir"
head = 1
[nodes.d]
type = "reservoir"
head = 2
[links.far]
type = "orifice"
from = "c"
to = "d"
Kv = 1
"""
RIGID = """
[nodes.c]
type = "junction"
[links.one]
type = "rigid-column"
from = "lake"
to = "c"
length = 1
diameter = 1
[links.two]
type = "rigid-column"
from = "c"
to = "gate"
length = 1
diameter = 1
"""


def tank(old, new):
    assert old in TANK
    return SCENE + TANK.replace(old, new, 1)


def opening(text):
    return swap(OPENING, f"opening = {text}")


BAD = {
    # names and keys
    "unknown table": (
        swap("[numerics]", "[numeric]"),
        'line 40: numeric: unknown key; did you mean "numerics"?',
    ),
    "missing table": (
        swap('[numerics]\nend = "10 s"\ncourant = 0.9\n', ""),
        "[numerics] is missing",
    ),
    "missing fluid": (SCENE[SCENE.index("[nodes.lake]") :], "[fluid] is missing"),
    "unknown key": (
        add("links.main", "lenth = 3"),
        'line 23: links.main.lenth: unknown key; did you mean "length"?',
    ),
    "unknown key, nothing near": (
        add("numerics", "zzz = 3"),
        "numerics.zzz: unknown key; keys are below_vapor, cell_time, courant, delay_tolerance, ",
    ),
    "missing key": (
        swap('length = "914.4 m"\n', ""),
        "line 22: links.main: expected one of length, profile",
    ),
    "unknown type": (
        swap('"valve"', '"vavle"'),
        'line 33: links.valve.type: unknown type "vavle"; types are altitude-valve, bearing, bushing, c',
    ),
    "unknown type, nearest": (swap('"valve"', '"vavle"'), 'did you mean "valve"?'),
    "missing type": (
        swap('type = "junction"\n', ""),
        "line 15: nodes.gate: type is missing; expected one of accumulator, ",
    ),
    "a link among nodes": (
        swap('"junction"', '"pipe"'),
        'nodes.gate.type: unknown type "pipe"; types are accumulator, ',
    ),
    "a link among nodes, where": (swap('"junction"', '"pipe"'), "it belongs under [links]"),
    "type that is no text": (swap('"junction"', "3"), "nodes.gate.type: unknown type 3"),
    "bad name": (
        swap("[nodes.gate]", '[nodes."ga te"]'),
        'nodes."ga te": "ga te" is not a valid name',
    ),
    "a part that is no table": (
        swap("[nodes.lake]", "[nodes]\nx = 3\n[nodes.lake]"),
        "nodes.x: 3 is not a table",
    ),
    "nodes that are no table": (
        "nodes = 3\n" + SCENE[SCENE.index("[fluid]") : SCENE.index("[nodes.lake]")],
        "nodes: 3",
    ),
    "unknown schema": (
        swap("schema = 1", "schema = 2"),
        "line 1: schema: 2 is out of range; expected a value between 1",
    ),
    "title that is no text": (swap('"A valve shuts"', "3"), "line 2: title: 3 is not text"),
    # the network
    "unknown place": (
        swap('from = "lake"', 'from = "lak"'),
        'line 24: links.main.from: no place named "lak"; places are',
    ),
    "a link as a place": (
        swap('to = "outfall"', 'to = "main"'),
        'links.valve.to: "main" is a link',
    ),
    "place that is no text": (
        swap('from = "lake"', "from = 3"),
        "line 24: links.main.from: 3 is not text",
    ),
    "joined to itself": (
        swap('to = "gate"', 'to = "lake"'),
        'line 25: links.main.to: joins "lake" to itself',
    ),
    "loose node": (
        SCENE + '[nodes.x]\ntype = "tank"\narea = 1\nlevel = 1',
        "line 46: nodes.x: no link touches it",
    ),
    "disconnected": (
        SCENE + ISLAND,
        "links: disconnected network of 2 parts: gate, lake, outfall | c, d",
    ),
    "nothing fixes the pressure": (
        swap('"reservoir"\nhead = "45.72 m"', '"junction"').replace(
            '"reservoir"\npressure = "0 barg"', '"junction"'
        ),
        "nodes: nothing fixes the pressure; expected a reservoir, tank or chamber",
    ),
    "only rigid columns": (
        SCENE + RIGID,
        "nodes.c: only rigid columns join this node, so nothing sets its pressure",
    ),
    "a demand above its pressure between rigid columns": (
        SCENE
        + RIGID.replace(
            'type = "junction"', 'type = "junction"\ndemand = 0.1\nrequired_pressure = 3e5'
        ),
        "nothing sets its pressure, since its demand is constant above its required_pressure",
    ),
    # exclusive keys
    "two step settings": (
        add("numerics", "step = 1e-3"),
        "numerics.step: courant and step are given; keep one",
    ),
    "pressure and head": (
        add("nodes.lake", "pressure = 2e5"),
        "nodes.lake.head: pressure and head are given; keep one",
    ),
    "neither pressure nor head": (
        swap('head = "45.72 m"\n', ""),
        "line 11: nodes.lake: expected one of pressure, head",
    ),
    "two sizes of a valve": (
        add("links.valve", "diameter = 1"),
        "links.valve.diameter: area and diameter are given",
    ),
    "two laws of a valve": (
        add("links.valve", "Kv = 1"),
        "links.valve.Kv: discharge_coefficient and Kv are given",
    ),
    "Kv with an area": (
        swap("discharge_coefficient = 0.6", "Kv = 1"),
        "links.valve.area: Kv already gives the size; leave the key `area` out",
    ),
    "no size": (
        swap('area = "0.001768 m2"\n', ""),
        "links.valve: discharge_coefficient needs area or diameter",
    ),
    "no size at all": (
        swap('area = "0.001768 m2"\ndischarge_coefficient = 0.6\n', ""),
        "line 32: links.valve: size is missing; expected area, diameter, Kv or Cv",
    ),
    "wall and wave speed": (
        add("links.main", 'wall = "rigid"'),
        "links.main.wall: wave_speed and wall are given",
    ),
    "roughness and factor": (
        swap('"0.26 mm" }', "1e-4, factor = 0.02 }"),
        "friction.factor: roughness and factor are",
    ),
    "friction without number": (
        swap(', roughness = "0.26 mm"', ""),
        "links.main.friction: expected one of roughness, factor",
    ),
    "friction with a stray number": (
        swap('"steady", r', '"none", r'),
        'links.main.friction.roughness: friction model "none" has no key roughness',
    ),
    "friction model": (
        swap('"steady"', '"stedy"'),
        'line 29: links.main.friction.model: no friction model named "stedy"',
    ),
    # sizes
    "negative size": (
        swap('"914.4 m"', '"-914.4 m"'),
        'links.main.length: "-914.4 m" is out of range; expected a value above 0',
    ),
    "zero size": (
        swap('"304.8 mm"', "0"),
        "line 27: links.main.diameter: 0 is out of range; expected a value above 0",
    ),
    "infinite size": (
        swap('"914.4 m"', "inf"),
        "links.main.length: inf is not finite; expected a length",
    ),
    "size not a number": (
        swap('"914.4 m"', "nan"),
        "links.main.length: nan is not finite; expected a length",
    ),
    "size that is true": (
        swap('"914.4 m"', "true"),
        "links.main.length: true is true or false; expected a length",
    ),
    "no unit": (
        swap('"914.4 m"', '"914.4"'),
        '"914.4" has no unit; did you mean "914.4 m", or the bare number 914.4?',
    ),
    "wrong unit": (
        swap('"304.8 mm"', '"304.8 kg"'),
        '"304.8 kg" is a mass; expected a length, for example "300 mm"',
    ),
    "zero cells": (
        swap("cells = 200", "cells = 0"),
        "links.main.cells: 0 is out of range; expected a value between 1 and",
    ),
    "half a cell": (
        swap("cells = 200", "cells = 2.5"),
        "links.main.cells: 2.5 is not a whole number",
    ),
    "too many cells": (
        swap("cells = 200\n", "").replace("courant = 0.9", "cell_time = 1e-12"),
        "numerics.cell_time: would cut main into 7.5e+11 cells",
    ),
    "coefficient above 1": (
        swap("= 0.6", "= 1.6"),
        "discharge_coefficient: 1.6 is out of range; expected a value above 0, 1",
    ),
    "wall without thickness": (
        swap('wave_speed = "1219.2 m/s"', "wall = { youngs_modulus = 1e11 }"),
        "line 28: links.main.wall: thickness is missing",
    ),
    "wall of a word": (
        swap('wave_speed = "1219.2 m/s"', 'wall = "soft"'),
        'links.main.wall: "soft" is not a wall; expected "rigid"',
    ),
    "gauge modulus": (
        swap('"2.2 GPa"', '"2.2 barg"'),
        'fluid.bulk_modulus: "2.2 barg" is a gauge pressure',
    ),
    "position": (
        add("nodes.gate", "position = [1]"),
        "nodes.gate.position: [1] has 1 values; expected 2",
    ),
    # pressures
    "vacuum": (
        swap('"0 barg"', '"0 bar"'),
        'nodes.outfall.pressure: "0 bar" is absolute, a vacuum; did you mean "0 barg"?',
    ),
    "vacuum in psi": (
        swap('"0 barg"', '"-3 psi"'),
        '"-3 psi" is absolute, a vacuum; did you mean "-3 psig"?',
    ),
    "vacuum, bare": (swap('"0 barg"', "0"), "nodes.outfall.pressure: 0 is absolute, a vacuum"),
    "vacuum in gauge": (
        swap('"0 barg"', '"-2 barg"'),
        '"-2 barg" is -9.868e+04 Pa absolute, a vacuum',
    ),
    "below vapour pressure": (
        swap('"0 barg"', '"0.02 bar"'),
        '"0.02 bar" is absolute, not above the vapour pressure of 2339 Pa; did you mean "0.02 barg"?',
    ),
    "below vapour pressure in a schedule": (
        swap('"0 barg"', '{ time = [0, 1], value = ["1 bar", "0.02 bar"] }'),
        'nodes.outfall.pressure.value[1]: "0.02 bar" is absolute, not above the vapour pressure',
    ),
    "vacuum of a chamber": (
        SCENE + CHAMBER,
        'nodes.t.initial_pressure: "0 bar" is absolute, a vacuum; did you mean "0 barg"?',
    ),
    "vacuum by head": (
        swap('"45.72 m"', '"-45.72 m"'),
        "nodes.lake.head: a head of -45.72 m at elevation 0 m is -3.461e+05 Pa absolute, "
        "a vacuum; expected a greater head",
    ),
    "boiling by head": (
        swap('"45.72 m"', '"-10.2 m"'),
        "Pa absolute, not above the vapour pressure of 2339 Pa; expected",
    ),
    "gauge ambient": (
        'ambient_pressure = "1 barg"\n' + SCENE,
        'line 1: ambient_pressure: "1 barg" is a gauge pressure',
    ),
    "no ambient": (
        'ambient_pressure = "0 bar"\n' + SCENE,
        'ambient_pressure: "0 bar" is not an absolute pressure above 0',
    ),
    "vacuum of the fluid": (
        add("fluid", 'pressure = "0 bar"'),
        'fluid.pressure: "0 bar" is absolute, a vacuum',
    ),
    # the fluid: errors of fluid.py are reported with their key
    "fluid without density": (swap("density = 998\n", ""), "fluid.density:"),
    "density law": (add("fluid", 'law = "cubic"'), 'fluid.law: no density law named "cubic"'),
    "fluid name": (swap('"user"', '"Watr"'), "line 5: fluid.name: "),
    "temperature in coulombs": (add("fluid", 'temperature = "20 C"'), 'did you mean "20 degC"?'),
    # elevations
    "some elevations": (
        add("nodes.gate", "elevation = 3"),
        "nodes.outfall: elevation is missing, but stated for gate; expected for all",
    ),
    "too steep": (
        add("nodes.gate", "elevation = 1000")
        .replace('"0 barg"', '"0 barg"\nelevation = 0')
        .replace('head = "45.72 m"', 'head = "1100 m"\nelevation = 0'),
        "links.main.length: 914.4 m is too short: the ends differ by 1000 m in elevation",
    ),
    # tanks
    "tank without level": (tank("level = 1\n", ""), "nodes.t: level is missing"),
    "level above height": (
        tank("level = 1\n", "level = 3\nheight = 2\n"),
        "nodes.t.level: 3 m is above the `height` of 2 m",
    ),
    "negative level": (
        tank("level = 1", "level = -1"),
        "nodes.t.level: -1 is out of range; expected a value of at least 0",
    ),
    "area table of unlike lengths": (
        tank("area = 1", "area = { level = [0, 1], area = [1] }"),
        "nodes.t.area.area: has length 1, but `level` has length 2",
    ),
    "area table out of order": (
        tank("area = 1", "area = { level = [0, 2, 1], area = [1, 1, 1] }"),
        "nodes.t.area.level: levels out of order: 1 comes after 2",
    ),
    "area table not from the bottom": (
        tank("area = 1", "area = { level = [1, 2], area = [1, 1] }"),
        "nodes.t.area.level: levels are measured from the bottom",
    ),
    "area zero": (
        tank("area = 1", "area = { level = [0, 1], area = [1, 0] }"),
        "nodes.t.area.area[1]: 0 is out of range",
    ),
    # schedules
    "times out of order": (
        opening('{ time = [0, "2 s", 1], value = [1, 0.5, 0] }'),
        'links.valve.opening.time: times out of order: 1 comes after "2 s"',
    ),
    "times that repeat": (
        opening("{ time = [0, 0], value = [1, 0] }"),
        "opening.time: times out of order: 0 comes after 0",
    ),
    "unlike lengths": (
        opening("{ time = [0, 1], value = [1] }"),
        "opening.value: has length 1, but `time` has length 2; expected equal lengths",
    ),
    "opening above 1": (
        opening("{ time = [0, 1], value = [1, 2] }"),
        "opening.value[1]: 2 is out of range; expected a value between 0",
    ),
    "constant opening below 0": (
        opening("-0.1"),
        "links.valve.opening: -0.1 is out of range; expected a value between 0 and 1",
    ),
    "empty schedule": (
        opening("{ time = [], value = [] }"),
        "opening.time: [] has no values; expected a list of values",
    ),
    "schedule kind": (
        opening('{ time = [0, 1], value = [1, 0], kind = "cubic" }'),
        'no kind of schedule named "cubic"',
    ),
    "schedule key": (
        opening("{ tme = [0, 1], value = [1, 0] }"),
        'opening.tme: unknown key; did you mean "time"?',
    ),
    "schedule without times": (
        opening("{ value = [1, 0] }"),
        "links.valve.opening: time is missing",
    ),
    "ramp of three values": (
        opening("{ start = 0, duration = 1, value = [1, 0, 1] }"),
        "opening.value: [1, 0, 1] has 3 values",
    ),
    "ramp backwards": (
        opening("{ start = 0, duration = -1, value = [1, 0] }"),
        "opening.duration: -1 is out of range",
    ),
    "ramp of exponent 0": (
        opening("{ start = 0, duration = 1, value = [1, 0], exponent = 0 }"),
        "opening.exponent: 0 is out",
    ),
    "unknown signal": (
        opening('{ signal = "x" }'),
        'opening.signal: no signal named "x"; [signals] has none',
    ),
    "signal with more keys": (opening('{ signal = "x", time = [1] }'), "opening.time: unknown key"),
    "a signal at fault": (
        opening('{ signal = "x" }') + "[signals.x]\ntime = [0, 1]\nvalue = [2, 3]\n",
        "line 48: signals.x.value[0]: 2 is out of range; expected a value between 0 and 1",
    ),
    "a signal of a signal": (
        opening('{ signal = "x" }') + '[signals.x]\nsignal = "x"\n',
        'signal "x" refers to another signal',
    ),
    "an unused signal at fault": (
        SCENE + "[signals.x]\ntime = [1]\n",
        "signals.x: value is missing",
    ),
    "schedule file missing": (
        opening('{ file = "strok.csv" }'),
        'opening.file: "strok.csv": there is no such file',
    ),
    "schedule file, nearest": (
        opening('{ file = "god.csv" }'),
        '"god.csv": there is no such file; did you mean "good.csv"?',
    ),
    "schedule file is a folder": (opening('{ file = "." }'), 'opening.file: ".": is a directory'),
    "schedule file without header": (
        opening('{ file = "bare.csv" }'),
        "bare.csv has no header; expected for example",
    ),
    "schedule file empty": (
        opening('{ file = "empty.csv" }'),
        "empty.csv has no rows; expected a header and rows of numbers",
    ),
    "schedule file, one column": (
        opening('{ file = "one.csv" }'),
        "one.csv has one column; expected a column of times and a column of values",
    ),
    "schedule file, no such column": (
        opening('{ file = "good.csv", value = "opening" }'),
        'good.csv has no column "opening"; columns are "t [s]", "stem [-]"',
    ),
    "schedule file, bad unit": (
        opening('{ file = "kilo.csv" }'),
        'kilo.csv, column "stem [kg]": "kg" is a mass; expected a number',
    ),
    "schedule file, no number": (
        opening('{ file = "text.csv" }'),
        'text.csv, line 3: "shut" is not a number in column "s"',
    ),
    "schedule file, out of order": (
        opening('{ file = "back.csv" }'),
        "back.csv: times out of order: 0.0 comes after 1.0; expected rising times",
    ),
    "schedule file, out of range": (
        opening('{ file = "wide.csv" }'),
        "opening.file: 2.0 is out of range",
    ),
    "schedule file, not text": (
        opening('{ file = "noise.csv" }'),
        "noise.csv is not UTF-8 or UTF-16 text",
    ),
    # characteristic
    "characteristic": (
        add("links.valve", 'characteristic = "linar"'),
        'no characteristic named "linar"; did you mean "linear"?',
    ),
    "characteristic that leaks": (
        add("links.valve", "characteristic = { opening = [0, 1], flow_area = [0.1, 1] }"),
        "characteristic.flow_area: opening 0 is shut: the first flow area must be 0",
    ),
    "characteristic that ends early": (
        add("links.valve", "characteristic = { opening = [0, 0.9], flow_area = [0, 1] }"),
        "characteristic.opening: openings must begin at 0 and end at 1",
    ),
    # numerics
    "no end": (swap('end = "10 s"\n', ""), "line 40: numerics: end is missing"),
    "end before start": (
        add("numerics", "start = 20"),
        "numerics.end: 10 s is not after the start at 20 s",
    ),
    "scheme": (
        add("numerics", 'scheme = "muscle"'),
        'numerics.scheme: no scheme named "muscle"; did you mean "muscl"?',
    ),
    "limiter": (
        add("numerics", 'limiter = "vanleer"'),
        'no limiter named "vanleer"; did you mean "van-leer"?',
    ),
    "method": (add("numerics", 'method = "rk5"'), 'no method named "rk5"; did you mean "rk4"?'),
    "start": (
        add("numerics", 'initial = "stead"'),
        'no start named "stead"; did you mean "steady"?',
    ),
    "no error estimate": (
        swap("courant = 0.9", 'rtol = 1e-6\nmethod = "rk4"'),
        'numerics.rtol: method "rk4" estimates no error; use "bogacki-shampine" or "dormand-prince"',
    ),
    "negative step": (
        swap("courant = 0.9", "step = -1"),
        "numerics.step: -1 is out of range; expected a value above 0",
    ),
    "Courant number without cells": (
        swap('type = "pipe"', 'type = "rigid-column"')
        .replace('wave_speed = "1219.2 m/s"\n', "")
        .replace("cells = 200", "")
        .replace('"junction"', '"chamber"\nvolume = 1'),
        "numerics.courant: needs cells, and the case has no pipe or basin; give `step` or `rtol`",
    ),
    # output
    "probe of nothing": (
        swap("gate.pressure", "gat.pressure"),
        'output.probes[0]: no part named "gat"; parts are gate, lake,',
    ),
    "probe of no node": (
        swap("gate.pressure", "nodes.main.flow"),
        'no node named "main"; nodes are gate, lake, outfall',
    ),
    "probe of no quantity": (
        swap("gate.pressure", "gate.presure"),
        'gate is a junction, which has no "presure"; it has pressure, gauge_pressure, head; did you mean "pressure"?',
    ),
    "probe of a level that is not there": (
        swap("gate.pressure", "lake.level"),
        'lake is a reservoir, which has no "level"',
    ),
    "probe without a place": (
        swap("gate.pressure", "main.head"),
        'main is a pipe, and this probe needs a place, for example "main.head@0.5"',
    ),
    "probe beyond the pipe": (
        swap("gate.pressure", "main.head@1.5"),
        '"@1.5" is not a fraction of the length; expected 0 to 1',
    ),
    "probe at no number": (
        swap("gate.pressure", "main.head@half"),
        '"@half" is not a fraction of the length; expected 0 to 1',
    ),
    "probe along a node": (
        swap("gate.pressure", "gate.head@0.5"),
        "gate is a junction, and head has no place along it; leave @0.5 out",
    ),
    "probe that is none": (
        swap("gate.pressure", "gate"),
        'output.probes[0]: "gate" is not a probe; expected NAME.QUANTITY',
    ),
    "probe that is a number": (swap('"gate.pressure"', "3"), "output.probes[0]: 3 is not a probe"),
    "probes that are no list": (
        swap('["gate.pressure"]', '"gate.pressure"'),
        'output.probes: "gate.pressure" is not a list',
    ),
    "output unit": (
        add("output", 'units = { pressure = "l/s" }'),
        'output.units.pressure: "l/s" is a flow; expected a pressure',
    ),
    "output quantity": (
        add("output", 'units = { presure = "bar" }'),
        'units.presure: unknown quantity; did you mean "pressure"?',
    ),
    "frames": (add("output", "fields = -1"), "output.fields: -1 is out of range"),
    # expect
    "claim": (
        SCENE + '[expect]\n"mx(gate.pressure)" = { value = 1 }',
        'expect."mx(gate.pressure)": is not a claim; expected max',
    ),
    "claim of nothing": (
        SCENE + '[expect]\n"max(gat.pressure)" = { value = 1, rtol = 1 }',
        'no part named "gat"',
    ),
    "claim without value": (
        SCENE + '[expect]\n"max(gate.head)" = { rtol = 1 }',
        "value is missing",
    ),
    "claim without tolerance": (
        SCENE + '[expect]\n"max(gate.head)" = { value = 1 }',
        "tolerance is missing; expected rtol, atol",
    ),
    "claim in a wrong unit": (
        SCENE + '[expect]\n"max(gate.head)" = { value = "1 bar", rtol = 1 }',
        "is a pressure; expected a head",
    ),
    "claim without time": (
        SCENE + '[expect]\n"at(gate.head)" = { value = 1, rtol = 1 }',
        "expected at(PROBE, TIME)",
    ),
    "claim with a time": (
        SCENE + '[expect]\n"max(gate.head, 3)" = { value = 1, rtol = 1 }',
        "expected max(PROBE)",
    ),
    "claim at no time": (
        SCENE + '[expect]\n"at(gate.head, 3 m)" = { value = 1, rtol = 1 }',
        '"3 m" is a length; expected a time',
    ),
    "claim at a time outside": (
        SCENE + '[expect]\n"at(gate.head, 11 s)" = { value = 1, rtol = 1 }',
        "11 s is not within the run, 0 s to 10 s",
    ),
    # compare
    "compare with nothing": (
        SCENE + '[compare]\n"gat.head" = { file = "good.csv" }',
        'compare."gat.head": no part named "gat"',
    ),
    "compare with no file": (
        SCENE + '[compare]\n"gate.head" = { file = "x.csv" }',
        'compare."gate.head".file: "x.csv": there is no',
    ),
    "compare with no column": (
        SCENE + '[compare]\n"gate.head" = { file = "good.csv", value = "x" }',
        'good.csv has no column "x"; columns are',
    ),
    "compare key": (
        SCENE + '[compare]\n"gate.head" = { fil = "good.csv" }',
        'compare."gate.head".fil: unknown key; did you mean "file"?',
    ),
    # suggestions
    "a closing time": (
        swap("discharge_coefficient = 0.6", "closing_time = 3"),
        'links.valve.closing_time: unknown key; use opening = { start = "1 s", duration = "2 s", value = [1, 0] }',
    ),
    "a roughness beside its friction": (
        swap("cells = 200", "roughness = 3e-4"),
        'links.main.roughness: unknown key; use friction = { model = "quasi-steady", roughness = ',
    ),
    "friction after Colebrook": (
        swap('"steady"', '"Colebrook"'),
        'friction.model: no friction model named "Colebrook"; use "quasi-steady" or "steady" with a roughness',
    ),
    "friction of one key": (
        swap('"steady", roughness = "0.26 mm"', '"hazen-williams"'),
        "links.main.friction: coefficient is missing",
    ),
    "some oil": (
        swap('name = "user"', 'name = "oil"'),
        'fluid.name: "oil" is not a CoolProp fluid; oils are ISO VG 32, ISO VG 46, ISO VG 68, or give a "user" fluid',
    ),
    "a fluid that is a text": (
        re.sub(r"\[fluid\](\n.+)*\n", "", SCENE).replace("schema = 1", 'schema = 1\nfluid = "oil"'),
        'line 2: fluid: "oil" is not a table; expected [fluid] with name = "ISO VG 46"',
    ),
    "water at 20 K": (
        swap('name = "user"', 'name = "Water"\ntemperature = 20'),
        'outside the range of Water, 0.01 degC to 1726.85 degC; a bare number is in K, did you mean "20 degC"?',
    ),
    "a hose": (
        swap('type = "pipe"', 'type = "hose"'),
        'links.main.type: unknown type "hose"; did you mean "pipe" (hose)? For an example: fvsolve parts "hose"',
    ),
    "a filter": (
        swap('type = "valve"', 'type = "Filter"'),
        'links.valve.type: unknown type "Filter"; did you mean "loss-curve" or "orifice" (filter)?',
    ),
    "an abbreviation of practice": (
        swap('type = "valve"', 'type = "nrv"'),
        'links.valve.type: unknown type "nrv"; did you mean "check-valve" (non-return valve)?',
    ),
    "a composition": (
        swap('type = "valve"', 'type = "one_way tank"'),
        'unknown type "one_way tank"; did you mean "tank" and "check-valve" (one-way tank)?',
    ),
    "a name of practice in the other table": (
        swap('"junction"', '"PSV"'),
        'did you mean "relief-valve" or "pressure-sustaining" (PSV), under [links]?',
    ),
    "a name of practice with a slip": (
        swap('type = "valve"', 'type = "non-return-vavle"'),
        'did you mean "check-valve" (non-return valve)?',
    ),
    "a bare name with an umlaut": (
        swap("[links.valve]", "[links.düse]"),
        'line 32: TOML: a name with letters beyond a to z needs quotes: "düse"',
    ),
    "a bare name with a blank": (
        swap("[links.valve]", "[links.main valve]"),
        "line 32: TOML: an unquoted name has no blank; write main_valve",
    ),
    "a bare key with a blank": (
        swap("cells = 200", "wave speed = 3"),
        "an unquoted name has no blank; write wave_speed",
    ),
    # TOML
    "syntax": (
        swap("end = ", "end "),
        "line 41: TOML: expected '=' after a key in a key/value pair: ",
    ),
    "a key twice": (add("links.main", "cells = 3"), 'TOML: this key is given twice: "cells = 200"'),
    "a table twice": (
        SCENE + "[numerics]\n",
        'line 46: TOML: this table is given twice: "[numerics]"',
    ),
    "nested too deep": ("x = " + "[" * 5000 + "]" * 5000, "nested too deep"),
    "a number of 5000 digits": ("x = " + "1" * 5000, "TOML: "),
}


@pytest.fixture
def folder(tmp_path):
    for name, text in {
        "good.csv": "t [s],stem [-]\n0,1\n1,0\n",
        "bare.csv": "0,1\n1,0\n",
        "empty.csv": "\n",
        "one.csv": "t\n1\n",
        "kilo.csv": "t [s],stem [kg]\n0,1\n1,0\n",
        "text.csv": "t,s\n0,1\n1,shut\n",
        "back.csv": "t,s\n0,1\n1,1\n0,0\n",
        "wide.csv": "t,s\n0,1\n1,2\n",
    }.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "noise.csv").write_bytes(b"t,s\n\xff\xfe,1\n")
    return tmp_path


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_gets_its_message(name, folder):
    text, message = BAD[name]
    found = faults(text, folder)
    assert message in found
    assert re.match(r"scene\.toml: \d+ faults?\n", found)


def test_the_scene_itself_has_no_fault(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    assert load(tmp_path / "scene.toml").links["valve"].kind == "valve"


def test_all_faults_come_at_once(tmp_path):
    text = (
        swap('"914.4 m"', "-1")
        .replace('"304.8 mm"', '"3 kg"')
        .replace("0.6", "7")
        .replace('"10 s"', '"10 m"')
    )
    text = text.replace("gate.pressure", "gat.pressure").replace('to = "outfall"', 'to = "outfal"')
    found = faults(text, tmp_path)
    for key in (
        "links.main.length",
        "links.main.diameter",
        "discharge_coefficient",
        "numerics.end",
        "probes[0]",
        "links.valve.to",
    ):
        assert key in found


SET = {
    "no such link": (
        {"links.mian.cells": 4},
        '--set links.mian.cells: no link named "mian"; did you mean "main"?',
    ),
    "no such node": ({"nodes.x.head": 4}, '--set nodes.x.head: no node named "x"'),
    "no such key": (
        {"links.main.cell": 4},
        '--set links.main.cell: unknown key; did you mean "cells"?',
    ),
    "no such table": ({"numeric.end": 4}, '--set numeric: unknown key; did you mean "numerics"?'),
    "below a value": ({"title.x": 4}, '--set title.x: "title" is "A valve shuts", not a table'),
    "no fit": (
        {"links.main.cells": "many"},
        '--set links.main.cells: "many" is not a whole number',
    ),
    "two steps": (
        {"numerics.step": 1, "numerics.rtol": 1},
        "--set numerics.rtol: step and rtol are given; keep one",
    ),
    "no such method": (
        {"numerics.rtol": 1e-5, "numerics.method": "rk4"},
        '--set numerics.rtol: method "rk4" estimates no',
    ),
}


@pytest.mark.parametrize("name", SET)
def test_an_override_at_fault_is_named(name, tmp_path):
    settings, message = SET[name]
    assert message in faults(SCENE, tmp_path, set=settings)


SHUT = SCENE.replace('type = "junction"', 'type = "junction"\ndemand = 0.1').replace(
    "[links.main]", "[links.sluice]"
)
SHUT = SHUT.replace('type = "pipe"', 'type = "valve"\nopening = 0\narea = 0.1').replace(
    "value = [1.0, 0.0]", "value = [0, 1]"
)
for key in ("length", "diameter", "wave_speed", "friction", "cells", "courant"):
    SHUT = re.sub(rf"^{key} = .*\n", "", SHUT, flags=re.MULTILINE)
FED = SHUT.replace('type = "junction"\ndemand = 0.1', 'type = "inflow"\nflow = 30')
CANNOT_START = {
    "an inflow before shut valves": (
        FED,
        {},
        "line 15: nodes.gate: no steady state: the inflow here is 30 m3/s, but every path out is shut",
    ),
    "a demand behind shut valves": (
        SHUT,
        {},
        "line 15: nodes.gate: no steady state: the demand here is 0.1 m3/s, but",
    ),
    "unequal heads and no friction": (
        SCENE.replace('"steady", roughness = "0.26 mm"', '"none"').replace(
            '"junction"', '"reservoir"\nhead = 3'
        ),
        {},
        "line 23: links.main: no steady state: this pipe has no friction",
    ),
    "what moves": (
        SCENE.replace("courant = 0.9", 'initial = "equilibrium"').replace(
            '"junction"', '"tank"\nlevel = 1\narea = 1'
        ),
        {},
        'line 44: numerics.initial: "equilibrium" expects that nothing moves',
    ),
    "what moves, set": (
        SCENE.replace('"junction"', '"tank"\nlevel = 1\narea = 1'),
        {"numerics.initial": "equilibrium"},
        '--set numerics.initial: "equilibrium" expects that nothing moves',
    ),
    "no viscosity": (
        SCENE.replace("viscosity = 1e-3\n", ""),
        {},
        "line 28: links.main.friction: the key `roughness` needs the fluid's viscosity",
    ),
    "no viscosity for a table that is set": (
        SCENE.replace("viscosity = 1e-3\n", ""),
        {"links.main.friction": {"model": "steady", "roughness": 1e-4}},
        "--set links.main.friction: the key `roughness` needs the fluid's viscosity",
    ),
    "no viscosity for a part that is set": (
        SCENE.replace("viscosity = 1e-3\n", ""),
        {"links.main.friction": {"model": "none"}, "links.valve.laminar_reynolds": 20},
        "--set links.valve.laminar_reynolds: needs the fluid's viscosity",
    ),
}


@pytest.mark.parametrize("name", CANNOT_START)
def test_a_case_that_cannot_start_has_its_lines_too(name, tmp_path):
    text, settings, message = CANNOT_START[name]
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    for case in (path, load(path)):
        with pytest.raises(CaseError) as caught:
            run(case, set=settings)
        assert re.match(r"scene.toml: \d faults?\n", str(caught.value)) and f"  {message}" in str(
            caught.value
        )


def test_a_dict_that_cannot_start_has_faults_without_lines():
    with pytest.raises(CaseError, match=r"^case: 1 fault\n  nodes.gate: no steady state"):
        run(tomllib.loads(SHUT))


def test_a_study_is_no_case_and_names_its_command(tmp_path):
    (tmp_path / "plan.toml").write_text('case = "main.toml"\n[events.trip.links.pump]\ntrip = 1\n')
    refused(
        tmp_path / "plan.toml", "1 fault\n  is a study of a case; fvsolve study plan.toml runs it"
    )


def test_a_material_that_is_none_hides_no_class_that_is_none():
    pipe = {
        "links.main": {
            "type": "pipe",
            "from": "lake",
            "to": "gate",
            "length": 900,
            "nominal": "DN300",
            "material": "ductil-iron",
            "class": "Q9",
            "friction": {"model": "none"},
        }
    }
    error = refused(tomllib.loads(SCENE), set=pipe)
    assert [one.place for one in error.faults] == ["links.main.class", "links.main.material"]


def test_a_list_of_parts_names_each_once():
    table = tomllib.loads(SCENE.replace("[links.main]", "[links.gate]"))
    table["output"]["probes"] = ["door.pressure"]
    refused(table, "; parts are gate, lake, outfall, valve$")


def test_a_dict_has_faults_without_lines():
    table = tomllib.loads(SCENE)
    table["links"]["main"]["length"] = None
    error = refused(table)
    assert str(error) == (
        'case: 1 fault\n  links.main.length: None is a NoneType; expected a length, for example "300 mm"'
    )
    assert isinstance(error, FvsolveError) and error.faults[0].place == "links.main.length"


def test_no_file_a_folder_and_noise(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    for path, message in (
        (tmp_path / "scen.toml", 'there is no such file; did you mean "scene.toml"?'),
        (tmp_path / "no" / "scene.toml", "there is no such file"),
        (tmp_path, "is a directory; expected a TOML file"),
        ("a\0b", "cannot be read"),
    ):
        refused(path, re.escape(message))
    (tmp_path / "noise.toml").write_bytes(b"a = 1\nb = '\xff'\n")
    refused(tmp_path / "noise.toml", r"line 2: byte b'\\xff' is not UTF-8 text")


def test_nearest_names():
    assert nearest("openning", ["opening", "area"]) == "opening"
    assert nearest("Youngs-Modulus", ["youngs_modulus"]) == "youngs_modulus"
    assert nearest("zzz", ["opening"]) is None
