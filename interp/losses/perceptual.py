"""Differences that eyes mind more than others: between features of a convolutional network.

With a file of VGG16's weights, as torchvision names them, the features are its relu4_3.  Without, which is the
default and needs no download, it is a stand-in: a network of the same layout with an eighth of the channels and
random weights that are always the same, and the features of all four levels.  Its first filters add up to 0, so that it
sees structure, over several scales, and not how bright it is.  But it has learnt nothing: numbers of networks trained
with it must not be compared with those of networks trained with VGG16.

Source: Johnson et al. (2016), "Perceptual losses for real-time style transfer and super-resolution", ECCV; VGG16,
Simonyan and Zisserman (2015), "Very deep convolutional networks for large-scale image recognition", ICLR.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

from interp.precision import in_full_precision
from vid2ev.errors import DataError

MEAN, SPREAD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet, which VGG16 was trained on
WIDTHS = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512)  # 0: the greatest of 2 x 2
SEED = 20_160
STAND_IN = 8


class Perceptual(nn.Module):
    """Mean absolute (or squared) differences of features; it has no parameters to train."""

    def __init__(self, vgg16: Path | None = None, squared: bool = False):
        super().__init__()
        self.squared, self.every_level = squared, vgg16 is None
        self.features = _layers(STAND_IN if vgg16 is None else 1)
        if vgg16 is None:
            _randomise(self.features)
        else:
            _load(self.features, vgg16)
        self.requires_grad_(False)

    @in_full_precision
    def forward(self, images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
        """The difference of images [..., C, H, W], codes 0 ... 1, grey or in colours."""
        pairs = zip(self._seen(images), self._seen(truth.detach()), strict=True)
        return torch.stack([F.mse_loss(a, b) if self.squared else F.l1_loss(a, b) for a, b in pairs]).mean()

    def _seen(self, images: torch.Tensor) -> list[torch.Tensor]:
        x = images.reshape(-1, *images.shape[-3:]).expand(-1, 3, -1, -1)
        x = (x - x.new_tensor(MEAN)[:, None, None]) / x.new_tensor(SPREAD)[:, None, None]
        levels = []
        for layer in self.features:
            if isinstance(layer, nn.MaxPool2d):
                levels.append(x)
            x = layer(x)
        return [*levels, x] if self.every_level else [x]


def _layers(fraction: int) -> nn.Sequential:
    """VGG16 up to relu4_3, numbered as in torchvision, or with a fraction of its channels."""
    layers: list[nn.Module] = []
    before = 3
    for width in WIDTHS:
        if width:
            layers += [nn.Conv2d(before, width // fraction, 3, padding=1), nn.ReLU()]
            before = width // fraction
        else:
            layers.append(nn.MaxPool2d(2, ceil_mode=True))
    return nn.Sequential(*layers)


def _randomise(layers: nn.Sequential) -> None:
    generator = torch.Generator().manual_seed(SEED)
    for layer in layers:
        if isinstance(layer, nn.Conv2d):
            fan_in = layer.weight[0].numel()
            with torch.no_grad():
                layer.weight.copy_(torch.randn(layer.weight.shape, generator=generator) * (2 / fan_in) ** 0.5)
                nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
    first = layers[0].weight
    assert isinstance(first, torch.Tensor)
    with torch.no_grad():
        first -= first.mean((2, 3), keepdim=True)


def _load(layers: nn.Sequential, path: Path) -> None:
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        stored = load_file(path)
        layers.load_state_dict({key: stored[f"features.{key}"] for key in layers.state_dict()})
    except (OSError, SafetensorError, KeyError, RuntimeError) as error:
        raise DataError(
            f"{path} does not hold the weights of VGG16 as torchvision names them (features.0.weight ...), in"
            " safetensors; convert them, or leave them out for a stand-in"
        ) from error
