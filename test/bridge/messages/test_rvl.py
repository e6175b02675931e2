# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import struct

import numpy as np
import pytest

from objreg_ros.bridge.messages import rvl


def nibbles(number: int) -> list[int]:
    """A number in nibbles of three bits, the lowest first; a fourth bit says that more follow."""
    threes = [number >> shift & 7 for shift in range(0, max(number.bit_length(), 1), 3)]
    return [three | 8 for three in threes[:-1]] + threes[-1:]


def stream(numbers: list[int]) -> bytes:
    """Numbers as 32-bit words of little endian, the first nibble in the upper bits of the first word."""
    row = [nibble for number in numbers for nibble in nibbles(number)]
    row += [0] * (-len(row) % 8)
    words = [int("".join(f"{nibble:x}" for nibble in row[at : at + 8]), 16) for at in range(0, len(row), 8)]
    return struct.pack(f"<{len(words)}I", *words)


def numbers_of(pixels: np.ndarray) -> list[int]:
    """Zeros, others, and the zigzag differences of the others, run by run."""
    numbers, row, before, at = [], pixels.ravel().tolist(), 0, 0
    while at < len(row):
        begin = at
        while at < len(row) and row[at] == 0:
            at += 1
        first = at
        while at < len(row) and row[at] != 0:
            at += 1
        numbers += [first - begin, at - first]
        for value in row[first:at]:
            step, before = value - before, value
            numbers.append(2 * step if step >= 0 else -2 * step - 1)
    return numbers


def packed(pixels: np.ndarray) -> np.ndarray:
    """What compressed_depth_image_transport writes behind its own header: width, height, and the stream."""
    height, width = pixels.shape
    return np.frombuffer(struct.pack("<ii", width, height) + stream(numbers_of(pixels)), np.uint8)


def claiming(width: int, height: int, numbers: list[int]) -> np.ndarray:
    return np.frombuffer(struct.pack("<ii", width, height) + stream(numbers), np.uint8)


def test_the_words_of_a_small_picture_are_those_that_its_paper_gives() -> None:
    # one zero, two pixels (5, then 3): 1, 2, zigzag 10 = 2 + 8 * 1 in two nibbles, zigzag 3
    assert packed(np.array([[0, 5, 3]], np.uint16)).tobytes() == struct.pack("<iiI", 3, 1, 0x12A13000)
    by_hand = np.frombuffer(struct.pack("<iiI", 3, 1, 0x12A13000), np.uint8)
    assert rvl.unpack(by_hand).tolist() == [[0, 5, 3]]


@pytest.mark.parametrize("zeros", [0.0, 0.3, 0.95, 1.0])
@pytest.mark.parametrize("most", [3, 1000, 65535])
def test_what_was_packed_is_unpacked_to_the_bit(zeros: float, most: int) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.integers(1, most, (37, 53), np.uint16, endpoint=True)
    pixels[rng.random(pixels.shape) < zeros] = 0
    found = rvl.unpack(packed(pixels))
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, pixels)


def test_the_size_is_known_before_anything_is_unpacked() -> None:
    assert rvl.size(claiming(640, 480, [])) == (640, 480)
    with pytest.raises(ValueError, match="expected an rvl header of 8 bytes, got 7; truncated"):
        rvl.size(np.zeros(7, np.uint8))


@pytest.mark.parametrize("kept", [8, 11, 12, 40])
def test_a_stream_that_is_cut_off_is_refused(kept: int) -> None:
    whole = packed(np.arange(1, 101, dtype=np.uint16).reshape(10, 10))
    with pytest.raises(ValueError, match=f"expected 10 × 10 pixels, got .* {kept - 8} bytes .* truncated"):
        rvl.unpack(whole[:kept])


@pytest.mark.parametrize(
    "numbers", [[7, 0], [0, 7, 2, 2, 2, 2, 2, 2, 2], [3, 4], [2**32 - 1, 1], [0, 2**31], [2**33 - 1, 0]]
)
def test_runs_beyond_the_picture_are_refused(numbers: list[int]) -> None:
    with pytest.raises(ValueError, match="expected 3 × 2 pixels, got an rvl stream that goes beyond"):
        rvl.unpack(claiming(3, 2, numbers))


def test_a_number_without_an_end_is_refused() -> None:
    endless = np.frombuffer(struct.pack("<ii", 3, 2) + b"\xff" * 40, np.uint8)
    with pytest.raises(ValueError, match="goes beyond"):
        rvl.unpack(endless)


def test_runs_of_nothing_end_with_the_stream() -> None:
    with pytest.raises(ValueError, match="ends before"):
        rvl.unpack(claiming(3, 2, [0, 0] * 500))


def test_noise_is_a_picture_or_refused() -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        noise = rng.integers(0, 256, rng.integers(0, 60), np.uint8)
        try:
            assert rvl.unpack(np.r_[claiming(5, 4, []), noise].astype(np.uint8)).shape == (4, 5)
        except ValueError as error:
            assert "compressed depth: expected 5 × 4 pixels" in str(error)
