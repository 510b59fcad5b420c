"""Table `[report]` of a case: title block, texts, decimal comma, and faults; it changes no number of a run."""

import json
import re

import pytest
from reference.scenes import junction, lake, pipe, ramp, scene, valve

import fvsolve
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios

PICTURE = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><rect width="9" height="9"/></svg>'
WORDS = {
    "client": "Water & Sons <b>",
    "project": "Main to the hill",
    "number": "2026-7",
    "revision": "B",
    "author": "A. Author",
}


def closure(**report) -> dict:
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 10),
        "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0)),
    }
    case = scene(nodes, links, 1.0, {}, ["gate.head", "valve.flow"], title="Closure")
    return case | ({"report": report} if report else {})


def written(folder, **report) -> str:
    fvsolve.run(closure(**report), out=folder, pictures=False)
    return write_report(folder)[0].read_text(encoding="utf-8")


def body(page: str) -> str:
    return page.partition("<body>")[2].partition('<script type="application/json"')[0]


def test_the_title_block_has_the_words_of_the_table(tmp_path):
    page = body(written(tmp_path / "run", **WORDS))
    found = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page)
    escaped = {**WORDS, "client": "Water &amp; Sons &lt;b&gt;"}
    assert found == list(escaped.items())
    assert '<div class="block">' not in body(written(tmp_path / "plain"))


@pytest.mark.parametrize("date", ["date = 2026-03-01", 'date = "2026-03-01"'])
def test_a_date_of_toml_and_a_text_give_the_same_date(date, tmp_path):
    path = tmp_path / "dated.toml"
    text = fvsolve.load(closure(client="x")).resolved()
    path.write_text(text.replace('client = "x"', date))
    assert fvsolve.load(path).declared["report"].date == "2026-03-01"


def test_texts_are_markdown_without_html_scripts_or_addresses_of_scripts(tmp_path):
    before = (
        "# Scope\n\nA **bold** word <script>alert(1)</script>\n\n| a | b |\n|---|---|\n| 1 | 2 |\n"
    )
    after = "[here](javascript:alert(1)) and [there](https://example.org)"
    page = body(written(tmp_path / "run", before=before, after=after))
    assert "<h1>Scope</h1>" in page and "<strong>bold</strong>" in page and "<td>2</td>" in page
    assert "&lt;script&gt;" in page and 'href="javascript' not in page
    assert '<a href="https://example.org">there</a>' in page
    assert page.index("Scope") < page.index('id="verdict"') < page.index("example.org")


def test_a_text_and_a_logo_come_from_files_that_are_copied_to_the_run(tmp_path):
    (tmp_path / "scope.md").write_text("Text *of* a file", encoding="utf-8")
    (tmp_path / "logo.svg").write_text(PICTURE)
    text = fvsolve.load(closure(client="x")).resolved()
    keys = 'logo = "logo.svg"\nbefore = { file = "scope.md" }'
    (tmp_path / "a.toml").write_text(text.replace('client = "x"', keys))
    fvsolve.run(tmp_path / "a.toml", out=tmp_path / "run", pictures=False)
    (tmp_path / "logo.svg").unlink()
    page = body(write_report(tmp_path / "run")[0].read_text(encoding="utf-8"))
    assert "Text <em>of</em> a file" in page and 'src="data:image/svg+xml;base64,' in page
    fvsolve.run(tmp_path / "run/case.toml", out=tmp_path / "again", pictures=False)


def test_a_decimal_comma_changes_the_sign_alone(tmp_path):
    point, comma = (
        written(tmp_path / sign, decimal=sign, client="A.B. Client") for sign in ("point", "comma")
    )
    cells = [re.findall(r'<td class="n">(.*?)</td>', body(page)) for page in (point, comma)]
    assert any("." in cell for cell in cells[0])
    assert [cell.replace(".", ",") for cell in cells[0]] == cells[1]
    assert "A.B. Client" in body(comma)
    layouts = [
        figure["layout"]["separators"]
        for page in (point, comma)
        for figure in json.loads(re.search(r'id="figures">(.*?)</script>', page, re.S)[1]).values()
    ]
    assert {layout[0] for layout in layouts} == {".", ","}


def test_a_study_has_the_words_of_its_case(tmp_path):
    case = fvsolve.load(closure(**WORDS)).resolved()
    (tmp_path / "closure.toml").write_text(case)
    ramp = "links.valve.opening = { start = 0.5, duration = 0.4, value = [1, 0] }"
    study = f'case = "closure.toml"\n[events.slow]\n{ramp}\n'
    (tmp_path / "study.toml").write_text(study)

    scenarios.study(tmp_path / "study.toml", tmp_path / "runs")
    page = body(write_report(tmp_path / "runs")[0].read_text(encoding="utf-8"))
    assert "<dt>client</dt><dd>Water &amp; Sons &lt;b&gt;</dd>" in page


def test_the_table_changes_neither_the_hash_nor_a_number_of_a_run(tmp_path):
    runs = [
        fvsolve.run(case, out=tmp_path / str(k), pictures=False)
        for k, case in enumerate((closure(), closure(**WORDS, decimal="comma")))
    ]
    assert len({run.summary["versions"]["case"] for run in runs}) == 1
    assert (tmp_path / "0/history.csv").read_bytes() == (tmp_path / "1/history.csv").read_bytes()
    further = closure(client="Another client")
    further["numerics"]["end"] = 1.2
    resumed = fvsolve.run(further, out=tmp_path / "1", pictures=False, resume=True)
    assert resumed.case.declared["report"].client == "Another client"


def test_all_faults_of_the_table_are_named(tmp_path):
    faulty = closure(
        clint="x",
        decimal="dot",
        logo="missing.png",
        depth_classes=["2 m", "1 m"],
        least_depth="-1 cm",
        before={"text": "x"},
    )
    with pytest.raises(fvsolve.CaseError) as caught:
        fvsolve.load(faulty)
    text = str(caught.value)
    for words in (
        'report.clint: unknown key; did you mean "client"?',
        "report.decimal: ",
        'report.logo: "missing.png": there is no such file',
        'report.depth_classes: values out of order: "1 m" comes after "2 m"',
        "report.least_depth: ",
        "report.before: ",
        "6 faults",
    ):
        assert words in text


def test_an_unknown_table_suggests_the_nearest_name():
    with pytest.raises(fvsolve.CaseError, match='rapport: unknown key; did you mean "report"?'):
        fvsolve.load(closure() | {"rapport": {}})
