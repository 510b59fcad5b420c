"""Outflows from basins that critical flow limits."""

import numpy as np

from fvsolve.core.solve.run_summary import Mark, scheduled_volume
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.lower import HELD

HELD_TEXTS = (  # of a scheduled outflow, and of an outflow through links or from an interior patch
    (
        "the scheduled outflow",
        "less than scheduled have left; give less outflow, or `stage` or `rating`",
    ),
    (
        "the flow drawn from it",
        "were added to meet it (`made_up` in the mass balance); draw less, or widen the patch",
    ),
)


def held_discharges(
    run_data, patches: np.ndarray, start: float, t: float, entered: np.ndarray
) -> list[Mark]:
    """Marks of patches whose scheduled outflow, or that of their links, is more than critical flow, which leaves.

    patches : table of patches; start, t : times of start and end [s]
    entered : float64[nodes]  mass that has entered at each node [kg]
    """
    model, marks = run_data.model, []
    times = run_data.marks[len(model.pipes) + len(model.node_names) :]
    for row in patches[np.isin(patches["closure"], HELD)]:
        name = model.node_names[row["node"]].removesuffix(".inside")
        time = float(times[row["node"]])
        if np.isfinite(time):
            basin, _, patch = name.partition(".")
            volume = float(entered[row["node"]]) / model.case.properties.density
            linked = row["closure"] != records.DISCHARGE
            if not linked:
                volume -= scheduled_volume(
                    model.case.nodes[basin].patches[patch].discharge, start, t
                )
            lack, when = model.case.amount(volume, "volume", 4), model.case.moment(time, 4)
            drawn, result = HELD_TEXTS[int(linked)]
            text = f"{name}: from {when} on {drawn} is more than critical flow, which leaves instead; {lack} {result}"
            marks.append(Mark("discharge held", f"nodes.{name}", time, text, volume))
    return marks
