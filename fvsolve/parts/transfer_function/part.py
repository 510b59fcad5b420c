"""Transfer functions as blocks: keys and faults."""

from typing import Annotated, Any

from fvsolve.parts.control import SingleInput
from fvsolve.parts.value import Rows
from fvsolve.units import show


class TransferFunction(SingleInput, kind="transfer-function"):
    """Block with the output G(s) x, G = (b0 s^m + ... + bm) / (a0 s^n + ... + an), m at most n.

    Lag, lead-lag, integrator and oscillator are such blocks. `initial` is its output at the start.
    """

    numerator: Annotated[tuple[float, ...], Rows("number", about="b0 to bm, highest power of s first, in SI")]
    denominator: Annotated[tuple[float, ...], Rows("number", about="a0 to an, highest power of s first, in SI")]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        lists = {key: given.get(key) for key in ("numerator", "denominator")}
        for key, values in lists.items():
            numbers = isinstance(values, (list, tuple)) and all(isinstance(x, (int, float)) for x in values) and values
            if not numbers:
                continue
            if values[0] == 0:
                faults.append(((key,), f"{show(values)} begins with a zero; expected the highest power of s first"))
            elif key == "denominator" and len(values) == 1 and len(lists["numerator"] or ()) <= 1:
                text = "has no power of s, so it holds no state; expected a function block for a gain"
                faults.append(((key,), text))
        if all(isinstance(values, (list, tuple)) for values in lists.values()):
            more, fewer = (len(values) for values in lists.values())
            if more > fewer:
                text = f"has the power {more - 1} of s, above that of the denominator; expected at most {fewer - 1}"
                faults.append((("numerator",), text))
        return faults

    @property
    def integrates(self) -> bool:
        return self.denominator[-1] == 0.0

    @property
    def direct(self) -> float:
        """Gain at infinite frequency."""
        return self.numerator[0] / self.denominator[0] if len(self.numerator) == len(self.denominator) else 0.0

    @property
    def passes_at_once(self) -> bool:
        return self.filter is None and self.direct != 0.0
