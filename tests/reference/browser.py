"""Headless Chromium of this computer, controlled by Playwright, and the text on the pages of a PDF file from it."""

import contextlib
import glob
import os
import re
import shutil
import zlib

import numpy as np
import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
# folder of the browsers that Playwright installs
OWN = "~/.cache/ms-playwright/chromium-*/chrome-linux*/chrome"


def chromium() -> str | None:
    """Path of an installed Chromium, or None."""
    found = [shutil.which(name) for name in NAMES] + sorted(glob.glob(os.path.expanduser(OWN)))
    return next((one for one in found if one), None)


@contextlib.contextmanager
def browser():
    """Yield a started browser; skip the test if Playwright or Chromium is missing."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="no Playwright here to drive a browser"
    )
    if (where := chromium()) is None:
        pytest.skip("no Chromium here: chromium, google-chrome or Playwright's own")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=where, args=["--no-sandbox"])
        yield started
        started.close()


def opened(started, path, width: int, height: int = 1000, **settings):
    """Page after its figures are drawn, with its console messages and errors, and the addresses that it requested."""
    page = started.new_page(viewport={"width": width, "height": height}, **settings)
    said, asked = [], []
    page.on("console", lambda one: said.append(one.text))
    page.on("pageerror", lambda one: said.append(str(one)))
    page.on("request", lambda one: asked.append(one.url))
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-drawn]", timeout=60_000)
    return page, said, asked


def until(page, expression: str) -> None:
    """Wait until a JavaScript expression is true; the function of Playwright evaluates text, which the page forbids."""
    for _ in range(200):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"it never came: {expression}")


MM = 72.0 / 25.4  # points per millimetre


def pages(pdf: bytes) -> list[list[tuple[float, str]]]:
    """Pieces of text of each page with their distances from the top edge [mm]."""
    objects = {
        int(one[1]): one[2] for one in re.finditer(rb"\n(\d+) 0 obj\n(.*?)\nendobj", pdf, re.S)
    }
    fonts: dict[int, dict[int, str]] = {}
    found = []
    for page in objects.values():
        if not re.search(rb"/Type /Page\b", page):
            continue
        height = float(re.search(rb"/MediaBox \[0 0 \S+ ([\d.]+)\]", page)[1])
        names = {name.decode(): int(at) for name, at in re.findall(rb"/(F\d+) (\d+) 0 R", page)}
        for at in names.values():
            if at not in fonts:
                fonts[at] = letters(
                    stream(objects, int(re.search(rb"/ToUnicode (\d+)", objects[at])[1]))
                )
        text = stream(objects, int(re.search(rb"/Contents (\d+)", page)[1]))
        known = {name: fonts[at] for name, at in names.items()}
        found.append([((height - y) / MM, words) for y, words in pieces(text, known)])
    return found


def stream(objects: dict[int, bytes], at: int) -> str:
    """Decompressed text of the stream of an object."""
    packed = objects[at].partition(b"stream\n")[2]
    return zlib.decompressobj().decompress(packed).decode("latin1")


def letters(table: str) -> dict[int, str]:
    """Letters of the glyphs of a ToUnicode table : glyph -> letter."""
    found = {}
    for block in re.findall(r"beginbfchar(.*?)endbfchar", table, re.S):
        found |= {int(a, 16): chr(int(b[:4], 16)) for a, b in re.findall(r"<(\w+)> <(\w+)>", block)}
    for block in re.findall(r"beginbfrange(.*?)endbfrange", table, re.S):
        for a, b, c in re.findall(r"<(\w+)> <(\w+)> <(\w+)>", block):
            found |= {
                int(a, 16) + k: chr(int(c[:4], 16) + k) for k in range(int(b, 16) - int(a, 16) + 1)
            }
    return found


def pieces(text: str, fonts: dict[str, dict[int, str]]) -> list[tuple[float, str]]:
    """Height of the base line [point] and text of each BT ... ET block."""
    found, stack, at, font, words, place = [], [], np.eye(3), {}, "", np.eye(3)
    operands: list[str] = []
    for token in text.split():
        if token == "cm":
            at = matrix(operands) @ at
        elif token == "q":
            stack.append(at)
        elif token == "Q":
            at = stack.pop()
        elif token == "Tf":
            font = fonts.get(operands[-2].lstrip("/"), {})
        elif token == "Tm":
            place = matrix(operands) @ at
        elif token == "Tj":
            glyphs = operands[-1].strip("<>")
            words += "".join(
                font.get(int(glyphs[k : k + 4], 16), "?") for k in range(0, len(glyphs), 4)
            )
        elif token == "ET":
            found.append((float(place[2, 1]), words))
            words = ""
        if re.fullmatch(r"[A-Za-z*]+", token):
            operands = []
        else:
            operands.append(token)
    return found


def matrix(operands: list[str]) -> np.ndarray:
    """Matrix [a b 0; c d 0; e f 1] of six numbers."""
    return np.array([*map(float, operands[-6:])]).reshape(3, 2) @ np.eye(2, 3) + np.diag(
        [0.0, 0.0, 1.0]
    )
