"""Faults of networks of rotation, electricity and heat: reasons without a unique solution, in the words of a domain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.errors import listing
from fvsolve.features.networks.elimination import NetworkFault, Terms, dependent_stores
from fvsolve.parts.network_elements import FLOW, INERTANCE, Element, node_or_reference

AGREE = 1e-9  # relative difference of two values that are equal
NO_SPEED = "has neither an inertia nor a given speed; give this shaft the key `inertia`"
NO_INERTIA = (
    "its speeds depend on its own torque at once; give the shafts at both ends an `inertia`"
)


class Words(NamedTuple):
    """Words of a domain: its potential and flow, a resistance, a way for a flow, and what determines a potential."""

    potential: str
    flow: str
    resistance: str
    way: str
    anchor: str


WORDS = {
    "rotational": Words(
        "speed",
        "torque",
        "a bearing",
        "give a shaft an `inertia`, or join a bearing",
        "a housing, or give a shaft an `inertia`",
    ),
    "electrical": Words(
        "voltage", "current", "a resistor", "join a resistor in parallel", "a ground"
    ),
    "thermal": Words(
        "temperature",
        "heat flow",
        "a thermal-conductor",
        "join a heat-capacity, or a thermal-conductor to an ambient",
        "an ambient or a heat-capacity",
    ),
}
OTHER = Words("velocity", "force", "a resistance", "give it another way", "a mass or a housing")


def name_of(part: str) -> str:
    """Name of the part at a place such as "links.motor"."""
    return part.partition(".")[2]


def names_of(items: list[Element]) -> list[str]:
    """Names of the parts of elements, each once."""
    return list(dict.fromkeys(name_of(item.part) for item in items))


def words_of(case, item: Element | str) -> Words:
    """Words of the domain of an element, or of a part at a place."""
    part = item if isinstance(item, str) else item.part
    nodes = (
        ()
        if isinstance(item, str)
        else [case.nodes[end].domain for end in item.ends if end in case.nodes]
    )
    group, _, name = part.partition(".")
    found = getattr(case, group, {}).get(name)
    joined = [found.domain] if group == "nodes" else [*getattr(found, "joins", {}).values()]
    return next((WORDS[domain] for domain in (*nodes, *joined) if domain in WORDS), OTHER)


def network_faults(faults: list[NetworkFault], case) -> Iterator[tuple[str, str]]:
    """Yield the faults (place, text) of a network without a unique solution."""
    for fault in faults:
        yield network_fault(fault, case)


def network_fault(fault: NetworkFault, case) -> tuple[str, str]:
    """Place and text of a fault of a network."""
    names = [name_of(part) for part in fault.parts]
    kinds = {name: getattr(case.links.get(name), "kind", "") for name in names}
    dry = [name for name in names if kinds[name] in ("bearing", "clutch")]
    coils = [name for name in names if kinds[name] == "solenoid"]
    if coils and len(names) > 1:
        others = listing([name for name in names if name != coils[0]])
        text = f"its flux gives the current, and {others} in series gives a current too"
        return f"links.{coils[0]}", f"{text}; put a resistor in parallel with one of them"
    if fault.sources and dry:
        return f"links.{dry[0]}", NO_INERTIA
    if fault.tied:
        words, store = words_of(case, fault.tied[0]), fault.tied[0]
        text = f"lies on the source {listing(names_of(fault.sources))}, which gives its "
        text += words.flow if store.kind == INERTANCE else words.potential
        return store.part, f"{text}; put {words.resistance} between them"
    if turning := [
        (name, shaft) for name in names if (shaft := shaft_of(case.links.get(name))) is not None
    ]:
        return f"links.{turning[0][0]}.ports.shaft", f"{turning[0][1]} {NO_SPEED}"
    if fault.sources:
        return contradiction(fault, case)
    words = words_of(case, fault.parts[0]) if fault.parts else OTHER
    if names and all(kinds[name] in ("gear", "rack", "dc-motor") for name in names):
        text = f"{listing(names, 6)} form a closed loop, whose torques are not determined; leave one out"
        return fault.parts[0], text
    text = f"nothing determines the {words.potential} or {words.flow} of {listing(names, 6)}"
    return fault.parts[0] if fault.parts else "links", f"{text}; join {words.anchor}"


def contradiction(fault: NetworkFault, case) -> tuple[str, str]:
    """Place and text of a fault of sources that contradict each other, or the places that they join."""
    first, words = fault.sources[0], words_of(case, fault.sources[0])
    names, flows = names_of(fault.sources), all(item.kind == FLOW for item in fault.sources)
    given = [end for end in first.ends if end in case.nodes and node_or_reference(case, end) != end]
    given += [end for end in first.ends if getattr(case.nodes.get(end), "potential_key", "")]
    if len(names) > 1:
        put = f"{words.resistance} in parallel" if flows else f"{words.resistance} between them"
        quantity = words.flow if flows else words.potential
        return first.part, f"the {quantity}s of {listing(names)} contradict each other; put {put}"
    if flows and given:
        kind = case.nodes[given[0]].kind
        text = f"its {words.flow} acts on {kind} {given[0]}, whose {words.potential} is given; join another place"
        return first.part, text
    if flows:
        where = listing([end for end in first.ends if end is not None])
        return first.part, f"its {words.flow} has no way: nothing at {where} takes it; {words.way}"
    laws = [part for part in fault.laws if part != first.part] or [first.part]
    at = "at its ends" if laws == [first.part] else f"of {names[0]}"
    text = f"its law contradicts the given {words.potential} {at}, and nothing can give way"
    return laws[0], f"{text}; put {words.resistance} between them, or leave it out"


def shaft_of(part) -> str | None:
    """Shaft whose speed the law of a link reads; None without one."""
    return None if part is None else lowering_of(type(part)).turns_with(part)


def stated_faults(
    relations: list[Terms], stores: dict[int, Element], fixed: set[int], case
) -> Iterator:
    """Yield a fault (place, text) for each store whose stated value contradicts those to which it is tied.

    relations, stores, fixed : as for `dependent_stores`
    """
    for column, terms in dependent_stores(relations, stores, fixed).items():
        values = {c: stores[c].initial for c in (column, *terms) if c in stores}
        if len(values) == 1 + len(terms) and None not in values.values():
            total = sum(factor * values[c] for c, factor in terms.items())
            if fault := tie_fault(case, stores, column, values[column], total, terms):
                yield fault


def tie_fault(
    case, stores: dict[int, Element], column: int, found: float, total: float, terms: Terms
):
    """Fault (place, text) of a store that has not the value of stores to which it is tied; None if they agree.

    found : its value; total : value that follows from the others; terms : as in `dependent_stores`
    """
    if abs(total - found) <= AGREE * (abs(total) + abs(found)):
        return None
    item, tied = stores[column], names_of([stores[other] for other in terms if other in stores])
    group, _, name = item.part.partition(".")
    part, quantity = getattr(case, group)[name], item.state.partition(".")[2] or "velocity"
    key = f"initial_{quantity}"
    stated = getattr(part, key, None)
    # of a store whose ends are reversed
    sign = -1.0 if stated is not None and stated * found < 0.0 else 1.0
    shown, expected = (
        case.amount(sign * value, part.quantities[quantity], 6) for value in (found, total)
    )
    text = f"{shown} at the start contradicts "
    text += f"{listing(tied)}, to which it is tied" if tied else "the parts that hold it"
    return item.part + f".{key}" * (stated is not None), f"{text}; expected {expected}"
