"""Table of reactions: rate laws and coefficients, rates at the start, couplings of amounts, modes of reactions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.formula_programs import INPUT
from fvsolve.core.steppers.tableau import AUTO, METHODS
from fvsolve.errors import listing
from fvsolve.features.scalars.kernels.tables import REACTION
from fvsolve.features.scalars.own_tables import scalar_tables
from fvsolve.parts.carried_scalar import molar_factor
from fvsolve.parts.formula import means, samples

if TYPE_CHECKING:
    from fvsolve.parts.reaction import Reaction

GAS_CONSTANT = 8.31446261815324  # [J/mol/K], exact in the SI


def lower_reactions(draft, own) -> None:
    """Fill the table of reactions, and the factors of scalars that are amounts; add faults of rates at the start.

    own : the feature, which receives the table
    """
    case, scalars = draft.case, own.scalars
    for row, scalar in zip(scalars, case.scalars.values(), strict=True):
        row["molar"] = 1.0
        if case.reactions:
            row["molar"] = molar_factor(scalar) or 1.0
    if not case.reactions:
        return
    table = own.reactions = np.zeros(len(case.reactions), REACTION)
    method = METHODS.get(case.numerics.method)
    explicit, places = method is not None and method.explicit, draft.size - int(scalars["y"][0])
    places = int(scalars["y"][1] - scalars["y"][0]) if len(scalars) > 1 else places
    places += sum(part.n for part in draft.meshed)
    for row, reaction in zip(table, case.reactions.values(), strict=True):
        sides, names = reaction.sides, reaction.sides.names
        row["program"] = -1
        if reaction.rate is not None:
            program = reaction.program(case.scalars)
            row["program"] = draft.schedules.add_program(program, located=False)
        row["forward"], row["reverse"] = reaction.forward or 0.0, reaction.reverse or 0.0
        row["thermal"] = GAS_CONSTANT * case.properties.temperature
        row["scalars"], row["count"], row["data"] = (
            len(draft.integers),
            len(names),
            len(draft.floats),
        )
        for name in names:
            q = list(case.scalars).index(name)
            draft.integers.append(q)
            draft.floats += [sides.left.get(name, 0.0), sides.right.get(name, 0.0)]
            draft.floats.append(sides.change(name) / float(scalars["molar"][q]))
        row["limits"] = explicit or case.numerics.method == AUTO
        row["extent"], row["extents"] = sum(table["extents"]), 1 if explicit else places
    draft.schedules.stack = max(draft.schedules.stack, len(scalars) + 1)
    for name, reaction in case.reactions.items():
        check_start(draft, name, reaction)


def reserve_reactions(draft, own) -> None:
    """Reserve the arrays of reactions; rows of the ledger: rates times the mass that reacts."""
    draft.sizes.ledger("extent", sum(own.reactions["extents"]))
    draft.sizes.out("quickest", len(own.reactions) > 0)


def reacting(case, side: str = "") -> set[str]:
    """Names of the scalars that reactions change; side : "right" for those that may grow, "left" for those that fall.

    A formula may have either sign.
    """
    sign, names = {"right": 1.0, "left": -1.0, "": 0.0}[side], set()
    for reaction in case.reactions.values():
        sides = reaction.sides
        both = reaction.rate is not None or bool(reaction.reverse) or not side
        changes = {name: sides.change(name) for name in sides.names}
        names |= {
            name
            for name, change in changes.items()
            if change * sign > 0.0 or (both and change != 0.0)
        }
    return names


def names_read(reaction: Reaction, scalars: dict[str, Any]) -> list[str]:
    """Names of the scalars on which the rate of a reaction depends; scalars : those of the case."""
    if reaction.rate is None:
        sides = reaction.sides
        return [
            *sides.left,
            *(name for name in sides.right if reaction.reverse and name not in sides.left),
        ]
    names = list(scalars)
    return list(
        dict.fromkeys(
            names[int(number)] for code, number in reaction.program(scalars).steps if code == INPUT
        )
    )


def rate_at(reaction: Reaction, case, values: dict[str, float]) -> float:
    """Rate of a reaction [mol/m3/s] at values of scalars in their own units; it may not be finite."""
    amounts = {
        name: value * (molar_factor(case.scalars[name]) or 1.0) for name, value in values.items()
    }
    if reaction.rate is not None:
        return reaction.program(case.scalars).value(
            0.0, inputs=tuple(amounts[name] for name in case.scalars)
        )
    sides, result = reaction.sides, 0.0
    for constant, side in (
        (reaction.forward, sides.left),
        (-(reaction.reverse or 0.0), sides.right),
    ):
        result += constant * math.prod(amounts[name] ** order for name, order in side.items())
    return result


def start_values(case, kinds, meshes: list, basins: list) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield places of reactions with the values of scalars at the start; of a basin cells with extreme values.

    kinds : of nodes, as in their table; meshes : of pipes; basins : basins of the model
    """
    scalars = case.scalars
    for (name, part), kind in zip(case.places.items(), kinds, strict=True):
        if kind in (rec.TANK, rec.CHAMBER):
            stated = part.scalars
            yield (
                name,
                {
                    key: stated[key].first if key in stated else item.initial
                    for key, item in scalars.items()
                },
            )
    for mesh in meshes:
        stated = case.links[mesh.name].scalars
        yield mesh.name, {key: stated.get(key, item.initial) for key, item in scalars.items()}
    for basin in basins:
        if not basin.scalars:
            continue
        stated = case.nodes[basin.name].scalars
        cells = {
            key: means(samples(stated[key], basin.mesh))
            if key in stated
            else np.full(basin.n, item.initial)
            for key, item in scalars.items()
        }
        extremes = {
            int(choose(values)) for values in cells.values() for choose in (np.argmin, np.argmax)
        }
        for i in sorted(extremes):
            x, y = basin.mesh.centre[i]
            yield (
                f"{basin.name} at x = {x:.6g} m, y = {y:.6g} m",
                {key: float(cells[key][i]) for key in cells},
            )


def check_start(draft, name: str, reaction: Reaction) -> None:
    """Add a fault if the rate of a reaction is not finite at the start, with the first such place and its values."""
    for place, values in start_values(
        draft.case, draft.node_table["kind"], draft.meshes, draft.meshed
    ):
        try:
            finite = math.isfinite(rate_at(reaction, draft.case, values))
        except (OverflowError, ZeroDivisionError):
            finite = False
        if not finite:
            key = "rate" if reaction.rate is not None else "forward"
            read = [
                f"{item} = {values[item]:g}" for item in names_read(reaction, draft.case.scalars)
            ]
            text = f"{reaction.law} is not finite at the start in {place}, where {listing(read)}"
            draft.fault(
                f"reactions.{name}.{key}",
                f"{text}; expected a finite rate, or values above 0 there",
            )
            return


def reaction_facts(model) -> dict[str, dict[str, Any]]:
    """Facts about reactions, for `fvsolve check`: equation, rate law, molar flow at the start [mol/s]."""
    if not model.case.reactions:
        return {}
    out = model.evaluate(model.case.numerics.start, model.start)[1]
    facts, rho = {}, model.case.properties.density
    for row, (name, reaction) in zip(
        scalar_tables(model).reactions, model.case.reactions.items(), strict=True
    ):
        at = int(model.layout["extent"] + row["extent"])
        flow = float(np.sum(out[at : at + int(row["extents"])])) / rho
        facts[name] = {"equation": reaction.equation, "law": reaction.law, "rate": flow}
    return facts


def reaction_modes(model) -> list[tuple[str, np.ndarray]]:
    """Modes of reactions at the start: pairs of "place.reaction" and eigenvalues [1/s].

    The eigenvalues are those of the slopes of all rates by the extents of all reactions.
    """
    case, modes = model.case, []
    places = (
        start_values(case, model.tables.nodes["kind"], model.pipes, model.meshed)
        if case.reactions
        else ()
    )
    for place, values in places:
        scale = max(abs(value) for value in values.values()) or 1.0
        slopes, step = np.zeros((len(case.reactions),) * 2), 1e-6 * scale
        for k, reaction in enumerate(case.reactions.values()):
            for other_k, other in enumerate(case.reactions.values()):
                moved, sides = dict(values), other.sides
                for name in sides.names:
                    moved[name] += step * sides.change(name) / molar_factor(case.scalars[name])
                slopes[k, other_k] = (
                    rate_at(reaction, case, moved) - rate_at(reaction, case, values)
                ) / step
        modes.append((f"{place}.{next(iter(case.reactions))}", np.linalg.eigvals(slopes)))
    return modes
