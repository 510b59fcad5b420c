"""Tableaux of implicit Runge-Kutta methods and of Rosenbrock methods, each as printed in its source.

The stages k_i follow from h k_i = h f(y + sum alpha_ij h k_j) + h J sum gamma_ij h k_j, with the step h, the Jacobian J
and the weights b. Codes avoid the product with J by u = Gamma h k, with the coefficients A = alpha Gamma^-1,
C = diag(1 / gamma) - Gamma^-1, m = b Gamma^-1 (Hairer and Wanner 1996, IV.7).
"""

import functools
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from fvsolve.core.steppers.analysis.trees import Conditions
from fvsolve.core.steppers.tableau import BUILT_IN, METHODS, Array, Method, declare, declare_each

declare_each(
    {
        "implicit-euler": """Radau IIA of one stage; Egeland and Gravdahl 2002 (27)
    1 | 1
    --+--
      | 1
    """,
        "implicit-midpoint": """Gauss of one stage; Hairer and Wanner 1996, IV.5
    1/2 | 1/2
    ----+----
        | 1
    """,
        "gauss-4": """Hammer and Hollingsworth 1955
    1/2-sqrt(3)/6 | 1/4            1/4-sqrt(3)/6
    1/2+sqrt(3)/6 | 1/4+sqrt(3)/6  1/4
    --------------+-----------------------------
                  | 1/2            1/2
    """,
        "gauss-6": """Kuntzmann 1961, Butcher 1964
    1/2-sqrt(15)/10 | 5/36              2/9-sqrt(15)/15  5/36-sqrt(15)/30
    1/2             | 5/36+sqrt(15)/24  2/9              5/36-sqrt(15)/24
    1/2+sqrt(15)/10 | 5/36+sqrt(15)/30  2/9+sqrt(15)/15  5/36
    ----------------+----------------------------------------------------
                    | 5/18              4/9              5/18
    """,
        "trapezoid": """Lobatto IIIA of two stages; Hairer and Wanner 1996, IV.5
    0 | 0    0
    1 | 1/2  1/2
    --+---------
      | 1/2  1/2
    """,
        "lobatto-iiia-4": """Ehle 1969; Hairer and Wanner 1996, IV.5
    0   | 0     0    0
    1/2 | 5/24  1/3  -1/24
    1   | 1/6   2/3  1/6
    ----+-----------------
        | 1/6   2/3  1/6
    """,
        "lobatto-iiia-6": """Ehle 1969; Hairer and Wanner 1996, IV.5
    0              | 0                 0                    0                    0
    (5-sqrt(5))/10 | (11+sqrt(5))/120  (25-sqrt(5))/120     (25-13sqrt(5))/120   (-1+sqrt(5))/120
    (5+sqrt(5))/10 | (11-sqrt(5))/120  (25+13sqrt(5))/120   (25+sqrt(5))/120     (-1-sqrt(5))/120
    1              | 1/12              5/12                 5/12                 1/12
    ---------------+-----------------------------------------------------------------------------
                   | 1/12              5/12                 5/12                 1/12
    """,
        "lobatto-iiic-2": """Chipman 1971; Hairer and Wanner 1996, IV.5
    0 | 1/2  -1/2
    1 | 1/2  1/2
    --+----------
      | 1/2  1/2
    """,
        "lobatto-iiic-4": """Chipman 1971; Hairer and Wanner 1996, IV.5
    0   | 1/6  -1/3  1/6
    1/2 | 1/6  5/12  -1/12
    1   | 1/6  2/3   1/6
    ----+-----------------
        | 1/6  2/3   1/6
    """,
        "radau-ia-3": """Ehle 1969; Hairer and Wanner 1996, IV.5
    0   | 1/4  -1/4
    2/3 | 1/4  5/12
    ----+----------
        | 1/4  3/4
    """,
        "radau-ia-5": """Ehle 1969; Hairer and Wanner 1996, IV.5
    0              | 1/9  (-1-sqrt(6))/18     (-1+sqrt(6))/18
    (6-sqrt(6))/10 | 1/9  (88+7sqrt(6))/360   (88-43sqrt(6))/360
    (6+sqrt(6))/10 | 1/9  (88+43sqrt(6))/360  (88-7sqrt(6))/360
    ---------------+--------------------------------------------
                   | 1/9  (16+sqrt(6))/36     (16-sqrt(6))/36
    """,
        "radau-iia-3": """Ehle 1969; Hairer and Wanner 1996, IV.5
    1/3 | 5/12  -1/12
    1   | 3/4   1/4
    ----+------------
        | 3/4   1/4
    """,
    },
    also={
        "implicit-euler": "radau-iia-1",
        "implicit-midpoint": "gauss-2",
        "trapezoid": "lobatto-iiia-2",
    },
)

# The weight of f(t, y) in the embedded solution is the real eigenvalue of A, (6 + 81^(1/3) - 9^(1/3)) / 30.
declare(
    "radau-iia-5",
    source="Ehle 1969; error estimate of Hairer and Wanner 1996, IV.8",
    text="""
    (4-sqrt(6))/10 | (88-7sqrt(6))/360      (296-169sqrt(6))/1800  (-2+3sqrt(6))/225
    (4+sqrt(6))/10 | (296+169sqrt(6))/1800  (88+7sqrt(6))/360      (-2-3sqrt(6))/225
    1              | (16-sqrt(6))/36        (16+sqrt(6))/36        1/9
    ---------------+----------------------------------------------------------------
                   | (16-sqrt(6))/36        (16+sqrt(6))/36        1/9
""",
    start_weight="0.2748888295956773677478286035994147792946",
)

# Computed to 40 digits from the roots of Radau's polynomial; the weight of f(t, y) is the real eigenvalue of A.
declare(
    "radau-iia-9",
    source="Ehle 1969; Hairer and Wanner 1999; to 40 digits",
    text="""
    0.05710419611451768219312119255411562123508 | 0.07299886431790332430556853377813742600416 \
      -0.02673533110794557187769796535275160121179 0.01867692976398435441224735480208825985277 \
      -0.01287910609330643985364694983829855156550 0.005042839233882015206650219164940088155432
    0.2768430136381238276800459976856251411109 | 0.1537752314791824686681235708817509749472 \
      0.1462148678474935066496872451240424484222 -0.03644456890512808952665020219848330591965 \
      0.02123306311930471942150766291977285223079 -0.007935579902728777532622279041457828569637
    0.5835904323689168200566976686629172486934 | 0.1400630456848098715137557368144872671248 \
      0.2989671294912834793983034551787568732802 0.1675850701352489634420614091615786059679 \
      -0.03396910168661774657192214164342377716906 0.01094428874419225227449920915151827948963
    0.8602401356562194478479129188751197667384 | 0.1448943081095347575366006470932021090105 \
      0.2765000687601592275559343883292666030587 0.3257979229104210299849289728109192952942 \
      0.1287567532549097611582383674917970751613 -0.01570891737880532838778945685006531578629
    1 | 0.1437135607912259413234122198541102271589 \
      0.2813560151494620601921726503406598912000 0.3118265229757412540818549115766405219881 \
      0.2231039010835707444025602182285893596530 0.04
    ----+----
      | 0.1437135607912259413234122198541102271589 0.2813560151494620601921726503406598912000 \
      0.3118265229757412540818549115766405219881 0.2231039010835707444025602182285893596530 \
      0.04
""",
    start_weight="0.1590658444274691204779151543515630013128",
)

declare(
    "alexander-2",
    source="Alexander 1977, two stages",
    text="""
    1-sqrt(2)/2 | 1-sqrt(2)/2
    1           | sqrt(2)/2    1-sqrt(2)/2
    ------------+-------------------------
                | sqrt(2)/2    1-sqrt(2)/2
""",
)

declare(
    "alexander-3",
    source="Alexander 1977, three stages",
    text="""
    g       | g
    (1+g)/2 | (1-g)/2          g
    1       | (-6g^2+16g-1)/4  (6g^2-20g+5)/4  g
    --------+-----------------------------------
            | (-6g^2+16g-1)/4  (6g^2-20g+5)/4  g
""",
    numbers={"g": ("x^3-3x^2+3x/2-1/6", 0.4358665215)},
)

declare(
    "crouzeix-3",
    source="Crouzeix 1975, Norsett 1974, two stages",
    text="""
    (3+sqrt(3))/6 | (3+sqrt(3))/6
    (3-sqrt(3))/6 | -sqrt(3)/3     (3+sqrt(3))/6
    --------------+-----------------------------
                  | 1/2            1/2
""",
)

# g = 1/2 + cos(pi/18) / sqrt(3)
declare(
    "crouzeix-4",
    source="Crouzeix 1975, Alexander 1977, three stages",
    text="""
    g   | g
    1/2 | 1/2-g          g
    1-g | 2g             1-4g             g
    ----+-----------------------------------------------
        | 1/(6(2g-1)^2)  1-1/(3(2g-1)^2)  1/(6(2g-1)^2)
""",
    numbers={"g": ("x^3-3x^2/2+x/2-1/24", 1.0685790213)},
)

declare_each(
    {
        "tr-bdf2": """Bank et al. 1985; error estimate of Hosea and Shampine 1996
    0         | 0
    2-sqrt(2) | 1-sqrt(2)/2       1-sqrt(2)/2
    1         | sqrt(2)/4         sqrt(2)/4           1-sqrt(2)/2
    ----------+-----------------------------------------------------
              | sqrt(2)/4         sqrt(2)/4           1-sqrt(2)/2
              | (4-sqrt(2))/12    (4+3sqrt(2))/12     (2-sqrt(2))/6
    """,
        "esdirk-3": """Kennedy and Carpenter 2019, ESDIRK3(2)5L[2]SA
    0                | 0
    9/20             | 9/40                                 9/40
    9(2+sqrt(2))/40  | 9(1+sqrt(2))/80                      9(1+sqrt(2))/80                      9/40
    3/5              | (22+15sqrt(2))/(80(1+sqrt(2)))       (22+15sqrt(2))/(80(1+sqrt(2))) \
                       -7/(40(1+sqrt(2)))                   9/40
    1                | (2398+1205sqrt(2))/(2835(4+3sqrt(2))) (2398+1205sqrt(2))/(2835(4+3sqrt(2))) \
                       -2374(1+2sqrt(2))/(2835(5+3sqrt(2))) 5827/7560                            9/40
    -----------------+----------------------------------------------------------------------------------
                     | (2398+1205sqrt(2))/(2835(4+3sqrt(2))) (2398+1205sqrt(2))/(2835(4+3sqrt(2))) \
                       -2374(1+2sqrt(2))/(2835(5+3sqrt(2))) 5827/7560                            9/40
                     | (5547709sqrt(2)-4800247)/16519545    (5547709sqrt(2)-4800247)/16519545 \
                       11095418(1-sqrt(2))/16519545         30698249/44052120                    49563/233080
    """,
        "esdirk-4": """Kennedy and Carpenter 2003, ARK4(3)6L[2]SA-ESDIRK
    0      | 0
    1/2    | 1/4                       1/4
    83/250 | 8611/62500                -1743/31250          1/4
    31/50  | 5012029/34652500          -654441/2922500      174375/388108        1/4
    17/20  | 15267082809/155376265600  -71443401/120774400  730878875/902184768  2285395/8070912  1/4
    1      | 82889/524892              0                    15625/83664          69875/102672     -2260/8211  1/4
    -------+-----------------------------------------------------------------------------------------------------
           | 82889/524892              0                    15625/83664          69875/102672     -2260/8211  1/4
           | 4586570599/29645900160    0  178811875/945068544  814220225/1159782912  -3700637/11593932  61727/225920
    """,
    }
)

# Kennedy and Carpenter print fractions accurate to 25 digits or more; a_i1 = a_i2.
declare(
    "esdirk-5",
    source="Kennedy and Carpenter 2019, ESDIRK5(4)7L[2]SA2",
    text="""
    0                            | 0
    46/125                       | 23/125                       23/125
    7121331996143/11335814405378 | 791020047304/3561426431547   791020047304/3561426431547    23/125
    49/353                       | -158159076358/11257294102345 -158159076358/11257294102345 \
                                   -85517644447/5003708988389   23/125
    3706679970760/5295570149437  | -1653327111580/4048416487981 -1653327111580/4048416487981 \
                                   1514767744496/9099671765375  14283835447591/12247432691556 23/125
    347/382                      | -4540011970825/8418487046959 -4540011970825/8418487046959 \
                                   -1790937573418/7393406387169 10819093665085/7266595846747 \
                                   4109463131231/7386972500302  23/125
    1                            | -188593204321/4778616380481  -188593204321/4778616380481 \
                                   2809310203510/10304234040467 1021729336898/2364210264653 \
                                   870612361811/2470410392208   -1307970675534/8059683598661  23/125
    -----------------------------+-----------------------------------------------------------------
                                 | -188593204321/4778616380481  -188593204321/4778616380481 \
                                   2809310203510/10304234040467 1021729336898/2364210264653 \
                                   870612361811/2470410392208   -1307970675534/8059683598661  23/125
                                 | -582099335757/7214068459310  -582099335757/7214068459310 \
                                   615023338567/3362626566945   3192122436311/6174152374399 \
                                   6156034052041/14430468657929 -1011318518279/9693750372484 \
                                   1914490192573/13754262428401
""",
    digits=25,
)


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
        # Gamma^-1 = diag(1 / gamma) - C
        inverse = [
            [(1 / Fraction(self.gamma) if i == j else Fraction(0)) - c[i][j] for j in range(s)]
            for i in range(s)
        ]
        gamma = _inverse(inverse)
        # The new state is y+ = y_s + u_s, the embedded solution is y_s.
        m = [*a[-1][:-1], Fraction(1)]
        hat = [*a[-1][:-1], Fraction(0)]
        alpha = _product(a, gamma)
        (b,), (embedded,) = _product([m], gamma), _product([hat], gamma)
        return alpha, gamma, b, embedded

    @functools.cached_property
    def exact(self) -> Array:
        """Butcher array, A = alpha + Gamma, of the diagonally implicit method that is equal on y' = lambda y."""
        alpha, gamma, b, embedded = self.forms
        beta = tuple(
            tuple(x + y for x, y in zip(*rows, strict=True))
            for rows in zip(alpha, gamma, strict=True)
        )
        return Array(
            beta, tuple(b), tuple(sum(row) for row in beta), tuple(embedded), Fraction(0), ()
        )

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

        # y+ = y_s + u_s: the weights of the last stage, and 1 for u_s, which also estimates the error.
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
        # Terms theta (1 - theta) theta^k, sorted by powers of theta.
        dense = np.column_stack([m + h[0], *(h[i + 1] - h[i] for i in range(len(h) - 1)), -h[-1]])
        return np.concatenate(flat), np.ascontiguousarray(dense), s + 1


def _inverse(lower):
    """Inverse of a lower triangular matrix of fractions."""
    s = len(lower)
    inverse = [[Fraction(0)] * s for _ in range(s)]
    # Forward substitution, column by column.
    for j in range(s):
        for i in range(j, s):
            total = Fraction(int(i == j)) - sum(lower[i][k] * inverse[k][j] for k in range(j, i))
            inverse[i][j] = total / lower[i][i]
    return inverse


def _product(x, y):
    return [[sum(row[k] * y[k][j] for k in range(len(y))) for j in range(len(y[0]))] for row in x]


def declare_rosenbrock(name: str, text: str, source: str, gamma: str) -> None:
    BUILT_IN.add(name)
    METHODS[name] = Rosenbrock(name, source, text, given_digits=DIGITS, gamma=gamma)


declare_rosenbrock(
    "rodas-4",
    gamma="0.25",
    source="Hairer and Wanner 1996, IV.7; RODAS",
    text="""
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
""",
)

declare_rosenbrock(
    "rodas-5p",
    gamma="0.21193756319429014",
    source="Steinebach 2023, BIT 63, 27",
    text="""
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
""",
)
