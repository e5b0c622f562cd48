"""What is known of one rebuilt frame: a row of the table that all reports are made of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """Scores of one frame by one method.  NaN where something is not defined or not known.

    sequence, method         names
    group, position          number of the gap in its sequence, from 0; place in it, 1 ... multiple - 1
    multiple                 frames per key frame: frames skipped + 1
    t_us                     instant of the frame [us]
    psnr, ssim               of the Time Lens protocol: against the range of the truth of that frame [dB]
    psnr_255, ssim_255       against 255 [dB]
    psnr_moving, psnr_static   PSNR-255 of the pixels whose truth is more than 10 codes away from either key frame in
                             any channel, and of the others [dB]
    moving                   share of the former
    patch_psnr, patch_ssim   of the worst of all 99x99 windows, each for itself; PSNR-255
    patch_x, patch_y         left and top of the one of patch_psnr [px]
    motion_px                motion between the key frames: 95th percentile of the optical flow's length, where they
                             differ visibly and the flow leads there and back; 0 where they do not differ, NaN where
                             it does so for less than a quarter of that: too far, flicker, or noise [px]
    motion_px_per_s          the same per second
    events_per_px            events of the gap, with what their dead time hid, per pixel of the event camera; of one
                             that stands apart, as they were brought to the frames, by up to a few percent others
    contrast                 standard deviation of the truth's log light [nat]
    blur_px                  motion during an exposure of a key frame [px]
    disparity_px             mean disparity between frame and event camera [px of the frames]
    offset_us                by how much the events' clock is late [us]
    """

    sequence: str
    method: str
    group: int
    position: int
    multiple: int
    t_us: int
    psnr: float
    ssim: float
    psnr_255: float
    ssim_255: float
    psnr_moving: float
    psnr_static: float
    moving: float
    patch_psnr: float
    patch_ssim: float
    patch_x: int
    patch_y: int
    motion_px: float
    motion_px_per_s: float
    events_per_px: float
    contrast: float
    blur_px: float
    disparity_px: float
    offset_us: float
