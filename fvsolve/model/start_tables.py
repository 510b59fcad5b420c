"""Initial steady state, filled into the tables of a draft."""

from __future__ import annotations

from typing import Any

from fvsolve.assembly.unsteady_terms import add_terms
from fvsolve.assembly.wall_creep import limit_creep_step
from fvsolve.model.chamber_loads import find_closed_chambers, supporting_pressures
from fvsolve.model.probe_tables import probe_offsets
from fvsolve.model.steady_start import SteadyStart


def start_profile(draft) -> dict[str, Any]:
    """Compute the initial steady state and fill it into the tables of a draft; return facts for `fvsolve check`.

    Raises CaseError if no steady state is found.
    """
    if draft.case.law.linear:
        start = SteadyStart(draft)
    else:
        from fvsolve.model.nonlinear_start import NonlinearStart  # not loaded under the linear law

        start = NonlinearStart(draft)
    start.solve()
    find_closed_chambers(draft, start)
    if start.set_supporting_pressures(supporting_pressures(draft, start)):
        start.solve()
    start.report_frictionless()
    start.freeze_factors()
    start.fill_nodes()
    start.fill_pipes()
    start.fill_columns()
    start.fill_valves()
    start.begin_devices()
    probe_offsets(draft, start)
    unsteady = add_terms(draft)
    return {**start.report(), "unsteady": unsteady, "creep": limit_creep_step(draft, unsteady)}
