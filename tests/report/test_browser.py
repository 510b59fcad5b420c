"""Report page in a browser: it fetches nothing, reports no error, and shows figures with a moving head line."""

import re
from itertools import pairwise

import pytest
from reference import browser
from reference.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.draw.style import COLOURS
from fvsolve.report.figures import DARK_COLOURS, escape_markup
from fvsolve.report.report_files import write_report

TITLE = "</script><b>A & B</b> costs $5 and $6"
HIGH = "far <b>above</b> & $5"  # a limit far above all heads
PARTS = ("#section-0", "#history-0", "#history-1")


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "closure"
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 40),
        "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0)),
    }
    probes = ["gate.head", *(f"main.head@{k / 10}" for k in range(1, 10)), "valve.flow"]
    limits = {
        HIGH: {"on": "main", "quantity": "head", "maximum": 5e3},
        "low": {"on": "main", "quantity": "head", "minimum": -20.0},
    }
    case = scene(nodes, links, 3.0, {}, probes, title=TITLE, limits=limits)
    case["output"] |= {"fields": 6, "units": {"flow": "l/s"}}
    fvsolve.run(case, out=folder, pictures=False)
    return write_report(folder)[0]


@pytest.fixture(scope="module")
def chromium():
    with browser.browser() as started:
        yield started


def heads(page) -> list:
    return page.evaluate("id => document.querySelector(id).data.at(-1).y.slice()", "#section-0")


def test_nothing_is_fetched_nothing_complains_and_the_head_line_plays(report, chromium):
    page, said, asked = browser.opened(chromium, report, 1000)
    assert page.title() == TITLE and page.inner_text("h1") == TITLE
    for id in PARTS:
        assert page.locator(f"{id} .scatterlayer path.js-line").count() >= 1
    names = legend(page, "#section-0").all_text_contents()
    assert {
        "maximum head",
        "minimum head",
        "initial head",
        "pipe",
        "vapour line",
        "head now",
    } <= set(names)
    assert f"{HIGH}, maximum" in names
    beyond = f"{HIGH}, maximum: from 5000 m"
    assert set(page.locator("#section-0 .annotation-text").all_text_contents()) == {
        "top",
        "valve",
        beyond,
    }
    legend(page, "#section-0").get_by_text("vapour line").click()
    assert (
        page.evaluate("document.querySelector('#section-0').data.map(one => one.visible)").count(
            "legendonly"
        )
        == 1
    )
    before = heads(page)
    page.click(".player button")
    browser.until(page, "Number(document.querySelector('.player input').value) >= 2")
    assert heads(page) != before and "Pause" in page.inner_text(".player button")
    browser.until(page, "document.querySelector('.player button').textContent == 'Play'")
    assert "t = 3 s" in page.inner_text(".player output")
    page.evaluate("Plotly.relayout('history-0', {'xaxis.range[0]': 0.4, 'xaxis.range[1]': 1.2})")
    browser.until(page, "document.querySelector('#history-1').layout.xaxis.range[1] == 1.2")
    name = "a <b>bold</b> & $x$ &lt; </script>"
    page.evaluate(
        "name => Plotly.relayout('history-1', {'xaxis.title.text': name})", escape_markup(name)
    )
    assert page.locator("#history-1 .xtitle").all_text_contents() == [name]
    assert said == [] and asked == [report.as_uri()]


def test_a_phone_reads_it_without_scrolling_aside(report, chromium):
    page, said, _ = browser.opened(chromium, report, 390, 844, has_touch=True, is_mobile=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 390 and said == []
    legends_are_clear(page)
    boxes = [page.locator(id).bounding_box() for id in PARTS]
    assert all(
        box["x"] >= 0 and box["x"] + box["width"] <= 390 and box["height"] >= 250 for box in boxes
    )


def test_paper_holds_whole_figures(report, chromium):
    page, said, _ = browser.opened(chromium, report, 1280)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 680, "height": 990})
    widths = [page.locator(f"{id} .main-svg").first.bounding_box()["width"] for id in PARTS]
    assert widths == [680.0] * 3 and not page.locator(".player").is_visible()
    assert page.locator("#section-0 .nsewdrag").bounding_box()["height"] > 300
    legends_are_clear(page)
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert (
        page.locator("#section-0 .main-svg").first.bounding_box()["height"] == 920.0 and said == []
    )


@pytest.mark.parametrize("width", [390, 1000])
def test_no_name_over_a_section_covers_another(chromium, tmp_path, width):
    """Places come closer towards the end, where names are left of their places; names never overlap, also on paper."""
    names = [f"place-{k}" for k in range(13)]
    nodes = {name: junction() for name in names} | {names[0]: lake("45 m"), names[-1]: lake("40 m")}
    links = {
        f"pipe-{k}": pipe(a, b, 20.0 + 480.0 * 0.7**k, 0.3, 1000.0, 2)
        for k, (a, b) in enumerate(pairwise(names))
    }
    case = scene(nodes, links, 0.1, {}, [], routes={"line": {"pipes": [*links]}})
    fvsolve.run(case, out=tmp_path / "run", pictures=False)
    page, _, _ = browser.opened(chromium, write_report(tmp_path / "run")[0], width)
    for printed in (False, True):
        if printed:
            page.evaluate("dispatchEvent(new Event('beforeprint'))")
        begins = sorted(
            page.evaluate("""() => [...document.querySelectorAll('#section-0 .annotation-text')].map(
            (one) => one.getBoundingClientRect().left)""")
        )
        assert len(begins) > 3 and min(b - a for a, b in pairwise(begins)) > 14, begins


@pytest.mark.parametrize("words", [0, 30, 60, 90])
def test_no_page_of_paper_but_the_last_is_half_empty_and_each_has_title_and_number(
    report, chromium, words
):
    """Up to 1080 words precede the figures."""
    page, _, _ = browser.opened(chromium, report, 1280)
    if int(chromium.version.partition(".")[0]) < 131:
        pytest.skip("this Chromium writes nothing on the margins of pages")
    page.evaluate(
        "n => document.querySelector('#verdict').append(...Array(n).fill('word '.repeat(12)))",
        words,
    )
    found = browser.pages(page.pdf(prefer_css_page_size=True))
    assert len(found) > 3
    for number, one in enumerate(found, 1):
        over, under = (
            "".join(text for y, text in one if low < y < high)
            for low, high in ((0, 18), (281, 297))
        )
        assert (over, under) == (TITLE, f"{number} / {len(found)}")
    ends = [max(y for y, _ in one if 18.0 < y < 281.0) for one in found]
    assert all((end - 18.0) / 263.0 > 0.5 for end in ends[:-1]), ends


def test_a_dark_screen_has_a_dark_page_and_paper_stays_light(report, chromium):
    page, said, _ = browser.opened(chromium, report, 1000, color_scheme="dark")
    assert colours(page) == dict.fromkeys(("body", "paper", "legend"), "dark")
    ground = "document.querySelector('#section-0').layout.paper_bgcolor"
    page.emulate_media(color_scheme="light")
    browser.until(page, f"{ground} == '#ffffff'")
    assert colours(page) == dict.fromkeys(("body", "paper", "legend"), "light")
    page.emulate_media(color_scheme="dark")
    browser.until(page, f"{ground} != '#ffffff'")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert colours(page) == dict.fromkeys(("body", "paper", "legend"), "light")
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert colours(page)["paper"] == "dark" and said == []


def colours(page) -> dict[str, str]:
    """`dark` or `light` for the page, a figure and the first line of a legend; a dark page has lighter lines."""
    asked = """() => ({body: getComputedStyle(document.body).backgroundColor,
        paper: getComputedStyle(document.querySelector('#section-0 .main-svg')).backgroundColor,
        legend: document.querySelector('.legend line').getAttribute('stroke')})"""
    found = page.evaluate(asked)
    values = {name: sum(numbers(text)) / 3 for name, text in found.items()}
    said = {name: "dark" if value < 128 else "light" for name, value in values.items()}
    return said | {"legend": "dark" if found["legend"] == DARK_COLOURS[COLOURS[0]] else "light"}


def numbers(colour: str) -> list[int]:
    """Red, green and blue of `rgb(18, 23, 29)` or `#12171d`."""
    if colour.startswith("#"):
        return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return [int(one) for one in re.findall(r"\d+", colour)[:3]]


def legend(page, id: str):
    """Buttons of the legend above a chart."""
    return page.locator(f".legend:has(+ {id}) button")


def legends_are_clear(page) -> None:
    """Check that no legend covers curves, axes or names of parts of a chart."""
    boxes = page.evaluate("""() => [...document.querySelectorAll('.chart')].map(chart => {
        const box = (one) => { const { top, bottom } = one.getBoundingClientRect(); return [top, bottom]; };
        return { legend: box(chart.previousElementSibling), chart: box(chart),
                 inside: chart.querySelectorAll('.legend').length,
                 curves: [...chart.querySelectorAll('.nsewdrag, .annotation, .xtick text, .ytick text')].map(box) };
    })""")
    assert boxes
    for one in boxes:
        (top, bottom), (begin, end) = one["legend"], one["chart"]
        assert bottom > top and bottom <= begin + 0.5 and one["inside"] == 0, one
        assert all(begin - 0.5 <= a and b <= end + 0.5 for a, b in one["curves"]), one
