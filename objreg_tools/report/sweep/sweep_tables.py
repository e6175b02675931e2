# SPDX-License-Identifier: Apache-2.0
"""A sweep as JSON and as Parquet: what each combination found in each recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from objreg_ros.whole_file import whole_file
from objreg_tools.report.batch.batch_tables import require_pyarrow
from objreg_tools.report.sweep.sweep_rows import Setting, best_of, equals_of, is_judged, most_false

COUNTS = ("frames", "constraints", "judged", "loose", "false", "revisits", "closed")


def as_json(settings: Sequence[Setting], about: Mapping[str, Any]) -> dict[str, Any]:
    """Every combination with its counts and those of each recording, and the best: None where no truth can say."""
    best = best_of(settings)
    return {
        "about": dict(about),
        "judged": is_judged(settings),
        "best": None if best is None else {**_of(best), "equals": equals_of(settings, best), "yaml": as_yaml(best)},
        "combinations": [{**_of(one), "recordings": [asdict(found) for found in one.found]} for one in settings],
    }


def _of(one: Setting) -> dict[str, Any]:
    false = most_false(one.total("false"), one.total("judged"))
    return {
        "values": dict(one.values),
        "set": list(one.changes),
        **{name: one.total(name) for name in COUNTS},
        "failed": one.failed,
        "recall": one.recall,
        "false_share_at_most": false,
    }


def as_yaml(one: Setting) -> str:
    """The values as a ROS 2 parameter file, for any namespace."""
    sections: dict[str, dict[str, Any]] = {}
    for path, value in one.values.items():
        node, _, name = path.partition(".")
        plain = list(value) if isinstance(value, tuple) else value
        sections.setdefault(f"/**/{node}", {}).setdefault("ros__parameters", {})[name] = plain
    return str(yaml.safe_dump(sections, sort_keys=False, allow_unicode=True))


def write_parquet(file: Path, settings: Sequence[Setting]) -> None:
    """A row for each combination and recording: the values in columns of their own, then the counts.

    ValueError without pyarrow, OSError where it cannot be written.
    """
    arrow = require_pyarrow()
    schema = arrow.schema(_columns(arrow, settings))
    table = arrow.Table.from_pylist(list(_rows(settings)), schema)
    with whole_file(file) as out, arrow.parquet.ParquetWriter(out, schema) as writer:
        writer.write_table(table)


def _rows(settings: Sequence[Setting]) -> Iterator[dict[str, Any]]:
    for number, setting in enumerate(settings):
        values = {name: list(one) if isinstance(one, tuple) else one for name, one in setting.values.items()}
        for found in setting.found:
            yield {"combination": number, **values, **asdict(found)}


def _columns(arrow: Any, settings: Sequence[Setting]) -> dict[str, Any]:
    values = settings[0].values if settings else {}
    kinds = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    of_values = {
        name: arrow.list_(arrow.string() if not one else kinds[type(one[0])])
        if isinstance(one, tuple)
        else kinds[type(one)]
        for name, one in values.items()
    }
    texts = dict.fromkeys(("name", "recording", "file", "error"), arrow.string())
    counts = dict.fromkeys(COUNTS, arrow.int64())
    return {
        "combination": arrow.int64(),
        **of_values,
        **texts,
        **counts,
        "odds": arrow.list_(arrow.float64()),
        "seconds": arrow.float64(),
    }
