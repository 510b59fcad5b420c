"""Transfer functions as blocks: keys and faults."""

from typing import Annotated, Any

from fvsolve.parts.control import SingleInput
from fvsolve.parts.value import ReadContext, Rows
from fvsolve.units import show


def numbers_in(given: Any) -> tuple[float, ...]:
    """Numbers of a list in the case file; empty if it is not a list of numbers."""
    try:
        return Rows("number").read(given, ReadContext())
    except ValueError:
        return ()


class TransferFunction(SingleInput, kind="transfer-function"):
    """Block with the output G(s) x, G = (b0 s^m + ... + bm) / (a0 s^n + ... + an), m at most n.

    Lag, lead-lag, integrator and oscillator are such blocks. `initial` is its output at the start.
    """

    numerator: Annotated[
        tuple[float, ...], Rows("number", about="b0 to bm, highest power of s first, in SI")
    ]
    denominator: Annotated[
        tuple[float, ...], Rows("number", about="a0 to an, highest power of s first, in SI")
    ]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        lists = {key: numbers_in(given.get(key)) for key in ("numerator", "denominator")}
        for key, values in lists.items():
            if values and not any(values):
                faults.append(
                    ((key,), f"{show(given[key])} has only zeros; expected a number that is not 0")
                )
            elif values and values[0] == 0.0:
                text = f"{show(given[key])} begins with a zero; expected the highest power of s first, and not 0"
                faults.append(((key,), text))
        above, below = lists.values()
        if len(below) == 1:
            text = f"{show(given['denominator'])} has no power of s; expected two or more numbers, or a function block"
            faults.append((("denominator",), f"{text} for a gain"))
        elif below and len(above) > len(below):
            text = f"{show(given['numerator'])} has the power {len(above) - 1} of s, above that of the denominator"
            faults.append((("numerator",), f"{text}; expected at most {len(below)} numbers"))
        return faults

    @property
    def integrates(self) -> bool:
        return self.denominator[-1] == 0.0

    @property
    def direct(self) -> float:
        """Gain at infinite frequency."""
        return (
            self.numerator[0] / self.denominator[0]
            if len(self.numerator) == len(self.denominator)
            else 0.0
        )

    @property
    def passes_at_once(self) -> bool:
        return self.filter is None and self.direct != 0.0
