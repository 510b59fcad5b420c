"""Any file is a case or a CaseError, never another exception, and a resolved case reads back as an equal case."""

import copy
import tomllib

from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference import folders
from reference.case_texts import CHAMBER, DETAILED, TANK, two_tanks
from reference.placed_parts import placed

from fvsolve.case import Case, load
from fvsolve.case.text import key_lines, write
from fvsolve.errors import CaseError

CASES = sorted(folders.CASES.glob("*.toml"))
SEEDS = [
    tomllib.loads(DETAILED),
    two_tanks(),
    tomllib.loads(DETAILED + TANK),
    tomllib.loads(DETAILED + CHAMBER),
]
DESIGN = {
    "limits": {
        "top": {"on": "main", "minimum": "vacuum", "maximum": "20 bar"},
        "quick": {"on": ["main-2"], "quantity": "velocity", "maximum": 3},
    },
    "routes": {"way": {"pipes": ["main"]}},
    "expect": {"max(main.head)": {"value": 1, "rtol": 1}},
}
SEEDS += [placed(bends=[1800.0], **DESIGN)] * 3  # this case has more keys
SEEDS += [tomllib.loads(path.read_text(encoding="utf-8")) for path in CASES]
# without CoolProp, which is not tested here
SEEDS = [{**seed, "fluid": SEEDS[0]["fluid"]} for seed in SEEDS]

WORDS = st.sampled_from(
    """0 bar|-1 barg|3 kg|20 C|1e999 m|5 m|2 m3/h|gate|lake|main|a|valve.flow||.|@
    |gate.pressure@0.5|main.head@0.5
    |3 9**9**9|1 furlong|nodes.gate.head|pipe|tank|rk4|1/0 m|1 (((m|stiff|inf|nan m|
    1 \N{SNOWMAN}|\0|../..|x.csv
    |1,5 m|5""".split("|")
)
SCALARS = st.one_of(
    WORDS,
    st.text(max_size=8),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.just(10**400),
    st.none(),
    st.dates(),
    st.sampled_from([0, 1, -1, 1e-300, 1e300]),
)
KEYS = st.one_of(
    st.text(max_size=6),
    st.sampled_from(
        """type from to length diameter head pressure time value kind file signal start duration exponent
        level area opening characteristic cells courant step rtol elevation units probes signals nodes links
        wall friction Kv""".split()
    ),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)


def places(table, path=()):
    """Every key path of nested tables and lists."""
    items = (
        table.items()
        if isinstance(table, dict)
        else enumerate(table)
        if isinstance(table, list)
        else ()
    )
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


@st.composite
def spoiled(draw):
    """Valid case with a few keys deleted, replaced, renamed, added or copied."""
    case = copy.deepcopy(draw(st.sampled_from(SEEDS)))
    for _ in range(draw(st.integers(1, 4))):
        every = list(places(case))
        if not every:
            break
        *path, key = draw(st.sampled_from(every))
        table = case
        for one in path:
            table = table[one]
        change = draw(st.sampled_from(["delete", "replace", "rename", "add", "copy"]))
        if change == "delete":
            del table[key]
        elif change == "rename" and isinstance(table, dict):
            table[draw(KEYS)] = table.pop(key)
        elif change == "add" and isinstance(table, dict):
            table[draw(KEYS)] = draw(VALUES)
        elif change == "copy":
            source = draw(st.sampled_from(every))
            found = case
            try:
                for one in source:
                    found = found[one]
            except (KeyError, IndexError, TypeError):
                continue
            table[key] = copy.deepcopy(found)
        else:
            table[key] = draw(VALUES)
    return case


def case_or_faults(source, set=None):
    try:
        case = load(source, set=set)
    except CaseError as error:
        assert error.faults and all(fault.message for fault in error.faults) and str(error)
        return None
    assert isinstance(case, Case)
    return case


@examples(150)
@given(spoiled())
def test_a_spoiled_dict_is_a_case_or_faults(given_case):
    case = case_or_faults(given_case)
    if case is not None and not case.files:
        assert load(tomllib.loads(case.resolved())) == case


@examples(150)
@given(case=spoiled())
def test_a_spoiled_file_is_a_case_or_faults(tmp_path, case):
    path = tmp_path / "case.toml"
    try:
        text = write(case)
        path.write_bytes(text.encode())
    except UnicodeEncodeError:
        return
    found = case_or_faults(path)
    assert found is None or found.name == "case"


@examples(150)
@given(text=st.text(), cut=st.integers(0, len(DETAILED)), drop=st.integers(0, 12))
def test_a_file_with_noise_is_a_case_or_faults(tmp_path, text, cut, drop):
    path = tmp_path / "case.toml"
    path.write_bytes(
        (DETAILED[:cut] + text + DETAILED[cut + drop :]).encode("utf-8", "surrogatepass")
    )
    case_or_faults(path)


@examples(150)
@given(data=st.binary(max_size=60))
def test_a_file_of_bytes_is_faults(tmp_path, data):
    path = tmp_path / "case.toml"
    path.write_bytes(data)
    assert case_or_faults(path) is None


@examples(150)
@given(
    seed=st.sampled_from(SEEDS),
    key=st.lists(KEYS, min_size=1, max_size=4),
    value=VALUES | st.text(),
)
def test_any_setting_is_a_case_or_faults(seed, key, value):
    case_or_faults(seed, set={".".join(key): value})


@examples(150)
@given(
    data=st.binary(max_size=80)
    | st.text(max_size=80).map(lambda text: f"t,s\n{text}".encode("utf-8", "replace"))
)
def test_any_schedule_file_is_a_schedule_or_faults(tmp_path, data):
    (tmp_path / "x.csv").write_bytes(data)
    (tmp_path / "case.toml").write_text(DETAILED)
    case_or_faults(tmp_path / "case.toml", set={"links.valve.opening": {"file": "x.csv"}})


@examples(150)
@given(spoiled())
def test_every_key_of_a_text_has_its_line(given_case):
    text = write(given_case)
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError):
        return
    lines = key_lines(text)
    assert all(place in lines for place in places(table))
