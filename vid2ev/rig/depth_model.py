"""Depth from single pictures, by a monocular model of the package transformers (`pip install 'vid2ev[depth]'`).

    model:depth-anything/Depth-Anything-V2-Small-hf     a name on the Hugging Face hub, downloaded at its first use
    model:FOLDER                                        a folder with config.json, weights, preprocessor_config.json

Any model for depth estimation that `AutoModelForDepthEstimation` loads will do.  Most give relative depth v, which
grows with nearness but has no unit: 1 / Z = scale v + shift.  Nobody knows scale and shift but the user, who has to
give the scale: two distances Z1, Z2 measured in the scene at places with v1, v2 give both.  Models of metric depth
(`depth_estimation_type` "metric", ZoeDepth, GLPN, Depth Pro) need neither.

The model sees a picture as sRGB of 8 bits, light above 1 as white, and the map comes back in the picture's size.  It is
run once for each frame of the video; depth in between is interpolated.

Source: L. Yang et al., "Depth Anything V2", NeurIPS 2024; the checkpoint named above has the licence Apache 2.0.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.transfer import parse_transfer
from vid2ev.rig.depth import DepthScale, Kind
from vid2ev.untrusted import first_line

EXAMPLE = "depth-anything/Depth-Anything-V2-Small-hf"
METRIC = ("zoedepth", "glpn", "depth_pro")
PATIENCE_S = 10.0  # for the hub to say whether it has a model


class ModelDepth:
    """Depth maps that a model makes of the frames.

    kind    what its numbers were said to be, if that was said

    Raises UsageError without the package, without a scale where the model is relative, or where its numbers are of
    another kind; DataError for a model that cannot be loaded.
    """

    plane_m: float | None = None
    count: int | None = None

    def __init__(self, name: str, size: tuple[int, int], scale: DepthScale, kind: Kind | None = None):
        if not name:
            raise UsageError(f"depth 'model:' without a name; expected a folder or a name, such as model:{EXAMPLE}")
        self.name, self.size = name, size
        self._processor, self._model = _loaded(name)
        metric = is_metric(self._model.config)
        if not metric and scale.scale is None:
            raise UsageError(f"model:{name} gives relative depth v; give the scale in 1 / Z = scale v + shift")
        own: Kind = "depth" if metric else "inverse"
        if kind not in (None, own):
            raise UsageError(f"model:{name} gives numbers of kind '{own}', not '{kind}'; leave kind and baseline_m out")
        self.scale = replace(scale, kind=own)
        self._to_signal = parse_transfer("srgb").to_signal
        self._kept: dict[int, np.ndarray] = {}

    def at(self, index: int, light: np.ndarray | None = None) -> np.ndarray:
        """The map of frame `index`, of its light."""
        if index not in self._kept:
            if light is None:
                raise UsageError(f"model:{self.name}: depth of frame {index} without its picture; give its light")
            self._kept = {index: self.scale.depth_m(self.values(light))}
        return self._kept[index]

    def values(self, light: np.ndarray) -> np.ndarray:
        """What the model says of light [H, W] or [H, W, 3]: [H, W] float32."""
        import torch

        codes = np.rint(255 * self._to_signal(np.clip(np.nan_to_num(light), 0, 1))).astype(np.uint8)
        picture = codes if codes.ndim == 3 else np.repeat(codes[..., None], 3, axis=-1)
        batch = self._processor(images=picture, return_tensors="pt", input_data_format="channels_last")
        sizes: dict[str, Any] = {"target_sizes": [picture.shape[:2]]}
        if self._model.config.model_type == "zoedepth":
            sizes["source_sizes"] = sizes["target_sizes"]
        with torch.inference_mode():
            outputs = self._model(**batch)
            made = self._processor.post_process_depth_estimation(outputs, **sizes)[0]["predicted_depth"]
        return made.float().numpy()


def is_metric(config: Any) -> bool:
    """Whether a model's numbers are metres."""
    return config.model_type in METRIC or getattr(config, "depth_estimation_type", "relative") == "metric"


def _loaded(name: str) -> tuple[Any, Any]:
    """(processor, model): of a folder, of what was downloaded before, or of the hub, which is first asked for it once.

    What transformers asks by itself it asks again and again, for minutes where there is no network.
    """
    try:
        from huggingface_hub import HfApi
        from transformers.utils.logging import disable_progress_bar
    except ImportError as error:
        raise UsageError(f"model:{name} needs a package that is not installed; pip install 'vid2ev[depth]'") from error
    disable_progress_bar()  # (of weights that are read from disk within a second)
    try:
        try:
            return _of_pretrained(name, local_files_only=True)
        except Exception:
            if Path(name).is_dir():
                raise
        HfApi().model_info(name, timeout=PATIENCE_S)
        return _of_pretrained(name)
    except Exception as error:  # (of the hub, of JSON, of safetensors, of configurations)
        said = first_line(error, None)
        raise DataError(f"model:{name} cannot be loaded ({said}); give a folder or a name, as {EXAMPLE}") from error


def _of_pretrained(name: str, local_files_only: bool = False) -> tuple[Any, Any]:
    from transformers import AutoImageProcessor, AutoModelForDepthEstimation

    processor = AutoImageProcessor.from_pretrained(name, backend="pil", local_files_only=local_files_only)
    model = AutoModelForDepthEstimation.from_pretrained(
        name,
        local_files_only=local_files_only,
        use_safetensors=True,  # (other files can run code)
    )
    return processor, model.eval()
