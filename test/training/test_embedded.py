# SPDX-License-Identifier: Apache-2.0
"""The deployed form of a network must give the network's own answers."""

from __future__ import annotations

import pytest
import torch

from training.embedded import Embedded, FromPixels, GroupedStem, centred, enlarged
from training.network import MobileNetSsd, Residual, convolution


def restless(network: torch.nn.Module) -> torch.nn.Module:
    """The network with statistics in its normalisations that differ by channel."""
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(module.running_mean, -0.5, 0.5)
            torch.nn.init.uniform_(module.running_var, 0.5, 2.0)
            torch.nn.init.uniform_(module.bias, -0.5, 0.5)
    return network.eval()


def test_the_grouped_first_convolution_is_the_first_convolution() -> None:
    torch.manual_seed(2)
    block = restless(convolution(3, 5, 3, 2))
    picture = torch.rand(1, 10, 24, 3)
    with torch.no_grad():
        expected, got = block(picture.permute(0, 3, 1, 2)), GroupedStem(block)(picture)
    assert got.shape == (1, 5, 5, 12) and torch.allclose(expected, got, atol=1e-5)


def test_the_deployed_network_gives_the_answers_of_the_trained_one_and_a_background_of_0() -> None:
    torch.manual_seed(3)
    network = restless(MobileNetSsd(4))
    pixels = torch.randint(0, 256, (1, 64, 96, 3), dtype=torch.uint8)
    with torch.no_grad():
        loc, odds = network(centred(pixels.float()).permute(0, 3, 1, 2))
        deployed, logits = FromPixels(Embedded(network))(pixels)
    assert torch.allclose(loc, deployed, atol=1e-4) and torch.allclose(odds, logits[..., 1:], atol=1e-4)
    assert (logits[..., 0] == 0).all()


@pytest.mark.parametrize("size", [(4, 6), (6, 9), (5, 8)])
def test_a_map_enlarged_by_copies_is_that_of_nearest_neighbours(size: tuple[int, int]) -> None:
    features = torch.rand(1, 7, 2, 3)
    expected = torch.nn.functional.interpolate(features, size, mode="nearest")
    assert torch.equal(expected, enlarged(features, torch.Size(size)))


def test_a_residual_block_adds_nothing_to_begin_with() -> None:
    features = torch.rand(2, 8, 6, 6)
    assert torch.equal(Residual(8)(features), features)
