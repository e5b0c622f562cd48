"""Scene files: what they mean, that they survive being written, and what is said of those that are none."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.scenes.scene_file import SceneFile, read_scene, scene_names
from vid2ev.scenes.textures import PHOTOGRAPHS, Pattern, pixels_of
from vid2ev.toml_text import toml_text

FILE = """
[about]
title = "a test"

[scene]
duration_s = { uniform = [1, 2] }
ambient = 0.5

[camera]
size = [64, 48]
trajectory = { kind = "shake" }

[[objects]]
name = "box"
kind = "box"
count = { integer = [3, 6] }
size_m = { uniform = [0.1, 0.3] }
texture = "photographs"
trajectory = [
    { kind = "straight", position_m = { spread = [[-1, -1, 2], [1, 1, 3]] }, velocity_m_s = { direction = 1.0 } },
    { kind = "spin", axis = { direction = 1 }, rate_deg_s = { normal = [90, 20] } },
]

[[objects]]
kind = "plane"
texture = { pattern = "noise", seed = { integer = [0, 9999] } }

[[lights]]
name = "lamp"
kind = "point"
flicker = { frequency_hz = { log_uniform = [50, 200] } }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(FILE)
    return file


def test_there_are_eight_scenes_and_each_says_what_it_is() -> None:
    assert set(scene_names()) == {
        "flying-shapes",
        "spinning-shapes",
        "parallax",
        "room",
        "close-object",
        "flicker",
        "specular",
        "low-light",
    }
    for name in scene_names():
        assert read_scene(name).title()


@pytest.mark.parametrize("name", ["flying-shapes", "room", "flicker"])
def test_a_resolved_scene_survives_its_file(name: str, tmp_path: Path) -> None:
    scene = read_scene(name).resolved(5)
    file = tmp_path / "resolved.toml"
    file.write_text(toml_text(scene.tables()), encoding="utf-8")
    again = read_scene(file)
    assert again.resolved(0) == again.resolved(99) == scene != read_scene(name).resolved(6)


def test_things_with_a_count_are_that_many(path: Path) -> None:
    counts = {len(read_scene(path).resolved(seed).objects) - 1 for seed in range(40)}
    assert counts == {3, 4, 5, 6}
    names = [thing.name for thing in read_scene(path, ["objects.box.count=3"]).resolved(0).objects]
    assert names == ["box-1", "box-2", "box-3", "plane-1"]
    sizes = {thing.size_m for thing in read_scene(path).resolved(0).objects}
    assert len(sizes) == len(read_scene(path).resolved(0).objects)


def test_a_change_of_one_range_leaves_all_other_draws_alone(path: Path) -> None:
    plain = read_scene(path).resolved(4)
    changed = read_scene(path, ["objects.box.size_m={ uniform = [1, 2] }", "lights.lamp.shadows=true"]).resolved(4)
    assert changed.scene == plain.scene and changed.lights[0].flicker == plain.lights[0].flicker
    assert [thing.trajectory for thing in changed.objects] == [thing.trajectory for thing in plain.objects]
    assert [thing.texture for thing in changed.objects] == [thing.texture for thing in plain.objects]
    assert all(1 <= thing.size_m[0] <= 2 for thing in changed.objects[:-1])


def test_settings_reach_every_key(path: Path) -> None:
    settings = ["duration_s=3", "camera.fov_deg=70", "objects.plane-1.texture=cat", "lights.lamp.flicker.depth=0.5"]
    with pytest.raises(UsageError, match=r"no 'plane-1'; objects are box, 1"):
        read_scene(path, settings)
    settings[2] = "objects.1.texture=cat"
    scene = read_scene(path, settings).resolved(0)
    assert scene.scene.duration_s == 3 and scene.camera.fov_deg == 70
    assert scene.objects[-1].texture == "cat"
    assert scene.lights[0].flicker is not None and scene.lights[0].flicker.depth == 0.5


def test_files_are_found_beside_the_scene_file(tmp_path: Path) -> None:
    photographs = tmp_path / "photos"
    photographs.mkdir()
    for k in range(3):
        cv2.imwrite(str(photographs / f"{k}.png"), np.full((4, 5, 3), 50 * k, np.uint8))
    file = tmp_path / "mine.toml"
    file.write_text('[[objects]]\nname = "a"\nkind = "plane"\ncount = 12\ntexture = "photos"\n')
    scene = read_scene(file).resolved(1)
    assert {Path(str(thing.texture)).name for thing in scene.objects} == {"0.png", "1.png", "2.png"}
    assert pixels_of(str(scene.objects[0].texture)).shape == (4, 5, 3)
    for bad in ("photos/none.png", "phot"):
        with pytest.raises(UsageError, match=r"objects.a-1.texture = .*no such file"):
            read_scene(file, [f"objects.a.texture={bad}"])
    for bad in ("none.png", f"{photographs}/none.png"):
        with pytest.raises(UsageError, match=f"environment = '{bad}': no such file in {(tmp_path / bad).parent}"):
            read_scene(file, [f"environment={bad}"])


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("foo=1", "key 'scene.foo' is unknown; the keys are duration_s, background, environment"),
        ("camera.foo=1", "key 'camera.foo' is unknown; the keys are size, fov_deg"),
        ("objects.box.foo=1", "foo' is unknown; the keys are name, kind, file, size_m"),
        ("lights.lamp.flicker.foo=1", "foo' is unknown; the keys are frequency_hz, depth, phase_deg"),
        ('objects.box.texture={ pattern = "checker", foo = 1 }', "foo' is unknown; the keys are pattern, colours"),
        ('environment={ pattern = "sky", foo = 1 }', "foo' is unknown; the keys are pattern, colours"),
        ('environment={ pattern = "sky", count = 0 }', "environment.count = 0 is impossible"),
        ("duration=1", "did you mean duration_s?"),
        ("lights.lamp.name=''", "lights.0.name = '' is impossible: it must not be empty"),
        ("objects.bx.count=2", "no 'bx' (did you mean box?)"),
        ("objects.box.colour=red", "objects.box-1.colour = 'red'"),
        ("objects.box.count=1.5", "objects.box.count = 1.5: expected a whole number"),
        ("objects.box.count=100000", "from 0 to 1000"),
        ("objects.box.kind=cone", "objects.box-1.kind = 'cone' is impossible: it must be 'plane', 'box'"),
        ("objects.box.kind=mesh", "a mesh needs a file"),
        ("objects.box.size_m=-1", "greater than or equal to 0"),
        ('objects.box.trajectory={ kind = "fly" }', "must be one of fixed, straight"),
        ("objects.box.trajectory={ a = 1 }", "has no kind"),
        ('objects.box.trajectory={ kind = "spin" }', "rate_deg_s is missing"),
        (
            'objects.box.trajectory={ kind = "spin", rate_deg_s = 1, wobble = 3 }',
            "the keys are axis, phase_deg, kind, rate",
        ),
        ('objects.box.texture={ pattern = "dots" }', "it must be 'checker', 'stripes'"),
        ("objects.box.texture=catt", "did you mean cat?"),
        ("camera.fov_deg={ uniform = [50, 500] }", "camera.fov_deg"),
        ("camera.focal_px=[0, 1]", "focal lengths must be greater than 0"),
        ("camera.size=3", "camera.size = 3"),
        ("camera.size=[100000, 2]", "1 to 16384"),
        ("camera.size.z=2", "is no table"),
        ("lights.lamp.flicker.depth=2", "less than or equal to 1"),
        ("lights.lamp.kind=sun", ""),
        ("lights.lamp.direction=[0, 1e300, 0]", "lights.lamp.direction.1 = 1e+300 is impossible"),
        ("min_fps=1e5", "above max_fps"),
        ("duration_s={ uniform = [3] }", "expected two ends"),
        ("duration_s=1979-05-27", "must be a valid number"),
        ("about.titel=x", "did you mean title?"),
        ("duration_s", "not of the form key=value"),
        ("=3", "not of the form key=value"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_sentence(path: Path, setting: str, said: str) -> None:
    if not said:  # (a lamp of any kind may say more than it needs)
        assert read_scene(path, [setting]).resolved(0).lights[0].kind == "sun"
        return
    with pytest.raises(UsageError) as refused:
        read_scene(path, [setting])
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_kind_left_to_chance_has_no_part_in_other_draws(tmp_path: Path) -> None:
    sizes = set()
    for kinds in ('["box"]', '["box", "sphere"]', '["sphere", "cylinder", "box"]'):
        file = tmp_path / "any.toml"
        file.write_text(f"[[objects]]\nkind = {{ choice = {kinds} }}\nsize_m = {{ uniform = [1, 2] }}\n")
        sizes.add(read_scene(file).resolved(3).objects[0].size_m)
    assert len(sizes) == 1


def test_no_name_is_that_of_one_of_several(tmp_path: Path) -> None:
    file = tmp_path / "boxes.toml"
    for count, name, taken in ((2, "box-2", True), (1, "box-2", False), (2, "box-3", False)):
        file.write_text(
            f'[[objects]]\nname = "box"\nkind = "box"\ncount = {count}\n[[objects]]\nname = "{name}"\nkind = "box"\n'
        )
        if taken:
            with pytest.raises(UsageError, match=r"objects\.box-2: one of several of a count has this name"):
                read_scene(file)
        else:
            assert len({thing.name for thing in read_scene(file).resolved(0).objects}) == count + 1


def test_a_key_of_another_table_is_no_hint_at_itself(path: Path) -> None:
    with pytest.raises(UsageError, match=r"key 'scene.colour' is unknown(?! \(did you mean colour\?\))"):
        read_scene(path, ["colour=1"])


def test_numbers_of_settings_are_as_people_write_them() -> None:
    """.5 and 5. are none in TOML; as those of sensors they are numbers here, too."""
    for written, number in ((".5", 0.5), ("+.25e1", 2.5), ("5.", 5.0), ("1_0", 10)):
        assert read_scene("room", [f"duration_s={written}"]).resolved(0).scene.duration_s == number


def test_a_scene_without_lamps_says_so_where_one_is_to_be_changed(tmp_path: Path) -> None:
    (tmp_path / "dark.toml").write_text("[scene]\nambient = 1\n")
    with pytest.raises(UsageError, match=r"no 'lamp'; the scene has no lights$"):
        read_scene(tmp_path / "dark.toml", ["lights.lamp.shadows=true"])


def test_files_that_are_no_scene(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("[scene\n")
    with pytest.raises(DataError, match="not valid TOML"):
        read_scene(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="not UTF-8"):
        read_scene(broken)
    broken.write_text("objects = 3")
    with pytest.raises(UsageError, match=r"objects = 3: expected tables, each under a line \[\[objects\]\]"):
        read_scene(broken)
    broken.write_text('[[lights]]\nname = "a"\nkind = "sun"\n' * 2)
    with pytest.raises(UsageError, match=r"lights\.a: 2 have this name"):
        read_scene(broken)
    with pytest.raises(UsageError, match=r"scene 'rooom' is unknown \(did you mean room\?\)"):
        read_scene("rooom")
    with pytest.raises(UsageError, match="does not exist"):
        read_scene(tmp_path / "none.toml")
    with pytest.raises(UsageError, match="seed -1"):
        read_scene("room").resolved(-1)


VALUES = st.recursive(
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(st.text(), st.dictionaries(st.text(), VALUES, max_size=4), max_size=4))
def test_toml_text_is_read_back_as_it_was(tables: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(tables)) == tables


@given(VALUES)
def test_any_value_anywhere_is_taken_or_refused(value: Any) -> None:
    tables = tomllib.loads(FILE)
    for place, key in ((tables, "objects"), (tables["objects"][0], "trajectory"), (tables["scene"], "duration_s")):
        before, place[key] = place[key], value
        try:
            SceneFile("fuzz", Path("fuzz.toml"), tables).check()
        except UsageError as error:
            assert "\n" not in str(error)
        place[key] = before


def test_photographs_are_there_and_patterns_are_what_they_say() -> None:
    for name in PHOTOGRAPHS:
        pixels = pixels_of(name)
        assert pixels.dtype == np.float32 and pixels.shape[2] == 3 and 0 <= pixels.min() < pixels.max() <= 1
    checker = pixels_of(Pattern(pattern="checker", count=4, size_px=8, colours=((0, 0, 0), (1, 1, 1))))[..., 0]
    assert checker[:2, :2].max() == 0 and checker[:2, 2:4].min() == 1 and checker.mean() == 0.5
    soft = pixels_of(Pattern(pattern="stripes", count=3, soft=True, size_px=96, colours=((0, 0, 0), (1, 1, 1))))
    spectrum = np.abs(np.fft.rfft(soft[0, :, 0]))
    assert np.argsort(spectrum)[-2:].tolist() == [3, 0] and spectrum[4:].max() < 1e-3
    noises = [pixels_of(Pattern(pattern="noise", seed=seed, size_px=256, roughness=1.5))[..., 1] for seed in range(8)]
    power = np.mean([np.abs(np.fft.rfft2(noise)) ** 2 for noise in noises], axis=0)
    halvings = np.log2(power[8:16, 8:16].mean() / power[16:32, 16:32].mean())
    assert 1.35 < halvings / 2 < 1.65  # (of the amplitude, for a doubled frequency)
    assert not np.array_equal(noises[0], noises[1])
