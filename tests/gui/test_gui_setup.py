"""A setup, its command, its options and its files say the same."""

from __future__ import annotations

import asyncio
import logging
import re
import shlex
import shutil
import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev.commands.convert import convert
from vid2ev.commands.gui import gui
from vid2ev.commands.worker_options import NAMES
from vid2ev.compare.recordings import compare_recordings
from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.formats.hdf5 import write_events
from vid2ev.gui.boards import CameraBoard, SceneBoard
from vid2ev.gui.command import SCENE, command_of, options_of, sensor_text, write_scene
from vid2ev.gui.guard import Guard, is_loopback
from vid2ev.gui.light import duration_s
from vid2ev.gui.loading import loaded, loaded_from
from vid2ev.gui.preview import Answer, Shown
from vid2ev.gui.scene_edit import moved, pose_at, thing_named, things_of, value_of, with_place, with_values
from vid2ev.gui.session import Session
from vid2ev.gui.setup import Setup, setup_of
from vid2ev.gui.tasks import gathered
from vid2ev.gui.unanswered import Unanswered
from vid2ev.gui.why import why_not
from vid2ev.making.conversion import default_directory
from vid2ev.reformat import reformat
from vid2ev.rig.camera import Camera
from vid2ev.rig.pose import Pose
from vid2ev.rig.rig_file import rig_text, write_text
from vid2ev.scenes.scene_file import read_scene, scene_names
from vid2ev.seen.recipe import Recipe
from vid2ev.stream.events import Events
from vid2ev.tracks.outputs import Outputs

SMALL = "scene:spinning-shapes,size=32x24,duration_s=0.02"


def changed(setup: Setup) -> Setup:
    setup = setup.with_preset(0, "davis346").with_sensor_values(0, {"threshold_on": 0.3})
    setup = setup.with_sensor_values(0, {"shading": (0.1, -0.2)}).with_sensor_values(1, {"exposure_us": 700.0})
    return setup.with_option("seed", 7)


def moved_camera(setup: Setup) -> Setup:
    return changed(setup).with_camera_values(1, {"translation_mm": (15.0, 0.0, 0.0), "fov_deg": 40.0})


def other_scene(setup: Setup) -> Setup:
    return moved_camera(setup).with_scene(with_values(setup.settled(), "scene", {"ambient": (0.2, 0.3, 0.4)}))


def save(setup: Setup, folder: Path) -> None:
    """Save the files that the command of a setup names, as the page does."""
    for name in command_of(setup).files:
        if name == SCENE:
            write_scene(setup, folder / name)
        else:
            write_text(folder / name, rig_text(setup.rig, folder))


def parsed(setup: Setup, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the recipe would be by the command, given to the shell in a folder that holds its files."""
    command = command_of(setup)
    save(setup, folder)
    monkeypatch.chdir(folder)
    context = convert.make_context("convert", shlex.split(str(command))[2:])
    options = dict(context.params)
    (video,) = options.pop("videos")
    Outputs.taken_from(options)
    for name in ("output", "dry_run", "verbose", "quiet", "as_json", "budget", "threads", "device", "skip", "overwrite",
                 "resume", "effects", "tolerance", "split", *NAMES):  # fmt: skip
        options.pop(name)
    return Recipe.of(video, **options).describe()


@pytest.mark.parametrize("change", [lambda setup: setup, changed, moved_camera, other_scene])
def test_the_command_is_what_the_page_converts(change: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setup = change(setup_of(SMALL))
    shell, page = tmp_path / "shell", tmp_path / "page"
    shell.mkdir()
    page.mkdir()
    said = parsed(setup, shell, monkeypatch)
    made = Recipe.of(**options_of(setup, page)).describe()
    for source in (said["source"], made["source"]):
        source["path"] = Path(source["path"]).name
        source.pop("changed_ns", None)
    assert said == made
    for number, camera in enumerate(setup.rig.cameras):
        assert said["cameras"][camera.name]["parameters"] == setup.spec(number).model_dump(mode="json")


@pytest.mark.parametrize("output", ["spinning-shapes_events", "scene_events", "elsewhere", "elsewhere/", "./a/./b//"])
@pytest.mark.parametrize("change", [lambda setup: setup, moved_camera, other_scene])
def test_the_command_records_where_the_page_does(change: Any, output: str) -> None:
    words = shlex.split(str(command_of(change(setup_of(SMALL)), output)))[2:]
    options = convert.make_context("convert", words).params
    usual = str(default_directory(options["videos"][0]))
    assert (options["output"] is None) == (output == usual)
    assert options["output"] in (None, str(Path(output))) and Path(options["output"] or usual) == Path(output)


def test_the_command_converts_the_source_whatever_it_is_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("-o.npy", "--json.npy", "a b.npy", "'.npy"):
        np.save(tmp_path / name, np.zeros((3, 24, 32), np.float32))
        setup = setup_of(name).with_option("fps", 50.0)
        options = convert.make_context("convert", shlex.split(str(command_of(setup)))[2:]).params
        (video,) = options["videos"]
        assert Path(video) == Path(name) and default_directory(video) == default_directory(name)


def test_a_value_that_cannot_be_is_refused_and_one_that_is_the_presets_is_no_change() -> None:
    setup = setup_of(SMALL)
    with pytest.raises(
        UsageError, match=r"threshold_on = -1.0 in sensor paper is impossible: it must be greater than 0"
    ):
        setup.with_sensor_values(0, {"threshold_on": -1.0})
    with pytest.raises(UsageError, match=r"camera cis: fov_deg = 400.0 is impossible"):
        setup.with_camera_values(1, {"fov_deg": 400.0})
    with pytest.raises(UsageError, match=r"scene.duration_s = -1.0 is impossible"):
        with_values(setup.settled(), "scene", {"duration_s": -1.0})
    with pytest.raises(UsageError, match="two cameras are called dvs"):
        setup.with_rig((*setup.rig.cameras, Camera(name="dvs", kind="dvs")))
    other = setup.with_sensor_values(0, {"threshold_on": 0.2})
    assert other.rig.cameras[0].set == {"threshold_on": 0.2}
    assert other.with_sensor_values(0, {"threshold_on": 0.15}) == setup


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("", "no source is named; enter a video"),
        ("nothing.mp4", "nothing.mp4: no such file or folder"),
        ("n" * 400 + ".mp4", "n" * 30 + ".mp4: no such file or folder"),
        ("-", "- passes once and cannot be looked at here and there; give a file"),
        ("camera:0", "camera:0 passes once"),
        ("scene:nope", "scene 'nope' is unknown"),
        ("events.txt", "events.txt is an event file (rpg) already; `vid2ev render` shows it"),
    ],
)
def test_a_source_that_is_none_is_refused_and_changes_nothing(
    source: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("events.txt").write_text("# width 8 height 6\n1000 1 2 1\n2000 1 2 0\n")
    session, heard = Session(setup_of(SMALL)), list[Any]()
    session.on("setup", heard.append)
    assert why in str(session.change(lambda: setup_of(source)))
    assert session.setup == setup_of(SMALL) and not heard
    session.close()


def test_the_pixel_that_is_followed_is_that_of_its_camera_whatever_its_number() -> None:
    setup = setup_of(SMALL)
    second = setup.with_rig((*setup.rig.cameras, Camera(name="dvs2", kind="dvs")))
    session = Session(second)
    session.look(pixel=(2, 5, 7))
    for other, followed in (
        (second.with_rig(second.rig.cameras[1:]), (1, 5, 7)),
        (second.with_rig(second.rig.cameras[::-1]), (0, 5, 7)),
        (second.with_sensor_values(0, {"threshold_on": 0.3}), (2, 5, 7)),
        (setup, None),
        (second, None),
    ):
        assert session.change(lambda other=other: other) is None
        assert session.request.pixel == followed and session.request.setup == other
    session.close()


def test_a_picture_that_is_still_there_is_clicked_for_its_own_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    testing = pytest.importorskip("nicegui.testing", reason="the extra gui is not installed")
    from vid2ev.gui.pictures import Pictures

    monkeypatch.setenv("NICEGUI_STORAGE_PATH", str(tmp_path / "storage"))
    setup = setup_of(SMALL)
    first, second = setup.rig.cameras[0], Camera(name="dvs2", kind="dvs")
    session = Session(setup.with_rig((first, second)))
    shown = tuple(Shown(each.name, each.kind, (8, 6), b"", "") for each in session.setup.rig.cameras)
    drawn = list[Pictures]()

    async def click() -> list[tuple[int, int, int] | None]:
        async with testing.user_simulation(lambda: drawn.append(Pictures(session))) as user:
            await user.open("/")
            drawn[0].show(Answer(1, 0.0, (0.0, 0.1), 1.0, shown))
            session.change(lambda: setup.with_rig((second,)))
            drawn[0].show(Answer(1, 0.0, (0.0, 0.1), 1.0, shown))  # (which was on its way)
            followed, said = [], SimpleNamespace(args={"image_x": 5.5, "image_y": 3.2})
            for image, *_ in reversed(drawn[0]._cards):
                (mouse,) = (each for each in image._event_listeners.values() if each.type == "mouse")
                mouse.handler(said)
                followed.append(session.request.pixel)
            return followed

    assert asyncio.run(click()) == [(0, 5, 3), (0, 5, 3)]
    session.close()


def test_a_name_that_no_disk_takes_is_refused_in_a_sentence() -> None:
    session = Session(setup_of(SMALL))

    def too_long() -> Setup:
        (Path("n" * 400)).read_text()
        raise AssertionError

    why = r"n+\.\.\.n+: File name too long; give another name"
    assert re.fullmatch(why, str(session.change(too_long)))
    with pytest.raises(OSError, match="File name too long") as failed:
        too_long()
    assert re.fullmatch(why, why_not(failed.value)) and why_not(KeyError("x")) == "KeyError: 'x'"
    session.close()


def test_a_preset_that_is_refused_is_said_and_the_one_in_use_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the file of another camera's sensor is none any more; what was changed of the sensor stays."""
    testing = pytest.importorskip("nicegui.testing", reason="the extra gui is not installed")
    from vid2ev.gui.settings import Settings

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NICEGUI_STORAGE_PATH", str(tmp_path / "storage"))
    file = Path("mine.toml")
    file.write_text("[cis]\nexposure_us = 100\n")
    setup = setup_of(SMALL).with_preset(1, "mine.toml").with_sensor_values(0, {"threshold_on": 0.3})
    session = Session(setup)

    async def choose(name: str) -> tuple[str, list[str]]:
        async with testing.user_simulation(lambda: Settings(session) and None) as user:
            await user.open("/")
            assert user.client
            drawn = user.client.elements.values()
            (select,) = (each for each in drawn if each.props.get("data-preset") == "dvs")
            select.value = name
            return select.value, user.notify.messages

    file.write_text("[cis]\nexposure_us = -100\n")
    shown, said = asyncio.run(choose("ideal"))
    assert shown == "paper" and session.setup == setup and "exposure_us = -100 in sensor mine.toml" in said[0]
    file.write_text("[cis]\nexposure_us = 100\n")
    assert asyncio.run(choose("ideal")) == ("ideal", []) and session.setup.rig.cameras[0].sensor == "ideal"
    session.close()


def test_files_that_are_saved_and_loaded_are_the_setup() -> None:
    setup = other_scene(setup_of(SMALL))
    other = setup_of(SMALL)
    for name, text in command_of(setup).files.items():
        other = loaded(other, text, name)
    assert [other.spec(k) for k in (0, 1)] == [setup.spec(k) for k in (0, 1)]
    assert other.rig == setup.rig and other.settled() == setup.settled()
    with_sensor = loaded(setup_of(SMALL), sensor_text(setup, 0), "camera.toml")
    assert with_sensor.spec(0) == setup.spec(0) and with_sensor.spec(1) == setup_of(SMALL).spec(1)
    with pytest.raises(OSError, match=r"bad.toml is not valid TOML"):
        loaded(setup, "[dvs", "bad.toml")


def test_every_part_of_a_scene_that_was_loaded_over_another_can_be_changed() -> None:
    """What both have is brought back as the other has it; of what that has not nothing is known but what it is."""
    given = setup_of(SMALL)
    text = command_of(given.with_scene(given.settled())).files["scene.toml"]
    session = Session(loaded(setup_of("scene:room"), text, "given.toml"))
    there = {thing.name for thing in things_of(setup_of("scene:room").settled())}
    parts = [thing.name for thing in things_of(session.setup.settled())]
    assert {"scene", "camera", "objects.disc-1", "lights.sun"} <= {*parts} and "objects.disc-1" not in there
    for name in parts:
        board = SceneBoard(session, name)
        shown = [(board.value(control.key), board.base(control.key)) for control in board.controls]
        assert len(shown) > 3 and (name in there or all(value == base for value, base in shown))
    board = SceneBoard(session, "objects.disc-1")
    board.put("specular", 0.25)
    assert board.value("specular") == board.base("specular") == 0.25
    assert SceneBoard(session, "scene").base("duration_s") == setup_of("scene:room").settled().scene.duration_s
    session.close()


@pytest.mark.parametrize("name", ["spinning-shapes", "specular", "parallax"])
def test_each_control_of_a_scene_takes_what_it_shows_and_is_brought_back(name: str) -> None:
    """A trajectory with a motion more, and a thing that was moved, too."""
    session = Session(setup_of(f"scene:{name}"))
    for thing in things_of(session.setup.settled()):
        board = SceneBoard(session, thing.name)
        for control in board.controls:
            before, shown = board.base(control.key), control.shown(board.value(control.key))
            put = [tuple(shown) if control.kind == "vector" and shown else control.parsed(shown)]
            if control.key == "trajectory":
                put.append(control.parsed(f'[{{ kind = "fixed", position_m = [1, 0, 0] }}, {shown[1:]}'))
            if control.key == "position_m":
                put.append((1.0, 2.0, 3.0))
            for value in put:
                board.put(control.key, value)
                board.put(control.key, before)
                assert board.value(control.key) == before and session.setup.scene is None
    session.close()


def test_a_camera_whose_rotation_is_a_matrix_is_turned_by_its_vector() -> None:
    turned = Pose.of((10.0, -20.0, 30.0)).rotation
    rows = {"rotation": tuple(tuple(row) for row in turned.tolist())}
    session = Session(setup_of(SMALL).with_camera_values(0, rows))
    board = CameraBoard(session, 0)
    assert board.value("rotation_deg") == pytest.approx((10, -20, 30))
    board.put("fov_deg", 50.0)
    camera = session.setup.rig.cameras[0]
    assert camera.fov_deg == 50 and camera.rotation == rows["rotation"]
    board.put("rotation_deg", board.value("rotation_deg"))
    np.testing.assert_allclose(session.setup.rig.cameras[0].pose.rotation, turned, atol=1e-8)
    for wanted in ((10.0, -20.0, 31.0), None):
        board.put("rotation_deg", wanted)
        assert board.value("rotation_deg") == wanted
    assert np.array_equal(session.setup.rig.cameras[0].pose.rotation, np.eye(3))
    session.close()


def test_a_scene_whose_values_are_brought_back_is_that_of_its_file() -> None:
    """Which the command names; there is nothing to save."""
    session = Session(setup_of(SMALL))
    board = SceneBoard(session, "objects.disc-1")
    for key, value in (("specular", 0.25), ("colour", (0.1, 0.2, 0.3))):
        before = board.value(key)
        board.put(key, value)
        assert session.setup.scene is not None and command_of(session.setup).files and before != value
        board.put(key, board.base(key))
        assert session.setup == setup_of(SMALL) and not command_of(session.setup).files
    session.close()


def test_a_rig_and_a_scene_are_loaded_with_the_files_that_they_name_beside_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = '[[camera]]\nname = "own"\nkind = "dvs"\nsensor = "own.toml"\n'
    scene = '[scene]\nduration_s = 0.1\n[[objects]]\nname = "wall"\nkind = "plane"\ntexture = "wall.png"\n'
    (tmp_path / "own.toml").write_text("[dvs]\nthreshold_on = 0.44\n")
    (tmp_path / "rig.toml").write_text(rig)
    (tmp_path / "scene.toml").write_text(scene)
    cv2.imwrite(str(tmp_path / "wall.png"), np.full((8, 8, 3), 90, np.uint8))
    setup, sent = setup_of(SMALL), tmp_path / "sent"
    assert loaded_from(setup, tmp_path / "rig.toml").spec(0).threshold_on == 0.44
    assert loaded_from(setup, tmp_path / "own.toml").spec(0).threshold_on == 0.44
    assert loaded_from(setup, tmp_path / "scene.toml").settled().objects[0].texture == str(tmp_path / "wall.png")
    sent.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(sent))
    for text, name, lacking in ((rig, "rig.toml", "own.toml"), (scene, "scene.toml", "wall.png")):
        with pytest.raises(
            UsageError, match=f"{lacking}.* a browser sends no other files along: give the path of"
        ) as why:
            loaded(setup, text, name)
        assert str(tmp_path) not in str(why.value) and str(why.value).endswith(f"{name} instead")
        assert [*sent.iterdir()] == []
    with pytest.raises(UsageError, match=r"missing.toml: no such file; give a TOML file of"):
        loaded_from(setup, tmp_path / "missing.toml")


@pytest.mark.parametrize("text", ["", "# words\n", "x = 1\n", "[about]\n"])
def test_what_is_no_sensor_rig_or_scene_is_told_so(text: str) -> None:
    with pytest.raises(DataError, match=r"none.toml has none of the tables dvs, cis, .*; give a TOML file of a sensor"):
        loaded(setup_of(SMALL), text, "none.toml")


@pytest.mark.parametrize("name", scene_names())
def test_things_of_each_scene_are_moved_by_as_much_as_was_asked(name: str) -> None:
    scene = read_scene(name).resolved(1)
    for thing in (f"objects.{scene.objects[0].name}", "camera"):
        before = pose_at(thing_named(scene, thing), 0.3)
        after = pose_at(thing_named(moved(scene, thing, (0.1, -0.2, 0.3)), thing), 0.3)
        looks = "look-at" in {motion.kind for motion in thing_named(scene, thing).values.trajectory}
        assert after.rotation == pytest.approx(before.rotation, abs=1.0 if looks else 1e-9)
        assert after.translation_m - before.translation_m == pytest.approx(
            [0.1, -0.2, 0.3], abs=2e-3 if looks else 2e-6
        )
    there = with_place(scene, "camera", (1, 2, 3), (0, 90, 0))
    assert value_of(there, "camera", "position_m") == (1, 2, 3)


@pytest.mark.parametrize("name", scene_names())
def test_each_scene_can_be_converted_as_it_comes(name: str, tmp_path: Path) -> None:
    setup = setup_of(f"scene:{name},size=32x24,duration_s=0.01")
    recipe = Recipe.of(**options_of(setup, tmp_path))
    assert [mount.kind for mount in recipe.mounts] == ["dvs", "cis"]
    assert str(command_of(setup)).startswith(f"vid2ev convert scene:{name},size=32x24")


@pytest.mark.parametrize("name", ["n" * 300 + ".toml", "a\0b", "", "..", "/"])
def test_a_file_is_taken_whatever_a_browser_calls_it(name: str) -> None:
    setup = loaded(setup_of(SMALL), "[dvs]\nthreshold_on = 0.33\n", name)
    assert setup.spec(0).threshold_on == 0.33
    with pytest.raises(DataError, match="is not valid TOML"):
        loaded(setup, "[", name)


def test_files_that_are_edited_are_read_again(tmp_path: Path) -> None:
    scene, sensor, photos = tmp_path / "own.toml", tmp_path / "own_sensor.toml", tmp_path / "photos"
    photos.mkdir()
    cv2.imwrite(str(photos / "b.png"), np.full((8, 8, 3), 90, np.uint8))
    wall = '[[objects]]\nname = "wall"\nkind = "plane"\ntexture = "photos"\n'

    def write(duration_s: float, threshold: float) -> None:
        scene.write_text(f"[scene]\nduration_s = {duration_s}\n[camera]\nsize = [16, 12]\n{wall}")
        sensor.write_text(f"[dvs]\n# measured\nthreshold_on = {threshold}\n")

    def read() -> tuple[float, float, Any]:
        duration_s, values = setup.settled().scene.duration_s, setup.sensor(0).values
        return duration_s, setup.spec(0).threshold_on, values["threshold_on"]

    write(0.5, 0.25)
    setup = setup_of(f"scene:{scene},seed=0").with_preset(0, str(sensor))
    assert read() == (0.5, 0.25, 0.25) and setup.settled().objects[0].texture == str(photos / "b.png")
    write(0.75, 0.375)
    (photos / "b.png").rename(photos / "c.png")
    assert read() == (0.75, 0.375, 0.375) and setup.settled().objects[0].texture == str(photos / "c.png")
    assert duration_s(setup) == setup_of(setup.source).settled().scene.duration_s == 0.75
    session = Session(setup)
    sensor.write_text("[dvs]\nthreshold_on = -1.0\n")
    assert "threshold_on = -1.0 in sensor" in str(session.change(lambda: setup.with_option("seed", 3)))
    assert session.setup == setup
    session.close()


def test_a_changed_scene_keeps_photographs_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "used").mkdir()
    cv2.imwrite(str(tmp_path / "own/wall.png"), np.full((8, 8, 3), 90, np.uint8))
    file = tmp_path / "own/own.toml"
    thing = '[[objects]]\nname = "wall"\nkind = "plane"\ntexture = "wall.png"\n'
    file.write_text(f"[scene]\nduration_s = 0.01\n[camera]\nsize = [16, 12]\n{thing}")
    setup = setup_of(f"scene:{file}")
    setup = setup.with_scene(with_values(setup.settled(), "scene", {"ambient": (0.2, 0.3, 0.4)}))
    source: Any = Recipe.of(**options_of(setup, tmp_path / "used")).source
    assert next(iter(source.frames())).light.shape == (12, 16, 3)


def test_a_scene_is_saved_with_its_files_beside_it(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    for name, code in (("dark", 40), ("light", 200)):
        cv2.imwrite(str(own / f"{name}.png"), np.full((8, 8, 3), code, np.uint8))
    thing = '[[objects]]\nname = "{0}"\nkind = "plane"\ntexture = "{0}.png"\n'
    text = "[scene]\nduration_s = 0.01\n[camera]\nsize = [16, 12]\n"
    (own / "own.toml").write_text(text + thing.format("dark") + thing.format("light"))
    here = tmp_path / "here"
    here.mkdir()
    setup = setup_of(f"scene:{own / 'own.toml'}")
    write_scene(setup.with_scene(setup.settled()), here / SCENE)
    shutil.rmtree(own)
    here.rename(tmp_path / "there")
    saved = tmp_path / "there/scene.toml"
    codes = [int(cv2.imread(thing.texture)[0, 0, 0]) for thing in read_scene(saved).resolved().objects]
    assert codes == [40, 200]
    with pytest.raises(UsageError, match=r"scene.toml exists; --overwrite replaces it"):
        write_scene(setup_of(f"scene:{saved}"), saved)
    settled = read_scene(saved).resolved()
    turned = setup_of(f"scene:{saved}").with_scene(settled.model_copy(update={"objects": settled.objects[::-1]}))
    write_scene(turned, saved, overwrite=True)  # (whose files are where they are to be)
    codes = [int(cv2.imread(thing.texture)[0, 0, 0]) for thing in read_scene(saved).resolved().objects]
    assert codes == [200, 40]


def test_a_scene_of_which_a_file_cannot_be_copied_leaves_nothing(tmp_path: Path) -> None:
    own, here = tmp_path / "own", tmp_path / "here"
    own.mkdir()
    here.mkdir()
    for name in ("first", "second"):
        cv2.imwrite(str(own / f"{name}.png"), np.full((8, 8, 3), 90, np.uint8))
    thing = '[[objects]]\nname = "{0}"\nkind = "plane"\ntexture = "{0}.png"\n'
    (own / "own.toml").write_text("[scene]\nduration_s = 0.01\n" + thing.format("first") + thing.format("second"))
    setup = setup_of(f"scene:{own / 'own.toml'}")
    (own / "second.png").unlink()
    with pytest.raises(DataError, match=r"scene.toml cannot be written: No such file or directory"):
        write_scene(setup, here / "scene.toml")
    assert [*here.iterdir()] == []
    with pytest.raises(DataError, match="File name too long; choose another place"):
        write_scene(setup, here / ("n" * 300 + ".toml"))


def test_without_the_extra_or_a_free_port_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("importlib.util.find_spec", lambda name: None)
        refused = CliRunner().invoke(gui, [SMALL]).exception
    assert isinstance(refused, UsageError) and "pip install 'vid2ev[gui]'" in str(refused)
    pytest.importorskip("nicegui", reason="the extra gui is not installed")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        refused = CliRunner().invoke(gui, [SMALL, "--port", str(taken.getsockname()[1])]).exception
    assert isinstance(refused, UsageError) and "give another --port, or 0" in str(refused)
    for host in ("a..b", 70 * "x" + ".org"):
        refused = CliRunner().invoke(gui, [SMALL, "--host", host, "--port", "0"]).exception
        assert isinstance(refused, UsageError) and "is no name that a machine can have" in str(refused)


@pytest.mark.parametrize("size", ["9", "[9, 9, 9]", "[9, 9, 0]"])
def test_a_plane_is_thin_in_the_3d_view(size: str, tmp_path: Path) -> None:
    pytest.importorskip("nicegui", reason="the extra gui is not installed")
    from vid2ev.gui.stage import THIN_M, extents_m

    file = tmp_path / "wall.toml"
    file.write_text(f'[[objects]]\nkind = "plane"\nsize_m = {size}\n[[objects]]\nkind = "box"\nsize_m = {size}\n')
    wall, box = read_scene(file).resolved().objects
    assert extents_m(wall) == (9, 9, THIN_M)
    assert extents_m(box) == (9, 9, max(box.size_m[2], THIN_M))


def test_addresses_of_version_6_are_served(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("nicegui", reason="the extra gui is not installed")
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no addresses of version 6")
    served: list[tuple[str, int]] = []
    monkeypatch.setattr("vid2ev.gui.page.serve", lambda setup, host, port, show: served.append((host, port)))
    said = CliRunner().invoke(gui, [SMALL, "--host", "::1", "--port", "0", "--no-browser"])
    assert said.exit_code == 0 and served[0][0] == "::1" and f"http://[::1]:{served[0][1]}  (" in said.output


def test_what_lacks_an_option_is_served_and_what_cannot_be_read_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("nicegui", reason="the extra gui is not installed")
    served: list[Setup] = []
    monkeypatch.setattr("vid2ev.gui.page.serve", lambda setup, *_: served.append(setup))
    cv2.imwrite(str(tmp_path / "photo.png"), np.full((8, 8, 3), 90, np.uint8))
    (tmp_path / "torn.mp4").write_bytes(b"nothing that is a video")
    for name in (tmp_path, tmp_path / "photo.png"):
        assert CliRunner().invoke(gui, [str(name), "--port", "0"]).exit_code == 0
    assert [setup.source for setup in served] == [str(tmp_path), str(tmp_path / "photo.png")]
    refused = CliRunner().invoke(gui, [str(tmp_path / "torn.mp4")]).exception
    assert isinstance(refused, DataError) and "not a video that can be read" in str(refused) and len(served) == 2
    refused = CliRunner().invoke(gui, ["synthetic:ramps", "--port", "0"]).exception
    assert isinstance(refused, UsageError) and "expected one of ramp, " in str(refused) and len(served) == 2


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1:80", "", 200),
        ("[::1]:80", "http://[::1]:80", 200),
        ("localhost", "http://localhost", 200),
        ("127.0.0.1:80", "http://127.0.0.1:81", 403),
        ("127.0.0.1:80", "null", 403),
        ("127.0.0.1:80", "http:127.0.0.1", 403),
        ("evil.example", "", 403),
    ],
)
def test_pages_of_others_are_not_served(host: str, origin: str, status: int) -> None:
    sent: list[Any] = []

    async def page(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200})

    async def send(message: Any) -> None:
        sent.append(message)

    headers = [(b"host", host.encode()), *([(b"origin", origin.encode())] if origin else [])]
    for served in ("127.0.0.1", "localhost", "127.0.0.2", "::1", "LocalHost"):
        asyncio.run(Guard(page, served)({"type": "http", "headers": headers}, None, send))
    assert [message["status"] for message in sent if "status" in message] == 5 * [status]


@pytest.mark.parametrize("error", [RuntimeError("No response returned."), KeyError("REQUEST_METHOD")])
def test_an_answer_to_nobody_is_no_error_of_the_program(error: Exception) -> None:
    def told(what: Exception | None) -> bool:
        info = None if what is None else (type(what), what, None)
        return Unanswered().filter(logging.LogRecord("uvicorn.error", logging.ERROR, "", 0, "", (), info))

    assert not told(error)
    assert told(None) and told(RuntimeError("anything else")) and told(KeyError("name"))


def test_a_page_for_the_network_is_served_under_any_name() -> None:
    assert not any(is_loopback(host) for host in ("0.0.0.0", "192.168.0.2", "evil.example", "127.0.0.1.evil.example"))


def test_a_recording_of_the_page_is_compared_by_its_own_folder(tmp_path: Path) -> None:
    events = Events(np.array([0, 700, 900]), *(np.zeros(3, kind) for kind in (np.uint16, np.uint16, np.uint8)))
    for camera in ("dvs", "cis"):  # (what a conversion leaves, as far as it is looked at)
        (tmp_path / camera).mkdir()
        (tmp_path / camera / "manifest.json").write_text("{}")
    write_events(tmp_path / "dvs" / "events.h5", Recording((4, 3), 0, 900, 3, lambda: iter([events])))
    found = [gathered(lambda *_: None, str(folder)) for folder in (tmp_path, tmp_path / "dvs")]
    assert found[0].as_dict() == found[1].as_dict() and found[0].shortest_us == 200


@pytest.mark.parametrize("name", ["later.csv", "later.raw"])
def test_a_recording_that_says_no_beginning_is_looked_at_from_its_first_event_on(tmp_path: Path, name: str) -> None:
    """As it is by compare --statistics: a camera's clock may be 0 long before it records."""
    events = "".join(f"{10_000_000 + 1000 * k},{k % 5},{k % 3},1\n" for k in range(1001))
    (tmp_path / "later.csv").write_text(f"t,x,y,p\n{events}")
    if name == "later.raw":
        reformat(tmp_path / "later.csv", tmp_path / name)
        said = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(said.replace(b"% start_us 0\n", b""))
    found = gathered(lambda *_: None, str(tmp_path / name))
    assert found.span_us == (10_000_000, 11_000_000) and found.rate_hz == pytest.approx(1001 / 15)
    alone = compare_recordings(tmp_path / name, tmp_path / name, statistics=True).alone
    assert alone and alone[0].as_dict() == found.as_dict()
