# SPDX-License-Identifier: Apache-2.0
"""The network as it is deployed: the same answers by other convolutions, which int8 kernels on channels-last pictures
compute faster, and the outputs of the contract `ssd_raw/1`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from training.network import MobileNetSsd

GROUP = 4
"""The first convolution takes so many neighbouring pixels as the channels of one: three channels alone fill no
register, and in a channels-last picture this costs a new shape and no copy."""

CENTRE, SCALE = 128.0, 1 / 128
"""Of the pixels, before the network: exactly what an uint8 tensor of zero point 128 and scale 1/128 means."""


def centred(pixels: Tensor) -> Tensor:
    """Pixels 0..255 as the network takes them."""
    return (pixels - CENTRE) * SCALE


BOX = 4
"""So many numbers of a head's answer are of the box."""


class GroupedStem(nn.Module):
    """A 3 x 3 convolution of stride 2 with normalisation and ReLU on ``(1, H, W, 3)``; gives ``(1, C, H/2, W/2)``."""

    def __init__(self, block: nn.Sequential) -> None:
        super().__init__()
        narrow = fuse_conv_bn_eval(block[0], block[1])
        assert narrow.bias is not None and narrow.kernel_size == (3, 3) and narrow.stride == (2, 2)
        outputs, self.pixels = narrow.out_channels, GROUP // 2
        self.wide = nn.Conv2d(GROUP * 3, self.pixels * outputs, (3, 2), (2, 1))
        self.wide.weight.data = _grouped(narrow.weight.data, self.pixels)
        self.wide.bias = nn.Parameter(narrow.bias.data.repeat(self.pixels))

    def forward(self, x: Tensor) -> Tensor:
        _, height, width, _ = x.shape
        grouped = x.reshape(1, height, width // GROUP, GROUP * 3).permute(0, 3, 1, 2)
        y = torch.relu(self.wide(nn.functional.pad(grouped, (1, 0, 1, 1))))
        return y.permute(0, 2, 3, 1).reshape(1, height // 2, width // 2, -1).permute(0, 3, 1, 2)


def _grouped(weight: Tensor, pixels: int) -> Tensor:
    """``(C, 3, 3, 3)`` as ``(pixels C, GROUP 3, 3, 2)``: pixel ``p`` sees columns 2p-1 to 2p+1."""
    outputs = weight.shape[0]
    wide = weight.new_zeros(pixels, outputs, 2 * GROUP, 3, 3)
    for pixel in range(pixels):
        for tap in range(3):
            wide[pixel, :, GROUP + 2 * pixel - 1 + tap] = weight[..., tap]
    return wide.reshape(pixels * outputs, 2, GROUP * 3, 3).permute(0, 2, 3, 1).contiguous()


def enlarged(x: Tensor, size: torch.Size) -> Tensor:
    """The map of nearest neighbours as `torch.nn.functional.interpolate` gives it, by copies of whole cells.

    onnxruntime's resizing of int8 maps goes pixel by pixel and channel by channel and takes six times as long.
    """
    (_, channels, height, width), (tall, wide) = x.shape, size
    rows, columns = torch.arange(tall) * height // tall, torch.arange(wide) * width // wide
    cells = x.permute(0, 2, 3, 1).reshape(1, height * width, channels)
    copies = cells.index_select(1, (rows[:, None] * width + columns).reshape(-1))
    return copies.reshape(1, tall, wide, channels).permute(0, 3, 1, 2)


def as_product(head: nn.Module) -> nn.Linear:
    """The pointwise convolution of a head as a product of matrices with a 0 for the background after the box.

    A product takes the cells of a map as they lie, channels last, and can give floats for int8.
    """
    assert isinstance(head, nn.Conv2d) and head.bias is not None
    product = nn.Linear(head.in_channels, 1 + head.out_channels)
    for part, whole in ((product.weight.data, head.weight.data[..., 0, 0]), (product.bias.data, head.bias.data)):
        part.copy_(torch.cat([whole[:BOX], torch.zeros_like(whole[:1]), whole[BOX:]]))
    return product


class Embedded(nn.Module):
    """``(1, H, W, 3)`` of centred pixels in; ``loc (1, A, 4)`` and ``logits (1, A, 1 + C)`` out.

    Log odds of the classes beside a background of 0 are logits for a softmax: for one likely class it is the sigmoid.
    """

    def __init__(self, network: MobileNetSsd) -> None:
        super().__init__()
        network = network.eval()
        first = network.stages[0][0]
        self.stem = GroupedStem(first[0])
        self.stages = nn.ModuleList([nn.Sequential(first[1], network.stages[0][1]), *network.stages[1:]])
        self.network = network
        self.heads = nn.ModuleList([as_product(head) for head in network.heads])

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        x, levels = self.stem(x), []
        for stage in self.stages:
            x = stage(x)
            levels.append(x)
        towers = self.network.tower_maps(levels, enlarged)
        rows = [x.permute(0, 2, 3, 1).reshape(-1, x.shape[1]) for x in towers]
        answers = torch.cat([head(x) for head, x in zip(self.heads, rows, strict=True)])[None]
        return answers[..., :BOX], answers[..., BOX:]


class FromPixels(nn.Module):
    """The same for uint8 pixels, in floats."""

    def __init__(self, embedded: Embedded) -> None:
        super().__init__()
        self.embedded = embedded

    def forward(self, rgb: Tensor) -> tuple[Tensor, Tensor]:
        return self.embedded(centred(rgb.to(torch.float32)))
