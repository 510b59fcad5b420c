"""Assembly of the model of a case."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from fvsolve.argument_checks import TABLE, instance_of, validated
from fvsolve.case import load, locate_faults
from fvsolve.case.case import Case
from fvsolve.core.assembly.array_sizes import ArraySizes
from fvsolve.core.assembly.features import features_of
from fvsolve.core.assembly.lowering import lower_devices, lowering_of
from fvsolve.core.assembly.model_draft import ModelDraft
from fvsolve.core.assembly.pipe_terms import MAX_TERMS, add_terms, limit_creep_step
from fvsolve.core.assembly.scheme_codes import limiter_notices, scheme_settings
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels import tanks
from fvsolve.core.model.cluster_tables import classify_nodes
from fvsolve.core.model.model import Model
from fvsolve.core.model.probe_tables import lower_probes, probe_offsets
from fvsolve.core.model.start_notices import start_notices
from fvsolve.core.model.steady_start import SteadyStart
from fvsolve.errors import CaseError, FvsolveError, Notice


def start_profile(draft) -> dict[str, Any]:
    """Compute the initial steady state and fill it into the tables of a draft; return facts for `fvsolve check`.

    Raises CaseError if no steady state is found.
    """
    for feature in draft.features:
        feature.prepare_start(draft, steady_profile)
    return steady_profile(draft)


def steady_profile(draft) -> dict[str, Any]:
    """Initial steady state with the values that features have set, as for `start_profile`."""
    if draft.case.law.linear:
        start = SteadyStart(draft)
    else:
        # not loaded under the linear law
        from fvsolve.core.model.nonlinear_start import NonlinearStart

        start = NonlinearStart(draft)
    start.solve()
    for feature in draft.features:
        start.loads |= feature.supported(draft, start)
    if start.loads:
        start.solve()
    start.report_frictionless()
    start.freeze_factors()
    start.fill_nodes()
    start.fill_pipes()
    start.fill_columns()
    start.fill_valves()
    for (_, part, device), row in zip(draft.devices, draft.device_table, strict=True):
        start.moving += device.begin(start, part, row)
        draft.start_flags |= device.flags_at_start(start, part, row)
    probe_offsets(draft, start)
    unsteady = add_terms(draft)
    return {**start.report(), "unsteady": unsteady, "creep": limit_creep_step(draft, unsteady)}


# fields of a case that differ after a change of numbers of parts
CHANGING_FIELDS = ("nodes", "links", "raw", "read")


def with_new_sizes(packed: ModelDraft, case: Case) -> ModelDraft | None:
    """Copy of packed tables with the restrictions of a case; None if the case differs in more than their sizes.

    The result is also None with data in `plane`, and for a change that `Lowering.resize` does not support.
    """
    before = packed.case
    changed = changed_links(before, case)
    if (
        changed is None
        or packed.plane_size
        or not all(name in packed.valve_names for name in changed)
    ):
        return None
    draft = packed.copy_for(case)
    for name in changed:
        link, row = case.links[name], draft.valve_table[draft.valve_names.index(name)]
        if not lowering_of(type(link)).resize(draft, name, before.links[name], link, row):
            return None
    return draft


def changed_links(before: Case, case: Case) -> list[str] | None:
    """Names of the links that differ between two cases; None if anything else differs, or a link has another type.

    The result is also None if the start of the first case is a static equilibrium.
    """
    constant = [field.name for field in fields(Case) if field.name not in CHANGING_FIELDS]
    same = all(getattr(before, name) is getattr(case, name) for name in constant)
    same = same and before.nodes.keys() == case.nodes.keys()
    same = same and all(case.nodes[name] is node for name, node in before.nodes.items())
    if not same or before.needs_equilibrium or before.links.keys() != case.links.keys():
        return None
    changed = [name for name, link in case.links.items() if link is not before.links[name]]
    return (
        changed
        if all(type(case.links[name]) is type(before.links[name]) for name in changed)
        else None
    )


def build(case: Case) -> Model:
    """Build the model of a case, with its initial steady state.

    Raises CaseError if the case has faults in its model, for example no steady state: a frictionless pipe between
    unequal heads, a demand that no link can supply, a node joined only by rigid columns.
    """
    if not isinstance(case, Case):
        raise FvsolveError(
            f"build takes a Case, not {type(case).__name__}; expected the result of load()"
        )
    return build_like(case)


def build_like(case: Case, like: Model | None = None) -> Model:
    """Build the model of a case.

    like : model of a similar case; if only sizes of restrictions differ, its other tables are used again
    """
    notices = []
    if case.needs_equilibrium:
        draft = tables_with_start(
            replace(case, numerics=case.numerics.model_copy(update={"initial": "steady"}))
        )
        for feature in draft.features:
            case, found = feature.rest(case, draft)
            notices += found
    if like is not None and not like.tables_before_start:
        like.tables_before_start.append(tables_before_start(like.case))
    reused = None if like is None else with_new_sizes(like.tables_before_start[0], case)
    draft = tables_with_start(case, reused)
    draft.warnings += notices
    model = model_of(draft)
    if draft is reused and model.unsteady == like.unsteady:
        model.__dict__["functions"] = like.functions
    return model


def tables_with_start(
    case: Case, draft: ModelDraft | None = None, unfit: Collection[str] = ()
) -> ModelDraft:
    """Tables of a case with its initial steady state; raises CaseError if there are faults.

    draft : tables before the start, to be filled, or None to make them
    unfit : names of parts that features have given up
    """
    draft = draft or tables_before_start(case, unfit)
    draft.check()
    for k in range(len(draft.features)):
        draft = draft.features[k].balanced(draft, model_with_start)
    draft.steady = start_profile(draft)
    worse = settle(draft)
    draft.check()
    return tables_with_start(case, None, {*unfit, *worse}) if worse else draft


def tables_before_start(case: Case, unfit: Collection[str] = ()) -> ModelDraft:
    """Tables of a case before its initial steady state is known; unfit : names of parts that features have given up."""
    draft = ModelDraft(case)
    draft.features = features_of(case, unfit)
    for feature in draft.features:
        feature.begin(draft)
    fill_nodes(draft)
    fill_links(draft)
    classify_nodes(draft)
    for feature in draft.features:
        feature.lower_behind_nodes(draft)
    for feature in draft.features:
        feature.lower_behind_meshes(draft)
    draft.check()
    for feature in draft.features:
        feature.lower_last(draft)
    draft.check()
    pack(draft, np.zeros(profile_size(draft)))
    fill_rises(draft)
    return draft


def model_with_start(draft: ModelDraft) -> Model:
    """Model of tables before the start, whose steady start is computed; without notices."""
    draft.steady = start_profile(draft)
    settle(draft)
    return model_of(draft, lambda _: [])


def fill_nodes(draft: ModelDraft) -> None:
    """Fill the table of fluid nodes, one NODE row for each."""
    table = draft.node_table = np.zeros(len(draft.case.places), rec.NODE)
    table["y"] = table["shape"] = table["schedule"] = table["row"] = table["forcing"] = -1
    table["full"] = np.inf
    for row, (name, node) in zip(table, draft.case.places.items(), strict=True):
        row["elevation"] = draft.case.elevations[name]
        lowering_of(type(node)).place(draft, name, node, row)


def fill_links(draft: ModelDraft) -> None:
    """Fill the tables of links and devices, and of features between them."""
    draft.pipe_names, draft.pipe_table = draft.fill("pipe", rec.PIPE)
    for feature in draft.features:
        feature.lower(draft)
    draft.column_names, draft.column_table = draft.fill("column", rec.COLUMN)
    draft.valve_names, draft.valve_table = draft.fill("valve", rec.VALVE)
    lower_devices(draft)
    for row in draft.pipe_table:
        for end in ("from_node", "to_node"):
            draft.node_table["admittance"][row[end]] += row["end_admittance"]
    for feature in draft.features:
        feature.lower_behind_links(draft)


def profile_size(draft: ModelDraft) -> int:
    """Size of the array `profile`, with data of the initial steady state along pipes; sets the offsets of each pipe.

    It starts with the sum of both waves at which each cell reaches vapour pressure [kg/s]. Under the density law
    `linear`, masses per length at centres follow if a feature reads them. Under other density laws, each pipe adds
    masses per length at faces [kg/m], momentum fluxes at faces [N], masses per length at centres and, unless it is
    straight, rises above its `from` end [m].
    """
    at = draft.cells
    if draft.case.law.linear:
        return 2 * at if any(feature.reads_masses for feature in draft.features) else at
    for row, mesh in zip(draft.pipe_table, draft.meshes, strict=True):
        n = row["cells"]
        row["face"], row["flux"], row["center"] = at, at + n + 1, at + 2 * n + 2
        at += 3 * n + 2
        if mesh.profile is not None:
            row["rise"] = at
            at += 2 * n + 1
    return int(at)


def fill_rises(draft: ModelDraft) -> None:
    """Set the rises above the `from` end at faces and centres of pipes with an elevation profile [m]."""
    for row, mesh in zip(draft.pipe_table, draft.meshes, strict=True):
        if row["rise"] >= 0:
            heights = mesh.profile.at(np.linspace(0.0, mesh.length, 2 * mesh.cells + 1))
            low, high = draft.node_table["elevation"][[row["from_node"], row["to_node"]]]
            heights[0], heights[-1] = low, high
            draft.tables.profile[row["rise"] :][: heights.size] = heights - low


def pack(draft: ModelDraft, profile: np.ndarray) -> None:
    """Make the tuple of tables, `draft.tables`, and the shapes of run arrays, `draft.shapes`.

    The tuple contains the tables of the draft themselves, so that later changes of their records appear in it.
    `integers` and `floats` are copied. profile : the table `profile`, see `profile_size`
    """
    settings = settings_of(draft)
    draft.probe_table = lower_probes(draft)
    schedules, pieces = draft.schedules.tables(tanks.EVENTS * draft.tanks)
    # from here on constant, as in the model
    schedules.flags.writeable = pieces.flags.writeable = False
    sizes = draft.sizes = ArraySizes()
    reserve_network(draft)
    for feature in draft.features:
        feature.reserve_ledger(draft)
    for feature in draft.features:
        feature.reserve(draft)
    layout = sizes.place()
    for feature in draft.features:
        feature.placed(draft)
    if (draft.probe_table["kind"] == rec.PIPE_FORCE).any():
        layout["forces"] = draft.to_work(most_states(draft))
    if sizes.reads_rates:
        layout["rates"] = draft.to_work(most_states(draft))
    draft.tables = rec.Tables(
        settings=settings,
        layout=layout,
        pipes=draft.pipe_table,
        nodes=draft.node_table,
        valves=draft.valve_table,
        columns=draft.column_table,
        clusters=draft.cluster_table,
        schedules=schedules,
        probes=draft.probe_table,
        devices=draft.device_table,
        couplings=draft.coupling_table,
        integers=np.array(draft.integers, dtype=np.int64),
        floats=np.array(draft.floats, dtype=float),
        profile=profile,
        plane=draft.plane(),
        pieces=pieces,
    )
    sizes.run_array("work", draft.work_size)
    draft.shapes = sizes.shapes()


def reserve_network(draft: ModelDraft) -> None:
    """Reserve the arrays of nodes, pipes, restrictions and columns."""
    nodes = len(draft.node_table)
    pipes = len(draft.pipe_table)
    sizes = draft.sizes
    valves = len(draft.valve_table)
    columns = len(draft.column_table)
    clusters = draft.cluster_table
    sizes.out("pressure", nodes)
    sizes.ledger("supply", nodes)
    for name, size in (
        ("net", nodes),
        ("ends", 4 * pipes),
        ("valve", valves),
        ("column", columns),
        ("valve_controlled", columns),
        ("stiffness", draft.moving),
        ("outflow_fraction", draft.moving),
        ("swept", draft.moving),
        ("conductance", valves),
        ("drive", valves),
        ("isolated", nodes),
    ):
        sizes.out(name, size)
    # `marks` has the first times at which the model does not hold. Density laws with cavities add three for each pipe:
    # location of the first cavity, greatest cavity volume, and its time. The last are: for each valve the time at which
    # it shut off a demand; for each node the first and the last time at which its demand is not supplied, and the first
    # at which its pressure is not determined.
    sizes.first_mark = pipes + 3 * nodes + columns
    sizes.marks = pipes * (4 if draft.case.law.cavitates else 1) + 3 * nodes + columns
    sizes.marks += 2 * len(draft.device_table) + valves + 3 * nodes
    sizes.run_array("clock", 1)
    sizes.flags(tanks.EVENTS * draft.tanks + len(draft.events))
    sizes.run_array("envelope", (4, draft.cells))
    sizes.run_array("extremes", (4, len(draft.probe_table)))
    sizes.run_array("stack", draft.schedules.stack)
    sizes.run_array("accepted", accepted_size(draft))
    for cells in draft.pipe_table["cells"]:
        sizes.need_places(cells)
    sizes.need_scratch(lambda places: 4 * places + 64)
    # equations of a cluster, or of nodes between columns, beside the arrays of all nodes and valves
    system = max(
        (c["matrix"] + 4 * c["nodes"] + 5 * c["valves"] + c["held"] for c in clusters), default=0
    )
    between = int(np.sum(draft.node_table["columns"] > 1))
    sizes.need_scratch(
        max(system, between * (between + 3)) + 6 * nodes + 2 * valves + 5 * len(clusters)
    )


def accepted_size(draft: ModelDraft) -> int:
    """Size of the array `accepted`, from which the iterations of clusters of a model without waves start; else 0.

    Waves and surfaces need short steps, over which the state of the start serves as well.
    """
    if not draft.case.law.linear or len(draft.pipe_table) or draft.meshed:
        return 0
    if not (draft.cluster_table["order"] >= 0).any():
        return 0
    return 2 * (1 + len(draft.node_table) + len(draft.valve_table))


def settings_of(draft: ModelDraft) -> np.ndarray:
    """Settings of a model, a single record : `kernels.dtypes.SETTINGS`[1]."""
    case = draft.case
    pipes = draft.pipe_table
    table = np.zeros(1, rec.SETTINGS)
    s = table[0]
    scheme_settings(s, case.numerics.scheme, case.numerics.limiter)
    s["from_arriving"] = case.numerics.scheme == "upwind" and case.numerics.method == "euler"
    s["viscosity"] = draft.fluid.viscosity or 0.0
    s["start"] = case.numerics.start
    s["reads_solved"] = any(feature.reads_solved for feature in draft.features)
    s["ambient"], s["gravity"] = case.ambient_pressure, case.gravity
    s["swept"] = (draft.node_table["kind"] == rec.MOVING).any()
    s["vapor"], s["unmarked"] = case.law.cavity_pressure, -np.inf
    s["stop_below"] = case.numerics.below_vapor == "stop"
    case.law.lower(draft.fluid, s, draft.floats)
    s["tolerance"] = case.numerics.rtol or 0.0
    s["arrivals"] = any(feature.sets_arrivals for feature in draft.features)
    waves = pipes["speed"] / pipes["dx"] * pipes["rate_factor"]
    if case.numerics.step is not None:  # pipes without cells do not limit a given step
        waves = waves[pipes["cells"] > 0]
    rates = [*waves, *column_rates(draft)]
    rates += [feature.rate(draft) for feature in draft.features]
    s["rate"] = max([0.0, *rates])
    for feature in draft.features:
        feature.change_settings(draft, s)
    return table


def column_rates(draft: ModelDraft):
    """Yield sqrt(k A / L) [1/s] for each rigid column of area A and length L.

    k is the sum of the stiffnesses of its end nodes that are known before the start: chambers, and tanks with their
    least area.
    """
    stiff = draft.node_table["stiffness"]
    for row in draft.column_table:
        k = stiff[row["from_node"]] + stiff[row["to_node"]]
        yield math.sqrt(k * row["area"] / row["length"])


def most_states(draft: ModelDraft) -> int:
    """Upper bound of the number of states, for the greatest possible number of terms of unsteady friction."""
    unsteady = [
        mesh.cells
        for mesh in draft.meshes
        if draft.case.conduits[mesh.name].friction.model == "unsteady"
    ]
    return draft.size + MAX_TERMS * sum(unsteady)


def model_of(
    draft: ModelDraft, notices: Callable[[ModelDraft], list[Notice]] = start_notices
) -> Model:
    """Build the model of a complete draft, with `notices` on its start.

    The state at the start is zero except for what features write.
    """
    case, start = draft.case, np.zeros(draft.size)
    for feature in draft.features:
        feature.start(draft, start)
    first, last = case.numerics.start, case.numerics.end
    inside = sorted((t, jump) for t, jump in draft.schedules.breaks.items() if first <= t <= last)
    draft.warnings += notices(draft)
    draft.warnings += limiter_notices(draft.case.numerics.scheme, draft.case.numerics.limiter)
    return Model(
        case,
        draft.tables,
        draft.shapes,
        draft.state_names,
        np.array(draft.scale),
        inside,
        draft.schedules.spacing,
        draft.meshes,
        list(case.places),
        list(case.links),
        draft.valve_names,
        draft.column_names,
        dict(case.elevations),
        case.probes,
        draft.warnings,
        draft.steady,
        draft.profiles,
        draft.devices,
        draft.laws,
        start,
        draft.events,
        case.extreme_probes,
        draft.watched_start,
        closed(draft),
        flags_at_start(draft),
    )


def settle(draft: ModelDraft) -> list[str]:
    """Let features continue after the start, and write facts of pipes for `fvsolve check`; names of parts given up."""
    facts = draft.steady["lines"] = {}
    for name, link in draft.case.links.items():
        if link.kind == "pipe":
            model = link.pipe_model or draft.case.numerics.pipe_model
            facts[name] = {
                "line": "finite-volume",
                "line_bound": None,
                "line_why": f'pipe_model = "{model}"',
            }
    return [name for feature in draft.features for name in feature.settle(draft)]


def closed(draft: ModelDraft) -> list:
    """Features with complete tables."""
    for feature in draft.features:
        feature.close(draft)
    return draft.features


def flags_at_start(draft: ModelDraft) -> np.ndarray:
    """Event flags before a run : float64[flags]; those of blocks do not always follow from the state."""
    flags = np.zeros(draft.shapes.armed)
    for flag, is_set in draft.start_flags.items():
        flags[flag], flags[flag + 1] = is_set, not is_set
    return flags


@validated(model=instance_of(Model), set=TABLE)
def vary(model: Model, set: Mapping[str, Any]) -> Model:
    """Build the model of the same case with changed keys, for example `{"links.valve.area": 0.002}`.

    The result is identical to the bit to a model built from the changed file, with its faults and notices. Only parts
    that the keys affect, and parts that read a file or a signal, are read again. The initial steady state is solved
    from scratch, so that its last digits do not depend on the earlier model. `model` is not changed. Raises CaseError.
    """
    case = load(model.case, dict(set))
    try:
        return build_like(case, model)
    except CaseError as error:
        raise locate_faults(error, case) from None
