"""File modelDescription.xml of an FMU (FMI 2.0.4, section 2.2)."""

import math
import re
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fvsolve import units
from fvsolve.exchange.fmi.variables import Variable, unit_name

LOG_CATEGORIES = ("logStatusWarning", "logStatusError", "logAll")


def model_description(
    case, variables: list[Variable], identifier: str, guid: str, version: str, description: str
) -> bytes:
    """Text of modelDescription.xml.

    identifier : name of the binaries; guid : text that identifies the FMU; version : version of fvsolve
    """
    numerics = case.numerics
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=case.name,
        guid=guid,
        description=description,
        generationTool=f"fvsolve {version}",
        variableNamingConvention="flat",
    )
    options = {
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "canNotUseMemoryManagementFunctions": "true",
    }
    SubElement(
        root, "CoSimulation", modelIdentifier=identifier, needsExecutionTool="true", **options
    )
    root.append(unit_definitions(variables))
    categories = SubElement(root, "LogCategories")
    for name in LOG_CATEGORIES:
        SubElement(categories, "Category", name=name)
    experiment = {"startTime": repr(numerics.start), "stopTime": repr(numerics.end)}
    if case.output.every:
        experiment["stepSize"] = repr(case.output.every)
    SubElement(root, "DefaultExperiment", experiment)
    listed, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    for reference, variable in enumerate(variables):
        listed.append(variable_element(variable, reference))
    outputs = [str(k) for k, variable in enumerate(variables, 1) if not variable.is_input]
    for name in ("Outputs", "InitialUnknowns") if outputs else ():
        section = SubElement(structure, name)
        for index in outputs:
            SubElement(section, "Unknown", index=index)
    indent(root)
    return tostring(root, "UTF-8", xml_declaration=True)


def variable_element(variable: Variable, reference: int) -> Element:
    """Element of a variable; reference : its value reference."""
    causality = "input" if variable.is_input else "output"
    element = Element(
        "ScalarVariable",
        name=variable.name,
        valueReference=str(reference),
        description=variable.description,
        causality=causality,
        variability="continuous",
    )
    numbers = {"start": variable.start, "min": variable.least, "max": variable.greatest}
    given = {
        key: repr(float(value))
        for key, value in numbers.items()
        if value is not None and math.isfinite(value)
    }
    if variable.unit:
        given["unit"] = variable.unit
    if variable.display is not None:
        given["displayUnit"] = variable.display[0]
    SubElement(element, "Real", given)
    return element


def unit_definitions(variables: list[Variable]) -> Element:
    """Element with all units of variables: exponents of base units, and units of `[output]`."""
    section, known = Element("UnitDefinitions"), {}
    for variable in variables:
        if variable.unit and variable.unit not in known:
            known[variable.unit] = unit = SubElement(section, "Unit", name=variable.unit)
            if variable.unit in SI_UNITS:
                SubElement(unit, "BaseUnit", base_exponents(variable.unit))
        if variable.display is not None:
            name, factor, offset = variable.display
            if known[variable.unit].find(f"DisplayUnit[@name='{name}']") is None:
                SubElement(
                    known[variable.unit],
                    "DisplayUnit",
                    name=name,
                    factor=repr(factor),
                    offset=repr(offset),
                )
    return section


SI_UNITS = {unit_name(dimension.si) for dimension in units.DIMENSIONS.values()}


def base_exponents(unit: str) -> dict[str, str]:
    """Exponents of base units in an SI unit, such as {"kg": "1", "m": "-1", "s": "-2"} for "Pa"."""
    powers = units.powers_of_base_units("-" if unit == "1" else unit)
    if match := re.search(r"(^|/)rad\b", unit):
        powers["rad"] = -1 if match[1] else 1
    return {name: str(power) for name, power in powers.items()}
