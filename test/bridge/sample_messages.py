# SPDX-License-Identifier: Apache-2.0
"""Messages for tests without ROS: anything with the right attributes will do."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from objreg_ros.bridge.messages.layout import fields_of


def header(stamp_ns: int = 1_000_000_002, frame_id: str = "camera") -> SimpleNamespace:
    stamp = SimpleNamespace(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return SimpleNamespace(stamp=stamp, frame_id=frame_id)


def image(pixels: np.ndarray, encoding: str, pad: int = 0, big: bool = False, **where: Any) -> SimpleNamespace:
    """An Image of native-order pixels (H, W[, C]) with ``pad`` bytes behind each row."""
    order = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<"))
    rows = np.frombuffer(order.tobytes(), np.uint8).reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=77)
    return SimpleNamespace(
        header=header(**where),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=int(big),
        step=rows.shape[1],
        data=rows.tobytes(),
    )


def compressed(data: bytes, kind: str) -> SimpleNamespace:
    return SimpleNamespace(header=header(), format=kind, data=data)


def camera_info(
    K: list[float], width: int, height: int, P: tuple[float, ...] = (0.0,) * 12, **where: Any
) -> SimpleNamespace:
    roi = SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0, do_rectify=False)
    return SimpleNamespace(
        header=header(**where), width=width, height=height, k=K, p=P, d=[], binning_x=0, binning_y=0, roi=roi
    )


def cloud(records: np.ndarray, pad: int = 0, **where: Any) -> SimpleNamespace:
    """A PointCloud2 of records (H, W) with ``pad`` bytes behind each row; big endian if the records are."""
    big = any(kind.base.byteorder == ">" for kind, *_ in records.dtype.fields.values())
    kinds = {np.dtype(f): n for f, n in zip(["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"], range(1, 9), strict=True)}
    fields = [
        SimpleNamespace(
            name=name, offset=place[1], datatype=kinds[place[0].base.newbyteorder("=")], count=math.prod(place[0].shape)
        )
        for name, place in records.dtype.fields.items()
    ]
    rows = np.frombuffer(np.ascontiguousarray(records).tobytes(), np.uint8).reshape(len(records), -1)
    rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=77)
    return SimpleNamespace(
        header=header(**where),
        height=records.shape[0],
        width=records.shape[1],
        fields=fields,
        is_bigendian=big,
        point_step=records.dtype.itemsize,
        row_step=rows.shape[1],
        data=rows.tobytes(),
        is_dense=False,
    )


def own_table(rows: np.ndarray, **where: Any) -> SimpleNamespace:
    """A PointCloud2 of rows (N,) or (H, W) in one of the layouts of this package."""
    message = cloud(np.atleast_2d(rows), **where)
    placed = fields_of(rows.dtype)
    count = {name: math.prod(rows.dtype[name].shape) for name, *_ in placed}
    message.fields = [SimpleNamespace(name=n, offset=o, datatype=d, count=count[n]) for n, o, d in placed]
    return message


def xyz(x: float, y: float, z: float, **more: float) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z, **more)


def odometry(T_quaternion: tuple[float, ...] = (0, 0, 0, 1), at: tuple[float, ...] = (0, 0, 0), **where: Any) -> Any:
    x, y, z, w = T_quaternion
    body = SimpleNamespace(position=xyz(*at), orientation=xyz(x, y, z, w=w))
    inner = SimpleNamespace(pose=body, covariance=np.eye(6).ravel())
    return SimpleNamespace(header=header(**where), child_frame_id="base_link", pose=inner)
