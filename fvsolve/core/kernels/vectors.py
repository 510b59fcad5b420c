"""Operations on vectors: tuples of three numbers, or three neighbouring numbers of an array.

A longer tuple stands for the vector of its first three numbers. A rotation matrix is stored by rows; it transforms axes
of a body to axes of the world.
"""

from fvsolve.jit import njit


@njit(forceinline=True)
def vector(a, k):
    """Vector at a[k], as a tuple."""
    return a[k], a[k + 1], a[k + 2]


@njit(forceinline=True)
def write_vector(out, k, x, y, z):
    """Write the vector (x, y, z) to out[k]."""
    out[k], out[k + 1], out[k + 2] = x, y, z


@njit(forceinline=True)
def add_vector(out, k, v):
    """Add the vector v to the vector at out[k]."""
    out[k] += v[0]
    out[k + 1] += v[1]
    out[k + 2] += v[2]


@njit(forceinline=True)
def plus(a, b):
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(forceinline=True)
def minus(a, b):
    """Difference a - b of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(forceinline=True)
def scaled(k, a):
    """Product of a number and a vector."""
    return k * a[0], k * a[1], k * a[2]


@njit(forceinline=True)
def scalar_product(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def vector_product(a, b):
    """Vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
def dot(a, i, x, y, z):
    """Scalar product of the vector at a[i] and (x, y, z)."""
    return a[i] * x + a[i + 1] * y + a[i + 2] * z


@njit(forceinline=True)
def cross(a, i, x, y, z):
    """Vector product of the vector at a[i] and (x, y, z)."""
    return a[i + 1] * z - a[i + 2] * y, a[i + 2] * x - a[i] * z, a[i] * y - a[i + 1] * x


@njit(forceinline=True)
def rotate(out, r, v, k):
    """Transform the vector v[k:k+3] from axes of a body to axes of the world; out[r] : its rotation matrix, by rows."""
    x = v[k]
    y = v[k + 1]
    z = v[k + 2]
    return dot(out, r, x, y, z), dot(out, r + 3, x, y, z), dot(out, r + 6, x, y, z)


@njit(forceinline=True)
def rotate_back(out, r, x, y, z):
    """Transform (x, y, z) from axes of the world to axes of a body; out[r] : rotation matrix of the body, by rows."""
    # The transpose of a rotation matrix is its inverse.
    return (
        out[r] * x + out[r + 3] * y + out[r + 6] * z,
        out[r + 1] * x + out[r + 4] * y + out[r + 7] * z,
        out[r + 2] * x + out[r + 5] * y + out[r + 8] * z,
    )
