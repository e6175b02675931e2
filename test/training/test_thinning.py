# SPDX-License-Identifier: Apache-2.0
"""The fast gradient of a depthwise convolution of stride 2 is the gradient of that convolution."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional

from training.thinning import ThinningConvolution, by_input


@pytest.mark.parametrize(("height", "width"), [(12, 16), (15, 20), (8, 9), (1, 2)])
def test_the_gradient_by_the_input_is_that_of_the_convolution_for_even_and_odd_sizes(height: int, width: int) -> None:
    torch.manual_seed(1)
    x, weight = torch.randn(2, 5, height, width, requires_grad=True), torch.randn(5, 1, 3, 3)
    y = functional.conv2d(x, weight, stride=2, padding=1, groups=5)
    above = torch.randn_like(y)
    wanted = torch.autograd.grad(y, x, above)[0]
    assert torch.allclose(by_input(above, weight, x.shape), wanted, atol=1e-5)


def test_in_bfloat16_both_gradients_come_back_as_from_floats() -> None:
    torch.manual_seed(2)
    layer, x = ThinningConvolution(8), torch.randn(2, 8, 10, 14)
    above = torch.randn(2, 8, 5, 7)
    found = []
    for dtype in (torch.float32, torch.bfloat16):
        layer.zero_grad()
        source = x.detach().clone().to(dtype).requires_grad_()
        with torch.autocast("cpu", torch.bfloat16, enabled=dtype == torch.bfloat16):
            y = layer(source)
        assert y.dtype == dtype
        y.backward(above.to(dtype))
        assert source.grad is not None and layer.weight.grad is not None and layer.weight.grad.dtype == torch.float32
        found.append((source.grad.float(), layer.weight.grad.clone()))
    for exact, rounded in zip(*found, strict=True):
        assert torch.allclose(exact, rounded, atol=0.03 * float(exact.abs().max()))


def test_without_gradients_it_is_a_plain_convolution_which_an_exporter_can_trace() -> None:
    layer, x = ThinningConvolution(4), torch.randn(1, 4, 6, 6)
    with torch.no_grad():
        assert torch.equal(layer(x), functional.conv2d(x, layer.weight, stride=2, padding=1, groups=4))
