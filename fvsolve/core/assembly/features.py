"""Features of models: protocol between the core and a folder of `features`, found by its header, imported at its use.

A feature is what needs a table shared by several parts, a history, or a say in the start; a single part needs none. It
is a class `class Name(Feature, slot=k, wakes="...")` in `features/*/feature.py`. `wakes` lists words of a case file,
separated by commas; a case with one of them has the feature. The core imports no feature: it asks `features_of(case)`,
and calls the methods below in the order of slots. Every method has a default, which does nothing.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fvsolve.declarations import Declaration, Declarations
from fvsolve.errors import FvsolveError

# in one line or in several, as a formatter leaves it
HEADER = re.compile(
    r'\nclass (?P<attribute>\w+)\(\s*Feature,\s*slot=(?P<slot>\d+),\s*wakes="(?P<wakes>[^"]+)",?\s*\)'
)
FEATURES = Declarations("feature", "features", ("features/*/feature.py",), HEADER)


class Header(NamedTuple):
    """Header of a feature. slot : its number; wakes : words of case files that wake it; declaration : in the index"""

    slot: int
    wakes: frozenset[str]
    declaration: Declaration


def headers() -> Iterator[Header]:
    """Yield the headers of all features. One of an entry point has no text in the index, so its class is imported.

    A feature of another package that cannot be imported causes a warning; cases run without it.
    """
    for declaration in FEATURES.values():
        if found := declaration.options:
            yield Header(int(found["slot"]), words_in(found["wakes"]), declaration)
            continue
        try:
            loaded = declaration.load()
        except FvsolveError as error:
            warnings.warn(str(error), RuntimeWarning, stacklevel=2)
        else:
            yield Header(loaded.slot, loaded.wakes, declaration)


def words_in(text: str) -> frozenset[str]:
    """Words of case files in a header."""
    return frozenset(word.strip() for word in text.split(","))


def wakes(header: Header, case, words: set[str]) -> bool:
    """True if a case has one of the words of a header; words : result of `words_of`"""
    sections = [
        word.removeprefix("section ") for word in header.wakes if word.startswith("section ")
    ]
    return bool(header.wakes & words) or any(getattr(case, name, None) for name in sections)


def words_of(case) -> set[str]:
    """Words of a case that may wake features: "pipe_model NAME" for pipes, and those of each part, see `Part.words`."""
    common = case.numerics.pipe_model
    models = {
        f"pipe_model {link.pipe_model or common}"
        for link in case.links.values()
        if link.kind == "pipe"
    }
    return models.union(*(part.words for part in (*case.nodes.values(), *case.links.values())))


def features_of(case, given_up: Collection[str] = ()) -> list[Feature]:
    """Features of a case, in the order of slots; given_up : names of parts that features do not compute.

    Raises FvsolveError if two of them have the same slot.
    """
    words, awake = words_of(case), {}
    for header in headers():
        if wakes(header, case, words):
            name = header.declaration.name
            if header.slot in awake:
                other = awake[header.slot].declaration.name
                text = f"{other} and {name} both have the slot {header.slot}"
                raise FvsolveError(f"features: {text}; expected another slot in one of them")
            awake[header.slot] = header
    return [awake[slot].declaration.load()(case, given_up) for slot in sorted(awake)]


class Squares(NamedTuple):
    """Energy of small deviations as squares of linear forms, a form given by the factor of each state in it.

    stored : state of a stored amount -> its form; first, last : (name of a part, form), before and behind those of
    devices
    """

    stored: dict[int, dict[int, float]] = {}
    first: list[tuple[str, dict[int, float]]] = []
    last: list[tuple[str, dict[int, float]]] = []


class Coordinate(NamedTuple):
    """Coordinate of a part that moves along a line.

    net : place of the force on it among the net forces in `out`, -1 for none; frame : its number among frames, or -1
    y, rate : offsets in y of its position and velocity, as deviations, or -1; schedule : that sets it, or -1
    position [m], velocity [m/s], force [N] : at the start; inertia [kg]; lightness : 1 / inertia, 0 if fixed [1/kg]
    """

    net: int
    frame: int
    y: int
    rate: int
    schedule: int
    position: float
    velocity: float
    force: float
    inertia: float
    lightness: float


class Feature:
    """Base of features, with one object for each case. `draft` is the `ModelDraft`, `model` the `Model`, of the case.

    slot : number of the feature, by which its compiled functions find its tables
    packages : names of further modules with compiled functions, such as laws of parts
    device_hooks : names of functions of laws of devices that its functions call, keys of `kernels.calls.HOOKS`
    sets_arrivals : True if its `record` writes out[ARRIVES], the next time at which a step must end, for waves
    reads_nodes : True if its functions need pressures or flows of nodes, also in a model that has only basins
    reads_masses : True if its functions read the initial masses per length at centres of pipe cells, in `profile`
    reads_solved : True if it reads values that only the solved nodes determine, before rates are computed
    shortest_delay : no stage of a step may be later than this after the beginning of the step [s]
    step_histories : names of arrays in the memory of a state that contain values at past steps
    single_thread_reason : reason why a model with the feature is stepped by a single thread; "" if it is not
    frames : names of frames that move, whose data it writes to `out`, see `kernels.moving_frames`
    leaks : rows of links that leak between nodes a and b and change their volumes: `leakage` [m3/s/Pa], `speed`,
    `sweep_a`, `sweep_b`; leak_names : names of these links
    pushes_at_rest : rows of forces at rest on what moves along a line: `mass`, its place among the net forces or -1;
    `outward`, 1 or -1; `rest`, the force [N]
    fast_parts : names of parts that can limit the step
    marks : kind and place of each entry of `marks` that the feature has reserved
    link_schedules : link -> number of its schedule; -1 for none
    further_cells : number of cells whose cost the feature adds to that of pipes and meshes; negative if it saves
    meshed : its parts with a mesh of cells, see `assembly.meshed_parts`
    sources : names of its rows in the ledger of mass that does not pass nodes, such as "street.rain"
    damped : True if explicit steps divide its rates by a factor for friction, see `steppers.erk`
    """

    slot = 0
    wakes: frozenset[str] = frozenset()
    packages: Sequence[str] = ()
    device_hooks: Sequence[str] = ()
    sets_arrivals = reads_nodes = reads_solved = reads_masses = False
    shortest_delay = np.inf
    step_histories: Sequence[str] = ()
    single_thread_reason = ""
    frames: Sequence[str] = ()
    leaks: Any = ()
    leak_names: Sequence[str] = ()
    pushes_at_rest: Any = ()
    fast_parts: Sequence[str] = ()
    marks: Sequence[tuple[str, str]] = ()
    link_schedules: dict[str, int] = {}
    further_cells = 0
    meshed: Sequence[Any] = ()
    sources: Sequence[str] = ()
    damped = False

    def __init__(self, case, given_up: Collection[str] = ()) -> None:
        self.case, self.given_up = case, given_up

    def __init_subclass__(cls, slot: int, wakes: str) -> None:
        cls.slot, cls.wakes = slot, words_in(wakes)

    # build, in the order of the calls ----------

    def begin(self, draft) -> None:
        """Continue before all tables are filled."""

    def fill_pipe(self, draft, name: str, link, row) -> bool:
        """Fill the row of a pipe that the feature computes, with cells = 0, and add its states; False for others."""
        return False

    def lower(self, draft) -> None:
        """Fill the tables of the feature, after those of the pipes; add faults."""

    def grouped(self, draft, group: np.ndarray) -> None:
        """Continue when nodes are grouped; group : label of the group of each node."""

    def join(
        self, draft, row, ports, places, toward=None, about=None
    ) -> tuple[float, float] | None:
        """Write to the row of a force element what it joins; None if the feature has no such parts.

        Returns the distance of the second part from the first at the start [m], and its rate [m/s]; for points
        `toward` a direction only the rate along it, and `about` an axis that of the angle [rad/s].
        ports : columns of the row for both parts, or for both points of a joint; places : names of parts or points
        """
        return None

    def coordinate(self, name: str) -> Coordinate | None:
        """Coordinate of a part that the feature moves along a line; None for others."""
        return None

    def lower_behind_links(self, draft) -> None:
        """Fill the tables of the feature, after those of links and devices; add faults."""

    def lower_behind_nodes(self, draft) -> None:
        """Fill the tables of the feature, after those of nodes and links; add faults."""

    def lower_behind_meshes(self, draft) -> None:
        """Fill the tables of the feature, after those of parts with a mesh; add faults."""

    def lower_last(self, draft) -> None:
        """Fill the tables of the feature, after all others; add faults."""

    def probe(self, draft, probe, row) -> bool:
        """Fill the row of a probe that the feature computes; False for others."""
        return False

    def probe_rows(self) -> tuple[np.ndarray, list]:
        """Rows of probes that the feature reads itself, and these probes."""
        return np.zeros(0), []

    def change_settings(self, draft, settings) -> None:
        """Change settings of the model, which follow from the case; settings : record of `kernels.dtypes.SETTINGS`"""

    def rate(self, draft) -> float:
        """Greatest constant rate of its states [1/s]."""
        return 0.0

    def reserve_ledger(self, draft) -> None:
        """Reserve rows of the ledger behind those of nodes, and what belongs to them, see `assembly.array_sizes`."""

    def reserve(self, draft) -> None:
        """Reserve stretches of `out`, and work arrays, see `assembly.array_sizes`."""

    def placed(self, draft) -> None:
        """Read the offsets of stretches of `out`, in `draft.sizes.offsets`."""

    def rest(self, case, draft) -> tuple[Any, list]:
        """Case whose parts begin at rest where their forces balance, and notices; draft : with its steady start."""
        return case, []

    def balanced(self, draft, start: Callable[[Any], Any]):
        """Draft whose start the feature has balanced; start : function of a draft -> model with its steady start."""
        return draft

    def supported(self, draft, start) -> dict[int, float]:
        """Pressures of closed nodes that support loads, in a solved steady start : node -> pressure [Pa]."""
        return {}

    def begin_forces(self, draft, start) -> list[str]:
        """Set forces from the steady start of the flow, start; texts on what moves."""
        return []

    def prepare_start(self, draft, trial: Callable[[Any], Any]) -> None:
        """Set values that the steady start needs. trial : function of a copy of the draft, which fills its start in."""

    def begin_motion(self, draft, start) -> list[str]:
        """Complete the steady start of the flow, start; texts on what changes with time at the start."""
        return []

    def accelerations(self, draft) -> dict[str, float]:
        """Accelerations of masses that the feature moves [m/s2], by name, at the forces in the table of masses."""
        return {}

    def settle(self, draft) -> list[str]:
        """Continue after the steady start; names of parts to be given up, after which the tables are made again."""
        return []

    def start(self, draft, y: np.ndarray) -> None:
        """Write the states of the feature at the start; those that it leaves are 0. Add notices on them."""

    def level(
        self, draft, y: np.ndarray, attitudes: Callable[[], dict[str, np.ndarray]] | None = None
    ) -> list[str]:
        """Write the states of its fluid at rest on bodies to the states y of the model.

        Returns the names of the functions that compute the loads of this fluid, "module: function".
        attitudes : function that returns the rotation matrix of each body; None for attitudes at the start
        """
        return []

    def tables(self) -> tuple | None:
        """Tables of the feature as its compiled functions read them, before there is a run, see `level`."""
        return None

    def close(self, draft) -> None:
        """Complete the tables of the feature; from here on they are constant."""

    def copy_for(self, case) -> Feature:
        """Copy of the feature for a case with tables of the same shapes."""
        return self

    # model ----------

    def terms(self, model, cast) -> Iterable[tuple[str, Any]]:
        """Terms of its functions, that is, phases of the right-hand side and jobs: (place in the order, `RhsTerms`).

        cast : `ModelFeatures` of the model without those of features
        Places: first: before all others; pipes: behind those of pipes; events: with event functions of restrictions;
        links: behind those of pipes, restrictions and columns; devices: behind those of devices; flow: behind those of
        the memory of pipes; carried: then, of what flows carry; cells: then, of what is carried in meshes; last: behind
        all others but records of nodes.
        Places of event functions, in this order, after the nodes are solved: closed: forces; given: values that follow
        from states, nodes and forces; sources: schedules that the feature sets; followed: what follows such schedules;
        solved: other values.
        """
        return ()

    def refusal(self, function: str) -> str:
        """Reason why a function of (t, y) is not defined, because the feature has a history; "" if it is."""
        return ""

    def run(self, run_data) -> FeatureRun:
        """Data of a run."""
        return FeatureRun(self, run_data)

    def pattern(self, couplings) -> FeaturePattern:
        """Couplings of states, see `model.jacobian_pattern.Couplings`."""
        return FeaturePattern(self)

    def modes(self, model) -> list[tuple[str, np.ndarray]]:
        """Modes of cells: pairs of a name and eigenvalues [1/s], see `step_limits.growing_modes`."""
        return []

    def squares(self, model, y: np.ndarray) -> Squares:
        """Squares of linear forms in deviations from the state y, whose sum is the energy of the feature."""
        return Squares()

    def weigh(self, model, weights: np.ndarray, y: np.ndarray) -> None:
        """Write the weights of its states in the norm of deviations from y, see `model.energy_norm`.

        weights : of all states; those of nodes, pipes and columns are known
        """

    def masses(self, model, y: np.ndarray) -> Iterable[tuple[float, float]]:
        """Pairs for its parts: mass stored at the start, and its change from the start to state y [kg]."""
        return ()

    def book_sources(self, y: np.ndarray, ledger: np.ndarray) -> None:
        """Write masses of its `sources` that follow from the last state y.

        ledger : float64[2, sources]  mass that entered, and as a negative number mass that left, of each [kg]
        """

    def open_nodes(self, model) -> set[int]:
        """Nodes through which mass enters and leaves the model, because the boundary behind them is open."""
        return set()

    def cell_states(self, model) -> list[np.ndarray]:
        """Numbers of its states that belong to cells, or that all cells of a part follow."""
        return []

    def energy_refusal(self) -> str:
        """Reason why the energy of a case with the feature cannot be computed; "" if it can."""
        return ""

    def end_accounts(self, accounts) -> None:
        """Add accounts with the rows of power and stored energy behind those of all other parts."""

    def energy_rows(self, model) -> Iterable[tuple[str, dict[int, float]]]:
        """Rows of the energy of deviations, (name, state -> factor), see `model.energy_norm.energy_form`."""
        return ()

    def add_accounts(self, accounts) -> None:
        """Add accounts of energy with rows behind those of others and before those of devices."""

    def add_fields(self, fields: dict, model, y: np.ndarray, out: np.ndarray) -> None:
        """Add values along pipes and at nodes to the result of `Model.fields`."""

    def drawn(self, model):
        """Lines that move with parts, in the way of `motion.drawing.BodyLines`; None for none."""
        return None

    def facts(self, model) -> dict[str, Any]:
        """Facts for `fvsolve check`."""
        return {}

    def check_texts(self, model, facts: dict[str, Any]) -> list[str]:
        """Lines that `fvsolve check` prints; facts : result of `facts`"""
        return []

    def stored_states(self, model) -> np.ndarray:
        """Numbers of the states that are stored amounts, whose sums are compensated."""
        return np.zeros(0, dtype=np.int64)

    def bounds(self, model) -> list[tuple[np.ndarray, np.ndarray]]:
        """Bounds of its states, see `model.state_bounds`."""
        return []

    def ledgers(self, model, y: np.ndarray, ledger: np.ndarray) -> dict[str, dict]:
        """Balances of a run, by name; y : its last state; ledger : float64[2, m], sums of its rates by sign"""
        return {}

    def begin_accounts(self, accounts) -> None:
        """Add accounts of energy with rows behind those of columns, see `model.energy_accounts`."""

    def above(self, model) -> dict[str, float]:
        """Energy of parts at the start, above that at rest, see `model.energy_accounts.available_energy` [J]."""
        return {}

    def inputs(self, model) -> dict[str, Any]:
        """Inputs that can be held at values : name -> `assembly.lowering.Input`."""
        return {}

    def driven(self) -> set[int]:
        """Numbers of schedules whose rates are speeds; -1 for none."""
        return set()

    def held(self, tables, t: float, smooth: bool) -> tuple[Feature, dict[str, np.ndarray]]:
        """Feature with values that vary by themselves held at those at t [s], and tables of the model replaced for it.

        smooth : True if bounds of values are removed too, because they are kinks of the right-hand side
        """
        return self, {}

    def to_hold(self) -> tuple[Feature, np.ndarray]:
        """Copy of the feature, and the array in which values of its inputs are set.

        The array may also be a table whose columns `least` and `greatest` are the bounds of values of inputs.
        """
        return self, np.zeros(0)

    def remedy(self, event: str) -> str:
        """Remedy if an event of a part follows itself without end; "" for parts of others. event : name of the part"""
        return ""

    def step_notices(self, model, method) -> list:
        """Notices of steps that are too long for the method."""
        return []


class FeaturePattern:
    """Couplings of states by a feature, for the sparsity pattern of the Jacobian. The base has none."""

    def __init__(self, feature: Feature) -> None:
        self.feature = feature

    def schedule(self, *indices: int) -> np.ndarray:
        """States on which schedules with these numbers depend."""
        return np.zeros(0, dtype=np.int64)

    def pressure(self, i: int) -> np.ndarray:
        """States on which the pressure of storing node i depends, in addition to its mass."""
        return np.zeros(0, dtype=np.int64)

    def inflows(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (storing node, states on which a flow of the feature into it depends)."""
        yield from ()

    def schedules(self) -> set[int]:
        """Numbers of the schedules that `pairs` contain, wherever blocks set them."""
        return set()

    def source(self, row) -> np.ndarray | None:
        """States on which a source of a network depends; None if the feature knows none. row : of the source"""
        return None

    def sets_pressure(self, i: int) -> np.ndarray | None:
        """States that set the pressure of node i; None if the feature does not set it."""
        return None

    def fed(self, i: int) -> np.ndarray:
        """States whose rates the flow into node i changes."""
        return np.zeros(0, dtype=np.int64)

    def on_bodies(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield pairs of fluid that a body carries: number of the body, states of the fluid."""
        yield from ()

    def carried(self, i: int, q: int) -> tuple[np.ndarray, np.ndarray | None] | None:
        """States of the amounts of scalar q that set its value at node i, and of the masses that hold them.

        Without masses the flows through the node weigh the amounts; None if the feature does not set the value.
        """
        return None

    def reacting_places(self) -> Iterator[tuple[np.ndarray, list, Callable]]:
        """Yield groups of its places of reactions, see `features.scalars.pattern.reacting_places`."""
        yield from ()

    def read_by(self, part, lowering) -> np.ndarray:
        """States on which values of the feature depend that the law of a device reads before the nodes are solved."""
        return np.zeros(0, dtype=np.int64)

    def probe(self, row) -> np.ndarray | None:
        """States on which the value of a probe depends; None if the feature does not compute it. row : of the probe"""
        return None

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs (rates, states)."""
        yield from ()


class FeatureRun:
    """Data that a run writes for a feature, one object for each run. The base has none.

    changes_flags : True if `at_event` may change event flags
    """

    changes_flags = False

    def __init__(self, feature: Feature, run_data) -> None:
        self.feature, self.run_data = feature, run_data

    def tables(self, view: str = "") -> tuple | None:
        """Tables of the feature as its compiled functions read them; view : name of another view of the model."""
        return self.feature.tables()

    def written_tables(self) -> dict[str, np.ndarray]:
        """Tables of the model that the run writes, as copies by name."""
        return {}

    def views(self) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
        """Views that compiled functions open : name -> (array for its handle, tables of the model replaced in it)."""
        return {}

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays of float64 that a state needs in addition to y, by the name in its memory; they may grow."""
        return {}

    def coefficients(self) -> list[np.ndarray]:
        """Arrays of numbers of 8 bytes that follow from the event flags, in addition to `arrays`."""
        return []

    def store(self, name: str, values: np.ndarray) -> bool:
        """Set one of `arrays`; True if it is a new array. The base writes into the array, which does not grow."""
        self.arrays()[name][:] = values
        return False

    def reset(self) -> None:
        """Reset for another state."""

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Continue from the memory of a state; raises ValueError if it lacks what the feature needs.

        The base sets the arrays that the memory contains.
        """
        for name in self.arrays().keys() & memory.keys():
            self.run_data.set_array(name, memory[name].copy())

    def capacity(self) -> float:
        """Number of steps that fit into the arrays, which grow if it is small."""
        return np.inf

    def begin_segment(self, t: float, y: np.ndarray, end: float) -> None:
        """Continue at the begin of a segment of the run, see `RunData.begin_segment`."""

    def begin_at_break(self) -> None:
        """Continue at a break of a schedule, at which a segment of the run begins."""

    def follow_flags(self) -> None:
        """Write what belongs to the present event flags, `run_data.armed`."""

    def at_event(self, y: np.ndarray) -> str:
        """Change flags and states y at an event, after those of tanks and devices; text of a fault, "" for none."""
        return ""

    def flags_changed(self, t: float, before: np.ndarray) -> None:
        """Continue at an event at t; before : event flags before it, those after it are `run_data.armed`"""

    def explanation(self, status: int, index: int, out: np.ndarray) -> dict[str, Any]:
        """Names and values in the text of a status of the feature with which functions end a run.

        status, index : numbers in out[STATUS] and out[WHERE], see `kernels.dtypes`
        """
        return {}

    def failure(self, earliest: float) -> str:
        """Reason why a run failed, with a time not before `earliest` [s]; "" if the feature knows none."""
        return ""

    def waves(
        self, t: float, out: np.ndarray, parts: int
    ) -> Iterator[tuple[int, tuple[np.ndarray, np.ndarray]]]:
        """Yield both waves along the pipes of the feature, see `RunData.along`."""
        yield from ()

    def critical_outflows(self, i: int) -> list[float]:
        """Greatest flow through each of its links from which node i draws, at critical flow [m3/s]."""
        return []

    def held_marks(self, start: float, t: float, entered: np.ndarray) -> list:
        """Marks of a run, see `run_summary.Mark`, in place of marks "dry" of the same places.

        start, t : times of start and end [s]; entered : float64[nodes]  mass that has entered at each node [kg]
        """
        return []

    def corrected_at(self, t: float) -> bool:
        """True if the feature corrected the state at t, so that the step before it cannot be repeated."""
        return False

    def for_energy(self) -> None:
        """Let functions compute what only energies need; raises FvsolveError if that is not possible."""

    def notices(self) -> list:
        """Notices at the end of a run."""
        return []

    def end_notices(self, y: np.ndarray) -> list:
        """Notices on the last state of a run."""
        return []


def with_slot(members: list[Any], slot: int) -> Any:
    """Feature with a slot, or its data of a run; None if the case does not have the feature."""
    return next(
        (member for member in members if getattr(member, "feature", member).slot == slot), None
    )


def frames_of(owner) -> list[str]:
    """Names of frames that move in a draft or model, in the order of their data in `out`, see `Feature.frames`."""
    return [name for feature in owner.features for name in feature.frames]


def coordinate_of(owner, name: str) -> Coordinate:
    """Coordinate of a part that moves along a line, of a draft or a model."""
    return next(
        found for feature in owner.features if (found := feature.coordinate(name)) is not None
    )
