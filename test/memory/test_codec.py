# SPDX-License-Identifier: Apache-2.0
"""Blobs: packed arrays come back, damaged ones are refused."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.memory.codec import pack, unpack


def test_arrays_of_any_kind_and_none_come_back() -> None:
    arrays = (np.arange(6, dtype=np.float32).reshape(2, 3), None, np.zeros((0, 3), np.uint8), np.array(5, np.uint16))
    back = unpack(pack(*arrays))
    assert back[1] is None
    for before, after in zip(arrays, back, strict=True):
        if before is not None:
            assert after.dtype == before.dtype and np.array_equal(after, before)


@pytest.mark.parametrize("blob", [b"", b"no blob", pack(np.arange(9.0))[:-7]])
def test_a_damaged_blob_is_refused(blob: bytes) -> None:
    with pytest.raises(ValueError, match="damaged"):
        unpack(blob)
