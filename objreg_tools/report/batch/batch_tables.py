# SPDX-License-Identifier: Apache-2.0
"""What a batch found as Parquet: one table of its recordings, one of all constraints, one of all refusals.

Names have the units. Poses are the 16 numbers of ``T_from_to``, row by row; covariances the 36 of (x, y, z, rotation).
The evidence is a map of names to numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from objreg_ros import extra
from objreg_ros.whole_file import whole_file
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.truth import FALSE, within

NAMES = ("recordings", "constraints", "refusals")
GROUP = 20_000  # rows that are held before they are written


def require_pyarrow() -> ModuleType:
    """pyarrow; ValueError that names the extra where it is not installed."""
    extra.load("pyarrow.parquet", "batch", "Parquet")
    return extra.load("pyarrow", "batch", "Parquet")


@contextmanager
def batch_tables(folder: Path) -> Iterator[Tables]:
    """``recordings.parquet``, ``constraints.parquet`` and ``refusals.parquet`` in a folder, whole when the block ends.

    ValueError without pyarrow, OSError where they cannot be written.
    """
    schemas = _schemas(require_pyarrow())
    with ExitStack() as stack:
        files = {name: stack.enter_context(whole_file(folder / f"{name}.parquet")) for name in NAMES}
        sheets = {name: stack.enter_context(_sheet(file, schemas[name])) for name, file in files.items()}
        yield Tables(sheets)


class Tables:
    """Takes one recording after another."""

    def __init__(self, sheets: Mapping[str, Sheet]) -> None:
        self._sheets = sheets

    def add_recording(self, row: Row, summary: Mapping[str, Any] | None) -> None:
        """A recording with its JSON; None where it failed."""
        whats = [finding["what"] for finding in row.findings]
        self._sheets["recordings"].add_row({**_items(asdict(row), "rejected", "stage_p50_ms"), "findings": whats})
        for item in () if summary is None else summary["constraints"]:
            self._sheets["constraints"].add_row({"recording": row.recording, **_constraint(item)})
        for item in () if summary is None else summary["refusals"]:
            self._sheets["refusals"].add_row({"recording": row.recording, **_pair(item)})


class Sheet:
    """The rows of one table, written in groups."""

    def __init__(self, writer: Any, schema: Any) -> None:
        self._writer, self._schema, self._rows = writer, schema, list[Mapping[str, Any]]()

    def add_row(self, row: Mapping[str, Any]) -> None:
        """Take a row; what the schema does not name is left out."""
        self._rows.append(row)
        if len(self._rows) >= GROUP:
            self.flush()

    def flush(self) -> None:
        """Write what is held."""
        arrow = require_pyarrow()
        self._writer.write_table(arrow.Table.from_pylist(self._rows, self._schema))
        self._rows = []


@contextmanager
def _sheet(file: Any, schema: Any) -> Iterator[Sheet]:
    with require_pyarrow().parquet.ParquetWriter(file, schema) as writer:
        sheet = Sheet(writer, schema)
        yield sheet
        sheet.flush()


def _pair(pair: Mapping[str, Any]) -> dict[str, Any]:
    """A constraint or a refusal with its pose flat and its evidence as items."""
    pose = pair["T_from_to"]
    flat = None if pose is None else np.ravel(pose).tolist()
    return {**_items(pair, "evidence"), "T_from_to": flat}


def _constraint(pair: Mapping[str, Any]) -> dict[str, Any]:
    error = pair["error"]
    judged = {
        "error_rotation_deg": error and error["rotation_deg"],
        "error_translation_cm": error and error["translation_cm"],
        "false": error and not within((error["rotation_deg"], error["translation_cm"]), FALSE),
    }
    return {**_pair(pair), "covariance": np.ravel(pair["covariance"]).tolist(), **judged}


def _items(row: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The row with its mappings as the items that a map of Arrow is made of."""
    return {**row, **{name: sorted(row[name].items()) for name in names}}


def _schemas(arrow: ModuleType) -> dict[str, Any]:
    text, whole, number = arrow.string(), arrow.int64(), arrow.float64()
    numbers = arrow.map_(text, number)
    ends = {"recording": text, "from_ns": whole, "to_ns": whole, "T_from_to": arrow.list_(number)}
    counts = ("frames", "detections", "objects", "constraints", "revisits", "strict", "loose", "false")
    recordings = {
        **dict.fromkeys(("name", "recording", "file", "page", "error"), text),
        **dict.fromkeys(counts, whole),
        "rejected": arrow.map_(text, whole),
        "seconds": number,
        "stage_p50_ms": numbers,
        "findings": arrow.list_(text),
    }
    errors = {"error_rotation_deg": number, "error_translation_cm": number, "false": arrow.bool_()}
    constraints = {"covariance": arrow.list_(number), "labels": arrow.list_(text), "evidence": numbers, **errors}
    refusals = {"reason": text, "detail": text, "evidence": numbers}
    tables = {"recordings": recordings, "constraints": {**ends, **constraints}, "refusals": {**ends, **refusals}}
    return {name: arrow.schema(columns) for name, columns in tables.items()}
