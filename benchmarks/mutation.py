# SPDX-License-Identifier: Apache-2.0
"""Messages that are almost good: every field of a ROS message at the values where code breaks.

All of them are such as the wire can carry: integers and floats are in the range of their type. The randomness comes
from a `random.Random` alone, which may be hypothesis's.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from trials import NoTrialError

from objreg_ros.bridge.messages.layout import DATATYPES, FORMATS

FLOATS = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1.0, 0.5, 2.0, 1e-45, 1e-30, 1e-12, 1e-3, 255.5, 65535.0, 65536.0,
    1e6, 1e9, 2.0**31, 2.0**63, 1e20, 1e30, -1e30, 3e38, -3e38, 1e160, -1e160, 1.7e308,
)  # fmt: skip
INTS = (
    -(2**31), -1, 0, 1, 2, 3, 4, 7, 8, 16, 127, 128, 255, 256, 30_000, 32_767, 32_768, 65_534, 65_535, 65_536, 70_000,
    1_000_000, 999_999_999, 10**9, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1,
)  # fmt: skip
STRINGS = (
    "", " ", "x", "z", "rgb", "rgba", "intensity", "camera", "camera@", "@1.000000000", "a@b@1.000000000", "\0", "\n",
    "é" * 40, "\U0001f4a5", "x" * 100_000, "rgb8", "bgr8", "rgba8", "mono8", "mono16", "8UC1", "8UC3", "8UC4", "16UC1",
    "32FC1", "64FC1", "8UC1000000", "bayer_rggb8", "yuv422", "jpeg", "png", "rgb8; jpeg compressed bgr8",
    "16UC1; compressedDepth", "32FC1; compressedDepth png", "compressedDepth", "32FC1; compressedDepth rvl",
)  # fmt: skip
RANGES = {f"{sign}int{bits}": (0 if sign else -(2 ** (bits - 1)), 2 ** (bits - (not sign)) - 1)
          for sign in ("", "u") for bits in (8, 16, 32, 64)}  # fmt: skip
RANGES |= {"octet": (0, 255), "byte": (0, 255), "char": (0, 255)}
MOST_BYTES = 1 << 20  # of what is not a bomb by intention


def mutated(draw: random.Random, message: Any) -> Any:
    """A changed copy of a message, now and then one with no change; `NoTrialError` for bytes that are none."""
    how = draw.random()
    if how < 0.03:
        return message
    if how < 0.2:
        return _with_flipped_bytes(draw, message)
    message = clone(message)
    recipe = RECIPES.get(type(message))
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        if recipe is not None and draw.random() < 0.5:
            draw.choice(recipe)(draw, message)
        else:
            _mutate_field(draw, message)
    return message


def clone(value: Any) -> Any:
    """A copy of a message that shares the arrays, which are replaced and never written to."""
    if hasattr(value, "get_fields_and_field_types"):
        made: Any = object.__new__(type(value))
        for slot in value.__slots__:
            setattr(made, slot, clone(getattr(value, slot)))
        return made
    return [clone(item) for item in value] if isinstance(value, list) else value


def flipped(draw: random.Random, data: bytes, most: int = 8) -> bytes:
    """Some bytes with a bit flipped, or replaced, or a number of four bytes overwritten, or the end cut off."""
    found = bytearray(data)
    for _ in range(draw.randint(1, most) if found else 0):
        at, how = draw.randrange(len(found)), draw.random()
        if how < 0.5:
            found[at] ^= 1 << draw.randrange(8)
        elif how < 0.8:
            found[at] = draw.randrange(256)
        else:
            found[at : at + 4] = (draw.choice(INTS) % 2**32).to_bytes(4, draw.choice(("little", "big")))
    return bytes(found[: draw.randrange(len(found) + 1)]) if draw.random() < 0.1 else bytes(found)


def _with_flipped_bytes(draw: random.Random, message: Any) -> Any:
    """What comes of a message of which the network changed some bytes."""
    data = serialize_message(message)
    head = draw.choice((len(data), 256, 64))  # what is not pixels is mostly at the beginning
    changed = flipped(draw, data[4:head])
    try:
        return deserialize_message(data[:4] + changed + data[head:], type(message))
    except Exception as error:
        raise NoTrialError(f"no {type(message).__name__}: {error}") from error


def _mutate_field(draw: random.Random, message: Any) -> None:
    names = message.get_fields_and_field_types()
    name = draw.choice(list(names))
    setattr(message, name, _other(draw, getattr(message, name), names[name]))


def _other(draw: random.Random, value: Any, kind: str) -> Any:
    """Another value of the type."""
    if kind.startswith("sequence<"):
        return _other_sequence(draw, value, kind.removeprefix("sequence<").rstrip(">").split(",")[0])
    if kind.endswith("]"):
        return _other_numbers(draw, np.array(value))
    if kind == "boolean":
        return not value
    if kind in ("double", "float"):
        return other_float(draw, kind == "float")
    if kind in RANGES:
        return other_int(draw, *RANGES[kind])
    if kind.startswith("string"):
        return draw.choice(STRINGS)
    _mutate_field(draw, value)
    return value


def other_float(draw: random.Random, single: bool) -> float:
    """A float where code breaks."""
    value = draw.choice(FLOATS) if draw.random() < 0.9 else draw.uniform(-1e4, 1e4)
    with np.errstate(over="ignore"):
        return float(np.float32(value)) if single else value


def other_int(draw: random.Random, least: int, most: int) -> int:
    """An integer of a range where code breaks."""
    value = draw.choice(INTS) if draw.random() < 0.9 else draw.randint(least, most)
    return value if least <= value <= most else draw.choice((least, most))


def _other_sequence(draw: random.Random, values: Any, kind: str) -> Any:
    if kind in ("uint8", "octet", "byte"):
        return _bytes_like(values, _other_bytes(draw, bytes(values)))
    how = draw.randrange(5)
    if how == 0 or not len(values):
        return values[:0]
    if how == 1:
        return values[: draw.randrange(len(values))]
    if how == 2 and len(values) < 1000:
        return values + values
    if kind in ("double", "float"):
        return type(values)(values.typecode, _other_numbers(draw, np.array(values)))
    if isinstance(values, list) and hasattr(values[0], "get_fields_and_field_types"):
        _mutate_field(draw, draw.choice(values))
    return values


def _bytes_like(values: Any, data: bytes) -> Any:
    return type(values)(values.typecode, data) if hasattr(values, "typecode") else data


def _other_bytes(draw: random.Random, data: bytes) -> bytes:
    how = draw.randrange(6)
    if how == 0:
        return b""
    if how == 1:
        return data[: draw.randrange(len(data) + 1)]
    if how == 2:
        return (data + data)[:MOST_BYTES]
    if how == 3:
        value = np.float32(other_float(draw, True)).tobytes()
        at = draw.randrange(len(data) // 4 + 1) * 4
        return data[:at] + value + data[at + 4 :]
    return flipped(draw, data)


def _other_numbers(draw: random.Random, values: Any) -> Any:
    values = values.copy()
    if values.size:
        which = slice(None) if draw.random() < 0.2 else draw.randrange(values.size)
        values[which] = other_float(draw, values.dtype == np.float32)
    return values


# --------------------------------------------------------------------------------------- clouds, pictures and cameras


def _column(draw: random.Random, cloud: Any) -> None:
    """A boundary in one column: in one record, in every third or in all."""
    if not cloud.fields:
        return
    field = draw.choice(cloud.fields)
    records = np.frombuffer(cloud.data, np.uint8)
    records = records[: records.size // max(cloud.point_step, 1) * max(cloud.point_step, 1)].reshape(
        -1, max(cloud.point_step, 1)
    )
    value = _packed(draw, field.datatype)
    if not len(records) or field.offset + value.size > cloud.point_step:
        return
    one = draw.randrange(len(records))
    which = draw.choice((slice(one, one + 1), slice(None, None, 3), slice(None), slice(one // 2, one)))
    records = records.copy()
    records[which, field.offset : field.offset + value.size] = value
    cloud.data = _bytes_like(cloud.data, records.tobytes())


def _packed(draw: random.Random, datatype: int) -> Any:
    kind = np.dtype(FORMATS.get(datatype, "f4"))
    if kind.kind == "f":
        value = other_float(draw, kind.itemsize == 4)
    else:
        value = other_int(draw, int(np.iinfo(kind).min), int(np.iinfo(kind).max))
    return np.frombuffer(np.array([value], kind).tobytes(), np.uint8)


def _retyped(draw: random.Random, cloud: Any) -> None:
    """A field of another type, moved behind the record, with a boundary in every record."""
    step, count = cloud.point_step, cloud.width * cloud.height
    if not cloud.fields or len(cloud.data) != step * count or count == 0 or step > 200:
        return
    field = draw.choice(cloud.fields)
    field.datatype, field.offset = draw.choice(list(DATATYPES.values())), step
    value = _packed(draw, field.datatype)
    records = np.zeros((count, step + value.size), np.uint8)
    records[:, :step] = np.frombuffer(cloud.data, np.uint8).reshape(count, step)
    records[:, step:] = value
    cloud.point_step, cloud.row_step = step + value.size, (step + value.size) * cloud.width
    cloud.data = _bytes_like(cloud.data, records.tobytes())


def _field(draw: random.Random, cloud: Any) -> None:
    """A field with another name, place, type or count."""
    if not cloud.fields:
        return
    field = draw.choice(cloud.fields)
    name, value = draw.choice(
        (
            ("count", draw.choice((0, 2, 3, 4, 1000, 2**31, 2**32 - 1))),
            ("datatype", draw.randrange(10)),
            ("offset", draw.choice((0, 1, 2, 3, cloud.point_step, 2**31, 2**32 - 1))),
            ("name", draw.choice((*STRINGS[:6], draw.choice(cloud.fields).name))),
        )
    )
    setattr(field, name, value)


def _counted(draw: random.Random, cloud: Any) -> None:
    """A field of several numbers."""
    if cloud.fields:
        draw.choice(cloud.fields).count = draw.choice((0, 2, 3, 4, 2**32 - 1))


def _fields(draw: random.Random, cloud: Any) -> None:
    """Fields missing, twice, in another order, or many."""
    fields = list(cloud.fields)
    draw.shuffle(fields)
    cloud.fields = draw.choice((fields, fields[1:], fields[:1], [], fields + fields[:1]))


def _shape(draw: random.Random, message: Any) -> None:
    """Another size: of as many pixels, of none, of one row or column, or of more than there can be."""
    width, height = message.width, message.height
    sizes = (
        (width * height, 1), (1, width * height), (height, width), (0, 0), (0, height), (width, 0), (width, 1), (1, 1),
        (width - 1, height), (width, height - 1), (2**31, 2), (2**32 - 1, 2**32 - 1), (65_536, 65_536),
    )  # fmt: skip
    message.width, message.height = (max(0, min(size, 2**32 - 1)) for size in draw.choice(sizes))
    if hasattr(message, "point_step") and draw.random() < 0.7:
        message.row_step = min(message.width * message.point_step, 2**32 - 1)
    elif hasattr(message, "step") and draw.random() < 0.7:
        message.step = len(message.data) // max(message.height, 1)


def _huge_camera(draw: random.Random, info: Any) -> None:
    """A camera that is right but for its size."""
    side = draw.choice((1, 2, 30_000, 20_000, 10**6, 2**31, 2**32 - 1))
    info.width, info.height = side, draw.choice((side, 1, info.height))


def _encoding(draw: random.Random, picture: Any) -> None:
    picture.encoding = draw.choice(STRINGS)
    picture.is_bigendian = draw.choice((0, 1, 255))


def _format(draw: random.Random, picture: Any) -> None:
    picture.format = draw.choice(STRINGS)


def _claimed_size(draw: random.Random, picture: Any) -> None:
    """A png or jpeg whose header claims another size."""
    data, side = bytearray(picture.data), draw.choice((0, 1, 30_000, 65_535, 7072, 2**31 - 1))
    start = data.find(b"IHDR")
    if start >= 0:
        data[start + 4 : start + 12] = side.to_bytes(4, "big") * 2
        data[start + 17 : start + 21] = _crc(bytes(data[start : start + 17]))
    start = next((at for sof in (b"\xff\xc0", b"\xff\xc2") if (at := data.find(sof)) >= 0), -1)
    if start >= 0:
        data[start + 5 : start + 9] = (side % 65_536).to_bytes(2, "big") * 2
    picture.data = _bytes_like(picture.data, bytes(data))


def _crc(data: bytes) -> bytes:
    from zlib import crc32

    return crc32(data).to_bytes(4, "big")


Recipe = Callable[[random.Random, Any], None]

RECIPES: dict[type, tuple[Recipe, ...]] = {
    PointCloud2: (_column, _column, _column, _retyped, _field, _counted, _fields, _shape),
    Image: (_encoding, _shape),
    CameraInfo: (_huge_camera,),
    CompressedImage: (_format, _claimed_size, _claimed_size),
}
