# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from io import BytesIO
from types import ModuleType

import cv2
import numpy as np
import pytest

from objreg_tools.recording.folders import record3d_depth
from objreg_tools.recording.folders.record3d_depth import metres_of

KNOWN = {"dw": 3, "dh": 4, "w": 6, "h": 8}
METRES = np.arange(12, dtype=np.float32).reshape(4, 3)


def test_png_is_millimetres_and_numpy_metres() -> None:
    data = cv2.imencode(".png", (METRES * 1000).astype(np.uint16))[1].tobytes()
    assert np.array_equal(metres_of(data, "depth/0.png", "a/0.png", KNOWN), METRES)
    file = BytesIO()
    np.save(file, METRES)
    assert np.array_equal(metres_of(file.getvalue(), "depth/0.npy", "a/0.npy", KNOWN), METRES)


def test_depth_that_no_library_here_unpacks_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record3d_depth, "DECODERS", ("no_such_library",))
    with pytest.raises(
        ValueError, match=r"0\.depth: expected .*got Apple's LZFSE.*`pip install pyliblzfse`, or export"
    ):
        metres_of(b"bvx2" + bytes(100), "rgbd/0.depth", "a/0.depth", KNOWN)
    with pytest.raises(ValueError, match=r"0\.exr: expected depth that OpenCV reads, got OpenEXR.*16-bit PNG or \.npy"):
        metres_of(b"v/1\x01" + bytes(100), "depth/0.exr", "a/0.exr", KNOWN)


@pytest.fixture
def unpacker(monkeypatch: pytest.MonkeyPatch) -> None:
    """A library that unpacks what follows eight bytes."""
    library = ModuleType("a_lzfse")
    library.decompress = lambda data: data[8:]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "a_lzfse", library)
    monkeypatch.setattr(record3d_depth, "DECODERS", ("no_such_library", "a_lzfse"))


@pytest.mark.parametrize("known", [KNOWN, {"w": 6, "h": 8}])
def test_unpacked_depth_has_the_size_of_the_metadata_or_the_shape_of_colour(known: dict, unpacker: None) -> None:
    data = b"bvx-" + bytes(4) + METRES.tobytes()
    assert np.array_equal(metres_of(data, "rgbd/0.depth", "a/0.depth", known), METRES)
    with pytest.raises(ValueError, match=r"expected depth of .* pixels, got 11"):
        metres_of(data[:-4], "rgbd/0.depth", "a/0.depth", known)


def test_a_block_that_becomes_too_much_is_refused_before_it_is_unpacked(unpacker: None) -> None:
    with pytest.raises(ValueError, match="got a block of 4294967295 bytes"):
        metres_of(b"bvx2\xff\xff\xff\xff", "rgbd/0.depth", "a/0.depth", KNOWN)


def test_an_array_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="expected an array of numpy"):
        metres_of(b"no array", "depth/0.npy", "a/0.npy", KNOWN)
