"""Scalars in moles for cases with reactions."""

MOLES = {"unit": "mol/m3"}


def moles(**start) -> dict:
    return {name: {**MOLES, "initial": value} for name, value in start.items()}
