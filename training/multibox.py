# SPDX-License-Identifier: Apache-2.0
"""Which prior answers for which object, and the loss of SSD (Liu et al., 2016, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

MATCH_IOU, IGNORE_IOU = 0.4, 0.3
"""A prior that overlaps an object by the first is positive; between the two it is neither positive nor negative."""

LEAST_NEGATIVES = 20
"""An image without objects still teaches by its hardest negatives."""

NEITHER = -1


def corners(boxes: Tensor) -> Tensor:
    """cx cy w h to x_min y_min x_max y_max."""
    half = boxes[..., 2:] / 2
    return torch.cat([boxes[..., :2] - half, boxes[..., :2] + half], dim=-1)


def pairwise_iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union ``(N, M)`` of corner boxes."""
    low = torch.maximum(a[:, None, :2], b[None, :, :2])
    high = torch.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = (high - low).clamp(min=0).prod(dim=-1)
    areas = [(boxes[:, 2:] - boxes[:, :2]).clamp(min=0).prod(dim=-1) for boxes in (a, b)]
    return shared / (areas[0][:, None] + areas[1][None] - shared).clamp(min=1e-9)


def encode(boxes: Tensor, priors: Tensor, variances: Tensor) -> Tensor:
    """Corner boxes ``(A, 4)`` as offsets from priors; the inverse of `objreg_ros.detector.boxes.decode`."""
    centre, size = (boxes[:, :2] + boxes[:, 2:]) / 2, (boxes[:, 2:] - boxes[:, :2]).clamp(min=1e-4)
    offset = (centre - priors[:, :2]) / priors[:, 2:]
    return torch.cat([offset / variances[:2], torch.log(size / priors[:, 2:]) / variances[2:]], dim=1)


@dataclass
class Matcher:
    """Matches the objects of one image to the priors ``(A, 4)`` (cx cy w h in 0..1)."""

    priors: Tensor
    variances: Tensor

    def __post_init__(self) -> None:
        self.prior_corners = corners(self.priors)

    def __call__(self, boxes: Tensor, classes: Tensor, difficult: Tensor) -> tuple[Tensor, Tensor]:
        """``target (A,) int64`` (0 background, 1 + class, `NEITHER`) and ``offsets (A, 4)``.

        ``boxes (N, 4)`` corners in 0..1; objects that are ``difficult (N,) bool`` make their priors `NEITHER`.
        """
        target = torch.zeros(len(self.priors), dtype=torch.int64)
        offsets = torch.zeros(len(self.priors), 4)
        if len(boxes) == 0:
            return target, offsets
        overlap = pairwise_iou(self.prior_corners, boxes)
        best, which = overlap.max(dim=1)
        own = overlap.argmax(dim=0)
        for index in torch.nonzero(overlap.amax(dim=0) > 0.1).flatten():  # each object keeps its best prior
            best[own[index]], which[own[index]] = 1.0, index
        matched = best >= MATCH_IOU
        target[matched] = classes[which[matched]] + 1
        target[(best >= IGNORE_IOU) & ~matched] = NEITHER
        target[(best >= IGNORE_IOU) & difficult[which]] = NEITHER
        offsets[matched] = encode(boxes[which[matched]], self.priors[matched], self.variances)
        return target, offsets


def multibox_loss(
    loc: Tensor, logits: Tensor, target: Tensor, offsets: Tensor, negatives: int = 3
) -> tuple[Tensor, Tensor]:
    """The location and the confidence loss of a batch, each per positive prior, with so many hard negatives to one."""
    positive = target > 0
    count = positive.sum().clamp(min=1)
    location = functional.smooth_l1_loss(loc[positive], offsets[positive], reduction="sum", beta=0.5) / count
    entropy = functional.cross_entropy(logits.flatten(0, 1), target.clamp(min=0).flatten(), reduction="none")
    entropy = entropy.view_as(target)
    hardness = torch.where(target == 0, entropy.detach(), torch.full_like(entropy, -1.0))
    wanted = (positive.sum(dim=1, keepdim=True) * negatives).clamp(min=LEAST_NEGATIVES)
    hardest = hardness.topk(int(wanted.max().clamp(max=target.shape[1])), dim=1).indices
    within = torch.arange(hardest.shape[1], device=hardest.device) < wanted
    chosen = positive | (torch.zeros_like(positive).scatter(1, hardest, within) & (target == 0))
    return location, entropy[chosen].sum() / count
