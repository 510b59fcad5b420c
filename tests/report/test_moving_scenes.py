"""Scenes of bodies and moving basins in a report: pictures of the stored frames with a slider."""

import base64
import json
import re

import pytest
from reference import browser

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.report import moving_scenes
from fvsolve.report.moving_scenes import moving_scene
from fvsolve.report.report_files import write_report


@pytest.fixture(scope="module")
def lifted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "crane"
    keys = {"output.fields": 4, "numerics.end": 1.0, "expect": {}}
    return fvsolve.run(fvsolve.load("crane", set=keys), out=folder, pictures=False)


def test_a_report_of_bodies_has_a_picture_of_each_frame(lifted):
    text = write_report(lifted.directory)[0].read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="figures">(.*?)</script>', text, re.S)[1])["scene"]
    if not data["pictures"]:
        pytest.skip("no OpenGL here")
    assert data["moving"]["times"] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    pictures = [base64.b64decode(item.partition(",")[2]) for item in data["pictures"]]
    assert len(set(pictures)) == 5 and all(item[:8] == b"\x89PNG\r\n\x1a\n" for item in pictures)
    with browser.browser() as chromium:
        page, said, asked = browser.opened(chromium, lifted.directory / "report.html", 1000)
        page.locator("#scene-player input").fill("3")
        assert page.locator("#scene-player output").inner_text() == "t = 0.75 s"
        assert page.get_attribute("img.scene", "src") == data["pictures"][3]
        assert not said and [item for item in asked if item.startswith("http")] == []


def test_without_pyvista_the_report_names_the_missing_library(lifted, monkeypatch):
    def failed(scene):
        raise FvsolveError("PyVista is missing")

    monkeypatch.setattr(moving_scenes, "frame_pictures", failed)
    text = write_report(lifted.directory)[0].read_text(encoding="utf-8")
    assert "The scene is not drawn: PyVista is missing" in text and 'id="scene-player"' not in text


def test_cases_without_bodies_have_no_scene(tmp_path):
    result = fvsolve.run("two-tanks", out=tmp_path / "run", pictures=False)
    assert moving_scene(result) is None
