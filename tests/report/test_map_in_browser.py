"""Map of a report in a browser: layers, slider, click on a cell, sizes of screens, print; nothing is fetched."""

import pytest
from reference import browser
from reference.flooded_valley import pool

import fvsolve
from fvsolve.report.report_files import write_report

SLIDER = "#maps .player input"
IMAGE = "document.querySelector('#map-0').layout.images[0].source"


@pytest.fixture(scope="module")
def flooded(tmp_path_factory):
    case = pool()
    case["output"] = case["output"] | {"fields": 8}
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "pool", pictures=False)


@pytest.fixture(scope="module")
def report(flooded):
    return write_report(flooded.directory)[0]


@pytest.fixture(scope="module")
def chromium():
    with browser.browser() as started:
        yield started


def test_layers_and_slider_change_the_picture_without_network_or_messages(report, chromium):
    page, said, asked = browser.opened(chromium, report, 1280)
    layers = page.locator("#maps .layers button")
    assert layers.all_text_contents() == [
        "greatest depth",
        "greatest speed",
        "greatest depth times speed",
        "time of arrival",
        "duration of flooding",
        "depth over time",
    ]
    pictures = [page.evaluate(IMAGE)]
    for k in range(1, 5):
        layers.nth(k).click()
        browser.until(page, f"{IMAGE} !== {pictures[-1]!r}")
        pictures.append(page.evaluate(IMAGE))
    assert len(set(pictures)) == 5
    assert (
        page.locator("#maps .classes").inner_text().lower().startswith("duration of flooding [s]")
    )
    page.locator(SLIDER).fill("3")
    browser.until(page, f"{IMAGE} !== {pictures[-1]!r}")
    assert layers.nth(5).get_attribute("aria-pressed") == "true"
    assert page.locator("#maps .player output").inner_text() == "t = 1.5 s"
    assert not said and asked == [report.as_uri()]


def test_the_map_plays_to_the_last_frame(report, chromium):
    page, said, _ = browser.opened(chromium, report, 1000)
    page.locator("#maps .player button").click()
    browser.until(page, f"document.querySelector('{SLIDER}').value === '8'")
    browser.until(page, "document.querySelector('#maps .player button').textContent === 'Play'")
    assert page.locator("#maps .player output").inner_text() == "t = 4 s" and not said


def test_a_click_on_a_cell_shows_its_depth_over_time(flooded, report, chromium):
    from fvsolve.core.output.grid_files import frame_field
    from fvsolve.report.maps.flood_map import basin_frames

    page, said, _ = browser.opened(chromium, report, 1280)
    x, y = page.evaluate(
        "() => { const plot = document.querySelector('#map-0'), { xaxis, yaxis } = plot._fullLayout;"
        "const box = plot.getBoundingClientRect();"
        "return [box.left + xaxis._offset + xaxis.d2p(3.4), box.top + yaxis._offset + yaxis.d2p(6.3)]; }"
    )
    page.mouse.click(x, y)
    browser.until(page, "document.querySelector('#maps .cell').data?.length === 1")
    shown = page.evaluate("[...document.querySelector('#maps .cell').data[0].y]")
    files = basin_frames(flooded)["valley"]
    depths = [float(frame_field(path, "depth")[6 * 24 + 3]) for _, path in files]
    # a shown value is the middle of a part of its class, which has 36; the widest class is 1 m to 2 m
    assert shown == pytest.approx(depths, abs=0.51 * 1.0 / 36)
    assert page.evaluate("document.querySelector('#map-0').data.at(-1).x[0]") == pytest.approx(
        3.4, abs=0.05
    )
    assert not said


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_map_fits_the_window(width, scheme, report, chromium):
    page, said, _ = browser.opened(chromium, report, width, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    ratio = page.evaluate(
        "() => { const { xaxis, yaxis } = document.querySelector('#map-0')._fullLayout;"
        "return (xaxis._length / (xaxis.range[1] - xaxis.range[0]))"
        " / (yaxis._length / (yaxis.range[1] - yaxis.range[0])); }"
    )
    assert ratio == pytest.approx(1.0, abs=0.02)
    bar = page.evaluate(
        "() => { const { xaxis } = document.querySelector('#map-0')._fullLayout,"
        "bar = document.querySelector('#maps .scale');"
        "return parseFloat(bar.style.width) * (xaxis.range[1] - xaxis.range[0]) / xaxis._length"
        " / parseFloat(bar.textContent); }"
    )
    assert bar == pytest.approx(1.0, abs=0.01) and not said


def test_with_a_start_time_the_slider_shows_dates(chromium, tmp_path):
    case = pool()
    case["numerics"]["start_time"] = "2026-03-01T06:00:00Z"
    fvsolve.run(case, out=tmp_path / "run", pictures=False)
    page, said, _ = browser.opened(chromium, write_report(tmp_path / "run")[0], 1000)
    page.locator(SLIDER).fill("5")
    browser.until(page, "document.querySelector('#maps .player output').textContent !== ''")
    assert "2026-03-01T06:00:04Z" in page.locator("#maps .player output").inner_text() and not said


def test_the_printed_map_is_large(report, chromium):
    page, _, _ = browser.opened(chromium, report, 1280)
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.wait_for_timeout(300)
    height = page.locator("#map-0").bounding_box()["height"]
    assert height >= 70 / 25.4 * 96
