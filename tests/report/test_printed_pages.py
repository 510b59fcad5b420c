"""Pages of a report as PDF on A4: heights of sections, names, and the message without a browser."""

import numpy as np
import pytest
from reference import browser
from reference.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.draw.style import COLOURS
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios

LONG_NAME = "valve-of-the-northern-district-beside-the-old-mill-road"
STUDY = """
case = "main.toml"
[events.slow.links.{name}]
opening = {{ start = 0.2, duration = 0.4, value = [1, 0] }}
[events.fast.links.{name}]
opening = {{ start = 0.2, duration = 0.1, value = [1, 0] }}
[protections.none]
[protections.vessel.nodes.vessel]
type = "accumulator"
volume = 0.5
gas_volume = 0.1
on = "main"
at = "300 m"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Study of a main whose valve has a long name, so that names take a large part of each figure."""
    folder = tmp_path_factory.mktemp("study")
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 20),
        LONG_NAME: valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0)),
    }
    links["main"]["allowable_pressure"] = "10 bar"
    limits = {"class": {"on": "main", "quantity": "gauge_pressure", "maximum": "10 bar"}}
    case = scene(nodes, links, 1.0, {}, ["gate.head"], title="Main", limits=limits)
    (folder / "main.toml").write_text(fvsolve.load(case).resolved())
    (folder / "study.toml").write_text(STUDY.format(name=LONG_NAME))
    scenarios.study(folder / "study.toml", folder / "runs")
    return folder / "runs"


@pytest.fixture(scope="module")
def chromium():
    with browser.browser() as started:
        yield started


def test_printed_sections_have_curves_of_70_mm(study, chromium):
    page, said, _ = browser.opened(chromium, write_report(study)[0], 1280)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    heights = page.evaluate(
        "() => [...document.querySelectorAll('[id^=section-] .nsewdrag')].map("
        "(area) => area.getBoundingClientRect().height)"
    )
    assert len(heights) == 2 and min(heights) >= 70.0 / 25.4 * 96.0 and not said


def test_a_name_is_on_several_lines_without_a_letter_left_out(study, chromium):
    page, _, _ = browser.opened(chromium, write_report(study)[0], 1280)
    names = page.locator("#section-0-0 .annotation-text").all_text_contents()
    assert any(LONG_NAME in "".join(name.split()) for name in names)
    assert page.locator("#section-0-0 .annotation-text tspan.line").count() >= 3


def test_a_section_of_a_study_names_the_devices_of_all_protections(study, chromium):
    page, _, _ = browser.opened(chromium, write_report(study)[0], 1280)
    assert "vessel" in page.locator("#section-0-0 .annotation-text").all_text_contents()


def test_a_limit_that_equals_the_class_is_not_drawn_again(study, chromium):
    page, _, _ = browser.opened(chromium, write_report(study)[0], 1280)
    names = page.locator(".legend:has(+ #section-0-0) button").all_text_contents()
    assert names.count("class line") == 1 and "class, maximum" not in names


def test_a_study_lists_the_extreme_pressures_of_every_run(study):
    text = write_report(study)[0].read_text(encoding="utf-8")
    table = text.partition("<caption>Extreme pressures</caption>")[2].partition("</table>")[0]
    for event in ("slow", "fast"):
        for protection in ("none", "vessel"):
            assert table.count(f">{event} with {protection}<") == 2


def test_the_option_pdf_prints_pages_with_title_and_number(study, fvs):
    if browser.chromium() is None:
        pytest.skip("no Chromium here")
    code, out, _ = fvs("report", study, "--pdf")
    assert code == 0 and out.split() == [str(study / "report.html"), str(study / "report.pdf")]
    pages = browser.pages((study / "report.pdf").read_bytes())
    text = " ".join(words for page in pages for _, words in page)
    assert len(pages) > 3 and "Extreme pressures" in text


def test_the_images_of_pages_are_of_a4_and_show_the_curves_of_each_event(study, fvs):
    pdfium = pytest.importorskip("pypdfium2")
    if browser.chromium() is None:
        pytest.skip("no Chromium here")
    fvs("report", study, "--pdf")
    document = pdfium.PdfDocument(study / "report.pdf")
    pictures = [np.asarray(page.render(scale=2.0).to_pil(), int)[..., :3] for page in document]
    sizes = {picture.shape[:2] for picture in pictures}
    assert all(abs(high / 2.0 / browser.MM - 297.0) < 0.5 for high, _ in sizes)
    assert all(abs(wide / 2.0 / browser.MM - 210.0) < 0.5 for _, wide in sizes)
    first_run = [int(COLOURS[0][k : k + 2], 16) for k in (1, 3, 5)]
    curves = [(np.abs(picture - first_run).sum(axis=2) < 30).sum() for picture in pictures]
    assert sum(count > 500 for count in curves) >= 2


def test_the_pdf_replaces_no_page_of_the_same_name(study, fvs, tmp_path):
    code, _, said = fvs("report", study, "--out", tmp_path / "page.pdf", "--pdf")
    assert code == 2 and "expected --out FILE.html" in said


def test_without_a_browser_the_message_is_how_to_print(study, fvs, monkeypatch):
    monkeypatch.setenv("FVSOLVE_BROWSER", "no-such-browser")
    code, out, said = fvs("report", study, "--pdf")
    assert code == 2 and out.split() == [str(study / "report.html")]
    assert "no Chromium, Chrome or Edge is installed" in said and "print it to a PDF on A4" in said
