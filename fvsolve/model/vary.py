"""Model of a case with changed keys, derived from an existing model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fvsolve.case import load, locate_faults
from fvsolve.errors import CaseError
from fvsolve.model.build import build_like
from fvsolve.model.model import Model
from fvsolve.validation import TABLE, instance_of, validated


@validated(model=instance_of(Model), set=TABLE)
def vary(model: Model, set: Mapping[str, Any]) -> Model:
    """Build the model of the same case with changed keys, for example `{"links.valve.area": 0.002}`.

    The result is identical to the bit to a model built from the changed file, with its faults and notices. Only parts
    that the keys affect, and parts that read a file or a signal, are read again. The initial steady state is solved
    from scratch, so that its last digits do not depend on the earlier model. `model` is not changed. Raises CaseError.
    """
    case = load(model.case, dict(set))
    try:
        return build_like(case, model)
    except CaseError as error:
        raise locate_faults(error, case) from None
