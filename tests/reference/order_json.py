"""Calls of `fvsolve order` from the command line, and its JSON output."""

import json
import sys
from pathlib import Path

from fvsolve.case import text
from fvsolve.cli import main


def call(capsys, *words: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of `fvsolve order` with the arguments `words`."""
    old, sys.argv = sys.argv, ["fvsolve", "order", *words]
    try:
        main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    finally:
        sys.argv = old
    said = capsys.readouterr()
    return code, said.out, said.err


def studies(capsys, folder: Path, case: dict, *words: str) -> list[dict]:
    """Studies in the output of `--json`, for a case given as a dict."""
    path = folder / "case.toml"
    path.write_text(text.write(case), encoding="utf-8")
    code, out, err = call(capsys, str(path), "--out", str(folder / "out"), "--json", *words)
    assert code == 0, err
    return json.loads(out)["studies"]
