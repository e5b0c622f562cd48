"""Pictures from events alone: what is known of them, however the events come."""

from __future__ import annotations

import json
import math
import os
import platform
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from exact_voxels import exact_voxels

from interp import pretrained
from interp.commands.making import contrast_of
from interp.commands.reconstruct import reconstruct as command
from interp.interpolate.shelf import PIECE
from interp.interpolate.take import Options
from interp.networks import make
from interp.reconstruct.high_pass import GREY, HighPass
from interp.reconstruct.of_network import OfNetwork
from interp.reconstruct.whole import AT_ONCE, reconstruct
from interp.weights import save
from vid2ev import DvsSpec, Events, open_source
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import format_named
from vid2ev.formats.event_file import Recording
from vid2ev.physics.comparator import LEAST_NATS
from vid2ev.recording.exposures import read_codes

SIZE = (40, 24)


def events_at(t: list[int], p: list[int], x: int = 3, y: int = 5) -> Events:
    here = np.zeros(len(t), np.uint16)
    return Events(np.array(t, np.int64), here + x, here + y, np.array(p, np.uint8))


def drawn(count: int = 5000, us: int = 1_000_000, seed: int = 0) -> Events:
    draw = np.random.default_rng(seed)
    t = np.sort(draw.integers(0, us, count)).astype(np.int64)
    x, y = (draw.integers(0, side, count).astype(np.uint16) for side in SIZE)
    return Events(t, x, y, draw.integers(0, 2, count).astype(np.uint8))


def written(path: Path, events: Events, us: int = 1_000_000, format: str = "npz", size: tuple[int, int] = SIZE) -> Path:
    kind = format_named(format)
    assert kind.write is not None
    kind.write(path, Recording(size, 0, us, len(events), lambda: iter([events])))
    return path


def test_a_pixel_is_the_log_of_its_light_high_pass_filtered() -> None:
    seen = HighPass(SIZE, (0.3, 0.2), cutoff_hz=2.0)
    times, signs = [10_000, 30_000, 200_000], [1, 1, 0]
    seen.add(events_at(times, signs), 0, 200_000)
    for at_us in (200_000, 450_000):
        law = sum(
            (0.2 if p else -0.3) * math.exp(-2 * math.pi * 2.0 * (at_us - t) * 1e-6)
            for t, p in zip(times, signs, strict=True)
        )
        picture = seen.picture(at_us)
        assert picture[5, 3] == pytest.approx(GREY * math.exp(law), rel=1e-6)
        others = np.delete(picture.reshape(-1), 5 * SIZE[0] + 3)
        np.testing.assert_allclose(others, GREY, rtol=1e-6)


@pytest.mark.parametrize("size", [(272, 208), (269, 203)])
@pytest.mark.parametrize("name", ["firenet", "e2vid"])
def test_pictures_in_tiles_are_those_of_the_whole_also_when_they_remember(
    tmp_path: Path, name: str, size: tuple[int, int]
) -> None:
    save(tmp_path / "net.safetensors", name, make(name))
    ways = [OfNetwork(tmp_path / "net.safetensors", size, (0.2, 0.3), tile=tile) for tile in ("128x64", "none")]
    draw, pictures = np.random.default_rng(0), []
    for k in range(3):
        t = np.sort(draw.integers(10_000 * k, 10_000 * (k + 1), 50_000)).astype(np.int64)
        x, y = (draw.integers(0, side, len(t)).astype(np.uint16) for side in size)
        events, pictures = Events(t, x, y, draw.integers(0, 2, len(t)).astype(np.uint8)), []
        for way in ways:
            way.add(events, 10_000 * k, 10_000 * (k + 1))
            pictures.append(way.picture(10_000 * (k + 1)))
        np.testing.assert_allclose(*pictures, atol=1e-6)
    assert pictures[0].std() > 1e-4
    for part, whole in zip(*(way.memory().values() for way in ways), strict=True):
        if whole.dtype.kind == "f":
            np.testing.assert_allclose(part, whole, atol=1e-6)


@pytest.mark.parametrize("begin_us", [-(10**12), -2_000_000, 10**12])
def test_pictures_do_not_depend_on_what_the_clock_says(begin_us: int) -> None:
    some, pictures = drawn(us=100_000), []
    for since_us in (0, begin_us):
        high_pass = HighPass(SIZE, (0.2, 0.3), 100.0)
        high_pass.add(Events(some.t + since_us, some.x, some.y, some.p), since_us, since_us + 100_000)
        pictures.append(high_pass.picture(since_us + 100_000))
    np.testing.assert_array_equal(*pictures)


def test_a_filter_that_forgets_nothing_gives_light_back_to_a_threshold() -> None:
    seen = HighPass(SIZE, (0.1, 0.1), cutoff_hz=0)
    seen.add(events_at(list(range(1, 8)), [1] * 7), 0, 10)
    seen.add(events_at(list(range(11, 14)), [0] * 3), 10, 20)
    assert seen.picture(10**9)[5, 3] == pytest.approx(GREY * math.exp(0.4), rel=1e-6)


def test_pictures_do_not_depend_on_how_often_one_looks() -> None:
    events, often, once = drawn(), HighPass(SIZE, (0.2, 0.2)), HighPass(SIZE, (0.2, 0.2))
    for k in range(20):
        part = events.select((events.t > 50_000 * k - (k == 0)) & (events.t <= 50_000 * (k + 1)))
        often.add(part, 50_000 * k, 50_000 * (k + 1))
        often.picture(50_000 * (k + 1))
    once.add(events, 0, 1_000_000)
    np.testing.assert_array_equal(often.picture(1_000_000), once.picture(1_000_000))


@pytest.mark.parametrize("name", ["firenet", "e2vid"])
def test_a_network_sees_voxels_with_exact_times_and_remembers(tmp_path: Path, name: str) -> None:
    network = make(name).eval()
    save(tmp_path / "some.safetensors", name, network)
    events, states = drawn(), ()
    seen = OfNetwork(tmp_path / "some.safetensors", SIZE, (0.2, 0.25))
    for k in range(3):
        start, stop = 100_000 * k, 100_000 * (k + 1)
        inside = events.select((events.t > start) & (events.t <= stop))
        voxels = exact_voxels(inside, SIZE, start, stop, network.spec.bins, (0.2, 0.25))
        with torch.inference_mode():
            image, states = network(voxels[None], states)
        half = len(inside) // 2
        seen.add(inside.stretch(0, half), start, stop)  # (however they come)
        seen.add(inside.stretch(half, len(inside)), start, stop)
        from interp.light import to_light

        expected = to_light(image[0, 0].clamp(0, 1), "srgb").numpy()
        np.testing.assert_allclose(seen.picture(stop), expected, atol=1e-5)


@pytest.mark.parametrize("format", ["npz", "hdf5", "evt3", "aedat4"])
def test_any_event_file_gives_the_same_pictures(tmp_path: Path, format: str) -> None:
    first = reconstruct(written(tmp_path / "a.npz", drawn()), tmp_path / "one", cutoff_hz=1, fps=25)
    path = written(tmp_path / f"b{format_named(format).suffix}", drawn(), format=format)
    other = reconstruct(path, tmp_path / "other", cutoff_hz=1, fps=25)
    assert first["frames"] == other["frames"] == 25 and first["events"] == other["events"] == 5000
    for k in (0, 12, 24):
        one, two = (read_codes(tmp_path / name / f"{k:06d}.png") for name in ("one", "other"))
        np.testing.assert_array_equal(one, two)


def test_of_a_recording_of_several_cameras_the_only_event_camera_is_taken(tmp_path: Path) -> None:
    for camera in ("aps", "dvs", "other"):
        (tmp_path / "rig" / camera).mkdir(parents=True)
        sensor = {"parameters": {"threshold_on": 0.3, "threshold_off": 0.2} if camera == "dvs" else {}}
        (tmp_path / "rig" / camera / "manifest.json").write_text(
            json.dumps({"versions": {"vid2ev": "0"}, "sensor": sensor})
        )
    written(tmp_path / "rig" / "dvs" / "events.npz", drawn())
    made = reconstruct(tmp_path / "rig", tmp_path / "a", cutoff_hz=1, fps=10)
    assert (made["source"]["path"], made["source"]["contrast"]) == (str(tmp_path / "rig" / "dvs"), [0.2, 0.3])
    written(tmp_path / "rig" / "other" / "events.npz", drawn())
    with pytest.raises(UsageError, match=r"of the cameras aps, dvs, other; give one: .*rig/dvs or .*rig/other$"):
        reconstruct(tmp_path / "rig", tmp_path / "b", cutoff_hz=1, fps=10)
    written(tmp_path / "rig" / "events.npz", drawn())
    assert reconstruct(tmp_path / "rig", tmp_path / "b", cutoff_hz=1, fps=10)["source"]["path"] == str(tmp_path / "rig")


def test_pictures_come_by_time_or_by_events(tmp_path: Path) -> None:
    path = written(tmp_path / "a.npz", drawn())
    made = reconstruct(path, tmp_path / "time", cutoff_hz=1, fps="1000/33")
    times = [frame.t_ns // 1000 for frame in open_source(tmp_path / "time").frames()]
    assert times == [33_000 * k for k in range(1, made["frames"] + 1)]
    made = reconstruct(path, tmp_path / "count", cutoff_hz=1, events_per_frame=1000)
    times = [frame.t_ns // 1000 for frame in open_source(tmp_path / "count").frames()]
    assert made["frames"] == 5 and times == [int(drawn().t[1000 * k - 1]) for k in range(1, 6)]
    part = reconstruct(path, tmp_path / "part", cutoff_hz=1, fps=10, start_s=0.2, stop_s=0.5)
    assert part["frames"] == 3 and part["start_us"] == 200_000


RUN = """
import os, signal, sys
import torch
torch.set_num_threads(1)
from interp.reconstruct.whole import reconstruct

seen = 0

def report(*_):
    global seen
    seen += 1
    if seen == int(sys.argv[4]):
        os.kill(os.getpid(), signal.SIGKILL)

reconstruct(sys.argv[1], sys.argv[2], network=sys.argv[3] or None, fps=40, report=report)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
@pytest.mark.parametrize("network", ["", "firenet"])
@pytest.mark.parametrize("at", [AT_ONCE + 2, 2 * AT_ONCE])
def test_killed_it_goes_on_to_the_same_bytes(tmp_path: Path, network: str, at: int) -> None:
    weights = tmp_path / "some.safetensors" if network else None
    if weights:
        save(weights, network, make(network))
    given: dict[str, Any] = {"fps": 40, "network": weights}
    path = written(tmp_path / "a.npz", drawn())
    reconstruct(path, tmp_path / "once", **given)
    arguments = [str(path), str(tmp_path / "twice"), str(weights or ""), str(at)]
    done = subprocess.run([sys.executable, "-c", RUN, *arguments], capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert not (tmp_path / "twice").exists()
    told = reconstruct(path, tmp_path / "twice", resume=True, **given)
    assert told["frames"] == 40 and told["run"]["frames"] < 40
    for file in os.listdir(tmp_path / "once"):
        if file != "frames.json":
            assert (tmp_path / "once" / file).read_bytes() == (tmp_path / "twice" / file).read_bytes()


class Stopped(Exception):
    pass


def stopped_after(pictures: int) -> Any:
    coming = iter(range(1, pictures))

    def report(*_: object) -> None:
        if next(coming, None) is None:
            raise Stopped

    return report


def test_what_a_network_began_on_another_device_is_not_gone_on_with(tmp_path: Path) -> None:
    save(tmp_path / "net.safetensors", "firenet", make("firenet"))
    path = written(tmp_path / "a.npz", drawn())
    given: dict[str, Any] = {"fps": 40, "network": tmp_path / "net.safetensors"}
    with pytest.raises(Stopped):
        reconstruct(path, tmp_path / "out", report=stopped_after(AT_ONCE + 1), **given)
    kept = tmp_path / "out.partial" / "job.json"
    job = json.loads(kept.read_text())
    job["reconstruction"]["device"] = "cuda"
    kept.write_text(json.dumps(job))
    with pytest.raises(UsageError, match=r'begun with reconstruction\.device = "cuda", not "cpu"'):
        reconstruct(path, tmp_path / "out", resume=True, **given)


def crowded() -> Events:
    """Fifty events in each of 40 microseconds, of which the first is that in which the recording begins."""
    some = drawn(2000)
    return Events(25_000 * (np.arange(2000) // 50).astype(np.int64), some.x, some.y, some.p)


@pytest.mark.parametrize("blind_us", [0, 2000])
@pytest.mark.parametrize("network", ["", "firenet"])
def test_of_slices_that_end_in_one_microsecond_there_is_one_picture(
    tmp_path: Path, network: str, blind_us: int
) -> None:
    weights = tmp_path / "some.safetensors" if network else None
    if weights:
        save(weights, network, make(network))
    path = written(tmp_path / "a.npz", crowded(), us=975_000)
    given: dict[str, Any] = {"network": weights, "cutoff_hz": None if network else 1, "refractory_us": blind_us}
    made = reconstruct(path, tmp_path / "many", events_per_frame=10, **given)
    times = [frame.t_ns // 1000 for frame in open_source(tmp_path / "many").frames()]
    assert made["frames"] == len(times) == 40 and times == [25_000 * k for k in range(40)]
    reconstruct(path, tmp_path / "once", events_per_frame=50, **given)
    with pytest.raises(Stopped):
        reconstruct(path, tmp_path / "on", events_per_frame=10, report=stopped_after(AT_ONCE + 2), **given)
    told = reconstruct(path, tmp_path / "on", events_per_frame=10, resume=True, **given)
    assert told["run"]["frames"] == 40 - AT_ONCE
    for file in os.listdir(tmp_path / "many"):
        if file != "frames.json":
            content = (tmp_path / "many" / file).read_bytes()
            assert content == (tmp_path / "on" / file).read_bytes()
            assert content == (tmp_path / "once" / file).read_bytes()  # (slices of fifty have all of a microsecond)


def test_the_size_that_is_said_is_that_of_what_was_made(tmp_path: Path) -> None:
    """Films have even sides."""
    path = written(tmp_path / "a.npz", drawn(), size=(41, 25))
    film = reconstruct(path, tmp_path / "a.mp4", cutoff_hz=1, fps=10)
    assert tuple(film["size"]) == open_source(tmp_path / "a.mp4").size == (42, 26)
    assert film["remarks"][-1].startswith("the film has 42x26 pixels: films have even sides, so the last column and")
    pictures = reconstruct(path, tmp_path / "pictures", cutoff_hz=1, fps=10)
    assert pictures["size"] == [41, 25] and not any("even" in text for text in pictures["remarks"])


@pytest.mark.parametrize(("count", "said"), [(1, "from      1 event, "), (1200, "from      1,200 events, ")])
def test_one_event_is_said_to_be_one(tmp_path: Path, count: int, said: str) -> None:
    path = written(tmp_path / "a.npz", drawn(count))
    shown = CliRunner().invoke(command, [str(path), "-o", str(tmp_path / "seen"), "--cutoff", "1", "--fps", "2"])
    assert shown.exit_code == 0 and said in shown.output


def test_a_film_has_all_pictures(tmp_path: Path) -> None:
    path = written(tmp_path / "a.npz", drawn())
    made = reconstruct(path, tmp_path / "a.mp4", cutoff_hz=1, fps=2 * PIECE)
    film = open_source(tmp_path / "a.mp4")
    assert made["frames"] == 2 * PIECE == len(list(film.frames())) and film.size == SIZE


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["nowhere.h5"], 2, "no such file"),
        (["text.txt"], 1, "no event file"),
        (["a.npz", "--fps", "0"], 2, "expected from 1e-05"),
        (["a.npz", "--fps", "10", "--events-per-frame", "9"], 2, "leave out one"),
        (["a.npz", "--events-per-frame", "0"], 2, "at least 1"),
        (["a.npz", "--cutoff", "-1"], 2, "0 to 10000"),
        (["a.npz", "--network", "rrin.safetensors"], 2, "takes frames"),
        (["a.npz", "--network", "rrin.safetensors", "--cutoff", "1"], 2, "leave out one"),
        (["a.npz", "--start", "5"], 2, "no events from 5 s on"),
        (["a.npz", "--stop", "-1"], 2, "no events from 0 s to -1 s"),
        (["empty.csv"], 1, "empty.csv holds no events"),
        (["a.npz", "--network", "broken.safetensors"], 1, "'broken' made values that are no numbers; take other"),
        (["a.npz", "--start", "0.5", "--stop", "0.2"], 2, "not after"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: int, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "a.npz", drawn(100))
    (tmp_path / "text.txt").write_text("nothing here\n")
    (tmp_path / "empty.csv").write_text("t,x,y,p\n")
    save(tmp_path / "rrin.safetensors", "rrin", make("rrin"))
    broken = make("firenet")
    torch.nn.init.constant_(broken.out.bias, torch.nan)  # type: ignore[arg-type, union-attr]
    save(tmp_path / "broken.safetensors", "firenet", broken)
    before = sorted(tmp_path.rglob("*"))
    result = CliRunner().invoke(command, arguments)
    assert isinstance(result.exception, (UsageError, DataError)), result.output
    assert result.exception.exit_code == code
    assert sentence in str(result.exception) and "\n" not in str(result.exception)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("text", ['{"name": "an app"}', "no JSON", '{"sensor": {}}'])
def test_what_lies_beside_an_event_file_is_not_its_manifest(tmp_path: Path, text: str) -> None:
    source = written(tmp_path / "a.npz", drawn(100))
    (tmp_path / "manifest.json").write_text(text)
    assert reconstruct(source, tmp_path / "out")["source"]["contrast"] == [0.15, 0.15]


@pytest.mark.parametrize("off", ["a", None, [0.2], -0.2, 0, math.nan, 1e300])
def test_thresholds_of_a_manifest_that_no_sensor_has_are_said_to_be_damage(tmp_path: Path, off: Any) -> None:
    source = written(tmp_path / "events.npz", drawn(10))
    sensor = {"parameters": {"threshold_on": 0.3, "threshold_off": off}}
    (tmp_path / "manifest.json").write_text(json.dumps({"versions": {"vid2ev": "0"}, "sensor": sensor}))
    with pytest.raises(DataError, match=r"manifest\.json does not say what it should"):
        reconstruct(source, tmp_path / "out", cutoff_hz=1)


@pytest.mark.parametrize("nats", [LEAST_NATS, 100.0])
def test_all_thresholds_that_a_sensor_may_have_are_those_of_its_events(tmp_path: Path, nats: float) -> None:
    numbers = DvsSpec(threshold_on=nats).model_dump(mode="json")
    source = written(tmp_path / "events.npz", drawn(10))
    (tmp_path / "manifest.json").write_text(
        json.dumps({"versions": {"vid2ev": "0"}, "sensor": {"parameters": numbers}})
    )
    told = reconstruct(source, tmp_path / "said", cutoff_hz=1)
    asked = reconstruct(source, tmp_path / "asked", cutoff_hz=1, contrast=contrast_of(f"0.15,{nats!r}"))
    assert told["source"]["contrast"] == asked["source"]["contrast"] == [0.15, nats]


@pytest.mark.parametrize("contrast", [(0, 0.2), (math.nan, 0.2), (0.2, math.inf), (0.2,), 0.2, (0.2, 100.1)])
def test_contrasts_of_no_event_are_refused(tmp_path: Path, contrast: Any) -> None:
    with pytest.raises(UsageError, match="expected nats"):
        reconstruct(written(tmp_path / "a.npz", drawn(10)), tmp_path / "a", contrast=contrast)
    with pytest.raises(UsageError, match="expected nats"):
        Options(contrast=contrast)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("events_per_frame", True, "at least 1"),
        ("events_per_frame", 2.5, "at least 1"),
        ("fps", "1e-400", "from 1e-05 to 100000"),
        ("cutoff_hz", "1", "from 0 to 10000"),
        ("network", 3, "weights 3: no such file"),
        ("start_s", "1", "expected seconds"),
        ("start_s", math.nan, "expected seconds"),
        ("stop_s", math.inf, "expected seconds"),
        ("refractory_us", 0.5, "refractory period 0.5 us: expected 1 to 1e"),
        ("refractory_us", math.nan, "refractory period nan us"),
        ("play", 30, "is of films"),
    ],
)
def test_arguments_that_are_none_are_refused_in_a_sentence(
    tmp_path: Path, name: str, value: Any, sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence) as refused:
        reconstruct(written(tmp_path / "a.npz", drawn(10)), tmp_path / "a", **{name: value})
    assert "\n" not in str(refused.value)


def test_the_command_says_what_it_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "a.npz", drawn())
    result = CliRunner().invoke(command, ["a.npz"])
    assert result.exit_code == 0, result.output
    by = pretrained.first(pretrained.OF_EVENTS)
    assert by and f"by {by.stem}: " in result.output
    assert "a_seen.mp4: 30 pictures of 40x24 as mp4, 30 per second: 1 s\n" in result.output
    soon = CliRunner().invoke(command, ["a.npz", "-o", "soon.mp4", "--fps", "300", "--stop", "0.1"])
    assert "30 pictures of 40x24 as mp4, 300 per second: 0.1 s; --play 30 shows it slowly\n" in soon.output
    slow = CliRunner().invoke(command, ["a.npz", "-o", "slow.mp4", "--stop", "0.03", "--play", "30"])
    assert "1 picture of 40x24 as mp4, 30 per second: 0.0333 s\n" in slow.output
    again = CliRunner().invoke(command, ["a.npz", "--resume", "--json"])
    assert json.loads(again.output)["events"] == 5000


def test_a_film_is_called_after_its_recording_wherever_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    below = tmp_path / "recording" / "below"
    below.mkdir(parents=True)
    written(tmp_path / "recording" / "events.npz", drawn())
    monkeypatch.chdir(below)
    assert CliRunner().invoke(command, ["..", "--cutoff", "1", "--fps", "5"]).exit_code == 0
    assert {path.name for path in below.iterdir()} == {"recording_seen.mp4", "recording_seen.json"}


@pytest.mark.parametrize("output", [".", "..", "/"])
def test_where_no_folder_can_be_put_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, output: str) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "a.npz", drawn())
    refused = CliRunner().invoke(command, ["a.npz", "-o", output]).exception
    assert isinstance(refused, UsageError) and f"{output} cannot be renamed into place" in str(refused)
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is another")
def test_memory_of_pictures_is_taken_again() -> None:
    """Pages that were cleared once are not cleared again; in processes of their own, as this one goes on as it was."""
    program = (
        "import resource, sys; import numpy as np; from interp.commands.reconstruct import keep_memory\n"
        "assert sys.argv[1] == 'no' or keep_memory()\n"
        "def faults(): return resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "for _ in range(3): np.ones(10**7)\n"
        "before = faults()\n"
        "for _ in range(10): np.ones(10**7)\n"
        "print(faults() - before)"
    )
    kept, given_back = (
        int(subprocess.run([sys.executable, "-c", program, word], capture_output=True, check=True).stdout)
        for word in ("yes", "no")
    )
    assert 10 * kept < given_back


def test_what_a_file_does_not_say_and_what_is_wrong_with_it_is_told(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.h5", drawn(us=200_000), us=200_000, format="hdf5")
    assert reconstruct(whole, tmp_path / "whole", cutoff_hz=1.0)["remarks"] == []
    bare = written(tmp_path / "a.csv", drawn(us=200_000), us=200_000, format="csv")
    (said,) = reconstruct(bare, tmp_path / "bare", cutoff_hz=1.0)["remarks"]
    assert "does not state the size of its sensor" in said
    raw = written(tmp_path / "a.raw", drawn(us=200_000), us=200_000, format="evt2")
    raw.write_bytes(raw.read_bytes()[:-1])
    (cut,) = reconstruct(raw, tmp_path / "cut", cutoff_hz=1.0)["remarks"]
    assert str(raw) in cut and "at the end" in cut
