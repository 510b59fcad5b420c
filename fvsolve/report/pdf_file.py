"""PDF of a page of a report, printed to A4 by an installed Chromium, Chrome or Edge without a window."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from fvsolve.errors import FvsolveError
from fvsolve.file_replacement import write_file

# commands of browsers that print without a window, and their places on Windows and macOS
BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "msedge",
)
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)
HOW_TO_PRINT = "open the page in a browser and print it to a PDF on A4, with its own margins and background graphics"
DRAWING_TIME = 60_000  # time of the page for drawing before it is printed [ms]; it ends early when all is drawn
TIMEOUT = 180.0  # of the browser [s]


def chromium_path() -> str | None:
    """Path of an installed browser that prints without a window; None if there is none.

    The environment variable FVSOLVE_BROWSER names another one.
    """
    if given := os.environ.get("FVSOLVE_BROWSER"):
        return shutil.which(given)
    found = [shutil.which(name) for name in BROWSERS]
    found += [place for place in PLACES if Path(place).is_file()]
    return next((path for path in found if path), None)


def write_pdf(page: Path) -> Path:
    """Print the page of a report to a PDF with the same name; returns its path.

    Raises FvsolveError with a sentence on printing by hand if no browser is installed, or if it fails.
    """
    browser, out = chromium_path(), page.with_suffix(".pdf")
    if browser is None:
        raise FvsolveError(
            f"{page} is written, but no Chromium, Chrome or Edge is installed to print it: {HOW_TO_PRINT}"
        )
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder) / "report.pdf"
        command = [
            browser,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
            f"--virtual-time-budget={DRAWING_TIME}",
            "--run-all-compositor-stages-before-draw",
            f"--print-to-pdf={fresh}",
            page.resolve().as_uri(),
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.insert(1, "--no-sandbox")  # Chromium refuses to run as root with its sandbox
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise FvsolveError(_failed(page, browser, str(error))) from None
        if done.returncode or not fresh.is_file():
            lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
            raise FvsolveError(_failed(page, browser, lines[-1]))
        try:
            write_file(out, fresh.read_bytes())
        except OSError as error:
            raise FvsolveError(f"{out}: cannot be written: {error.strerror or error}") from None
    return out


def _failed(page: Path, browser: str, reason: str) -> str:
    return f"{page} is written, but {browser} could not print it ({reason}): {HOW_TO_PRINT}"
