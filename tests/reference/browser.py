"""Headless Chromium of this computer, controlled by Playwright."""

import contextlib
import glob
import os
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
OWN = "~/.cache/ms-playwright/chromium-*/chrome-linux*/chrome"  # folder of the browsers that Playwright installs


def chromium() -> str | None:
    """Path of an installed Chromium, or None."""
    found = [shutil.which(name) for name in NAMES] + sorted(glob.glob(os.path.expanduser(OWN)))
    return next((one for one in found if one), None)


@contextlib.contextmanager
def browser():
    """Yield a started browser; skip the test if Playwright or Chromium is missing."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright here to drive a browser")
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
