# SPDX-License-Identifier: Apache-2.0
"""Train the detector from random weights on shards of simulated pictures; start it again and it goes on.

python -m training.train --data DATA --validation VALIDATION --out OUT --steps 7000
torchrun --nproc-per-node 2 -m training.train …     # on two cores: each has a batch of its own, twice as many a step
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, distributed
from torch.nn.parallel import DistributedDataParallel
from torch.utils.data import DataLoader

from training.dataset import Example, Stream
from training.embedded import centred
from training.export import export, provenance_of
from training.labels import LABELS
from training.multibox import NOTHING, MultiboxLoss
from training.network import MobileNetSsd
from training.priors import INPUT_HW, VARIANCES, make_priors
from training.validation import describe, validate_model

WARM_UP_STEPS = 200
COOL_DOWN = 0.3
"""In this last share of the steps the rate falls, until then it stays: a training can be made longer before it begins
(Hägele et al., "Scaling Laws and Compute-Optimal Training Beyond Fixed Training Durations", 2024)."""

AVERAGE_DECAY = 0.999
WEIGHT_DECAY = 0.02
GRADIENT_LIMIT = 10.0


class Training:
    """Everything that a checkpoint holds: the network, its running average, the optimiser and how far it is."""

    def __init__(self, rate: float, command: str, half: bool = False, device: str = "cpu") -> None:
        self.device = torch.device(device)
        self.network = MobileNetSsd(len(LABELS)).to(self.device, memory_format=torch.channels_last)
        self.forward: torch.nn.Module = self.network
        self.average = copy.deepcopy(self.network).eval()
        priors = torch.from_numpy(make_priors()) * torch.tensor([INPUT_HW[1], INPUT_HW[0]] * 2)
        self.loss = MultiboxLoss(priors.to(self.device), torch.tensor(VARIANCES, device=self.device))
        self.optimiser = torch.optim.AdamW(_groups(self.network), lr=rate)
        self.rate, self.command, self.half = rate, command, half
        self.step, self.seconds = 0, 0.0

    def start_from(self, weights: Path) -> None:
        """Begin with the weights of `training.pretrain`, or with those of another checkpoint that fit."""
        content = torch.load(weights, map_location=self.device, weights_only=True)
        content = content.get("average", content)
        for network in (self.network, self.average):
            own = network.state_dict()
            fitting = {key: value for key, value in content.items() if key in own and own[key].shape == value.shape}
            network.load_state_dict(own | fitting)

    def freeze_stem(self) -> None:
        """Leave the first layers as they are: a fifth of the time for what changes least late in a training."""
        self.network.stages[0][0].requires_grad_(False).eval()

    def share(self) -> None:
        """Step along the mean of all processes' gradients from now on, from the weights of the first; all must call."""
        self.forward = DistributedDataParallel(self.network, forward_sync_buffers=False)

    def advance(self, batch: Example, steps: int) -> tuple[float, float]:
        """One step on one batch; what the boxes and what the classes cost."""
        picture, truth = (part.to(self.device, non_blocking=True) for part in batch)
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate(self.step, steps, self.rate)
        truth = truth[:, : int((truth[..., 5] != NOTHING).sum(dim=1).max())]
        x = picture.permute(0, 3, 1, 2).to(torch.bfloat16 if self.half else torch.float32)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.half):
            loc, logits = self.forward(centred(x))
        location, confidence = self.loss(loc.float(), logits.float(), truth)
        self.optimiser.zero_grad(set_to_none=True)
        (location + confidence).backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_LIMIT)
        self.optimiser.step()
        self.step += 1
        self._update_average()
        return float(location.detach()), float(confidence.detach())

    @torch.no_grad()
    def _update_average(self) -> None:
        decay = min(AVERAGE_DECAY, (1 + self.step) / (20 + self.step))
        for mean, value in zip(_state(self.average), _state(self.network), strict=True):
            if mean.is_floating_point():
                mean.lerp_(value, 1 - decay)
            else:
                mean.copy_(value)

    def as_dict(self) -> dict[str, Any]:
        """What goes into a checkpoint."""
        return {
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "command": self.command,
        }

    def save(self, path: Path) -> None:
        """Write a checkpoint; an interruption leaves the one before."""
        temporary = path.with_suffix(".part")
        torch.save(self.as_dict(), temporary)
        os.replace(temporary, path)

    def load(self, path: Path) -> None:
        """Go on from a checkpoint."""
        content = torch.load(path, map_location=self.device, weights_only=True)
        self.network.load_state_dict(content["network"])
        self.average.load_state_dict(content["average"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.step, self.seconds = content["step"], content["seconds"]


def learning_rate(step: int, steps: int, top: float) -> float:
    """A linear start, the top, and in the last share of the steps half a cosine down to a hundredth."""
    start = min(1.0, (step + 1) / WARM_UP_STEPS)
    fall = min(1.0, max(0.0, (step / steps - 1) / COOL_DOWN + 1))
    return top * start * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * fall)))


def join_others() -> int:
    """Join the processes that `torchrun` has started; this one's rank."""
    distributed.init_process_group("gloo")
    return distributed.get_rank()


def _groups(network: MobileNetSsd) -> list[dict[str, Any]]:
    """Decay for the kernels only, not for biases and normalisation."""
    kernels = [p for p in network.parameters() if p.ndim > 1]
    others = [p for p in network.parameters() if p.ndim <= 1]
    return [{"params": kernels, "weight_decay": WEIGHT_DECAY}, {"params": others, "weight_decay": 0.0}]


def _state(network: MobileNetSsd) -> Iterator[Tensor]:
    return iter(network.state_dict().values())


def run(training: Training, arguments: argparse.Namespace, rank: int) -> None:
    """Train until the last step; rank 0 writes a checkpoint and an ONNX file and validates every now and then."""
    seed = (arguments.seed, training.step, rank)
    stream = Stream(arguments.data, seed, arguments.mosaic, arguments.mistakes)
    batches = iter(DataLoader(stream, batch_size=arguments.batch, num_workers=arguments.workers, prefetch_factor=4))
    recent: list[tuple[float, float]] = []
    begin = time.monotonic()
    last = min(arguments.steps, arguments.until or arguments.steps)
    while training.step < last:
        recent.append(training.advance(next(batches), arguments.steps))
        training.seconds, begin = training.seconds + time.monotonic() - begin, time.monotonic()
        if rank > 0:
            continue
        if training.step % 100 == 0:
            location, confidence = (sum(part) / len(recent) for part in zip(*recent, strict=True))
            recent.clear()
            print(f"step {training.step} of {arguments.steps}, {training.seconds / 60:.1f} min: "
                  f"location {location:.3f}, confidence {confidence:.3f}", flush=True)  # fmt: skip
        if training.step % arguments.check_every == 0 or training.step == last:
            check(training, arguments)


def check(training: Training, arguments: argparse.Namespace) -> None:
    """Save what there is and say how good it is on the validation pictures."""
    training.save(arguments.out / "checkpoint.pt")
    model = arguments.out / "model.onnx"
    export(copy.deepcopy(training.average).cpu(), model, provenance_of(training.as_dict()))
    if arguments.validation is not None:
        print(f"step {training.step}: {describe(validate_model(model, arguments.validation))}", flush=True)


def parse(argv: list[str]) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder of shards from training.render")
    parser.add_argument("--validation", type=Path, help="folder of shards of other seeds")
    parser.add_argument("--out", type=Path, required=True, help="folder for checkpoint.pt and model.onnx")
    parser.add_argument("--backbone", type=Path, help="weights from training.pretrain to begin with")
    parser.add_argument("--mistakes", type=Path, help="folder of crops from training.mistakes for half of the mosaics")
    parser.add_argument("--steps", type=int, default=7000, help="length of the schedule")
    parser.add_argument("--until", type=int, help="stop at this step, before the schedule ends")
    parser.add_argument("--batch", type=int, default=16, help="pictures a step, of each process")
    parser.add_argument("--rate", type=float, default=1.5e-3)
    parser.add_argument(
        "--device", default="cuda" if torch.cuda.is_available() else "cpu", help="a GPU where there is one"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--check-every", type=int, default=1000)
    parser.add_argument("--mosaic", type=float, default=0.65, help="share of mosaics; few at the end of a training")
    parser.add_argument("--bf16", action="store_true", help="compute in bfloat16 where the processor is faster so")
    parser.add_argument("--freeze-stem", action="store_true", help="leave the first layers as they are")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(argv)


def recipe(arguments: argparse.Namespace) -> str:
    """The command that goes on like this elsewhere: its processes and options, without this machine's folders."""
    chosen = {name: value for name, value in vars(arguments).items() if not isinstance(value, Path | None)}
    flags = [f"--{name.replace('_', '-')}" + ("" if value is True else f" {value}") for name, value in chosen.items()]
    start = f"torchrun --nproc-per-node {os.environ.get('WORLD_SIZE', '1')} -m training.train"
    return " ".join([start, *(flag for flag in flags if not flag.endswith(" False"))])


def main() -> None:
    """Start, or go on."""
    arguments = parse(sys.argv[1:])
    rank = join_others() if distributed.is_torchelastic_launched() else 0
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(arguments.threads)
    arguments.out.mkdir(parents=True, exist_ok=True)
    training = Training(arguments.rate, recipe(arguments), arguments.bf16, arguments.device)
    if (arguments.out / "checkpoint.pt").is_file():
        training.load(arguments.out / "checkpoint.pt")
        if rank == 0:
            print(f"goes on at step {training.step}", flush=True)
    elif arguments.backbone is not None:
        training.start_from(arguments.backbone)
    if arguments.freeze_stem:
        training.freeze_stem()
    if distributed.is_initialized():
        training.share()
    run(training, arguments, rank)


if __name__ == "__main__":
    main()
