"""Losses: 0 for what is right, finite where slopes could be infinite, and of float32 whatever they are given."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from pairs import counts, frames
from torch.nn import functional as F
from vgg16 import write_vgg16

from interp.losses import objectives
from interp.losses.objectives import reconstruction
from interp.losses.over_time import inconsistency, visibility
from interp.losses.perceptual import Perceptual
from interp.losses.terms import absolute, between_frames, charbonnier, laplacian, log_error, pyramid, smoothness
from interp.networks import make
from interp.networks.frame_fed import Interpolated
from interp.warp import flows_at, warp
from vid2ev import DataError, UsageError


@pytest.mark.parametrize("kind", [torch.float32, torch.float16, torch.bfloat16])
@pytest.mark.parametrize("term", [charbonnier, absolute, pyramid])
def test_what_is_exactly_right_has_a_finite_slope(term, kind: torch.dtype) -> None:
    images = torch.zeros(1, 3, 16, 16, dtype=kind, requires_grad=True)
    with torch.autocast("cpu", torch.float16):
        loss = term(images, images.detach())
    loss.backward()
    assert loss.dtype == torch.float32 and images.grad is not None and torch.isfinite(images.grad).all()
    assert float(loss.detach()) <= 1e-3 + 1e-9  # Charbonnier's epsilon


def test_charbonnier_is_the_formula() -> None:
    a, b = torch.rand(2, 1, 3, 9, 9, dtype=torch.float64)
    torch.testing.assert_close(charbonnier(a, b), ((a - b) ** 2 + 1e-6).sqrt().mean())


def test_sixteen_bits_do_not_round_differences() -> None:
    truth = torch.full((1, 1, 8, 8), 0.5)
    with torch.autocast("cpu", torch.bfloat16):
        assert float(absolute(truth + 1e-4, truth)) == pytest.approx(1e-4, rel=1e-3)


def test_a_pyramid_tells_scales_apart() -> None:
    zeros = torch.zeros(1, 1, 64, 64)
    checks = torch.ones(64, 64)
    checks[::2, ::2] = checks[1::2, 1::2] = -1
    even, fine = (0.1 * torch.ones(1, 1, 64, 64)), 0.1 * checks[None, None]
    # an even error is in the last level alone, a fine one in the first alone (but at the border)
    assert float(pyramid(even, zeros)) == pytest.approx(0.1, rel=1e-4)
    assert float(pyramid(fine, zeros)) == pytest.approx(0.1, rel=0.1)
    assert float(pyramid(even, zeros, 1)) == pytest.approx(0.1, rel=1e-5)
    for size in ((1, 1), (1, 5), (3, 2)):
        assert torch.isfinite(pyramid(torch.rand(2, 2, 3, *size), torch.rand(2, 2, 3, *size)))


@pytest.mark.parametrize("size", [(256, 256), (225, 203)])
def test_an_even_ramp_is_in_the_last_level_alone(size: tuple[int, int]) -> None:
    y, x = torch.meshgrid(*(torch.arange(side, dtype=torch.float64) for side in size), indexing="ij")
    ramp = 0.01 * x + 0.02 * y - 0.3
    inner = [level[0, 0, 6:-6, 6:-6] for level in laplacian(ramp[None, None])]  # no border reaches farther
    assert len(inner) == 5 and all(float(level.abs().max()) < 1e-12 for level in inner[:-1])
    torch.testing.assert_close(inner[-1], ramp[::16, ::16][6:-6, 6:-6], atol=1e-12, rtol=0)


@pytest.mark.parametrize("size", [(64, 48), (75, 90), (61, 33)])
def test_levels_of_a_pyramid_are_those_of_opencv(size: tuple[int, int]) -> None:
    image = torch.rand(size, dtype=torch.float64)
    lower = cv2.pyrDown(image.numpy(), borderType=cv2.BORDER_REPLICATE)
    detail = image.numpy() - cv2.pyrUp(lower, dstsize=size[::-1])
    fine, last = (level[0, 0].numpy() for level in laplacian(image[None, None], 2))
    np.testing.assert_allclose(last, lower, atol=1e-12)
    np.testing.assert_allclose(fine[2:-2, 2:-2], detail[2:-2, 2:-2], atol=1e-12)  # (its borders are mirrored)


def test_smooth_flows_cost_nothing_and_steps_what_they_are() -> None:
    assert float(smoothness(torch.ones(1, 4, 5, 6))) == 0 and float(smoothness(torch.ones(1, 4, 1, 1))) == 0
    across, down = torch.zeros(2, 1, 1, 3, 4)
    across[..., 2:] = 3.0
    down[..., 1:, :] = 5.0
    assert float(smoothness(across)) == pytest.approx(3.0 / 3)  # one of three differences across
    assert float(smoothness(down)) == pytest.approx(5.0 / 2)  # one of two down
    assert float(smoothness(across - down)) == pytest.approx(3.0 / 3 + 5.0 / 2)


def test_true_flows_carry_frames_into_each_other() -> None:
    first = torch.rand(1, 3, 12, 20)
    second = torch.roll(first, 2, dims=-1)
    flows = torch.zeros(1, 4, 12, 20)
    flows[:, 0], flows[:, 2] = 2, -2
    crop = slice(2, -2)
    assert torch.equal(warp(second, flows[:, :2])[..., crop], first[..., crop])
    assert float(between_frames(flows, first, second)) < 0.3 * float(between_frames(-flows, first, second))


def test_opposite_errors_of_colours_do_not_cancel() -> None:
    frame, earlier = torch.full((1, 3, 4, 4), 0.5), torch.full((1, 3, 4, 4), 0.5)
    frame[:, 0] += 0.3
    frame[:, 1] -= 0.3
    seen = visibility(frame, earlier, torch.zeros(1, 2, 4, 4))
    torch.testing.assert_close(seen, torch.full((1, 1, 4, 4), float(torch.exp(torch.tensor(-50 * 0.18)))))


def test_codes_to_255_are_refused_where_they_would_hide_everything() -> None:
    frames, flows = torch.full((1, 3, 1, 4, 4), 200.0), torch.zeros(1, 2, 2, 4, 4)
    with pytest.raises(UsageError, match=r"expected 0 \.\.\. 1"):
        reconstruction(frames, frames, absolute, flows)


def test_flicker_on_dark_frames_is_as_large_as_it_is() -> None:
    image = torch.full((1, 1, 6, 6), 1e-6, requires_grad=True)
    loss = inconsistency(image, torch.zeros(1, 1, 6, 6), torch.zeros(1, 2, 6, 6), torch.ones(1, 1, 6, 6))
    loss.backward()
    assert float(loss.detach()) == pytest.approx(1e-6, rel=1e-3)  # not divided by its brightness
    assert image.grad is not None and float(image.grad.abs().sum()) == pytest.approx(1.0)


def test_gradients_go_through_the_earlier_image_only_if_told() -> None:
    images = torch.rand(2, 1, 1, 6, 6, requires_grad=True)
    for through in (False, True):
        loss = inconsistency(images[1], images[0], torch.zeros(1, 2, 6, 6), torch.ones(1, 1, 6, 6), through)
        (grad,) = torch.autograd.grad(loss, images)
        assert bool(grad[0].any()) == through and grad[1].any()


def test_the_stand_in_for_features_is_always_the_same_and_not_trained() -> None:
    torch.manual_seed(0)
    images, truth = torch.rand(2, 2, 3, 3, 20, 24)
    torch.manual_seed(1)
    one = Perceptual()
    torch.manual_seed(2)
    other = Perceptual()
    assert float(one(images, truth)) == float(other(images, truth)) > 0 == float(one(truth, truth))
    assert not any(parameter.requires_grad for parameter in one.parameters())
    images = torch.zeros(1, 1, 5, 7, requires_grad=True)
    one(images, torch.rand(1, 1, 5, 7)).backward()
    assert images.grad is not None and torch.isfinite(images.grad).all() and images.grad.any()


def test_features_mind_blur_more_than_brightness() -> None:
    features, truth = Perceptual(), torch.rand(1, 3, 32, 32)
    blurred = F.avg_pool2d(F.pad(truth, (1, 1, 1, 1), mode="replicate"), 3, 1)
    offset = truth + (blurred - truth).abs().mean()
    # the border, where black begins, is what sees brightness at all
    assert float(features(blurred, truth)) > 4 * float(features(offset, truth))


def test_vgg16_is_taken_from_a_file(tmp_path: Path) -> None:
    from safetensors.torch import save_file

    write_vgg16(tmp_path / "vgg16.safetensors")
    features = Perceptual(tmp_path / "vgg16.safetensors", squared=True)
    assert sum(parameter.numel() for parameter in features.parameters()) == 7_635_264  # up to conv4_3
    assert torch.isfinite(features(torch.rand(1, 3, 16, 16), torch.rand(1, 3, 16, 16)))
    save_file({"features.0.bias": torch.zeros(64)}, tmp_path / "other.safetensors")
    for name in ("other.safetensors", "none.safetensors"):
        with pytest.raises(DataError, match="does not hold the weights of VGG16"):
            Perceptual(tmp_path / name)


# The weights, by the name of the objective.  Warps are four differences, of both warps and of the frames there and
# back, and flows are two.
WARPS = {"warps": 4 * 0.4 * 255, "smoothness": 2 * 1}
WEIGHTS: dict[str, dict[str, float]] = {
    # Jiang et al. (2018), "Super SloMo", section 3.3, for codes to 255: 0.8, 0.005, 0.4 and 1
    "super_slomo": {"image": 0.8 * 255, "features": 0.005} | WARPS,
    "flows": {"flows": 10} | WARPS,  # ours, beside Super SloMo's
    "residue": {"image": 1},
    "supervised_residue": {"image": 1, "blend": 0.5, "warps": 0.25, "pyramid": 0.1},  # ours
    "by_ratio": {"image": 0.1},  # ours
    "time_lens": {"image": 1, "features": 0.1},  # Tulyakov et al. (2021), "Time Lens", CVPR
    "E2VID": {"image": 1, "features": 1},  # event_cnn_minimal
    "FireNet": {"image": 1, "features": 1, "time": 2},  # event_cnn_minimal
    # Lai et al. (2018), "Learning blind video temporal consistency": features 10, both of time 100; the others are ours
    "hdr": {"image": 100, "time": 100, "long time": 100, "features": 10, "beyond": 3},
}
MEANS = ("absolute", "charbonnier", "log_error", "pyramid", "smoothness", "inconsistency")


@pytest.mark.parametrize("name", WEIGHTS)
def test_every_term_is_weighed_as_its_source_says(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of differences that are all 1, the weights are left."""
    for mean in MEANS:
        monkeypatch.setattr(objectives, mean, one)
    monkeypatch.setattr(objectives, "between_frames", lambda *_: 2 * one())  # (there and back)
    truth, flows = torch.rand(1, 4, 3, 8, 8), torch.zeros(1, 3, 2, 8, 8)
    pair, flow = (truth[:, 0], truth[:, 3]), torch.zeros(1, 4, 8, 8)
    made = Interpolated(truth, flow, flow[:, None], truth[:, :, None], flow[:, None], truth)
    terms = {
        "super_slomo": lambda: objectives.super_slomo(made, *pair, truth, one),
        "flows": lambda: objectives.flows(made, *pair, truth, flow),
        "residue": lambda: objectives.residue(made, truth),
        "supervised_residue": lambda: objectives.supervised_residue(made, truth),
        "by_ratio": lambda: objectives.by_ratio(made, truth),
        "time_lens": lambda: objectives.time_lens(made, truth, one),
        "E2VID": lambda: objectives.reconstruction(truth, truth, one),
        "FireNet": lambda: objectives.reconstruction(truth, truth, one, flows),
        "hdr": lambda: objectives.hdr(truth, truth, flows, flows, one, truth > 0.5),
    }[name]()
    assert {term: float(weighed) for term, weighed in terms.items()} == pytest.approx(WEIGHTS[name])


def one(*_: object) -> torch.Tensor:
    """A difference of 1, whatever is compared."""
    return torch.tensor(1.0)


def test_super_slomo_is_weighed_as_published() -> None:
    made = make("superslomo")(*(pair := frames(1, (16, 16))), [0.5])
    truth = torch.rand(1, 1, 3, 16, 16)
    terms = objectives.super_slomo(made, *pair, truth, Perceptual(squared=True))
    # the flows of a fresh network are 0, and so the warps are the frames
    first, second = pair
    warps = absolute(first, truth[:, 0]) + absolute(second, truth[:, 0]) + 2 * absolute(first, second)
    torch.testing.assert_close(terms["warps"], 102 * warps)
    torch.testing.assert_close(terms["image"], 204 * absolute(made.images, truth))
    assert float(terms["smoothness"].detach()) == 0 and set(terms) == {"image", "warps", "features", "smoothness"}


def test_super_slomo_learns_flows_before_they_are_refined() -> None:
    network = make("superslomo", flow_scale=4)
    for part in (network.flow, network.refine):
        torch.nn.init.normal_(part.head.bias, std=0.5)
    pair = frames(1, (16, 16))
    made, truth = network(*pair, [0.25]), torch.rand(1, 1, 3, 16, 16)
    terms = objectives.carried(made, *pair, truth)
    at = flows_at(made.flows, torch.tensor([[0.25]]))
    carried = [absolute(warp(frame, at[:, 0, k : k + 2]), truth[:, 0]) for frame, k in zip(pair, (0, 2), strict=True)]
    expected = sum(carried) + between_frames(made.flows, *pair)
    torch.testing.assert_close(terms["warps"], 102 * expected)
    assert not torch.allclose(at, made.flows_at)


def test_warps_are_looked_at_while_training_begins() -> None:
    made = make("rrin_events_light")(*frames(1, (16, 16)), [0.5], counts(1, (16, 16)))
    truth = torch.rand(1, 1, 3, 16, 16)
    early, later = (objectives.supervised_residue(made, truth, progress) for progress in (0.1, 0.5))
    torch.testing.assert_close(early["warps"], 0.125 * charbonnier(made.warps, truth[:, :, None]))
    assert float(later["warps"].detach()) == 0 and torch.equal(early["image"], later["image"])
    assert set(objectives.residue(made, truth)) == {"image"}
    assert set(objectives.time_lens(made, truth, Perceptual())) == {"image", "features"}


def test_a_decibel_counts_the_same_in_every_picture() -> None:
    truth = torch.rand(1, 2, 3, 16, 16)
    wrong = torch.tensor([0.01, 0.1])[None, :, None, None, None] * torch.randn(truth.shape)
    here, better = (log_error(truth + scale * wrong, truth) for scale in (1.0, 0.5))
    torch.testing.assert_close(here - better, torch.tensor(math.log(4.0)), atol=0.02, rtol=0)
    only_the_hard_one = torch.tensor([1.0, 0.5])[None, :, None, None, None]
    torch.testing.assert_close(
        log_error(truth + only_the_hard_one * wrong, truth), (here + better) / 2, atol=0.02, rtol=0
    )
    assert float(log_error(truth, truth)) == pytest.approx(math.log(1e-6))


def test_the_first_picture_from_events_does_not_count() -> None:
    truth, features = torch.rand(1, 3, 1, 16, 16), Perceptual()
    images = truth.clone()
    images[:, 0] = 9.0
    terms = objectives.reconstruction(images, truth, features)
    assert all(float(term) == 0 for term in terms.values()) and set(terms) == {"image", "features"}
    still = truth[:, :1].expand(-1, 3, -1, -1, -1)
    flows = torch.zeros(1, 2, 2, 16, 16)
    assert float(objectives.reconstruction(still, still, features, flows)["time"]) == 0
    assert float(objectives.reconstruction(images, still, features, flows)["time"]) > 1


def test_an_error_by_ratio_is_of_what_is_asked_for() -> None:
    truth, where = torch.zeros(3, 1, 4, 4), torch.zeros(3, 1, 4, 4, dtype=torch.bool)
    where[0, :, :2], where[1, :, 0, 0] = True, True
    images = truth + torch.where(where, torch.tensor([0.1, 0.01, 5.0])[:, None, None, None], 7.0)
    expected = (math.log(1e-2 + 1e-6) + math.log(1e-4 + 1e-6)) / 2  # nothing of the third
    assert float(log_error(images, truth, where)) == pytest.approx(expected, rel=1e-5)


def test_hdr_looks_at_the_frame_before_and_at_the_first() -> None:
    still, flows = torch.rand(1, 1, 3, 16, 16).expand(-1, 4, -1, -1, -1), torch.zeros(1, 3, 2, 16, 16)
    drifting = still + torch.tensor([0.0, 0.01, 0.02, 0.03])[None, :, None, None, None]
    terms = objectives.hdr(drifting, still, flows, flows, Perceptual(), still > 2)
    assert float(terms["time"]) == pytest.approx(100 * 0.01, rel=1e-3)
    assert float(terms["long time"]) == pytest.approx(100 * (0.02 + 0.03) / 2, rel=1e-3)
    assert all(
        float(term) == 0 for term in objectives.hdr(still, still, flows, flows, Perceptual(), still > 2).values()
    )
    assert (
        float(
            objectives.hdr(still[:, :2], still[:, :2], flows[:, :1], flows[:, :1], Perceptual(), still[:, :2] > 2)[
                "long time"
            ]
        )
        == 0
    )
