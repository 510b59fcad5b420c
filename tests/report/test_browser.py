"""The page in a real browser: nothing is fetched, nothing complains, figures are there, the head line moves."""

import pytest
from truth import browser
from truth.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.figures import as_it_stands
from fvsolve.report.report import write_report

TITLE = "</script><b>A & B</b> costs $5 and $6"
PARTS = ("#section-0", "#history-0", "#history-1")


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "closure"
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {"main": pipe("top", "gate", 900.0, 0.3, 1200.0, 40),
             "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0))}  # fmt: skip
    case = scene(nodes, links, 3.0, {}, ["gate.head", "main.head@0.5", "valve.flow"], title=TITLE)
    case["output"] |= {"fields": 6, "units": {"flow": "l/s"}}
    fvsolve.run(case, out=folder, pictures=False)
    return write_report(folder)[0]


@pytest.fixture(scope="module")
def chromium():
    with browser.browser() as started:
        yield started


def heads(page) -> list:
    return page.evaluate("id => document.querySelector(id).data.at(-1).y.slice()", "#section-0")


def until(page, what: str) -> None:
    """Wait for it; Playwright's own way would evaluate text, which the page forbids."""
    for _ in range(200):
        if page.evaluate(what):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"it never came: {what}")


def test_nothing_is_fetched_nothing_complains_and_the_head_line_plays(report, chromium):
    page, said, asked = browser.opened(chromium, report, 1000)
    assert page.title() == TITLE and page.inner_text("h1") == TITLE
    for id in PARTS:
        assert page.locator(f"{id} .scatterlayer path.js-line").count() >= 1
    names = page.locator("#section-0 .legendtext").all_text_contents()
    assert {"greatest head", "least head", "initial head", "pipe", "vapour line", "head now"} <= set(names)
    assert set(page.locator("#section-0 .annotation-text").all_text_contents()) == {"top (r", "valve"} - {"top (r"} | {
        "top"
    }
    before = heads(page)
    page.click(".player button")
    until(page, "Number(document.querySelector('.player input').value) >= 2")
    assert heads(page) != before and "Pause" in page.inner_text(".player button")
    until(page, "document.querySelector('.player button').textContent == 'Play'")
    assert "t = 3 s" in page.inner_text(".player output")
    page.evaluate("Plotly.relayout('history-0', {'xaxis.range[0]': 0.4, 'xaxis.range[1]': 1.2})")
    until(page, "document.querySelector('#history-1').layout.xaxis.range[1] == 1.2")
    name = "a <b>bold</b> & $x$ &lt; </script>"
    page.evaluate("name => Plotly.restyle('history-1', {name: name}, [0])", as_it_stands(name))
    page.evaluate("Plotly.relayout('history-1', {showlegend: true})")
    assert page.locator("#history-1 .legendtext").all_text_contents() == [name]
    assert said == [] and asked == [report.as_uri()]


def test_a_phone_reads_it_without_scrolling_aside(report, chromium):
    page, said, _ = browser.opened(chromium, report, 390, 844, has_touch=True, is_mobile=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 390 and said == []
    boxes = [page.locator(id).bounding_box() for id in PARTS]
    assert all(box["x"] >= 0 and box["x"] + box["width"] <= 390 and box["height"] >= 250 for box in boxes)


def test_paper_holds_whole_figures(report, chromium):
    page, said, _ = browser.opened(chromium, report, 1280)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 680, "height": 990})
    widths = [page.locator(f"{id} .main-svg").first.bounding_box()["width"] for id in PARTS]
    assert widths == [680.0] * 3 and not page.locator(".player").is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.pdf(prefer_css_page_size=True).startswith(b"%PDF") and said == []
