# SPDX-License-Identifier: Apache-2.0
"""What the benchmark of registration keeps is of the code that runs."""

from __future__ import annotations

from pathlib import Path

import pytest


def test_a_piece_is_kept_for_the_code_that_made_it_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import registration

    def piece(success: bool) -> bool:
        bench = registration.Bench("clean", 0, tmp_path)
        return bool(bench._piece("single", lambda: [{"success": success}])[0]["success"])

    assert [piece(True), piece(False)] == [True, True]
    monkeypatch.setattr(registration, "code", lambda: "another")
    assert [piece(False), piece(True)] == [False, False]
