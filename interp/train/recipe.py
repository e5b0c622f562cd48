"""How a network is trained: one frozen record.

The defaults are those of `tiny` on two cores.  Where a number has no source, it is the field's usual one.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Share = Annotated[float, Field(ge=0, lt=1)]


def _as_text(value: Any) -> Any:
    """A whole number as it is written: precision=32 is a number where settings are read."""
    return str(value) if isinstance(value, int) else value


Precision = Annotated[Literal["auto", "32", "bf16", "16"], BeforeValidator(_as_text)]


class Recipe(BaseModel):
    """Numbers of training.  Raises `pydantic.ValidationError` for what cannot be."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    seed: int = Field(0, ge=0, lt=1 << 63, description="of first weights, samples and whatever else is random")
    steps: int | None = Field(None, ge=1, description="steps; without them training takes `time_s`")
    time_s: float = Field(
        3300.0, gt=0, description="how long training may take [s]; 55 minutes, so that an hour is kept"
    )
    batch: int = Field(8, ge=1, le=65536, description="samples per step, of all processes together")
    rate: float = Field(1.5e-3, gt=0, description="highest learning rate")
    warm_up: int = Field(200, ge=0, description="steps until it is reached")
    rate_end: float = Field(0.01, ge=0, le=1, description="rate reached after the last step, as a share of the highest")
    betas: tuple[Share, Share] = Field((0.9, 0.99), description="of AdamW: means over 10 and 100 steps")
    weight_decay: float = Field(1e-4, ge=0, description="of AdamW")
    clip: float = Field(1.0, gt=0, description="longest gradient")
    mean: float = Field(0.998, ge=0, lt=1, description="weight of what was, in the running mean of the weights")
    most_skipped: int = Field(20, ge=1, description="steps in a row without a finite gradient that end training")
    precision: Precision = Field(
        "auto", description="bits of activations: 32 on a CPU; on a GPU bf16 where it has that, else 16"
    )
    validations: int = Field(10, ge=1, description="how often it is validated, the end included")
    cut_every: int = Field(
        8, ge=0, description="windows of events that gradients of recurrent networks go back through; 0 for all"
    )
    processes: int = Field(
        2,
        ge=1,
        description="processes that train without a GPU, which --devices sets; decides the last bits",
    )
    threads: int = Field(
        1, ge=1, le=1024, description="threads of a process that trains without a GPU; decides the last bits"
    )
    save_s: float = Field(60.0, gt=0, description="time between checkpoints [s]")


# Recurrent networks are less stable: gradients of many steps add up (FireNet's are "very unstable", Radomski et al.).
RECURRENT = {"rate": 3e-4, "warm_up": 500, "clip": 0.5}
