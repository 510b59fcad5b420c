"""What the law of each kind of device is made of, one entry a part. Knows names; `loops` makes loops of them."""

from dataclasses import dataclass

from fvsolve.kernels.devices import codes


@dataclass(frozen=True)
class Law:
    """Calls as `module: function(arguments)`, "" for none; all have `device`, its row, and the tables open.

    set : before nodes are closed, conductances, speeds, pressures and stiffness of vessels, from (t, y) and flags alone
    move : after, d/dt of what it holds where dydt.size > 0, and its greatest rate into out[RATE]
    events : its event functions into g, from a state whose nodes are closed
    value : its quantity number `which`; outside : 1 where its law is not to be trusted, or PASSING
    power : (supplied, rate of what it stores, dissipated) beside its restriction [W]; stored : since the profile [J]
    """

    set: str = ""
    move: str = ""
    events: str = ""
    value: str = ""
    outside: str = ""
    power: str = ""
    stored: str = ""


REGULATOR = Law(
    set="regulator: set_regulator(y, out, tables, device)",
    move="regulator: move_regulator(t, y, dydt, out, tables, device)",
    events="regulator: regulator_events(t, y, out, tables, device, g)",
    value="regulator: regulator_value(y, tables, device)",
)
DISC = Law(
    set="disc: set_disc(y, out, tables, device)",
    move="disc: move_disc(y, dydt, out, tables, device)",
    events="disc: disc_events(y, out, tables, device, g)",
    value="disc: disc_value(y, tables, device)",
)
LAWS = {
    codes.CHECK_VALVE: Law(
        set="check_valve: set_check_valve(out, tables, device)",
        events="check_valve: check_valve_events(out, tables, device, g)",
        value="check_valve: check_valve_value(out, tables, device)",
    ),
    codes.REDUCING: REGULATOR,
    codes.SUSTAINING: REGULATOR,
    codes.FLOW_CONTROL: REGULATOR,
    codes.PUMP: Law(
        set="pump: set_pump(t, y, out, tables, device)",
        move="pump: move_pump(t, dydt, out, tables, device)",
        events="pump: pump_events(out, tables, device, g)",
        value="pump: pump_value(out, tables, device, which)",
        outside="pump: pump_outside(out, tables, device)",
        power="pump: pump_powers(t, y, dydt, out, tables, device)",
        stored="pump: shaft_energy(y, tables, device)",
    ),
    codes.RELIEF: Law(
        set="relief: set_relief(out, tables, device)",
        events="relief: relief_events(out, tables, device, g)",
        value="relief: relief_opening(out, tables, device)",
    ),
    codes.RELIEF_DISC: DISC,
    codes.CHECK_DISC: DISC,
    codes.ACCUMULATOR: Law(
        set="accumulator: set_accumulator(y, out, tables, device)",
        events="accumulator: accumulator_events(y, tables, device, g)",
        value="accumulator: accumulator_value(y, tables, device, which)",
        power="accumulator_energy: accumulator_power(dydt, out, tables, device)",
        stored="accumulator_energy: accumulator_stored(y, tables, device)",
    ),
    codes.AIR_VALVE: Law(
        set="air_valve: set_air_valve(y, out, tables, device)",
        move="air_valve: move_air_valve(y, dydt, out, tables, device)",
        events="air_valve: air_valve_events(y, out, tables, device, g)",
        value="air_valve: air_valve_value(y, tables, device, which)",
        power="air_valve_energy: air_power(y, dydt, out, tables, device)",
        stored="air_valve_energy: air_stored(y, tables, device)",
    ),
}
