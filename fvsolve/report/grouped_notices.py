"""Notices of a report, in which notices that differ in their place and numbers alone are a single entry."""

import re
from collections.abc import Iterable, Sequence

from fvsolve.errors import Notice

LEAST = 3  # least number of alike notices that are grouped
NAMED_PLACES = 6  # greatest number of places named in an entry
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def pattern_of(notice: Notice) -> tuple[str, str]:
    """Kind and text of a notice, with its place and all numbers replaced: equal for alike notices."""
    name = notice.place.partition(".")[2] or notice.place
    text = notice.text
    if name:
        text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", "<place>", text)
    return notice.kind, NUMBER.sub("<number>", text)


def grouped_texts(notices: Iterable[Notice]) -> list[str]:
    """Texts of notices in their order; of alike notices only the first, with their count and the other places."""
    groups: dict[tuple[str, str], list[Notice]] = {}
    for notice in notices:
        groups.setdefault(pattern_of(notice), []).append(notice)
    texts = []
    for group in groups.values():
        if len(group) < LEAST:
            texts += list(dict.fromkeys(notice.text for notice in group))
        else:
            texts.append(f"{group[0].text} ({len(group)} times{_others(group)})")
    return texts


def _others(group: Sequence[Notice]) -> str:
    """Text of the places of all alike notices but the first; "" if they have the same place."""
    names = [notice.place.partition(".")[2] or notice.place for notice in group]
    others = [name for name in dict.fromkeys(names) if name != names[0]]
    if not others:
        return ""
    left = len(others) - NAMED_PLACES
    more = f" and {left} more places" if left > 0 else ""
    return f"; also {', '.join(others[:NAMED_PLACES])}{more}"
