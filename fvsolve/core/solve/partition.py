"""Partition of the state of a model into bands of rows, a band for each thread, and the data that bands exchange.

A band steps its own rows of every basin that can be divided. All other states are stepped by every band. Values of
neighbouring rows come from the band that owns them. In large basins a band forms the stage sums of a Runge-Kutta step
in blocks of rows that fit into the processor cache.
"""

from dataclasses import dataclass

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels import stage_sums
from fvsolve.core.model import Model
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import FvsolveError, Notice, listing


@dataclass(frozen=True)
class Partition:
    """Basins of a model divided into bands of rows.

    count : number of bands
    basins : numbers of the divided basins
    firsts : int64[basins, count + 1]  for each divided basin the first row of each band, then the number of rows
    """

    model: Model
    count: int
    basins: tuple[int, ...]
    firsts: np.ndarray

    @property
    def sum_count(self) -> int:
        """Number of partial sums of the error norm of a step, over all bands.

        There is one for each range of `common_states`, and one for each row of each quantity of the divided basins.
        """
        rows = [row_count(self.model, b) * quantities(self.model, b) for b in self.basins]
        return len(self.common_states()) + sum(rows)

    def common_states(self) -> list[tuple[int, int]]:
        """Ranges (first, last + 1) of the states that every band steps."""
        runs, start = [], 0
        for b in sorted(self.basins, key=lambda b: self.model.tables.basins[b]["y"]):
            row = self.model.tables.basins[b]
            runs.append((start, int(row["y"])))
            start = int(row["y"] + quantities(self.model, b) * row["n"])
        runs.append((start, self.model.y_size))
        return [run for run in runs if run[1] > run[0]] or [(0, 0)]

    def row_blocks(self, k: int) -> np.ndarray:
        """Blocks of states that band k steps : int64[q, 5]; blocks that every band steps come first.

        Each row: first state, last state + 1, index of its first partial sum of the error norm (see `sum_count`), count
        of its partial sums, number of states of each (the last may have fewer).
        """
        alike = self.common_states()
        blocks, first = [(*run, m, 1, run[1] - run[0]) for m, run in enumerate(alike)], len(alike)
        for rows, b in zip(self.firsts, self.basins, strict=True):
            for q in range(quantities(self.model, b)):
                states = states_of_rows(self.model, b, q, int(rows[k]), int(rows[k + 1]))
                blocks.append((*states, first + int(rows[k]), int(rows[k + 1] - rows[k]), row_size(self.model, b)))
                first += row_count(self.model, b)
        return np.array(blocks, dtype=np.int64)

    def maxima_rows(self, k: int) -> list[slice]:
        """Ranges of the array `maxima` that band k writes in the divided basins."""
        ranges = []
        for rows, b in zip(self.firsts, self.basins, strict=True):
            basin, (begin, stop) = self.model.tables.basins[b], rows[k : k + 2].tolist()
            at, size, n = int(basin["maxima"]), int(basin["maxima_row"]), int(basin["n"])
            if at >= 0 and basin["nx"] > 0:
                ranges.append(slice(at + size * begin, at + size * stop))
            elif at >= 0:  # a row of each quantity
                begin, stop = cells_of_rows(self.model, b, begin, stop)
                ranges += [slice(at + q * n + begin, at + q * n + stop) for q in range(size // n)]
        return ranges

    def bands(self, k: int) -> np.ndarray:
        """First row and last row + 1 of band k in each basin, cells for meshes that are not grids : int64[2 basins].

        An undivided basin has all its rows.
        """
        table = self.model.tables.basins
        rows_of = np.zeros((len(table), 2), dtype=np.int64)
        rows_of[:, 1] = np.where(table["nx"] > 0, table["ny"], table["n"])
        for rows, b in zip(self.firsts, self.basins, strict=True):
            own = int(rows[k]), int(rows[k + 1])
            rows_of[b] = own if table[b]["nx"] > 0 else cells_of_rows(self.model, b, *own)
        return rows_of.ravel()

    def states(self, k: int) -> np.ndarray:
        """Ranges of states that band k reads from other bands : int64[r, 3], (other band, first, last + 1)."""
        parts = []
        for rows, b in zip(self.firsts, self.basins, strict=True):
            basin = self.model.tables.basins[b]
            near = np.arange(*cells_of_rows(self.model, b, *rows_read(self.model, b, int(rows[k]), int(rows[k + 1]))))
            cells, size = np.concatenate([near, *common_cells(self.model, b)]), row_size(self.model, b)
            for q in range(quantities(self.model, b)):
                parts.append(runs(cells, size, rows, k, int(basin["y"] + q * basin["n"])))
        return np.concatenate(parts)

    def flows(self, k: int) -> np.ndarray:
        """Ranges of flows through open boundaries that band k reads from other bands : int64[r, 3].

        Each row: other band, first and last + 1 index in the array `work`.
        """
        parts = [np.zeros((0, 3), dtype=np.int64)]
        for rows, b in zip(self.firsts, self.basins, strict=True):
            basin = self.model.tables.basins[b]
            nx, ny, at = int(basin["nx"]), int(basin["ny"]), int(basin["through"])
            if at < 0:
                continue
            if nx > 0:
                row = np.concatenate([np.arange(ny), np.arange(ny), np.zeros(nx, int), np.full(nx, ny - 1)])
            else:
                from fvsolve.core.basins.cell_sides import BLOCK

                mesh = self.model.basins[b].mesh
                row = mesh.left[mesh.inner :] // BLOCK
            owner = np.searchsorted(rows, row, "right") - 1
            parts.append(merged_runs(np.arange(row.size), owner, k, at))
        return np.concatenate(parts)

    @property
    def exchanges_flows(self) -> bool:
        """True if a divided basin has an open boundary."""
        return bool((self.model.tables.basins["through"][[*self.basins]] >= 0).any())


def quantities(model: Model, b: int) -> int:
    """Number of states in each cell of basin number b, with transported scalars and the states of the soil."""
    basin = model.basins[b]
    return len(basin.quantities) + len(basin.scalars) + basin.soil_states


def row_size(model: Model, b: int) -> int:
    """Number of cells of a row of basin b; a row of a mesh that is not a grid is a block of cells, see `cell_sides`."""
    from fvsolve.core.basins.cell_sides import BLOCK

    return int(model.tables.basins[b]["nx"]) or BLOCK


def row_count(model: Model, b: int) -> int:
    """Number of rows of basin b, see `row_size`."""
    return -(-int(model.tables.basins[b]["n"]) // row_size(model, b))


def cells_of_rows(model: Model, b: int, first: int, stop: int) -> tuple[int, int]:
    """(first, last + 1) of the cells of the rows from `first` to `stop` - 1 of basin b."""
    size, n = row_size(model, b), int(model.tables.basins[b]["n"])
    return min(first * size, n), min(stop * size, n)


def rows_read(model: Model, b: int, first: int, stop: int) -> tuple[int, int]:
    """(first, last + 1) of the rows of basin b whose values the rates of the rows from `first` to `stop` - 1 read."""
    if model.tables.basins[b]["nx"] > 0:
        from fvsolve.core.basins.boundary_cells import BAND_MARGIN

        return max(first - BAND_MARGIN, 0), min(stop + BAND_MARGIN, row_count(model, b))
    need = model.basins[b].blocks_needed  # rates read values at sides, and these read the cells next to them
    sides = int(np.searchsorted(need, first, "right")), int(need[stop - 1])
    return int(np.searchsorted(need, sides[0], "right")), int(need[sides[1] - 1])


def common_cells(model: Model, b: int):
    """Yield the numbers of the cells of basin b that all bands read: an array for each patch and probe in cells."""
    from fvsolve.core.basins.lower_pattern import cells_at_faces  # loads scipy

    integers = model.tables.integers
    for patch in model.tables.patches[model.tables.patches["basin"] == b]:
        yield integers[patch["first"] : patch["first"] + patch["count"]]
        if patch["closure"] != rec.NO_CLOSURE:
            yield cells_at_faces(integers, patch)
    probes = model.tables.probes
    for probe in probes[np.isin(probes["kind"], (rec.CELL_FIELD, rec.CELL_SCALAR)) & (probes["index"] == b)]:
        yield integers[probe["cell"] : probe["cell"] + probe["count"]]


def runs(cells: np.ndarray, size: int, rows: np.ndarray, k: int, at: int) -> np.ndarray:
    """Ranges of states of the cells outside band k : int64[r, 3], as `merged_runs` returns them.

    cells : numbers of cells of a basin; size : cells in a row; rows : first row of each band; at : state of cell 0
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
    """Partition of the divisible basins of a model into `count` bands of about equal numbers of rows."""
    basins = tuple(b for b, basin in enumerate(model.basins) if not basin.undivided_reason)
    rows = np.array([row_count(model, b) for b in basins], dtype=np.int64)
    return Partition(model, count, basins, np.arange(count + 1) * rows[:, None] // count)


READ_ALL_CELLS = ("volume", "wet_area", "infiltration", "infiltrated")  # quantities of whole basins
EXPLICIT_ONLY = "only explicit methods can be distributed over threads"


def single_thread_reason(model: Model) -> str:
    """Reason why a model is stepped by a single thread; "" if several threads are possible."""
    method = model.case.numerics.method
    if method == automatic.AUTO:
        return f"method {method} may change to a method that solves for all states at once; {EXPLICIT_ONLY}"
    if not method_named(method).explicit:
        return f"method {method} solves for all states at once; {EXPLICIT_ONLY}"
    if reason := next((feature.single_thread_reason for feature in model.features if feature.single_thread_reason), ""):
        return reason
    meshes = model.case.meshes
    for probe in (*model.probes, *model.watched):
        if (probe.name in meshes and probe.quantity in READ_ALL_CELLS) or probe.part == "sections":
            return f"the probe {probe.text} reads all cells"
    if not model.basins:
        return "the case has no basin; only rows of basins are distributed over threads"
    return "" if not all(basin.undivided_reason for basin in model.basins) else undivided_basins(model)


def undivided_basins(model: Model) -> str:
    """Text with the basins that every thread steps completely, and the reasons."""
    return "; ".join(f"{basin.name}: {basin.undivided_reason}" for basin in model.basins if basin.undivided_reason)


def divisible_rows(model: Model) -> dict:
    """Data of the command `check` on threads, as a dict.

    rows : rows of each divisible basin, see `row_size`; texts : these with their unit, such as "50 rows"
    whole : reason for each undivided basin; most : greatest number of threads
    why : reason why only one thread is possible, or ""
    """
    from fvsolve.core.basins.cell_sides import BLOCK

    reason = single_thread_reason(model)
    divided = [b for b, basin in enumerate(model.basins) if not basin.undivided_reason]
    rows = {} if reason else {model.basins[b].name: row_count(model, b) for b in divided}
    units = {
        model.basins[b].name: "row{}" if model.basins[b].is_grid else f"block{{}} of {BLOCK} cells" for b in divided
    }
    texts = {name: f"{count} {units[name].format('s' * (count > 1))}" for name, count in rows.items()}
    undivided = {basin.name: basin.undivided_reason for basin in model.basins if basin.undivided_reason}
    return {"rows": rows, "texts": texts, "whole": undivided, "most": min(rows.values(), default=1), "why": reason}


def threads_of(model: Model, threads: int) -> tuple[int, list[Notice]]:
    """Number of threads that can step a model, at most `threads`, and notices on threads.

    Raises FvsolveError if a divisible basin has fewer rows (or blocks of cells of a mesh) than threads.
    """
    if threads == 1:
        return 1, []
    divisible = divisible_rows(model)
    if reason := divisible["why"]:
        return 1, [Notice("threads", "numerics", f"threads = {threads}, but one thread is used: {reason}", "threads")]
    few = [name for name, rows in divisible["rows"].items() if rows < threads]
    if few:
        counts = listing(f"{name} has {divisible['texts'][name]}" for name in few)
        text = f"threads = {threads}: {counts}, and each thread needs at least one"
        raise FvsolveError(f"{text}; expected at most {divisible['most']}")
    text = f"each thread computes all rows of these basins: {undivided_basins(model)}"
    return threads, [Notice("threads", "numerics", text, "threads")] if divisible["whole"] else []


# Cells of a block of `stage_sums`: their arrays and the work arrays of the rates fit into a second-level cache.
CACHED_CELLS = 4096
LEAST_STATES = 2**17  # least number of states of a basin: smaller basins stay in the second-level cache during a step


def blocked_sums(cut: Partition, k: int) -> np.ndarray:
    """Table `sums` of `kernels.stage_sums` for band k : int64[n]; empty if no basin uses blocks.

    A basin uses blocks if it has at least 2^17 states and `forms_stages` is True.
    """
    model = cut.model
    forming = [b for b in cut.basins if model.basins[b].forms_stages]
    blocked_basins = [b for b in forming if quantities(model, b) * model.basins[b].n >= LEAST_STATES]
    if not blocked_basins:
        return np.zeros(0, dtype=np.int64)
    from fvsolve.core.basins.boundary_cells import BAND_MARGIN

    others, common_cells, edges = list(cut.common_states()), [], []
    for rows, b in zip(cut.firsts, cut.basins, strict=True):
        first, stop = (int(row) for row in rows[k : k + 2])
        for q in range(quantities(model, b)):
            if b not in blocked_basins:
                others.append(states_of_rows(model, b, q, first, stop))
                continue
            edges.append(states_of_rows(model, b, q, first, min(first + BAND_MARGIN, stop)))
            edges.append(states_of_rows(model, b, q, max(stop - BAND_MARGIN, first), stop))
            common_cells += cells_at(model, b, q, first, stop)
    head = np.zeros(stage_sums.HEAD + len(model.basins), dtype=np.int64)
    head[[stage_sums.OTHERS, stage_sums.CHECKED, stage_sums.EDGES]] = len(others), len(common_cells), len(edges)
    head[stage_sums.BASINS], head[stage_sums.CELLS] = len(model.basins), CACHED_CELLS
    head[[stage_sums.HEAD + b for b in blocked_basins]] = 1
    return np.concatenate([head, np.array([*others, *common_cells, *edges], dtype=np.int64).ravel()])


def states_of_rows(model, b: int, q: int, first: int, stop: int) -> tuple[int, int]:
    """(first state, last state + 1) of the rows from `first` to `stop` - 1 of quantity q of basin b."""
    basin, (begin, end) = model.tables.basins[b], cells_of_rows(model, b, first, stop)
    at = int(basin["y"] + q * basin["n"])
    return at + begin, at + end


def cells_at(model, b: int, q: int, first: int, stop: int) -> list[tuple[int, int]]:
    """Ranges (first, last + 1) of states of cells that all bands read, within the rows from `first` to `stop` - 1.

    b : number of the basin; q : number of the quantity
    """
    begin, end = states_of_rows(model, b, q, first, stop)
    at = begin - int(model.tables.basins[b]["nx"]) * first
    cells = at + np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *common_cells(model, b)]))
    cells = cells[(cells >= begin) & (cells < end)]
    if not cells.size:
        return []
    new = np.flatnonzero(np.diff(cells) != 1) + 1
    return [(int(cell_run[0]), int(cell_run[-1]) + 1) for cell_run in np.split(cells, new)]
