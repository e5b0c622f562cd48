"""What has been published, to be quoted beside own numbers: other data, other cameras, other machines.

Sources
    paper        Radomski et al., "Enhanced Frame and Event-Based Simulator and Event-Based Video Interpolation
                 Network", Tables II and III
    Time Lens    Tulyakov et al. (2021), "Time Lens: Event-based Video Frame Interpolation", as its authors give them
                 in issue 32 of uzh-rpg/rpg_timelens; there, too, what its public weights give others
    GoPro        the tables of REFID (Sun et al., 2023, "Event-Based Frame Interpolation with Ad-hoc Deblurring")
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quality:
    """A column of the paper's Table II as it stands there: mean, least frame, least 99x99 patch, standard deviation."""

    data: str
    ssim: tuple[str, str, str, str]
    psnr: tuple[str, str, str, str]


@dataclass(frozen=True, slots=True)
class Published:
    """A row in the form of the paper's Table III: means as given, ± standard deviation where there is one."""

    method: str
    data: str
    skipped: int
    psnr: str
    ssim: str


TABLE_II = (
    Quality("paper, simulated", ("0.955", "0.941", "0.478", "0.006"), ("38.122", "34.964", "22.493", "1.688")),
    Quality("paper, recorded", ("0.937", "0.888", "0.500", "0.014"), ("34.865", "28.441", "15.404", "2.245")),
)
TABLE_III = (
    Published("Time Lens, as the paper has it", "HS-ERGB", 7, "32.207 ± 7.18", "0.869 ± 0.123"),
    Published("the paper's network", "HS-ERGB", 7, "32.205 ± 7.04", "0.877 ± 0.109"),
)
ELSEWHERE = (
    Published("Time Lens", "HS-ERGB far", 5, "33.13 ± 2.10", "0.877 ± 0.092"),
    Published("Time Lens", "HS-ERGB close", 5, "32.19 ± 4.19", "0.839 ± 0.090"),
    Published("Time Lens", "HS-ERGB far", 7, "32.31 ± 2.27", "0.869 ± 0.110"),
    Published("Time Lens", "HS-ERGB close", 7, "31.68 ± 4.18", "0.835 ± 0.091"),
    Published("Time Lens, public weights", "HS-ERGB far", 5, "31.33 ± 2.55", "0.883"),
    Published("Time Lens, public weights", "HS-ERGB close", 5, "31.81 ± 4.20", "0.822"),
    Published("Time Lens, public weights", "HS-ERGB far", 7, "30.05 ± 2.24", "0.864"),
    Published("Time Lens, public weights", "HS-ERGB close", 7, "31.54 ± 6.05", "0.844"),
    Published("Super SloMo", "GoPro", 7, "28.98", "0.875"),
    Published("DAIN", "GoPro", 7, "28.81", "0.876"),
    Published("Time Lens", "GoPro, simulated events", 7, "34.81", "0.959"),
    Published("REFID", "GoPro, simulated events", 7, "36.80", "0.980"),
    Published("Super SloMo", "GoPro", 15, "24.38", "0.747"),
    Published("DAIN", "GoPro", 15, "24.39", "0.736"),
    Published("Time Lens", "GoPro, simulated events", 15, "33.21", "0.942"),
    Published("REFID", "GoPro, simulated events", 15, "35.635", "0.974"),
)
FASTEST_PX, FASTEST_PX_PER_S = 100.0, 3000.0  # motion that the paper's network follows, between frames and per second


def of_gap(skipped: int) -> list[Published]:
    """What is published for as many frames between key frames; the paper's rows first."""
    return [row for row in (*TABLE_III, *ELSEWHERE) if row.skipped == skipped]
