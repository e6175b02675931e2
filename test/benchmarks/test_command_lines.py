# SPDX-License-Identifier: Apache-2.0
"""What the benchmarks answer to a command line that they cannot follow, and what ``--quick`` leaves alone."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import click
import pytest
from click.testing import CliRunner

Benchmark = Callable[[str], ModuleType]


@pytest.fixture
def benchmark() -> Benchmark:
    return importlib.import_module


@pytest.fixture
def detector(repository: Path) -> ModuleType:
    """A folder of tests has the same name, so it is found by its path."""
    spec = importlib.util.spec_from_file_location("detector_benchmark", repository / "benchmarks" / "detector.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def refusal(command: click.Command, *arguments: str) -> str:
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 2, result.output
    return " ".join(result.output.replace("│", "").split())


def test_without_recordings_closure_says_what_it_needs(benchmark: Benchmark, tmp_path: Path) -> None:
    said = refusal(benchmark("closure").main, "--json", str(tmp_path / "x.json"), "--keep", str(tmp_path))
    assert "expected RECORDINGS or --simulate SCENARIO:SEED, got neither" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["limits", "landmarks"])
def test_without_recordings_the_mappers_commands_say_what_they_need(benchmark: Benchmark, command: str) -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")
    said = refusal(benchmark("mapper").main, command)
    assert "expected RECORDINGS or --simulate SCENARIO:SEED, got neither" in said


@pytest.mark.parametrize("plan", ["foo:0", "loop:x", "loop:1,", "loop:-1"])
def test_what_is_no_scenario_and_seed_is_refused(benchmark: Benchmark, tmp_path: Path, plan: str) -> None:
    said = refusal(benchmark("closure").main, "--simulate", plan, "--keep", str(tmp_path))
    assert "expected SCENARIO:SEED" in said and f"got '{plan}'" in said


@pytest.mark.parametrize("jitter", ["3", "3,x", "-1,4", "3,4,5", "3,101", "nan,1"])
def test_jitter_that_is_no_two_sizes_is_refused(benchmark: Benchmark, tmp_path: Path, jitter: str) -> None:
    said = refusal(benchmark("closure").main, "--jitter", jitter, "--keep", str(tmp_path))
    assert "expected DEG,CM with numbers from 0 to 45 and from 0 to 100" in said and f"got '{jitter}'" in said


def test_figures_with_jitter_are_kept_apart(benchmark: Benchmark) -> None:
    closure, sources = benchmark("closure"), benchmark("sources")
    plain, jittering = (closure.Asked(sources.detector_of(), (), 1, 1, 1.0, j) for j in ((0.0, 0.0), (3.0, 4.0)))
    assert jittering.tag() == f"{plain.tag()}_j3-4"


@pytest.mark.parametrize(("name", "needed"), [("closure", ()), ("pairs", (".",))])
def test_a_peer_that_there_is_not_is_refused_at_once(benchmark: Benchmark, name: str, needed: tuple[str, ...]) -> None:
    said = refusal(benchmark(name).main, *needed, "--peers", "orb_pnp,nonsense")
    assert "expected peers of orb_pnp, sift_pnp, fpfh_icp, paper, got nonsense" in said


@pytest.mark.parametrize("option", ["--model", "--coco"])
def test_a_model_that_there_is_not_is_refused_with_where_it_may_be(
    detector: ModuleType, tmp_path: Path, option: str
) -> None:
    said = refusal(detector.main, "--json", str(tmp_path / "x.json"), option, "nonsense.onnx")
    assert f"'{option}'" in said and "expected a path, or the name of a file in" in said
    assert "got 'nonsense.onnx'; `objreg fetch-model` gets one" in said


@pytest.mark.parametrize("option", ["--model", "--coco"])
def test_a_file_that_is_no_model_is_refused(detector: ModuleType, tmp_path: Path, option: str) -> None:
    (tmp_path / "text.onnx").write_text("no model")
    said = refusal(detector.main, "--json", str(tmp_path / "x.json"), option, str(tmp_path / "text.onnx"))
    assert "expected an ONNX file that onnxruntime loads, got" in said and not (tmp_path / "x.json").exists()


def test_a_run_that_has_no_time_for_a_picture_says_so(detector: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detector, "pictures", lambda *_: iter([object()]))
    with pytest.raises(click.ClickException, match=r"within 0 s, got none; .* without --quick"):
        detector.simulated(None, 1, 240, limit_s=0.0)


def test_a_scenario_without_seeds_is_that_of_seed_0(benchmark: Benchmark) -> None:
    assert benchmark("closure").plans(["loop", "moved:1,2"]) == [("loop", 0), ("moved", 1), ("moved", 2)]


def test_recordings_of_one_name_are_refused(benchmark: Benchmark, tmp_path: Path) -> None:
    same = [tmp_path / folder / "walk" for folder in ("a", "b")]
    for folder in same:
        folder.mkdir(parents=True)
    said = refusal(benchmark("closure").main, *map(str, same), "--keep", str(tmp_path / "out"))
    assert "expected recordings of different names, got more than one walk" in said


def test_parts_of_the_store_that_there_are_not_are_refused(benchmark: Benchmark) -> None:
    said = refusal(benchmark("store").main, "--parts", "sizes,nonsense")
    assert "expected some of sizes,frames,kills, got 'sizes,nonsense'" in said


def test_a_quick_registration_has_no_size_to_choose(benchmark: Benchmark) -> None:
    said = refusal(benchmark("registration").main, "--quick", "--reps", "3")
    assert "expected --quick or a size of the whole, got --quick and --reps" in said


def test_quick_changes_defaults_and_nothing_that_was_named(benchmark: Benchmark) -> None:
    quick_values, taken = benchmark("command_line").quick_values, []

    @click.command()
    @click.option("--frames", default=600)
    @click.option("--seed", default=1)
    @click.option("--quick", is_flag=True)
    @click.pass_context
    def command(context: click.Context, quick: bool, **_: int) -> None:
        taken.append(quick_values(context, quick, {"frames": 300, "seed": 7}))

    for arguments in (["--quick"], ["--quick", "--frames", "600"], []):
        CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert taken == [{"frames": 300, "seed": 7}, {"seed": 7}, {}]


def test_a_witness_that_heard_nothing_says_so(benchmark: Benchmark) -> None:
    pytest.importorskip("rclpy", reason="the witness listens with ROS 2")
    deaf = object.__new__(benchmark("latency").Witness)
    deaf.seen, deaf.done = {}, {}
    with pytest.raises(
        click.ClickException, match="expected images on image/compressed and acknowledgements on finished"
    ):
        _ = deaf.span
