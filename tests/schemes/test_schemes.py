"""Properties derived from the entry of a scheme: order, reach, and the scheme for basins."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from fvsolve.assembly.scheme_codes import CODES, FAMILIES, family
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.reconstruction import limited
from fvsolve.schemes import LEAST_CELLS, LIMITED, LINEAR, SCHEMES, Scheme

KNOWN = {  # order, reach, scheme on grids of basins, True if it computes cavities
    "upwind": (1, (1, 0, 0, 1), "upwind", True),
    "linear-upwind": (2, (2, 0, 1, 2), "muscl", False),
    "fromm": (2, (2, 1, 1, 2), "muscl", False),
    "central": (2, (1, 1, 1, 2), "muscl", False),
    "upwind3": (3, (2, 1, 2, 3), "muscl", False),
    "upwind5": (5, (3, 2, 4, 5), "upwind5", False),
    "muscl": (2, (2, 1, 1, 3), "muscl", True),
    "weno5": (5, (3, 2, 4, 5), "weno5", False),
}


def test_every_scheme_is_known():
    assert set(KNOWN) == set(SCHEMES) == {*LINEAR, *LIMITED}


@pytest.mark.parametrize("name", KNOWN)
def test_facts_of_a_scheme_are_those_of_its_weights(name):
    one = SCHEMES[name]
    assert (one.order, tuple(one.reach), one.for_basin(True).name, one.cavities) == KNOWN[name]
    assert one.for_basin(False).name == ("upwind" if name == "upwind" else "muscl")
    assert one.smooth is (SCHEMES[one.twin] if one.limited else one)
    assert family(name) == (rec.UPWIND if name == "upwind" else rec.LINEAR if name in LINEAR else FAMILIES[name])


@pytest.mark.parametrize("name", LINEAR)
def test_weights_are_exact_for_their_degree_and_no_more(name):
    """Averages of (x - 0.3)^d over the cells [k, k + 1], k = -2 to 2, give the value at the face x = 1."""
    one = LINEAR[name]
    for degree in range(one.degree + 2):
        averages = [((k + 0.7) ** (degree + 1) - (k - 0.3) ** (degree + 1)) / (degree + 1) for k in range(-2, 3)]
        apart = abs(float(np.dot([float(w) for w in one.weights], averages)) - 0.7**degree)
        assert apart < 1e-12 if degree <= one.degree else apart > 1e-3


def test_a_scheme_is_one_entry():
    """The weights of a new scheme, kappa = 1/2 of van Leer's family, give all its properties."""
    one = Scheme("quick-like", weights=tuple(Fraction(w, 8) for w in (0, -1, 6, 3, 0)))
    assert (one.order, tuple(one.reach), one.limited, one.plane) == (2, (2, 1, 1, 2), False, "muscl")


def test_shorter_schemes_have_room():
    """Schemes that read five cells have a scheme of lower order for pipes with fewer cells; others have none."""
    for one in SCHEMES.values():
        assert bool(one.shorter) == (one.degree + 1 >= LEAST_CELLS)
        assert not one.shorter or SCHEMES[one.shorter].order < one.order


def test_codes_of_limiters_are_those_of_their_functions():
    assert [CODES[name] for name in ("minmod", "van-leer", "monotonized-central")] == [
        rec.MINMOD, rec.VAN_LEER, rec.MONOTONIZED_CENTRAL]  # fmt: skip
    assert limited(CODES["minmod"], 1.0, 3.0) == 1.0
    assert limited(CODES["van-leer"], 1.0, 3.0) == 1.5
    assert limited(CODES["monotonized-central"], 1.0, 3.0) == 2.0
