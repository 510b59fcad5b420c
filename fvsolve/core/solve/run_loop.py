"""Loop over the time steps of a run: arrays, step settings, events, and collisions of rigid water columns."""

from collections import ChainMap, deque
from collections.abc import Callable

import numpy as np

from fvsolve.core.assembly.lowering import Device
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels import tanks
from fvsolve.core.kernels.compiled_functions import fused_step_function
from fvsolve.core.model import Model, RunData
from fvsolve.core.model.state_bounds import state_bounds
from fvsolve.core.model.step_division import dividing_rate
from fvsolve.core.solve.partition import blocked_sums, make_partition
from fvsolve.core.steppers import automatic, loop_records
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.ledger import LEDGER_ROWS
from fvsolve.core.steppers.structure import Structure
from fvsolve.core.steppers.tableau import Method, method_named
from fvsolve.errors import listing

ROW_CAPACITY = 512
NO_LIMIT = 1e308
# Least steps in the time of a `delay` under error control, which does not see the error of its input between entries:
# as many as a polynomial through six of them needs.
STEPS_IN_DELAY = 6
MOST_EVENTS_AT_ONCE = 20  # events at the same time; more is chattering
# events within this fraction of the run, or within a given step; more is chattering
MOST_EVENTS_IN_SPAN, SPAN = 2000, 1e-5

FAILURES = {  # reason for the return of the loop -> text
    loop_records.STOPPED: '{event} at {when}, and numerics.below_vapor = "stop" ends the run there',
    loop_records.NEWTON_STUCK: "Newton did not converge at {when}, however short the step, worst in {worst}; check the "
    "parts there for jumps, or try an explicit method",
    loop_records.TINY_STEP: "the step became too small at {when}; try a larger rtol, or numerics.courant or "
    "numerics.step instead; a formula with an infinite slope there is another cause",
    loop_records.BAD_VALUE: "a value is not finite{place} at {when}; the step is too long for the method: "
    "halve the step",
}
# [Pa]; at a junction whose pressure is less above the vapour pressure there is a cavity
NEAR_VAPOR = 5e3
STATUS_FAILURES = {  # status of the right-hand side -> text
    rec.NO_SOLUTION: "the demand{place} cannot be supplied at {when}; all connections to its node are shut, or pass "
    "a flow that its pressure does not change: open one, give a machine a leakage, or replace the node by a chamber",
    rec.NO_VOLUME: "the chamber volume{place} is zero at {when}; give the piston an end-stop",
    rec.NO_WIDTH: "the wall has no space left{place} at {when}; give its mass an end-stop, or a wider zone",
    rec.NO_COOLANT: "{part} heats {name} by more than {rise:g} K at {when}: too little fluid flows "
    "through this junction to take up the heat; make it a chamber, or leave the part out of `heat_from`",
    rec.NO_LIQUID: "a cavity{place} cannot supply the flow that is drawn from it at {when}; give a demand the key "
    "`required_pressure`, so that it falls with the pressure; a pump would lose its suction there: trip it earlier",
    rec.NO_WEIGHT: "the water in {name} has no weight left at {when}; reduce the downward acceleration of its body",
}
NO_BALANCE = (
    "no pressure{place} balances the flows there at {when}; all connections to its node are shut, or pass a flow that "
    "pressure does not change: open one, give a machine a leakage, or replace the node by a chamber"
)
NO_WAY_OUT = "the inflow{place} finds no way out at {when}; all connections to its node are shut: open one, or stop it"
CONDUITS_EXHAUSTED = (
    "the demand of {demand} at {name} cannot be met at {when}: at most {available} leave the conduits there (critical "
    "outflow); draw less, or replace the node by a tank"
)


class RunLoop:
    """Arrays of a run of a model; its method `run` steps until an output is due, a fault occurs or the segment ends.

    structure : function without arguments that returns the sparsity structure of the Jacobian; default: that of the
    model
    threads : number of threads
    comm : MPI communicator of all ranks, in place of threads
    """

    def __init__(
        self, model: Model, structure: Callable[[], Structure] | None = None, threads=1, comm=None
    ) -> None:
        numerics = model.case.numerics
        self.model, self.run_data = model, RunData(model)
        method = method_named(automatic.first_method(numerics.method))
        self.switched: list[tuple[float, int]] = []  # time and number of every event of a device
        self.at_once, self.last_switch = 0, np.nan
        self.event_fault = ""  # reason why a run cannot continue after an event
        # times of the last events
        self.recent_events: deque[float] = deque(maxlen=MOST_EVENTS_IN_SPAN + 4 * self.armed.size)
        self.span = SPAN * (numerics.end - numerics.start)
        # called after every event, before the next step
        self.on_switch: Callable[[], None] = lambda: None
        call = model.functions
        self.rhs, self.observe, self.record, self.events = (
            call.rhs,
            call.observe,
            call.record,
            call.events,
        )
        self.fused_step = fused_step_function(fused_allowed := fused_step_allowed(model, method))
        ledgers, structure = model.ledgers, structure or (lambda: model.structure)
        self.stepper = stepper = Integrator(
            method, model.y_size, ledgers, structure, model.scale.copy(), model.damped
        )
        stepper.stored = stored_states(model)
        stepper.carry = np.zeros(len(stepper.stored))
        stepper.bounded_states, stepper.bounds = state_bounds(model)
        stepper.out, stepper.out_row = model.new_out(), model.new_out()
        stepper.values = np.zeros(len(model.tables.probes))
        self.tanks = np.flatnonzero(model.tables.nodes["kind"] == rec.TANK)
        self.changed_at_events = [
            (device, row)
            for (_, _, device), row in zip(model.devices, model.tables.devices, strict=True)
            if type(device).apply_event is not Device.apply_event
        ]
        stepper.prepare_events(self.armed.size)
        stepper.rows = np.zeros((ROW_CAPACITY, 1 + len(model.tables.probes)))
        self.state, self.control, self.progress = (
            stepper.state[0],
            stepper.control[0],
            stepper.progress[0],
        )
        self.out, control = stepper.out, self.control
        control["step_max"] = longest_step(model)
        control["stop_at"], control["allow_fused"] = NO_LIMIT, fused_allowed
        control["has_jumps"] = model.tables.settings["arrivals"][0] == 1
        set_step_mode(control, model)
        if numerics.method == automatic.AUTO:
            automatic.watch(stepper, structure(), cost_of_rates(model))
        # of waves only: implicit steps are stable for the rest
        if numerics.courant is not None and not method.explicit:
            control["mode"], control["size"] = loop_records.FIXED_STEP, step_of_waves(model)
        longest = step_within_delays(model)
        control["step_max"] = min(
            control["step_max"], longest / (STEPS_IN_DELAY if numerics.rtol is not None else 1)
        )
        if control["mode"] == loop_records.FIXED_STEP:
            control["size"] = min(control["size"], longest)
        if control["mode"] == loop_records.FIXED_STEP and method.explicit:
            control["dividing_rate"] = dividing_rate(model, self.given_step)
        self.run_data.clock["step"] = self.given_step
        self.team, single_band = None, make_partition(model, 1)
        if method.explicit and numerics.method != automatic.AUTO:
            stepper.structure = blocked_sums(single_band, 0)
            self.run_data.written = self.run_data.written._replace(sums=stepper.structure)
        if numerics.rtol is not None:  # errors are summed by rows
            stepper.row_blocks, stepper.sums = (
                single_band.row_blocks(0),
                np.zeros(single_band.sum_count),
            )
        if comm is not None:
            from fvsolve.core.solve.parallel_bands import MpiRanks

            self.team = MpiRanks(self, make_partition(model, comm.size), comm)
        elif threads > 1:
            from fvsolve.core.solve.parallel_bands import ThreadTeam

            self.team = ThreadTeam(self, make_partition(model, threads))

    @property
    def now(self) -> np.ndarray:
        """Present state y (a view)."""
        return self.stepper.y[self.progress["now"]]

    @property
    def before(self) -> np.ndarray:
        """State before the last step (a view)."""
        if self.team is not None:
            self.team.gather_states(self.progress["old"])
        return self.stepper.y[self.progress["old"]]

    @property
    def given_step(self) -> float:
        """Given step [s]; 0 under error control and where it depends on the wave rate."""
        return (
            float(self.control["size"]) if self.control["mode"] == loop_records.FIXED_STEP else 0.0
        )

    @property
    def t(self) -> float:
        """Present time [s]."""
        return float(self.state["t"])

    def begin(self, end: float, stop_at: float) -> None:
        """Start a segment of the run that ends at `end` [s], and discard the data of steps before its start.

        stop_at : time [s] from which on the loop writes no output rows
        """
        self.stepper.discard_history()
        if any(t == self.t for t, _ in self.model.breaks):
            for own in self.run_data.features:
                own.begin_at_break()
        self.resume(end, stop_at)

    def resume(self, end: float, stop_at: float) -> None:
        """Continue a segment of the run up to the time `end` [s]; the loop writes no output rows from `stop_at` on."""
        self.control["end"], self.control["stop_at"] = end, stop_at
        self.stepper.restart_segment()
        self.apply_events()
        self.run_data.clock["limit"] = end

    def run(self, budget: float) -> int:
        """Take at most `budget` steps; returns a code of `steppers.loop_records`, from DONE to CHATTERING."""
        while (capacity := self.run_data.history_capacity()) < budget:
            code = self.steps(capacity)
            left, budget = self.control["budget"], budget - capacity
            if (
                code != loop_records.BUDGET_SPENT
                or left != 0.0
                or automatic.is_change_due(self.stepper)
            ):
                return code
        return self.steps(budget)

    def steps(self, budget: float) -> int:
        """Take at most `budget` steps, for which the wave history has space; returns a code, see `run`."""
        self.control["budget"] = budget
        code = loop_records.CHATTERING if self.event_fault else loop_records.SWITCHED
        while code == loop_records.SWITCHED:
            before = self.armed.copy()
            functions, where = self.functions
            if self.team is None:
                code = self.stepper.call(*functions, self.run_data.handle, where, self.armed)
            else:
                code = self.team.call(functions, where)
            if code == loop_records.SWITCHED:
                code = (
                    loop_records.SWITCHED if self.handle_events(before) else loop_records.CHATTERING
                )
                self.on_switch()
        return code

    @property
    def functions(self) -> tuple:
        """Tuple of the compiled functions that the time loop calls, and index of the first ledger rate in `out`."""
        return (self.fused_step, self.observe, self.record, self.events, self.rhs), int(
            self.model.layout["supply"]
        )

    def close(self) -> None:
        """End the threads or ranks."""
        if self.team is not None:
            self.team.close()

    @property
    def armed(self) -> np.ndarray:
        """Flags of events, 1 while the condition of an event holds (a view)."""
        return self.run_data.armed

    def record_events(self, before: np.ndarray) -> None:
        """Record the events since the event flags were `before`, and apply their immediate effects."""
        first, count = tanks.EVENTS * self.tanks.size, len(self.model.events)
        armed, earlier = self.armed[first : first + count], before[first : first + count]
        now = armed > earlier
        self.switched += [(self.t, int(k)) for k in now.nonzero()[0] if self.model.events[k][1]]
        self.run_data.store_times(self.t, before)
        self.apply_events()
        if any(own.changes_flags for own in self.run_data.features):
            more = (armed > earlier) & ~now
            self.switched += [
                (self.t, int(k)) for k in more.nonzero()[0] if self.model.events[k][1]
            ]

    def apply_events(self) -> None:
        """Apply the immediate effects of events: limits of tank levels, and sudden changes of states of devices.

        Mass that a limit of a tank adds or removes is booked in the ledger.
        """
        held = self.armed[: tanks.EVENTS * self.tanks.size].any()  # a tank at a limit
        for i in self.tanks if held else ():
            node, sums = self.model.tables.nodes[i], self.stepper.ledger.reshape(LEDGER_ROWS, -1)
            part = tanks.overshoot_correction(
                node, self.armed, float(node["mass"] + self.now[node["y"]])
            )
            self.now[node["y"]] += part
            sums[0 if part > 0.0 else 1, i] += part
        for device, row in self.changed_at_events:
            device.apply_event(self.run_data, row, self.t, self.now, self.stepper.scale)
        self.event_fault = self.run_data.apply_event(self.now)

    def handle_events(self, before: np.ndarray) -> bool:
        """Record the last events; returns False if there are too many at the same time or in a short span of time."""
        self.record_events(before)
        if self.event_fault:
            return False
        self.at_once = self.at_once + 1 if self.t == self.last_switch else 1
        self.last_switch = self.t
        self.recent_events.append(self.t)
        span, events = max(self.span, self.given_step), self.recent_events
        crowded = len(events) == events.maxlen and self.t - events[0] <= span
        return self.at_once <= MOST_EVENTS_AT_ONCE + 4 * self.armed.size and not crowded

    def evaluate(self, limit: float) -> np.ndarray:
        """Compute and return the output array `out` at the present state, and record the events that a jump has caused.

        limit : time [s] at which schedules with a jump take the value before the jump
        """
        before = self.armed.copy()
        out = self.run_data.evaluate(self.t, self.now, limit)[1]
        self.record_events(before)
        return out

    def stop_columns(self, limit: float) -> list[tuple[int, float]]:
        """Set the flows of rigid columns that stop, or that collide at a node without other flow.

        Where columns separate at an air valve, the valve opens first.
        limit : time [s] at which schedules with a jump take the value before the jump
        Returns a pair (number of the column, lost mass flow [kg/s]) for each column whose flow has changed.
        """
        if not len(self.model.tables.columns):
            if self.armed.size:  # events to record
                self.evaluate(limit)
            return []
        stopped = []
        out = self.evaluate(limit)
        layout = self.model.layout
        places = shut_places(self.model, out)
        while (event := separate(self.run_data, self.t, self.now, out, places)) is not None:
            before = self.armed.copy()
            self.armed[event], self.armed[event + 1] = 1.0, 0.0
            self.record_events(before)
            out = self.evaluate(limit)
            places = shut_places(self.model, out)
        for k, row in enumerate(self.model.tables.columns):
            flow, new = float(row["flow"] + self.now[row["y"]]), float(out[layout["column"] + k])
            ends = row["from_node"] in places or row["to_node"] in places
            collides = out[layout["valve_controlled"] + k] == 0.0 and ends
            if flow != new and (collides or new == 0.0):
                self.now[row["y"]] = new - row["flow"]
                stopped.append((k, flow - new))
        return stopped

    def take_rows(self) -> np.ndarray:
        """Copy of the output rows (time and probe values) written since the last call."""
        count = int(self.progress["rows"])
        self.progress["rows"] = 0
        return self.stepper.rows[:count].copy()

    def step_back(self) -> None:
        """Return to the state before the last step, unless the ledgers include that step already; it is valid then."""
        if self.progress["has_last_step"] == 1 and self.state["unbooked"] > 0.0:
            self.before  # noqa: B018  (copies that state from the other threads or ranks)
            self.state["t"] = self.progress["t_old"]
            self.state["unbooked"] = 0.0
            self.progress["now"], self.progress["old"] = self.progress["old"], self.progress["now"]
            self.progress["has_last_step"] = 0

    def failure_text(self, code: int) -> str:
        """Text with failure, place, time and remedy for a code of `steppers.loop_records`.

        For BAD_VALUE and BAD_STATUS the loop returns to the state before the last step, see `step_back`.
        """
        model = self.model
        text = FAILURES.get(code, "")
        names = {}
        names["when"] = f"t = {model.case.moment(self.t)}"
        if code == loop_records.CHATTERING and self.event_fault:
            return f"{self.event_fault} at {names['when']}"
        if code == loop_records.CHATTERING:
            return self.chattering_text(names["when"])
        if code == loop_records.STOPPED:
            names["event"] = (
                "a cavity opened" if model.cavitates else "pressure fell below vapour pressure"
            )
        elif code == loop_records.NEWTON_STUCK:
            names["worst"] = model.state_names[int(self.state["worst"])]
        elif code == loop_records.BAD_VALUE:
            bad = np.flatnonzero(~np.isfinite(self.now))
            names["place"] = f" at {model.state_names[bad[0]]}" if bad.size else ""
            self.step_back()
        elif code == loop_records.BAD_STATUS:
            index, status = int(self.out[rec.WHERE]), int(self.out[rec.STATUS])
            if status == rec.NOT_CONVERGED and (cavity := self.cavity_of_cluster(index)) >= 0:
                index, status = cavity, rec.NO_LIQUID
            text = STATUS_FAILURES.get(
                status, "Newton did not converge{place} at {when}; try a smaller step"
            )
            if status == rec.NOT_CONVERGED and (values := self.demand_above_outflow(index)):
                text, names = CONDUITS_EXHAUSTED, names | values
            if (
                status == rec.NO_SOLUTION
                and index >= 0
                and self.out[model.layout["supply"] + index] >= 0.0
            ):
                text = NO_WAY_OUT if self.out[model.layout["supply"] + index] > 0.0 else NO_BALANCE
            told = ChainMap(
                *(own.explanation(status, index, self.out) for own in self.run_data.features)
            )
            if status == rec.NO_WEIGHT:
                waters = [*(part.name for part in model.meshed), *model.node_names]
                names["name"] = waters[index].removesuffix(".inside")
            elif told:
                names |= told
            else:
                names["place"] = f" at {model.node_names[index]}" if index >= 0 else ""
            self.step_back()
        if reason := self.feature_failure():
            return f"{reason} at {names['when']}; check its formula and its inputs"
        return text.format(**names)

    def demand_above_outflow(self, index: int) -> dict[str, str]:
        """Names and values of a node that draws more than the critical outflow of its links; empty for others.

        index : number of a node in its cluster, which is solved at once
        """
        model = self.model
        tables = self.model.tables
        found = {}
        links = (tables.valves, tables.pipes, tables.columns)
        for cluster in tables.clusters:
            nodes = tables.integers[
                cluster["first_node"] : cluster["first_node"] + cluster["nodes"]
            ]
            for i in (
                nodes[self.out[model.layout["supply"] + nodes] < 0.0] if index in nodes else ()
            ):
                limits = [
                    limit for own in self.run_data.features for limit in own.critical_outflows(i)
                ]
                joined = sum(
                    np.count_nonzero(t[end] == i) for t in links for end in ("from_node", "to_node")
                )
                if joined != len(limits):
                    continue
                available = sum(limits)
                demand = -self.out[model.layout["supply"] + i] / model.case.properties.density
                if demand > available:
                    found = {"name": model.node_names[i]}
                    found |= {
                        "demand": model.case.amount(demand, "flow"),
                        "available": model.case.amount(available, "flow"),
                    }
        return found

    def cavity_of_cluster(self, index: int) -> int:
        """Number of a junction with a cavity in the cluster of node `index`, which is solved at once; -1 for none."""
        tables = self.model.tables
        if not self.model.cavitates or index < 0:
            return -1
        for cluster in tables.clusters:
            nodes = tables.integers[
                cluster["first_node"] : cluster["first_node"] + cluster["nodes"]
            ]
            p = tables.nodes["pressure"][nodes] + self.out[self.model.layout["pressure"] + nodes]
            low = nodes[p < tables.settings[0]["floor"] + NEAR_VAPOR]
            if index in nodes and low.size:
                return int(low[0])
        return -1

    def feature_failure(self) -> str:
        """Reason of a feature why a step from the present time on failed; "" for none.

        In a model without states no step is rejected, so a failure at any time counts.
        """
        earliest = self.t if self.model.y_size else -np.inf
        return next((text for own in self.run_data.features if (text := own.failure(earliest))), "")

    def chattering_text(self, when: str) -> str:
        """Text with the devices that change their states without end, and a remedy; when : time of the failure."""
        model = self.model
        # at the same time, or within a short span
        first = self.t if self.at_once > 1 else self.recent_events[0]
        names = sorted({model.events[k][0] for t, k in self.switched if t >= first})
        remedies = {
            device.remedy: None
            for name, _, device in model.devices
            if name.removesuffix(".inside") in names
        }
        for text in (feature.remedy(name) for feature in model.features for name in names):
            remedies |= {text: None} if text else {}
        parts_text = listing(names) if names else "a leak, or a demand that follows the pressure,"
        verbs = "change their states" if len(names) > 1 else "changes its state"
        remedy = ", or ".join(remedies) or "put a chamber at the node of this part"
        return f"{parts_text} {verbs} without end at {when}; {remedy}"


def stored_states(model: Model) -> np.ndarray:
    """Numbers of the states that are stored amounts, or travel, whose sums are compensated."""
    sums = [*model.tables.nodes["y"]]
    for feature in model.features:
        sums += feature.stored_states(model).tolist()
    return np.array([at for at in sums if at >= 0], dtype=np.int64)


def set_step_mode(control, model: Model) -> None:
    """Set the mode of the steps and its number: Courant number, given step [s] or tolerance.

    Without waves nothing is fast after a switch: steps then keep their length, which only their error limits.
    """
    numerics = model.case.numerics
    # COURANT, FIXED_STEP, TOLERANCE of `loop_records`
    for mode, key in enumerate(("courant", "step", "rtol")):
        if getattr(numerics, key) is not None:
            control["mode"], control["size"] = mode, getattr(numerics, key)
    # given steps begin anew after a switch: full steps end at multiples of the step after its beginning
    control["keeps_step"] = model.shapes.accepted > 0 and control["mode"] == loop_records.TOLERANCE


def cost_of_rates(model: Model) -> float:
    """Cost of the right-hand side relative to that of rates alone: 1 and the number of restrictions in clusters.

    They are solved together by Newton's method, which takes about a microsecond for each of them.
    """
    clusters = model.tables.clusters
    return (
        1.0 + float(clusters["valves"][clusters["order"] >= 0].sum())
        if model.shapes.accepted > 0
        else 1.0
    )


def step_of_waves(model: Model) -> float:
    """Given step of an implicit method with a Courant number [s]: that of the fastest wave at the start."""
    rate = model.wave_rate
    return model.case.numerics.courant / rate if rate > 0.0 else longest_step(model)


def longest_step(model: Model) -> float:
    """Longest step [s]; infinite if waves, or a given step, set all steps.

    Under error control it resolves schedules and delay lines (the inverse of their greatest wave rate). With a Courant
    number it is that of meshes that start dry, see `filling_step`.
    """
    numerics = model.case.numerics
    if numerics.courant is not None:
        return min([NO_LIMIT, *(numerics.courant * part.filling_step() for part in model.meshed)])
    if numerics.rtol is None:
        return NO_LIMIT
    others = model.tables.pipes["cells"] == 0
    return min(model.step_max, 1.0 / model.wave_rates[others].max() if others.any() else NO_LIMIT)


def step_within_delays(model: Model) -> float:
    """Longest step for which no stage reads the input of a `delay` before it is known [s]; infinity without delays."""
    method = model.case.numerics.method
    methods = (automatic.EXPLICIT, automatic.IMPLICIT) if method == automatic.AUTO else (method,)
    latest = max(1.0, *(time for name in methods for time in method_named(name).times))
    return min((feature.shortest_delay for feature in model.features), default=np.inf) / latest


def fused_step_allowed(model: Model, method: Method) -> bool:
    """True if a single function can compute both rates and step (a fused step).

    It requires the linear density law, the upwind scheme, a one-stage explicit method without error control, no state
    except cells of pipes, no events, no pipe on a moving body, no control, and no friction or a constant friction
    factor.
    """
    settings, numerics = model.tables.settings[0], model.case.numerics
    laws = model.tables.pipes["friction"]
    return bool(
        model.case.law.linear
        and settings["scheme"] == rec.UPWIND
        and settings["from_arriving"]
        and method.explicit
        and method.stages == 1
        and numerics.rtol is None
        and model.y_size == 2 * model.cells
        and model.shapes.armed == 0
        and not model.functions.cast.features
        and {*laws.tolist()} <= {rec.FRICTION_NONE, rec.FRICTION_FACTOR}
    )


ROUNDING = 1e-9  # relative to a small flow: columns that separate more slowly separate by rounding


def shut_places(model: Model, out: np.ndarray) -> list[int]:
    """Numbers of the nodes that join only rigid columns and shut valves; out : output array of the right-hand side."""
    places = []
    nodes = model.tables.nodes
    at = model.layout["conductance"]
    for i in np.flatnonzero(nodes["gates"] >= 0):
        if not out[at + gates_of(model, i)].any():
            places.append(int(i))
    return places


def gates_of(model: Model, i: int) -> np.ndarray:
    """Numbers of the valves at node i, a junction of rigid columns and valves."""
    row = model.tables.nodes[i]
    return model.tables.integers[row["gates"] : row["gates"] + row["gate_count"]]


def air_valve_of(model: Model, i: int) -> int | None:
    """Number of the opening event of the air valve at node i; None without an air valve."""
    valves, devices = model.tables.valves, model.tables.devices
    for device in valves["device"][gates_of(model, i)]:
        if device >= 0 and devices[device]["row"] >= 0:
            return int(devices[device]["event"])
    return None


def flow_before(run_data: RunData, t: float, y: np.ndarray) -> np.ndarray:
    """Mass flow of each rigid column just before t, minus its initial steady flow : float64[columns] [kg/s].

    At the start time of the run it is the state of each column.
    """
    model = run_data.model
    before, columns = model.new_out(), model.tables.columns
    if t <= model.case.numerics.start:
        return y[columns["y"]]
    limit, run_data.clock["limit"] = float(run_data.clock["limit"]), t
    model.functions.rhs(t, y, np.zeros(0), before, run_data.handle)
    run_data.clock["limit"] = limit
    return before[model.layout["column"] :][: len(columns)] - columns["flow"]


def impact_impulses(
    model: Model, carried: np.ndarray, out: np.ndarray, places: list[int]
) -> np.ndarray:
    """Mass flow that the pressure impulse J [Pa s] at each node stops [kg/s]; negative where columns separate.

    J follows from the momentum: at each node, the sum over its columns of A / L (J - J_far) is the sum of their
    inflows, with area A [m2] and length L [m] of a column and the impulse J_far at its far end. Columns whose flow a
    valve controls keep their flow. The result is J times the sum of A / L.
    carried : float64[columns]  result of `flow_before`; out : output array of the right-hand side
    places : nodes from `shut_places`
    """
    from fvsolve.core.kernels.column_junctions import gate_inflow

    sums = np.array(
        [model.tables.nodes["inflow"][i] - gate_inflow(model.tables, i) for i in places]
    )
    matrix = np.zeros((len(places), len(places)))
    row = {i: r for r, i in enumerate(places)}
    for k, column in enumerate(model.tables.columns):
        ends = [
            (row.get(int(column["from_node"]), -1), -1.0),
            (row.get(int(column["to_node"]), -1), 1.0),
        ]
        at = model.layout["column"] + k
        valve_controlled = out[model.layout["valve_controlled"] + k] != 0.0 and out[at] != 0.0
        change = out[at] - column["flow"] if valve_controlled else carried[k]
        for r, sign in ends:
            if r >= 0:
                sums[r] += sign * change
            for other, other_sign in ends if r >= 0 and not valve_controlled else ():
                if other >= 0:
                    matrix[r, other] += sign * other_sign * column["area"] / column["length"]
    return np.diag(matrix) * np.linalg.lstsq(matrix, sums)[0]


def separate(
    run_data: RunData, t: float, y: np.ndarray, out: np.ndarray, places: list[int]
) -> int | None:
    """Number of the opening event of the air valve where columns separate fastest; None if no columns separate.

    run_data : data of the run; y : state at time t [s]; out : output array of the right-hand side there
    places : result of `shut_places`
    """
    model = run_data.model
    events = [air_valve_of(model, i) for i in places]
    if all(event is None for event in events):
        return None
    small = ROUNDING * model.scale[model.tables.columns["y"]].max()
    all_impulses = impact_impulses(model, flow_before(run_data, t, y), out, places)
    separating = [
        (impulse, event)
        for impulse, event in zip(all_impulses, events, strict=True)
        if event is not None and impulse < -small
    ]
    return min(separating)[1] if separating else None
