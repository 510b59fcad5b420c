"""Notices of a report that differ in place and numbers alone are a single entry."""

from fvsolve.errors import Notice
from fvsolve.report.grouped_notices import grouped_texts


def notices(names, text="{name}: 1.5 m/s is above {k}.2 m/s", kind="range"):
    return [
        Notice(kind, f"links.{name}", text.format(name=name, k=k)) for k, name in enumerate(names)
    ]


def test_nine_alike_notices_are_a_single_entry():
    names = [f"pipe-{k}" for k in range(9)]
    others = ", ".join(names[1:7])
    assert grouped_texts(notices(names)) == [
        f"pipe-0: 1.5 m/s is above 0.2 m/s (9 times; also {others} and 2 more places)"
    ]


def test_two_alike_notices_stay_apart():
    assert len(grouped_texts(notices(["a", "b"]))) == 2


def test_notices_of_other_words_or_kinds_stay_apart():
    found = grouped_texts(
        [
            *notices(["a", "b", "c"]),
            *notices(["a", "b", "c"], "{name}: {k} cells are too few"),
            *notices(["a", "b", "c"], kind="cost"),
        ]
    )
    assert len(found) == 3 and all("(3 times; also b, c)" in text for text in found)


def test_a_name_within_a_longer_name_is_no_place():
    """The part `a` is not a part of the word `a-b` or of `cat`."""
    texts = ["a: a-b is near a", "b: a-b is near b", "c: a-b is near c"]
    found = grouped_texts(Notice("start", f"nodes.{text[0]}", text) for text in texts)
    assert found == ["a: a-b is near a (3 times; also b, c)"]


def test_the_order_of_notices_changes_the_named_place_alone():
    forth, back = (grouped_texts(notices(names)) for names in (["a", "b", "c"], ["c", "b", "a"]))
    assert forth[0].startswith("a: ") and back[0].startswith("c: ") and len(forth) == len(back) == 1
