# SPDX-License-Identifier: Apache-2.0
"""Training goes on after an interruption as if there had been none."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from training import train
from training.multibox import WANTED
from training.priors import INPUT_HW
from training.train import Training, learning_rate, parse, recipe


def batch(left: float = 40.0) -> tuple[torch.Tensor, torch.Tensor]:
    truth = torch.zeros(2, 4, 6)
    truth[:, 0] = torch.tensor([left, 60.0, 120.0, 160.0, 3.0, WANTED])
    return torch.zeros(2, *INPUT_HW, 3, dtype=torch.uint8), truth


def test_a_checkpoint_brings_back_weights_average_optimiser_and_step(tmp_path: Path) -> None:
    torch.manual_seed(1)
    torch.set_num_threads(1)
    first = Training(1e-3, "command")
    first.advance(batch(), steps=10)
    first.save(tmp_path / "checkpoint.pt")
    second = Training(1e-3, "command")
    second.load(tmp_path / "checkpoint.pt")
    assert first.advance(batch(), steps=10) == pytest.approx(second.advance(batch(), steps=10))
    for a, b in zip(first.average.state_dict().values(), second.average.state_dict().values(), strict=True):
        assert torch.allclose(a.float(), b.float())


def test_a_training_starts_from_whatever_weights_fit(tmp_path: Path) -> None:
    donor = Training(1e-3, "command")
    weights = donor.network.state_dict()
    weights["heads.0.weight"] = torch.zeros(70, 96, 1, 1)
    torch.save(weights, tmp_path / "weights.pt")
    torch.manual_seed(5)
    other = Training(1e-3, "command")
    other.start_from(tmp_path / "weights.pt")
    ours = other.network.state_dict()
    assert torch.equal(ours["laterals.0.weight"], weights["laterals.0.weight"])
    assert ours["heads.0.weight"].shape == (13, 96, 1, 1)


def step_alone_and_together(rank: int, folder: Path) -> None:
    torch.distributed.init_process_group("gloo", f"file://{folder / 'meet'}", rank=rank, world_size=2)
    torch.set_num_threads(1)
    train.GRADIENT_LIMIT = float("inf")
    gradients = []
    for together in (False, True):
        torch.manual_seed(1)
        training = Training(1e-3, "command")
        training.freeze_stem()
        if together:
            training.share()
        training.advance(batch(left=40.0 + 30.0 * rank), steps=10)
        gradients.append([parameter.grad for parameter in training.network.parameters()])
    torch.save(gradients, folder / f"{rank}.pt")
    torch.distributed.destroy_process_group()


def test_two_processes_step_along_the_mean_of_their_gradients(tmp_path: Path) -> None:
    torch.multiprocessing.spawn(step_alone_and_together, (tmp_path,), nprocs=2)
    (alone, shared), (other, shared_by_other) = (torch.load(tmp_path / f"{rank}.pt") for rank in (0, 1))
    trained = [number for number, gradient in enumerate(shared) if gradient is not None]
    assert shared[0] is None and len(trained) > 50
    assert not torch.allclose(alone[trained[-1]], other[trained[-1]])
    for number in trained:
        mean = (alone[number] + other[number]) / 2
        assert torch.allclose(shared[number], mean, rtol=1e-3, atol=1e-4 * float(mean.abs().max()))
        assert torch.equal(shared[number], shared_by_other[number])


def test_the_learning_rate_rises_stays_and_falls_to_a_hundredth() -> None:
    rates = [learning_rate(step, 1000, 1.0) for step in range(1001)]
    assert rates[0] < 0.01 and rates[-1] == pytest.approx(0.01)
    assert rates[200:700] == [1.0] * 500 and rates[850] == pytest.approx(0.505)


def test_a_training_made_longer_while_the_rate_stays_is_the_same_until_then() -> None:
    assert [learning_rate(step, 1000, 1.0) for step in range(701)] == [learning_rate(s, 2000, 1.0) for s in range(701)]


def test_the_recipe_in_the_model_names_no_folder_of_this_machine() -> None:
    text = recipe(parse(["--data", "/home/me/data", "--out", "/home/me/out", "--steps", "12", "--freeze-stem"]))
    assert "/home" not in text and "--steps 12" in text and text.endswith("--freeze-stem --seed 0")
