"""Settings of the site: `sphinx-build -W -n --keep-going docs build/site`, with the extra `docs`.

The site needs no network: formulas become MathML in the pages; fonts, styles and search are files of the site.
Three rules make a site of the pages of the repository, so that no text is stored twice:

- `<!-- page: PATH -->` on a page stands for a Markdown file outside docs, such as benchmarks/README.md.
- `<!-- generated: NAME -->` stands for the text of `generated_pages.GENERATED[NAME]`; words behind NAME are arguments.
- The pages that the tables of an `index.md` link, in this order, are the contents of its section.
"""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

import latex2mathml.converter
from docutils import nodes
from sphinx.addnodes import download_reference

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))  # for generated_pages
from generated_pages import filled  # noqa: E402

# tutorials run `fvsolve`
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["IPYTHONDIR"] = tempfile.mkdtemp(prefix="fvsolve-site-")
PROFILE = Path(os.environ["IPYTHONDIR"], "profile_default", "startup")
PROFILE.mkdir(parents=True)
shutil.copy(DOCS / "kernel_start.py", PROFILE)

project = author = "fvsolve"
project_copyright = "fvsolve maintainers"
extensions = ["myst_nb", "sphinx_copybutton"]
exclude_patterns = ["**/.*", "validation/results", "views"]
smartquotes = False
highlight_language = "none"  # of blocks without a language: formulas and output
myst_enable_extensions = ["attrs_inline", "colon_fence", "dollarmath"]
myst_heading_anchors = 6  # links such as results.md#fields
nb_execution_mode = "cache"
nb_execution_timeout = 60  # seconds for a cell
nb_execution_raise_on_error = True
nb_execution_in_temp = nb_execution_show_tb = True
nb_merge_streams = True
nitpick_ignore_regex = [("py:.*", ".*")]  # default values in signatures

html_theme = "pydata_sphinx_theme"
html_title = "fvsolve"
html_math_renderer = "mathml"
html_static_path = ["site.css", "views"]
(DOCS / "views").mkdir(exist_ok=True)  # filled by `generated_pages.views`
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False
html_sidebars = {"index": []}
html_context = {"default_mode": "auto"}  # light or dark as the system
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "default",
    "pygments_dark_style": "github-dark",
}

NOTEBOOK = "---\nfile_format: mystnb\n"  # head of a page with cells
LANGUAGES = {".toml": "toml", ".py": "python"}
NAMED = re.compile(r"\[([\w-]+)\.md\]\(")  # a link whose text is the name of its file
LINK = re.compile(r"(?<=\]\()([^)\s:#]+)(#[^)\s]*)?(?=\))")
ELSEWHERE = re.compile(r"<!-- page: (\S+) -->\n.*", re.DOTALL)


def pages_outside() -> dict[Path, str]:
    """Markdown files outside docs that are pages of the site : file -> name of the page."""
    found = {}
    for path in DOCS.rglob("*.md"):
        if mark := ELSEWHERE.search(path.read_text(encoding="utf-8")):
            found[(path.parent / mark[1]).resolve()] = (
                path.relative_to(DOCS).with_suffix("").as_posix()
            )
    return found


OUTSIDE = pages_outside()


def read_page(app, page: str, source: list[str]) -> None:
    """Replace the marks of a page, point its links to pages of the site or to files, and add its contents."""
    file, text = DOCS / f"{page}.md", source[0]
    if mark := ELSEWHERE.search(text):
        file = (file.parent / mark[1]).resolve()
        text = ELSEWHERE.sub("", text) + file.read_text(encoding="utf-8")
        app.env.note_dependency(str(file))
    text = filled(text)
    text = LINK.sub(lambda link: target(link[1], file.parent, page) + (link[2] or ""), text)
    text = NAMED.sub(r"[\1](", text)
    if file.name == "index.md":
        rows = "\n".join(line for line in text.splitlines() if line.startswith("|"))
        linked = dict.fromkeys(
            name for name, heading in LINK.findall(rows) if name.endswith(".md") and not heading
        )
        text += "\n```{toctree}\n:hidden:\n\n" + "\n".join(linked) + "\n```\n"
    source[0] = text


def target(link: str, folder: Path, page: str) -> str:
    """Path from a page of the site to the page or file that a link in a file of `folder` names."""
    path = (folder / link).resolve()
    if path in OUTSIDE:
        path = DOCS / f"{OUTSIDE[path]}.md"
    return (
        os.path.relpath(path, (DOCS / page).parent).replace(os.sep, "/") if path.exists() else link
    )


def plain_cells(app, document) -> None:
    """Show cells of tutorials of lines with `!` as shell commands, and cells `%%writefile [-a] NAME` as files."""
    for block in document.findall(nodes.literal_block):
        first, *rest = lines = block.astext().splitlines() or [""]
        if all(line.startswith("!") for line in lines):
            lines, language = [line[1:] for line in lines], "sh"
        elif first.startswith("%%writefile"):
            place = "at the end of " if " -a " in first else ""
            name = first.split()[-1]
            lines, language = [f"# {place}{name}", *rest], LANGUAGES.get(Path(name).suffix, "none")
        else:
            continue
        block.rawsource = "\n".join(lines)
        block.children, block["language"] = [nodes.Text(block.rawsource)], language


def notebook_link(app, document) -> None:
    """Add a link to the notebook, with the output of its cells, below the introduction of a tutorial.

    A link that opens the notebook in a service such as Binder needs a public address of the repository, which does
    not exist.
    """
    page = app.env.docname
    if not (DOCS / f"{page}.md").read_text(encoding="utf-8").startswith(NOTEBOOK):
        return
    path = Path(app.outdir).parent / "jupyter_execute" / f"{page}.ipynb"
    link = download_reference(
        "", "", reftarget="/" + os.path.relpath(path, DOCS).replace(os.sep, "/")
    )
    link += nodes.literal("", path.name)
    line = nodes.paragraph("", "Download this page as a notebook with its output: ", link)
    line += nodes.Text(". It runs in Jupyter with an installed fvsolve.")
    section = next(document.findall(nodes.section))
    first = (k for k, child in enumerate(section) if isinstance(child, nodes.section))
    place = next(first, len(section))
    section.insert(place, line)


def formula(display: str, before: str = "", after: str = ""):
    """Visitor of formula nodes, which writes them as MathML."""

    def visit(writer, node) -> None:
        writer.body.append(
            before + latex2mathml.converter.convert(node.astext(), display=display) + after
        )
        raise nodes.SkipNode

    return visit


def setup(app) -> None:
    app.connect("source-read", read_page)
    app.connect("doctree-read", plain_cells)
    # before Sphinx copies the files of links
    app.connect("doctree-read", notebook_link, priority=100)
    app.connect(
        "build-finished", lambda *_: shutil.rmtree(os.environ["IPYTHONDIR"], ignore_errors=True)
    )
    block = formula("block", '<div class="formula">', "</div>\n")
    app.add_html_math_renderer("mathml", (formula("inline"), None), (block, None))
