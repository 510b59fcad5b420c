"""Units: every spelling of the table agrees with pint, and near misses are refused."""

import subprocess
import sys
import time

import numpy as np
import pytest
from pytest import approx

from fvsolve import units
from fvsolve.parts import value
from fvsolve.units import DIMENSIONS, UNITS, Kinematic, convert, parse

# Spelling -> unit in pint's words. A test checks that each spelling of the table has a row.
ROWS = """
m: meter | mm: millimeter | cm: centimeter | dm: decimeter | km: kilometer | um: micrometer | in: inch
inch: inch | ft: foot | yd: yard | mi: mile | m2: meter**2 | cm2: centimeter**2 | mm2: millimeter**2
dm2: decimeter**2 | km2: kilometer**2 | ha: hectare | in2: inch**2 | ft2: foot**2 | sqft: foot**2
acre: 43560 foot**2 | m3: meter**3 | cm3: centimeter**3 | mm3: millimeter**3 | dm3: decimeter**3
l: liter | L: liter | ml: milliliter | mL: milliliter | cl: centiliter | hl: hectoliter | Ml: megaliter
ML: megaliter | in3: inch**3 | ft3: foot**3 | gal: gallon | impgal: imperial_gallon
acre ft: 43560 foot**3 | s: second | ms: millisecond | us: microsecond | ns: nanosecond | min: minute
h: hour | hr: hour | d: day | day: day | Pa: pascal | hPa: hectopascal | kPa: kilopascal
MPa: megapascal | GPa: gigapascal | mbar: millibar | bar: bar | kbar: kilobar | atm: standard_atmosphere
at: technical_atmosphere | kgf/cm2: kilogram_force/centimeter**2 | N/m2: newton/meter**2
N/mm2: newton/millimeter**2 | kN/m2: kilonewton/meter**2 | psi: psi | ksi: kpsi
psf: pound_force/foot**2 | lbf/in2: pound_force/inch**2
mH2O: 1000 kilogram/meter**3*standard_gravity*meter
cmH2O: 1000 kilogram/meter**3*standard_gravity*centimeter
mmH2O: 1000 kilogram/meter**3*standard_gravity*millimeter
mwc: 1000 kilogram/meter**3*standard_gravity*meter | inH2O: 1000 kilogram/meter**3*standard_gravity*inch
ftH2O: 1000 kilogram/meter**3*standard_gravity*foot | mmHg: millimeter_Hg | inHg: 25.4 millimeter_Hg
Torr: torr | torr: torr | Paa: pascal | kPaa: kilopascal | MPaa: megapascal | mbara: millibar
bara: bar | psia: psi | Pag: pascal | kPag: kilopascal | MPag: megapascal | mbarg: millibar | barg: bar
psig: psi | mH2Og: 1000 kilogram/meter**3*standard_gravity*meter | m3/s: meter**3/second
m3/min: meter**3/minute | m3/h: meter**3/hour | m3/hr: meter**3/hour | m3/d: meter**3/day
m3/day: meter**3/day | cmh: meter**3/hour | CMH: meter**3/hour | cmd: meter**3/day | CMD: meter**3/day
cms: meter**3/second | CMS: meter**3/second | l/s: liter/second | L/s: liter/second | lps: liter/second
LPS: liter/second | l/min: liter/minute | L/min: liter/minute | lpm: liter/minute | LPM: liter/minute
l/h: liter/hour | L/h: liter/hour | l/d: liter/day | L/d: liter/day | ml/s: milliliter/second
mL/s: milliliter/second | ml/min: milliliter/minute | mL/min: milliliter/minute
cm3/s: centimeter**3/second | cm3/min: centimeter**3/minute | mm3/s: millimeter**3/second
dm3/s: decimeter**3/second | Ml/d: megaliter/day | ML/d: megaliter/day | mld: megaliter/day
MLD: megaliter/day | cfs: foot**3/second | CFS: foot**3/second | ft3/s: foot**3/second
cfm: foot**3/minute | CFM: foot**3/minute | ft3/min: foot**3/minute | gpm: gallon/minute
GPM: gallon/minute | gal/min: gallon/minute | gal/s: gallon/second | gpd: gallon/day | gph: gallon/hour
mgd: 1e6 gallon/day | MGD: 1e6 gallon/day | igpm: imperial_gallon/minute | imgd: 1e6 imperial_gallon/day
IMGD: 1e6 imperial_gallon/day | afd: 43560 foot**3/day | AFD: 43560 foot**3/day | m/s: meter/second
mm/s: millimeter/second | cm/s: centimeter/second | km/s: kilometer/second | m/min: meter/minute
m/h: meter/hour | km/h: kilometer/hour | ft/s: foot/second | fps: foot/second | ft/min: foot/minute
in/s: inch/second | mm/h: millimeter/hour | mm/min: millimeter/minute
in/h: inch/hour | mm/d: millimeter/day | m/d: meter/day | mph: mile/hour
kg/m2/s: 0.001 meter/second | kg/m2/h: 0.001 meter/hour | kg/m2/d: 0.001 meter/day
m/s2: meter/second**2 | cm/s2: centimeter/second**2
ft/s2: foot/second**2 | kg/m3: kilogram/meter**3 | g/cm3: gram/centimeter**3 | g/ml: gram/milliliter
g/mL: gram/milliliter | kg/l: kilogram/liter | kg/L: kilogram/liter | kg/dm3: kilogram/decimeter**3
g/l: gram/liter | g/L: gram/liter | t/m3: metric_ton/meter**3 | lb/ft3: pound/foot**3
Pa s: pascal*second | mPa s: millipascal*second | uPa s: micropascal*second | P: poise | cP: centipoise
N s/m2: newton*second/meter**2 | kg/m/s: kilogram/meter/second | m2/s: meter**2/second
mm2/s: millimeter**2/second | cSt: centistokes | St: stokes | cm2/s: centimeter**2/second
ft2/s: foot**2/second | -: dimensionless | 1: dimensionless | %: percent | kg: kilogram | g: gram
mg: milligram | t: metric_ton | tonne: metric_ton | lb: pound | lbm: pound | kg/s: kilogram/second
g/s: gram/second | kg/min: kilogram/minute | kg/h: kilogram/hour | t/h: metric_ton/hour
lb/s: pound/second | N: newton | kN: kilonewton | MN: meganewton | kgf: kilogram_force | lbf: pound_force
N/m: newton/meter | N/mm: newton/millimeter | N/um: newton/micrometer | kN/m: kilonewton/meter
kN/mm: kilonewton/millimeter | MN/m: meganewton/meter | lbf/in: pound_force/inch | N s/m: newton*second/meter
N/(m/s): newton*second/meter | kN s/m: kilonewton*second/meter | N s/mm: newton*second/millimeter
lbf s/in: pound_force*second/inch | m3/s/Pa: meter**3/second/pascal | l/s/bar: liter/second/bar
l/min/bar: liter/minute/bar | L/min/bar: liter/minute/bar | ml/min/bar: milliliter/minute/bar
cm3/s/bar: centimeter**3/second/bar | cm3/min/bar: centimeter**3/minute/bar | J: joule
kJ: kilojoule | MJ: megajoule | kWh: kilowatt_hour | W: watt | kW: kilowatt | MW: megawatt
hp: horsepower | Hz: 1/second | kHz: 1000/second | 1/s: 1/second | 1/min: 1/minute | 1/h: 1/hour | 1/day: 1/day
1/Pa: 1/pascal | 1/MPa: 1/megapascal | 1/GPa: 1/gigapascal | 1/bar: 1/bar | 1/psi: 1/psi
Pa s/m: pascal*second/meter | rad: radian | deg: degree
rad/s: radian/second | rpm: revolution/minute | RPM: revolution/minute | N m: newton*meter
Nm: newton*meter | kN m: kilonewton*meter | kNm: kilonewton*meter | lbf ft: pound_force*foot
lbf in: pound_force*inch | kg m2: kilogram*meter**2 | kgm2: kilogram*meter**2 | g m2: gram*meter**2
t m2: metric_ton*meter**2 | kg cm2: kilogram*centimeter**2 | kg mm2: kilogram*millimeter**2
g cm2: gram*centimeter**2 | g mm2: gram*millimeter**2 | lb in2: pound*inch**2 | slug ft2: slug*foot**2
deg/s: degree/second | N m s: newton*meter*second | N m s/rad: newton*meter*second
Nms: newton*meter*second | kN m s: kilonewton*meter*second | N s: newton*second | kg m/s: kilogram*meter/second
kN s: kilonewton*second | kg m2/s: kilogram*meter**2/second
V: volt | mV: millivolt | kV: kilovolt | A: ampere | mA: milliampere | kA: kiloampere | ohm: ohm | mohm: milliohm
kohm: kiloohm | Mohm: megaohm | H: henry | mH: millihenry | uH: microhenry | Wb: weber | mWb: milliweber
uWb: microweber | A/Wb: ampere/weber | 1/H: 1/henry | m3/rad: meter**3/radian
cm3/rad: centimeter**3/radian | l/rad: liter/radian | m3/rev: meter**3/revolution | l/rev: liter/revolution
cm3/rev: centimeter**3/revolution | cc/rev: centimeter**3/revolution | ml/rev: milliliter/revolution
in3/rev: inch**3/revolution | J/kg/K: joule/kilogram/kelvin | kJ/kg/K: kilojoule/kilogram/kelvin
kg/mol: kilogram/mole | g/mol: gram/mole | kg/kmol: kilogram/kilomole | mol/s: mole/second
mmol/s: millimole/second | mol/min: mole/minute | mol/h: mole/hour | mol/day: mole/day | J/mol: joule/mole
kJ/mol: kilojoule/mole
N m/A: newton*meter/ampere | mN m/A: millinewton*meter/ampere | V s/rad: volt*second | V/(rad/s): volt*second
V s: volt*second | N m/rad: newton*meter | kN m/rad: kilonewton*meter | N m/deg: newton*meter/degree
J/K: joule/kelvin | kJ/K: kilojoule/kelvin | MJ/K: megajoule/kelvin | W/K: watt/kelvin | kW/K: kilowatt/kelvin
W/m2/K: watt/meter**2/kelvin | W/(m2 K): watt/meter**2/kelvin | kW/m2/K: kilowatt/meter**2/kelvin
lb ft2: pound*foot**2 | C: coulomb | F: farad | mF: millifarad | uF: microfarad | K: kelvin
degC: degC | celsius: degC | degF: degF | degR: degR
"""
PINT = dict(
    row.strip().split(": ") for line in ROWS.splitlines() for row in line.split("|") if row.strip()
)
PINT_SI = {
    "m": "meter",
    "m2": "meter**2",
    "m3": "meter**3",
    "s": "second",
    "Pa": "pascal",
    "m3/s": "meter**3/second",
    "N/m": "newton/meter",
    "N s/m": "newton*second/meter",
    "m3/s/Pa": "meter**3/second/pascal",
    "m/s": "meter/second",
    "m/s2": "meter/second**2",
    "kg/m3": "kilogram/meter**3",
    "Pa s": "pascal*second",
    "K": "kelvin",
    "-": "dimensionless",
    "m2/s": "meter**2/second",
    "kg": "kilogram",
    "kg/s": "kilogram/second",
    "N": "newton",
    "J": "joule",
    "W": "watt",
    "Hz": "1/second",
    "1/s": "1/second",
    "rad": "radian",
    "1/Pa": "1/pascal",
    "Pa s/m": "pascal*second/meter",
    "rad/s": "radian/second",
    "N m": "newton*meter",
    "kg m2": "kilogram*meter**2",
    "N m s": "newton*meter*second",
    "N s": "newton*second",
    "kg m2/s": "kilogram*meter**2/second",
    "C": "coulomb",
    "F": "farad",
    "V": "volt",
    "A": "ampere",
    "ohm": "ohm",
    "H": "henry",
    "Wb": "weber",
    "N m/A": "newton*meter/ampere",
    "1/H": "1/henry",
    "m3/rad": "meter**3/radian",
    "J/kg/K": "joule/kilogram/kelvin",
    "kg/mol": "kilogram/mole",
    "mol/s": "mole/second",
    "J/mol": "joule/mole",
    "N m/rad": "newton*meter/radian",
    "J/K": "joule/kelvin",
    "W/K": "watt/kelvin",
    "W/m2/K": "watt/meter**2/kelvin",
}


@pytest.fixture(scope="module")
def registry():
    import pint

    return pint.UnitRegistry()


def test_every_spelling_has_a_row():
    assert set(PINT) == set(UNITS)


@pytest.mark.parametrize("spelling", UNITS)
def test_spelling_agrees_with_pint(spelling, registry):
    unit = UNITS[spelling]
    words = PINT[spelling].split(" ", 1)
    factor, name = (float(words[0]), words[1]) if len(words) == 2 else (1.0, words[0])
    wanted = PINT_SI[DIMENSIONS[unit.dimension].si]
    for number in (1.0, 36.6):
        si = (
            registry.Quantity(number * factor, registry.parse_expression(name).units)
            if "/" not in name
            else None
        )
        if si is None:
            si = number * factor * registry.parse_expression(name)
        assert unit.si(number) == approx(si.to(wanted).magnitude, rel=1e-12)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_examples_and_si_units_parse(dimension):
    example = DIMENSIONS[dimension]
    assert parse(example.example, dimension) is not None
    assert units.find(example.si, dimension).si(1.0) == 1.0


def test_text_is_rounded_once():
    assert parse("304.8 mm", "length") == 0.3048
    assert parse("0.26 mm", "length") == 0.00026
    assert parse("20 degC", "temperature") == 293.15
    assert parse("68 degF", "temperature") == 293.15
    assert parse("32.9 l/s", "flow") == 0.0329


@pytest.mark.parametrize(
    "text, dimension, value",
    [
        ("300mm", "length", 0.3),
        (" 1e3 m ", "length", 1000.0),
        ("-3 m", "length", -3.0),
        ("1_000 m", "length", 1e3),
        ("\N{MINUS SIGN}5 degC", "temperature", 268.15),
        ("5 m³/h", "flow", 5 / 3600),
        ("5 m^3/h", "flow", 5 / 3600),
        ("5 m**3 / h", "flow", 5 / 3600),
        ("1 Pa.s", "viscosity", 1.0),
        ("1 Pa*s", "viscosity", 1.0),
        ("1 Pa·s", "viscosity", 1.0),
        ("20 °C", "temperature", 293.15),
        ("3 µm", "length", 3e-6),
        ("50 %", "number", 0.5),
        ("0.5", "number", 0.5),
        ("3 metre", "length", 3.0),
        ("3 Meters", "length", 3.0),
        ("3 metres per second", "velocity", 3.0),
        ("2 hours", "time", 7200.0),
        ("10 sec", "time", 10.0),
        ("3 m s-1", "velocity", 3.0),
        ("3 m s^-1", "velocity", 3.0),
        ("3 m s⁻¹", "velocity", 3.0),
        ("3 m.s-1", "velocity", 3.0),
        ("36 mm h-1", "rainfall", 1e-5),
        ("36 mm hr-1", "rainfall", 1e-5),
        ("36 mm/hr", "rainfall", 1e-5),
        ("864 mm day-1", "rainfall", 1e-5),
        ("864 mm d-1", "rainfall", 1e-5),
        ("0.01 kg m-2 s-1", "rainfall", 1e-5),
        ("0.01 kg m**-2 s**-1", "rainfall", 1e-5),
        ("3 m**3 s**-1", "flow", 3.0),
        ("3 m3 s-1", "flow", 3.0),
        ("2 s-1", "frequency", 2.0),
        ("3 kg m-3", "density", 3.0),
        ("3 W m-2 K-1", "heat_transfer_coefficient", 3.0),
        ("20 degrees_Celsius", "temperature", 293.15),
        (7, "length", 7.0),
        (2.5, "flow", 2.5),
    ],
)
def test_ways_of_writing(text, dimension, value):
    assert parse(text, dimension) == value


def test_pressure_is_stated_as_gauge_or_absolute():
    assert parse("5 barg", "pressure") == (5e5, True)
    assert parse("5 bar(g)", "pressure") == (5e5, True)
    assert parse("5 bara", "pressure") == (5e5, False)
    assert parse("5 bar", "pressure") == (5e5, False)
    assert parse(101325, "pressure") == (101325.0, False)
    assert parse("1 psig", "pressure") == (approx(6894.757), True)


def test_viscosity_may_be_kinematic():
    assert isinstance(parse("32 cSt", "viscosity"), Kinematic)
    assert not isinstance(parse("32 cP", "viscosity"), Kinematic)


def test_pint_knows_the_rest():
    assert parse("1 furlong", "length") == approx(201.168, rel=1e-5)
    assert parse("1 m^3/fortnight", "flow") == approx(1 / (14 * 86400))


@pytest.mark.parametrize(
    "text, dimension, message",
    [
        (
            "20 C",
            "temperature",
            '"20 C" is a charge; expected a temperature; did you mean "20 degC"?',
        ),
        (
            "68 F",
            "temperature",
            '"68 F" is a capacitance; expected a temperature; did you mean "68 degF"?',
        ),
        ("304.8 kg", "length", '"304.8 kg" is a mass; expected a length, for example "300 mm"'),
        ("10 mPa", "pressure", 'unknown unit "mPa"; did you mean "10 MPa"?'),
        ("10 BAR", "pressure", 'unknown unit "BAR"; did you mean "10 bar"?'),
        ("5 bar g", "pressure", 'unknown unit "bar g"; did you mean "5 barg"?'),
        ("5 kg/cm2", "pressure", '"5 kg/cm2": unknown unit "kg/cm2"; did you mean "5 kgf/cm2"?'),
        ("45 m", "pressure", '"45 m" is a length; expected a pressure; did you mean "45 mH2O"?'),
        ("3 kg m-2 s-1", "velocity", '"3 kg m-2 s-1" is a rate of rain; expected a velocity'),
        ("3 kg m-2 s-1", "flow", '"3 kg m-2 s-1" is a rate of rain; expected a flow'),
        (
            "3 kg s-1",
            "rainfall",
            '"3 kg s-1" is a mass flow; expected a rate of rain, for example "25 mm/h"',
        ),
        (
            "45 metres",
            "pressure",
            '"45 metres" is a length; expected a pressure; did you mean "45 mH2O"?',
        ),
        ("3 mm/h-1", "rainfall", '"3 mm/h-1" is a quantity of'),
        ("10 Min", "time", 'unknown unit "Min"; did you mean "10 min"?'),
        ("3 kg/s", "flow", '"3 kg/s" is a mass flow; expected a flow, for example "20 l/s"'),
        ("3 lp", "flow", '"3 lp": unknown unit "lp"; did you mean "3 lps"?'),
        ("300", "length", '"300" has no unit; did you mean "300 m", or the bare number 300?'),
        ("1.304,8 mm", "length", '"1.304,8 mm" has a comma; did you mean "1304.8 mm"?'),
        ("1,304.8 mm", "length", '"1,304.8 mm" has a comma; did you mean "1304.8 mm"?'),
        ("304,8 mm", "length", '"304,8 mm" has a comma; did you mean "304.8 mm"?'),
        (
            "a lot",
            "length",
            '"a lot" is not a number with a unit; expected a length, for example "300 mm"',
        ),
        ("", "length", '"" is not a number with a unit; expected a length, for example "300 mm"'),
        (True, "length", 'true is true or false; expected a length, for example "300 mm"'),
        ([1], "length", '[1] is a list; expected a length, for example "300 mm"'),
        (float("nan"), "length", 'nan is not finite; expected a length, for example "300 mm"'),
        (float("inf"), "flow", 'inf is not finite; expected a flow, for example "20 l/s"'),
        (10**400, "length", "is not finite; expected a length"),
        ("1e999 m", "length", '"1e999 m" is not finite; expected a length, for example "300 mm"'),
        ("2 GPag", "modulus", '"2 GPag": unknown unit "GPag"'),
        (
            "2 barg",
            "modulus",
            '"2 barg" is a gauge pressure; expected a modulus, for example "210 GPa"',
        ),
        (
            "2 bara",
            "gauge_pressure",
            '"2 bara" is an absolute pressure; expected a gauge pressure, for example "5 barg"',
        ),
        ("3 m/s", "number", '"3 m/s" is a velocity; expected a number, for example 0.5'),
        ("3 V", "length", '"3 V" is a voltage; expected a length, for example "300 mm"'),
        (
            "3 9**9**9",
            "length",
            '"3 9**9**9": unknown unit "9**9**9"; expected a length, for example "300 mm"',
        ),
    ],
)
def test_near_misses_are_refused(text, dimension, message):
    with pytest.raises(ValueError) as caught:
        parse(text, dimension)
    assert message in str(caught.value)


def test_a_decimal_comma_is_refused_in_units_of_ratios_too():
    with pytest.raises(ValueError, match=r'"0,8 1/m" has a comma; did you mean "0.8 1/m"\?'):
        units.parse_ratio("0,8 1/m", "number", "length")


@pytest.mark.parametrize(
    "text, meant", [("0 bar", "0 barg"), ("-0.5 bar", "-0.5 barg"), ("-2 bar", "")]
)
def test_a_vacuum_is_read_as_gauge_only_where_that_is_none(text, meant):
    said = units.vacuum(text, parse(text, "pressure")[0])
    assert said == f'"{text}" is absolute, a vacuum' + (
        f'; did you mean "{meant}"?' if meant else ""
    )


def test_convert_is_the_inverse_and_counts_gauge_from_ambient():
    values = np.array([0.0, 1.5e5])
    assert convert(values, "pressure", "barg", ambient=1e5) == approx([-1.0, 0.5])
    assert convert(values, "pressure", "bar") == approx([0.0, 1.5])
    assert convert(values, "gauge_pressure", "barg", ambient=1e5) == approx([0.0, 1.5])
    assert convert(0.02, "flow", "l/s") == approx(20.0)
    assert convert(293.15, "temperature", "degC") == approx(20.0)
    assert convert(3.048, "head", "ft") == approx(10.0)


@pytest.mark.parametrize(
    "text",
    ["1" * 10**6, "1" + " " * 10**6 + "x", " " * 10**6, "1 a" + " " * 10**6 + "b", "," * 10**6],
)
def test_long_texts_are_refused_at_once(text):
    start = time.process_time()
    with pytest.raises(
        ValueError,
        match="(has [0-9]+ letters, more than|is not) a number with (its|a) unit; expected a length",
    ) as caught:
        parse(text, "length")
    assert len(str(caught.value)) < 300 and time.process_time() - start < 5.0


def test_a_difference_has_the_unit_without_its_zero_for_each_spelling():
    assert [units.span(unit) for unit in ("barg", "bar(g)", "bara", "bar", "hectopascal")] == [
        "bar",
        "bar",
        "bar",
        "bar",
        "hectopascal",
    ]


def test_plain_numbers_name_the_first_text_that_is_not_a_number():
    assert units.plain_numbers("1 2.5\n-3e2\tnan\n").tolist()[:3] == [1.0, 2.5, -300.0]
    assert units.plain_numbers(" \n ").size == 0
    for text, fault in {
        "1 2\n3 0,5": 'line 4: "0,5" has a comma; did you mean "0.5"?',
        "1 x": 'line 3: "x" is not a',
        "1 1_0": '"1_0" is not a number',
        "1.234,5": 'did you mean "1234.5"?',
    }.items():
        with pytest.raises(ValueError) as caught:
            units.plain_numbers(text, 3)
        assert fault in str(caught.value)


def test_the_table_needs_no_pint():
    code = "import sys; from fvsolve.units import parse; parse('1 l', 'volume'); parse('3 m s-1', 'velocity')"
    code += "; parse('3 mm hr-1', 'rainfall'); parse('3 kg m-2 s-1', 'rainfall'); parse('3 metres', 'length')"
    code += "; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# lists ----------------------------------------------------------------------------------------------------------------

LISTS = [
    [0.0, 300, 600.5], [1, True], [1.0, "2 m"], [1e200, 1.0], [1e-200], [10**400, 1], [float("nan")], [-1.0, 2.0],
    [0.0], [1.0, [2.0]], [5.0, 1e7], ["1 m", "2.5 m", "0.26 m"], ["1 mm", "260 mm"], ["1 m", "2 mm"], ["1 m", "x m"],
    ["1", "2"], ["1 m", "-1 m"], ["1 s", "90 min"], ["0.1 min", "0.2 min"], ["1e400 m", "1 m"], ["5 barg", "1 barg"],
    ["1,5 m"], ["\u0661 m"], [""], ["m"],
]  # fmt: skip
DECLARED = [
    ("length", value.positive),
    ("length", value.nonnegative),
    ("number", value.between(0, 1)),
    ("time", value.anything),
    ("pressure", value.positive),
    ("gauge_pressure", value.anything),
    ("number", value.Range(nonzero=True)),
]


@pytest.mark.parametrize("given", LISTS, ids=str)
@pytest.mark.parametrize(
    "dimension, bounds", DECLARED, ids=[f"{name}-{bounds}" for name, bounds in DECLARED]
)
def test_a_list_is_read_as_each_of_its_entries(given, dimension, bounds):
    """Bare numbers are read all at once; values and faults are those of single numbers."""
    context, item = value.ReadContext(), value.Quantity(dimension, bounds)

    def outcome(read):
        try:
            return read()
        except ValueError as error:
            return value.faults_of(error)

    whole = outcome(lambda: value.Rows(dimension, bounds).read(given, context))
    single = outcome(
        lambda: tuple(
            value.read_each(enumerate(given), lambda one: item.read(one, context)).values()
        )
    )
    assert whole == single
