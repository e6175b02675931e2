# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import array
import struct
import tracemalloc
import zlib
from typing import Any

import cv2
import numpy as np
import pytest

from bridge import sample_messages as messages
from bridge.messages.test_rvl import claiming, packed
from objreg_ros.bridge.messages.pictures import colour_pixels, depth_metres, size_of, unpack_rgb

RED = (200, 30, 10)


def flat(*channels: int) -> np.ndarray:
    return np.tile(np.array(channels, "u1"), (4, 6, 1))


@pytest.mark.parametrize("pad", [0, 3])
@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("rgb8", flat(200, 30, 10)),
        ("bgr8", flat(10, 30, 200)),
        ("rgba8", flat(200, 30, 10, 9)),
        ("bgra8", flat(10, 30, 200, 9)),
        ("8UC3", flat(10, 30, 200)),
        ("8UC4", flat(10, 30, 200, 9)),
    ],
)
def test_every_colour_encoding_gives_rgb(encoding: str, pixels: np.ndarray, pad: int) -> None:
    rgb = colour_pixels(messages.image(pixels, encoding, pad))
    assert rgb.shape == (4, 6, 3) and (rgb == RED).all()


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize(("encoding", "value"), [("mono8", 7), ("8UC1", 7), ("mono16", 7 << 8)])
def test_grey_has_three_equal_channels(encoding: str, value: int, big: bool) -> None:
    pixels = np.full((4, 6), value, "u2" if encoding == "mono16" else "u1")
    assert (colour_pixels(messages.image(pixels, encoding, 2, big)) == 7).all()


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize(("encoding", "order"), [("rgb16", (0, 1, 2)), ("bgr16", (2, 1, 0))])
def test_colour_of_16_bits_keeps_the_upper_eight(encoding: str, order: tuple[int, ...], big: bool) -> None:
    pixels = (flat(*RED).astype("u2")[..., order] << 8) + 77
    assert (colour_pixels(messages.image(pixels, encoding, 2, big)) == RED).all()


def quarters() -> np.ndarray:
    """Red, green, blue and grey, in a quarter of the picture (16, 24) each."""
    rgb = np.zeros((16, 24, 3), np.uint8)
    rgb[:8, :12], rgb[:8, 12:], rgb[8:, :12], rgb[8:, 12:] = (200, 30, 10), (20, 180, 40), (10, 20, 210), (90, 90, 90)
    return rgb


def mosaic(rgb: np.ndarray, pattern: str) -> np.ndarray:
    """What a sensor behind a filter of four letters, those of its first two rows, measures of a picture."""
    raw = np.zeros(rgb.shape[:2], np.uint8)
    for i, letter in enumerate(pattern):
        y, x = divmod(i, 2)
        raw[y::2, x::2] = rgb[y::2, x::2, "rgb".index(letter)]
    return raw


def within_quarters(rgb: np.ndarray) -> np.ndarray:
    """The pixels that do not mix with those of another quarter, (4, 6, 10, 3)."""
    halves = rgb.reshape(2, 8, 2, 12, 3).swapaxes(1, 2).reshape(4, 8, 12, 3)
    return halves[:, 1:-1, 1:-1].astype(int)


@pytest.mark.parametrize("pad", [0, 4])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_bayer_picture_gives_the_colours_that_its_sensor_saw(pattern: str, bits: int, pad: int) -> None:
    raw = mosaic(quarters(), pattern)
    pixels = raw if bits == 8 else raw.astype("u2") << 8
    rgb = colour_pixels(messages.image(pixels, f"bayer_{pattern}{bits}", pad))
    assert rgb.shape == (16, 24, 3) and rgb.dtype == np.uint8
    np.testing.assert_array_equal(within_quarters(rgb), within_quarters(quarters()))


def bt601(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Y, U and V of ITU-R BT.601 in the range of video, (H, W) each."""
    turn = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]])
    yuv = np.rint(rgb / 255.0 @ turn.T + (16, 128, 128)).astype(np.uint8)
    return yuv[..., 0], yuv[..., 1], yuv[..., 2]


def interleaved(rgb: np.ndarray, order: str) -> np.ndarray:
    """(H, W, 2): brightness and, in turn, U and V, in the order of ``uyvy`` or ``yuyv``."""
    y, u, v = bt601(rgb)
    chroma = np.where(np.arange(rgb.shape[1]) % 2 == 0, u, v)
    return np.stack([chroma, y] if order == "uyvy" else [y, chroma], axis=-1)


@pytest.mark.parametrize("pad", [0, 6])
@pytest.mark.parametrize(
    ("encoding", "order"), [("yuv422", "uyvy"), ("uyvy", "uyvy"), ("yuv422_yuy2", "yuyv"), ("yuyv", "yuyv")]
)
def test_a_yuv_picture_gives_the_colours_that_were_put_in(encoding: str, order: str, pad: int) -> None:
    rgb = colour_pixels(messages.image(interleaved(quarters(), order), encoding, pad))
    np.testing.assert_allclose(rgb.astype(int), quarters(), atol=3)


def planes(encoding: str, pad: int = 0) -> Any:
    """`quarters` as brightness and, behind it, pairs of colour; ``pad`` bytes behind each row."""
    y, u, v = bt601(quarters())
    every = 1 if encoding == "nv24" else 2
    pairs = np.stack([c[::every, ::every] for c in ((v, u) if encoding == "nv21" else (u, v))], axis=-1)
    message = messages.image(y, encoding, pad)
    rows = pairs.reshape(len(pairs), -1)
    behind = pad * rows.shape[1] // y.shape[1]
    message.data += np.pad(rows, ((0, 0), (0, behind)), constant_values=77).tobytes()
    return message


@pytest.mark.parametrize("pad", [0, 8])
@pytest.mark.parametrize("encoding", ["nv12", "nv21", "nv24"])
def test_a_picture_whose_colour_comes_behind_its_brightness_gives_what_was_put_in(encoding: str, pad: int) -> None:
    rgb = colour_pixels(planes(encoding, pad))
    assert rgb.shape == (16, 24, 3) and rgb.flags.c_contiguous
    np.testing.assert_allclose(rgb.astype(int), quarters(), atol=3)


@pytest.mark.parametrize("encoding", ["nv12", "nv24"])
def test_planes_that_are_cut_off_or_overlap_are_refused(encoding: str) -> None:
    message = planes(encoding)
    whole, message.data = len(message.data), message.data[:-1]
    with pytest.raises(ValueError, match=f"expected {whole} bytes for 24 × 16, got {whole - 1}; truncated"):
        colour_pixels(message)
    message.step = 20
    with pytest.raises(ValueError, match=f"expected a step of at least 24 bytes for {encoding}, got 20"):
        colour_pixels(message)
    message.width = message.step = 2**30
    with pytest.raises(ValueError, match="expected at most"):
        colour_pixels(message)


@pytest.mark.parametrize(
    ("encoding", "width", "height", "wanted"),
    [
        ("yuyv", 5, 4, "an even width"),
        ("bayer_grbg8", 5, 4, "an even width and height"),
        ("nv21", 4, 5, "an even width and height"),
    ],
)
def test_a_size_that_leaves_half_a_colour_is_refused(encoding: str, width: int, height: int, wanted: str) -> None:
    message = messages.image(np.zeros((height, width, 2), np.uint8), encoding)
    with pytest.raises(ValueError, match=f"expected {wanted} for {encoding}, got {width} × {height}"):
        colour_pixels(message)


@pytest.mark.parametrize("holder", [bytes, lambda data: array.array("B", data), lambda d: np.frombuffer(d, np.uint8)])
def test_the_data_may_be_of_any_kind_of_buffer(holder: object) -> None:
    message = messages.image(flat(200, 30, 10), "rgb8")
    message.data = holder(message.data)  # type: ignore[operator]
    assert (colour_pixels(message) == RED).all()


def test_an_unknown_encoding_is_named() -> None:
    with pytest.raises(ValueError, match="got 'bayer'"):
        colour_pixels(messages.image(flat(1), "bayer"))
    with pytest.raises(ValueError, match="depth: expected an encoding of 16UC1, mono16, 32FC1, got 'rgb8'"):
        depth_metres(messages.image(flat(1, 2, 3), "rgb8"))


@pytest.mark.parametrize(
    "pixels", [np.zeros((4, 6), np.uint8), np.zeros((4, 6, 3), np.uint16)], ids=["8 bits", "colour"]
)
@pytest.mark.parametrize(("kind", "head"), [("16UC1; png", b""), ("16UC1; compressedDepth png", bytes(12))])
def test_compressed_depth_that_is_not_of_16_bits_and_one_channel_is_refused(
    pixels: np.ndarray, kind: str, head: bytes
) -> None:
    png = cv2.imencode(".png", pixels)[1].tobytes()
    with pytest.raises(ValueError, match=f"expected 16 bits of one channel, got {pixels.dtype}"):
        depth_metres(messages.compressed(head + png, kind))


def test_an_empty_image_is_refused() -> None:
    message = messages.image(flat(200, 30, 10), "rgb8")
    message.width = 0
    with pytest.raises(ValueError, match="expected pixels, got 0 × 4"):
        colour_pixels(message)


def test_a_truncated_image_is_refused_with_expected_and_got() -> None:
    message = messages.image(flat(200, 30, 10), "rgb8")
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match="expected 72 bytes for 6 × 4, got 71"):
        colour_pixels(message)


def test_a_single_row_may_leave_its_step_out() -> None:
    message = messages.image(flat(200, 30, 10)[:1], "rgb8")
    message.step = 0
    assert (colour_pixels(message) == RED).all()


def test_a_step_below_the_line_is_refused() -> None:
    message = messages.image(flat(200, 30, 10), "rgb8")
    message.step = 17
    with pytest.raises(ValueError, match="step of at least 18"):
        colour_pixels(message)


@pytest.mark.parametrize("kind", [".jpg", ".png"])
def test_a_compressed_image_is_rgb(kind: str) -> None:
    data = cv2.imencode(kind, flat(10, 30, 200))[1].tobytes()
    rgb = colour_pixels(messages.compressed(data, f"bgr8; {kind[1:]} compressed bgr8"))
    assert np.abs(rgb.astype(int) - RED).max() <= 2


def test_a_jpeg_is_taken_as_it_is_stored_however_it_is_to_be_held() -> None:
    data = cv2.imencode(".jpg", np.zeros((40, 60, 3), np.uint8))[1].tobytes()
    turned = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6
    tagged = data[:2] + b"\xff\xe1" + struct.pack(">H", len(turned) + 2) + turned + data[2:]
    assert cv2.imdecode(np.frombuffer(tagged, np.uint8), cv2.IMREAD_COLOR).shape == (60, 40, 3)
    assert colour_pixels(messages.compressed(tagged, "jpeg")).shape == (40, 60, 3)


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff\xe0 no jpeg", b"BM" + bytes(200), b"\0\0\1\0" * 9])
def test_what_does_not_begin_as_a_jpeg_or_png_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=f"expected jpeg or png, got {len(data)} bytes that do not begin so"):
        colour_pixels(messages.compressed(data, "jpeg"))


def test_a_picture_of_another_kind_is_refused_though_opencv_would_take_it() -> None:
    data = cv2.imencode(".bmp", flat(10, 30, 200))[1].tobytes()
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) is not None
    with pytest.raises(ValueError, match="expected jpeg or png"):
        colour_pixels(messages.compressed(data, "bgr8; bmp compressed"))


def test_a_picture_that_begins_well_and_does_not_go_on_is_refused() -> None:
    whole = png_that_claims(64, 64, 8, 2)
    with pytest.raises(ValueError, match="expected a jpeg or png, got 69 bytes that do not decode"):
        colour_pixels(messages.compressed(whole, "png"))
    with pytest.raises(ValueError, match=r"expected a png of \d+ bytes, got 50; truncated"):
        colour_pixels(messages.compressed(whole[:50], "png"))


def test_a_chunk_that_claims_gigabytes_is_refused_before_memory_is_taken_for_it() -> None:
    data = bytearray(cv2.imencode(".png", flat(10, 30, 200))[1].tobytes())
    data[33:37] = (0x7FFFFFFF).to_bytes(4, "big")  # the length of IDAT
    with pytest.raises(ValueError, match="expected a png of 2147483"):
        colour_pixels(messages.compressed(bytes(data), "png"))


def png_that_claims(width: int, height: int, bits: int, colour: int) -> bytes:
    """A PNG whose header states so many pixels, and which has next to none."""
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes(100))),
        (b"IEND", b""),
    )
    framed = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def jpeg_that_claims(width: int, height: int) -> bytes:
    jpeg = bytearray(cv2.imencode(".jpg", np.zeros((16, 16, 3), np.uint8))[1].tobytes())
    frame = jpeg.index(b"\xff\xc0")
    jpeg[frame + 5 : frame + 9] = struct.pack(">HH", height, width)
    return bytes(jpeg)


CLAIMS = {"jpeg": jpeg_that_claims(65500, 65500), "png": png_that_claims(60000, 60000, 8, 2)}


@pytest.mark.parametrize("data", CLAIMS.values(), ids=CLAIMS)
def test_a_header_that_claims_too_many_pixels_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="expected at most 50000000 pixels, got "):
        colour_pixels(messages.compressed(data, "jpeg"))


@pytest.mark.parametrize("kind", [".jpg", ".png"])
def test_how_many_pixels_a_picture_may_have_is_up_to_who_asks(kind: str) -> None:
    message = messages.compressed(cv2.imencode(kind, np.zeros((40, 60, 3), np.uint8))[1].tobytes(), kind)
    assert colour_pixels(message, 2400).shape == (40, 60, 3)
    with pytest.raises(ValueError, match="expected at most 2399 pixels, got 60 × 40"):
        colour_pixels(message, 2399)


def test_a_raw_picture_has_the_same_limit() -> None:
    message = messages.image(np.zeros((4, 6), np.uint16), "16UC1")
    assert depth_metres(message, 24).shape == (4, 6)
    with pytest.raises(ValueError, match="expected at most 23 pixels, got 6 × 4"):
        depth_metres(message, 23)


def test_a_row_of_more_pixels_than_a_table_can_state_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at most 65535 pixels a side, got 70000 × 2"):
        colour_pixels(messages.compressed(png_that_claims(70_000, 2, 8, 2), "png"))


def test_a_picture_bomb_is_refused_before_memory_is_taken_for_it() -> None:
    tracemalloc.start()
    for bits, colour in ((8, 2), (16, 2)):
        with pytest.raises(ValueError, match="expected at most 50000000 pixels, got"):
            colour_pixels(messages.compressed(png_that_claims(30000, 30000, bits, colour), "png"))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1_000_000


def test_compressed_depth_that_claims_too_many_pixels_is_refused() -> None:
    data = bytes(12) + png_that_claims(60000, 60000, 16, 0)
    with pytest.raises(ValueError, match="expected at most 50000000 pixels, got"):
        depth_metres(messages.compressed(data, "16UC1; compressedDepth png"))


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
def test_millimetres_become_metres_and_no_depth_becomes_zero(encoding: str, big: bool) -> None:
    pixels = np.array([[0, 1, 1500], [65535, 65534, 10000]], np.uint16)
    depth = depth_metres(messages.image(pixels, encoding, 4, big))
    assert depth.dtype == np.float32
    assert depth == pytest.approx(np.array([[0, 0.001, 1.5], [0, 65.534, 10]]))


@pytest.mark.parametrize("big", [False, True])
def test_floating_depth_keeps_only_what_was_measured(big: bool) -> None:
    pixels = np.array([[np.nan, np.inf, -np.inf], [-1, 0, 1.25]], np.float32)
    depth = depth_metres(messages.image(pixels, "32FC1", 4, big))
    assert depth.tolist() == [[0, 0, 0], [0, 0, 1.25]]


def compressed_depth(pixels: np.ndarray, kind: str, a: float = 0, b: float = 0) -> object:
    png = cv2.imencode(".png", pixels)[1].tobytes()
    return messages.compressed(struct.pack("<iff", 0, a, b) + png, f"{kind}; compressedDepth png")


def test_compressed_depth_of_16_bits_is_millimetres() -> None:
    depth = depth_metres(compressed_depth(np.array([[0, 1500]], np.uint16), "16UC1"))
    assert depth == pytest.approx(np.array([[0, 1.5]]))


def test_compressed_depth_of_floats_is_inverse_depth() -> None:
    a, b = 1000.0, -20.0  # as the sender has it: q = a / depth + b
    quantised = np.array([[0, round(a / 2.0 + b)]], np.uint16)
    depth = depth_metres(compressed_depth(quantised, "32FC1", a, b))
    assert depth == pytest.approx(np.array([[0, 2.0]]), rel=1e-3)


def rvl_depth(behind: np.ndarray, kind: str = "16UC1; compressedDepth rvl", a: float = 0, b: float = 0) -> Any:
    return messages.compressed(struct.pack("<iff", 0, a, b) + behind.tobytes(), kind)


@pytest.mark.parametrize("kind", ["16UC1; compressedDepth rvl", "16UC1;compressedDepth RVL"])
def test_rvl_of_16_bits_is_millimetres_and_of_floats_inverse_depth(kind: str) -> None:
    pixels = np.array([[0, 1500, 65535], [1, 0, 480]], np.uint16)
    depth = depth_metres(rvl_depth(packed(pixels), kind))
    assert depth.dtype == np.float32 and depth == pytest.approx(np.array([[0, 1.5, 0], [0.001, 0, 0.48]]))
    a, b = 1000.0, -20.0
    depth = depth_metres(rvl_depth(packed(pixels), kind.replace("16UC1", "32FC1"), a, b))
    assert depth == pytest.approx(np.array([[0, 1000 / 1520, 1000 / 65555], [1000 / 21, 0, 2.0]]))


def test_the_size_of_rvl_is_known_before_any_pixel_is_decoded() -> None:
    assert size_of(rvl_depth(claiming(640, 480, []))) == (640, 480)
    for width, height in ((0, 480), (640, -1)):
        with pytest.raises(ValueError, match=f"expected pixels, got {width} × {height}"):
            size_of(rvl_depth(claiming(width, height, [])))


@pytest.mark.parametrize(("width", "height"), [(0, 5), (-3, -3), (70_000, 2), (30_000, 30_000), (2**31 - 1, 2**31 - 1)])
def test_rvl_that_claims_an_impossible_size_is_refused_before_memory_is_taken(width: int, height: int) -> None:
    message = rvl_depth(claiming(width, height, [width * height, 0] if width > 0 else []))
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"expected (pixels|at most)"):
        depth_metres(message)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


@pytest.mark.parametrize("length", [0, 5, 12, 19])
def test_rvl_without_its_headers_is_refused(length: int) -> None:
    message = messages.compressed(bytes(length), "32FC1; compressedDepth rvl")
    for read in (depth_metres, size_of):
        with pytest.raises(ValueError, match="expected an rvl header"):
            read(message)


def test_a_plain_png_of_depth_is_millimetres() -> None:
    png = cv2.imencode(".png", np.array([[0, 1500]], np.uint16))[1].tobytes()
    assert depth_metres(messages.compressed(png, "png")) == pytest.approx(np.array([[0, 1.5]]))


def test_a_colour_png_is_no_depth() -> None:
    png = cv2.imencode(".png", flat(1, 2, 3))[1].tobytes()
    with pytest.raises(ValueError, match="expected 16 bits of one channel"):
        depth_metres(messages.compressed(png, "png"))


def test_packed_colours_come_apart() -> None:
    assert unpack_rgb(np.array([[0xFF010203, 0x000A0B0C]], "u4")).tolist() == [[[1, 2, 3], [10, 11, 12]]]


@pytest.mark.parametrize("kind", [".jpg", ".png"])
def test_the_size_is_known_before_any_pixel_is_decoded(kind: str) -> None:
    data = cv2.imencode(kind, np.zeros((4, 6, 3), np.uint8))[1].tobytes()
    assert size_of(messages.image(flat(1, 2, 3), "rgb8")) == size_of(messages.compressed(data, "jpeg")) == (6, 4)
    depth = bytes(12) + cv2.imencode(".png", np.zeros((4, 6), np.uint16))[1].tobytes()
    assert size_of(messages.compressed(depth, "16UC1; compressedDepth png")) == (6, 4)
    with pytest.raises(ValueError, match="expected jpeg or png, got 3 bytes that do not begin so"):
        size_of(messages.compressed(b"abc", "jpeg"))
