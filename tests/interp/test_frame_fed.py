"""Networks that take two frames: any size, grey or colours, any targets, one first flow, still scenes untouched."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from pairs import FRAME_FED, counts, frames

from interp.blocks.unet import Layout, Unet, rrin_layout, slomo_layout
from interp.candidates.ramps import ramps
from interp.light import grey
from interp.networks import make
from interp.networks.event_input import first_last_and_target
from interp.networks.frame_fed import FrameFed
from interp.representation.event_counts import EventCounts
from interp.warp import both_warped
from vid2ev import Events, UsageError

TIMES = [0.25, 0.5, 0.9]
FROM_CANDIDATES = ("rrin_events_light", "rrin_events_guided")
FROM_MOTION = ("rrin_light", "rrin_events_guided")  # (by DIS, in the place of a network of their own)


def shaken(network: FrameFed, scale: float = 0.02) -> FrameFed:
    """A network as if it had been trained: heads that are not 0."""
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(scale * torch.randn_like(parameter))
    return network.eval()


def network(name: str, **options: object) -> FrameFed:
    made = make(name, "tiny", **options)
    assert isinstance(made, FrameFed)
    return shaken(made)


@pytest.mark.parametrize("name", FRAME_FED)
@pytest.mark.parametrize("size", [(1, 1), (3, 50), (37, 45)])
def test_any_size_comes_back_as_it_went_in(name: str, size: tuple[int, int]) -> None:
    with torch.no_grad():
        made = network(name)(*frames(1, size), TIMES[:2], counts(1, size))
    assert made.images.shape == (1, 2, 3, *size) and made.warps.shape == (1, 2, 2, 3, *size)
    assert made.blend.shape == made.images.shape and made.flows_at.shape == (1, 2, 4, *size)
    assert made.flows is None or made.flows.shape == (1, 4, *size)
    assert made.weights.shape[-2:] == size and torch.isfinite(made.images).all()


@pytest.mark.parametrize(("coarse", "px"), [(False, 2.0), (True, 4.0)])
def test_flows_are_pixels_of_the_frames_whatever_the_networks_resolution(coarse: bool, px: float) -> None:
    made = make("rrin_events", coarse=coarse)
    with torch.no_grad():
        made.get_submodule("flow.head").bias.copy_(torch.tensor([0.2, 0.0, -0.2, 0.0]))  # type: ignore[union-attr]
        first, second = frames(1, (20, 40))
        given = made(first, second, [0.5])
    assert torch.equal(given.flows[:, 0], torch.full((1, 20, 40), px))
    shift = int(px) // 2  # halfway between the frames
    assert torch.equal(given.flows_at[0, 0, :, 9, 9], torch.tensor([-px, 0, px, 0]) / 2)
    assert torch.equal(given.warps[:, 0, 0][..., 8:-8], first[..., 8 - shift : -8 - shift])
    assert torch.equal(given.warps[:, 0, 1][..., 8:-8], second[..., 8 + shift : -8 + shift])


def test_frames_go_on_as_their_border_and_events_end() -> None:
    first, second = frames(1, (5, 20))
    pair = network("rrin_events").prepare(first, second, EventCounts(torch.ones(1, 2, 3, 5, 20), torch.ones(1, 2)))
    assert pair.frame_0.shape[-2:] == (16, 32) and torch.equal(pair.frame_0[..., :5, :20], first)
    assert torch.equal(pair.frame_1[..., 20:], pair.frame_1[..., 19:20].expand(-1, -1, -1, 12))
    assert torch.equal(pair.frame_1[..., 5:, :], pair.frame_1[..., 4:5, :].expand(-1, -1, 11, -1))
    assert float(pair.events.off_on.sum()) == 2 * 3 * 5 * 20


@pytest.mark.parametrize(
    "name", [name for name in FRAME_FED if name not in (*FROM_CANDIDATES, *FROM_MOTION, "timelens")]
)
def test_a_fresh_network_is_a_cross_fade_at_any_size(name: str) -> None:
    # so nothing is resampled, shifted or mixed with what was put around
    first, second = frames(2, (19, 35))
    with torch.no_grad():
        images = make(name)(first, second, TIMES, counts(2, (19, 35))).images
    t = torch.tensor(TIMES)[:, None, None, None]
    expected = (1 - t) * first[:, None] + t * second[:, None]
    torch.testing.assert_close(images, expected, rtol=0, atol=1e-6)


def test_a_fresh_light_network_is_its_candidate() -> None:
    first, second = frames(2, (19, 35))
    some = counts(2, (19, 35))
    with torch.no_grad():
        images = make("rrin_events_light")(first, second, TIMES, some).images
    torch.testing.assert_close(images, ramps(first, second, some, torch.tensor([TIMES] * 2)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", FRAME_FED)
def test_targets_may_come_in_any_number_and_order(name: str) -> None:
    made = network(name)
    first, second, some = *frames(2), counts(2)
    with torch.no_grad():
        together = made(first, second, TIMES, some)
        pair = made.prepare(first, second, some)
        for k in (2, 0, 1):
            alone = made.at(pair, TIMES[k : k + 1])
            # convolutions of other batch sizes add up in another order: some 1e-6 of values near 1, through 40 layers
            torch.testing.assert_close(alone.images[:, 0], together.images[:, k], rtol=0, atol=1e-4)
        own = made.at(pair, torch.tensor([TIMES, TIMES[::-1]]))
    torch.testing.assert_close(own.images[0], together.images[0], rtol=0, atol=1e-4)
    torch.testing.assert_close(own.images[1].flip(0), together.images[1], rtol=0, atol=1e-4)


@pytest.mark.parametrize("name", [name for name in FRAME_FED if name not in (*FROM_MOTION, "timelens")])
def test_the_first_flow_network_runs_once_per_pair(name: str) -> None:
    made = network(name)
    runs = []
    made.get_submodule("flow").register_forward_hook(lambda *_: runs.append(1))
    with torch.no_grad():
        made(*frames(), [k / 32 for k in range(1, 32)], counts())  # the paper's 30 to 960 fps
    assert len(runs) == 1


@pytest.mark.parametrize("name", FRAME_FED)
def test_grey_frames_are_colours_that_are_alike(name: str) -> None:
    made = network(name)
    first, second = frames(1, (20, 24), 1)
    some = counts(1, (20, 24))
    with torch.no_grad():
        grey = made(first, second, TIMES, some)
        colours = made(first.expand(-1, 3, -1, -1), second.expand(-1, 3, -1, -1), TIMES, some)
        one = network(name, colours=1)(first, second, TIMES, some)
    torch.testing.assert_close(grey.images, colours.images.mean(2, keepdim=True))
    assert grey.images.shape == one.images.shape == (1, 3, 1, 20, 24)


@pytest.mark.parametrize("name", FRAME_FED)
def test_a_network_of_one_colour_makes_the_luminance_of_images_and_frames_their_colours(name: str) -> None:
    made = network(name, colours=1)
    first, second, some = *frames(2, (20, 24)), counts(2, (20, 24))
    with torch.no_grad():
        seen = made(grey(first), grey(second), TIMES, some)
        images = made(first, second, TIMES, some)
        alike = made(grey(first).expand(-1, 3, -1, -1), grey(second).expand(-1, 3, -1, -1), TIMES, some)
    assert images.images.shape == images.blend.shape == (2, 3, 3, 20, 24)
    torch.testing.assert_close(grey(images.images), seen.images.clamp(min=0), rtol=0, atol=1e-4)
    torch.testing.assert_close(alike.images, seen.images.clamp(min=0).expand(-1, -1, 3, -1, -1), rtol=0, atol=1e-4)
    torch.testing.assert_close(images.flows_at, seen.flows_at)
    torch.testing.assert_close(images.warps, both_warped(first, second, seen.flows_at), rtol=0, atol=1e-5)
    darkest, brightest = images.warps.amin(2), images.warps.amax(2)
    assert bool(((images.blend > darkest - 1e-5) & (images.blend < brightest + 1e-5)).all())


def test_colours_come_from_the_frame_that_is_believed() -> None:
    """Halfway, of a frame that is red and one that is green, where the masks say that the second is not to be seen."""
    made = make("superslomo", colours=1)
    red, green = (torch.tensor(codes)[None, :, None, None].expand(1, 3, 16, 16) for codes in ((0.5, 0, 0), (0, 0.3, 0)))
    with torch.no_grad():
        made.get_submodule("refine.head").bias[4] = 20.0  # type: ignore[index, union-attr, operator]
        image = made(red, green, [0.5]).images
    torch.testing.assert_close(image[:, 0], red, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", FRAME_FED)
def test_events_of_a_sensor_with_fewer_pixels_are_taken(name: str) -> None:
    made = network(name)
    with torch.no_grad():
        images = made(*frames(1, (33, 48)), TIMES, counts(1, (11, 16))).images  # the paper's 1 : 9
        without = made(*frames(1, (33, 48)), TIMES).images
    assert images.shape == without.shape and torch.isfinite(images).all()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        *((name, {}) for name in FRAME_FED),
        ("rrin", {"gate": True}),
        ("rrin_slomo_events", {"events": "none", "flow": "dis"}),
        ("rrin_slomo_events", {"events": "none", "flow_input": "frames+events"}),
        ("rrin_slomo_events", {"events": "none", "flow_input": "frames+events", "flow": "dis"}),
    ],
)
def test_events_matter_where_a_network_takes_them_and_only_there(name: str, options: dict) -> None:
    made = network(name, **options)
    first, second = frames()
    with torch.no_grad():
        with_them, without = (made(first, second, TIMES, some).images for some in (counts(rate=1.0), counts(rate=0.0)))
    assert torch.equal(with_them, without) == (not made.spec.takes_events)


@pytest.mark.parametrize("candidate", ["base", "mixed", "softmax"])
def test_what_stands_still_and_sends_nothing_stays_as_it_is(candidate: str) -> None:
    made = network("rrin_events_light", candidate=candidate)
    frame, _ = frames(1, (40, 40))
    off_on = torch.zeros(1, 2, 4, 40, 40)
    off_on[..., 30:, 30:] = 1
    with torch.no_grad():
        images = made(frame, frame, TIMES, EventCounts(off_on, torch.full((1, 2), 0.15))).images
    still = images[..., :20, :20] - frame[:, None, :, :20, :20]
    # the candidate is exact to exp and log in float32; `softmax` blends it with warps by what flows the network has
    assert candidate == "softmax" or still.abs().max() < 2e-5
    no_events = made(frame, frame, TIMES).images
    assert (no_events - frame[:, None]).abs().max() > 1e-3  # a network without events has no gate


def test_a_candidate_in_the_blend_is_left_out_at_random_only_while_training() -> None:
    made = network("rrin_events", candidate="softmax", candidate_dropout=0.5)
    first, second, some = *frames(8), counts(8)
    with torch.no_grad():
        used = made(first, second, TIMES, some).weights[:, :, 2].amax((2, 3))
        assert (used > 0).all()
        dropped = made.train()(first, second, TIMES, some).weights[:, :, 2].amax((2, 3)) == 0
    assert 3 <= int(dropped.sum()) <= 21  # of 24, at one half: 4 standard deviations


@pytest.mark.parametrize("candidate", ["none", "input", "base", "mixed", "softmax"])
@pytest.mark.parametrize("coarse", [False, True])
@pytest.mark.parametrize("chroma", ["keyframes", "warps"])
def test_all_ways_with_a_candidate_teach_every_unet(candidate: str, coarse: bool, chroma: str) -> None:
    made = network("rrin_events", candidate=candidate, coarse=coarse, chroma=chroma, gate=True)
    given = made(*frames(1, (20, 24)), TIMES, counts(1, (20, 24)))
    (given.images.square().sum() + given.blend.square().sum()).backward()
    for name, parameter in made.named_parameters():
        assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name


@pytest.mark.parametrize(
    "options",
    [
        {"events": "bins"},
        {"events": "none", "refine": "none"},
        {"prepare": "unet"},
        {"events": "bins", "prepare": "unet", "flow_input": "frames+events"},
        {"reconstruct": "firenet"},
        {"reconstruct": "e2vid", "events": "bins"},
    ],
)
def test_all_parts_of_the_combined_system_learn(options: dict) -> None:
    made = network("rrin_slomo_events", **options)
    made(*frames(1, (20, 24)), TIMES, counts(1, (20, 24))).images.square().sum().backward()
    for name, parameter in made.named_parameters():
        assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name


def test_a_guided_combined_system_learns_from_a_flash_and_changes_nothing_elsewhere() -> None:
    """Light that comes and goes between two frames that are alike is nowhere in them, and no motion explains it."""
    frame, lit = frames(1, (32, 48))[0], (slice(8, 24), slice(8, 20))
    flash = torch.zeros(1, 2, 16, 32, 48, dtype=torch.uint8)
    flash[:, 1, 4, *lit] = flash[:, 0, 12, *lit] = 3  # ON, then OFF
    made = network("rrin_slomo_events", flow="guided")
    images = made(frame, frame, [0.5], EventCounts(flash, torch.full((1, 2), 0.15))).images
    images.square().sum().backward()
    for name, parameter in made.named_parameters():
        assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name
    torch.testing.assert_close(images[0, 0, :, :, 40:], frame[0, :, :, 40:], atol=1e-6, rtol=0)
    assert not torch.allclose(images[0, 0, :, *lit], frame[0, :, *lit], atol=1e-3)


def test_frozen_parts_are_not_taught_and_stay_as_in_use() -> None:
    made = network(
        "rrin_slomo_events", flow="pretrained", reconstruct="firenet", reconstruct_weights="pretrained"
    ).train()
    made(*frames(), TIMES, counts()).images.square().sum().backward()
    frozen = [parameter for name, parameter in made.named_parameters() if not parameter.requires_grad]
    assert {name.split(".")[0] for name, part in made.named_parameters() if not part.requires_grad} == {
        "flow",
        "reconstruct",
    }
    assert frozen and all(parameter.grad is None for parameter in frozen)
    assert not made.get_submodule("flow.module").training and made.get_submodule("combined").training


@pytest.mark.parametrize("recurrent", [False, True])
def test_bins_are_the_first_the_last_and_that_of_the_target(recurrent: bool) -> None:
    bins = torch.arange(5.0)[None, :, None, None].expand(2, 5, 3, 4)
    chosen = first_last_and_target(bins, torch.tensor([[0.0, 0.3, 0.6], [0.4, 0.9, 1.0]]))
    assert chosen[..., 0, 0].tolist() == [[[0, 4, 0], [0, 4, 1], [0, 4, 2]], [[0, 4, 2], [0, 4, 4], [0, 4, 4]]]
    made = network("slomo_events", events="bins", recurrent=recurrent)
    assert torch.isfinite(made(*frames(), TIMES, counts()).images).all()


def test_images_are_not_clipped() -> None:
    made = network("rrin_events")
    with torch.no_grad():
        made.get_submodule("residue.head").bias.fill_(2.0)  # type: ignore[union-attr]
    assert made(*frames(), TIMES).images.min() > 1.5


@pytest.mark.parametrize("layout", [rrin_layout(3, 4), slomo_layout(2)])
def test_heads_make_either_sign_alike(layout: Layout) -> None:
    """Motion to the left is as large as motion to the right: nothing bends what a head makes."""
    unet = Unet(2, 4, layout)
    seen = torch.rand(1, 2, 64, 64)
    with torch.no_grad():
        one = unet(seen)
        for of in unet.head.parameters():
            of.neg_()
        torch.testing.assert_close(unet(seen), -one)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"frame_1": torch.zeros(1, 3, 8, 9)}, "that are alike"),
        ({"frame_0": torch.zeros(1, 2, 8, 8), "frame_1": torch.zeros(1, 2, 8, 8)}, "C 3 or 1"),
        ({"times": [1.5]}, "outside of 0 ... 1"),
        ({"times": [float("nan")]}, "outside of 0 ... 1"),
        ({"times": torch.zeros(3, 2)}, "for 1 pairs"),
        ({"times": []}, r"times of shape \[0\]"),
        ({"times": "half"}, "times 'half': expected numbers"),
        ({"frame_0": np.zeros((1, 3, 8, 8), np.float32)}, "frames of ndarray: expected tensors"),
        ({"frame_1": [[0.5]]}, "frames of list: expected tensors"),
        ({"frame_1": torch.zeros(1, 3, 8, 8, dtype=torch.uint8)}, "frames of torch.uint8: expected tensors"),
        ({"frame_1": torch.zeros(1, 3, 8, 8, dtype=torch.float64)}, "frames of torch.float64: expected tensors"),
        ({"events": EventCounts.none(2, (8, 8))}, "stack one for each"),
        ({"events": Events.empty()}, "events of type Events: expected EventCounts"),
    ],
)
def test_what_cannot_be_meant_is_refused(change: dict, sentence: str) -> None:
    given = {"frame_0": torch.zeros(1, 3, 8, 8), "frame_1": torch.zeros(1, 3, 8, 8), "times": [0.5], **change}
    with pytest.raises(UsageError, match=sentence):
        make("rrin")(**given)
