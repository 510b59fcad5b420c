"""Controls and formulas of time: each fault has one message with its place and remedy; legal input stays legal."""

import copy
import cProfile
import pstats
import re
import tomllib

import pytest

import fvsolve
from fvsolve import CaseError
from fvsolve.features.controls.feature import blocks_of

LEVEL = """\
schema = 1
title = "Level of a tank by a PI controller"

[fluid]
name = "water"
density = 1000.0
bulk_modulus = "2.2 GPa"
viscosity = "1 mPa s"

[nodes.source]
type = "reservoir"
head = "20 m"
elevation = 0.0

[nodes.tower]
type = "tank"
area = "2 m2"
level = "4 m"
elevation = 0.0

[nodes.town]
type = "reservoir"
head = "0 m"
elevation = 0.0

[links.inlet]
type = "valve"
from = "source"
to = "tower"
area = "20 cm2"
opening = { control = "level" }

[links.outlet]
type = "valve"
from = "tower"
to = "town"
area = "20 cm2"
opening = 0.5

[controls.level]
type = "pi"
input = "tower.level"
setpoint = "4 m"
gain = "0.8 1/m"
integral_time = "120 s"

[numerics]
end = "600 s"
"""
LOOP = """\
schema = 1
title = "PI controller of two lags"

[controls.plant]
type = "transfer-function"
input = "controls.pi"
numerator = [1.0]
denominator = [0.05, 0.6, 1.0]

[controls.pi]
type = "pi"
input = "controls.plant"
setpoint = { time = [0, 1], value = [0, 1], kind = "step" }
gain = 5
integral_time = "0.4 s"

[numerics]
end = "5 s"
"""
BASIN = """\
schema = 1
title = "A wall makes waves"

[fluid]
name = "water"
density = 1000.0
bulk_modulus = "2.2 GPa"

[nodes.flume]
type = "basin"
size = ["2 m", "0.5 m"]
cells = [20, 1]
level = "0.3 m"
patches = { paddle = { side = "west", travel = "0.02*sin(t)" } }

[numerics]
end = "2 s"
"""
BODY = """\
schema = 1
title = "An arm swings"

[fluid]
name = "water"
density = 1000.0
bulk_modulus = "2.2 GPa"

[nodes.arm]
type = "body"
mass = 2
inertia = [0.1, 0.1, 0.1]
joint = { kind = "revolute", axis = [0, 0, 1], angle = "0.1*(1 - cos(t))" }

[numerics]
end = "2 s"
"""
GONE = object()  # in place of a value: the key is removed

FUNCTION = {"type": "function", "inputs": {"h": "tower.level"}, "formula": "0.1*h"}
TABLE = {"type": "table", "input": "tower.level", "table": {"input": [3, 5], "output": [1, 0.1]}}
LAG = {
    "type": "transfer-function",
    "input": "tower.level",
    "numerator": [0.1],
    "denominator": [10, 1],
}
CONSTANT = {"type": "function", "formula": "0.1"}
PLAIN = {"controls": GONE, "links.inlet.opening": 0.3}  # the scene without blocks
MIDDLE = {  # a junction between valves, whose pressure has no state
    "nodes.mid": {"type": "junction", "elevation": 0.0},
    "links.pre": {"type": "valve", "from": "mid", "to": "tower", "area": "20 cm2"},
    "links.inlet.to": "mid",
}
BY_PRESSURE = MIDDLE | {
    "controls.level.input": "mid.pressure",
    "controls.level.setpoint": "2 bar",
    "controls.level.gain": "-0.1 1/bar",
}
BY_SOURCE = {  # the controller drives the pressure of the source
    "nodes.source.head": GONE,
    "nodes.source.pressure": {"control": "level"},
    "links.inlet.opening": 0.3,
    "controls.level.gain": "1 bar/m",
}


def edited(text, changes):
    """Table of a scene with changed values : dotted key -> value."""
    table = tomllib.loads(text)
    for key, value in changes.items():
        *path, last = key.split(".")
        inner = table
        for word in path:
            inner = inner.setdefault(word, {})
        if value is GONE:
            del inner[last]
        else:
            inner[last] = copy.deepcopy(value)
    return table


def faults(changes, text=LEVEL):
    """Texts of the faults of a scene with changed values, found by reading it or by building its model."""
    with pytest.raises(CaseError) as caught:
        fvsolve.build(fvsolve.load(edited(text, changes)))
    return [str(fault) for fault in caught.value.faults]


def only_fault(changes, text=LEVEL):
    """Text of the single fault of a scene with changed values."""
    found = faults(changes, text)
    assert len(found) == 1, found
    return found[0]


def matches(text, pattern):
    """True if a text has the parts of a pattern between its signs *, in their order."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), text) is not None


def with_block(**keys):
    """Change of the scene: these keys of the block "level"; None removes a key."""
    return {
        f"controls.level.{key}": GONE if value is None else value for key, value in keys.items()
    }


# blocks -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes, message",
    [
        (with_block(input=None), "controls.level: input is missing"),
        (with_block(input="towr.level"), 'controls.level.input: no part named "towr"; *did you mean "tower"?'),
        (with_block(input="tower.lvel"), 'controls.level.input: tower is a tank, which has no "lvel"; *"level"?'),
        (with_block(input="controls.levl"), 'controls.level.input: no control named "levl"; did you mean "level"?*'),
        (with_block(input="level"), 'controls.level.input: "level" is not a block; did you mean "controls.level"?'),
        (with_block(input="controls.level.output"), 'controls.level.input: *; did you mean "controls.level"?'),
        (with_block(input="tower"), 'controls.level.input: "tower" is not a probe; expected NAME.QUANTITY*NAME'),
        (with_block(input=3), "controls.level.input: 3 is not text; expected text in quotes"),
        (with_block(input=["tower.level"]), "controls.level.input: ['tower.level'] is not text; expected text*"),
        (with_block(setpoint=None), "controls.level: setpoint is missing"),
        (with_block(gain=None), "controls.level: gain is missing"),
        (with_block(type=None), "controls.level: type is missing; expected one of *pi, pid*"),
        (with_block(type="pii"), 'controls.level.type: unknown type "pii"; did you mean "pi"?'),
        (with_block(type=["pi"]), "controls.level.type: unknown type ['pi']; types are *pi, pid*"),
        (with_block(gian=3), 'controls.level.gian: unknown key; did you mean "gain"?'),
        ({"controls.level": 3}, "controls.level: 3 is not a table; expected a table with a type"),
        ({"controls": [1]}, "controls: [1] is not a table"),
        ({"controls.a b": CONSTANT}, 'controls."a b": "a b" is not a valid name; a name has only letters, digits*'),
        (with_block(initial="0.4 m"), 'controls.level.initial: "0.4 m" is a length; expected a number*'),
        (with_block(initial=2), "controls.level.initial: 2 is outside the limits [0, 1]; expected a value within them"),
        (with_block(initial=0.1, limits=[0.2, 0.5]), "controls.level.initial: 0.1 is outside the limits [0.2, 0.5]*"),
        (with_block(limits=[]), "controls.level.limits: [] has no values; expected a list of values"),
        (with_block(limits=[1]), "controls.level.limits: [1] has 1 values; expected 2"),
        (with_block(limits=[1, 0]), "controls.level.limits: [1, 0] has no values between; expected the least, then*"),
        (with_block(limits=["1", "0"]), "controls.level.limits: *has no values between; expected the least, then*"),
        (with_block(limits=[0.5, 0.5]), "controls.level.limits: [0.5, 0.5] has no values between*"),
        (with_block(limits=[0, 2]), "controls.level.limits: [0, 2] goes beyond *; expected values between 0 and 1"),
        (with_block(limits=3), "controls.level.limits: 3 is not a list; expected a list of values"),
        (
            {"controls.level": TABLE | {"table": {"input": [3, 5], "output": [100, 10]}}},
            "controls.level.table.output: [100.0, 10.0] goes beyond what the driven keys may be; expected values *",
        ),
    ],
)  # fmt: skip
def test_a_fault_of_a_block_has_a_message_with_its_remedy(changes, message):
    assert matches(only_fault(changes), message)


@pytest.mark.parametrize("key", ["setpoint", "gain"])
def test_a_unit_that_depends_on_a_faulty_input_gives_no_second_fault(key):
    assert only_fault(with_block(input="tower.lvel", **{key: "3 bar"})).startswith(
        "controls.level.input: "
    )


@pytest.mark.parametrize(
    "keys, message",
    [
        (
            {"gain": "0.8 1/s"},
            'controls.level.gain: "0.8 1/s" has the unit 1/s; expected a number in 1/m',
        ),
        (
            {"gain": "0.8 zz"},
            'controls.level.gain: "0.8 zz": unknown unit "zz"; expected a number in 1/m',
        ),
        (
            {"gain": "much"},
            'controls.level.gain: "much" is not a number with a unit; expected a number in 1/m',
        ),
        ({"gain": True}, "controls.level.gain: true is true or false; expected a number*"),
        (
            {"setpoint": "4 bar"},
            'controls.level.setpoint: "4 bar" is a pressure; expected a level, for example "2 m"',
        ),
        ({"limits": ["0 m", 1]}, 'controls.level.limits[0]: "0 m" is a length; expected a number*'),
        (
            {"input": "outlet.flow", "setpoint": "1 l/s"},
            'controls.level.gain: "0.8 1/m" has *; expected *',
        ),
    ],
)
def test_units_fit_between_probe_setpoint_gain_limits_and_driven_key(keys, message):
    assert matches(only_fault(with_block(**keys)), message)


def test_the_unit_of_a_setpoint_is_that_of_the_block_that_it_follows():
    outer = {"type": "function", "formula": "4", "unit": "bar"}
    text = only_fault(with_block(setpoint={"control": "outer"}) | {"controls.outer": outer})
    assert matches(text, 'controls.outer.unit: "bar" is a pressure; expected a level*')


def test_a_control_cannot_drive_keys_of_unlike_units():
    town = {"nodes.town.head": {"control": "level"}, "controls.level.limits": [0, 1]}
    text = (
        "controls.level: drives a head and a number; expected keys of one unit, or a block for each"
    )
    assert only_fault(town) == text
    outer = {"controls.outer": CONSTANT, "links.outlet.opening": {"control": "outer"}}
    assert only_fault(with_block(setpoint={"control": "outer"}) | outer).startswith(
        "controls.outer: drives a number and"
    )


def test_a_control_may_drive_several_keys_of_equal_units():
    fvsolve.build(fvsolve.load(edited(LEVEL, {"links.outlet.opening": {"control": "level"}})))


@pytest.mark.parametrize(
    "value, message",
    [
        ({"control": "level"}, "links.inlet.area: *follows a control, and this value does not; expected an area*"),
        ({"formula": "2*t"}, "links.inlet.area: *changes with time, and this value does not; expected an area*"),
        ("2*t", 'links.inlet.area: "2*t" is a formula of t, and this value does not *; expected an area*'),
    ],
)  # fmt: skip
def test_a_value_that_is_not_a_schedule_follows_no_control_and_no_formula(value, message):
    assert matches(only_fault({"links.inlet.area": value}), message)


@pytest.mark.parametrize(
    "value, place, message",
    [
        ({"control": "levl"}, "opening.control", 'no control named "levl"; did you mean "level"?*'),
        ({"control": "controls.level"}, "opening.control", 'no control *; did you mean "level"?*'),
        ({"control": 3}, "opening.control", "3 is not text; expected text in quotes"),
        ({"control": "level", "x": 1}, "opening.x", "unknown key; keys are control"),
    ],
)
def test_a_schedule_names_a_control_that_exists(value, place, message):
    assert matches(only_fault({"links.inlet.opening": value}), f"links.inlet.{place}: {message}")


@pytest.mark.parametrize(
    "block, message",
    [
        ({"offset": "1 s"}, "offset: has no effect without `period`; give both keys, or remove this key"),
        ({"period": "2 s", "offset": "2 s"}, "offset: 2 s is not below the period; expected less than 2 s"),
        ({"period": "100 ns"}, "period: 1e-07 s gives 6e+09 samples; expected at most 1e+09 in the run"),
    ],
)  # fmt: skip
def test_a_fault_of_samples_has_the_key_of_the_block(block, message):
    assert only_fault(with_block(**block)) == f"controls.level.{message}"


@pytest.mark.parametrize(
    "delay, numerics, message",
    [
        ("0.5 s", {"step": "1 s", "method": "rk4"}, "0.5 s is shorter than numerics.step, *; expected at least 1 s, *"),
        ("100 ns", {}, "1e-07 s gives 6e+09 steps, since no step may exceed the delay; expected at most 1e+09 *"),
    ],
)  # fmt: skip
def test_a_delay_fits_the_steps_of_the_run(delay, numerics, message):
    lag = {"type": "delay", "input": "controls.level", "delay": delay}
    changes = {f"numerics.{key}": value for key, value in numerics.items()}
    assert matches(only_fault(changes | {"controls.late": lag}), f"controls.late.delay: {message}")


LINES = {
    "tank-level-pi": "level: pi of tower.level, setpoint 4.5 m, at least 0, at most 1; output 0.1596",
    "digital-pressure": "radio: delay of town.head; output 50 m",
    "tank-relay": "starter: relay of tower.level, at least 0; output 1",
}


@pytest.mark.parametrize("case", LINES)
def test_check_prints_a_line_for_each_block(case, fvs):
    code, said, _ = fvs("check", case)
    assert code == 0 and f"control {LINES[case]} at the start" in said.splitlines()


def test_a_line_of_a_block_has_its_filter_and_samples():
    keys = {"controls.level.filter": "3 s", "controls.level.period": "2 s"}
    model = fvsolve.build(fvsolve.load("tank-level-pi", keys | {"controls.level.offset": 1}))
    assert model.checks["controls"]["level"]["filter"] == 3.0
    (text,) = model.checks["texts"]
    assert "pi of tower.level, filter 3 s, samples every 2 s from 1 s on, setpoint" in text


def test_a_line_of_a_block_has_its_inputs_in_the_order_of_its_keys():
    function = {"type": "function", "formula": "b + a", "inputs": {"b": "tower.level", "a": "outlet.flow"}}  # fmt: skip
    model = fvsolve.build(fvsolve.load("tank-level-pi", {"controls.sum": function}))
    assert any("function of tower.level, outlet.flow" in text for text in model.checks["texts"])


def test_a_block_that_samples_once_in_a_run_and_a_setpoint_that_continues_get_notes():
    late = {"time": ["0 s", "9 h"], "value": ["4.5 m", "5 m"]}
    changes = {"controls.level.period": "8 h", "controls.level.setpoint": late}
    notes = [str(note) for note in fvsolve.build(fvsolve.load("tank-level-pi", changes)).warnings]
    assert any(
        "controls.level.period: 28800 s gives one sample in a run of" in note for note in notes
    )
    assert any(
        "controls.level.setpoint: continues to 32400 s, after the end" in note for note in notes
    )


def test_without_controls_the_message_names_their_absence():
    text = 'links.inlet.opening.control: no control named "level"; [controls] has none'
    assert only_fault({"controls": GONE}) == text


def test_a_signal_does_not_follow_a_control():
    for opening in ({"signal": "s"}, {"control": "level"}):
        changes = {"signals.s": {"control": "level"}, "links.inlet.opening": opening}
        text = 'signals.s: * is not a signal with values; write { control = "level" } at the keys that use it'
        assert matches(only_fault(changes), text)


@pytest.mark.parametrize("group", ["nodes", "links"])
def test_no_node_and_no_link_is_named_controls(group):
    part = (
        {"type": "junction", "elevation": 0.0}
        if group == "nodes"
        else tomllib.loads(LEVEL)["links"]["outlet"]
    )
    text = f'{group}.controls: "controls" is the name of the blocks; expected another name'
    assert text in faults({f"{group}.controls": part})


# cycles and loops ---------------------------------------------------------------------------------------------------


def test_blocks_that_pass_on_at_once_do_not_form_a_cycle():
    plant = {"type": "function", "inputs": {"x": "controls.pi"}, "formula": "2*x"}
    text = (
        "controls.plant: pi, plant read each other at once, so none can decide "
        "first; give [controls.plant] a `filter`"
    )
    assert only_fault({"controls.plant": plant}, LOOP) == text
    fvsolve.load(edited(LOOP, {"controls.plant": plant | {"filter": "1 s"}}))


def test_a_block_does_not_read_its_own_output_at_once():
    own = {"type": "function", "inputs": {"x": "controls.own"}, "formula": "0.5*x"}
    assert only_fault({"controls.own": own}, LOOP).startswith(
        "controls.own: own reads its own output at once; give"
    )


def test_each_cycle_is_a_fault_of_its_own():
    chain = {"a": "b", "b": "a", "c": "d", "d": "c", "e": "d"}
    blocks = {
        f"controls.{name}": {
            "type": "function",
            "inputs": {"x": f"controls.{other}"},
            "formula": "2*x",
        }
        for name, other in chain.items()
    }
    assert [text.partition(",")[0] for text in faults(blocks, LOOP)] == [
        "controls.a: a",
        "controls.c: c",
    ]


def test_a_filter_is_no_remedy_for_setpoints_that_follow_each_other():
    pi = {"type": "pi", "input": "controls.plant", "gain": 1}
    blocks = {
        "controls.a": pi | {"setpoint": {"control": "b"}},
        "controls.b": pi | {"setpoint": {"control": "a"}},
    }
    text = only_fault(blocks, LOOP)
    assert text.endswith(
        "a `filter` does not act on setpoints; expected a setpoint from outside of the cycle"
    )


def test_blocks_without_parts_need_no_fluid_and_parts_do():
    alone = fvsolve.load(tomllib.loads(LOOP))
    tank = {"type": "tank", "area": 2.0, "level": 4.0}
    text = "[fluid] is missing: the fluid"
    assert text in faults({"nodes.tower": tank}, LOOP)
    with pytest.raises(CaseError, match=re.escape(text)):  # an earlier case lends it no fluid
        fvsolve.load(alone, {f"nodes.tower.{key}": value for key, value in tank.items()})
    with pytest.raises(CaseError, match=re.escape(text)):
        fvsolve.load(
            {key: value for key, value in tomllib.loads(LOOP).items() if key != "controls"}
        )
    assert faults({"nodes.tower": tank, "fluid.name": "water"}, LOOP) == [
        "nodes.tower: no link touches it"
    ]


def test_a_loop_through_the_network_without_a_state_needs_a_filter():
    text = (
        "mid.pressure may follow at once from what the control drives, a loop without a state; give"
    )
    assert only_fault(BY_PRESSURE) == f"controls.level.input: {text} [controls.level] a `filter`"
    through = with_block(input="controls.f", setpoint=2e5, gain=-1e-6)
    through |= {"controls.f": {"type": "function", "inputs": {"p": "mid.pressure"}, "formula": "p"}}
    assert (
        only_fault(BY_PRESSURE | through) == f"controls.f.inputs.p: {text} [controls.f] a `filter`"
    )


def test_a_loop_on_a_pressure_with_a_filter_starts_balanced():
    model = fvsolve.build(fvsolve.load(edited(LEVEL, BY_PRESSURE | with_block(filter="1 s"))))
    assert blocks_of(model)["start"][0] == pytest.approx(0.78102, abs=1e-5)  # where mid has 2 bar


def test_a_speed_without_limits_is_balanced_from_full_speed():
    """At rest the pump gives no flow to a demand, so that a search from 0 finds no start."""
    curve = {"flow": [0, 0.05, 0.08], "head": [60, 50, 34.4]}
    pump = {
        "type": "pump",
        "from": "source",
        "to": "mid",
        "speed": {"control": "level"},
        "curve": curve,
    }
    case = edited(LEVEL, BY_PRESSURE | {"links": {"pump": pump}, "nodes.mid.demand": "30 l/s"})
    case["nodes"] = {
        name: node for name, node in case["nodes"].items() if name in ("source", "mid")
    }
    case["controls"]["level"] |= {"setpoint": "7 bar", "gain": "0.1 1/bar", "filter": "1 s"}
    model = fvsolve.build(fvsolve.load(case))
    assert blocks_of(model)["start"][0] > 0.5
    assert fvsolve.run(case)["mid.pressure"] == pytest.approx(7e5, rel=1e-9)


def test_a_cascade_starts_balanced():
    outer = {"controls.outer": {"type": "function", "formula": "4"}}
    model = fvsolve.build(
        fvsolve.load(edited(LEVEL, with_block(setpoint={"control": "outer"}) | outer))
    )
    assert sorted(blocks_of(model)["start"]) == pytest.approx([0.25, 4.0])


@pytest.mark.parametrize(
    "changes, state",
    [
        (with_block(setpoint="4.5 m"), ": the input is 4 m, but the setpoint 4.5 m"),
        (
            BY_PRESSURE | with_block(filter="1 s", setpoint="9 bar"),
            ": the input is *, but the setpoint 9e+05 Pa",
        ),
        ({"links.outlet.area": "1 m2"}, ""),  # the outlet takes more than the inlet can supply
        ({"controls.level": LAG | {"denominator": [1, 0]}}, ": the input is 4 m, but not 0"),
    ],
)
def test_a_loop_without_balance_requires_its_initial_output(changes, state):
    text = (
        f"controls.level: no output of level balances the start{state}; give "
        "the key `initial`, the output at the start"
    )
    assert matches(only_fault(changes), text)


def test_each_block_without_balance_has_a_fault_and_a_relay_without_state_too():
    second = {
        "type": "pi",
        "input": "tower.level",
        "setpoint": "5 m",
        "gain": 1,
        "integral_time": 3,
    }
    relay = {"type": "relay", "input": "tower.level", "on": 3, "off": 5}
    changes = with_block(setpoint="4.5 m") | {
        "controls.second": second,
        "controls.relay": relay,
        "links.outlet.opening": {"control": "second"},
    }
    found = sorted(faults(changes))
    start = "no output of {} balances the start: the input is 4 m, but the setpoint"
    assert [text.partition(";")[0] for text in found] == [
        f"controls.level: {start.format('level')} 4.5 m",
        "controls.relay: its input is 4 m at the start, between `on` and `off`",
        f"controls.second: {start.format('second')} 5 m",
    ]


def test_a_block_that_drives_nothing_is_named():
    idle = 'controls.level: drives no key; write { control = "level" } where it acts'
    assert only_fault({"links.inlet.opening": 0.3}) == idle
    assert (
        only_fault({"links.inlet.opening": 0.3, "output.probes": ["controls.level.output"]}) == idle
    )
    spare = {"controls.spare": FUNCTION}
    texts = [
        [
            notice.text
            for notice in fvsolve.build(fvsolve.load(edited(LEVEL, spare | more))).warnings
        ]
        for more in (
            {},
            {"output.probes": ["controls.spare.output"]},
            {
                "controls.sum": {
                    "type": "function",
                    "inputs": {"x": "controls.spare"},
                    "formula": "x",
                },
                "output.probes": ["controls.sum.output"],
            },
        )
    ]
    assert texts == [
        ['controls.spare: drives no key; write { control = "spare" } where it acts'],
        [],
        [],
    ]


@pytest.mark.parametrize("key", ["contol", "formla", "singal", "fle"])
def test_a_misspelt_key_of_a_schedule_has_the_key_of_its_form(key):
    near = {"contol": "control", "formla": "formula", "singal": "signal", "fle": "file"}[key]
    text = f'links.outlet.opening.{key}: unknown key; did you mean "{near}"?'
    assert only_fault({"links.outlet.opening": {key: "level"}}) == text


def test_keys_of_samples_are_unknown_to_a_block_that_acts_at_all_times():
    relay = {"type": "relay", "input": "tower.level", "on": 1, "off": 3, "period": 1}
    text = "unknown key; use it in a `function` that reads this block, which acts at all times"
    assert only_fault({"controls.level": relay}) == f"controls.level.period: {text}"


def test_a_relay_is_refused_in_a_state_that_its_input_contradicts():
    relay = {"type": "relay", "input": "tower.level", "on": 1, "off": 3}
    drives = {"links.inlet.opening": {"control": "level"}}
    text = only_fault(drives | {"controls.level": relay | {"initial": 1}})
    assert matches(
        text,
        "controls.level: `initial` is 1, but its input is 4 m at the start, with `on` at 1 m and `off`*",
    )
    assert text.endswith("expected 0, or leave this key out")
    fvsolve.build(fvsolve.load(edited(LEVEL, drives | {"controls.level": relay | {"initial": 0}})))


def test_a_function_beyond_the_range_of_its_key_gives_a_notice_at_the_start():
    tall = edited(LEVEL, {"controls.level": FUNCTION | {"formula": "2.5*h - 0.5"}})
    (notice,) = fvsolve.build(fvsolve.load(tall)).warnings
    assert notice.text.startswith(
        "controls.level: its output at the start, 9.5, is beyond its limits"
    )
    assert notice.text.endswith("it is limited to 1")
    stated = {**tall, "controls": {"level": tall["controls"]["level"] | {"limits": [0, 1]}}}
    assert not fvsolve.build(fvsolve.load(stated)).warnings


def test_with_its_initial_output_a_loop_may_start_out_of_balance():
    fvsolve.build(fvsolve.load(edited(LEVEL, with_block(setpoint="4.5 m", initial=0.4))))


# driven keys --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes, place, words",
    [
        (BY_SOURCE, "nodes.source.pressure.control", "a pressure"),
        ({"nodes.source.head": {"control": "level"}, "links.inlet.opening": 0.3, "controls.level.gain": 1},
         "nodes.source.head.control", "a head"),
    ],
)  # fmt: skip
def test_a_control_of_a_pressure_or_a_head_needs_limits(changes, place, words):
    assert (
        only_fault(changes) == f"{place}: {words} needs bounds; give `limits` in [controls.level]"
    )


def test_limits_of_a_pressure_are_absolute_pressures_of_a_liquid():
    vacuum = only_fault(BY_SOURCE | with_block(limits=["-2 barg", "6 barg"]))
    assert matches(
        vacuum, 'controls.level.limits[0]: "-2 barg" is -9.868e+04 Pa absolute, a vacuum'
    )
    boiling = BY_SOURCE | with_block(limits=["1 mbar", "6 bar"]) | {"fluid.vapor_pressure": 2339}
    text = (
        'controls.level.limits[0]: "1 mbar" is absolute, not above the vapour pressure of 2339 Pa*'
    )
    assert matches(only_fault(boiling), text)
    fvsolve.build(fvsolve.load(edited(LEVEL, BY_SOURCE | with_block(limits=["0 barg", "6 barg"]))))


def test_a_set_flow_follows_a_control_within_limits_above_0():
    valve = {
        "type": "flow-control",
        "from": "source",
        "to": "tower",
        "area": "20 cm2",
        "time_constant": 1,
    }
    changes = {
        "links.inlet": valve | {"set_flow": {"control": "level"}},
        "controls.level": CONSTANT,
    }
    assert only_fault(changes).startswith(
        "links.inlet.set_flow.control: a flow needs bounds; give `limits`"
    )
    changes["controls.level"] = CONSTANT | {"limits": [0, 1]}
    assert only_fault(changes).endswith(
        "[0, 1] goes beyond what the driven keys may be; expected values above 0"
    )


def test_a_pressure_dependent_demand_follows_a_control_with_limits():
    junction = {
        "type": "junction",
        "elevation": 0.0,
        "required_pressure": "2 bar",
        "demand": {"control": "level"},
    }
    changes = MIDDLE | {
        "nodes.mid": junction,
        "links.inlet.opening": 0.3,
        "controls.level.gain": 0.1,
    }
    text = "nodes.mid.demand: follows a control without `limits`, which `required_pressure` needs; expected limits of"
    assert only_fault(changes) == f"{text} at least 0"


@pytest.mark.parametrize(
    "text, key", [(BASIN, "nodes.flume.patches.paddle.travel"), (BODY, "nodes.arm.joint.angle")]
)
def test_a_moving_wall_or_joint_follows_no_control(text, key):
    found = only_fault({"controls.a": CONSTANT, key: {"control": "a"}}, text)
    assert found.startswith(
        f"{key}: cannot follow a control, because the motion needs its slopes; expected a schedule"
    )


@pytest.mark.parametrize("text", [BASIN, BODY])
def test_a_wall_and_a_joint_follow_a_smooth_formula(text):
    fvsolve.build(fvsolve.load(edited(text, {})))


@pytest.mark.parametrize("formula", ["abs(t - 1)", "max(0, t - 1)", "where(sin(t) > 0.5, t, 0.5)"])
def test_a_driven_joint_follows_no_formula_with_kinks(formula):
    found = only_fault({"nodes.arm.joint.angle": formula}, BODY)
    assert found.startswith(
        f'nodes.arm.joint.angle: "{formula}" drives the joint, and has kinks, which need an infinite'
    )


def test_a_driven_joint_follows_no_formula_that_jumps():
    assert "at t = 1 s it jumps" in only_fault(
        {"nodes.arm.joint.angle": "where(t < 1, 0, 1)"}, BODY
    )


@pytest.mark.parametrize("formula", ["0.1*where(t < 1, 0, 1)", "0.1*(sin(9*t) > 0.5)"])
def test_a_wall_follows_no_formula_that_jumps(formula):
    found = only_fault({"nodes.flume.patches.paddle.travel": formula}, BASIN)
    assert found.startswith(
        "nodes.flume.patches.paddle.travel: jumps, and a wall has a finite speed; expected"
    )


def test_a_wall_may_follow_a_formula_with_kinks():
    fvsolve.load(edited(BASIN, {"nodes.flume.patches.paddle.travel": "0.05*abs(sin(t))"}))


def test_a_node_named_joint_may_follow_a_control():
    node = {"type": "reservoir", "head": {"control": "level"}, "elevation": 0.0}
    block = {"type": "function", "formula": "20", "limits": ["1 m", "30 m"]}
    changes = {
        "nodes.joint": node,
        "nodes.source": GONE,
        "links.inlet.from": "joint",
        "links.inlet.opening": 0.3,
    }
    fvsolve.load(edited(LEVEL, changes | {"controls.level": block}))


def test_a_pump_that_trips_does_not_follow_a_control():
    case = fvsolve.load("pump-trip")
    pump = next(name for name, link in case.links.items() if link.kind == "pump")
    with pytest.raises(
        CaseError, match=f"links.{pump}.speed: cannot follow a control if the machine trips"
    ):
        fvsolve.load(case, {"controls.a": CONSTANT, f"links.{pump}.speed": {"control": "a"}})


# formulas of time ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "formula, message",
    [
        ("0.5*sn(t)", 'is not a formula of t: sn is unknown; did you mean "sin"?*'),
        ("0.5*T", 'is not a formula of t: T is unknown; did you mean "t"?*'),
        ("x + t", "is not a formula of t: x is unknown; known are *"),
        ("0.1*x", "is not a formula of t: x is unknown; known are *"),
        ("sin(t, 2)", "is not a formula of t: sin has 2 arguments; expected sin(a)"),
        ("min(t)", "is not a formula of t: min has 1 argument; expected min(a, b, ...)"),
        (
            "where(t < 1, 0)",
            "is not a formula of t: where has 2 arguments; expected where(condition, a, b)",
        ),
        ("0.5*sin(t", "is not a formula of t: a bracket is not closed"),
        ("t or 1", "is not a formula of t: unknown operator or; did you mean max(a, b)?"),
        ("0.5*cos(t) m", "is not a formula of t: *; numbers in a formula are in SI, without units"),
        ("0.5 + 0.1", "is neither a number with a unit nor a formula of t; expected a number*"),
        ("2*t", "at t = 0.5* s is 1.0*, out of range; expected a value between 0 and 1"),
        ("0.5 - t", "at t = 0.5* s is -0.0*, out of range; expected a value between 0 and 1"),
        ("1/t", "at t = 0 s is not a finite number"),
        ("log(t - 1)", "at t = 0 s is not a finite number"),
    ],
)
def test_a_formula_that_cannot_be_the_value_of_its_key_is_refused(formula, message):
    assert matches(
        only_fault(PLAIN | {"links.inlet.opening": formula}),
        f'links.inlet.opening: "{formula}" {message}',
    )


def test_a_formula_does_not_compare_for_equality():
    text = (
        'links.inlet.opening: "where(t == 3, 1, 0)": t == 3 compares for equality; expected < or >'
    )
    assert only_fault(PLAIN | {"links.inlet.opening": "where(t == 3, 1, 0)"}) == text


@pytest.mark.parametrize(
    "table, message",
    [
        ({"formula": "t/999", "unit": "l/s"}, 'unit: "l/s" is a flow; expected a number*'),
        ({"formula": "t/999", "unit": "zz"}, 'unit: "zz": unknown unit "zz"; expected a number*'),
        ({"formula": "t/999", "unit": 3}, "unit: 3 is not text; expected text in quotes"),
        ({"formula": "t/999", "units": "%"}, 'units: unknown key; did you mean "unit"?'),
        ({"formula": "t", "unit": "%"}, 'formula: "t" at t = 100.0* s is 1.000*, out of range; *'),
        ({"formula": 3}, "formula: 3 is not text; expected text in quotes"),
        ({"formula": ""}, 'formula: "" is not a formula of t'),
    ],
)
def test_a_formula_with_a_unit_is_checked_in_this_unit(table, message):
    assert matches(
        only_fault(PLAIN | {"links.inlet.opening": table}), f"links.inlet.opening.{message}"
    )


def test_a_formula_and_its_unit_have_faults_of_their_own():
    found = faults(PLAIN | {"links.inlet.opening": {"formula": "sn(t)", "unit": "bar"}})
    assert [text.partition(":")[0] for text in found] == [
        "links.inlet.opening.unit",
        "links.inlet.opening.formula",
    ]


def test_a_formula_of_a_pressure_stays_above_the_vapour_pressure():
    changes = PLAIN | {
        "nodes.source": {"type": "reservoir", "pressure": "1e5*sin(t)", "elevation": 0.0}
    }
    text = '"1e5*sin(t)" falls to -* Pa absolute; expected values above the vapour pressure of * Pa'
    assert matches(only_fault(changes), f"nodes.source.pressure: {text}")


@pytest.mark.parametrize("text, message", [
    ("12 m3/hh", 'unknown unit "m3/hh"; expected a number, for example 0.5'), ("12 t/h", "is a mass flow"),
    ("0.5 t", "is a mass"), ("0.5 m", "is a length"),
])  # fmt: skip
def test_a_number_with_a_wrong_unit_is_not_taken_for_a_formula(text, message):
    found = only_fault(PLAIN | {"links.inlet.opening": text})
    assert message in found
    assert "formula" not in found


def test_with_faulty_times_of_the_run_a_formula_gives_no_second_fault():
    changes = PLAIN | {"links.inlet.opening": "2*t", "numerics.end": "-3 s"}
    assert only_fault(changes) == "numerics.end: -3 s is not after the start at 0 s"


@pytest.mark.parametrize("frequency, end", [(50, 40.0), (100, 20.0), (200, 10.0), (20, 100.0)])
def test_a_formula_that_leaves_its_range_between_even_samples_is_refused(frequency, end):
    """All even samples of the run fall on the same phase of the wave."""
    text = f"0.9 + 0.3*sin(2*pi*{frequency}*t)"
    assert "links.inlet.opening" in only_fault(
        PLAIN | {"links.inlet.opening": text, "numerics.end": end}
    )


@pytest.mark.parametrize(
    "formula", ["0.5 + 0.5*sin(2*pi*t/11)", "t < 3", "min(1, t/10)", "exp(-t)", "t^0.5/100"]
)
def test_a_formula_within_the_range_of_its_key_is_legal(formula):
    fvsolve.build(fvsolve.load(edited(LEVEL, PLAIN | {"links.inlet.opening": formula})))


# formulas of blocks -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "keys, message",
    [
        ({"formula": "0.1*g"}, 'formula: "0.1*g" is not a formula of t and h: g is unknown; known are *'),
        ({"formula": "min(h)"}, "formula: *: min has 1 argument; expected min(a, b, ...)"),
        ({"formula": "where(h == 4, 1, 0)"}, "formula: *: h == 4 compares for equality; expected < or >"),
        ({"formula": 3}, "formula: 3 is not text; expected text in quotes"),
        ({"formula": "1/(h - 4)"}, 'formula: "1/(h - 4)" is not a finite number at the start, with t = 0, h = 4; *'),
        ({"formula": "h + 1/t"}, 'formula: "h + 1/t" is not a finite number at the start, with t = 0, h = 4; *'),
        ({"inputs": {"t": "tower.level"}, "formula": "t"}, 'inputs.t: "t" is reserved; expected another name than *'),
        ({"inputs": {"sin": "tower.level"}}, 'inputs.sin: "sin" is reserved; expected another name than *'),
        ({"inputs": {"if": "tower.level"}, "formula": "if"}, 'inputs.if: "if" is reserved; expected another name *'),
        ({"inputs": {"a-b": "tower.level"}}, 'inputs.a-b: "a-b" is not a name in a formula; expected letters a to z*'),
        ({"inputs": {"h": "towr.level"}}, 'inputs.h: no part named "towr"; *; did you mean "tower"?'),
        ({"inputs": {"h": "controls.levle"}}, 'inputs.h: no control named "levle"; did you mean "level"?*'),
        ({"inputs": {"h": 3}}, "inputs.h: 3 is not text; expected text in quotes"),
        ({"inputs": ["tower.level"]}, "inputs: ['tower.level'] is not a table of inputs; expected { NAME = PROBE }"),
        ({"unit": "m"}, 'unit: "m" is a length; expected a number*'),
        ({"unit": [3]}, "unit: [3] is not text; expected text in quotes"),
        ({"input": "tower.level"}, 'input: unknown key; did you mean "inputs"?'),
    ],
)  # fmt: skip
def test_a_fault_of_a_function_has_a_message(keys, message):
    found = [
        text for text in faults({"controls.level": FUNCTION | keys}) if "h is unknown" not in text
    ]
    assert len(found) == 1
    assert matches(found[0], f"controls.level.{message}")


def test_an_input_that_the_formula_does_not_use_is_legal():
    inputs = {"h": "tower.level", "spare": "source.head"}
    fvsolve.build(fvsolve.load(edited(LEVEL, {"controls.level": FUNCTION | {"inputs": inputs}})))


def test_a_formula_is_finite_if_the_blocks_that_it_reads_are_at_rest():
    blocks = {
        "controls.level": {"type": "function", "inputs": {"a": "controls.b"}, "formula": "1/a"}
    }
    model = fvsolve.build(
        fvsolve.load(edited(LEVEL, blocks | {"controls.b": {"type": "function", "formula": "2"}}))
    )
    assert sorted(blocks_of(model)["start"]) == pytest.approx([0.5, 2.0])


# numbers ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["filter", "integral_time", "tracking_time", "derivative_filter"])
@pytest.mark.parametrize("value", [0, -1])
def test_times_and_filters_are_above_0(key, value):
    text = f"controls.level.{key}: {value} is out of range; expected a value above 0"
    assert only_fault(with_block(type="pid", derivative_time=1.0, **{key: value})) == text


def test_a_derivative_time_is_0_or_above():
    text = "controls.level.derivative_time: -1 is out of range; expected a value of at least 0"
    assert only_fault(with_block(type="pid", derivative_time=-1)) == text
    fvsolve.load(edited(LEVEL, with_block(type="pid", derivative_time=0)))


@pytest.mark.parametrize(
    "keys, message",
    [
        ({"numerator": [1, 1, 1]}, "numerator: [1, 1, 1] has the power 2 of s, above *; expected at most 2 numbers"),
        ({"denominator": [0, 1]}, "denominator: [0, 1] begins with a zero; expected the highest power of s first*"),
        ({"denominator": ["0", "1"]}, "denominator: ['0', '1'] begins with a zero; expected the highest power*"),
        ({"numerator": [0, 1]}, "numerator: [0, 1] begins with a zero; expected the highest power of s first*"),
        ({"numerator": [0]}, "numerator: [0] has only zeros; expected a number that is not 0"),
        ({"denominator": [1]}, "denominator: [1] has no power of s; expected two or more*"),
        ({"numerator": [1, 1], "denominator": ["2"]}, "denominator: ['2'] has no power of s; expected two or more*"),
        ({"numerator": []}, "numerator: [] has no values; expected a list of values"),
        ({"denominator": []}, "denominator: [] has no values; expected a list of values"),
        ({"numerator": 1}, "numerator: 1 is not a list; expected a list of values"),
        ({"denominator": [1, "1 s"]}, 'denominator[1]: "1 s" is a time; expected a number*'),
    ],
)  # fmt: skip
def test_a_fault_of_a_transfer_function_has_a_message(keys, message):
    assert matches(only_fault({"controls.level": LAG | keys}), f"controls.level.{message}")


@pytest.mark.parametrize(
    "inputs, outputs, message",
    [
        ([3], [1], "input: has one value; expected two or more"),
        ([3, 2], [1, 0], "input: inputs out of order: 2 comes after 3; expected rising inputs"),
        ([3, 3], [1, 0], "input: inputs out of order: 3 comes after 3; expected rising inputs"),
        (
            [3, 4, 5],
            [1, 0],
            "output: has length 2, but `input` has length 3; expected equal lengths",
        ),
        (["3 bar", 5], [1, 0], 'input[0]: "3 bar" is a pressure; expected a level*'),
        ([3, 5], ["1 m", 0], 'output[0]: "1 m" is a length; expected a number*'),
    ],
)
def test_a_fault_of_a_table_has_a_message(inputs, outputs, message):
    changes = {"controls.level": TABLE | {"table": {"input": inputs, "output": outputs}}}
    assert matches(only_fault(changes), f"controls.level.table.{message}")


def test_a_table_of_a_block_has_two_lists():
    text = "controls.level.table: [1, 2] is not a table; expected { input = [...], output = [...] }"
    assert only_fault({"controls.level": TABLE | {"table": [1, 2]}}) == text


# all at once --------------------------------------------------------------------------------------------------------


def test_all_faults_of_a_file_come_at_once_each_with_its_line(tmp_path):
    text = LEVEL.replace('control = "level"', 'control = "levl"').replace('"0.8 1/m"', '"0.8 1/s"')
    text = text.replace("opening = 0.5", 'opening = "2*t"').replace(
        '"120 s"', "0\nlimits = [1, 0]\ninitial = 3"
    )
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(CaseError) as caught:
        fvsolve.load(tmp_path / "scene.toml")
    lines = text.splitlines()
    found = {
        fault.place.rpartition(".")[2]: lines[fault.line - 1].partition(" ")[0]
        for fault in caught.value.faults
    }
    assert found == {
        "control": "opening",
        "opening": "opening",
        "gain": "gain",
        "integral_time": "integral_time",
        "limits": "limits",
    }


def test_a_fault_of_the_start_has_the_line_of_its_block(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(LEVEL.replace('setpoint = "4 m"', 'setpoint = "5 m"'))
    with pytest.raises(CaseError) as caught:
        fvsolve.run(path)
    assert LEVEL.splitlines()[caught.value.faults[0].line - 1] == "[controls.level]"


# legal input --------------------------------------------------------------------------------------------------------


def test_a_gain_can_be_set():
    case = fvsolve.load(fvsolve.load(edited(LEVEL, {})), {"controls.level.gain": 2})
    assert case.controls["level"].control.gain == 2.0


@pytest.mark.parametrize("gain", [0.8, "0.8 1/m", "8e-3 1/cm", "80 %/m"])
def test_a_gain_has_a_unit_or_is_in_si(gain):
    case = fvsolve.load(edited(LEVEL, with_block(gain=gain)))
    assert case.controls["level"].control.gain == pytest.approx(0.8)


@pytest.mark.parametrize(
    "block",
    [
        {},
        with_block(
            type="pid",
            derivative_time=1.0,
            filter="1 s",
            limits=[0.1, 0.9],
            initial=0.3,
            tracking_time="9 s",
        ),
        {"controls.level": LAG},
        {"controls.level": FUNCTION},
        {"controls.level": FUNCTION | {"unit": "%", "formula": "20 + h"}},
        {"controls.level": TABLE},
        BY_SOURCE | with_block(limits=["0 barg", "6 barg"], initial="2 barg"),
        PLAIN | {"links.inlet.opening": "0.5 + 0.1*sin(t)"},
        PLAIN | {"links.inlet.opening": {"formula": "50 + 9*sin(t)", "unit": "%"}},
        PLAIN | {"nodes.source.head": {"formula": "60 + 5*sin(t)", "unit": "ft"}},
        PLAIN | {"signals.s": "0.5 + 0.1*sin(t)", "links.inlet.opening": {"signal": "s"}},
    ],
)
def test_a_case_with_controls_or_formulas_reads_back_as_an_equal_case(block):
    case = fvsolve.load(edited(LEVEL, block))
    again = fvsolve.load(tomllib.loads(case.resolved()))
    assert again == case
    assert [item.control for item in again.controls.values()] == [
        item.control for item in case.controls.values()
    ]


def calls_to_read(blocks):
    """Number of function calls that reading a case takes, with as many latches and functions for each, and pipes."""
    nodes = {
        f"n{k}": {"type": "junction", "elevation": 0.0, "position": [k, 0.0]} for k in range(60)
    }
    nodes["n0"] = {"type": "reservoir", "head": 10.0}
    links = {
        f"p{k}": {
            "type": "pipe",
            "from": f"n{k}",
            "to": f"n{k + 1}",
            "length": 100.0,
            "diameter": 0.1,
            "wave_speed": 1000.0,
        }
        for k in range(59)
    }
    controls = {}
    for k in range(blocks):
        controls |= {
            f"set-{k}": {"type": "function", "formula": "0"},
            f"reset-{k}": {"type": "function", "formula": "t"},
        }
        controls[f"b{k}"] = {
            "type": "latch",
            "set": f"controls.set-{k}",
            "reset": f"controls.reset-{k}",
            "initial": 0,
        }
        links[f"v{k}"] = {
            "type": "valve",
            "from": f"n{k}",
            "to": f"n{k + 1}",
            "diameter": 0.1,
            "opening": {"control": f"b{k}"},
        }
    profile = cProfile.Profile()
    profile.enable()
    case = fvsolve.load(
        {
            "schema": 1,
            "fluid": {"name": "Water"},
            "nodes": nodes,
            "links": links,
            "controls": controls,
            "numerics": {"end": 1.0, "cell_time": 0.01},
        }
    )
    profile.disable()
    assert len(case.controls) == 3 * blocks and not case.unread_blocks
    return pstats.Stats(profile).total_calls


def test_the_work_to_read_blocks_is_proportional_to_their_number():
    """An imported network with 25 latches took minutes: each block searched the whole case, once for each block."""
    few, twice, many = (calls_to_read(blocks) for blocks in (1, 7, 13))
    assert many - twice < 1.3 * (twice - few)
