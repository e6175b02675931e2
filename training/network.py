# SPDX-License-Identifier: Apache-2.0
"""A small MobileNet-SSD: depthwise separable convolutions (Howard et al., "MobileNets", 2017), five levels of SSD heads
(Liu et al., "SSD", 2016), and a top-down path that gives the fine levels the context of the coarse ones (Lin et al.,
"Feature Pyramid Networks", 2017), without which small objects have no surroundings to be recognised by.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.thinning import ThinningConvolution

STEM = ((16, 2), (32, 2), (32, 1))
TO_STRIDE_8 = ((96, 2), (128, 1), (128, 1))
TO_STRIDE_16 = ((256, 2), (256, 1), (256, 1), (256, 1), (256, 1))
TO_STRIDE_32 = ((384, 2), (384, 1))
TO_STRIDE_64 = ((256, 2),)
TO_STRIDE_128 = ((128, 2),)
DEEPER = (0, 4, 3, 0, 0)
"""So many residual blocks end each of these stages."""

HEAD_WIDTH = 96

TOWERS_DEEPER = (1, 1, 1, 0, 0)
"""So many end the tower of each level: small objects are recognised by detail and context, which meet only here."""

Enlarge = Callable[[Tensor, torch.Size], Tensor]
"""A map ``(B, C, h, w)`` and a size (H, W) to the map ``(B, C, H, W)`` of nearest neighbours."""

RARE = -4.0
"""The log odds of an object at a prior, to begin with."""


def convolution(inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation, ReLU."""
    thins = stride == 2 and groups == inputs == outputs
    return nn.Sequential(
        ThinningConvolution(inputs)
        if thins
        else nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


def separable(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    """A depthwise 3 x 3 convolution and a pointwise one."""
    return nn.Sequential(convolution(inputs, inputs, 3, stride, inputs), convolution(inputs, outputs, 1))


class Residual(nn.Module):
    """A separable block that is added to its input, and adds nothing to begin with (Goyal et al., "Accurate,
    Large Minibatch SGD", 2017, section 5.1)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.depthwise = convolution(width, width, 3, groups=width)
        self.pointwise = nn.Sequential(nn.Conv2d(width, width, 1, bias=False), nn.BatchNorm2d(width))
        nn.init.zeros_(self.pointwise[1].weight)

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.pointwise(self.depthwise(x)))


def stage(inputs: int, blocks: tuple[tuple[int, int], ...], deeper: int = 0) -> nn.Sequential:
    """Separable blocks of (width, stride), one after the other, then so many residual ones."""
    widths = [inputs, *(width for width, _ in blocks)]
    plain = [separable(widths[i], width, stride) for i, (width, stride) in enumerate(blocks)]
    return nn.Sequential(*plain, *(Residual(widths[-1]) for _ in range(deeper)))


def tower(inputs: int, deeper: int) -> nn.Sequential:
    """What stands between a level and its head."""
    return stage(inputs, ((HEAD_WIDTH, 1), (HEAD_WIDTH, 1)), deeper)


class MobileNetSsd(nn.Module):
    """``(B, 3, H, W)`` in about -1..1 to ``loc (B, A, 4)`` and the log odds of the classes ``(B, A, C)``."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.classes = classes
        stem = nn.Sequential(convolution(3, STEM[0][0], 3, STEM[0][1]), stage(STEM[0][0], STEM[1:]))
        plans = (TO_STRIDE_8, TO_STRIDE_16, TO_STRIDE_32, TO_STRIDE_64, TO_STRIDE_128)
        widths = [STEM[-1][0], *(plan[-1][0] for plan in plans)]
        self.stages = nn.ModuleList([stage(*parts) for parts in zip(widths[:-1], plans, DEEPER, strict=True)])
        self.stages[0] = nn.Sequential(stem, self.stages[0])
        self.laterals = nn.ModuleList([nn.Conv2d(width, HEAD_WIDTH, 1) for width in widths[1:4]])
        towers = [HEAD_WIDTH] * 3 + widths[4:]
        self.towers = nn.ModuleList([tower(*parts) for parts in zip(towers, TOWERS_DEEPER, strict=True)])
        self.heads = nn.ModuleList([nn.Conv2d(HEAD_WIDTH, 4 + classes, 1) for _ in towers])
        self.apply(_initialise)
        for head in self.heads:
            _expect_background(head)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        levels = []
        for one in self.stages:
            x = one(x)
            levels.append(x)
        maps = self.tower_maps(levels)
        joined = torch.cat([self._rows(head(x)) for head, x in zip(self.heads, maps, strict=True)], dim=1)
        return joined[..., :4], joined[..., 4:]

    def tower_maps(self, levels: list[Tensor], enlarge: Enlarge = functional.interpolate) -> list[Tensor]:
        """What the heads see, of the maps of all stages; ``enlarge`` is nearest neighbours by whatever operations."""
        return [one(level) for one, level in zip(self.towers, self._top_down(levels, enlarge), strict=True)]

    def _top_down(self, levels: list[Tensor], enlarge: Enlarge) -> list[Tensor]:
        """The three finest levels with the context from above, the others as they are."""
        coarse = self.laterals[2](levels[2])
        merged = [coarse]
        for level in (1, 0):
            size = levels[level].shape[2:]
            coarse = self.laterals[level](levels[level]) + enlarge(coarse, size)
            merged.insert(0, coarse)
        return merged + levels[3:]

    def _rows(self, head: Tensor) -> Tensor:
        """``(B, 4 + C, h, w)`` to one row a prior, in the order of `training.priors.make_priors`."""
        return head.permute(0, 2, 3, 1).reshape(head.shape[0], -1, 4 + self.classes)


def _initialise(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d):
        nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
        if module.bias is not None:
            nn.init.zeros_(module.bias)


def _expect_background(head: nn.Module) -> None:
    """Start with small outputs and objects unlikely, as they are at almost all priors."""
    assert isinstance(head, nn.Conv2d) and head.bias is not None
    nn.init.normal_(head.weight, std=0.01)
    head.bias.data[4:] = RARE
