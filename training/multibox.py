# SPDX-License-Identifier: Apache-2.0
"""Which prior answers for which object, and what its answer costs.

The assignment is the task-aligned one of Feng et al., "TOOD" (2021, section 3.2): a prior whose centre lies in an
object answers for it when the network already scores and places that object well there. The class costs binary cross
entropy against that alignment, the box 1 - GIoU (Rezatofighi et al., "Generalized Intersection over Union", 2019).
All boxes are x_min y_min x_max y_max in pixels of the network's input.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

SCORE_POWER, IOU_POWER = 0.5, 4.0
"""How much score and overlap count in the alignment."""

ANSWERS = 9
"""At most so many priors answer for one object."""

LEAST_REACH_PX = 6.0
"""Objects thinner than twice this draw from priors this far from their middle; else many would have none."""

BOX_WEIGHT = 2.0

NOTHING, WANTED, DIFFICULT = 0.0, 1.0, 2.0
"""The last number of a row of truth: padding, an object to find, an object neither to find nor to rule out."""


def area(boxes: Tensor) -> Tensor:
    """The areas of boxes."""
    return (boxes[..., 2:] - boxes[..., :2]).clamp(min=0).prod(dim=-1)


def overlap(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """Intersection over union, and the union, of boxes of broadcastable shapes ``(..., 4)``."""
    low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
    shared = (high - low).clamp(min=0).prod(dim=-1)
    union = (area(a) + area(b) - shared).clamp(min=1e-6)
    return shared / union, union


def pairwise_iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of boxes ``(B, N, 4)`` with boxes ``(B, A, 4)``: ``(B, N, A)``.

    Coordinate by coordinate, because a last axis of four makes the same arithmetic many times slower on a processor.
    """
    rows, columns = [one[:, :, None] for one in a.unbind(-1)], [one[:, None] for one in b.unbind(-1)]
    width, height = (
        (torch.minimum(rows[high], columns[high]) - torch.maximum(rows[low], columns[low])).clamp_(min=0)
        for low, high in ((0, 2), (1, 3))
    )
    shared = width.mul_(height)
    return shared / (area(a)[:, :, None] + area(b)[:, None] - shared).clamp_(min=1e-6)


def generalised_iou(a: Tensor, b: Tensor) -> Tensor:
    """GIoU of boxes ``(..., 4)``, pairwise: -1 far apart, 1 the same."""
    iou, union = overlap(a, b)
    hull = torch.cat([torch.minimum(a[..., :2], b[..., :2]), torch.maximum(a[..., 2:], b[..., 2:])], dim=-1)
    whole = area(hull).clamp(min=1e-6)
    return iou - (whole - union) / whole


def decode(loc: Tensor, priors: Tensor, variances: Tensor) -> Tensor:
    """Boxes of offsets ``(B, A, 4)`` from priors ``(A, 4)`` cx cy w h; as `objreg_ros.detector.boxes.decode`."""
    centre = priors[:, :2] + loc[..., :2] * variances[:2] * priors[:, 2:]
    half = priors[:, 2:] * torch.exp((loc[..., 2:] * variances[2:]).clamp(max=4.0)) / 2
    return torch.cat([centre - half, centre + half], dim=-1)


@dataclass
class Assignment:
    """What the priors of a batch should have said."""

    alignment: Tensor
    """``(B, A)``: the score that is wanted, 0 for background."""
    classes: Tensor
    """``(B, A) int64``: of which class, where that is not 0."""
    boxes: Tensor
    """``(B, A, 4)``: and which box."""
    counted: Tensor
    """``(B, A) bool``: whether what it says of classes counts; False at difficult objects."""


@torch.no_grad()
def assign(scores: Tensor, boxes: Tensor, centres: Tensor, truth: Tensor) -> Assignment:
    """The assignment for class scores ``(B, A, C)`` in 0..1, boxes ``(B, A, 4)`` and prior centres ``(A, 2)``.

    ``truth (B, N, 6)``: box, class, and `NOTHING`, `WANTED` or `DIFFICULT`.
    """
    known, classes, kind = truth[..., :4], truth[..., 4].long(), truth[..., 5]
    inside = _inside(centres, known)
    iou = pairwise_iou(known, boxes)
    score = scores.gather(2, classes[:, None].expand(-1, scores.shape[1], -1)).transpose(1, 2)
    aligned = score**SCORE_POWER * iou**IOU_POWER * (inside & (kind == WANTED)[..., None])
    least = aligned.topk(ANSWERS, dim=2).values[..., -1:]
    aligned = torch.where(aligned >= least, aligned, 0.0)
    best = aligned.amax(dim=2, keepdim=True).clamp(min=1e-9)
    wanted = aligned / best * iou.masked_fill(aligned == 0, 0.0).amax(dim=2, keepdim=True)
    owner = torch.where(aligned > 0, iou, -1.0).argmax(dim=1)
    alignment = wanted.gather(1, owner[:, None])[:, 0]
    hidden = ((inside | (iou > 0.5)) & (kind == DIFFICULT)[..., None]).any(dim=1)
    return Assignment(
        alignment,
        classes.gather(1, owner),
        known.gather(1, owner[..., None].expand(-1, -1, 4)),
        (alignment > 0) | ~hidden,
    )


def _inside(centres: Tensor, boxes: Tensor) -> Tensor:
    """Whether prior centres ``(A, 2)`` lie in boxes ``(B, N, 4)``, or near the middle of thin ones: ``(B, N, A)``."""
    middle = (boxes[..., :2] + boxes[..., 2:]) / 2
    reach = ((boxes[..., 2:] - boxes[..., :2]) / 2).clamp(min=LEAST_REACH_PX)
    x, y = ((centres[:, i] - middle[..., i, None]).abs() < reach[..., i, None] for i in range(2))
    return x & y


@dataclass
class MultiboxLoss:
    """The loss of a batch for priors ``(A, 4)`` cx cy w h in pixels."""

    priors: Tensor
    variances: Tensor

    def __call__(self, loc: Tensor, logits: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
        """What the boxes cost and what the classes cost, each per answer wanted; ``logits (B, A, C)``."""
        boxes = decode(loc, self.priors, self.variances)
        wanted = assign(logits.sigmoid(), boxes, self.priors[:, :2], truth)
        count = wanted.alignment.sum().clamp(min=1.0)
        target = functional.one_hot(wanted.classes, logits.shape[2]) * wanted.alignment[..., None]
        entropy = functional.binary_cross_entropy_with_logits(logits, target, reduction="none").sum(dim=2)
        chosen = wanted.alignment > 0
        apart = (1 - generalised_iou(boxes[chosen], wanted.boxes[chosen])) * wanted.alignment[chosen]
        return BOX_WEIGHT * apart.sum() / count, (entropy * wanted.counted).sum() / count
