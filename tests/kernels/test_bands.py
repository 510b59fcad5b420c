"""Functions of the right-hand side give equal bits for a band of rows, by a handle whose tables are slices."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from reference.folders import CASES

import fvsolve
from fvsolve.core.kernels.rhs_assembly import PHASES
from fvsolve.core.kernels.table_handle import make_handle
from fvsolve.core.model import RunData

BANDED = ("answer", "rates")  # phases in which no pipe writes values that another pipe reads
ENDS = 4  # numbers of a pipe in `out` for its ends


def handles(slate: RunData, cuts: list[int]) -> list[np.ndarray]:
    """Handle of each band of pipes between cuts, with its own scratch, and the arrays that it needs."""
    tables, functions = slate.model.tables, slate.model.functions
    results = []
    for first, last in zip(cuts, cuts[1:], strict=False):
        layout = tables.layout.copy()
        layout["ends"] += ENDS * first
        own = tables._replace(pipes=tables.pipes[first:last], layout=layout)
        written = slate.written._replace(scratch=slate.written.scratch.copy())
        made = (*own, *written, functions.calls, functions.hooks)
        # the arrays of a handle must exist as long as it does
        results.append((make_handle(made), made))
    return results


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("cuts", [[0, 4, 9], [0, 1, 2, 9]])
def test_bands_of_pipes_give_the_bits_of_all(law, cuts):
    """Bands run in order, in reverse order and in threads."""
    path = CASES / "streeter-nine-pipes.toml"
    model = fvsolve.build(fvsolve.load(path, {"fluid.law": law}))
    y = model.start + 0.1 * model.scale * np.random.default_rng(3).normal(size=model.y_size)
    dydt, out = model.evaluate(0.3, y)
    slate = RunData(model)
    bands, whole = handles(slate, cuts), slate.handle

    def rates_and_out(each) -> tuple[np.ndarray, np.ndarray]:
        rates, beside = np.zeros(model.y_size), model.new_out()
        for phase in PHASES:
            for piece in model.functions.cast.functions(phase):
                if phase in BANDED:
                    each(lambda one, piece=piece: piece(0.3, y, rates, beside, one[0]))
                else:
                    piece(0.3, y, rates, beside, whole)
        return rates, beside

    with ThreadPoolExecutor(len(bands)) as pool:
        ways = (
            lambda do: [do(one) for one in bands],
            lambda do: [do(one) for one in bands[::-1]],
            lambda do: list(pool.map(do, bands)),
        )
        for each in ways:
            rates, beside = rates_and_out(each)
            assert np.array_equal(rates, dydt) and np.array_equal(beside, out)
