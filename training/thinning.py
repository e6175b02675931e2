# SPDX-License-Identifier: Apache-2.0
"""Depthwise convolutions of stride 2 whose gradient is fast in bfloat16 on a CPU."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional


class ThinningConvolution(nn.Conv2d):
    """A depthwise 3 x 3 convolution of stride 2, as `torch.nn.Conv2d` computes it.

    oneDNN has no fast kernel for the gradient by its input in bfloat16: 20 to 40 ms a layer for a batch of 8 where the
    convolution itself takes one or two. Hence that gradient is a convolution of stride 1 here, of the outputs'
    gradient with zeros in between and the kernel turned (Dumoulin and Visin, "A guide to convolution arithmetic",
    2016, section 4.5).
    """

    def __init__(self, width: int) -> None:
        super().__init__(width, width, 3, 2, 1, groups=width, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        if not (torch.is_grad_enabled() and x.dtype == torch.bfloat16 and x.device.type == "cpu"):
            return super().forward(x)
        with torch.autocast("cpu", enabled=False):
            thinned = _Thinned.apply(x, self.weight.to(x.dtype))
        assert isinstance(thinned, Tensor)
        return thinned


class _Thinned(torch.autograd.Function):
    @staticmethod
    def forward(context: Any, x: Tensor, weight: Tensor) -> Tensor:  # type: ignore[override]
        context.save_for_backward(x, weight)
        return functional.conv2d(x, weight, stride=2, padding=1, groups=len(weight))

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, Tensor]:  # type: ignore[override]
        x, weight = context.saved_tensors
        by_weight = torch.ops.aten.convolution_backward(
            gradient, x, weight, None, (2, 2), (1, 1), (1, 1), False, (0, 0), len(weight), (False, True, False)
        )[1]
        return by_input(gradient, weight, x.shape), by_weight


def by_input(gradient: Tensor, weight: Tensor, shape: torch.Size) -> Tensor:
    """The gradient ``(B, C, H, W)`` by an input of ``shape``, of that by the outputs."""
    batch, width, height, length = shape
    spread = gradient.new_zeros((batch, height, length, width))
    spread[:, ::2, ::2] = gradient.permute(0, 2, 3, 1)
    return functional.conv2d(spread.permute(0, 3, 1, 2), weight.flip(2, 3), padding=1, groups=width)
