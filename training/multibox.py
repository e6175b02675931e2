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

CLASS_WEIGHTS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 1.0)
"""The weight of each label, in their order, against all else: flashlights and books are hardest to recognise."""

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
    hidden = (inside & (kind == DIFFICULT)[..., None]).any(dim=1)
    b, n, a = (inside & (kind == WANTED)[..., None]).nonzero(as_tuple=True)
    iou = overlap(known[b, n], boxes[b, a])[0]
    aligned = scores[b, a, classes[b, n]] ** SCORE_POWER * iou**IOU_POWER
    best = aligned.new_zeros(inside.shape).index_put_((b, n, a), aligned).topk(ANSWERS, dim=2).values
    chosen = (aligned > 0) & (aligned >= best[b, n, -1])
    b, n, a, iou, aligned = (part[chosen] for part in (b, n, a, iou, aligned))
    wanted = aligned / best[b, n, 0] * _most(iou, (b, n), kind.shape)[b, n]
    owning = iou == _most(iou, (b, a), scores.shape[:2])[b, a]
    b, n, a, wanted = (part[owning] for part in (b, n, a, wanted))
    alignment, owner = scores.new_zeros(scores.shape[:2]), classes.new_zeros(scores.shape[:2])
    alignment[b, a], owner[b, a] = wanted, n
    return Assignment(
        alignment,
        classes.gather(1, owner),
        known.gather(1, owner[..., None].expand(-1, -1, 4)),
        (alignment > 0) | ~hidden,
    )


def _most(values: Tensor, at: tuple[Tensor, Tensor], shape: torch.Size) -> Tensor:
    """The greatest of the values that fall into each cell of a table of this shape, 0 where none does."""
    cell = at[0] * shape[1] + at[1]
    return values.new_zeros(shape.numel()).scatter_reduce_(0, cell, values, "amax").reshape(shape)


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
        entropy = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
        entropy = (entropy * entropy.new_tensor(CLASS_WEIGHTS)).sum(dim=2)
        chosen = wanted.alignment > 0
        apart = (1 - generalised_iou(boxes[chosen], wanted.boxes[chosen])) * wanted.alignment[chosen]
        return BOX_WEIGHT * apart.sum() / count, (entropy * wanted.counted).sum() / count
