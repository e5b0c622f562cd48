"""Weights on disk: safetensors, with the network's name and options beside them.  Nothing in such a file can run.

metadata   network: a name of `interp.networks`; spec: its options, as JSON; more as whoever saves it likes
tensors    by their names in the network; names that a wrapper has put `module.` or `_orig_mod.` before are understood
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import torch
from torch import nn

from interp.blocks.frozen import Frozen
from interp.networks import NETWORKS, make, spec_of
from interp.pretrained import OF_RUN
from vid2ev.errors import DataError, UsageError
from vid2ev.untrusted import first_line, json_of

WRAPPERS = ("module.", "_orig_mod.")


def save(path: Path, name: str, network: nn.Module, about: Mapping[str, str] | None = None, half: bool = False) -> None:
    """Write a network of that name, whole or not at all; the same network gives the same bytes.

    about   what else goes into the metadata
    half    in 16 bits, for half the size
    """
    from safetensors.torch import save as in_bytes

    from vid2ev.recording.disk import whole_file

    spec = network.spec.model_dump_json()  # type: ignore[operator, union-attr]
    kind = torch.float16 if half else torch.float32
    tensors = {key: tensor.detach().cpu().to(kind).contiguous() for key, tensor in network.state_dict().items()}
    with whole_file(path) as file:
        file.write(_in_order(in_bytes(tensors, {**(about or {}), "network": name, "spec": spec})))


def load(path: Path) -> nn.Module:
    """The network of a file, as in use.  Raises DataError for a file that does not hold one."""
    name, spec, tensors = _of_network(path)
    network = make(name, **spec)
    network.load_state_dict(tensors)
    return network.eval()


def about(path: Path) -> tuple[str, dict[str, Any]]:
    """The name of a file's network, and its options.  Raises DataError for a file that does not hold one."""
    name, spec, _ = _of_network(path)
    return name, spec


def fill(network: nn.Module, path: Path) -> None:
    """Give a network the weights of a file.  Raises UsageError where they are of another network, or of one for frames
    of other colours, DataError where they are not even of the one that the file names."""
    name, spec, tensors = _read(path)
    if misfit := _misfit(network, tensors):
        _of_network(path)
        theirs, ours = spec.get("colours"), getattr(network.spec, "colours", None)
        if theirs and ours and theirs != ours:
            raise UsageError(
                f"{path} holds the weights of a network with network.colours = {theirs}, and this one has {ours};"
                f" choose network.colours = {theirs}, or give others"
            )
        raise UsageError(f"{path} holds the weights of another network, {name} ({misfit}); give those of this one")
    network.load_state_dict(tensors)


def load_part(network: nn.Module, part: str, path: Path) -> None:
    """Give a part of a network, such as `flow` or `reconstruct`, the weights of a network trained for itself; raises
    UsageError for a part that it does not have, for weights that mean something else there, and as `fill` does."""
    parts = {name: each.module if isinstance(each, Frozen) else each for name, each in network.named_children()}
    parts = {name: each for name, each in parts.items() if hasattr(each, "spec")}
    if part not in parts:
        there = ", ".join(parts) or "none that is trained for itself; leave it out"
        raise UsageError(f"{type(network).__name__} has no part '{part}'; it has {there}")
    fill(parts[part], path)
    name, said = about(path)
    theirs, ours = spec_of(name, **said).model_dump(), parts[part].spec.model_dump()  # type: ignore[operator, union-attr]
    for key in theirs.keys() - {"zero_heads"}:  # (which decides how weights begin, and nothing later)
        if theirs[key] != ours[key]:
            raise UsageError(
                f"{path} holds the weights of a network with {key} = {theirs[key]}, and {part} of this one has"
                f" {ours[key]}; give those of one that is alike"
            )


def _of_network(path: Path) -> tuple[str, dict[str, Any], dict[str, torch.Tensor]]:
    """Name, options and tensors of a file, which fit."""
    name, spec, tensors = _read(path)
    try:
        with torch.device("meta"):  # (without memory: options in a file may ask for any amount of it)
            network = make(name, **spec)
    except Exception as error:  # (of options; of torch, for sizes that cannot be)
        said = first_line(error)
        raise DataError(f"{path} is of another version of its network ({said}); train it again") from error
    if misfit := _misfit(network, tensors):
        raise DataError(f"{path} holds the weights of another network than it says ({misfit}); get another copy")
    return name, spec, tensors


def _read(path: Path) -> tuple[str, dict[str, Any], dict[str, torch.Tensor]]:
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, "pt") as file:
            metadata = file.metadata() or {}
            tensors = {_bare(key): file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        if is_zipfile(path):
            raise DataError(
                f"{path} is a checkpoint of torch, not weights in safetensors; give the run's folder, or {OF_RUN} in it"
            ) from error
        raise DataError(f"{path} cannot be read as weights ({error}); give a file that training has written") from error
    name = metadata.get("network", "")
    try:
        spec = json_of(metadata.get("spec", ""))
    except ValueError:
        spec = None
    if name not in NETWORKS or not isinstance(spec, dict) or ("size" in spec and not isinstance(spec["size"], str)):
        raise DataError(f"{path} does not say which network its weights are of; give a file that training has written")
    return name, spec, tensors


def _in_order(file: bytes) -> bytes:
    """The same file with its header in alphabetical order; safetensors writes metadata in any."""
    length = int.from_bytes(file[:8], "little")
    header = json.dumps(json.loads(file[8 : 8 + length]), sort_keys=True, separators=(",", ":")).encode()
    padded = header + b" " * (-len(header) % 8)
    return len(padded).to_bytes(8, "little") + padded + file[8 + length :]


def _misfit(module: nn.Module, tensors: Mapping[str, torch.Tensor]) -> str:
    """The first tensor that is not as the module has it, and how; empty if all fit."""
    shapes = {key: tensor.shape for key, tensor in module.state_dict().items()}
    keys = (key for key in [*shapes, *tensors] if key not in tensors or tensors[key].shape != shapes.get(key))
    if (key := next(keys, None)) is None:
        return ""
    wanted, found = (list(of) if of is not None else "nothing" for of in (shapes.get(key), _shape(tensors.get(key))))
    return f"{key[:80]} is {found}, expected {wanted}"


def _shape(tensor: torch.Tensor | None) -> torch.Size | None:
    return None if tensor is None else tensor.shape


def _bare(key: str) -> str:
    while key.startswith(WRAPPERS):
        key = key.removeprefix("module.").removeprefix("_orig_mod.")
    return key
