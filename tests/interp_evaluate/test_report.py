"""The report says what the rows say, in Markdown and in a page that loads nothing and takes names as they are."""

from __future__ import annotations

import math
import re
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.textpath import TextPath
from scored import METHODS, SEQUENCES, row, scored

from interp.evaluate.conditions import varying
from interp.evaluate.published import of_gap
from interp.evaluate.report import MARKDOWN, PAGE, About, WorstFrame, write_report
from interp.evaluate.report.blocks import Cell
from interp.evaluate.report.content import FROM_TRUTH, document
from interp.evaluate.report.coverage import fullest, uneven
from interp.evaluate.report.drawing import styles
from interp.evaluate.report.frame_plots import distribution_plot, over_time_plot
from interp.evaluate.report.markdown import escaped, markdown
from interp.evaluate.report.mean_plots import condition_plot, position_plot
from interp.evaluate.report.overview import (
    best_method,
    condition_table,
    full_scale_table,
    position_table,
    protocol_table,
    sequence_table,
)
from interp.evaluate.row import Row
from vid2ev.errors import DataError

ABOUT: About = {
    "settings": {"skip": 7, "methods": ["bridge", "flow"]},
    "not_scored": {"the events end before the last frame": 14},
    "remarks": ["31 events were beyond the sensor."],
    "versions": {"vid2ev": "0.1.0"},
    "events_from_truth": list(SEQUENCES),
}
ROWS = scored(groups=3)
NASTY = "<script>alert(1)</script>"
VOID = {"meta", "img", "br", "link", "input", "hr"}


class Checked(HTMLParser):
    """Elements open and close in order; ids are unique; what is loaded is collected, and so is the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.loads: list[str] = []
        self.links: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids += [given["id"] or ""] if "id" in given else []
        self.loads += [given[name] or "" for name in ("src", "srcset", "data", "xlink:href") if name in given]
        (self.links if tag in ("a", "use") else self.loads).extend([given["href"] or ""] if "href" in given else [])
        assert tag != "script" and not any(name.startswith("on") for name in given)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def checked(text: str) -> Checked:
    page = Checked()
    page.feed(text)
    page.close()
    assert page.open == [] and len(page.ids) == len(set(page.ids))
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert all(load.startswith("data:image/png;base64,") for load in page.loads)
    assert "http" not in text.replace("http-equiv", "") and "@import" not in text
    assert set(re.findall(r"url\((.)", text)) <= {"#"}
    return page


def written(folder: Path, rows: list[Row], about: About | None = None, **more: object) -> tuple[str, str]:
    write_report(folder, rows, about or {}, **more)  # type: ignore[arg-type]
    return tuple((folder / name).read_text(encoding="utf-8") for name in (MARKDOWN, PAGE))  # type: ignore[return-value]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    return written(tmp_path_factory.mktemp("report"), ROWS, ABOUT)


def test_a_report_of_everything(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (170, 210, 3)).astype(np.uint8)
    text, page = written(tmp_path, ROWS, ABOUT, worst=[WorstFrame(ROWS[0], picture, picture[::-1].copy())] * 3)
    seen = checked(page)
    assert len(seen.loads) == 2, "of the worst frames of a method those that come first"
    for said in (*METHODS, *SEQUENCES, FROM_TRUTH, "the events end before the last frame", "31 events", "vid2ev"):
        assert said in seen.text and said in text
    assert "PSNR of each frame over time" in page and page.count("<svg") == 3 + len(varying(ROWS))
    assert sorted(file.name for file in tmp_path.iterdir()) == [PAGE, MARKDOWN]


def test_numbers_are_those_of_the_rows(whole: tuple[str, str]) -> None:
    text, page = whole
    for method in METHODS:
        scores = np.array([one.psnr for one in ROWS if one.method == method])
        shown = f"{scores.mean():.2f} ± {scores.std():.2f}"
        assert shown in text and shown in checked(page).text
        least = min(one.patch_psnr for one in ROWS if one.method == method)
        assert f" {least:.2f} " in text.replace("*", "")
    assert re.search(r"\| rrin_events_light \| 105 \| \*\*[\d.]+ ± [\d.]+\*\*", text), "the best is marked"


def test_drawings_are_well_formed_and_take_the_colours_of_the_page(whole: tuple[str, str]) -> None:
    page = whole[1]
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    for drawing in drawings:
        ElementTree.fromstring(drawing)
        assert "var(--accent)" in drawing and "var(--ink)" in drawing and "var(--letters)" in drawing
        colours = set(re.findall(r"(?:fill|stroke): ?(#\w+)", drawing))
        assert not colours, "colours that are the same by day and by night"
    style = page[page.index("<style>") : page.index("</style>")]
    for variable in set(re.findall(r"var\((--\w+)\)", page)):
        assert f"{variable}:" in style


@pytest.mark.parametrize(
    "name", [NASTY, "a|b `c` *d* [e](f)", "$\\frac{1}{2}$", "街 & <b>", 'x" onload="y', "-->", "__init__"]
)
def test_names_mean_themselves(tmp_path: Path, name: str) -> None:
    rows = [
        row(sequence=name, method=method, position=p, psnr=30.0 + p, ssim=0.9, t_us=p, motion_px=10.0 * p)
        for method in (name, "bridge")
        for p in (1, 2, 3)
    ]
    text, page = written(tmp_path, rows, {"title": name, "settings": {name: name}, "not_scored": {name: 1}})
    seen = checked(page)
    assert seen.text.count(name) > 10
    assert "<script" not in page and "<script" not in text and "<b>" not in text
    widths = {
        len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith(f"| {escaped(name)}")
    }
    assert widths and max(widths) < 12
    for line, following in zip(text.splitlines(), text.splitlines()[1:], strict=False):
        if line.startswith("|") and following.startswith("|"):
            assert len(re.findall(r"(?<!\\)\|", line)) == len(re.findall(r"(?<!\\)\|", following))


def test_a_plot_names_each_method_that_it_has_lines_of() -> None:
    names = ["_first", "__init__", "bridge", "_"]
    rows = [
        row(method=name, position=p, psnr=30.0 + p, ssim=0.9, t_us=p, motion_px=40.0 * p)
        for name in names
        for p in (1, 2, 3)
    ]
    ((condition, edges),) = varying(rows)
    over_time, against = over_time_plot(rows), condition_plot(rows, condition, edges)
    for drawing in (over_time and over_time.svg, position_plot(rows), against and against.svg):
        assert drawing and [text for text in ElementTree.fromstring(drawing).itertext() if text in names] == names


def test_names_that_begin_alike_are_told_apart_in_plots() -> None:
    methods = [f"rrin_slomo_events_small_rate0.0001_batch32_seed{k}" for k in range(7)]
    sequences = [f"recordings_outdoors_in_the_rain_2021_take_{k}" for k in range(5)]
    rows = [
        row(sequence=sequence, method=method, position=p, psnr=30.0 + p, ssim=0.9, t_us=p)
        for sequence in sequences
        for method in methods
        for p in (1, 2, 3)
    ]
    for drawing, names in ((distribution_plot(rows), [*methods, *sequences]), (position_plot(rows), methods)):
        texts = [text for text in ElementTree.fromstring(drawing or "").itertext() if "…" in text]
        assert len(set(texts)) == len(names)
        assert all(any(map(name.endswith, (text.partition("…")[2] for text in texts))) for name in names)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_names_above_panels_do_not_run_into_each_other(count: int) -> None:
    methods = [f"rrin_slomo_events_small_rate0.0001_batch32_and_all_the_rest_of_it_{k}" for k in range(count)]
    rows = [row(sequence="outdoors_in_the_rain_2021", method=method, psnr=30.0) for method in methods]
    root = ElementTree.fromstring(distribution_plot(rows) or "")
    right = float(root.attrib["viewBox"].split()[2])
    titles = [each for each in root.iter() if (each.text or "").startswith("rrin")]
    spans: dict[str, list[tuple[float, float]]] = {}
    for each in titles:
        start, wide = float(each.attrib["x"]), float(TextPath((0, 0), each.text, size=9).get_extents().width)
        spans.setdefault(each.attrib["y"], []).append((start, start + wide))
    assert sum(map(len, spans.values())) == count
    for line in spans.values():
        assert all(end < start for (_, end), (start, _) in pairwise(sorted(line))) and max(line)[1] < right


@pytest.mark.parametrize("best", ["m5", None])
def test_each_method_is_drawn_in_its_own_way(best: str | None) -> None:
    drawn = styles([f"m{k}" for k in range(13)], best).values()
    of_lines = {(each["color"], each["linestyle"]) for each in drawn}
    of_marks = {(each["linestyle"], each["marker"]) for each in drawn if each["zorder"] == 2}
    assert len(of_lines) == 12 + (best is not None) and len(of_marks) == 13 - (best is not None)


@pytest.mark.parametrize("count", [1, 8, 9, 30])
def test_the_plot_over_time_says_which_sequences_it_leaves_out(count: int) -> None:
    rows = [row(sequence=f"s{k}.", position=p, psnr=30.0 + k * p, t_us=p) for k in range(count) for p in (1, 2)]
    plot = over_time_plot([*rows, row(sequence="of one frame", psnr=30.0)])
    assert plot
    shown = [text for text in ElementTree.fromstring(plot.svg).itertext() if text in {each.sequence for each in rows}]
    assert shown == [f"s{k}." for k in range(count)][-8:]
    assert plot.caption == (
        "PSNR of each frame."
        if len(shown) == count
        else f"PSNR of each frame, of the 8 of {count} sequences in which it changes most."
    )


def test_nothing_scored(tmp_path: Path) -> None:
    text, page = written(tmp_path, [], {"not_scored": {"no events": 3}})
    assert "No frame was scored." in text and "| no events | 3 |" in text
    assert "No frame was scored." in checked(page).text and "<svg" not in page
    assert "Nothing was left out." in written(tmp_path, [])[0]


@pytest.mark.parametrize("known", [{}, {"psnr": 30.0, "ssim": 0.9}, {"psnr": math.inf, "ssim": 1.0}])
def test_a_single_frame(tmp_path: Path, known: dict[str, float]) -> None:
    text, page = written(tmp_path, [row(**known)])
    checked(page)
    assert "1 frame of 1 sequence" in text and "nan" not in text.lower()
    assert ("–" in text) and ("∞" in text) == math.isinf(known.get("psnr", 0.0))


def test_a_column_that_is_not_known_is_not_drawn() -> None:
    rows = [row(position=p, psnr=30.0, ssim=0.9, motion_px=m, blur_px=2.0) for p, m in ((1, 1.0), (2, 2.0))]
    assert [condition.field for condition, _ in varying(rows)] == ["motion_px"]
    assert [s.title for s in document(rows, {}).sections if s.title.startswith("Against")] == [
        "Against motion between the key frames"
    ]


def test_nothing_is_said_against_a_condition_where_no_score_is_known() -> None:
    rows = [row(position=p, psnr_255=30.0, motion_px=10.0 * p, events_per_px=1.0 * p) for p in (1, 2, 3)]
    assert [condition.field for condition, _ in varying(rows)] == ["motion_px", "events_per_px"]
    assert not [section.title for section in document(rows, {}).sections if section.title.startswith("Against")]


@pytest.mark.parametrize("most_px", [50.0, 250.0])
def test_a_line_is_spoken_of_where_there_is_one(most_px: float) -> None:
    rows = [row(position=p, psnr=30.0, ssim=0.9, motion_px=most_px * p / 5) for p in (1, 2, 3, 4, 5)]
    ((condition, edges),) = varying(rows)
    plot = condition_plot(rows, condition, edges)
    assert plot and ("paper: 100" in plot.svg) == ("The line at 100 is" in plot.caption) == (most_px > 100)


@pytest.mark.parametrize(
    ("late_us", "marks"),
    [
        ([0, 200, 700, 7000, 23000], ["0", "500", "1000", "5000", "10000"]),
        ([0.3, 0.7, 20], ["0", "0.5", "1", "5", "10"]),
        ([0, *range(2, 60)], ["0", "1", "5", "10", "50", "100"]),
    ],
)
def test_an_axis_over_decades_has_round_marks_whatever_the_values(late_us: list[float], marks: list[str]) -> None:
    rows = [row(group=k, psnr=30.25, ssim=0.925, offset_us=late) for k, late in enumerate(late_us)]
    ((condition, edges),) = varying(rows)
    plot = condition_plot(rows, condition, edges)
    svg = ElementTree.fromstring(plot.svg if plot else "")
    axes = [each for each in svg.iter() if (each.get("id") or "").startswith(f"offset_us-{rows[0].multiple}-xtick_")]
    assert [text for each in axes for text in "".join(each.itertext()).split()] == marks * 2


def test_a_plot_says_how_many_frames_there_are_as_the_table_does() -> None:
    many = {10.0: 137, 20.0: 251, 30.0: 163}
    rows = [row(method="few", group=k, psnr=30.0, ssim=0.9, motion_px=motion) for motion in many for k in range(3)]
    rows += [
        row(group=k, psnr=30.0, ssim=0.9, motion_px=motion) for motion, count in many.items() for k in range(count)
    ]
    ((condition, edges),) = varying(rows)
    plot = condition_plot(rows, condition, edges)
    counts = [line.cells[0].text for line in condition_table(rows, condition, edges, "psnr", "").lines]
    assert plot and counts == [str(count) for count in many.values()]
    assert [text for text in ElementTree.fromstring(plot.svg).itertext() if text in counts] == counts * 2


@pytest.mark.parametrize("values", [(1.0001, 1.0002, 2.0), (1500.2, 1500.5, 9e3), (0.0, 1e-9, 0.5)])
def test_no_two_bins_are_called_alike(values: tuple[float, ...]) -> None:
    """However little tells their values apart; what three digits tell apart has no more."""
    rows = [row(group=k, psnr=30.0 - 4 * k, ssim=0.9, motion_px=value) for k, value in enumerate(values)]
    ((condition, edges),) = varying(rows)
    labels = [line.name for line in condition_table(rows, condition, edges, "psnr", "").lines]
    assert [float(label.replace(",", "")) for label in labels] == list(values)
    assert f"from {labels[1]}" in markdown(document(rows, {}))


def test_where_methods_break_down_is_said() -> None:
    rows = [
        row(method=method, position=p, psnr=30.0 - lost * p, ssim=0.9, motion_px=10.0 * p)
        for method, lost in (("a", 0.1), ("b", 1.0))
        for p in (1, 2, 3, 4, 5)
    ]
    assert "[px per key frame]: a nowhere, b from 50." in markdown(document(rows, {}))


def test_published_rows_are_of_the_same_gap_and_said_to_be_of_other_data() -> None:
    for multiple, first in ((8, "HS-ERGB"), (6, "HS-ERGB far"), (16, "GoPro"), (32, None)):
        said = markdown(document([row(multiple=multiple, psnr=30.0, ssim=0.9)], {}))
        quoted = of_gap(multiple - 1)
        assert (quoted[0].data if quoted else None) == first
        assert said.count("published, other data") == 2 + len(quoted)
        assert all(f"*{published.psnr}*" in said for published in quoted)
    assert "*32.207 ± 7.18*" in markdown(document([row(multiple=8, psnr=30.0)], {})), "as it is given"


def test_methods_with_other_frames_are_compared_over_those_that_all_have() -> None:
    rows = [row(method="a", position=p, psnr=20.0 + p, ssim=0.9) for p in (1, 2, 3)]
    rows += [row(method="b", position=p, psnr=30.0, ssim=0.9) for p in (1, 2)]
    said = markdown(document(rows, {}))
    assert "2 frames have those of all" in said and "| a | 21.50 ± 0.50 |" in said
    assert "have those of all" not in markdown(document(rows[:3], {}))


def test_a_method_with_few_frames_is_not_the_best() -> None:
    rows = [row(method="all", position=p, psnr=28.0 + p, ssim=0.9, psnr_255=28.0, motion_px=p) for p in range(1, 8)]
    rows += [row(method="worse", position=p, psnr=20.0, ssim=0.8, psnr_255=20.0, motion_px=p) for p in range(1, 8)]
    rows += [row(method="easy", position=1, psnr=40.0, ssim=0.99, psnr_255=40.0, motion_px=1)]
    assert best_method(rows) == "all"
    for table in (protocol_table(rows), full_scale_table(rows), sequence_table(rows, "psnr", "")):
        for line in table.lines:
            of = dict(zip(table.head[1:], line.cells, strict=True))
            assert not of.get("easy", Cell("")).best
            assert line.name not in ("easy", "worse") or not any(cell.best for cell in line.cells)
        assert any(cell.best for line in table.lines for cell in line.cells)
    assert any(cell.best for cell in position_table(rows, "psnr", "").lines[0].cells[2:]), "the only frame that it has"
    said = markdown(document(rows, {}))
    assert "all, 7 of 7 frames, has 32.00 ± 2.00 dB and SSIM 0.900 ± 0.000, worse, 7 of 7 frames, 20.00" in said
    assert "dB; over other frames, and not to be compared: easy, 1 of 7 frames, 40.00 dB." in said
    warning = "Not all methods have scores of all frames: easy has 1 of 7 frames; 1 frame has those of all; only"
    assert said.index(warning) < said.index("Time Lens protocol")
    assert uneven(rows).startswith(warning) and not uneven(rows[:14])


def test_as_many_frames_but_others_are_not_compared() -> None:
    rows = [row(method=name, position=p, psnr=25.0, ssim=0.9) for name in ("a", "b") for p in (1, 2)]
    rows += [row(method="others", position=p, psnr=40.0, ssim=0.9) for p in (2, 3)]
    assert fullest(rows) == ["a", "b"] and best_method(rows) in ("a", "b")
    assert "over other frames, and not to be compared: others, 2 of 3 frames, 40.00" in markdown(document(rows, {}))
    assert uneven(rows).startswith("Not all methods have scores of all frames: others has 2 of 3 frames; 1 frame has")
    assert fullest([]) == []


def test_gaps_of_several_lengths_have_chapters_of_their_own(tmp_path: Path) -> None:
    places = [(multiple, p) for multiple in (8, 4, 2) for p in (1, 2) if p < multiple]
    rows = [row(multiple=multiple, position=p, psnr=30.0 + p, ssim=0.9) for multiple, p in places]
    text, page = written(tmp_path, rows)
    checked(page)
    assert all(f"## All methods, {said} skipped" in text for said in ("1 frame", "3 frames", "7 frames"))


def test_what_is_not_known_of_gaps_of_two_lengths_is_counted_in_both() -> None:
    rows = [row(multiple=multiple, method=name, position=p) for multiple in (8, 4) for name in "ab" for p in (1, 2)]
    said = markdown(document(rows, {}))
    assert "| rebuilt, but without a PSNR | 8 |" in said
    assert "the motion between the key frames is not known of 4 of 4 frames" in said


def test_the_same_rows_make_the_same_bytes(tmp_path: Path, whole: tuple[str, str]) -> None:
    assert written(tmp_path, ROWS, ABOUT) == whole


def test_a_folder_that_cannot_be_written_is_said_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_report(tmp_path / "file", [row()], {})
