"""Checks of blocks of other packages, of their conversions and laws: some faults give wrong numbers."""

from __future__ import annotations

from typing import Any

from fvsolve.core.assembly import lowering_checks as checks
from fvsolve.core.kernels.calls import hook_of
from fvsolve.errors import FvsolveError
from fvsolve.features.controls.kernels.tables import HOOKS


def checked(control: type, own: Any, static: type, base: type) -> Any:
    """Conversion of a class of blocks. Raises FvsolveError for a fault of the conversion or of its law.

    own : the conversion; static, base : classes of which it inherits methods that it must have itself
    """
    faults = [*checks.faults_of_kind(control, own)]
    if not faults:
        place = checks.place_of(type(own))
        faults += checks.faults_of_methods(type(own))
        law = getattr(own, "law", None)
        faults += checks.faults_of_law(law, HOOKS)
        if law is None:
            faults.append(f"{place}: a block has no law; expected `law = law`")
        elif not faults and all(hook_of(law, hook, HOOKS) is None for hook in ("decide", "sample")):
            faults.append(f'{checks.law_file(law)} has neither "decide" nor "sample"')
        if isinstance(own, static) and type(own).value is static.value:
            faults.append(f'{place} has no method "value", which gives the output at the start')
        elif type(own).residual is base.residual:
            faults.append(f'{place} has no method "residual", which is zero at rest')
    if faults:
        raise FvsolveError(f"{checks.source_of_part(control)}: {'; '.join(faults)}")
    return own


def check_block(name: str, control: Any, own: Any) -> None:
    """Raise FvsolveError if the law of a block lacks a function that this block needs: else it would be called."""
    missing = ""
    if control.period is None and hook_of(own.law, "decide", HOOKS) is None:
        missing = '"decide"; a block without it needs a `period`'
    elif (
        control.period is None and own.states(control) and hook_of(own.law, "adapt", HOOKS) is None
    ):
        missing = '"adapt", which writes the rates of its states'
    if missing:
        place = f"{checks.source_of_part(type(control))}, in controls.{name}"
        raise FvsolveError(f"{place}: {checks.law_file(own.law)} has no function {missing}")
