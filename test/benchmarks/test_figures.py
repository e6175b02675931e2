# SPDX-License-Identifier: Apache-2.0
"""Every figure of the documents comes from the JSON of a benchmark, and a run keeps what the rows need."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from click.testing import CliRunner

MOST_WORDS = 2500
BY_HAND = ("README.md", "docs/limits.md", "docs/gate.md", "docs/robots.md")
DRAWN = (*BY_HAND, "docs/figures.md", "docs/figures-history.md")
MADE = (
    r"<!-- figures: made by .*?<!-- end of figures -->",
    r"<!-- figure: .*?<!-- /figure -->",
    r"<!-- made by docs/evidence_table.py -->.*?<!-- end of what was made -->",  # the gate's own weights
    r"```.*?```",
    r"`[^`\n]*`",
    r"<!--.*?-->",
)
NUMBER = r"(?<![\w.])\d[\d.]*"
MEASURED = re.compile(
    rf"{NUMBER} ?(?:%|°|×|ms|s|min|minutes?|hours?|Hz|[kMG]B|c?m|times|degrees)(?![\w/])"
    rf"|{NUMBER} of (?:the )?{NUMBER}|\b0\.\d+\b|\b\d{{3,}}\b"
)
SET = {
    "README.md": ("70 to 180 degrees", "the model's own, 0.5 where it says none"),
    "docs/limits.md": (
        "a jitter of 3° and 4 cm",  # what its command asks for
        "70 to 180 degrees",
        "from 3 m and more",
        "within 3 s of two of them",
        "After 20 s at rest, or 60 s of motion",
        "below 5 %, or within four deviations (three after 20 s)",
        "less than 10°",
        "less than 0.08 s",
    ),
    "docs/gate.md": (
        "2° + 2°/m and 5 cm + 6 cm/m",
        "3 m of path",
        "2 m of path",
        "1 m of path",
        "8° and 15 cm",
        "moved by 40 cm",
        "512 statements",
    ),
    "docs/robots.md": (
        "at most 100 kB",
        "it keeps, 128 keyframes",
        "0.7 kB a message",  # the format's
        "by more than 10 cm or 5°",
        "A number 10 000 beyond",
        "datagrams of up to 64 kB",
        "frames of 1.5 kB",
        "A datagram is 1400 bytes",
        "after 180 s of silence",
        "forgets after 20 s",
        "a delay of 20 ms",
        "messages of 80 kB",
        "20 % are lost",
        "With a pause of 30 s",
        "128 by a keyframer",
        "queue of 1.5 MB",
        "10.75.0.1, 10.75.0.2",
    ),
}  # what is set and not measured: parameters, limits, what is asked for


def by_hand(text: str) -> str:
    """A document without what is drawn, and without code."""
    for part in MADE:
        text = re.sub(part, " ", text, flags=re.DOTALL)
    return " ".join(text.split())


def suspects(document: str, text: str) -> list[str]:
    """What looks measured in the sentences of a document."""
    sentences = by_hand(text)
    for phrase in SET[document]:
        sentences = sentences.replace(phrase, " ")
    return [found[0] for found in MEASURED.finditer(sentences)]


@pytest.fixture
def scripts() -> dict[str, ModuleType]:
    names = ("figures", "figure_draw", "figure_results", "figure_run", "figure_topics", "figure_topics.topic")
    return {name: importlib.import_module(name) for name in names}


@pytest.fixture
def result(scripts: dict[str, ModuleType]) -> Any:
    return scripts["figure_results"].Result(
        topic="start",
        version=scripts["figure_results"].version(),
        commit="abc",
        code="123",
        size="quick",
        command="benchmarks/start.py --rounds 1",
        seeds=[],
        date="2026-01-01",
        machine="a processor",
        cores=2,
        load=0.1,
        seconds=1.0,
        processor_seconds=1.0,
        figures={"one": {"seconds": 0.8, "mb": 188}, "library": {"seconds": 0.6, "mb": 174}},
    )


@pytest.fixture
def kept(scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folders of results that are empty."""
    current = tmp_path / "current"
    for name in ("figure_results", "figure_draw", "figures"):
        monkeypatch.setattr(scripts[name], "RESULTS", tmp_path, raising=False)
        monkeypatch.setattr(scripts[name], "CURRENT", current, raising=False)
    draw, results = scripts["figure_draw"], scripts["figure_results"]
    monkeypatch.setattr(draw, "read_result", lambda topic, folder=current: results.read_result(topic, folder))
    monkeypatch.setattr(scripts["figures"], "read_result", lambda topic: results.read_result(topic, current))
    return current


@pytest.mark.parametrize("document", DRAWN)
def test_a_document_is_what_is_drawn_of_the_kept_figures(
    repository: Path, scripts: dict[str, ModuleType], document: str
) -> None:
    drawn = scripts["figure_draw"].pages()[document]
    assert (repository / document).read_text(encoding="utf-8") == drawn, "draw it: python benchmarks/figures.py --draw"


@pytest.mark.parametrize("document", BY_HAND)
def test_no_measured_number_is_written_by_hand(repository: Path, document: str) -> None:
    text = (repository / document).read_text(encoding="utf-8")
    assert suspects(document, text) == [], "mark it as <!-- figure: topic.key -->, or name in SET what is no figure"
    assert all(phrase in by_hand(text) for phrase in SET[document])


@pytest.mark.parametrize(
    "sentence",
    [
        "It takes 12 ms.",
        "Of these 3 of 400 were wrong.",
        "0.98 are accepted.",
        "59 % of a core",
        "19 × faster",
        "1.7 cm",
    ],
)
def test_a_number_that_is_written_by_hand_is_found(sentence: str) -> None:
    assert suspects("README.md", sentence)
    assert not suspects("README.md", f"<!-- figure: a.b -->{sentence}<!-- /figure -->")


def test_the_page_is_read_in_one_sitting(repository: Path) -> None:
    assert len((repository / "docs/figures.md").read_text(encoding="utf-8").split()) <= MOST_WORDS


@pytest.mark.parametrize(("size", "most_minutes"), [(0, 20), (1, 240)])
def test_quick_is_within_twenty_minutes_and_whole_within_four_hours_on_two_cores(
    scripts: dict[str, ModuleType], size: int, most_minutes: float
) -> None:
    topics = scripts["figure_topics"].TOPICS
    beside, alone = (sum(t.minutes[size] for t in topics if t.alone == is_alone) for is_alone in (False, True))
    assert beside / 2 + alone <= most_minutes


def test_every_topic_names_a_benchmark_and_options_that_it_has(
    repository: Path, scripts: dict[str, ModuleType]
) -> None:
    topics = scripts["figure_topics"].TOPICS
    assert len({topic.name for topic in topics}) == len(topics) >= 20
    for topic in topics:
        for size in ("quick", "whole"):
            script, *arguments = shlex.split(topic.command(size))
            source = (repository / script).read_text(encoding="utf-8")
            unknown = [one for one in arguments if one.startswith("--") and not re.search(f'["/]{one}"', source)]
            assert not unknown, f"{topic.name}: {script} has no {unknown}"


def test_what_was_not_run_says_so(scripts: dict[str, ModuleType], kept: Path) -> None:
    page = scripts["figure_draw"].pages()["docs/figures.md"]
    rows = [row for topic in scripts["figure_topics"].TOPICS for row in topic.rows]
    assert page.count("not measured on this version") == len(rows)


def test_what_is_kept_is_drawn(scripts: dict[str, ModuleType], kept: Path, result: Any) -> None:
    result.write(kept)
    pages = scripts["figure_draw"].pages()
    assert "|0.8 s, 188 MB|`benchmarks/start.py --rounds 1`|" in pages["docs/figures.md"]
    assert "| 0.8 s, 188 MB | quick |" in pages["README.md"]
    assert "| 0.8 s, 188 MB (quick) |" in pages["docs/figures-history.md"]


def test_the_picture_of_a_whole_run_stands_below_its_table(
    scripts: dict[str, ModuleType], kept: Path, result: Any
) -> None:
    assert "](pictures/founding.svg)" not in scripts["figure_draw"].pages()["docs/figures.md"]
    replace(result, topic="paper", size="whole").write(kept)
    assert (
        "\n\n![The founding document's pairs](pictures/founding.svg)\n\n"
        in (scripts["figure_draw"].pages()["docs/figures.md"])
    )


def test_times_of_a_busy_machine_say_so(scripts: dict[str, ModuleType], kept: Path, result: Any) -> None:
    replace(result, load=14.0).write(kept)
    assert "| 0.8 s, 188 MB (busy machine) | quick |" in scripts["figure_draw"].pages()["README.md"]


def test_a_row_that_has_other_values_now_is_not_measured(
    scripts: dict[str, ModuleType], kept: Path, result: Any
) -> None:
    replace(result, figures={"one": {"minutes": 1}}).write(kept)
    assert "| not measured on this version |  |" in scripts["figure_draw"].pages()["README.md"]


def test_figures_of_another_version_are_history_alone(scripts: dict[str, ModuleType], kept: Path, result: Any) -> None:
    replace(result, version="0.0.1").write(kept)
    result.write(kept.parent / "0.0.1")
    pages = scripts["figure_draw"].pages()
    assert "188 MB" not in pages["docs/figures.md"] and "188 MB" not in pages["README.md"]
    assert "| 0.0.1 | current |" in pages["docs/figures-history.md"]


def test_a_marked_sentence_gets_its_figure(scripts: dict[str, ModuleType], kept: Path, result: Any) -> None:
    result.write(kept)
    sentence = "In <!-- figure: start.one.seconds -->9<!-- /figure --> s, <!-- figure: start.one --><!-- /figure -->."
    drawn = scripts["figure_draw"].marked("docs/limits.md", sentence)
    assert "-->0.8<!--" in drawn and "-->0.8 s, 188 MB<!--" in drawn
    with pytest.raises(ValueError, match=r"expected a row of benchmarks/figure_topics, got start\.two"):
        scripts["figure_draw"].marked("docs/limits.md", "<!-- figure: start.two --><!-- /figure -->")


def test_a_run_goes_on_where_it_was(scripts: dict[str, ModuleType], kept: Path, result: Any) -> None:
    topics, wanted = scripts["figure_topics"].TOPICS, scripts["figures"].wanted
    start = next(topic for topic in topics if topic.name == "start")
    result.write(kept)
    assert start in wanted(topics, "quick", "123", False)  # it is of another command
    result = replace(result, command=start.command("quick"))
    result.write(kept)
    assert {t.name for t in topics} - {t.name for t in wanted(topics, "quick", "123", False)} == {"start"}
    assert len(wanted(topics, "quick", "other code", False)) == len(topics)
    assert len(wanted(topics, "whole", "123", False)) == len(topics)
    replace(result, size="whole", command=start.command("whole")).write(kept)
    assert len(wanted(topics, "quick", "123", False)) == len(topics) - 1


def test_recordings_that_are_not_there_are_a_reason(scripts: dict[str, ModuleType], tmp_path: Path) -> None:
    lacking = {t.name: t.lacks("whole", tmp_path) for t in scripts["figure_topics"].TOPICS}
    assert lacking["pairs_rpy"] == "needs RPY, COCO in $OBJREG_SHARED" and lacking["start"] == ""


def one_topic(scripts: dict[str, ModuleType], script: Path, **changes: Any) -> Any:
    topic = scripts["figure_topics.topic"]
    row = topic.Row("n", "numbers", "{n}", lambda raw: {"n": raw["n"]})
    options = {"quick": "--size 2", "whole": "", "minutes": (0.2, 0.2), "rows": (row,), **changes}
    return topic.Topic(name="made", title="Made", script=str(script), **options)


def measured(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, **changes: Any
) -> Any:
    script = tmp_path / "made.py"
    script.write_text(code)
    run = scripts["figure_run"]
    monkeypatch.setattr(run, "OUT", tmp_path / "out")
    monkeypatch.setattr(scripts["figure_results"].Result, "write", lambda self: None)
    return run.measure(one_topic(scripts, script, **changes), "quick", "123", 1.0)


WRITES = "import json, sys; json.dump({'n': int(sys.argv[2])}, open(sys.argv[-1], 'w'))"


def test_a_topic_is_run_and_its_rows_are_kept(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = measured(scripts, tmp_path, monkeypatch, WRITES)
    assert result.figures == {"n": {"n": 2}} and result.size == "quick" and result.cores > 0
    assert (
        0 <= result.processor_seconds < 12 and 0 < result.seconds < 12 and result.command.endswith("made.py --size 2")
    )


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import sys; sys.exit(1)", "expected exit status 0, got 1"),
        ("", "expected its rows in"),
        (WRITES.replace("'n'", "'m'"), "KeyError: 'n'"),
    ],
)
def test_a_topic_that_has_no_figures_is_refused_with_the_reason(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, said: str
) -> None:
    with pytest.raises(scripts["figure_run"].TopicError, match=said):
        measured(scripts, tmp_path, monkeypatch, code)


def runs(pid: int) -> bool:
    """Whether a process is there, and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_topic_that_takes_too_long_is_ended_with_what_it_started(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "import pathlib, subprocess, time\n"
    code += "process = subprocess.Popen(['sleep', '60'])\n"
    code += f"pathlib.Path({str(tmp_path / 'pid')!r}).write_text(str(process.pid))\ntime.sleep(60)\n"
    with pytest.raises(scripts["figure_run"].TopicError, match="expected an end within"):
        measured(scripts, tmp_path, monkeypatch, code, minutes=(0.12, 0.12))
    until_s, pid = time.monotonic() + 20.0, int((tmp_path / "pid").read_text())
    while runs(pid) and time.monotonic() < until_s:
        time.sleep(0.05)
    assert not runs(pid)


def test_what_was_found_wrong_is_a_figure_too(
    scripts: dict[str, ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert measured(scripts, tmp_path, monkeypatch, f"{WRITES}; sys.exit(1)", judges=True).figures["n"] == {"n": 2}


def test_topics_run_in_their_order_those_alone_last_and_a_failure_is_named(
    scripts: dict[str, ModuleType], result: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"t{k}" for k in range(12)]
    topics = [replace(one_topic(scripts, Path(name)), name=name, alone=name == "t0") for name in names]
    begun: list[str] = []

    def work(topic: Any) -> Any:
        begun.append(topic.name)
        if topic.name == "t5":
            raise scripts["figure_run"].TopicError("expected an end")
        return result

    assert scripts["figures"].measure_all(topics, 1, work) == ["t5"]
    assert begun == [*names[1:], "t0"]
    said = capsys.readouterr()
    assert "t5: expected an end" in said.err and "t11: 1 s, 1 s of the processor" in said.out


def test_the_seeds_are_those_of_the_command(scripts: dict[str, ModuleType]) -> None:
    seeds_of = scripts["figure_run"].seeds_of
    assert seeds_of("x.py --seed 3 --simulate moved:1,2 --simulate loop:814:sensor=azure --rounds 5") == [3, 1, 2, 814]
    assert seeds_of("x.py --seeds 103,104 --tries 10") == [103, 104]


def test_an_unknown_topic_is_refused(scripts: dict[str, ModuleType]) -> None:
    said = CliRunner().invoke(scripts["figures"].main, ["--only", "nonsense"])
    assert said.exit_code == 2 and "got nonsense" in said.output


def test_kept_files_are_small_and_are_what_the_rows_need(repository: Path, scripts: dict[str, ModuleType]) -> None:
    rows = {topic.name: {row.key for row in topic.rows} for topic in scripts["figure_topics"].TOPICS}
    for file in (repository / "benchmarks/results").rglob("*.json"):
        kept = json.loads(file.read_text(encoding="utf-8"))
        assert file.stat().st_size < 4000 and file.stem == kept["topic"]
        assert file.parent.name != "current" or set(kept["figures"]) == rows[file.stem]


def test_the_quick_figures_are_measured_each_night_with_pinned_actions(repository: Path) -> None:
    workflow = (repository / ".github/workflows/figures.yml").read_text(encoding="utf-8")
    assert "cron:" in workflow and "benchmarks/figures.py --quick" in workflow
    used = re.findall(r"uses: (\S+)", workflow)
    assert used and all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", action) for action in used)
