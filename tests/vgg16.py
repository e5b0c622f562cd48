"""A file as of VGG16's weights, of random numbers."""

from pathlib import Path

import torch
from safetensors.torch import save_file

PLACES = {0: (3, 64), 2: (64, 64), 5: (64, 128), 7: (128, 128), 10: (128, 256), 12: (256, 256), 14: (256, 256)}
PLACES |= {17: (256, 512), 19: (512, 512), 21: (512, 512)}  # torchvision's vgg16().features, up to relu4_3


def write_vgg16(path: Path) -> dict[str, torch.Tensor]:
    """Write it, with what comes after the features too; returns those."""
    tensors = {f"features.{k}.bias": torch.zeros(out) for k, (_, out) in PLACES.items()}
    tensors |= {f"features.{k}.weight": 0.02 * torch.randn(out, into, 3, 3) for k, (into, out) in PLACES.items()}
    save_file({**tensors, "classifier.0.bias": torch.zeros(4)}, path)
    return tensors
