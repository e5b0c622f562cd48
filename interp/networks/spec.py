"""What all networks' specifications have."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Size = Literal["tiny", "small", "paper"]
Depth = Annotated[int, Field(ge=2, le=7)]  # levels of a UNet
BASES = {"tiny": 8, "small": 16, "paper": 32}


class NetworkSpec(BaseModel):
    """A network's options; frozen.  The costs that fields name are those of size `paper`, unless they say otherwise: of
    whole UNets a quarter at `small`, a sixteenth at `tiny`, of channels that these take half and a quarter."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: Size = Field(
        default="tiny",
        description="8, 16 or 32 channels at full resolution; parameters and kMAC/px are fourfold from one to the next",
    )

    @property
    def base(self) -> int:
        """Channels at full resolution."""
        return BASES[self.size]


class FrameFedSpec(NetworkSpec):
    """Options of networks that take two frames."""

    colours: Literal[1, 3] = Field(
        default=3,
        description="channels of a frame; a network of 3 takes grey frames, too, and one of 1, which learns from"
        " luminance, gives coloured frames the colours of those that it carries. 1 saves 1 to 3 % of the cost, at tiny"
        " 3 to 10 %",
    )
    flow_scale: float = Field(
        default=10.0, gt=0, description="pixels that 1 at the head of a flow network stands for; costs nothing"
    )
    zero_heads: bool = Field(
        default=True,
        description="heads of flows and residues start at 0, so that training starts at a cross-fade; free",
    )

    @property
    def takes_events(self) -> bool:
        """Whether what the network makes depends on events."""
        return True

    @property
    def guided(self) -> bool:
        """Whether it begins as the closed form that the light of events guides (`guide.py`)."""
        return False
