"""The examples run and find what they say; the pages in docs/ name options, keys and files that are there."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import click
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.image import imread

from vid2ev import CisSpec, DvsSpec, cis_names, load_sensor
from vid2ev.commands import main
from vid2ev.recording.depth_files import write_depth
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.rig_file import read_rig
from vid2ev.sensors.devices import missing_for_cuda
from vid2ev.sources import open_source
from vid2ev.sources.with_depth import parse_depth

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]
FROM_V2E, CAMERAS = ROOT / "docs" / "from_v2e.md", ROOT / "docs" / "cameras.md"


def example(name: str) -> ModuleType:
    path = ROOT / "examples" / f"{name}.py"
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification and specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def against_v2e() -> ModuleType:
    return example("against_v2e")


@pytest.fixture(scope="module")
def measured(against_v2e: ModuleType) -> list[dict]:
    done = CliRunner().invoke(against_v2e.main, ["--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.output)


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "examples").glob("*.py")))
def test_each_example_finds_what_it_imports_and_says_what_it_is(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "examples")
    monkeypatch.delitem(sys.modules, name, raising=False)
    module = importlib.import_module(name)
    commands = [value for value in vars(module).values() if isinstance(value, click.Command)]
    assert len(commands) == ("__main__" in Path(module.__file__ or "").read_text())  # (one is imported by another)
    for command in commands:
        told = CliRunner().invoke(command, ["--help"])
        assert told.exit_code == 0 and told.output.startswith("Usage:")
        needed = [option.opts[-1] for option in command.params if isinstance(option, click.Option) and option.required]
        assert [option for option in needed if f" {option} " not in (module.__doc__ or "")] == []


@pytest.mark.parametrize(
    "asked",
    [["--clip", "4k", "--frames", str(n)] for n in (2, 20, 60, 61, 150)]
    + [["--clip", "day", "--hours", hours, "--fps", fps] for hours, fps in (("24", "1"), ("0.01", "29.97"))],
)
def test_a_soak_expects_as_many_frames_as_its_clip_has(asked: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    soak, clips = example("soak"), []
    monkeypatch.setattr(soak, "soak", lambda _, *clip: clips.append(clip) or True)
    assert CliRunner().invoke(soak.main, asked).exit_code == 0
    for clip, fps, seconds in clips:
        assert open_source(clip).frames_expected == soak.frames_in(fps, seconds)
        assert "4k" not in asked or soak.frames_in(fps, seconds) == int(asked[-1])


def test_the_presets_obey_the_laws(measured: list[dict]) -> None:
    """Each measurement is within five standard errors of v2e's law, or of ours where that is said to be another."""
    assert len(measured) == 27
    for row in measured:
        law = row["expected"] if row["ours"] is None else row["ours"]
        assert row["error"] > 0 and row["v2e"] is None
        assert abs(row["value"] - law) <= 5 * row["error"], row


def test_the_laws_that_differ_from_v2es_are_leak_and_shot_noise(measured: list[dict]) -> None:
    others = {row["law"].split(":")[0] for row in measured if row["ours"] is not None}
    assert others == {"leak", "shot noise"}


def test_the_page_shows_what_is_measured(measured: list[dict]) -> None:
    """Laws and values in the table of the page are those of the example."""
    lines = FROM_V2E.read_text(encoding="utf-8").splitlines()
    for row in measured:
        line = next(line for line in lines if f"| {row['case']} | {row['expected']:.4g} {row['unit']}".rstrip() in line)
        shown, error = re.findall(r"([-\d.]+) ± ([\d.]+)", line)[0]
        assert abs(float(shown) - row["value"]) <= 2 * float(error), line


FAKE = """
import numpy as np
class EventEmulator:
    def __init__(self, seed, device): self.sigma_thres = 1.0
    def set_dvs_params(self, preset): assert preset == "clean"
    def generate_events(self, frame, t):
        print("chatter")
        if t == 0: return None
        y, x = np.nonzero(frame > 100 * self.sigma_thres)
        return np.stack([np.full(len(x), t), x, y, np.where(x % 2, 1, -1)], 1).astype(np.float32)
"""


def test_what_another_simulator_sends_arrives(against_v2e: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "v2ecore").mkdir()
    (tmp_path / "v2ecore" / "emulator.py").write_text(FAKE)
    scene = against_v2e.Scene(np.array([0, 1500, 3000]), np.array([[0, 0, 0], [0, 201, 202], [255, 0, 0.0]]), 2)
    with against_v2e.v2e_side(tmp_path, sys.executable) as run:
        for _ in range(2):
            sent = run("clean", {"sigma_thres": 2.0}, scene)
            assert sent.t.tolist() == [1500] * 4 + [3000] * 2
            assert sent.x.tolist() == [1, 2, 1, 2, 0, 0] and sent.y.tolist() == [0, 0, 1, 1, 0, 1]
            assert sent.p.tolist() == [1, 0, 1, 0, 0, 0]


def test_a_checkout_that_is_none_is_one_sentence(against_v2e: ModuleType, tmp_path: Path) -> None:
    scene = against_v2e.Scene(np.array([0]), np.zeros((1, 1)))
    with (
        against_v2e.v2e_side(tmp_path, sys.executable) as run,
        pytest.raises(click.ClickException, match="cannot run v2e"),
    ):
        run("clean", {}, scene)


def test_a_longer_exposure_blurs_and_a_later_line_leans(tmp_path: Path) -> None:
    """At the top all lines open together, whatever the readout time; further down they see something else."""
    shutter = example("figure_shutter")
    scene = shutter.SCENE.replace("size=480x360", "size=64x48")
    pictures = np.int64(shutter.exposed(scene, [0, 20], [0, 300]))
    (sharp, blurred), (leaning, both) = pictures
    for still, late in ((sharp, leaning), (blurred, both)):
        assert np.array_equal(still[0], late[0]) and np.abs(still[-8:] - late[-8:]).mean() > 5
    roughness = [np.abs(np.diff(picture, axis=1)).mean() for picture in (sharp, blurred, leaning, both)]
    assert roughness[1] < 0.8 * roughness[0] and roughness[3] < 0.8 * roughness[2]
    shutter.drawn(pictures.astype(np.uint8), [0, 20], [0, 300]).savefig(tmp_path / "shutter.png")
    assert run(shutter, ["--scene", scene, "--exposures", "1", "--lines", "0"], tmp_path).startswith("out.png: 1 exp")


def test_crossings_lie_on_the_response_and_events_are_those_that_are_not_too_early(tmp_path: Path) -> None:
    crossings = example("figure_crossings")
    course = crossings.course_of(["refractory_us=1200"])
    levels = (crossings.at(course, 1e-3 * course.crossings.t) - course.filtered[0]) / 0.2
    assert np.abs(levels - np.rint(levels)).max() < 0.005
    assert levels.max() > 6.9 and len(course.crossings.t) == 14
    sent, silent = [course.crossings.t[0]], []
    for t_us in course.crossings.t[1:]:
        (sent if t_us - sent[-1] > 1200 else silent).append(t_us)
    assert course.sent.t.tolist() == sent and len(silent) == 3
    assert not (course.fixed.t % 2000).any() and len(course.fixed.t) < len(sent)
    assert not np.array_equal(course.linear.t, course.sent.t)
    assert "off by 186 us, at most 1412 us" in run(crossings, [], tmp_path)


def test_the_picture_of_the_rig_is_made(tmp_path: Path) -> None:
    rig_picture = example("rig_picture")
    printed = run(rig_picture, ["--scene", "scene:parallax,seed=8,size=96x72,duration_s=0.1", "--start", "0"], tmp_path)
    counts = [int(count.replace(",", "")) for count in re.findall(r"([\d,]+) events", printed)]
    assert len(counts) == 2 and min(counts) > 100


def run(module: ModuleType, arguments: list[str], folder: Path) -> str:
    """What an example prints; its picture is there and is more than one colour."""
    with contextlib.chdir(folder):
        done = CliRunner().invoke(module.main, [*arguments, "-o", "out.png"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    picture = imread(folder / "out.png")
    assert min(picture.shape[:2]) > 200 and picture[..., :3].std() > 0.05
    return done.output


def our_options() -> set[str]:
    commands = [main.get_command(click.Context(main), name) for name in ("convert", "render", "reformat")]
    options = [option for command in commands if command for option in command.params]
    return {name for option in options for name in (*option.opts, *option.secondary_opts)}


def test_the_page_names_options_keys_and_files_that_are_there() -> None:
    page = FROM_V2E.read_text(encoding="utf-8")
    rows = page.partition("## Options")[2].partition("\n\nIn v2e")[0]
    ours = " ".join(line.split(" | ")[1] for line in rows.splitlines() if line.count(" | ") >= 2)
    ours += " ".join(re.findall(r"^(?:vid2ev|  --).*$", page, re.MULTILINE))
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", ours))
    assert len(named) > 20
    assert named <= our_options(), named - our_options()
    settings = re.findall(r"--set (\w+=[\w.]+)", page)
    assert len(settings) > 10
    load_sensor("v2e-noisy", settings)
    equations = page.partition("## The model, equation by equation")[2].partition("## Options")[0]
    keys = {key for line in equations.splitlines() for key in re.findall(r"`([a-z_0-9]+)`", line.split(" | ")[-1])}
    assert len(keys) > 10
    assert keys <= set(DvsSpec.model_fields), keys - set(DvsSpec.model_fields)
    assert all((ROOT / name).exists() for name in re.findall(r"examples/[\w.]+", page))


def test_the_page_of_cameras_names_keys_options_and_sensors_that_are_there(tmp_path: Path) -> None:
    page = CAMERAS.read_text(encoding="utf-8")
    for k, text in enumerate(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)):
        (tmp_path / f"{k}.toml").write_text(text, encoding="utf-8")
        assert read_rig(tmp_path / f"{k}.toml").resolved((741, 500) if k else (640, 480)).viewpoints
    assert k == 1
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", page)) <= our_options() | {"--from", "--as", "--threads"}
    rows = page.partition("| keys | what they do |")[2].partition("\n\n")[0]
    keys = {key for line in rows.splitlines() for key in re.findall(r"`(\w+)`", line.split(" | ")[0])}
    assert keys == set(CisSpec.model_fields)
    assert all(f"`{name}`" in page for name in cis_names())


def test_the_depths_of_the_page_are_understood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    for name in ("depth.npy", "disparity.npy", "inverse.npy", "maps/0.npy"):
        np.save(name, np.ones((6, 8), np.float32))
    (tmp_path / "room" / "depth").mkdir(parents=True)
    write_depth(tmp_path / "room" / "depth" / "000000.png", np.full((6, 8), 3, np.float32))
    table = CAMERAS.read_text(encoding="utf-8").partition("| `--depth` |")[2].partition("\n\n")[0]
    texts = [text for text in re.findall(r"^\| `([^`]+)`", table, re.MULTILINE) if not text.startswith("model:")]
    assert len(texts) == 6
    found = {text: parse_depth(text, Intrinsics.of_field((8, 6), 60)).at(0)[0, 0] for text in texts}
    assert [float(f"{depth_m:.4g}") for depth_m in found.values()] == [2.5, 1, 0.001, 3, 5.985, 5]


def test_the_python_of_the_page_runs() -> None:
    blocks = re.findall(r"```python\n(.*?)```", FROM_V2E.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    for code in blocks:
        namespace: dict[str, object] = {}
        with contextlib.redirect_stdout(None):
            exec(compile(code, FROM_V2E.name, "exec"), namespace)
        assert len(namespace["events"])  # type: ignore[arg-type]


def test_the_benchmark_of_gpus_says_in_one_line_that_there_is_none() -> None:
    if not missing_for_cuda():
        pytest.skip("there is a GPU: the example would measure it for minutes")
    done = CliRunner().invoke(example("benchmark_gpu").main, [])
    assert done.exit_code == 0 and re.fullmatch(r"no GPU: .+; nothing is measured\n", done.output)


def test_the_benchmark_of_clips_measures_each_part(monkeypatch: pytest.MonkeyPatch) -> None:
    module = example("benchmark_clips")
    monkeypatch.setattr(module, "CLIPS", {"16x12 x2": ((16, 12), 2)})
    done = CliRunner().invoke(module.main, ["--runs", "1"])
    rows = [line.strip("| ").split(" | ") for line in done.output.splitlines()[2:]]
    assert done.exit_code == 0 and [row[1] for row in rows] == ["paper", "ideal"]
    assert all(float(row[2]) > 0.1 for row in rows)


def test_how_much_of_a_scene_changes_is_known_of_short_ones() -> None:
    share = example("benchmark_still").share_changed("scene:spinning-shapes,size=128x96,duration_s=0.05")
    assert 0 < share <= 1


def test_too_few_frames_to_time_sleep_by_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "short.npz", frames=np.ones((3, 4, 4), np.float32), t=np.arange(3) / 100)
    done = CliRunner().invoke(example("benchmark_skip").main, ["--clip", str(tmp_path / "short.npz")])
    assert done.exit_code == 2 and "3 frames, expected at least 30" in done.output


@pytest.mark.long
def test_scores_of_clips_are_given_for_each_method() -> None:
    done = CliRunner().invoke(
        example("score_clips").main, ["--scenes", "1", "--method", "linear", "--method", "nearest", "--multiple", "4"]
    )
    header, _, *rows = [line.strip("| ").split(" | ") for line in done.output.splitlines()]
    assert done.exit_code == 0 and header == ["clips", "linear", "nearest"]
    assert [row[0] for row in rows] == ["1 scenes, clean", "1 scenes, noisy"]
    assert all(float(row[1].split(" / ")[0]) > 10 for row in rows)
