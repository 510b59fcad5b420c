"""Reactions between scalars: equations, rate laws, units of amounts of substance, balance of atoms."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.carried_scalar import MASS_UNIT, Scalar, molar_factor
from fvsolve.parts.formula import SMOOTH_FUNCTIONS, Arithmetic
from fvsolve.parts.formula_program import Program
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import VALUE, Quantity, ReadContext, Text, Value, ValueFault, nonnegative
from fvsolve.units import show

ARROW = "->"
EXAMPLE = '"Cl + 2 B -> P"'
TERM = re.compile(r"(\d+\.?\d*|\.\d+)?[ ]*\*?[ ]*([^\W\d][\w-]*)")
UNIT_HINT = 'expected unit = "mol/m3", "mmol/l", or "mg/l" with `molar_mass`'
BALANCED = 1e-9  # greatest relative difference of counts of atoms


@dataclass(frozen=True)
class ReactionEquation:
    """Equation of a reaction: coefficients of its scalars on the left and on the right side, by name."""

    left: dict[str, float]
    right: dict[str, float]

    @property
    def names(self) -> list[str]:
        """Names of its scalars, each once."""
        return list(dict.fromkeys([*self.left, *self.right]))

    def change(self, name: str) -> float:
        """Amount of a scalar that the reaction forms; negative for what it consumes."""
        return self.right.get(name, 0.0) - self.left.get(name, 0.0)

    def order(self, side: str) -> float:
        """Sum of the coefficients of a side, "left" or "right"."""
        return sum(getattr(self, side).values())


def read_equation(text: Any) -> ReactionEquation:
    """Equation from its text, such as "Cl + 2 B -> P". Raises ValueError."""
    if not isinstance(text, str):
        raise ValueError(f"{show(text)} is not text; expected for example {EXAMPLE}")
    sides = text.split(ARROW)
    if len(sides) != 2:
        hint = "" if "=" not in text else "; a reversible reaction has the key `reverse`"
        raise ValueError(
            f"{show(text)} is not an equation; expected one {ARROW}, for example {EXAMPLE}{hint}"
        )
    left, right = (dict(read_side(side, text)) for side in sides)
    if not left and not right:
        raise ValueError(f"{show(text)} has no scalars; expected for example {EXAMPLE}")
    return ReactionEquation(left, right)


def read_side(side: str, text: str) -> Iterator[tuple[str, float]]:
    """Yield scalars and coefficients of a side of an equation; text : the equation. Raises ValueError."""
    found: dict[str, float] = {}
    for term in side.split("+") if side.strip() else ():
        match = TERM.fullmatch(term.strip())
        if match is None or (match[1] and float(match[1]) == 0.0):
            fault = f"{show(term.strip())} is not a coefficient above 0 and the name of a scalar"
            raise ValueError(f"{show(text)}: {fault}; expected for example {EXAMPLE}")
        found[match[2]] = found.get(match[2], 0.0) + float(match[1] or 1.0)
    yield from found.items()


@dataclass(frozen=True)
class RateConstant(Value):
    """Value of a case file: a constant of mass action, a number in SI or text with a unit by the order."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = "number of at least 0, (mol/m3)^(1 - order)/s"
    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string"]}
    number: ClassVar[Quantity] = Quantity("number", nonnegative)

    def read(self, given: Any, setting: ReadContext) -> float:
        return self.number.read(given, setting)


def constant_in_si(given: Any, order: float) -> Any:
    """Constant of mass action in SI from text with a unit; other values are returned unchanged. Raises ValueError."""
    if not isinstance(given, str):
        return given
    if order == 1.0:
        return units.parse(given, "rate")
    if order not in (0.0, 2.0, 3.0):
        state = "has a unit" if units.is_number_with_unit(given) else "is text"
        raise ValueError(
            f"{show(given)} {state}, and the order is {order:g}; expected a number in mol, m3 and s"
        )
    si = {0.0: "mol/m3/s", 2.0: "m3/mol/s", 3.0: "m6/mol2/s"}[order]
    return units.parse_in(given, si, f"expected a constant of order {order:g} in {si}")


class Reaction(Table):
    """Reaction of scalars with the rate r [mol/m3/s], by which each scalar changes times its coefficient.

    By mass action r = forward prod c^n of the left side - reverse prod c^n of the right side, with coefficients n and
    amounts c [mol/m3]; or r is a formula.
    """

    equation: Annotated[str, Text(f"scalars and coefficients, for example {EXAMPLE}")]
    rate: Annotated[
        str | None, Text("rate [mol/m3/s]: a formula of scalars, amounts in mol/m3")
    ] = None
    forward: Annotated[float | None, RateConstant("constant of mass action of the left side")] = (
        None
    )
    reverse: Annotated[
        float | None, RateConstant("constant of mass action of the right side; none if left out")
    ] = None

    alternatives = (("rate", "forward"), ("rate", "reverse"))
    needs = (("rate", "forward"),)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        faults = super().key_faults(given)
        if "reverse" in given and not {"rate", "forward"} & given.keys():
            faults = [(("reverse",), "has no effect without `forward`; give both keys")]
        return faults

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        if "equation" not in given:
            return given
        faults, result = [], dict(given)
        try:
            equation = read_equation(given["equation"])
        except ValueError as error:
            # of any order
            unknown = {
                key: 0.0 for key in ("forward", "reverse") if isinstance(given.get(key), str)
            }
            raise ValueFault(
                [(("equation",), str(error))], {**given, "equation": "", **unknown}
            ) from None
        for key, side in (("forward", "left"), ("reverse", "right")):
            try:
                result[key] = constant_in_si(given.get(key), equation.order(side))
            except ValueError as error:
                faults.append(((key,), str(error)))
                result[key] = 0.0
        result = {key: value for key, value in result.items() if key in given}
        if faults:
            raise ValueFault(faults, result)
        return result

    @property
    def sides(self) -> ReactionEquation:
        """Coefficients of its scalars on both sides of the equation."""
        return read_equation(self.equation)

    @property
    def reversible(self) -> bool:
        """True if its affinity is finite: it follows mass action in both directions."""
        return bool(self.forward) and bool(self.reverse)

    @property
    def law(self) -> str:
        """Text of its rate, such as "0.3 A B^2 - 0.1 P" or a formula."""
        if self.rate is not None:
            return self.rate
        sides, terms = self.sides, []
        for constant, side in ((self.forward, sides.left), (self.reverse, sides.right)):
            if constant is not None:
                factors = [
                    name if order == 1.0 else f"{name}^{order:g}" for name, order in side.items()
                ]
                terms.append(" ".join([f"{constant:g}", *factors]))
        return " - ".join(terms)

    def program(self, scalars: dict[str, Any]) -> Program:
        """Steps of the formula of the rate; its inputs are all scalars of the case. Raises ValueError."""
        Arithmetic(self.rate, names=("pi", *scalars), functions=SMOOTH_FUNCTIONS)
        program = Program(self.rate, tuple(scalars), clock=False)
        if program.kinks:
            text = "has kinks: comparisons, abs, min or max; expected a smooth formula of scalars"
            raise ValueError(f"{show(self.rate)} {text}")
        return program


def unit_fault(scalar: Scalar, reaction: str) -> tuple[tuple[str, ...], str] | None:
    """Fault (keys, text) of the unit of a scalar of a reaction; None for an amount; reaction : its name."""
    if molar_factor(scalar) is not None:
        return None
    if scalar.unit.replace(" ", "").replace("L", "l") == MASS_UNIT:
        return (
            (),
            f'molar_mass is missing: reaction {reaction} converts "mg/l" to mol/m3; give molar_mass = "NUMBER g/mol"',
        )
    return (
        "unit",
    ), f"{show(scalar.unit)} is not an amount, which reaction {reaction} needs; {UNIT_HINT}"


def atom_faults(equation: ReactionEquation, scalars: dict[str, Scalar]) -> Iterator[str]:
    """Yield the text of a fault for each element whose atoms do not balance; none if a composition is not stated."""
    compositions = {name: scalars[name].composition for name in equation.names}
    if not all(compositions.values()):
        return
    for element in dict.fromkeys(element for atoms in compositions.values() for element in atoms):
        left, right = (
            sum(count * compositions[name].get(element, 0.0) for name, count in side.items())
            for side in (equation.left, equation.right)
        )
        if abs(left - right) > BALANCED * max(left, right):
            yield f"{element} does not balance: {left:g} on the left, {right:g} on the right; expected equal counts"


def name_faults_of(equation: ReactionEquation, scalars: dict[str, Any]) -> Iterator[str]:
    """Yield the text of a fault for each name in an equation that is no scalar of the case."""
    for name in equation.names:
        if name not in scalars:
            known = (
                f"; scalars are {listing(scalars)}" if scalars else "; the case has no [scalars]"
            )
            yield f"unknown scalar {show(name)}{did_you_mean(name, scalars) or known}"
