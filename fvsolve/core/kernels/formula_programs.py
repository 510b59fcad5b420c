"""Formulas as programs: a stack machine that computes the value of a formula of time and of inputs, and its slopes.

A program has a header row in `pieces`, then a row for each step with its code and a number. The header has the columns
start, kind, number of steps, scale, offset, first event flag. The result is scale times the value plus offset.
A comparison, `abs`, `min` or `max` of anything but the time and a number has two event functions, the difference of its
sides and the negative of this difference. On accepted states they set its flags, which select a side within a step.
"""

from math import atan2, cos, exp, hypot, log, sin, sqrt, tan, tanh

from fvsolve.jit import njit

(
    CONSTANT,
    TIME,
    INPUT,
    ADD,
    SUBTRACT,
    MULTIPLY,
    DIVIDE,
    POWER_OF,
    NEGATE,
    SINE,
    COSINE,
    TANGENT,
    ARCTANGENT,
    EXPONENTIAL,
    LOGARITHM,
    ROOT,
    TANH,
    HYPOTENUSE,
    WHERE,
    BEFORE,
    AFTER,
    ABSOLUTE,
    LEAST,
    GREATEST,
    LESS,
    MORE,
) = range(26)
TIE = 1e-300  # value of the second event function of a kink if its sides are equal
FIRST_KINK = ABSOLUTE  # codes from here on have flags
STEPS, SCALE, OFFSET, FLAG = 2, 3, 4, 5  # columns of the header


@njit(forceinline=True)
def is_low(e, number, flag, armed, g):
    """True if the difference e of the sides of a kink counts as not above zero: by its flag, or by its sign if none.

    number : its first flag after `flag`; armed : flags, or empty; g : receives e and -e unless it is empty
    """
    at = flag + int(number)
    if g.size > 0:
        g[at], g[at + 1] = e, -e if e != 0.0 else TIE  # so that exactly one of them is positive
    return armed[at] > 0.0 if armed.size > 0 else e <= 0.0


@njit
def run_program(pieces, first, t, limit, base, stack, armed, g):
    """Value of a formula at time t [s]; from time `limit` on, its left limit there.

    first : header row in `pieces`; base : number of inputs, which stack[:base] contains; stack : work array
    armed, g : as for `is_low`
    """
    flag = int(pieces[first, FLAG])
    k = base
    time = min(t, limit)
    for i in range(first + 1, first + 1 + int(pieces[first, STEPS])):
        code, number = int(pieces[i, 1]), pieces[i, 2]
        if code == CONSTANT:
            stack[k] = number
            k += 1
        elif code == TIME:
            stack[k] = time
            k += 1
        elif code == INPUT:
            stack[k] = stack[int(number)]
            k += 1
        elif code == ADD:
            k -= 1
            stack[k - 1] += stack[k]
        elif code == SUBTRACT:
            k -= 1
            stack[k - 1] -= stack[k]
        elif code == MULTIPLY:
            k -= 1
            stack[k - 1] *= stack[k]
        elif code == DIVIDE:
            k -= 1
            stack[k - 1] /= stack[k]
        elif code == POWER_OF:
            k -= 1
            stack[k - 1] = stack[k - 1] ** stack[k]
        elif code == NEGATE:
            stack[k - 1] = -stack[k - 1]
        elif code == BEFORE:
            # At a time of switching that ends the segment, the value before it still holds.
            stack[k] = 0.0 if time > number or (time == number and limit > number) else 1.0
            k += 1
        elif code == AFTER:
            stack[k] = 1.0 if time > number or (time == number and limit > number) else 0.0
            k += 1
        elif code == WHERE:
            # On the stack: condition, value where it holds, value elsewhere.
            k -= 2
            if stack[k - 1] == stack[k - 1]:  # else NaN, which stays
                stack[k - 1] = stack[k] if stack[k - 1] != 0.0 else stack[k + 1]
        elif code >= FIRST_KINK:
            k = kink(code, number, k, flag, stack, armed, g)
        else:
            k = call_function(code, k, stack)
    return pieces[first, SCALE] * stack[base] + pieces[first, OFFSET]


@njit
def kink(code, number, k, flag, stack, armed, g):
    """Replace the last values on the stack of k values by `abs`, `min`, `max` or a comparison; returns the new k.

    The result is NaN if a value is.
    """
    if code == ABSOLUTE:
        stack[k - 1] = (
            -stack[k - 1] if is_low(stack[k - 1], number, flag, armed, g) else stack[k - 1]
        )
        return k
    k -= 1
    e = stack[k - 1] - stack[k]
    low = is_low(e, number, flag, armed, g)
    if e != e:
        stack[k - 1] = e
    elif code == LEAST:
        stack[k - 1] = stack[k - 1] if low else stack[k]
    elif code == GREATEST:
        stack[k - 1] = stack[k] if low else stack[k - 1]
    elif code == LESS:
        stack[k - 1] = 1.0 if low else 0.0
    else:
        stack[k - 1] = 0.0 if low else 1.0
    return k


@njit
def call_function(code, k, stack):
    """Replace the last values on the stack of k values by a function of them; returns the new k."""
    x = stack[k - 1]
    if code == SINE:
        stack[k - 1] = sin(x)
    elif code == COSINE:
        stack[k - 1] = cos(x)
    elif code == TANGENT:
        stack[k - 1] = tan(x)
    elif code == EXPONENTIAL:
        stack[k - 1] = exp(x)
    elif code == LOGARITHM:
        stack[k - 1] = log(x)
    elif code == ROOT:
        stack[k - 1] = sqrt(x)
    elif code == TANH:
        stack[k - 1] = tanh(x)
    else:
        k -= 1
        stack[k - 1] = atan2(stack[k - 1], x) if code == ARCTANGENT else hypot(stack[k - 1], x)
    return k


@njit
def program_slopes(pieces, first, t, limit, stack):
    """(first, second) derivative by time of a formula of time without kinks at time t [per s, per s2].

    The stack has value and both derivatives of each entry.
    """
    k, time = 0, min(t, limit)
    for i in range(first + 1, first + 1 + int(pieces[first, STEPS])):
        code, number = int(pieces[i, 1]), pieces[i, 2]
        if code in (CONSTANT, TIME, BEFORE, AFTER):
            # Between switching times all of them but the time are constants without slopes.
            after = time > number or (time == number and limit > number)
            stack[k], stack[k + 1], stack[k + 2] = number, 0.0, 0.0
            if code == TIME:
                stack[k], stack[k + 1] = time, 1.0
            elif code != CONSTANT:
                stack[k] = 1.0 if after == (code == AFTER) else 0.0
            k += 3
        elif code == WHERE:
            # The chosen value keeps its slopes: a condition is constant between switching times.
            k -= 6
            source = k if stack[k - 3] != 0.0 else k + 3
            for j in range(3):
                stack[k - 3 + j] = stack[source + j]
        elif code in (NEGATE, SINE, COSINE, TANGENT, EXPONENTIAL, LOGARITHM, ROOT, TANH):
            slope_of_function(code, k, stack)
        else:
            k -= 3
            slope_of_pair(code, k, stack)
    return pieces[first, SCALE] * stack[1], pieces[first, SCALE] * stack[2]


@njit
def slope_of_function(code, k, stack):
    """Replace value and derivatives in stack[k - 3:k] by those of a function of a single argument."""
    x = stack[k - 3]
    dx = stack[k - 2]
    ddx = stack[k - 1]
    if code == NEGATE:
        f, df, ddf = -x, -1.0, 0.0
    elif code == SINE:
        f = sin(x)
        df = cos(x)
        ddf = -sin(x)
    elif code == COSINE:
        f = cos(x)
        df = -sin(x)
        ddf = -cos(x)
    elif code == TANGENT:
        f = tan(x)
        df, ddf = 1.0 + f * f, 2.0 * f * (1.0 + f * f)
    elif code == EXPONENTIAL:
        f = df = ddf = exp(x)
    elif code == LOGARITHM:
        f = log(x)
        df = 1.0 / x
        ddf = -1.0 / (x * x)
    elif code == ROOT:
        f = sqrt(x)
        df, ddf = 0.5 / f, -0.25 / (f * x)
    else:
        f = tanh(x)
        df, ddf = 1.0 - f * f, -2.0 * f * (1.0 - f * f)
    # Chain rule: f(x)'' = f''(x) x'^2 + f'(x) x''.
    stack[k - 3], stack[k - 2], stack[k - 1] = f, df * dx, ddf * dx * dx + df * ddx


@njit
def slope_of_pair(code, k, stack):
    """Replace value and derivatives in stack[k - 3:k] by those of a function of this entry and the entry after it."""
    x = stack[k - 3]
    dx = stack[k - 2]
    ddx = stack[k - 1]
    y = stack[k]
    dy = stack[k + 1]
    ddy = stack[k + 2]
    if code == ADD or code == SUBTRACT:
        s = 1.0 if code == ADD else -1.0
        f = x + s * y
        df = dx + s * dy
        ddf = ddx + s * ddy
    elif code == MULTIPLY:
        f = x * y
        df = dx * y + x * dy
        ddf = ddx * y + 2.0 * dx * dy + x * ddy
    elif code == DIVIDE:
        # Quotient rule by derivatives of x = f y: x' = f' y + f y', x'' = f'' y + 2 f' y' + f y''.
        f = x / y
        df = (dx - f * dy) / y
        ddf = (ddx - 2.0 * df * dy - f * ddy) / y
    elif code == POWER_OF and dy == 0.0 and ddy == 0.0:
        # A constant power also has slopes for a negative base, whose logarithm does not exist.
        f, slope = x**y, y * x ** (y - 1.0) if y != 0.0 else 0.0
        df, ddf = slope * dx, slope * ddx
        # For these powers the coefficient is zero, while x^(y - 2) may be infinite.
        if y != 0.0 and y != 1.0:
            ddf += y * (y - 1.0) * x ** (y - 2.0) * dx * dx
    elif code == POWER_OF:
        # Logarithmic derivative: f' = f (y ln x)'.
        f, log_x = x**y, log(x)
        rate = dy * log_x + y * dx / x
        df = f * rate
        ddf = df * rate + f * (ddy * log_x + 2.0 * dy * dx / x + y * (ddx / x - dx * dx / (x * x)))
    elif code == HYPOTENUSE:
        # Derivatives of f^2 = x^2 + y^2.
        f = hypot(x, y)
        df = (x * dx + y * dy) / f
        ddf = (dx * dx + dy * dy + x * ddx + y * ddy - df * df) / f
    else:
        # Derivative of the angle: (x' y - x y') / (x^2 + y^2).
        f, square = atan2(x, y), x * x + y * y
        df = (dx * y - x * dy) / square
        ddf = (ddx * y - x * ddy) / square - df * 2.0 * (x * dx + y * dy) / square
    stack[k - 3], stack[k - 2], stack[k - 1] = f, df, ddf
