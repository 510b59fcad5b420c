"""Tables of a case that a file outside the package declares: keys, faults, resolved case, and hash of the case."""

import textwrap

import pytest

import fvsolve
from fvsolve.case import declared_tables
from fvsolve.case.declared_tables import DECLARED

TABLE = '''
"""Table of a case for a survey."""

from typing import Annotated

from fvsolve.case.declared_tables import DeclaredTable
from fvsolve.declarations import declared
from fvsolve.parts.value import Quantity, Text, positive


@declared("case table", "survey")
class Survey(DeclaredTable):
    """Table `[survey]`."""

    surveyor: Annotated[str, Text("name of the surveyor")]
    spacing: Annotated[float, Quantity("length", positive, "distance of points [m]")] = 10.0
'''


@pytest.fixture
def survey(tmp_path, monkeypatch):
    path = tmp_path / "survey_table.py"
    path.write_text(textwrap.dedent(TABLE))
    monkeypatch.setenv(DECLARED.variable, str(path))


def test_a_table_of_another_package_is_read_with_units_and_defaults(survey):
    case = fvsolve.load("two-tanks", set={"survey": {"surveyor": "A", "spacing": "2 km"}})
    assert case.declared["survey"].spacing == 2000.0
    again = fvsolve.load({**case.table()})
    assert again.declared == case.declared and "[survey]" in case.resolved()
    assert fvsolve.load("two-tanks").declared == {}


def test_faults_of_a_table_of_another_package_are_named(survey):
    with pytest.raises(fvsolve.CaseError) as caught:
        fvsolve.load("two-tanks", set={"survey": {"spacing": "-1 m", "space": 1}})
    text = str(caught.value)
    assert "survey.spacing: " in text and "survey.space: unknown key; did you mean" in text
    assert "survey: surveyor is missing" in text


def test_a_table_counts_in_the_identity_of_a_case_unless_it_states_otherwise(survey, monkeypatch):
    cases = [fvsolve.load("two-tanks", set={"survey.surveyor": name}) for name in ("A", "B")]
    assert cases[0].identity_text != cases[1].identity_text
    monkeypatch.setattr(type(cases[0].declared["survey"]), "changes_results", False)
    cases = [fvsolve.load("two-tanks", set={"survey.surveyor": name}) for name in ("A", "B")]
    assert cases[0].identity_text == cases[1].identity_text


def test_without_its_package_the_table_is_an_unknown_key():
    with pytest.raises(fvsolve.CaseError, match="survey: unknown key"):
        fvsolve.load("two-tanks", set={"survey.surveyor": "A"})
    assert declared_tables.DECLARED.own().keys() == {"report", "gis"}
