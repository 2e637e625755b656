"""A report as one file: complete, harmless, reproducible, good to read and to print."""

from __future__ import annotations

import numpy as np
import pytest

import warp_springs as ws
from tests.chromium import Browser

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
    "53de0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)
EVIL = '<script>document.title = "evil"</script>'


def plot(lift=0.0):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4, 3))
    ax = figure.subplots()
    ax.plot(np.arange(5), np.arange(5) ** 2 + lift, "o-", label="squares")
    ax.legend()
    return figure


def document():
    report = ws.Document(f"A report {EVIL}", subtitle=EVIL)
    report.verdict("It walks", good=True)
    report.tiles([("speed", "0.98")])
    report.section("Numbers & words")
    report.text(EVIL)
    report.table([("stiffness", 1234.5, EVIL), ("count", 2000, "b")], ("name", "value", "words"))
    report.code("evolve run walker > log")
    report.section("Pictures")
    report.row(report.plot(plot(), EVIL), report.plot(plot(3.0)), report.image(PNG, "a dot"))
    report.row(report.page("<body style='margin:0;background:red'>inner</body>", "a page",
                           printed="Open the file to see it move."))  # fmt: skip
    report.links([("zoo.usdc", "the zoo")])
    return report


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = document().write(tmp_path_factory.mktemp("report") / "report.html")
    with Browser() as browser:
        page = browser.open(path.as_uri(), size=(1000, 1400))
        yield page


def test_it_opens_from_the_disk_without_a_complaint(page):
    page.picture()
    assert page.complaints == []
    assert page.requests == [page.evaluate("location.href")]
    assert page.evaluate("document.title").startswith("A report <script>"), "no script ran"
    assert page.evaluate("document.querySelectorAll('figure svg').length") == 2
    assert page.evaluate("document.querySelector('img').naturalWidth") == 1


def test_it_lists_its_sections(page):
    words = page.evaluate("[...document.querySelectorAll('nav a')].map(a => a.textContent)")
    assert words == ["Numbers & words", "Pictures"]
    target = page.evaluate("document.querySelector('nav a').getAttribute('href').slice(1)")
    assert page.evaluate(f"document.getElementById('{target}').textContent") == words[0]


def test_numbers_stand_to_the_right(page):
    align = "getComputedStyle(document.querySelectorAll('tbody tr td')[{}]).textAlign"
    assert page.evaluate(align.format(1)) == "right"
    assert page.evaluate("document.querySelectorAll('tbody tr td')[4].textContent") == "2,000"


def test_columns_of_numbers_in_words_stand_to_the_right_too():
    report = ws.Document("table")
    header = ("robot", "speed", "kept", "error", "size")
    rows = [("#12", "0.470", "97%", "one seed", "3 m"), ("#7", 0.5, "stopped", "1e-3", "4 m")]
    report.table(rows, header)
    text = report.html()
    right = [f'<{tag} class="number">{words}</{tag}>' in text
             for tag, words in [("th", name) for name in header] + [("td", "stopped")]]  # fmt: skip
    assert right == [False, True, True, True, False, True]


def test_a_page_in_it_is_shown_and_is_kept_off_the_paper(page):
    box = page.evaluate(
        "(() => { const f = document.querySelector('iframe');"
        "f.scrollIntoView({behavior: 'instant'});"
        "const r = f.getBoundingClientRect(); return [r.left, r.top]; })()"
    )
    x, y = (int(v) + 40 for v in box)
    for _ in range(100):
        if tuple(page.picture()[y, x]) == (255, 0, 0):
            break
    else:
        pytest.fail("the inner page is not drawn")
    page.call("Emulation.setEmulatedMedia", media="print")
    shown = "getComputedStyle(document.querySelector('{}')).display"
    assert page.evaluate(shown.format("iframe")) == "none"
    assert page.evaluate(shown.format(".printed")) == "block"
    page.call("Emulation.setEmulatedMedia", media="")
    assert page.pdf().startswith(b"%PDF")


def test_parts_of_different_plots_have_different_names(page):
    ids = page.evaluate("[...document.querySelectorAll('svg [id]')].map(e => e.id)")
    assert len(ids) == len(set(ids))


def test_the_same_content_gives_the_same_bytes():
    assert document().html() == document().html()


def test_a_figure_stands_where_it_was_made_or_in_its_row():
    report = ws.Document("figures")
    first = report.image(PNG, "first")
    report.text("between")
    second = report.image(PNG, "second")
    third = report.image(PNG, "third")
    report.row(third, first)
    text = report.html()
    order = ["between", "second</figcaption>", '<div class="row">', "third<", "first<"]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    assert text.count("<figure>") == 3
    for bad in (first, "<p>", ws.Document("another").image(PNG)):  # it is in a row already
        with pytest.raises(ValueError, match="of this document returned, each once"):
            report.row(second, bad)
    assert report.html().count("<figure>") == 3


def test_a_bad_path_is_refused(tmp_path):
    with pytest.raises(ValueError, match="html"):
        document().write(tmp_path / "report.pdf")
    with pytest.raises(NotADirectoryError):
        document().write(tmp_path / "nowhere" / "report.html")
