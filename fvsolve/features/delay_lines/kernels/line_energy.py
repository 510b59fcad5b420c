"""Power and stored energy of delay lines, from sent waves.

Delay lines, from the waves sent into them: a stretch of travel time tau contains the waves sent into it at ages u of 0
.. tau: the forward wave R at the distance u c from its beginning, the backward wave L at u c from its end; c is the
wave speed. Beyond the middle of the stretch the forward wave is smaller by delta, the friction loss there, and the
backward wave is larger by delta.

In units of 1 / (rho A) per length, with density rho and area A, the stretch stores
R^2 + L^2 + (q0 + M0) R + (q0 - M0) L above the initial steady state. M0 is its mass flow, q0 = Y P0 its potential P0 =
p - p_ambient + rho g z times the admittance Y; q0 falls along the line by drag0 times the travel time. The power that
enters at the ends is stored or taken. The part taken is (drag(M) - drag0) M times the length of the stretch, with the
flow M in its middle, plus drag0 times the integral of M. It is the power of friction, drag(M) M times the length, plus
the error of the midpoint rule for falling q0.

A line shorter than a step h stores the fraction 1 - beta of the waves sent in h, beta = 1 - tau / h. It takes
beta (1 - beta) c (s - s_h)^2 of each wave s; s_h is the wave sent h before.
"""

from fvsolve.core.kernels.network_energy import NODE, PIPE
from fvsolve.core.kernels.pipe_energy import GAUSS_POINTS, GAUSS_WEIGHTS
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.line_rates import friction_loss, sent_wave
from fvsolve.features.delay_lines.kernels.tables import open_lines
from fvsolve.jit import njit


@njit
def power_lines(t, y, dydt, out, handle, rows):
    """Write the powers of all delay lines except the inflow [W] to the entries of their pipes."""
    tables = open_lines(handle)
    for number in range(tables.delays.size):
        at = NODE * tables.nodes.size + PIPE * tables.delays[number]["pipe"]
        line_power(t, out, tables, number, rows[at : at + PIPE])


@njit
def stored_lines(t, y, dydt, out, handle, rows):
    """Write the energy changes of all delay lines since the start [J] to the entries of their pipes."""
    tables = open_lines(handle)
    for number in range(tables.delays.size):
        at = tables.nodes.size + 2 * tables.delays[number]["pipe"]
        line_energy(t, out, tables, number, rows[at : at + 2])


@njit
def sent_waves(t, out, tables, number, q, at):
    """Both waves sent into stretch q of delay line `number` at a time `at` <= t: (forward, backward) [kg/s].

    `at` may lie in the step that ends at t, see `sent_wave`. out : values of the right-hand side at t
    """
    past, newest = tables.past, int(tables.past[history.COUNT]) - 1
    if newest >= 0 and (at <= history.time_of(past, newest) or t <= history.time_of(past, newest)):
        places, clock = history.offsets_of(past), history.reading_data(past, newest)
        return history.read_waves(past, places, clock, tables.delays[number], q, at)
    return sent_wave(t, out, tables, number, q, 0, at), sent_wave(t, out, tables, number, q, 1, at)


@njit
def kink_before(past, places, line, q, t, least):
    """Latest time before t at which a wave sent into stretch q may have a kink or jump [s]; at least `least`.

    Kinks may be at entries.
    """
    latest, before = least, t - history.time_tolerance(past)
    k, x = history.find_interval(past, int(past[history.COUNT]) - 1, before)
    k += x == 1.0
    if k >= history.PROFILE_ENTRIES and history.time_of(past, k) < before:
        latest = max(latest, history.time_of(past, k))
    # Jumps are sent between entries too.
    for wave in range(2):
        at = history.jump_head(places, line["stretch"] + q, wave)
        for i in range(int(past[at + history.JUMP_COUNT])):
            time = past[history.jump_place(past, places, at, i)]
            if time < before:
                latest = max(latest, time)
    return latest


@njit
def stretch_integrals(t, out, tables, number, q):
    """(integral of R - L [kg m/s], energy of R, energy of L [kg2 m/s2]) in stretch q of delay line `number` at t.

    R, L : forward and backward wave [kg/s]; out : values of the right-hand side at t
    The energies are those above the initial steady state, multiplied by density times area [kg/m], see the module. A
    line with a travel time tau below the step h stores the fraction tau / h of the waves sent in h. There the integrals
    are those of the waves sent in h; the energies are multiplied by tau / h, the first result by (tau / h)^2.
    """
    past = tables.past
    line = tables.delays[number]
    st = tables.settings[0]
    pipe = tables.pipes[line["pipe"]]
    places = history.offsets_of(past)
    hold = line["hold"]
    share = 1.0 - line["now"]
    first, flow = tables.nodes[pipe["from_node"]], pipe["flow"]
    height = st["rho"] * st["gravity"] * (first["elevation"] - st["datum"])
    fall = pipe["drag"] * line["tau"]  # decrease of q0 along a stretch
    top = pipe["admittance"] * ((first["pressure"] - st["ambient"]) + height) - fall * q
    net, ahead, back = 0.0, 0.0, 0.0
    end = t
    oldest = t - hold + history.time_tolerance(past)
    middle = t - 0.5 * hold
    # Pieces end at kinks, and in the middle where friction acts, so that quadrature sees smooth waves.
    while end > oldest:
        least = middle if end > middle + history.time_tolerance(past) else t - hold
        begin = kink_before(past, places, line, q, end, least)
        for g in range(3):
            at = end + (GAUSS_POINTS[g] - 0.5) * (end - begin)
            r, l = sent_waves(t, out, tables, number, q, at)
            x, w = (t - at) / hold, GAUSS_WEIGHTS[g] * (end - begin) * (pipe["speed"] * share)
            # Older than half of the travel time: both waves have passed the friction in the middle.
            if share == 1.0 and at < middle:
                delta = friction_loss(pipe, line, r, l)
                r, l = r - delta, l + delta
            net += w * share * (r - l)
            ahead += w * r * (r + (top - fall * x) + flow)
            back += w * l * (l + (top - fall * (1.0 - x)) - flow)
        end = begin
    return net, ahead, back


@njit
def line_energy(t, out, tables, number, rows):
    """Write the change of the energy stored in delay line `number` since the start [J], in two parts.

    rows[0] : receives the part of the forward wave; rows[1] : that of the backward wave
    """
    line, rows[0], rows[1] = tables.delays[number], 0.0, 0.0
    per = 1.0 / (tables.settings[0]["rho"] * tables.pipes[line["pipe"]]["area"])
    for q in range(line["stretches"]):
        _, ahead, back = stretch_integrals(t, out, tables, number, q)
        rows[0] += per * ahead
        rows[1] += per * back


@njit
def line_power(t, out, tables, number, rows):
    """Write friction power, 0 and rate of storage of delay line `number` [W] into rows[1:4].

    rows[0] : power that enters at the ends of the line, set before
    """
    line = tables.delays[number]
    pipe = tables.pipes[line["pipe"]]
    beta = line["now"]
    at = tables.layout[0]["ends"] + 4 * line["pipe"]
    per, length = 1.0 / (tables.settings[0]["rho"] * pipe["area"]), pipe["speed"] * line["tau"]
    friction, taken = 0.0, 0.0
    for q in range(line["stretches"]):
        # Friction acts on the waves in the middle, sent half a travel time ago; in a short line a step ago.
        r, l = sent_waves(
            t, out, tables, number, q, t - (line["hold"] if beta > 0.0 else 0.5 * line["tau"])
        )
        delta = friction_loss(pipe, line, r, l)
        flow = pipe["flow"] + (r - l - delta)
        pull = drag(
            pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], flow
        )
        friction += length * flow * pull
        taken += length * (pull - pipe["drag"]) * flow
        mean = 0.0
        # Only an initial drag lets q0 fall along the line; its part of the power needs the mean flow.
        if pipe["drag"] != 0.0:
            mean = stretch_integrals(t, out, tables, number, q)[0] / length
        # A line shorter than a step takes energy from each wave, beta (1 - beta) c (s - s_h)^2.
        if beta > 0.0:
            ahead, back = out[at] - r, out[at + 3] - l
            mean += beta * (out[at] - out[at + 3]) - delta
            taken += beta * (1.0 - beta) * pipe["speed"] * (ahead * ahead + back * back)
            taken += length * (pull - pipe["drag"]) * beta * (ahead - back)
        taken += length * pipe["drag"] * (pipe["flow"] + mean)
    rows[1], rows[2], rows[3] = per * friction, 0.0, rows[0] - per * taken
