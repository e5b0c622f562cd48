"""What clips are made of: one frozen record, which with a seed, a number and the files it names decides every bit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from interp.data.chance import Range, Share, has_some, within
from interp.data.sensor_ranges import SENSORS, SensorRanges
from vid2ev.scenes.scene_file import scene_names
from vid2ev.scenes.textures import PHOTOGRAPHS
from vid2ev.sources.times import SLOWEST_HZ

HELD_OUT = ("coffee", "motorcycle", "gravel", "rocket")  # photographs that are kept for validation
TRAINED_ON = tuple(name for name in PHOTOGRAPHS if name not in HELD_OUT)
MOST_PX = 1000  # of motion: what turns and grows with much more is soon beyond all numbers
MULTIPLES = (4, 8, 16, 32)
SOURCES = ("scenes", "photographs", "videos", "recordings")


class ClipSettings(BaseModel):
    """How clips are made.

    Raises `pydantic.ValidationError` for what does not go together.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: tuple[Annotated[int, Field(ge=16, le=8192)], Annotated[int, Field(ge=16, le=8192)]] = Field(
        default=(128, 128), description="width and height of the frames [px]"
    )
    multiples: tuple[int, ...] = Field(
        default=(8,), description="frames to rebuild per key frame: of 4, 8, 16, 32, each as often"
    )
    bins: int = Field(
        default=32, ge=1, description="sub-intervals that events are counted in; a multiple of all multiples"
    )
    scenes: Share = Field(default=0.4, description="share of clips of rendered scenes")
    photographs: Share = Field(default=0.6, description="share of clips of photographs in motion, one before the other")
    videos: Share = Field(default=0.0, description="share of clips of real videos")
    recordings: Share = Field(default=0.0, description="share of clips of recordings on disk")
    video_files: tuple[str, ...] = Field(default=(), description="real videos")
    recording_folders: tuple[str, ...] = Field(
        default=(), description="recordings: own, or in the HS-ERGB or BS-ERGB layout"
    )
    slowdown: float = Field(
        default=1.0, ge=1e-6, le=1000, description="how many times slower than the world the videos play"
    )
    fps: float | None = Field(
        default=None, ge=SLOWEST_HZ, le=1e9, description="of the videos, in place of their own times [Hz]; for pictures"
    )
    scene_names: tuple[str, ...] = Field(default=tuple(scene_names()), min_length=1, description="of the scenes")
    textures: tuple[str, ...] = Field(
        default=TRAINED_ON, min_length=1, description="photographs: bundled ones by name, or files"
    )
    environments: tuple[str, ...] = Field(default=(), description="HDR pictures of all that is around, for scenes")
    motion: tuple[tuple[Share, float, float], ...] = Field(
        default=((0.6, 4, 24), (0.2, 0.5, 4), (0.2, 24, 60)),
        description="share of clips, and motion per key frame from, to [px]",
    )
    step_px: float = Field(
        default=1.5, gt=0, description="the most that things move from picture to picture, while there are bins"
    )
    gap_ms: Annotated[Range, within(1e-3, 1e5)] = Field(
        default=(8.0, 60.0), description="from key frame to key frame, even in the logarithm [ms]"
    )
    rigs: float = Field(default=0.0, ge=0, le=1, description="share of clips whose event camera stands elsewhere")
    baseline_mm: Annotated[Range, within(0, 1e4)] = Field(
        default=(0.0, 15.0), description="how far from the frame camera [mm]"
    )
    coarser: tuple[Annotated[int, Field(ge=1)], ...] = Field(
        default=(1, 2, 3), min_length=1, description="pixels of frames per pixel of events, across, in rigs"
    )
    sensors: SensorRanges = Field(default=SensorRanges(), description="ranges of the sensors")
    light: Literal["srgb", "linear"] = Field(
        default="srgb", description="truth: sRGB codes of 8 bits, or unclipped linear light"
    )

    @model_validator(mode="after")
    def _fits(self) -> ClipSettings:
        if not self.multiples or not set(self.multiples) <= {*MULTIPLES}:
            raise ValueError(f"multiples {self.multiples}: expected some of 4, 8, 16, 32")
        if self.bins % max(self.multiples) or self.bins > 64:
            raise ValueError(f"bins {self.bins}: expected a multiple of {max(self.multiples)} up to 64")
        shares = [share for share, _, _ in self.motion]
        if not has_some(shares) or any(not 0 <= low <= high <= MOST_PX for _, low, high in self.motion):
            raise ValueError(
                f"motion {self.motion}: expected shares above 0, each with a range of pixels that rises to {MOST_PX}"
            )
        if not has_some(self.shares):
            raise ValueError("no clips: expected a share of scenes, photographs, videos or recordings above 0")
        if self.videos > 0 and not self.video_files:
            raise ValueError("videos without video_files: expected one or more")
        if self.recordings > 0 and not self.recording_folders:
            raise ValueError("recordings without recording_folders: expected one or more")
        if self.recordings > 0 and self.light == "linear":
            raise ValueError(
                "recordings have codes of 8 bits, where light beyond white is wanted: expected videos, pictures with"
                " their times, or scenes"
            )
        if any(side % factor for side in self.size for factor in self.coarser) and self.rigs > 0:
            raise ValueError(f"size {self.size}: expected a multiple of {self.coarser} both ways, for coarser sensors")
        return self

    @property
    def shares(self) -> tuple[float, ...]:
        """Of `SOURCES`."""
        return self.scenes, self.photographs, self.videos, self.recordings


PRESETS = {
    "default": ClipSettings(),
    # The paper's rig, rates and sensors: Table I and section III.B.2.
    "paper": ClipSettings(
        size=(144, 144), multiples=(32,), gap_ms=(33.312, 33.344), rigs=1.0, sensors=SENSORS["paper"]
    ),
    # HDR: truth is unclipped light; frames are clipped where a sample is drawn (`sequences.py`).
    "hdr": ClipSettings(
        light="linear", scenes=0.6, photographs=0.4, scene_names=("low-light", "specular", "flicker", "room")
    ),
}  # fmt: skip
