"""Every field of a specification has a control that can show its values and read them back."""

from __future__ import annotations

import pytest
from pydantic import BaseModel

from vid2ev.gui.controls import Control, controls_of, reach
from vid2ev.rig.camera import Camera, Source
from vid2ev.scenes import scene
from vid2ev.scenes.trajectory import Fixed
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.presets import CIS, DVS, Kind, load
from vid2ev.sensors.spec import DvsSpec

MODELS = [DvsSpec, CisSpec, Camera, Source, scene.Setting, scene.Camera, scene.Object, scene.LightSource, Fixed]


def named(model: type[BaseModel], key: str) -> Control:
    return next(control for control in controls_of(model) if control.key == key)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: f"{model.__module__}.{model.__name__}")
def test_each_field_has_a_control_that_says_what_it_means(model: type[BaseModel]) -> None:
    controls = [control for control in controls_of(model) if (model, control.key) != (Fixed, "kind")]
    assert {control.key for control in controls} >= set(model.model_fields) - {"kind"}
    for control in controls:
        assert control.meaning and "[" not in control.label
        assert control.kind != "choice" or len(control.choices) > 1
        assert control.kind != "vector" or control.places in (2, 3)
    assert len({control.label for control in controls}) == len(controls)


@pytest.mark.parametrize("kind", [DVS, CIS], ids=lambda kind: kind.table)
def test_what_is_shown_of_each_preset_is_read_back(kind: Kind) -> None:
    for name in kind.names():
        spec = load(kind, name)
        for control in controls_of(kind.spec):
            value = getattr(spec, control.key)
            read = control.parsed(control.shown(value))
            assert read == (pytest.approx(value, rel=1e-5) if isinstance(value, float) else value)


@pytest.mark.parametrize("kind", [DVS, CIS], ids=lambda kind: kind.table)
def test_a_slider_goes_over_values_that_can_be_and_past_the_one_in_use(kind: Kind) -> None:
    base = kind.spec()
    for control in controls_of(kind.spec):
        value = getattr(base, control.key)
        span = reach(control, [value])
        assert (span is None) == (control.kind not in ("number", "whole"))
        if span:
            low, high, step = span
            kind.spec(**{control.key: type(value)(low)})
            kind.spec(**{control.key: type(value)(high)})
            assert low <= value <= high or value == 0
            assert 0 < step <= (high - low) / 5 and (high > value or high == control.high)


def test_limits_units_and_words_are_those_of_the_field() -> None:
    threshold = named(DvsSpec, "threshold_on")
    assert (threshold.kind, threshold.unit, threshold.label) == ("number", "nat", "threshold on")
    assert threshold.limits == "above 0, at most 100" and threshold.group == "Comparator"
    assert named(DvsSpec, "refractory_us").unit == "us" and named(CisSpec, "bits").kind == "whole"
    assert named(DvsSpec, "timing").choices == ("response", "linear", "frame")
    assert named(Camera, "translation_mm").places == 3 and named(Camera, "fov_deg").optional


def test_what_cannot_be_read_is_refused_in_a_sentence() -> None:
    with pytest.raises(ValueError, match="threshold_on is empty; enter a value above 0"):
        named(DvsSpec, "threshold_on").parsed(None)
    assert named(Camera, "fov_deg").parsed("") is None
    gamma = named(CisSpec, "gamma")
    assert (gamma.parsed("srgb"), gamma.parsed("2.2"), gamma.shown("srgb"), gamma.shown(2.2)) == (
        "srgb",
        2.2,
        "srgb",
        "2.2",
    )
    assert named(DvsSpec, "shading").parsed("[0.1, -0.2]") == (0.1, -0.2)
    assert named(CisSpec, "bits").parsed(12.0) == 12
