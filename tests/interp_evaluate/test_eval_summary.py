"""What rows come to, and what is shown of them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from footage_made import SIZE, pictures, write_film, write_hsergb
from rows_read import TYPES, read_rows
from scored import METHODS as METHODS_SCORED
from scored import scored
from skimage.metrics import structural_similarity

from interp.commands.evaluate import evaluate as command
from interp.evaluate.group import Cameras, Group
from interp.evaluate.report.content import FROM_TRUTH
from interp.evaluate.row import Row
from interp.evaluate.rows import write_rows
from interp.evaluate.scoring import conditions_of, contrast_of, rows_of, scores_of
from interp.evaluate.simulated import Simulated
from interp.evaluate.summary import summarised
from interp.evaluate.tables import binned, edges_of, values
from interp.evaluate.worst import COUNT, worst_of
from interp.methods import METHODS
from interp.representation.event_counts import EventCounts
from vid2ev import Frame
from vid2ev.commands import Commands
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.recording.exposures import read_codes


def row(sequence: str, group: int, position: int, **known: Any) -> Row:
    numbers = {name: math.nan for name, kind in TYPES.items() if kind is float} | known
    return Row(sequence, "m", group, position, 8, 0, **{"patch_x": 0, "patch_y": 0} | numbers)


def test_means_are_of_all_frames_and_of_sequences() -> None:
    rows = [row("a", 0, k, psnr=value) for k, value in enumerate((20.0, 30.0, 40.0), 1)]
    rows += [row("b", 0, 1, psnr=10.0), row("b", 0, 2)]
    found = summarised(rows, ["m"], {"one": ["a"], "two": ["b"]})["m"]
    assert found["pooled"]["psnr"] == {
        "mean": 25.0, "std": pytest.approx(np.std([20, 30, 40, 10])), "count": 4, "min": 10.0,
    }  # fmt: skip
    assert found["global"]["psnr"]["mean"] == 20.0 and found["global"]["psnr"]["std"] == 10.0  # of 30 and 10
    assert found["by_set"]["one"]["pooled"]["psnr"]["mean"] == 30.0
    assert found["by_position"]["1"]["psnr"]["mean"] == 15.0 and found["by_position"]["2"]["psnr"]["count"] == 1
    assert found["by_sequence"]["a"]["psnr"]["mean"] == 30.0
    assert found["worst"]["psnr"] == {"sequence": "b", "group": 0, "position": 1, "psnr": 10.0}
    assert found["pooled"]["ssim"]["mean"] is None and found["worst"]["ssim"] is None
    json.dumps(found, allow_nan=False)


def test_bins_are_the_same_for_all_methods_and_those_of_the_tables() -> None:
    rows = scored(groups=3)
    found = summarised(rows, list(METHODS_SCORED), {})
    edges = edges_of(values(rows, "motion_px"))
    for method in METHODS_SCORED:
        bins = binned([each for each in rows if each.method == method], "motion_px", "ssim", edges)
        said = found[method]["by_condition"]["motion_px"]["ssim"]
        assert [(each["from"], each["mean"], each["count"]) for each in said] == [
            (each.low, each.score.mean, each.score.count) for each in bins
        ]


def test_worst_frames_are_of_different_groups() -> None:
    rows = [row("a", k // 3, 1 + k % 3, patch_psnr=float(k)) for k in range(60)]
    assert [(each.group, each.position) for each in worst_of(rows)] == [(k, 1) for k in range(COUNT)]


def test_rows_come_back_from_the_disk(tmp_path: Path) -> None:
    rows = [row("a, b", 0, 1, psnr=1 / 3, ssim=1e-300), row("a", 0, 2)]
    write_rows(tmp_path / "rows.csv", rows)
    assert repr(read_rows(tmp_path / "rows.csv")) == repr(rows)


def moved(px: int) -> Group:
    draw = np.random.default_rng(0)
    texture = np.kron(draw.random((20, 40)), np.ones((6, 6))).astype(np.float32)
    light = [np.repeat(texture[:96, 20 - k : 148 - k, None], 3, axis=2) for k in (0, px // 2, px)]
    frames = [srgb_codes(Frame(each, 0).light) for each in light]
    counts = EventCounts.none(1, (96, 128), 4)
    counts.off_on[0, 0, 0, :, :64] = 3
    return Group(
        0, 0, np.stack([frames[0], frames[2]]), (1,), np.stack([frames[1]]), np.array([0, 5_000, 10_000]), counts,
        Cameras(2_500.0, 4.0, -7.0),
    )  # fmt: skip


def test_conditions_are_what_they_are_called() -> None:
    found = conditions_of(moved(8))
    assert found["motion_px"] == pytest.approx(8, abs=0.5)
    assert found["motion_px_per_s"] == pytest.approx(100 * found["motion_px"])
    assert found["blur_px"] == pytest.approx(found["motion_px"] / 4)
    assert (found["events_per_px"], found["disparity_px"], found["offset_us"]) == (1.5, 4.0, -7.0)


@pytest.mark.parametrize("changed", [lambda key: np.roll(key, 64, axis=1), lambda key: key // 2])
def test_motion_that_is_not_found_is_not_taken_for_none(changed: Callable[[np.ndarray], np.ndarray]) -> None:
    """Half the picture across, and half the light."""
    group = moved(0)
    assert conditions_of(group)["motion_px"] == 0
    group.keys[1] = changed(group.keys[0])
    found = conditions_of(group)
    assert all(math.isnan(found[name]) for name in ("motion_px", "motion_px_per_s", "blur_px"))


def test_motion_of_most_of_a_picture_is_found() -> None:
    """Three of eight pixels show another thing."""
    group = moved(8)
    group.keys[1, :, :48] = np.roll(group.keys[1], 37, axis=0)[:, ::-1][:, :48]
    assert conditions_of(group)["motion_px"] == pytest.approx(8, abs=0.5)


def test_motion_is_that_of_light_by_the_curve_of_the_codes() -> None:
    """Codes of which light changes visibly by one curve, and by another does not."""
    group = moved(8)
    faint = replace(group, keys=(200 + group.keys // 51).astype(np.uint8))
    assert conditions_of(replace(faint, curve="gamma:10"))["motion_px"] == pytest.approx(8, abs=0.5)
    assert not conditions_of(faint)["motion_px"] > 0


def test_light_is_that_of_red_green_and_blue_in_this_order() -> None:
    """Of red and green the contrast is that of their shares; a texture that moves in blue alone is hardly seen."""
    true = np.zeros((4, 6, 3), np.uint8)
    true[:, :3, 0] = true[:, 3:, 1] = 255
    assert contrast_of(true) == pytest.approx(math.log((0.7152 + 1e-3) / (0.2126 + 1e-3)) / 2, rel=1e-3)
    group = moved(8)
    group.keys[..., 2] = 0.8 * group.keys[..., 2]
    group.keys[..., :2] = 255
    assert conditions_of(group)["motion_px"] == 0


def test_events_are_counted_for_each_pixel_of_their_own_camera() -> None:
    group = moved(8)
    counts = EventCounts.none(1, (24, 32), 4)
    counts.off_on[0, 0, 0], counts.off_on[0, 1, 3] = 1, 4
    assert conditions_of(replace(group, events=counts))["events_per_px"] == 5


def test_contrast_is_that_of_the_log_of_light_by_its_curve() -> None:
    """Of a picture that is half of one code and half of another: half of what their logs are apart."""
    true = np.full((4, 6, 3), 40, np.uint8)
    true[:, :3] = 200
    linear = {"srgb": lambda signal: ((signal + 0.055) / 1.055) ** 2.4, "gamma:2.2": lambda signal: signal**2.2}
    for curve, light in linear.items():
        expected = math.log((light(200 / 255) + 1e-3) / (light(40 / 255) + 1e-3)) / 2
        assert contrast_of(true, curve) == pytest.approx(expected, rel=1e-5)
        group = replace(moved(0), truth=true[None], keys=np.stack([true, true]), curve=curve)
        none, one = (rows_of("seq", "m", group, [made], conditions_of(moved(0))) for made in (None, true))
        assert none == [] and one[0].contrast == contrast_of(true, curve)
        assert (one[0].position, one[0].t_us, one[0].multiple) == (1, 5_000, 2)


def test_the_worst_window_and_the_whole_are_those_of_scikit_image() -> None:
    """Windows of 99 x 99 pixels, of the squared error and of SSIM by a range of 255."""
    draws = np.random.default_rng(4)
    true = cv2.GaussianBlur(draws.integers(0, 256, (120, 150, 3)).astype(np.uint8), (0, 0), 1.5)
    made = np.clip(true + draws.normal(0, 3, true.shape), 0, 255).round().astype(np.uint8)
    made[70:, 100:] = np.clip(made[70:, 100:] + draws.normal(0, 30, (50, 50, 3)), 0, 255).astype(np.uint8)
    found = scores_of(made, true, np.stack([true, true]))
    options = {"data_range": 255, "channel_axis": -1, "gaussian_weights": True, "use_sample_covariance": False}
    mean, plane = structural_similarity(true, made, full=True, **options)
    squares = ((true.astype(float) - made) ** 2).mean(2)
    errors, alike = (
        np.lib.stride_tricks.sliding_window_view(each, (99, 99)).mean((2, 3))
        for each in (squares, plane.mean(2)[5:-5, 5:-5])
    )
    assert found["ssim_255"] == pytest.approx(mean, abs=1e-9)
    assert found["patch_ssim"] == pytest.approx(alike.min(), abs=1e-9) and alike.min() < mean - 0.01
    assert found["patch_psnr"] == pytest.approx(10 * math.log10(255**2 / errors.max()), abs=1e-9)
    assert (found["patch_y"], found["patch_x"]) == np.unravel_index(errors.argmax(), errors.shape) == (21, 51)


def test_moving_pixels_and_the_worst_window_are_scored_apart() -> None:
    group = moved(8)
    made = group.truth[0].astype(int)
    made[60:, 100:] += 20
    (found,) = rows_of("seq", "m", group, [np.clip(made, 0, 255).astype(np.uint8)], conditions_of(group))
    assert 0 < found.moving < 1 and (found.patch_x, found.patch_y) != (0, 0) and found.patch_psnr < found.psnr_255
    assert found.contrast > 0.1
    still = Group(
        0, 0, np.stack([group.truth[0]] * 2), (1,), group.truth, group.times_us, group.events, Cameras()
    )  # fmt: skip
    (found,) = rows_of("seq", "m", still, [group.truth[0]], conditions_of(still))
    assert found.moving == 0 and math.isnan(found.psnr_moving) and math.isnan(found.blur_px)


def test_pixels_move_by_more_than_ten_codes_and_are_scored_for_themselves() -> None:
    true = np.full((2, 2, 3), 100, np.uint8)
    keys, made = np.stack([true, true]), true.copy()
    keys[0, 0, 0, 1] = 90  # by exactly ten in one channel: static
    keys[1, 0, 1, 2], keys[0, 1, 0, 0] = 89, 111  # by eleven from either frame, either way: moving
    made[0, 0], made[1, 1] = 102, 104  # squares of errors 4 and 16
    made[0, 1, 1], made[1, 0] = 120, 90  # 400 / 3 and 100
    found = scores_of(made, true, keys)
    assert found["moving"] == 0.5
    assert found["psnr_static"] == pytest.approx(10 * math.log10(255**2 / 10))
    assert found["psnr_moving"] == pytest.approx(10 * math.log10(255**2 / (700 / 6)))
    assert found["psnr_255"] == pytest.approx(10 * math.log10(255**2 / (760 / 12)))


def run(*arguments: object) -> Result:
    group = Commands("vid2ev")
    group.get_command = lambda *_: command  # type: ignore[method-assign]
    group.list_commands = lambda *_: ["eval"]  # type: ignore[method-assign]
    return CliRunner().invoke(group, ["eval", *map(str, arguments)])


def test_the_command_prints_a_table_and_writes_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_hsergb(tmp_path / "set" / "seq", pictures(18))
    shown = run("set", "--baseline", "linear", "--baseline", "bridge")
    assert shown.exit_code == 0, shown.output
    assert "set_eval/report.html: 28 rows of 1 sequence\n" in shown.stdout
    assert "note: seq: not rebuilt: 1 frame after the last complete group of 8" in shown.stderr
    quiet = run("set", "--baseline", "linear", "--baseline", "bridge", "--resume", "-q")
    assert quiet.exit_code == 0 and quiet.output == quiet.stderr == ""
    text, page = ((tmp_path / "set_eval" / name).read_text() for name in ("report.md", "report.html"))
    assert "not rebuilt: 1 frame after the last complete group of 8" in text and "seed" not in text
    assert page.count("data:image/png") == 2 * 2  # of the worst frames of both, of two gaps
    summary = json.loads((tmp_path / "set_eval" / "summary.json").read_text())
    scores = summary["methods"]["linear"]["pooled"]
    mean, least = scores["psnr"], [scores[name]["min"] for name in ("patch_psnr", "patch_ssim")]
    for said in (shown.stdout, text):
        plain = re.sub(r"[* ]+", " ", said)
        assert f"| linear | 14 | {mean['mean']:.2f} ± {mean['std']:.2f} |" in plain
        assert f"| {least[0]:.2f} | {least[1]:.3f} |" in plain
    for of in summary["methods"]["linear"]["worst_pictures"]:
        assert {
            name: read_codes(tmp_path / "set_eval" / path).shape for name, path in of["files"].items()
        } == dict.fromkeys(("made", "truth", "before", "after"), (*SIZE[::-1], 3))
    again = run("set", "--baseline", "linear", "--resume", "--json")
    assert json.loads(again.stdout)["methods"].keys() == {"linear"}
    refused = run("set", "--skip", "3", "--baseline", "linear", "--resume")
    assert refused.exit_code == 2 and "begun with protocol.skip = 7, not 3" in refused.output


@pytest.mark.parametrize(
    ("dataset", "made"),
    [(".", "sets.v2_eval"), ("seq", "seq_eval"), ("../sets.v2", "sets.v2_eval"), ("../film.npz", "film_eval")],
)
def test_a_report_is_called_after_the_data_set_wherever_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dataset: str, made: str
) -> None:
    write_hsergb(tmp_path / "sets.v2" / "seq", pictures(5))
    write_film(tmp_path / "film.npz", pictures(5))
    monkeypatch.chdir(tmp_path / "sets.v2")
    assert run(dataset, "--skip", 3, "--baseline", "linear", "-q").exit_code == 0
    assert (tmp_path / "sets.v2" / made / "report.html").exists()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--start", "5"], "leave --start out"),
        (["--size", "20", "--seed", "1"], "leave --size out"),
        (["--transfer", "pq"], "leave --transfer out"),
        (["--sensor", "noisy"], "leave --sensor, --set and --seed out"),
        (["--set", "threshold_on=0.4"], "leave --sensor, --set and --seed out"),
    ],
)
def test_what_is_said_of_films_is_refused_where_there_are_recordings_alone(
    tmp_path: Path, asked: list[str], said: str
) -> None:
    write_hsergb(tmp_path / "set" / "seq", pictures(10))
    options = ["--skip", 3, "--baseline", "linear", "-o", tmp_path / "out"]
    refused = run(tmp_path / "set", *options, *asked)
    assert refused.exit_code == 2 and not (tmp_path / "out").exists()
    assert f"seq is a recording, whose frames and events stay as they are; {said}" in refused.output
    write_film(tmp_path / "film.npz", pictures(5))
    assert run(tmp_path / "set", tmp_path / "film.npz", *options, "--seed", "1", "-q").exit_code == 0


def test_the_curve_that_is_taken_anyway_may_be_asked_for_of_recordings_too(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "set" / "seq", pictures(5))
    options = ["--skip", 3, "--baseline", "linear", "-o", tmp_path / "out", "-q"]
    assert run(tmp_path / "set", *options, "--transfer", "auto").exit_code == 0


def test_the_report_says_how_films_were_read(tmp_path: Path) -> None:
    """That decides the scores, and whether it can be gone on with."""
    write_film(tmp_path / "film.npz", pictures(9))
    options = ["--skip", 3, "--baseline", "linear", "-o", tmp_path / "out"]
    assert run(tmp_path / "film.npz", *options, "--slowdown", 8, "--size", "16x12", "-q").exit_code == 0
    assert "| how films are read | slowdown 8, size 16x12 |" in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [([], "of the frames"), (["--times", "even"], "even"), (["--insert", 1], "even"), (["--insert", 7], "even")],
)
def test_the_report_says_at_which_times_frames_were_rebuilt(tmp_path: Path, options: list[Any], said: str) -> None:
    write_hsergb(tmp_path / "seq", pictures(5))
    options = [*options, "--skip", 3, "--baseline", "nearest", "-o", tmp_path / "out", "-q"]
    assert run(tmp_path / "seq", *options).exit_code == 0
    assert f"| times of these | {said} |" in (tmp_path / "out" / "report.md").read_text()


def test_the_command_takes_a_film_and_a_sensor(tmp_path: Path) -> None:
    write_film(tmp_path / "film.npz", pictures(9))
    done = run(tmp_path / "film.npz", "-o", tmp_path / "out", "--sensor", "clean", "--set", "threshold_on=0.4",
               "--set", "shading=[1, -0.25]", "-q")  # fmt: skip
    assert done.exit_code == 0 and done.stdout == ""
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["sensor"]["parameters"]["threshold_on"] == 0.4
    assert list(summary["methods"]) == list(METHODS)
    assert f"[default: {', '.join(METHODS)}]" in " ".join(run("--help").stdout.split())
    text = (tmp_path / "out" / "report.md").read_text()
    assert FROM_TRUTH in text and "| event camera | clean, seed 0 |" in text
    assert "threshold_on 0.4," in text and "shading [1, -0.25]," in text and "how films are read" not in text
    noisy = Simulated.of("noisy", ["shot_rate_hz=3"]).spec
    assert (noisy.threshold_on, noisy.shot_rate_hz, noisy.photoreceptor_tau_us) == (0.25, 3.0, 100.0)
    wrong = run(tmp_path / "film.npz", "-o", tmp_path / "other", "--sensor", "davis")
    assert wrong.exit_code == 2 and "presets are" in wrong.output
