#!/usr/bin/env python3
"""How fast and how right the event camera is on a GPU, against the same on the CPU.

    python examples/benchmark_gpu.py                   parity and speed, three sizes, quiet and busy
    python examples/benchmark_gpu.py --into README.md  and the table between its marks there
    python examples/benchmark_gpu.py --simulated       parity alone, in numba's simulator, at a small size
    python examples/benchmark_gpu.py --cpu             what a pixel and step takes on a thread of the CPU alone

Parity: `DvsOnCard` and `Dvs` see the same frames; every event must be the same.  Speed: light is on the card, events
stay there, 16 frames at a time; the median of some runs, the card awaited before and after each.

    quiet   noise of 1 % of the light: two poles at work, next to no events
    busy    a pattern that moves by half a pixel a frame

The roofline is what must be moved of a pixel and frame: its light once (4 bytes), its state in and out once for 16
frames; the share is that over the time, against a copy measured on the same card.

Rendered: the pictures of a scene at 1280x720, 960 a second, painted on the card and seen there by the sensor `paper`,
from the numbers of the world on the host to the events; and the painting alone.

Last it prints the numbers by which `--device auto` chooses, as `vid2ev/sensors/devices.py` has them: nanoseconds for a
pixel and step on a thread of the CPU and on the card, light carried along motion and the sensor `paper`, and what it
takes until a card has made its first events.

Without a GPU it says so, in one line.
"""

from __future__ import annotations

import statistics
import sys
import time
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np

SIZES = {"346x260": (346, 260), "1280x720": (1280, 720), "3840x2160": (3840, 2160)}
FRAMES, RUNS, FRAME_NS = 16, 3, 1_000_000
BEGIN, END = "<!-- gpu: begin -->", "<!-- gpu: end -->"
STEPS = 17  # from frame to frame, as many as `--subframes auto` takes of eight clips (the median)
SCENES, SCENE_FPS, PICTURES = ("spinning-shapes", "room", "close-object"), 960, 64
CLIPS, CLIP_FRAMES = 32, 256  # of training: 256x256, 9 frames of truth and 32 steps between each two


def sensors() -> dict[str, Any]:
    from vid2ev import DvsSpec

    clean = {"mismatch": 0.0, "crossing_noise": 0.0, "refractory_us": 0.0, "random_phase": False}
    return {"two poles": DvsSpec(**clean), "paper": DvsSpec()}


def frames(kind: str, size: tuple[int, int], count: int, seed: int = 0) -> np.ndarray:
    """Linear light [count, height, width]."""
    rng, (width, height) = np.random.default_rng(seed), size
    pattern = np.exp(0.6 * rng.standard_normal((height, width + count))).astype(np.float32)
    if kind == "quiet":
        still = pattern[:, :width]
        return np.stack([still * (1 + 0.01 * rng.standard_normal(still.shape, np.float32)) for _ in range(count)])
    both = [0.5 * (pattern[:, k // 2 : k // 2 + width] + pattern[:, (k + 1) // 2 :][:, :width]) for k in range(count)]
    return np.stack(both).astype(np.float32)


def parity(memory: Any, size: tuple[int, int], count: int) -> tuple[list[str], int]:
    """A line for each sensor and kind of light; and how many events differ."""
    from vid2ev.sensors.dvs import Dvs
    from vid2ev.sensors.dvs_on_card import DvsOnCard

    lines, differ, t_ns = [], 0, [FRAME_NS * k for k in range(count)]
    for name, spec in sensors().items():
        for kind in ("quiet", "busy"):
            light = frames(kind, size, count)
            cpu, card = Dvs(spec, size, 1), DvsOnCard(spec, size, 1, memory=memory)
            ours = card.steps(light, t_ns)
            theirs = [cpu.step(frame, t) for frame, t in zip(light, t_ns, strict=True)]
            off = sum(difference(a, b) for a, b in zip(ours, theirs, strict=True))
            lines.append(f"{name}, {kind}: {sum(map(len, theirs))} events, {off} differ")
            differ += off
    return lines, differ


def difference(one: Any, other: Any) -> int:
    """How many events are in one of two recordings and not in the other."""
    if len(one) == len(other) and all((getattr(one, f) == getattr(other, f)).all() for f in "txyp"):
        return 0
    sets = [set(zip(*(getattr(part, f).tolist() for f in "txyp"), strict=True)) for part in (one, other)]
    return max(len(sets[0] ^ sets[1]), 1)


def seconds(torch: Any, work: Any) -> float:
    """The median time of a few runs, the card awaited."""
    work()
    taken = []
    for _ in range(RUNS):
        torch.cuda.synchronize()
        began = time.perf_counter()
        work()
        torch.cuda.synchronize()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def bytes_per_step(spec: Any) -> float:
    """Light once; state in and out, and the thresholds in, once for all frames of a launch."""
    poles = len(spec.pole_taus_us)
    return 4 + (4 * (3 + poles) * 2) / FRAMES


def speed(torch: Any, memory: Any, name: str, spec: Any, size: tuple[int, int], kind: str, copied: float) -> dict:
    """What one sensor does with one kind of light."""
    from vid2ev.sensors.batch_on_card import DvsBatchOnCard

    light = torch.from_numpy(frames(kind, size, FRAMES + 1)).cuda()[:, None]
    there_and_back = light[1:], light[:-1].flip(0).contiguous()
    batch, clock = DvsBatchOnCard([spec], size, [1], memory=memory), [0]
    batch.restart(light[0], [0])
    sent = []

    def run() -> None:
        t_ns = clock[0] + FRAME_NS * np.arange(1, FRAMES + 1)[:, None]
        clock[0] = int(t_ns[-1, 0])
        sent.append(len(batch.steps(there_and_back[len(sent) % 2], t_ns)))

    taken, pixel_steps = seconds(torch, run), size[0] * size[1] * FRAMES
    return {
        "sensor": name, "size": f"{size[0]}x{size[1]}", "light": kind, "gpixel": pixel_steps / taken * 1e-9,
        "mevents": statistics.median(sent[1:]) / taken * 1e-6,
        "share": bytes_per_step(spec) * pixel_steps / taken / copied,
    }  # fmt: skip


def clips_per_second(torch: Any, memory: Any, spec: Any) -> tuple[float, float]:
    """Training clips of 256x256 and 256 steps that a card makes events of in a second, and net counts of each step."""
    from vid2ev.sensors.batch_on_card import DvsBatchOnCard
    from vid2ev.sensors.card_grids import NetCountsOnCard

    one = torch.from_numpy(frames("busy", (256, 256), CLIP_FRAMES // 8 + 1)).cuda()
    steps = torch.arange(CLIP_FRAMES, device="cuda") / 8  # (an eighth of the busy pattern's motion in each)
    low = steps.long()
    some = torch.lerp(one[low], one[low + 1], (steps - low)[:, None, None])
    light = some[:, None].expand(CLIP_FRAMES, CLIPS, 256, 256).contiguous()
    t_ns = np.repeat((FRAME_NS * np.arange(CLIP_FRAMES))[:, None], CLIPS, 1)

    batch = DvsBatchOnCard([spec] * CLIPS, (256, 256), range(CLIPS), memory=memory)
    grids = NetCountsOnCard(memory, CLIPS, (256, 256), t_ns[:, 0] // 1000)

    def run(straight: bool) -> None:
        batch.renew([spec] * CLIPS, range(CLIPS))
        batch.restart(light[0], t_ns[0])
        for k in range(1, CLIP_FRAMES, FRAMES):
            some = slice(k, k + FRAMES)
            if straight:
                batch.fill(grids, light[some], t_ns[some])
            else:
                batch.steps(light[some], t_ns[some])
        if straight:
            grids.take()

    return CLIPS / seconds(torch, lambda: run(False)), CLIPS / seconds(torch, lambda: run(True))


def start_s(memory: Any) -> float:
    """Seconds until a sensor of 64x48 pixels has sent its first events: kernels are compiled, torch has begun."""
    from vid2ev.sensors.dvs_on_card import DvsOnCard

    began = time.perf_counter()
    card = DvsOnCard(sensors()["paper"], (64, 48), memory=memory)
    card.steps(frames("busy", (64, 48), FRAMES), [FRAME_NS * k for k in range(FRAMES)])
    return time.perf_counter() - began


def step_ns(memory: Any | None) -> float:
    """Nanoseconds for a pixel and step of 1280x720: a photograph carried along motion of 3 px, and what a sensor
    makes of it; of the CPU, where there is no memory of a card, those of one thread."""
    import cv2
    from skimage import data

    from vid2ev.sensors.dvs import Dvs
    from vid2ev.sensors.dvs_on_card import DvsOnCard
    from vid2ev.stream.frames import Frame
    from vid2ev.stream.upload import Upload
    from vid2ev.upsample import make_upsampler

    size, spec = SIZES["1280x720"], sensors()["paper"]
    photograph = (cv2.resize(data.camera(), (size[0] + 3, size[1])).astype(np.float32) / 255) ** 2.2
    before, after = (np.ascontiguousarray(photograph[:, k : k + size[0]]) for k in (0, 3))
    upsampler = make_upsampler("flow", STEPS, upload=None if memory is None else Upload(memory.name))
    dvs = Dvs(spec, size) if memory is None else DvsOnCard(spec, size, memory=memory)
    clock = time.thread_time if memory is None else time.perf_counter
    taken = []
    for k in range(RUNS):
        interval = upsampler.between(Frame(before, 2 * k * 10**9), Frame(after, (2 * k + 1) * 10**9))
        dvs.restart(before, 2 * k * 10**9)
        began = clock()
        dvs.see_all(list(interval))  # (its events come to the host, which awaits the card)
        taken.append(clock() - began)
    return 1e9 * statistics.median(taken[1:]) / (size[0] * size[1] * STEPS)


def picture_parity(memory: Any, size: tuple[int, int]) -> list[str]:
    """A line for each scene: how far its picture and flow are from those of the CPU."""
    from vid2ev.scenes.reel_on_card import ReelOnCard
    from vid2ev.scenes.scene_file import scene_names
    from vid2ev.scenes.world import World

    lines = []
    for name in scene_names():
        world = World.of(name, settings=[f"camera.size={list(size)}"])
        times = world.duration_ns // 3, world.duration_ns // 2
        reel = ReelOnCard(world, memory)
        ours, theirs = next(iter(reel.pictures(times[:1]))), world.render(times[0])
        there, flow = reel.flow(*times, ours), world.flow(*times, theirs)
        pairs = {"light": (ours.light, theirs.light), "depth": (ours.depth, theirs.depth), "flow": (there[0], flow[0])}
        off = [f"{what} {apart(memory.get(one) if what != 'flow' else one.cpu().numpy(), other)}"
               for what, (one, other) in pairs.items()]  # fmt: skip
        lines.append(f"{name}: {', '.join(off)}")
    return lines


def apart(one: np.ndarray, other: np.ndarray) -> str:
    """In how many numbers two arrays differ, and by how much at most."""
    differs = ~((one == other) | (np.isnan(one) & np.isnan(other)))
    return f"{differs.sum()} differ" + (f", by {np.abs(one - other)[differs].max():.2g}" if differs.any() else "")


def rendered(torch: Any, memory: Any, name: str) -> str:
    """How many times faster than real time a scene becomes events, and pictures alone."""
    from vid2ev.scenes.reel_on_card import ReelOnCard
    from vid2ev.scenes.world import World
    from vid2ev.sensors.dvs_on_card import DvsOnCard
    from vid2ev.stream.frames import Frame

    size = SIZES["1280x720"]
    world = World.of(name, settings=[f"camera.size={list(size)}"])
    reel, card = ReelOnCard(world, memory), DvsOnCard(sensors()["paper"], size, 1, memory=memory)
    instants_ns, clock = [k * 10**9 // SCENE_FPS for k in range(PICTURES)], [0]

    def light() -> Any:
        for picture, t_ns in zip(reel.pictures(instants_ns), instants_ns, strict=True):
            yield Frame(torch.as_tensor(picture.light), t_ns).luminance

    def paint() -> None:
        for _ in light():
            pass

    def convert() -> None:
        seen = list(light())
        t_ns = [clock[0] + t for t in instants_ns]
        clock[0] += 2 * instants_ns[-1]
        card.restart(seen[0], t_ns[0])
        for k in range(1, len(seen), FRAMES):
            card.steps(torch.stack(seen[k : k + FRAMES]), t_ns[k : k + FRAMES])

    real_s = PICTURES / SCENE_FPS
    return (
        f"rendered {name}: {real_s / seconds(torch, convert):.2f} x real time, {real_s / seconds(torch, paint):.2f} x"
    )


def copy_speed(torch: Any) -> float:
    """Bytes a second that a copy moves, both ways counted."""
    source = torch.zeros(1 << 28, device="cuda")
    target = torch.empty_like(source)
    return 2 * source.numel() * 4 / seconds(torch, lambda: target.copy_(source))


def table(rows: list[dict], device: str, copied: float, clips: tuple[float, float]) -> str:
    per_s = f"{clips[0]:.0f}/s to events, {clips[1]:.0f}/s straight to net counts"
    head = f"{device}, a copy moves {copied * 1e-9:.0f} GB/s; training clips (256x256, 256 steps): {per_s}\n\n"
    lines = ["| sensor | size | light | Gpixel-steps/s | Mevents/s | of the roofline |", "|---|---|---|---|---|---|"]
    return head + "\n".join([*lines, *map(line_of, rows)]) + "\n"


def line_of(row: dict) -> str:
    numbers = f"{row['gpixel']:.2f} | {row['mevents']:.1f} | {100 * row['share']:.0f} %"
    return f"| {row['sensor']} | {row['size']} | {row['light']} | {numbers} |"


@click.command()
@click.option("--into", type=click.Path(path_type=Path, exists=True), help="write the table between its marks there")
@click.option("--simulated", is_flag=True, help="parity alone, in numba's simulator")
@click.option("--cpu", is_flag=True, help="what a pixel and step takes on a thread of the CPU alone")
def main(into: Path | None, simulated: bool, cpu: bool) -> None:
    """Parity and speed of the event camera on a GPU."""
    from vid2ev.sensors.devices import memory_of, missing_for_cuda

    if cpu:
        click.echo(f"CPU_NS = {step_ns(None):.1f}")
        return
    if simulated:
        lines, differ = parity(memory_of("simulated"), (23, 11), 6)
        click.echo("\n".join(lines))
        click.echo("\n".join(picture_parity(memory_of("simulated"), (14, 14))))
        sys.exit(differ > 0)
    if missing := missing_for_cuda():
        click.echo(f"no GPU: {missing}; nothing is measured")
        return
    import torch

    memory = memory_of("cuda")
    started = start_s(memory)
    lines, differ = parity(memory, SIZES["346x260"], 40)
    click.echo("\n".join(lines))
    click.echo("\n".join(picture_parity(memory, SIZES["346x260"])))
    click.echo("\n".join(rendered(torch, memory, name) for name in SCENES))
    copied = copy_speed(torch)
    rows = []
    for (name, spec), size, kind in product(sensors().items(), SIZES.values(), ("quiet", "busy")):
        rows.append(speed(torch, memory, name, spec, size, kind, copied))
        click.echo(line_of(rows[-1]))
    text = table(rows, torch.cuda.get_device_name(), copied, clips_per_second(torch, memory, sensors()["paper"]))
    click.echo(text)
    click.echo(f"CPU_NS = {step_ns(None):.1f}\nSTART_S = {started:.0f}\nCARD_NS = {step_ns(memory):.2f}")
    if into is not None:
        before, _, rest = into.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        into.write_text(f"{before}{BEGIN}\n{text}{END}{after}", encoding="utf-8")
    sys.exit(differ > 0)


if __name__ == "__main__":
    main()
