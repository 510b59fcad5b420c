"""The site: built without warnings, complete, linked, independent of the network, and readable in every form.

The tests need the extra `docs`. FVSOLVE_SITE is the folder of a site that is already built.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from reference.browser import browser
from reference.folders import DOCS

for module in (
    "sphinx",
    "myst_nb",
    "pydata_sphinx_theme",
    "sphinx_copybutton",
    "latex2mathml",
    "wntr",
    "plotly",
):
    pytest.importorskip(module, reason="the extra `docs` is not installed")

FILES = (path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md"))
# part of validation/cases
PAGES = sorted(page for page in FILES if not page.startswith("validation/results/"))
FORMS = [(width, scheme) for width in (1280, 390) for scheme in ("light", "dark")]
LOADED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "embed": "src",
}
VOID = {"script", "style", "template", "noscript"}  # elements whose text is not shown


def build(source: Path, target: Path) -> subprocess.CompletedProcess:
    """Build a site from nothing, with warnings as errors."""
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "-n",
        "--keep-going",
        "-E",
        "-q",
        str(source),
        str(target),
    ]
    known = os.environ | {"PYTHONPATH": str(DOCS.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(command, capture_output=True, text=True, env=known)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """Folder of the built site."""
    if folder := os.environ.get("FVSOLVE_SITE"):
        return Path(folder)
    folder = tmp_path_factory.mktemp("site")
    done = build(DOCS, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


class Page(HTMLParser):
    """Links, anchors, loaded files and text of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.links, self.anchors, self.loaded, self.words, self.hidden = [], {""}, [], [], 0
        self.feed(path.read_text(encoding="utf-8"))
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given.get("id", "")}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag in LOADED or (tag == "link" and given.get("rel") != "canonical"):
            self.loaded.append(given.get("src") or given.get("href") or "")
        self.hidden += tag in VOID

    def handle_endtag(self, tag):
        self.hidden -= tag in VOID

    def handle_data(self, data):
        if not self.hidden:
            self.words.append(data)


@cache
def read(path: Path) -> Page:
    return Page(path)


def html(site: Path) -> list[Path]:
    """Pages of the site, without templates of the theme."""
    return [path for path in site.rglob("*.html") if path.parent.name != "_static"]


def test_every_page_of_docs_is_a_page_of_the_site(site):
    assert [page for page in PAGES if not (site / f"{page}.html").is_file()] == [] and len(
        PAGES
    ) > 60


def test_every_page_is_reached_from_the_only_landing_page(site):
    seen, todo = set(), {"index.html"}
    while todo:
        name = todo.pop()
        seen.add(name)
        found = (urlsplit(link).path for link in read(site / name).links if "://" not in link)
        todo |= {
            os.path.normpath(Path(name).parent / unquote(one))
            for one in found
            if one.endswith(".html")
        } - seen
    assert {f"{page}.html" for page in PAGES} <= seen
    assert [
        one for one in ("home", "start", "contents", "README") if (site / f"{one}.html").exists()
    ] == []


def test_every_link_leads_to_a_file_and_an_anchor_of_the_site(site):
    lost = []
    for path in html(site):
        for link in [*read(path).links, *read(path).loaded]:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchored = target.suffix != ".html" or unquote(parts.fragment) in read(
                target
            ).anchors | {"#"}
            if not target.is_file() or not anchored:
                lost.append(f"{path.relative_to(site)}: {link}")
    assert lost == []


def test_no_page_and_no_style_loads_a_file_from_the_network(site):
    outside = re.compile(r"^(https?:)?//")
    assert [
        (path.name, one) for path in html(site) for one in read(path).loaded if outside.match(one)
    ] == []
    for style in site.rglob("*.css"):
        assert not re.search(
            r"(url\(\s*['\"]?|@import\s+['\"])(https?:)?//", style.read_text(encoding="utf-8")
        ), style


@pytest.mark.parametrize("page", PAGES)
def test_headings_and_code_of_a_page_are_in_its_html(page, site):
    """The text needs no JavaScript."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    if mark := re.match(r"<!-- page: (\S+) -->", text):
        text = (DOCS / f"{page}.md").parent.joinpath(mark[1]).read_text(encoding="utf-8")
    shown = re.sub(r"\s", "", read(site / f"{page}.html").text)
    blocks = re.findall(
        r"^```[^\n]*\n(?:%%writefile[^\n]*)?(.*?)^```",
        text.replace("\n!", "\n"),
        re.DOTALL | re.MULTILINE,
    )
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    headings = [
        re.sub(r"[*`]|\]\(.*?\)|\[", "", one)
        for one in re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    ]
    assert (
        headings
        and [one for one in [*headings, *blocks] if re.sub(r"\s", "", one) not in shown] == []
    )


def test_formulas_are_mathml(site):
    page = (site / "tutorials/first-run.html").read_text(encoding="utf-8")
    assert "<mi>&#x003C1;</mi>" in page or "<mi>ρ</mi>" in page
    assert 'display="block"' in page and "$$" not in read(site / "tutorials/first-run.html").text
    assert not any("mathjax" in one.lower() for path in html(site) for one in read(path).loaded)


def test_cells_of_a_tutorial_have_run_and_commands_are_shown_as_for_a_shell(site):
    page = (site / "tutorials/first-run.html").read_text(encoding="utf-8")
    text = read(site / "tutorials/first-run.html").text
    assert "rise 5.26" in text and "holds: max(gate.pressure)" in text and "!fvsolve" not in text
    assert "gate.pressure Pa 27352.5 3.99638" in text and "\x1b" not in text
    assert len(re.findall(r"<img[^>]*_images/[0-9a-f]{32,}\.png", page)) == 2


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.startswith("tutorials/") and "index" not in page]
)
def test_every_tutorial_has_run_and_shows_pictures_and_plain_commands_and_files(page, site):
    shown = re.sub(r"\s", "", read(site / f"{page}.html").text)
    assert "!fvsolve" not in shown and "%%writefile" not in shown and "\x1b" not in shown
    assert (
        len(
            re.findall(
                r"<img[^>]*_images/[0-9a-f]{32,}\.png", (site / f"{page}.html").read_text("utf-8")
            )
        )
        >= 1
    )


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.startswith("tutorials/") and "index" not in page]
)
def test_every_tutorial_has_a_link_to_its_notebook_with_output(page, site):
    links = [link for link in read(site / f"{page}.html").links if link.endswith(".ipynb")]
    assert [Path(link).stem for link in links] == [Path(page).name]
    cells = json.loads(((site / page).parent / links[0]).read_text("utf-8"))["cells"]
    assert any(cell.get("outputs") for cell in cells)


def test_a_failing_cell_a_lost_link_and_a_page_without_section_stop_the_build(tmp_path):
    for name in (
        "conf.py",
        "generated_pages.py",
        "part_pages.py",
        "kernel_start.py",
        "python.md",
        "site.css",
    ):
        shutil.copy(DOCS / name, tmp_path / name)
    (tmp_path / "python.md").write_text("# Alone\n")
    (tmp_path / "index.md").write_text(
        "# Top\n\n[gone](gone.md)\n\n| page |\n|---|\n| [cell](cell.md) |\n"
    )
    head = "---\nfile_format: mystnb\nkernelspec:\n  name: python3\n---\n\n# Cell\n\n"
    (tmp_path / "cell.md").write_text(head + "```{code-cell} ipython3\n!false\n!echo after\n```\n")
    done = build(tmp_path, tmp_path / "html")
    assert done.returncode != 0
    assert "exit status 1 of: false" in done.stdout + done.stderr
    (tmp_path / "cell.md").write_text(head)
    done = build(tmp_path, tmp_path / "html")
    assert done.returncode != 0 and "gone" in done.stderr
    assert "python.md: WARNING: document isn't included" in done.stderr


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.mark.parametrize(("width", "scheme"), FORMS)
def test_pages_fit_their_window_without_a_message_of_the_browser(width, scheme, site, chromium):
    """No page is wider than its window; the browser loads local files only and reports nothing."""
    view = chromium.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    said, asked, wide = [], [], []
    view.on(
        "console", lambda one: said.append(one.text) if one.type in ("error", "warning") else None
    )
    view.on("pageerror", lambda one: said.append(str(one)))
    view.on("request", lambda one: asked.append(one.url))
    for page in PAGES:
        view.goto((site / f"{page}.html").as_uri())
        if view.evaluate(
            "document.documentElement.scrollWidth > document.documentElement.clientWidth"
        ):
            wide.append(page)
        assert view.evaluate("document.documentElement.dataset.theme") == scheme
    view.close()
    # speed of a browser without a graphics card
    said = [text for text in said if "GL Driver Message" not in text]
    assert (said, wide) == ([], [])
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_text_and_formulas_are_shown_without_javascript(site, chromium):
    context = chromium.new_context(java_script_enabled=False)
    view = context.new_page()
    view.goto((site / "tutorials/first-run.html").as_uri())
    assert "Joukowsky" in view.locator("article").inner_text()
    box = view.locator("math[display=block]").first.bounding_box()
    assert box["width"] > 50 and box["height"] > 10
    context.close()


@pytest.mark.parametrize(
    ("words", "page"),
    [("Joukowsky", "What happens when a valve shuts?"), ("viscoelastic", "A plastic main"), ("psig", "Units"),
     ("integrate", "Public names"), ("estimate-error", "Options of the commands")],
)  # fmt: skip
def test_the_search_finds_words_without_a_server(words, page, site, chromium):
    view = chromium.new_page()
    view.goto(f"{(site / 'search.html').as_uri()}?q={words}")
    view.wait_for_selector("#search-results .search li, #search-results li", timeout=20_000)
    view.wait_for_timeout(500)
    assert page in view.locator("#search-results").inner_text()
    view.close()
