"""Blocks of `controls`: sensors, outputs before and after the nodes are solved, rates of their states, probes.

A sensor is a probe that a block reads. The functions of the job OBSERVE read all sensors through the handle `sensing`,
in which the sensors replace the probes. A block works on changes since the start, so that a loop at rest does not move.
Blocks whose output drives the network (openings, speeds, pressures, demands) decide before the nodes are solved, from
states alone. Other blocks decide afterwards. Schedules read the outputs from `applied`; after the outputs, this array
has the outputs before their limits, then number + 1 of the last block whose output was not finite, and its time.
"""

from math import inf, nan

from fvsolve.core.kernels import calls
from fvsolve.core.kernels.barotropic_nodes import head_pressure
from fvsolve.core.kernels.devices import SET
from fvsolve.core.kernels.dtypes import ARRIVED, ARRIVES, FIXED, LAST_ROW, NEVER, STATUS
from fvsolve.core.kernels.formula_programs import is_low
from fvsolve.core.kernels.restrictions import valve_conductance
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.features.controls.kernels.input_histories import (
    JUMP,
    admit_breaks,
    awaits_break,
    break_arrives,
    next_break,
    record_inputs,
    set_breaks,
)
from fvsolve.features.controls.kernels.tables import (
    ADAPT,
    BLOCK_VALUE,
    DECIDE,
    DRIVEN_DEVICE,
    DRIVEN_VALVE,
    SAMPLE,
    SWITCH,
    call_adapt,
    call_decide,
    call_sample,
    call_switch,
    open_blocks,
)
from fvsolve.jit import njit, specialise

OUTPUT, INPUT, ERROR = 0, 1, 2  # quantities of a block
SAMPLE_ROUNDING = 1e-12  # of times, relative to the time and the period
LINEAR = None  # of the template: True for the density law `linear`


@njit(forceinline=True)
def measured_change(tables, control, j):
    """Change of input j of a block since the start, before its filter."""
    code = tables.integers[control["inputs"] + j]
    # A negative code is the output of another block, counted from -1.
    value = tables.readings[code] if code >= 0 else tables.applied[-1 - code]
    return value - tables.floats[control["starts"] + j]


@njit(forceinline=True)
def input_change(y, tables, control, j):
    """Change of input j of a block since the start, after its filter if it has one."""
    return y[control["y"] + j] if j < control["filters"] else measured_change(tables, control, j)


@njit(forceinline=True)
def flag_count(tables, control):
    """Count of event flags that select the side of kinks of a block; 0 for a block that acts at samples."""
    return 0 if control["period"] > 0.0 else tables.armed.size


@njit(forceinline=True)
def setpoint_change(t, tables, control):
    """Change of the setpoint of a block since the start; 0 without a setpoint."""
    if control["setpoint"] < 0:
        return 0.0
    return schedule_value(tables, control["setpoint"], t) - control["setpoint_start"]


@njit
def begin_controls(t, y, dydt, out, handle):
    """Set the outputs of all blocks to those at the start, which schedules have until the blocks decide."""
    tables = open_blocks(handle)
    for k in range(tables.controls.size):
        tables.applied[k] = applied_output(tables.controls[k], tables.controls[k]["start"])


@njit(forceinline=True)
def applied_output(control, output):
    """Output of a block as schedules read it: the value at which a study holds it, else `output`."""
    return control["held"] if control["held"] == control["held"] else output


@njit(forceinline=True)
def read_sensors(t, y, out, tables):
    """Write the values of all sensors to `readings`."""
    if tables.readings.size > 0:
        calls.observe_in_turn(t, y, out, tables.sensing, tables.readings)


@njit(forceinline=True)
def clipped(v, control):
    """Output within its limits; NaN stays NaN."""
    return v if v != v else min(max(v, control["least"]), control["greatest"])


@njit(forceinline=True)
def limited(v, armed, control):
    """Output within its limits, as `clipped`; flags select the limits, so that no step has a kink."""
    flag = control["flag"]
    if v != v:
        return v
    if flag >= 0 and armed[flag] > 0.0:
        return control["least"]
    if flag >= 0 and armed[flag + 2] > 0.0:
        return control["greatest"]
    return clipped(v, control)


@njit(forceinline=True)
def apply_output(t, tables, k, output):
    """Write the output of block k to `applied`; if it is not finite, also its number and the time."""
    tables.applied[k] = applied_output(tables.controls[k], output)
    if not abs(output) < inf:
        at = 2 * tables.controls.size
        tables.applied[at], tables.applied[at + 1] = k + 1.0, t


@njit
def write_outputs(t, y, out, tables, late):
    """Write the outputs of the blocks that decide before (late 0) or after (late 1) the nodes are solved."""
    controls = tables.controls
    applied = tables.applied
    at = tables.block_settings[0]["outputs"]
    for k in range(controls.size):
        control = controls[k]
        if control["late"] == late:
            # A sampled block holds the output of its last sample.
            if control["period"] > 0.0:
                v = out[at + 2 * k] = tables.discrete[control["memory"]]
            else:
                v = call_decide(tables.block_hooks[control["hooks"], DECIDE], t, y, tables, control)
                out[at + 2 * k] = limited(v, tables.armed, control)
            # Output before its limits, which event functions and the rates of states read.
            applied[controls.size + k] = v
            apply_output(t, tables, k, out[at + 2 * k])


@njit(forceinline=True)
def drive_node(t, out, tables, i):
    """Write the pressure change of a node of given pressure, or replace the demand of a junction (law `linear`)."""
    node, layout = tables.nodes[i], tables.layout[0]
    value = schedule_value(tables, node["schedule"], t)
    if node["kind"] != FIXED:
        # The net inflow contains the demand of the schedule at its old value, which is taken out.
        out[layout["net"] + i] -= value + out[layout["supply"] + i]
        out[layout["supply"] + i] = -value
        return
    if not LINEAR and node["head_given"] == 1:
        value = head_pressure(tables.settings[0], tables.floats, value - node["elevation"])
    out[layout["pressure"] + i] = value - node["pressure"]


def _decide_early(t, y, dydt, out, handle):
    """Write the outputs of blocks that drive the network, from states alone, and apply them to valves and nodes."""
    tables, core = open_blocks(handle), open_tables(handle)
    read_sensors(t, y, out, tables)
    write_outputs(t, y, out, tables, 0)
    for m in range(tables.driven.size):
        kind, i = tables.driven[m]["kind"], tables.driven[m]["index"]
        # The phase `prepare` has set valves and devices with the outputs before, so they are set again.
        if kind == DRIVEN_VALVE:
            out[core.layout[0]["conductance"] + i] = valve_conductance(core, i, t)
        elif kind == DRIVEN_DEVICE:
            device = core.devices[i]
            calls.call_set(core.hooks[device["hooks"], SET], t, y, out, core, device)
        elif i >= 0:
            drive_node(t, out, core, i)


decide_linear = specialise(_decide_early, "decide_linear", LINEAR=True)
decide_barotropic = specialise(_decide_early, "decide_barotropic", LINEAR=False)


@njit
def decide_late(t, y, dydt, out, handle):
    """Write the outputs of blocks that only rates read, such as forces, after the nodes are solved."""
    tables = open_blocks(handle)
    if tables.block_settings[0]["late"] == 1:
        read_sensors(t, y, out, tables)
        write_outputs(t, y, out, tables, 1)


@njit
def control_rates(t, y, dydt, out, handle):
    """Write the rates of filters and other states of blocks to `dydt`, and the first input of each block to `out`."""
    tables = open_blocks(handle)
    controls = tables.controls
    applied = tables.applied
    at = tables.block_settings[0]["outputs"]
    # others have been read before the nodes were solved
    if tables.block_settings[0]["late_sensors"] == 1:
        read_sensors(t, y, out, tables)
    for k in range(controls.size):
        control = controls[k]
        if control["input_count"] > 0:
            out[at + 2 * k + 1] = tables.floats[control["starts"]] + input_change(
                y, tables, control, 0
            )
        if dydt.size == 0:
            continue
        for j in range(control["filters"]):
            i = control["y"] + j
            # First-order filter: its state follows the input with the rate 1 / time constant.
            dydt[i] = (measured_change(tables, control, j) - y[i]) * control["filter_rate"]
        hook = tables.block_hooks[control["hooks"], ADAPT]
        # States of sampled blocks change at samples alone.
        if hook != 0 and control["y"] >= 0 and control["period"] == 0.0:
            call_adapt(
                hook, t, y, dydt, tables, control, applied[controls.size + k], out[at + 2 * k]
            )
        if not abs(applied[k]) < inf:
            dydt[0] = nan  # the run must not go on, whatever a driven part makes of this output


@njit
def outputs_for_events(t, y, out, handle, g):
    """Write the outputs of all blocks, which sources of networks follow, for event functions; g is not used."""
    tables = open_blocks(handle)
    read_sensors(t, y, out, tables)
    write_outputs(t, y, out, tables, 1)


@njit
def control_events(t, y, out, handle, g):
    """Write the event functions of all blocks to g, from solved nodes."""
    tables = open_blocks(handle)
    controls = tables.controls
    applied = tables.applied
    none = tables.armed[:0]
    read_sensors(t, y, out, tables)
    write_outputs(t, y, out, tables, 1)
    for k in range(controls.size):
        control = controls[k]
        hook, flag = tables.block_hooks[control["hooks"], SWITCH], control["flag"]
        if hook != 0 and control["period"] == 0.0:
            call_switch(hook, t, y, tables, control, g)
        if flag >= 0:
            v = applied[controls.size + k]
            # Distances to both limits before they act: they set the flags that `limited` reads.
            is_low(v - control["least"], 0.0, flag, none, g)
            is_low(control["greatest"] - v, 2.0, flag, none, g)


@njit(forceinline=True)
def next_sample(tables, control):
    """Time of the next sample of a block [s], counted from the start, so that no rounding adds up."""
    count = tables.discrete[control["memory"] + 1]
    return tables.settings[0]["start"] + control["offset"] + count * control["period"]


@njit(forceinline=True)
def is_due(t, tables, control):
    """True if a block acts at a sample at the time t, but for rounding."""
    later = t + sample_rounding(t, control)
    return control["period"] > 0.0 and next_sample(tables, control) <= later


@njit(forceinline=True)
def sample_rounding(t, control):
    """Greatest difference of the times of a sample and of a state or row by rounding [s]."""
    return SAMPLE_ROUNDING * (abs(t) + control["period"])


@njit
def let_breaks_arrive(t, tables):
    """Let the breaks that are due at the time t arrive at blocks with a delay that act at all times; True if any do.

    Samples are then taken after these outputs have changed.
    """
    found = False
    for k in range(tables.controls.size):
        control = tables.controls[k]
        if (
            control["delay"] > 0.0
            and control["period"] == 0.0
            and break_arrives(tables.histories, control, t)
        ):
            admit_breaks(tables, k, t)
            found = True
    return found


@njit
def take_samples(t, y, out, handle, values):
    """At a time at which a sample is due (STATUS is ARRIVED), let the blocks act, in the order of their table."""
    tables = open_blocks(handle)
    controls, discrete = tables.controls, tables.discrete
    # Breaks arrive first; samples follow when this state has been evaluated again.
    if out[STATUS] != ARRIVED or let_breaks_arrive(t, tables):
        return
    read_sensors(t, y, out, tables)
    for k in range(controls.size):
        control = controls[k]
        if is_due(t, tables, control):
            # Breaks of its delayed input that are due take effect before it acts.
            if control["delay"] > 0.0:
                admit_breaks(tables, k, t)
            # A sample is a jump of the output, which no history may interpolate across.
            if tables.histories.size > 0:
                set_breaks(tables, k, t, JUMP)
            sample = tables.block_hooks[control["hooks"], SAMPLE]
            if sample != 0:
                v = call_sample(sample, t, y, tables, control)
            else:
                v = call_decide(tables.block_hooks[control["hooks"], DECIDE], t, y, tables, control)
            discrete[control["memory"]] = clipped(v, control)
            discrete[control["memory"] + 1] += 1.0
            apply_output(t, tables, k, discrete[control["memory"]])


@njit
def record_controls(t, y, out, handle, values):
    """Store the inputs of blocks with a delay, and write the time of the next sample or break to out[ARRIVES].

    A break is that of the input of a block with a delay. The time is t if it is now, and that of a jump of a delay line
    if this comes first. A sample or break at the end of a segment of the run acts at the start of the next one, after a
    jump of a schedule there.
    """
    tables = open_blocks(handle)
    record_inputs(t, out, tables)
    arrives = out[ARRIVES] if tables.settings[0]["arrivals"] == 1 else NEVER
    ends = t >= tables.clock[0]["limit"]
    out[LAST_ROW] = NEVER
    for k in range(tables.controls.size):
        control = tables.controls[k]
        # Output rows at the time of a sample are those before it.
        if is_due(t, tables, control):
            out[LAST_ROW] = max(out[LAST_ROW], t + sample_rounding(t, control))
        if control["period"] > 0.0 and not (ends and is_due(t, tables, control)):
            time = t if is_due(t, tables, control) else next_sample(tables, control)
            arrives = time if arrives == NEVER else min(arrives, time)
        elif control["delay"] > 0.0 and awaits_break(tables.histories, control):
            is_now = break_arrives(tables.histories, control, t)
            if not (ends and is_now):
                time = t if is_now else next_break(tables.histories, control)
                arrives = time if arrives == NEVER else min(arrives, time)
    out[ARRIVES] = arrives


@njit
def restore_outputs(t, y, out, handle, values):
    """Write the outputs of blocks at this state to `applied`, before other functions read schedules."""
    tables = open_blocks(handle)
    for k in range(tables.controls.size):  # there is none behind the handle of the sensors
        tables.applied[k] = applied_output(
            tables.controls[k], out[tables.block_settings[0]["outputs"] + 2 * k]
        )


@njit
def observe_controls(t, y, out, handle, values):
    """Write output, input or error of blocks to `values`."""
    tables = open_blocks(handle)
    controls, at = tables.controls, tables.block_settings[0]["outputs"]
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == BLOCK_VALUE:
            i = probe["index"]
            if probe["side"] == OUTPUT:
                values[k] = out[at + 2 * i]
            elif probe["side"] == INPUT:
                values[k] = out[at + 2 * i + 1]
            else:
                values[k] = schedule_value(tables, controls[i]["setpoint"], t) - out[at + 2 * i + 1]
