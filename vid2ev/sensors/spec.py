"""The specification of an event camera: the parameters of every effect, in one flat, frozen, validated record."""

from __future__ import annotations

import math

from pydantic import model_validator

from vid2ev.physics.bad_pixels import BadPixels
from vid2ev.physics.comparator import Comparator
from vid2ev.physics.crossing_noise import CrossingNoise
from vid2ev.physics.delay import Delay
from vid2ev.physics.fixed_rate import FixedRate
from vid2ev.physics.leak import Leak
from vid2ev.physics.log_curve import LogCurve
from vid2ev.physics.mismatch import Mismatch, reached_spread
from vid2ev.physics.photoreceptor import Photoreceptor
from vid2ev.physics.photoreceptor_noise import PhotoreceptorNoise
from vid2ev.physics.refractory import Refractory
from vid2ev.physics.shading import Shading
from vid2ev.physics.shot import Shot
from vid2ev.sensors.record import Record


class DvsSpec(  # the order of the bases, last to first, is the order of the fields: the path of light
    FixedRate,
    Delay,
    BadPixels,
    Shot,
    Leak,
    Refractory,
    CrossingNoise,
    Mismatch,
    Comparator,
    LogCurve,
    PhotoreceptorNoise,
    Photoreceptor,
    Shading,
    Record,
    frozen=True,
    extra="forbid",
):
    """Parameters of an event camera; the defaults are the paper's (section II.A), where it gives a number.

    Raises `pydantic.ValidationError` for an unknown key or a value outside its limits; `vid2ev.load_sensor` turns
    that into one sentence.
    """

    @model_validator(mode="after")
    def _noise_needs_two_poles(self) -> DvsSpec:
        if self.photoreceptor_noise > 0 and not (self.photoreceptor_tau_us > 0 and self.follower_tau_us > 0):
            raise ValueError(
                "photoreceptor_noise needs photoreceptor_tau_us and follower_tau_us above 0 (white noise through"
                " one pole crosses a level infinitely often); set both or leave the noise out"
            )
        return self

    @property
    def pole_taus_us(self) -> tuple[float, ...]:
        """Time constants of the poles in use [us], the photoreceptor's first."""
        return tuple(tau for tau in (self.photoreceptor_tau_us, self.follower_tau_us) if tau > 0)

    def effects(self) -> list[str]:
        """Names of the effects that these parameters switch on, in the order of the path of light."""
        on = {
            "shading": bool(self.shading),
            "photoreceptor": self.photoreceptor_tau_us > 0,
            "follower": self.follower_tau_us > 0,
            "bandwidth": self.bandwidth == "light" and self.photoreceptor_tau_us > 0,
            "photoreceptor_noise": self.photoreceptor_noise > 0,
            "mismatch": self.mismatch > 0,
            "crossing_noise": self.crossing_noise > 0,
            "refractory": self.refractory_us > 0,
            "leak": self.leak_rate_hz > 0,
            "shot": self.shot_rate_hz > 0,
            "hot": self.hot_probability > 0 and self.hot_rate_hz > 0,
            "cold": self.cold_probability > 0,
            "delay": self.delay_us > 0,
            "fixed_rate": self.frame_rate_hz > 0,
        }
        return [name for name, used in on.items() if used]

    def reached_spreads(self) -> dict[str, tuple[float, float]]:
        """What the clip of the thresholds leaves of `mismatch` and `crossing_noise`, for ON and OFF [nat]: of those of
        which it takes more than 1 % (of the noise, in a pixel of mean thresholds)."""
        means, spreads = (self.threshold_on, self.threshold_off), {}
        for key, sigma in (("mismatch", self.mismatch), ("crossing_noise", self.crossing_noise)):
            on, off = (reached_spread(mean, sigma) for mean in means)
            if min(on, off) < 0.99 * sigma:
                spreads[key] = (on, off)
        return spreads

    def refractory_ns(self) -> int:
        """The refractory period in whole nanoseconds."""
        return math.floor(self.refractory_us * 1000 + 0.5)
