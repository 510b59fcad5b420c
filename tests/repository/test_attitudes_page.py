"""Examples of docs/attitudes.md: attitudes are read, and lines of Python print the output on the page."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest
from reference import folders
from reference.folders import printed_otherwise, python_of

from fvsolve.parts.attitude_keys import Attitude

PAGE = folders.page("attitudes")
FORMS = re.findall(r"^attitude = .*$", PAGE, re.MULTILINE)


def test_there_is_an_example_of_every_form():
    assert {key for form in FORMS for key in tomllib.loads(form)["attitude"]} == {*Attitude.keys()}


@pytest.mark.parametrize("form", FORMS)
def test_the_forms_of_the_page_are_read(form):
    read = Attitude.model_validate(tomllib.loads(form)["attitude"])
    assert np.allclose(read.rotation @ read.rotation.T, np.eye(3), atol=1e-15) and not [*read.unusual()]


def test_lines_of_python_print_what_stands_below_them():
    assert printed_otherwise(python_of(PAGE)) == ""


def test_lines_that_print_otherwise_are_seen():
    assert "Expected" in printed_otherwise(">>> 1 + 1\n3\n")
