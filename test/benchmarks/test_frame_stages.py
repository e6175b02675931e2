# SPDX-License-Identifier: Apache-2.0
"""How the table of a frame's milliseconds is made."""

from __future__ import annotations

import importlib


def test_the_rows_add_up_to_what_the_process_used_for_each_frame() -> None:
    runs = {"segment": [(0.010, 0.008), (0.030, 0.012)], "receive": [(0.001, 0.001)] * 2}
    process = {"seconds": 2.0, "processor_seconds": 0.03, "stages": runs}
    rows = importlib.import_module("frame_stages").table_of(2, process)
    assert list(rows) == ["segment", "other", "receive", "all"]
    assert {stage: row["cpu_ms"] for stage, row in rows.items()} == {
        "segment": 10.0,
        "other": 4.0,
        "receive": 1.0,
        "all": 15.0,
    }
    assert rows["segment"]["wall_ms_p50"] == 20.0 and rows["all"]["cpu_percent"] == 1.5
