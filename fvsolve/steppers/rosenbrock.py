"""Rosenbrock methods with the coefficients printed in their published codes, and their properties.

The stages k_i follow from h k_i = h f(y + sum alpha_ij h k_j) + h J sum gamma_ij h k_j, with the step h, the Jacobian J
and the weights b. Codes avoid the product with J by u = Gamma h k, with the coefficients A = alpha Gamma^-1,
C = diag(1 / gamma) - Gamma^-1, m = b Gamma^-1 (Hairer and Wanner 1996, IV.7).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from fvsolve.steppers.analysis.trees import Conditions
from fvsolve.steppers.tableau import BUILT_IN, METHODS, Array, Method

DIGITS = 14  # accurate digits of the printed numbers after the inversion of Gamma


@dataclass(frozen=True, eq=False)
class Rosenbrock(Method):
    """Stiffly accurate Rosenbrock method with a linear solve for each stage.

    The new state is y+ = y_s + u_s with the last stage y_s, and u_s estimates the error.
    text : rows `c_i d_i | a_i1 a_i2 ...` with the sums c and d of the rows of alpha and Gamma, a ruled line, the rows
    of C, a ruled line, the rows of H for the dense output
    y(theta) = y + theta (y+ - y) + theta (1 - theta) sum_k theta^k (H u)_k
    gamma : diagonal coefficient of Gamma
    """

    gamma: str = field(default="", repr=False)

    @functools.cached_property
    def printed(self) -> tuple:
        """Printed coefficients (c, d, A, C, H) as fractions.

        A and C are square, with zeros on and above the diagonal; the class names the coefficients.
        """
        blocks: list[list[list[Fraction]]] = [[], [], []]
        at, sums = 0, []
        for line in self.text.strip().splitlines():
            left, _, right = line.partition("|")
            if set(line.strip()) <= set("-+ "):
                at += 1
                continue
            row = [Fraction(word) for word in right.split()]
            blocks[at].append(row)
            if at == 0:
                sums.append([Fraction(word) for word in left.split()])
        s = len(sums)
        a, c, h = ([row + [Fraction(0)] * (s - len(row)) for row in block] for block in blocks)
        return [pair[0] for pair in sums], [pair[1] for pair in sums], a, c, h

    @functools.cached_property
    def forms(self) -> tuple:
        """(alpha, Gamma, weights b, weights of the embedded solution), as fractions.

        alpha and Gamma are the coefficients of the form with products of the Jacobian, see the top of this file.
        """
        _, _, a, c, _ = self.printed
        s = len(a)
        inverse = [
            [(1 / Fraction(self.gamma) if i == j else Fraction(0)) - c[i][j] for j in range(s)] for i in range(s)
        ]
        gamma = _inverse(inverse)
        m = [*a[-1][:-1], Fraction(1)]
        hat = [*a[-1][:-1], Fraction(0)]
        alpha = _product(a, gamma)
        (b,), (embedded,) = _product([m], gamma), _product([hat], gamma)
        return alpha, gamma, b, embedded

    @functools.cached_property
    def exact(self) -> Array:
        """Butcher array, A = alpha + Gamma, of the diagonally implicit method that is equal on y' = lambda y."""
        alpha, gamma, b, embedded = self.forms
        beta = tuple(tuple(x + y for x, y in zip(*rows, strict=True)) for rows in zip(alpha, gamma, strict=True))
        return Array(beta, tuple(b), tuple(sum(row) for row in beta), tuple(embedded), Fraction(0), ())

    @functools.cached_property
    def _conditions(self) -> Conditions:
        return Conditions(self.forms[0], self.rounding, self.exact.a)

    @property
    def times(self) -> tuple[float, ...]:
        return tuple(map(float, self.printed[0]))

    @property
    def diagonally_implicit(self) -> bool:
        """False, because no stage is solved by Newton."""
        return False

    @property
    def kind(self) -> str:
        """Kind of the equations of a step, "linear": each stage is a linear solve."""
        return "linear"

    @functools.cached_property
    def coefficients(self) -> tuple[np.ndarray, np.ndarray, int]:
        """(flat coefficients, coefficients of the dense output, number of stages) for the compiled steps.

        The flat coefficients are A, m, c, weights e of the error estimate, C, d, gamma, and 0. The printed coefficients
        are described at the top of this file. The rate f at the start of the step is added as a first stage.
        """
        c, d, a, big_c, h = self.printed
        s = len(c)

        def padded_matrix(rows):
            padded = np.zeros((s + 1, s + 1))
            padded[1:, 1:] = [[float(x) for x in row] for row in rows]
            return padded

        def padded_row(values):
            return np.array([0.0, *map(float, values)])

        m, error = padded_row([*a[-1][:-1], 1]), padded_row([0] * (s - 1) + [1])
        flat = [
            padded_matrix(a).ravel(),
            m,
            padded_row(c),
            error,
            padded_matrix(big_c).ravel(),
            padded_row(d),
            [float(Fraction(self.gamma))],
            [0],
        ]
        h = np.vstack([padded_row(row) for row in h])
        dense = np.column_stack([m + h[0], *(h[i + 1] - h[i] for i in range(len(h) - 1)), -h[-1]])
        return np.concatenate(flat), np.ascontiguousarray(dense), s + 1


def _inverse(lower):
    """Inverse of a lower triangular matrix of fractions."""
    s = len(lower)
    inverse = [[Fraction(0)] * s for _ in range(s)]
    for j in range(s):
        for i in range(j, s):
            total = Fraction(int(i == j)) - sum(lower[i][k] * inverse[k][j] for k in range(j, i))
            inverse[i][j] = total / lower[i][i]
    return inverse


def _product(x, y):
    return [[sum(row[k] * y[k][j] for k in range(len(y))) for j in range(len(y[0]))] for row in x]


def declare(name: str, text: str, source: str, gamma: str) -> None:
    BUILT_IN.add(name)
    METHODS[name] = Rosenbrock(name, source, text, given_digits=DIGITS, gamma=gamma)


declare("rodas-4", gamma="0.25", source="Hairer and Wanner 1996, IV.7; RODAS", text="""
    0     0.25    |
    0.386 -0.1043 | 1.544
    0.21  0.1035  | 0.9466785280815826 0.2557011698983284
    0.63  -0.0362 | 3.314825187068521  2.896124015972201 0.9986419139977817
    1     0       | 1.221224509226641  6.019134481288629 12.53708332932087 -0.6878860361058950
    1     0       | 1.221224509226641  6.019134481288629 12.53708332932087 -0.6878860361058950 1
    --------------+---------------------------------------------------------------------------------
                  |
                  | -5.6688
                  | -2.430093356833875 -0.2063599157091915
                  | -0.1073529058151375 -9.594562251023355 -20.47028614809616
                  | 7.496443313967647 -10.24680431464352 -33.99990352819905 11.70890893206160
                  | 8.083246795921522 -7.981132988064893 -31.52159432874371 16.31930543123136 -6.058818238834054
    --------------+---------------------------------------------------------------------------------
                  | 10.12623508344586 -7.487995877610167 -34.80091861555747 -7.992771707568823 1.025137723295662
                  | -0.6762803392801253 6.087714651680015 16.43084320892478 24.76722511418386 -6.594389125716872
""")  # fmt: skip

declare("rodas-5p", gamma="0.21193756319429014", source="Steinebach 2023, BIT 63, 27", text="""
    0                  0.21193756319429014  |
    0.6358126895828704 -0.42387512638858027 | 3
    0.4095798393397535 -0.3384627126235924  | 2.849394379747939 0.45842242204463923
    0.9769306725060716 1.8046452872882734   | -6.954028509809101 2.489845061869568 -10.358996098473584
    0.4288403609558664 2.325825639765069    | 2.8029986275628964 0.5072464736228206 -0.3988312541770524 -0.04721187230404641
    1 0 | -7.502846399306121 2.561846144803919 -11.627539656261098 -0.18268767659942256 0.030198172008377946
    1 0 | -7.502846399306121 2.561846144803919 -11.627539656261098 -0.18268767659942256 0.030198172008377946 1
    1 0 | -7.502846399306121 2.561846144803919 -11.627539656261098 -0.18268767659942256 0.030198172008377946 1 1
    ----+----------------------------------------------------------------------------------------------------
        |
        | -14.155112264123755
        | -17.97296035885952 -2.859693295451294
        | 147.12150275711716 -1.41221402718213 71.68940251302358
        | 165.43517024871676 -0.4592823456491126 42.90938336958603 -5.961986721573306
        | 24.854864614690072 -3.0009227002832186 47.4931110020768 5.5814197821558125 -0.6610691825249471
        | 30.91273214028599 -3.1208243349937974 77.79954646070892 34.28646028294783 -19.097331116725623 -28.087943162872662
        | 37.80277123390563 -3.2571969029072276 112.26918849496327 66.9347231244047 -40.06618937091002 -54.66780262877968 -9.48861652309627
    ----+----------------------------------------------------------------------------------------------------
        | 25.948786856663858 -2.5579724845846235 10.433815404888879 -2.3679251022685204 0.524948541321073 1.1241088310450404 0.4272876194431874 -0.17202221070155493
        | -9.91568850695171 -0.9689944594115154 3.0438037242978453 -24.495224566215796 20.176138334709044 15.98066361424651 -6.789040303419874 -6.710236069923372
        | 11.419903575922262 2.8879645146136994 72.92137995996029 80.12511834622643 -52.072871366152654 -59.78993625266729 -0.15582684282751913 4.883087185713722
""")  # fmt: skip
