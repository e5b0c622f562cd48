"""Presets and sensor files: what they promise, and every way to get them wrong."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.plan.plan import EFFECTS
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.presets import CIS, DVS, Kind, load, load_cis, load_sensor, preset_names, read_sensor
from vid2ev.sensors.record import changed
from vid2ev.sensors.spec import DvsSpec

NAMES = preset_names()


def test_the_presets_that_the_project_promises_are_there() -> None:
    promised = {"ideal", "paper", "v2e-clean", "v2e-noisy", "davis346", "dvxplorer"}
    assert promised | {"prophesee-gen31", "prophesee-gen41", "imx636"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_a_preset_has_a_source(name: str) -> None:
    sensor = read_sensor(name)
    assert set(sensor.sources) == set(sensor.values)
    assert sensor.about["title"] and sensor.about["sources"]
    # A source is a phrase, not the leftover of a comment that was cut.
    assert all(len(source) > 10 for source in sensor.sources.values())


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_states_every_effect_that_is_on_by_default(name: str) -> None:
    on_by_default = {key for effect in DvsSpec().effects() for key in EFFECTS[effect].off}
    assert {"mismatch", "refractory_us"} <= on_by_default
    assert on_by_default <= set(read_sensor(name).values)


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_loads_to_the_values_it_states(name: str) -> None:
    spec = load_sensor(name)
    for key, value in read_sensor(name).values.items():
        assert getattr(spec, key) == (tuple(value) if isinstance(value, list) else value)


def test_the_paper_preset_is_the_default_sensor() -> None:
    assert load_sensor("paper") == DvsSpec()


def test_the_ideal_preset_has_no_imperfection() -> None:
    spec = load_sensor("ideal")
    assert spec.effects() == [] and not spec.random_phase


def test_v2e_noisy_has_the_published_corner_frequency_at_white() -> None:
    tau_s = load_sensor("v2e-noisy").photoreceptor_tau_us * 1e-6
    assert 1 / (2 * math.pi * tau_s) == pytest.approx(30, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("threshold_on=0.2", "threshold_on", 0.2),
        ("dvs.threshold_on = 0.2", "threshold_on", 0.2),
        ("threshold_on=.2", "threshold_on", 0.2),
        ("threshold_on=2e-1", "threshold_on", 0.2),
        ("refractory_us=250", "refractory_us", 250.0),
        ("random_phase=false", "random_phase", False),
        ("filter=after", "filter", "after"),
        ('filter="after"', "filter", "after"),
        ("shading=[0, -0.3]", "shading", (0.0, -0.3)),
    ],
)
def test_an_override_is_understood(text: str, key: str, value: object) -> None:
    assert getattr(load_sensor("davis346", [text]), key) == value


def test_the_last_override_wins_and_the_others_stay() -> None:
    spec = load_sensor("davis346", ["mismatch=0.1", "leak_rate_hz=2", "mismatch=0.2"])
    assert (spec.mismatch, spec.leak_rate_hz) == (0.2, 2.0)
    assert spec.model_copy(update={"mismatch": 0.03, "leak_rate_hz": 0.1}) == load_sensor("davis346")


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("treshold_on=0.2", ["treshold_on", "did you mean threshold_on"]),
        ("cis.bits=8", ["cis.bits", "unknown"]),
        ("threshold_on=-1", ["threshold_on = -1", "greater than 0", "0.15"]),
        ("threshold_on=0", ["threshold_on = 0", "greater than 0"]),
        ("threshold_on=1e-30", ["threshold_on = 1e-30", "at least 1e-06 nat"]),
        ("threshold_on=true", ["threshold_on = true", "a number", "0.15"]),
        ("threshold_on=nan", ["threshold_on = nan"]),
        ("threshold_on=inf", ["threshold_on = inf"]),
        ("threshold_on=big", ["threshold_on = 'big'", "number"]),
        ("threshold_on=", ["threshold_on=", "key=value"]),
        ("threshold_on", ["threshold_on", "key=value"]),
        ("=3", ["=3", "key=value"]),
        ("threshold_on=1\nmismatch=2", ["threshold_on", "number"]),
        ("hot_probability=1.5", ["hot_probability = 1.5", "less than or equal to 1"]),
        ("filter=beside", ["filter = 'beside'", "'before' or 'after'"]),
        ("random_phase=maybe", ["random_phase = 'maybe'", "it must be a valid boolean (default true)"]),
        ("shading=[0, a]", ["shading"]),
        ("shading=3", ["shading = 3", "it must be a list (default [])"]),
        ("shading=[0, true]", ["shading = [0, true]", "a list of numbers (default [])"]),
        ("frame_rate_hz=-5", ["frame_rate_hz = -5", "greater than or equal to 0"]),
    ],
)
def test_a_wrong_override_is_refused_in_one_sentence(override: str, parts: list[str]) -> None:
    with pytest.raises(UsageError) as refusal:
        load_sensor("paper", [override])
    sentence = str(refusal.value)
    assert all(part in sentence for part in parts), sentence
    assert "pydantic" not in sentence and sentence.endswith(".")
    if "\n" not in override:
        assert "\n" not in sentence


@pytest.mark.parametrize("kind", [DVS, CIS])
def test_true_is_neither_a_number_nor_a_word(kind: Kind) -> None:
    fields = kind.spec.model_fields
    for key in [key for key, field in fields.items() if field.annotation is not bool]:
        with pytest.raises(UsageError, match=rf"^{key} = [tT]rue in sensor ideal is impossible: it must be "):
            load(kind, "ideal", [f"{key}=true"])
    assert len(fields) > 15


@pytest.mark.parametrize("kind", [DVS, CIS])
@pytest.mark.parametrize("text", ["1e20", "-1e20", "123456789012345678901234567890", "1.5", "inf", "some"])
def test_of_whole_numbers_that_cannot_be_it_is_said_what_can(kind: Kind, text: str) -> None:
    whole = [key for key, field in kind.spec.model_fields.items() if field.annotation is int]
    assert whole
    for key in whole:
        with pytest.raises(UsageError, match=rf"^{key} = .* in sensor ideal is impossible: it must be [^,]*\.$"):
            load(kind, "ideal", [f"{key}={text}"])


@pytest.mark.parametrize(("value", "expected"), [("foo", "a valid number"), ("50", "less than or equal to 10")])
def test_of_a_value_that_may_be_a_number_or_a_word_both_are_said(value: str, expected: str) -> None:
    with pytest.raises(UsageError, match=rf"gamma = .* is impossible: it must be {expected} or 'srgb' "):
        load_cis("ideal", [f"gamma={value}"])
    with pytest.raises(UsageError, match=rf"gamma={value}: it must be {expected} or 'srgb'$"):
        changed(load_cis("ideal"), {"gamma": value})
    with pytest.raises(UsageError, match=r"shading = 'a' .* it must be a valid number \(default"):
        load_cis("ideal", ["shading=['a', 'b']"])


def test_values_that_do_not_go_together_are_refused_in_one_sentence() -> None:
    with pytest.raises(UsageError, match=r"^The values in sensor ideal do not go together: photoreceptor_noise.*\.$"):
        load_sensor("ideal", ["photoreceptor_noise=0.1"])


def test_an_unknown_preset_is_refused_with_the_names_and_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"davis364.*did you mean davis346\?.*ideal.*paper"):
        load_sensor("davis364")


@pytest.mark.parametrize(("kind", "other", "option"), [(DVS, CIS, "--cis"), (CIS, DVS, "--sensor")])
def test_a_file_of_the_other_kind_is_said_to_be_one(kind: Kind, other: Kind, option: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f"[{other.table}]\n")
    with pytest.raises(UsageError, match=rf"mine.toml is of another kind, \[{other.table}\]: .* {option}, "):
        read_sensor(file, kind)
    file.write_text("[dvs]\n[cis]\n")
    with pytest.raises(UsageError, match=r"tables \[dvs\] and \[cis\]: expected one sensor; give each its own file"):
        read_sensor(file, kind)


@pytest.mark.parametrize(("kind", "other", "option"), [(DVS, CIS, "--cis"), (CIS, DVS, "--sensor")])
def test_presets_and_keys_of_the_other_kind_are_said_to_be_its(kind: Kind, other: Kind, option: str) -> None:
    """Also in the table `set` of a camera, whose keys have no kind before them."""
    for name in {*other.names()} - {*kind.names()}:
        with pytest.raises(UsageError, match=rf"^Sensor '{name}' is of another kind, {other.table}: .* {option}, or "):
            load(kind, name)
    for key in {*other.spec.model_fields} - {*kind.spec.model_fields}:
        meant = rf"'{key}' in sensor ideal is unknown \(did you mean {other.table}\.{key}, of cameras of that kind\?\)"
        with pytest.raises(UsageError, match=meant):
            load(kind, "ideal", [f"{key}=1"])


@pytest.mark.parametrize("name", ["", "../paper", "paper.toml", "no/such.toml", "."])
def test_what_is_no_sensor_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError):
        load_sensor(name)


def test_a_file_of_ones_own_with_overrides(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[about]\ntitle = "mine"\n\n[dvs]\n# measured\nthreshold_on = 0.3\nshading = [0, -0.1]\n')
    spec = load_sensor(path, ["threshold_off=0.4"])
    assert (spec.threshold_on, spec.threshold_off, spec.shading) == (0.3, 0.4, (0.0, -0.1))
    assert spec.mismatch == DvsSpec().mismatch
    assert read_sensor(path).sources == {"threshold_on": "measured"}


@pytest.mark.parametrize(
    ("content", "kind", "parts"),
    [
        (b"[dvs]\nthreshold_on = = 2\n", DataError, ["line 2"]),
        (b"[dvs]\nmismatch = \xff\n", DataError, ["UTF-8"]),
        (b"threshold_on = 0.3\n", UsageError, ["threshold_on", "[dvs]"]),
        (b"", UsageError, ["[dvs]"]),
        (b"dvs = 3\n", UsageError, ["[dvs]"]),
        (b"[dvs]\nthreshold = 0.3\n", UsageError, ["threshold", "did you mean"]),
        (b"[dvs]\nmismatch = -0.1\n", UsageError, ["mismatch = -0.1"]),
        (b"[dvs]\n[cis]\n", UsageError, ["cis"]),
    ],
)
def test_a_wrong_file_is_refused_in_one_sentence(
    content: bytes, kind: type[Exception], parts: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    with pytest.raises(kind) as refusal:
        load_sensor(path)
    sentence = str(refusal.value)
    assert str(path) in sentence and all(part in sentence for part in parts), sentence
    assert "\n" not in sentence


def test_a_folder_named_like_a_sensor_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").mkdir()
    with pytest.raises(UsageError, match="does not exist"):
        load_sensor(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("name", "shortest_us", "longest_us"),
    [
        pytest.param("davis346", 20, 20, marks=pytest.mark.slow),  # (a pixel of its own, compiled for 20 s)
        pytest.param("prophesee-gen31", 40, 200, marks=pytest.mark.long),
        ("prophesee-gen41", 20, 150), ("imx636", 0, 100),
    ],
)  # fmt: skip
def test_a_camera_in_bright_light_has_its_published_latency(name: str, shortest_us: int, longest_us: int) -> None:
    """The first event after the light doubles at once; published latencies as cited in the presets."""
    certain = ["random_phase=false", "mismatch=0", "crossing_noise=0", "hot_probability=0", "shot_rate_hz=0"]
    dvs = Dvs(load_sensor(name, certain), (1, 1))
    dvs.step(np.full((1, 1), 0.5, np.float32), 0)
    dvs.step(np.full((1, 1), 1.0, np.float32), 1)
    first = dvs.step(np.full((1, 1), 1.0, np.float32), 1_000_000).t[0]
    assert 0.8 * shortest_us <= first <= 2 * longest_us
