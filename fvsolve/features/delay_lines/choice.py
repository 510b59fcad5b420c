"""Choice of the pipes that are delay lines, and of the steps which they imply."""

import math
from collections.abc import Collection
from dataclasses import dataclass

from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import AUTO, method_named


@dataclass(frozen=True)
class LineMethod:
    """Method for a pipe ("finite-volume" or "delay-line"), the reason for it, and the steps that it implies.

    rate : wave rate of all delay lines: key `cells` of the line with the longest travel time, over this time [1/s]
    longest : longest step [s]; stretches have at least this travel time, or the line is shorter than a step
    For "finite-volume" they are 0 and infinite.
    """

    pipe_model: str
    reason: str
    rate: float = 0.0
    longest: float = math.inf


def line_methods(case, unfit: Collection[str] = ()) -> dict[str, LineMethod]:
    """Method for every pipe : name of the pipe -> LineMethod.

    unfit : names of pipes whose estimated error as delay lines exceeds `numerics.delay_tolerance`
    """
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    methods, lines = {}, []
    for name, link in pipes.items():
        line = link.pipe_model or case.numerics.pipe_model
        need = "" if line == "finite-volume" else reason_for_cells(case, name, link)
        if line == "auto" and case.controls:
            need = need or "a control may change values at any rate"
        if line == "finite-volume" or need:
            methods[name] = LineMethod("finite-volume", need or f'pipe_model = "{line}"')
        elif name in unfit:
            methods[name] = LineMethod(
                "finite-volume", "its error as a delay line may exceed numerics.delay_tolerance"
            )
        else:
            lines.append(name)
    if not lines:
        return {name: methods[name] for name in pipes}
    travel = {name: link.length / case.wave_speed(name) for name, link in pipes.items()}
    slowest = slowest_pipe(case, lines)
    rate = pipes[slowest].cells / travel[slowest]
    cells = max((pipes[name].cells / travel[name] for name in methods), default=0.0)
    numerics = case.numerics
    longest = 1.0 / rate  # under error control, see `solve.run_loop.longest_step`
    if numerics.step is not None or numerics.courant is not None:
        longest = numerics.step or numerics.courant / max(rate, cells)
    steppers = (
        (automatic.EXPLICIT, automatic.IMPLICIT) if numerics.method == AUTO else (numerics.method,)
    )
    # no value is read that is not yet known
    longest *= max(1.0, *(time for method in steppers for time in method_named(method).times))
    for name in lines:
        reason = "waves travel along it unchanged except for friction"
        if travel[name] < longest:
            reason += f", and in less than a step of {case.step_amount(longest, 4)}"
        methods[name] = LineMethod("delay-line", reason, rate, longest)
    return {name: methods[name] for name in pipes}


def slowest_pipe(case, names: Collection[str]) -> str:
    """Name of the pipe with the longest travel time of a wave; with most cells if several have the longest."""
    travel = {name: case.links[name].length / case.wave_speed(name) for name in names}
    longest = (1.0 - 1e-9) * max(travel.values())  # travel times that differ by rounding are equal
    return max(
        names, key=lambda name: (travel[name] > longest, case.links[name].cells, travel[name])
    )


def reason_for_cells(case, name: str, link) -> str:
    """Reason why a pipe must be computed with cells; "" if it can be a delay line."""
    if not case.law.linear:
        return f'law = "{case.law.name}" changes waves as they travel'
    if case.scalars:
        return "scalars are carried in cells"
    if link.friction.model == "unsteady":
        return "unsteady friction depends on the flow history of every cell"
    if link.creep_elements:
        return "its wall creeps in every cell"
    if any(getattr(case.places[end], "on", None) for end in link.ports.values()):
        return "the acceleration of its body acts on its cells"
    if name in case.links_with_force_probe:
        return "a probe reads its force, which is computed from cells"
    return ""
