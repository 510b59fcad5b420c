"""Cases that are refused: the error that reading them raises."""

import pytest

import fvsolve


def refused(case, match: str | None = None, **more) -> fvsolve.CaseError:
    """Error that `fvsolve.load` raises for a case; match : pattern that is found in its text."""
    with pytest.raises(fvsolve.CaseError, match=match) as caught:
        fvsolve.load(case, **more)
    return caught.value


def messages_of(case):
    """Return the faults of a case: place -> message."""
    return {fault.place: fault.message for fault in refused(case).faults}
