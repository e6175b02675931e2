# SPDX-License-Identifier: Apache-2.0
"""The definition of a type is made of what its class says."""

from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from objreg_ros.blackbox.definitions import definition


class Inner:
    @staticmethod
    def get_fields_and_field_types() -> dict[str, str]:
        return {"flag": "boolean", "raw": "octet", "near": "float", "name": "string<10>"}


class Outer:
    @staticmethod
    def get_fields_and_field_types() -> dict[str, str]:
        return {
            "inner": "p/Inner",
            "all": "sequence<p/Inner>",
            "few": "sequence<p/Inner, 3>",
            "matrix": "double[36]",
            "numbers": "sequence<uint8>",
        }


def test_every_kind_of_field_is_as_in_a_msg_file() -> None:
    text = definition("p/msg/Outer", {"p/msg/Outer": Outer, "p/msg/Inner": Inner}.__getitem__)
    outer, inner = text.split("=" * 80 + "\n")
    assert outer == "p/Inner inner\np/Inner[] all\np/Inner[<=3] few\nfloat64[36] matrix\nuint8[] numbers\n"
    assert inner == "MSG: p/Inner\nbool flag\nbyte raw\nfloat32 near\nstring<=10 name\n"


@pytest.mark.parametrize(
    "msgtype",
    [
        *(f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "PointCloud2", "CameraInfo", "Imu")),
        *("nav_msgs/msg/Odometry", "diagnostic_msgs/msg/DiagnosticArray", "std_msgs/msg/String"),
    ],
)
def test_the_definition_of_an_installed_type_is_that_of_ros(msgtype: str) -> None:
    player = pytest.importorskip("objreg_ros.bridge.streams.player")
    types = get_types_from_msg(definition(msgtype, player.message_type), msgtype)
    shipped = get_typestore(Stores.ROS2_JAZZY).fielddefs
    assert {name: fields[1] for name, fields in types.items()} == {name: shipped[name][1] for name in types}
