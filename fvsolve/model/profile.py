"""Steady starting profile, filled into the tables of a draft."""

from __future__ import annotations

from typing import Any

from fvsolve.model.creep import pace_creep
from fvsolve.model.holding import find_shut, holding_pressures
from fvsolve.model.probes import probe_offsets
from fvsolve.model.start import Start
from fvsolve.model.unsteady import add_terms


def start_profile(draft) -> dict[str, Any]:
    """Fill the profile's numbers into the tables of a draft; return the facts for `check`."""
    if draft.case.law.linear:
        start = Start(draft)
    else:
        from fvsolve.model.barotropic import BarotropicStart  # not loaded under the linear law

        start = BarotropicStart(draft)
    start.solve()
    find_shut(draft, start)
    if start.hold_loads(holding_pressures(draft, start)):
        start.solve()
    start.report_split()
    start.freeze_factors()
    start.fill_nodes()
    start.fill_pipes()
    start.fill_columns()
    start.fill_valves()
    start.begin_devices()
    probe_offsets(draft, start)
    unsteady = add_terms(draft)
    return {**start.report(), "unsteady": unsteady, "creep": pace_creep(draft, unsteady)}
