"""The model of a case with some keys changed, made of the one that is there. Knows no file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fvsolve.case import load, located
from fvsolve.doors import TABLE, door, made
from fvsolve.errors import CaseError
from fvsolve.model.build import built
from fvsolve.model.model import Model


@door(model=made(Model), set=TABLE)
def vary(model: Model, set: Mapping[str, Any]) -> Model:
    """The model of the same case with keys changed, for example `{"links.valve.area": 0.002}`.

    To the bit what a fresh run makes, with its faults and notices: read again is what the keys touch, and what asks for
    a file or a signal. The profile is solved from the beginning, as the last digits of an answer found from another
    would be others. `model` stays as it is. Raises CaseError.
    """
    case = load(model.case, dict(set))
    try:
        return built(case, model)
    except CaseError as error:
        raise located(error, case) from None
