"""What is known for certain of what a camera sees, as files:

truth/timestamps.txt          when, in us on the camera's clock, a line for each number
truth/poses.txt               camera to world, as TUM's benchmark has it
truth/intrinsics.json         the camera's lens and pixels
truth/depth/000000.npy        m, NaN where it is not known
truth/flow/000000.npz         to the next number, px
truth/mask/000000.png
truth/map_NAME/000000.npz     where each pixel is in the camera of that name, px
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from vid2ev.recording.folder import Folder
from vid2ev.recording.pose_text import HEADER, pose_lines
from vid2ev.recording.truth_files import write_depth, write_flow, write_mask, write_pixel_map
from vid2ev.rig.lens_file import write_lens
from vid2ev.seen.mounts import Mount
from vid2ev.seen.truth import Truth

TIMES, POSES = "truth_times", "truth_poses"  # files that grow


def truth_files(within: str) -> list[str]:
    """The files that grow, `within` the folder."""
    return [f"{within}{TIMES}", f"{within}{POSES}"]


class TruthTrack:
    """The truth of a camera; a file depends on its instant alone, so what is written again is the same."""

    def __init__(self, mount: Mount, folder: Folder):
        self._mount, self._folder = mount, folder
        self._aside = folder.partial / mount.within / "truth"

    def add(self, truth: Truth) -> None:
        """Write what is known of one instant."""
        times = f"{self._mount.within}{TIMES}"
        number = f"{self._folder.size(times) // len(_line(0)):06d}"
        self._folder.write(times, _line(truth.t_ns // 1000))
        pose = truth.pose
        line = pose_lines(np.array([truth.t_ns]), pose.translation_m[None], pose.quaternion()[None])
        self._folder.write(f"{self._mount.within}{POSES}", line.encode())
        if truth.depth is not None:
            write_depth(self._place("depth", f"{number}.npy"), truth.depth)
        if truth.flow is not None:
            write_flow(self._place("flow", f"{number}.npz"), truth.flow)
        if truth.mask is not None:
            write_mask(self._place("mask", f"{number}.png"), truth.mask)
        for name, pixels in (truth.maps or {}).items():
            write_pixel_map(self._place(f"map_{name}", f"{number}.npz"), pixels)

    def write(self, whole: Path) -> None:
        """Put all into the folder of the finished recording."""
        target = whole / "truth"
        shutil.rmtree(target, ignore_errors=True)
        times = self._folder.written(f"{self._mount.within}{TIMES}").read_text(encoding="ascii").split()

        def beyond(_: str, names: list[str]) -> list[str]:  # (of instants that a resumed recording never came to)
            return [name for name in names if (stem := name.partition(".")[0]).isdecimal() and int(stem) >= len(times)]

        shutil.copytree(self._aside, target, ignore=beyond) if self._aside.exists() else target.mkdir(parents=True)
        (target / "timestamps.txt").write_text("".join(f"{int(t_us)}\n" for t_us in times), encoding="ascii")
        poses = self._folder.written(f"{self._mount.within}{POSES}").read_text(encoding="ascii")
        (target / "poses.txt").write_text(HEADER + poses, encoding="ascii")
        write_lens(target, self._mount.intrinsics)

    def _place(self, kind: str, name: str) -> Path:
        (self._aside / kind).mkdir(parents=True, exist_ok=True)
        return self._aside / kind / name


def _line(t_us: int) -> bytes:
    """All of one length, so that the file's size says how many there are."""
    return f"{t_us:+020d}\n".encode()
