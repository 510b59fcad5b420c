"""What steps of every kind share: sums, error norm, dense output, ledgers. Knows arrays; controls nothing."""

from math import sqrt

from fvsolve.jit import njit

HUGE = 1e100  # values beyond it count as not finite


@njit(forceinline=True)
def copy(source, target):
    """target = source, by a plain loop: numba's slice assignment looks for overlaps first."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def combine(y, h, weights, count, k, out):
    """out = y + h sum of weights[j] k[j] over j < count; up to three terms a pass."""
    terms, c, which = 0, (0.0, 0.0, 0.0), (0, 0, 0)
    first = True
    for j in range(count):
        if weights[j] != 0.0:
            if terms == 0:
                c, which = (h * weights[j], 0.0, 0.0), (j, 0, 0)
            elif terms == 1:
                c, which = (c[0], h * weights[j], 0.0), (which[0], j, 0)
            else:
                c, which = (c[0], c[1], h * weights[j]), (which[0], which[1], j)
            terms += 1
            if terms == 3:
                add(y if first else out, c, which, terms, k, out)
                first, terms = False, 0
    if terms > 0:
        add(y if first else out, c, which, terms, k, out)
    elif first:
        copy(y, out)


@njit
def add(y, c, which, terms, k, out):
    """out = y + c0 k0 (+ c1 k1 (+ c2 k2))."""
    k0, k1, k2 = k[which[0]], k[which[1]], k[which[2]]
    c0, c1, c2 = c
    if terms == 1:
        for i in range(out.size):
            out[i] = y[i] + c0 * k0[i]
    elif terms == 2:
        for i in range(out.size):
            out[i] = y[i] + (c0 * k0[i] + c1 * k1[i])
    else:
        for i in range(out.size):
            out[i] = y[i] + (c0 * k0[i] + c1 * k1[i] + c2 * k2[i])


@njit
def error_norm(h, error, k, y, y_new, scale, tolerance):
    """Root mean square of h sum e_j k_j over tolerance (scale + max(|y|, |y_new|))."""
    total = 0.0
    for i in range(y.size):
        e = 0.0
        for j in range(error.size):
            e += error[j] * k[j, i]
        w = h * e / (tolerance * (scale[i] + max(abs(y[i]), abs(y_new[i]))))
        total += w * w
    return sqrt(total / max(y.size, 1))


@njit
def interpolate(theta, h, y, f, y_new, f_new, k, dense, out):
    """Dense output at t + theta h: the method's own polynomial, else the cubic through both ends."""
    if dense.shape[0] > 0:
        copy(y, out)
        for j in range(dense.shape[0]):
            w, power = 0.0, theta
            for m in range(dense.shape[1]):
                w += dense[j, m] * power
                power *= theta
            kj = f if j == 0 else k[j]
            if w != 0.0:
                for i in range(y.size):
                    out[i] += h * w * kj[i]
        return
    s, r = theta, 1.0 - theta
    h00, h01 = r * r * (1.0 + 2.0 * s), s * s * (1.0 + 2.0 * r)
    h10, h11 = h * s * r * r, -h * s * s * r
    for i in range(y.size):
        out[i] = h00 * y[i] + h01 * y_new[i] + (h10 * f[i] + h11 * f_new[i])


@njit
def all_finite(y):
    """False where any value is not finite or its square is not: counted in integers, which is vectorised."""
    bad = 0
    for i in range(y.size):
        bad += not abs(y[i]) < HUGE
    return bad == 0


@njit(forceinline=True)
def add_up(total, part, carry):
    """(total + part, what rounding took off), with what it took off before put back in (Kahan 1965)."""
    whole = part + carry
    new = total + whole
    return new, whole - (new - total)


@njit
def add_stored(h, b, k, y, y_new, stored, carry):
    """Stored masses once more, summed so that a million steps round as one; True where that changed a bit."""
    changed = False
    for q in range(stored.size):
        i, total = stored[q], 0.0
        for j in range(b.size):
            total += b[j] * k[j, i]
        new, carry[q] = add_up(y[i], h * total, carry[q])
        changed = changed or new != y_new[i]
        y_new[i] = new
    return changed


@njit
def book(h, b, supply, ledger):
    """Add a step of length h to the ledger, by the step's own weights; only once its end is known to be sound."""
    count = supply.shape[1]
    for m in range(count):
        total = 0.0
        for i in range(b.size):
            total += b[i] * supply[i, m]
        ledger[m], ledger[count + m] = add_up(ledger[m], h * total, ledger[count + m])
