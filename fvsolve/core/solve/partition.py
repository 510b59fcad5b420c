"""Partition of the state of a model into bands of rows, a band for each thread, and the data that bands exchange.

A band steps its own rows of every mesh that can be divided. All other states are stepped by every band. Values of
neighbouring rows come from the band that owns them. In large meshes a band forms the stage sums of a Runge-Kutta step
in blocks of rows that fit into the processor cache.
"""

import signal
import threading
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from fvsolve.core.kernels import stage_sums
from fvsolve.core.model import Model
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import FvsolveError, Notice, listing


@dataclass(frozen=True)
class Partition:
    """Parts of a model divided into bands of rows.

    count : number of bands
    parts : numbers of the divided parts among all meshed parts
    firsts : int64[parts, count + 1]  for each divided part the first row of each band, then the number of rows
    """

    model: Model
    count: int
    parts: tuple[int, ...]
    firsts: np.ndarray

    @property
    def sum_count(self) -> int:
        """Number of partial sums of the error norm of a step, over all bands.

        There is one for each range of `common_states`, and one for each row of each quantity of the divided parts.
        """
        rows = [part.row_count * part.states_per_cell for part in self.divided]
        return len(self.common_states()) + sum(rows)

    @property
    def divided(self) -> list:
        """Divided parts, as `MeshedPart`."""
        meshed = self.model.meshed
        return [meshed[b] for b in self.parts]

    def common_states(self) -> list[tuple[int, int]]:
        """Ranges (first, last + 1) of the states that every band steps."""
        runs, start = [], 0
        for part in sorted(self.divided, key=lambda part: part.first_state):
            runs.append((start, part.first_state))
            start = part.first_state + part.states_per_cell * part.n
        runs.append((start, self.model.y_size))
        return [run for run in runs if run[1] > run[0]] or [(0, 0)]

    def row_blocks(self, k: int) -> np.ndarray:
        """Blocks of states that band k steps : int64[q, 5]; blocks that every band steps come first.

        Each row: first state, last state + 1, index of its first partial sum of the error norm (see `sum_count`), count
        of its partial sums, number of states of each (the last may have fewer).
        """
        alike = self.common_states()
        blocks, first = [(*run, m, 1, run[1] - run[0]) for m, run in enumerate(alike)], len(alike)
        for rows, part in zip(self.firsts, self.divided, strict=True):
            for q in range(part.states_per_cell):
                states = part.states_of_rows(q, int(rows[k]), int(rows[k + 1]))
                blocks.append(
                    (*states, first + int(rows[k]), int(rows[k + 1] - rows[k]), part.row_size)
                )
                first += part.row_count
        return np.array(blocks, dtype=np.int64)

    def maxima_rows(self, k: int) -> list[slice]:
        """Ranges of the array `maxima` that band k writes in the divided parts."""
        pairs = zip(self.firsts, self.divided, strict=True)
        return [
            own for rows, part in pairs for own in part.maxima_of_rows(*rows[k : k + 2].tolist())
        ]

    def bands(self, k: int) -> np.ndarray:
        """First row and last row + 1 of band k in each part, cells for meshes that are not grids : int64[2 parts].

        An undivided part has all its rows.
        """
        rows_of = [part.band(0, part.row_count) for part in self.model.meshed]
        for rows, b, part in zip(self.firsts, self.parts, self.divided, strict=True):
            rows_of[b] = part.band(int(rows[k]), int(rows[k + 1]))
        return np.array(rows_of, dtype=np.int64).ravel()

    def states(self, k: int) -> np.ndarray:
        """Ranges of states that band k reads from other bands : int64[r, 3], (other band, first, last + 1)."""
        parts = []
        for rows, part in zip(self.firsts, self.divided, strict=True):
            near = np.arange(*part.cells_of_rows(*part.rows_read(int(rows[k]), int(rows[k + 1]))))
            cells = np.concatenate([near, *part.common_cells(self.model.tables)])
            for q in range(part.states_per_cell):
                parts.append(runs(cells, part.row_size, rows, k, part.first_state + q * part.n))
        return np.concatenate(parts)

    def flows(self, k: int) -> np.ndarray:
        """Ranges of flows through open boundaries that band k reads from other bands : int64[r, 3].

        Each row: other band, first and last + 1 index in the array `work`.
        """
        parts = [np.zeros((0, 3), dtype=np.int64)]
        for rows, part in zip(self.firsts, self.divided, strict=True):
            at, row = part.boundary_rows()
            if at >= 0:
                owner = np.searchsorted(rows, row, "right") - 1
                parts.append(merged_runs(np.arange(row.size), owner, k, at))
        return np.concatenate(parts)

    @property
    def exchanges_flows(self) -> bool:
        """True if a divided part has an open boundary."""
        return any(part.boundary_rows()[0] >= 0 for part in self.divided)


def runs(cells: np.ndarray, size: int, rows: np.ndarray, k: int, at: int) -> np.ndarray:
    """Ranges of states of the cells outside band k : int64[r, 3], as `merged_runs` returns them.

    cells : numbers of cells of a mesh; size : cells in a row; rows : first row of each band; at : state of cell 0
    """
    cells = np.unique(cells)
    return merged_runs(cells, np.searchsorted(rows, cells // size, "right") - 1, k, at)


def merged_runs(places: np.ndarray, owner: np.ndarray, k: int, at: int) -> np.ndarray:
    """Ranges of adjacent indices in `places` with the same owner, without owner k : int64[r, 3].

    owner : number of the band that computes each entry of `places`; at : offset added to the indices
    Each row: owner, first index, last index + 1.
    """
    places, owner = places[owner != k], owner[owner != k]
    if not places.size:
        return np.zeros((0, 3), dtype=np.int64)
    new = np.flatnonzero((np.diff(places) != 1) | (np.diff(owner) != 0)) + 1
    first, last = places[np.append(0, new)], places[np.append(new - 1, places.size - 1)]
    return np.column_stack([owner[np.append(0, new)], at + first, at + last + 1]).astype(np.int64)


def make_partition(model: Model, count: int) -> Partition:
    """Partition of the divisible parts of a model into `count` bands of about equal numbers of rows."""
    divided = {b: part for b, part in enumerate(model.meshed) if not part.undivided_reason}
    rows = np.array([part.row_count for part in divided.values()], dtype=np.int64)
    return Partition(model, count, tuple(divided), np.arange(count + 1) * rows[:, None] // count)


READ_ALL_CELLS = ("volume", "wet_area", "infiltration", "infiltrated")  # quantities of whole meshes
EXPLICIT_ONLY = "only explicit methods can be distributed over threads"


def single_thread_reason(model: Model) -> str:
    """Reason why a model is stepped by a single thread; "" if several threads are possible."""
    method = model.case.numerics.method
    if method == automatic.AUTO:
        return f"method {method} may change to a method that solves for all states at once; {EXPLICIT_ONLY}"
    if not method_named(method).explicit:
        return f"method {method} solves for all states at once; {EXPLICIT_ONLY}"
    if reason := next(
        (
            feature.single_thread_reason
            for feature in model.features
            if feature.single_thread_reason
        ),
        "",
    ):
        return reason
    meshes = model.case.meshes
    for probe in (*model.probes, *model.watched):
        if (probe.name in meshes and probe.quantity in READ_ALL_CELLS) or probe.part == "sections":
            return f"the probe {probe.text} reads all cells"
    if not model.meshed:
        return "the case has no basin; only rows of basins are distributed over threads"
    return "" if not all(part.undivided_reason for part in model.meshed) else undivided_parts(model)


def undivided_parts(model: Model) -> str:
    """Text with the parts that every thread steps completely, and the reasons."""
    return "; ".join(
        f"{part.name}: {part.undivided_reason}" for part in model.meshed if part.undivided_reason
    )


def divisible_rows(model: Model) -> dict:
    """Data of the command `check` on threads, as a dict.

    rows : rows of each divisible part; texts : these with their unit, such as "50 rows"
    whole : reason for each undivided part; most : greatest number of threads
    why : reason why only one thread is possible, or ""
    """
    reason = single_thread_reason(model)
    divided = [] if reason else [part for part in model.meshed if not part.undivided_reason]
    rows = {part.name: part.row_count for part in divided}
    texts = {part.name: part.row_text(part.row_count) for part in divided}
    undivided = {part.name: part.undivided_reason for part in model.meshed if part.undivided_reason}
    return {
        "rows": rows,
        "texts": texts,
        "whole": undivided,
        "most": min(rows.values(), default=1),
        "why": reason,
    }


def threads_of(model: Model, threads: int) -> tuple[int, list[Notice]]:
    """Number of threads that can step a model, at most `threads`, and notices on threads.

    Raises FvsolveError if a divisible part has fewer rows (or blocks of cells of a mesh) than threads.
    """
    if threads == 1:
        return 1, []
    divisible = divisible_rows(model)
    if reason := divisible["why"]:
        return 1, [
            Notice(
                "threads",
                "numerics",
                f"threads = {threads}, but one thread is used: {reason}",
                "threads",
            )
        ]
    few = [name for name, rows in divisible["rows"].items() if rows < threads]
    if few:
        counts = listing(f"{name} has {divisible['texts'][name]}" for name in few)
        text = f"threads = {threads}: {counts}, and each thread needs at least one"
        raise FvsolveError(f"{text}; expected at most {divisible['most']}")
    text = f"each thread computes all rows of these basins: {undivided_parts(model)}"
    return threads, [Notice("threads", "numerics", text, "threads")] if divisible["whole"] else []


# Cells of a block of `stage_sums`: their arrays and the work arrays of the rates fit into a second-level cache.
CACHED_CELLS = 4096
# least number of states of a mesh: smaller ones stay in the second-level cache during a step
LEAST_STATES = 2**17


def blocked_sums(cut: Partition, k: int) -> np.ndarray:
    """Table `sums` of `kernels.stage_sums` for band k : int64[n]; empty if no mesh uses blocks.

    A mesh uses blocks if it has at least 2^17 states and `forms_stages` is True.
    """
    model = cut.model
    parts = model.meshed
    forming = [b for b in cut.parts if parts[b].forms_stages]
    blocked = [b for b in forming if parts[b].states_per_cell * parts[b].n >= LEAST_STATES]
    if not blocked:
        return np.zeros(0, dtype=np.int64)
    others = list(cut.common_states())
    common_cells = []
    edges = []
    for rows, b in zip(cut.firsts, cut.parts, strict=True):
        part, (first, stop) = parts[b], (int(row) for row in rows[k : k + 2])
        for q in range(part.states_per_cell):
            if b not in blocked:
                others.append(part.states_of_rows(q, first, stop))
                continue
            edges.append(part.states_of_rows(q, first, min(first + part.margin, stop)))
            edges.append(part.states_of_rows(q, max(stop - part.margin, first), stop))
            common_cells += cells_at(model, part, q, first, stop)
    head = np.zeros(stage_sums.HEAD + len(parts), dtype=np.int64)
    head[[stage_sums.OTHERS, stage_sums.CHECKED, stage_sums.EDGES]] = (
        len(others),
        len(common_cells),
        len(edges),
    )
    head[stage_sums.BASINS], head[stage_sums.CELLS] = len(parts), CACHED_CELLS
    head[[stage_sums.HEAD + b for b in blocked]] = 1
    return np.concatenate(
        [head, np.array([*others, *common_cells, *edges], dtype=np.int64).ravel()]
    )


def cells_at(model, part, q: int, first: int, stop: int) -> list[tuple[int, int]]:
    """Ranges (first, last + 1) of states of cells that all bands read, within the rows from `first` to `stop` - 1.

    part : a `MeshedPart`; q : number of the quantity
    """
    begin, end = part.states_of_rows(q, first, stop)
    at = part.first_state + q * part.n
    cells = at + np.unique(
        np.concatenate([np.zeros(0, dtype=np.int64), *part.common_cells(model.tables)])
    )
    cells = cells[(cells >= begin) & (cells < end)]
    if not cells.size:
        return []
    new = np.flatnonzero(np.diff(cells) != 1) + 1
    return [(int(cell_run[0]), int(cell_run[-1]) + 1) for cell_run in np.split(cells, new)]


# ranks ----------

RUN_LOOP, SEND_STATES, CLOSE = range(3)  # requests of rank 0: run the time loop, send states, end
CLOSE_MESSAGE = CLOSE, None


@contextmanager
def postponed_interrupts():
    """Postpone Ctrl-C until all workers have returned, because they wait for each other."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals, before = [], signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *arguments: signals.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if signals and callable(before):
        before(*signals[0])
