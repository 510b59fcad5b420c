"""Export of a case as an FMU: a zip file with the case, a description of its variables, and PythonFMU's binaries."""

import hashlib
import html
import re
import zipfile
from importlib import import_module
from pathlib import Path

import fvsolve
from fvsolve.case import Case
from fvsolve.core.model import build
from fvsolve.errors import FvsolveError
from fvsolve.exchange.fmi.cosimulation import CASE_FOLDER
from fvsolve.exchange.fmi.model_description import model_description
from fvsolve.exchange.fmi.variables import Variable, variables_of
from fvsolve.file_replacement import replacing

SUFFIX = ".fmu"
FIXED_DATE = (1980, 1, 1, 0, 0, 0)  # of files in the zip file: the same case gives the same bytes

# Module that PythonFMU's binary imports. Python reads it in the host, so it must check the version of fvsolve first.
SLAVE = '''"""Slave of an FMU of fvsolve {version}."""

import sys

NEEDED = "{version}"


def refuse(text):
    print(f"fvsolve FMU: {{text}}", file=sys.stderr, flush=True)
    raise ImportError(text)


def remedy():
    return f"The FMU needs fvsolve {{NEEDED}} in the Python of the host, {{sys.executable or sys.prefix}}: " \\
           f"python -m pip install fvsolve=={{NEEDED}}"


try:
    import fvsolve
except ImportError as error:
    refuse(f"fvsolve cannot be imported: {{error}}. {{remedy()}}")
if getattr(fvsolve, "__version__", None) != NEEDED:
    refuse(f"the host has fvsolve {{getattr(fvsolve, '__version__', 'without a version')}}. {{remedy()}}")

from fvsolve.exchange.fmi.cosimulation import CoSimulation
from pythonfmu import Fmi2Slave


class Slave(CoSimulation, Fmi2Slave):
    def __init__(self, **given):
        Fmi2Slave.__init__(self, **given)
        self.start()
'''
NEEDS = (
    "This FMU needs Python 3.11 or later with fvsolve {version} in its host. A host that is no Python program has to "
    "load the library of Python first (Linux: LD_PRELOAD=libpython3.x.so); without it the system reports an undefined "
    "symbol such as _Py_NoneStruct."
)


def write_fmu(case: Case, path: str | Path | None = None) -> tuple[Path, list[Variable]]:
    """Write the FMU of a case to the file `path`, by default NAME.fmu; return the path and all variables.

    Raises FvsolveError without PythonFMU or for a name that does not end in .fmu, and CaseError where an input and a
    probe share a name.
    """
    path = Path(path or f"{case.name}{SUFFIX}")
    if path.suffix.lower() != SUFFIX:
        raise FvsolveError(f"{path}: unknown type of file; expected a name that ends in {SUFFIX}")
    package = folder_of_pythonfmu()
    variables = variables_of(build(case))
    version, identifier = fvsolve.__version__, identifier_of(case.name)
    # FMUs of one version share it in a host
    module = f"fvsolve_{re.sub(r'[^0-9A-Za-z]', '_', version)}_slave"
    needs = NEEDS.format(version=version)
    files = {f"resources/{name}": data for name, data in case_files(case).items()}
    guid = hashlib.sha256(repr(sorted(files.items())).encode() + version.encode()).hexdigest()[:32]
    description = f"{case.title or case.name}. {needs}"
    files["modelDescription.xml"] = model_description(
        case, variables, identifier, guid, version, description
    )
    files["documentation/index.html"] = documentation(case, variables, needs)
    files[f"resources/{module}.py"] = SLAVE.format(version=version).encode()
    files["resources/slavemodule.txt"] = module.encode()
    files |= {
        f"resources/pythonfmu/{file.name}": file.read_bytes()
        for file in sorted(package.glob("*.py"))
    }
    for file in sorted((package / "resources" / "binaries").rglob("*.*")):
        files[f"binaries/{file.parent.name}/{identifier}{file.suffix}"] = file.read_bytes()
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as fresh, zipfile.ZipFile(fresh, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, FIXED_DATE), data, zipfile.ZIP_DEFLATED)
    return path, variables


def case_files(case: Case) -> dict[str, bytes]:
    """Resolved case and its files : path in the resources of an FMU -> contents."""
    files = {f"{CASE_FOLDER}/{case.name}.toml": case.resolved().encode()}
    return files | {
        f"{CASE_FOLDER}/{name}": Path(source).read_bytes() for name, source in case.copies.items()
    }


def folder_of_pythonfmu() -> Path:
    """Folder of the package PythonFMU, with its binaries. Raises FvsolveError with the command to install it."""
    try:
        return Path(import_module("pythonfmu").__file__).parent
    except ImportError:
        raise FvsolveError(
            'an FMU needs the package PythonFMU: pip install "fvsolve[fmi]"'
        ) from None


def identifier_of(name: str) -> str:
    """Name of the binaries, a C identifier."""
    text = re.sub(r"\W", "_", name, flags=re.ASCII)
    return text if text[:1].isalpha() else f"case_{text}"


def documentation(case: Case, variables: list[Variable], needs: str) -> bytes:
    """HTML page of the FMU: its needs and its variables."""
    rows = "\n".join(
        f"<tr><td>{html.escape(item.name)}</td><td>{'input' if item.is_input else 'output'}</td>"
        f"<td>{html.escape(item.unit)}</td><td>{html.escape(item.description)}</td></tr>"
        for item in variables
    )
    title = html.escape(case.title or case.name)
    page = f"""<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>{title}</title></head>
<body><h1>{title}</h1>
<p>{html.escape(case.description)}</p>
<p>{html.escape(needs)}</p>
<p>All values are in SI, pressures are absolute. An input that the host does not set follows the case.</p>
<table><tr><th>variable</th><th></th><th>unit</th><th>meaning</th></tr>
{rows}
</table></body></html>
"""
    return page.encode()
