"""Writes the loops over all devices of a kind from its law, so that a scene compiles its own kinds alone.

They stand in the folder of compiled code, written once and cached like any other. Knows names; knows no law.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from fvsolve.jit import once, written_folder
from fvsolve.kernels.devices.laws import LAWS

HOME = "fvsolve.kernels.devices"
TEMPLATE = Path(__file__).parent / "template.py"


@once
def loops_of(kind: int) -> ModuleType:
    """The module of a kind's loops: `prepare`, `move`, `events`, `observe`, `record`, `power` and `stored`."""
    path, source = written_folder() / f"kind_{kind}.py", text(kind)
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        fresh = Path(f"{path}.{os.getpid()}")
        fresh.write_text(source, encoding="utf-8")
        os.replace(fresh, path)
    spec = importlib.util.spec_from_file_location(f"{HOME}.kind_{kind}", path)
    made = sys.modules[spec.name] = importlib.util.module_from_spec(spec)  # where numba looks for it
    spec.loader.exec_module(made)
    return made


def text(kind: int) -> str:
    """The source of that module: the template, with the calls of this kind in it."""
    law = vars(LAWS[kind])
    homes = [call.split(": ") for call in law.values() if call]
    lines = dict.fromkeys(f"from {HOME}.{module} import {call.split('(')[0]}" for module, call in homes)
    head, *functions = TEMPLATE.read_text(encoding="utf-8").replace("KIND = -1", f"KIND = {kind}").split("\n\n\n")
    own = [said for function in functions if (said := filled(function, law))]
    return "\n\n\n".join(["\n".join([*lines, head]), *own])


def filled(function: str, law: dict[str, str]) -> str:
    """A function of the template with its call in place, "" where this kind has none and needs none."""
    before, _, after = function.partition("...  # each: ")
    asked, end, rest = after.partition("\n")
    *into, job = asked.split(" = ")
    if law[job]:
        return before + " = ".join([*into, law[job].split(": ")[1]]) + end + rest
    return before + "pass" + end + rest if job in ("power", "stored") else ""
