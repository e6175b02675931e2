# SPDX-License-Identifier: Apache-2.0
"""How a PointCloud2 lies in memory, and the layouts of the tables that this package sends as one.

A PointCloud2 is a typed table: named fields at offsets in records of ``point_step`` bytes, in rows of ``row_step``
bytes. Reading one here copies nothing and touches no element. Reads attributes only, so the messages of rclpy and of
rosbags both fit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits

Array = NDArray[Any]

SUPPORT_ID = 65535  # class_id of the support surface, which is no class
SUPPORT_LABEL = "support"
UNNAMED_ID = 65534  # class_id of the objects that the detector has no name for
MOST_WHOLE = 65535  # of the numbers of the tables, which are u2

DETECTIONS = np.dtype(
    [
        ("x_min", "<f4"),
        ("y_min", "<f4"),
        ("x_max", "<f4"),
        ("y_max", "<f4"),
        ("score", "<f4"),
        ("class_id", "<u2"),
        ("image_width", "<u2"),
        ("image_height", "<u2"),
    ]
)
MASK = "mask"  # the column behind these where the table has masks: for each box a PNG of 0 and 255, then zeros
SURPLUS = np.dtype([("surplus", "u1")])  # instead, of a picture that was left out to keep a pace; it has no rows

# rgb is 0x00RRGGBB; the wire calls it FLOAT32, as PCL and RViz do.
OBJECTS = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("rgb", "<u4"),
        ("normal_x", "<f4"),
        ("normal_y", "<f4"),
        ("normal_z", "<f4"),
        ("score", "<f4"),
        ("density", "<f4"),
        ("class_id", "<u2"),
        ("instance", "<u2"),
        ("flags", "<u2"),
    ]
)

LANDMARKS = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("object_id", "<u4"), ("class_id", "<u2")])

VIEW = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])

PACKED = ("rgb", "rgba")
# sensor_msgs/PointField: INT8 = 1 ... FLOAT64 = 8
FORMATS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
DATATYPES = {text: number for number, text in FORMATS.items()}


def fields_of(layout: np.dtype[Any]) -> list[tuple[str, int, int]]:
    """(name, offset, datatype) of each field of a layout, as sensor_msgs/PointField wants them."""
    assert layout.fields is not None
    placed = [(name, *layout.fields[name][:2]) for name in layout.names or ()]
    return [(name, offset, DATATYPES["f4" if name in PACKED else kind.base.str[1:]]) for name, kind, offset in placed]


def table(cloud: Any, *required: str) -> Array:
    """The records of a PointCloud2, (height, width) with one named column a field; a view of ``cloud.data``.

    Packed colours (``rgb``, ``rgba``) come as unsigned integers whatever the type that carries them. ValueError for a
    field that is ``required`` and missing or holds several values, for fields that leave the record and for data that
    are cut off.
    """
    layout = record_layout(cloud)
    missing = [name for name in required if name not in (layout.names or ())]
    if missing:
        raise ValueError(
            f"cloud: expected the fields {', '.join(required)}, got {', '.join(layout.names or ('none',))}"
        )
    _require_single_values(layout, *required, *PACKED)
    height, width, row = int(cloud.height), int(cloud.width), int(cloud.row_step)
    if height * width == 0:
        return np.empty((height, width), layout)
    data = np.frombuffer(cloud.data, np.uint8)
    row = row if height > 1 else max(row, width * layout.itemsize)  # some drivers leave row_step 0 in a single row
    expected = (height - 1) * row + width * layout.itemsize
    if row < width * layout.itemsize:
        raise ValueError(f"cloud: expected a row_step of at least {width} × {layout.itemsize} bytes, got {row}")
    if data.size < expected:
        raise ValueError(f"cloud: expected {expected} bytes for {width} × {height} points, got {data.size}; truncated?")
    return np.ndarray((height, width), layout, buffer=data, strides=(row, layout.itemsize))


def _require_single_values(layout: np.dtype[Any], *names: str) -> None:
    several = [name for name in names if name in (layout.names or ()) and layout[name].shape]
    if several:
        raise ValueError(f"cloud: expected a count of 1 of field {several[0]!r}, got {layout[several[0]].shape[0]}")


def record_layout(cloud: Any) -> np.dtype[Any]:
    """The structured dtype of one record of a PointCloud2; ValueError if it cannot be one."""
    step, order = int(cloud.point_step), ">" if cloud.is_bigendian else "<"
    if not 0 < step <= limits.MOST_RECORD:
        raise ValueError(f"cloud: expected a point_step of 1 to {limits.MOST_RECORD} bytes, got {step}")
    if len(cloud.fields) > limits.MOST_FIELDS:
        raise ValueError(f"cloud: expected at most {limits.MOST_FIELDS} fields, got {len(cloud.fields)}")
    names, kinds, offsets = [], [], []
    for field in cloud.fields:
        kind = _field_kind(field, order)
        if field.name in names:
            raise ValueError(f"cloud: expected fields with names of their own, got {field.name!r} twice")
        if field.offset + kind.itemsize > step:
            end = field.offset + kind.itemsize
            raise ValueError(
                f"cloud: expected field {field.name!r} within point_step {step}, got its end at byte {end}"
            )
        names.append(field.name)
        kinds.append(kind)
        offsets.append(int(field.offset))
    return np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": step})  # type: ignore[call-overload, no-any-return]


def _field_kind(field: Any, order: str) -> np.dtype[Any]:
    if field.datatype not in FORMATS:
        raise ValueError(f"cloud: expected a datatype 1..8 of field {field.name!r}, got {field.datatype}")
    if not field.name or len(field.name) > limits.MOST_NAME:
        raise ValueError(f"cloud: expected a field's name of 1 to {limits.MOST_NAME} characters, got {len(field.name)}")
    packed = field.name in PACKED and FORMATS[field.datatype] in ("f4", "u4", "i4")
    kind = np.dtype(order + ("u4" if packed else FORMATS[field.datatype]))
    if field.count * kind.itemsize > limits.MOST_RECORD:
        raise ValueError(f"cloud: expected field {field.name!r} within a record, got a count of {field.count}")
    return kind if field.count <= 1 else np.dtype((kind, (int(field.count),)))


def columns(records: Array, *names: str) -> Array:
    """Some columns of a (height, width) table as (height, width, len(names)) float32 in native order, copied."""
    if _side_by_side(records.dtype, names):
        first = records[names[0]]
        shape, strides = (*first.shape, len(names)), (*first.strides, first.itemsize)
        return np.array(np.lib.stride_tricks.as_strided(first, shape, strides))
    with np.errstate(over="ignore"):  # of float64: infinity is no number of a point either
        return np.stack([records[name] for name in names], axis=-1, dtype=np.float32, casting="same_kind")


def whole_numbers(records: Array, name: str) -> Array:
    """A column of a table as int64; ValueError unless it holds integers of 16 bits without a sign."""
    column = records[name]
    if column.dtype.kind not in "iu":
        raise ValueError(f"cloud: expected whole numbers in field {name!r}, got {column.dtype}")
    if column.size and not (int(column.min()) >= 0 and int(column.max()) <= MOST_WHOLE):
        raise ValueError(f"cloud: expected 0 to {MOST_WHOLE} in field {name!r}, got {column.min()} to {column.max()}")
    return column.astype(np.int64)


def _side_by_side(layout: np.dtype[Any], names: tuple[str, ...]) -> bool:
    """Whether these fields are native float32 right behind each other: then they are copied in one go."""
    assert layout.fields is not None
    placed = [layout.fields[name][:2] for name in names]
    start = placed[0][1]
    return all(kind == np.float32 and offset == start + 4 * k for k, (kind, offset) in enumerate(placed))
