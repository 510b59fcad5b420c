"""Networks of potential and flow: rates of their stores, probes, event functions of switches, and power.

All quantities are linear in the states and in sources. A row has a value at the start and coefficients: value + sum of
coefficient times change. The rows of rates come first, in the order of `network_rates`.
The sources are schedules, quantities of devices, forces on masses, torques of friction and heat. Heat from the fluid is
known only after the scalars are mixed; `network_rates` then runs again.
`network_places` contains for each row the offsets of its first entry, of its first entry for a source, and of the entry
after its last; then for each entry the place of its state in y, or the number of its source.
`network_factors` contains the value of each row at the start, then the coefficient of each entry. A switch, diode or
friction that changes its state changes both arrays.
"""

from math import exp

from fvsolve.core.kernels import calls
from fvsolve.core.kernels.devices import SET, VALUE
from fvsolve.core.kernels.energy_rows import device_power_row, device_stored_row
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.features.networks.kernels.tables import open_networks
from fvsolve.jit import njit
from fvsolve.parts import law_elements as codes

TINY = 1e-300  # in place of a zero of an event function
CLOSED = 0.5  # value of `closed` above which a switch is closed


@njit(forceinline=True)
def row_change(y, out, tables, r):
    """Change of row r since the start."""
    places = tables.network_places
    factors = tables.network_factors
    inputs = tables.network_settings[0]["inputs"]
    first = places[3 * r]
    middle = places[3 * r + 1]
    last = places[3 * r + 2]
    rows = places[0] // 3
    # Entries follow three offsets for each row in `places`, and one value for each row in `factors`.
    change, shift = 0.0, rows - places[0]
    for k in range(first, middle):
        change += factors[k + shift] * y[places[k]]
    for k in range(middle, last):
        change += factors[k + shift] * out[inputs + places[k]]
    return change


@njit(forceinline=True)
def row_value(y, out, tables, r):
    """Value of row r."""
    return tables.network_factors[r] + row_change(y, out, tables, r)


@njit
def known_potential(t, y, tables, r):
    """Value of row r that depends on stores and schedules alone, before sources are written to `out`."""
    places, factors = tables.network_places, tables.network_factors
    first = places[3 * r]
    middle = places[3 * r + 1]
    last = places[3 * r + 2]
    shift = places[0] // 3 - places[0]
    value = factors[r]
    for k in range(first, middle):
        value += factors[k + shift] * y[places[k]]
    for k in range(middle, last):
        source = tables.network_inputs[places[k]]
        # Other sources are not known yet and count as unchanged.
        if source["kind"] == codes.SCHEDULE_INPUT:
            given = source["sign"] * schedule_value(tables, source["index"], t)
            value += factors[k + shift] * (given - source["start"])
    return value


@njit(forceinline=True)
def slip_direction(tables, switch):
    """1 or -1 while dry friction slips, 0 while it sticks."""
    armed, flag = tables.armed, switch["flag"]
    return 1.0 if armed[flag] > 0.0 else -1.0 if armed[flag + 2] > 0.0 else 0.0


@njit(forceinline=True)
def slipping_torque(t, y, out, tables, switch):
    """Torque of dry friction that slips; 0 while it sticks."""
    direction = slip_direction(tables, switch)
    if direction == 0.0:
        return 0.0
    if switch["schedule"] >= 0:
        return direction * schedule_value(tables, switch["schedule"], t)
    torque = switch["kinetic"]
    # Stribeck curve: from static to kinetic friction as the slip grows.
    if switch["stribeck"] > 0.0:
        share = row_value(y, out, tables, switch["drop"]) / switch["stribeck"]
        torque += (switch["static"] - switch["kinetic"]) * exp(-share * share)
    return direction * torque


@njit(forceinline=True)
def torque_at_rest(t, tables, switch):
    """Greatest torque of dry friction that sticks."""
    if switch["schedule"] >= 0:
        return switch["factor"] * schedule_value(tables, switch["schedule"], t)
    return switch["static"]


@njit
def element_power(y, out, tables, element):
    """Power into an element [W]; of a thermal element the heat that it takes up."""
    flow = row_value(y, out, tables, element["flow"])
    # The flow of a thermal element is a power itself, which no drop multiplies.
    if element["thermal"] == 1:
        return element["weight"] * flow
    return row_value(y, out, tables, element["drop"]) * flow


@njit
def write_sources(t, y, out, core, tables):
    """Write the changes of all sources since the start to `out`. core : open tables of the model alone"""
    inputs, at = tables.network_inputs, tables.network_settings[0]["inputs"]
    for j in range(inputs.size):
        source = inputs[j]
        kind, i = source["kind"], source["index"]
        if kind == codes.SCHEDULE_INPUT:
            value = schedule_value(tables, i, t)
        elif kind == codes.DEVICE_INPUT:
            device = core.devices[i]
            value = calls.call_value(
                core.hooks[device["hooks"], VALUE], t, y, out, core, device, source["side"]
            )
        elif kind == codes.FORCE_INPUT:
            value = out[tables.layout[0]["net_force"] + i]
        elif kind == codes.FLUID_HEAT:
            value = out[tables.layout[0]["exchange"] + 2 * i + 1]
        elif kind == codes.FRICTION_FLOW:
            value = slipping_torque(t, y, out, tables, tables.network_switches[i])
        else:
            value = element_power(y, out, tables, tables.network_elements[i])
        out[at + j] = source["sign"] * value - source["start"]


@njit
def network_rates(t, y, dydt, out, handle):
    """Write all sources to `out`, and the rates of stores to `dydt`."""
    tables = open_networks(handle)
    # Sources also without rates to write: probes read them.
    write_sources(t, y, out, open_tables(handle), tables)
    rates = tables.network_rates
    if dydt.size > 0:
        for r in range(rates.size):
            dydt[rates[r]["y"]] = row_value(y, out, tables, r)


@njit
def known_sources(t, y, dydt, out, handle):
    """Write all sources to `out` before blocks decide that read them."""
    tables = open_networks(handle)
    if tables.settings[0]["reads_solved"] == 1:
        write_sources(t, y, out, open_tables(handle), tables)


@njit
def write_temperatures(y, out, tables):
    """Write the temperatures of the thermal nodes of heat exchangers, in the unit of the scalar, to `out`."""
    rows, at = tables.thermal_rows, tables.layout[0]["exchange"]
    zero = tables.network_settings[0]["zero"]
    for k in range(rows.size):
        out[at + 2 * k] = row_value(y, out, tables, rows[k]) - zero


@njit
def node_temperatures(t, y, dydt, out, handle):
    """Write the temperatures of the thermal nodes of heat exchangers, before the scalars are mixed."""
    write_temperatures(y, out, open_networks(handle))


@njit
def turn_shafts(t, y, dydt, out, handle):
    """Write the speeds of shafts that laws of devices read before the nodes are solved."""
    tables = open_networks(handle)
    turned, at = tables.turned, tables.layout[0]["shaft"]
    for k in range(turned.size):
        out[at + k] = known_potential(t, y, tables, turned[k])


@njit
def drive_shafts(t, y, dydt, out, handle):
    """Write the speeds of shafts that follow blocks, and set the devices on them again."""
    turn_shafts(t, y, dydt, out, handle)
    devices, tables = open_networks(handle).turned_devices, open_tables(handle)
    for k in range(devices.size):
        device = tables.devices[devices[k]]
        calls.call_set(tables.hooks[device["hooks"], SET], t, y, out, tables, device)


@njit(forceinline=True)
def network_power_row(tables, power):
    """Index of the first entry of elements of networks in `power`."""
    first = device_power_row(tables, power) - tables.layout[0]["feature_power"]
    return first - tables.network_elements.size


@njit(forceinline=True)
def network_stored_row(tables, stored):
    """Index of the first entry of elements of networks in `stored`."""
    first = device_stored_row(tables, stored) - tables.layout[0]["feature_stored"]
    return first - tables.network_elements.size


@njit
def observe_networks(t, y, out, handle, values):
    """Write the values of the probes of networks to `values`."""
    tables = open_networks(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == codes.NETWORK_VALUE:
            i, side = probes[k]["index"], probes[k]["side"]
            if side == codes.LOCKED:
                # Dry friction is locked while neither direction of slip is active.
                value = 0.0 if tables.armed[i] + tables.armed[i + 2] > 0.0 else 1.0
            else:
                value = row_value(y, out, tables, i)
            if side == codes.POWER:
                value *= row_value(y, out, tables, probes[k]["cell"])
            elif side == codes.ENTROPY:
                # Flow of entropy: flow of heat over temperature.
                value = row_value(y, out, tables, probes[k]["cell"]) / value
            elif side == codes.NET_PUSH:
                value = out[tables.layout[0]["push"] + probes[k]["cell"]] - value
            values[k] = probes[k]["scale"] * value + 0.0  # no negative zero


@njit
def sources_for_events(t, y, out, handle, g):
    """Write all sources to `out` before event functions are evaluated; g is not used."""
    tables = open_networks(handle)
    write_sources(t, y, out, open_tables(handle), tables)
    write_temperatures(y, out, tables)


@njit
def sources_again(t, y, out, handle, g):
    """Write all sources to `out` once more, after features have set the schedules that they follow; g is not used."""
    tables = open_networks(handle)
    write_sources(t, y, out, open_tables(handle), tables)
    write_temperatures(y, out, tables)


@njit(forceinline=True)
def write_pair(g, flag, left):
    """Write an event function and its negative."""
    g[flag], g[flag + 1] = left, -left


@njit
def friction_events(t, y, out, tables, switch, g):
    """Write the event functions of dry friction: slip forward, slip backward, each with its negative.

    While it slips they are minus the slip, while it sticks what is left until the torque exceeds its greatest value.
    """
    flag, slip = switch["flag"], row_value(y, out, tables, switch["drop"])
    direction = slip_direction(tables, switch)
    forward = backward = 1.0
    if direction != 0.0 and abs(slip) <= switch["rounding"]:
        slip = direction * TINY  # it begins to slip
    if direction > 0.0:
        forward = -slip
    elif direction < 0.0:
        backward = slip
    else:
        # Neither function of a pair may be exactly zero: both would count as crossed.
        most, torque = torque_at_rest(t, tables, switch), row_value(y, out, tables, switch["flow"])
        forward = most - torque if torque != most else TINY
        backward = most + torque if torque != -most else TINY
    write_pair(g, flag, forward)
    write_pair(g, flag + 2, backward)


@njit
def switch_events(t, y, out, handle, g):
    """Write the event functions of all switches, diodes and dry frictions to g."""
    tables = open_networks(handle)
    for k in range(tables.network_switches.size):
        switch = tables.network_switches[k]
        if switch["kind"] == codes.FRICTION:
            friction_events(t, y, out, tables, switch, g)
            continue
        if switch["kind"] == codes.SWITCH:
            left = CLOSED - schedule_value(tables, switch["schedule"], t)
        elif tables.armed[switch["flag"]] > 0.0:
            # A diode that conducts blocks when its flow changes sign.
            left = -row_value(y, out, tables, switch["flow"]) - switch["rounding"]
        else:
            # A diode that blocks conducts when the drop exceeds its forward drop.
            left = switch["forward"] - row_value(y, out, tables, switch["drop"])
        write_pair(g, switch["flag"], left if left != 0.0 else TINY)


@njit
def power_networks(t, y, dydt, out, handle, power):
    """Write the power into each element of a network [W] to `power`; of a source the power that it supplies."""
    tables = open_networks(handle)
    elements, first = tables.network_elements, network_power_row(tables, power)
    for k in range(elements.size):
        into = element_power(y, out, tables, elements[k])
        power[first + k] = -into if elements[k]["category"] == codes.SUPPLIED else into


@njit
def stored_networks(t, y, dydt, out, handle, stored):
    """Write the change of the energy in each element since the start [J] to `stored`."""
    tables = open_networks(handle)
    elements, first = tables.network_elements, network_stored_row(tables, stored)
    for k in range(elements.size):
        element, energy = elements[k], 0.0
        if element["capacity"] > 0.0:
            # A product of change and mean value: no difference of large energies.
            change = row_change(y, out, tables, element["drop"])
            level = 1.0 if element["thermal"] == 1 else element["start"] + 0.5 * change
            energy = element["capacity"] * change * level
        elif element["inertance"] > 0.0:
            # Inertance: I (q^2 - q_0^2) / 2 of its flow q, in the same form.
            change = row_change(y, out, tables, element["flow"])
            energy = element["inertance"] * change * (element["start"] + 0.5 * change)
        stored[first + k] = energy
