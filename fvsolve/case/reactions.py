"""Reading of `[reactions]`: names, units of scalars, balance of atoms, formulas of rates, quantities of probes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from fvsolve.case.reading import Reading
from fvsolve.case.resource_checks import name_faults
from fvsolve.parts.reaction import Reaction, atom_faults, name_faults_of, unit_fault

PREFIX = "reactions."
MOLAR_FLOW = {"rate": "molar_flow"}
CHEMICAL_PORT = {"affinity": "affinity", "power": "power"}


@dataclass(frozen=True)
class ReactionQuantities:
    """Quantities of a reaction that a probe may read: name -> dimension.

    missing : reason why the quantities of the chemical port are not finite; "" if they are
    scalar : a scalar of the reaction, whose places are those of the reaction
    """

    scalar: str
    missing: str
    kind: str = "reaction"
    along: dict[str, str] = field(default_factory=dict)

    @property
    def quantities(self) -> dict[str, str]:
        return MOLAR_FLOW | ({} if self.missing else CHEMICAL_PORT)


def read_reactions(reading: Reading, scalars: Mapping[str, Any]) -> dict[str, Reaction | None]:
    """Reactions of a case by name; None for a faulty reaction. scalars : by name, None if faulty"""
    if "reactions" not in reading.raw.table:
        return {}
    for group in ("nodes", "links"):
        if "reactions" in reading.raw.table.get(group, {}):
            reading.fault(
                (group, "reactions"),
                '"reactions" is the name of the reactions; expected another name',
            )
    result: dict[str, Reaction | None] = {}
    units_checked: set[str] = set()
    for name, given in reading.group("reactions").items():
        result[name] = None
        reading.add((("reactions", name), text) for text in name_faults(name))
        with reading.catch("reactions", name):
            reaction = Reaction.model_validate(given, context=reading.setting)
            faults = list(faults_of_scalars(name, reaction, scalars, units_checked))
            reading.add(faults)
            result[name] = None if faults else reaction
    return result


def faults_of_scalars(
    name: str, reaction: Reaction, scalars: Mapping[str, Any], checked: set[str]
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield faults (key path, text) of a reaction and its scalars; checked : scalars with units already checked."""
    place, equation = ("reactions", name), reaction.sides
    unknown = list(name_faults_of(equation, scalars))
    yield from ((place + ("equation",), text) for text in unknown)
    sound = {key: scalars[key] for key in equation.names if scalars.get(key) is not None}
    for key, scalar in sound.items():
        if key not in checked and (fault := unit_fault(scalar, name)) is not None:
            yield ("scalars", key, *fault[0]), fault[1]
        checked.add(key)
    if len(sound) == len(equation.names):
        yield from ((place + ("equation",), text) for text in atom_faults(equation, sound))
    if reaction.rate is not None:
        try:
            reaction.program(scalars)
        except ValueError as error:
            yield (*place, "rate"), str(error)


def reaction_kinds(
    reactions: Mapping[str, Reaction | None],
) -> dict[str, ReactionQuantities | None]:
    """Quantities of reactions, as for `read_probe`; None for a faulty reaction."""
    return {
        f"{PREFIX}{name}": item and ReactionQuantities(item.sides.names[0], missing_port(item))
        for name, item in reactions.items()
    }


def missing_port(reaction: Reaction) -> str:
    """Reason why a reaction has no finite affinity; "" if it has one."""
    if reaction.reversible:
        return ""
    if reaction.rate is not None:
        return "its rate is a formula; affinity and power need `forward` and `reverse`"
    return "its affinity is infinite without a rate in both directions; give `forward` and `reverse` above 0"
