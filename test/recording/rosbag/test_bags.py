# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg
from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.rosbag import bag_files, messages
from objreg_tools.recording.rosbag.messages import standard_types
from recording.sample_folders import CAMERA, humble_bag, records, robot_bag

STORAGES = ("mcap", "sqlite3")


@pytest.fixture(params=STORAGES)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    write_rosbag2(tmp_path / "bag", records(), request.param)
    return tmp_path / "bag"


def test_what_was_written_is_read(bag: Path) -> None:
    with open_recording(bag) as recording:
        assert {name: topic.count for name, topic in recording.topics.items()} == {
            "/camera_info": 3,
            "/depth/image": 3,
            "/image": 3,
            "/odom": 3,
        }
        assert (recording.start_ns, recording.seconds) == (10**9, pytest.approx(0.2))
        assert [r.stamp_ns for r in recording.records(["/image"])] == [10**9, 11 * 10**8, 12 * 10**8]
        first = next(recording.records(["/image"]))
        assert from_msg.image(first.message).rgb[0, 0].tolist() == [0, 20, 30]


def test_a_single_file_is_a_recording_too(bag: Path) -> None:
    file = next(f for f in bag.iterdir() if f.suffix in (".mcap", ".db3"))
    with open_recording(file) as recording:
        assert recording.topics["/odom"].count == 3
        poses = [motion_from_msg.odometry(r.message).T_odom_body[0, 3] for r in recording.records(["/odom"])]
        assert poses == pytest.approx([0, 0.1, 0.2])


def test_a_part_in_time_is_read(bag: Path) -> None:
    with open_recording(bag) as recording:
        part = list(recording.records(["/odom", "/image"], start_ns=11 * 10**8, end_ns=12 * 10**8))
        assert [(r.topic, r.stamp_ns) for r in part] == [("/odom", 11 * 10**8), ("/image", 11 * 10**8)]


def test_a_topic_that_is_not_there_gives_nothing(bag: Path) -> None:
    with open_recording(bag) as recording:
        assert list(recording.records(["/nothing"])) == []


def test_the_bytes_are_those_that_ros_2_sends(bag: Path) -> None:
    with open_recording(bag) as recording:
        record = next(recording.records(["/camera_info"]))
        info = standard_types().deserialize_cdr(record.cdr, record.msgtype)
        assert camera_from_msg.intrinsics(info) is not None and camera_from_msg.intrinsics(info).fx == CAMERA.fx


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_compressed_rosbag2_is_read(mode: CompressionMode, tmp_path: Path) -> None:
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        for record in records(1):
            connection = writer.add_connection(record.topic, record.msgtype, typestore=standard_types())
            writer.write(connection, record.stamp_ns, record.cdr)
    with open_recording(tmp_path / "bag") as recording:
        assert from_msg.depth(next(recording.records(["/depth/image"])).message)[0, 0] == 1.0


@pytest.fixture
def rosbag1(tmp_path: Path) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    made = types.types
    stamp = made["builtin_interfaces/msg/Time"](sec=5, nanosec=6)
    header = made["std_msgs/msg/Header"](seq=7, stamp=stamp, frame_id="camera")
    roi = made["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    info = made["sensor_msgs/msg/CameraInfo"](
        header=header,
        height=48,
        width=64,
        distortion_model="plumb_bob",
        D=np.zeros(5),
        K=np.array([50.0, 0, 31.5, 0, 50, 23.5, 0, 0, 1]),
        R=np.eye(3).ravel(),
        P=np.array([49.0, 0, 30.5, 0, 0, 49, 22.5, 0, 0, 0, 1, 0]),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )
    writer = Rosbag1Writer(tmp_path / "one.bag")
    writer.set_compression(Rosbag1Writer.CompressionFormat.LZ4)
    with writer:
        connection = writer.add_connection("/camera/rgb/camera_info", info.__msgtype__, typestore=types)
        writer.write(connection, 9 * 10**9, types.serialize_ros1(info, info.__msgtype__))
    return tmp_path / "one.bag"


def test_a_compressed_rosbag1_is_read_and_brought_up_to_date(rosbag1: Path) -> None:
    with open_recording(rosbag1) as recording:
        record = next(recording.records())
        assert recording.kind == "rosbag1" and record.stamp_ns == 9 * 10**9
        assert camera_from_msg.intrinsics(record.message).cx == 30.5
        modern = standard_types().deserialize_cdr(record.cdr, record.msgtype)
        assert headers.stamp_ns(modern) == 5_000_000_006 and camera_from_msg.intrinsics(modern).cx == 30.5


def test_what_ros_1_latched_is_kept_for_who_comes_late(tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/String"
    raw = types.serialize_ros1(types.types[kind](data="a"), kind)
    publishers = (("/map", "/a", 1), ("/map", "/b", 1), ("/map", "/c", 0), ("/chatter", "/a", 0), ("/log", "/a", None))
    with Rosbag1Writer(tmp_path / "one.bag") as writer:
        for topic, caller, latching in publishers:
            connection = writer.add_connection(topic, kind, typestore=types, callerid=caller, latching=latching)
            writer.write(connection, 10**9, raw)
    with open_recording(tmp_path / "one.bag") as recording:
        ((topic, (profile,)),) = recording.offered_qos().items()
    assert (topic, profile.durability, profile.depth) == ("/map", QosDurability.TRANSIENT_LOCAL, 2)


def test_a_real_rosbag1_gives_its_cloud(shared: Path) -> None:
    with open_recording(shared / "data/bag_soda_can/perception_tutorial.bag") as recording:
        cloud = from_msg.point_cloud(next(recording.records()).message)
    assert cloud.organised and cloud.xyz.shape == (480, 640, 3) and cloud.rgb is not None
    assert np.isfinite(cloud.xyz[..., 2]).mean() > 0.5


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_rosbag2_names_the_topics_that_ros_2_jazzy_has_with_other_fields(
    plugin: StoragePlugin, tmp_path: Path
) -> None:
    with open_recording(humble_bag(tmp_path / "bag", plugin)) as recording:
        assert recording.obstacles() == recording.obstacles(shipped_only=False)
        assert list(recording.obstacles()) == ["/range"] and "variance" in recording.obstacles()["/range"]


def test_a_type_that_ros_2_does_not_ship_is_an_obstacle_only_where_that_is_asked(tmp_path: Path) -> None:
    with open_recording(robot_bag(tmp_path / "bag")) as recording:
        assert recording.obstacles() == {"/meta": "ROS 2 does not ship acme_msgs/msg/Meta"}
        assert recording.obstacles(shipped_only=False) == {}


def cut(file: Path, share: float) -> None:
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * share)])


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_rosbag2_says_what_to_do(bag: Path, share: float) -> None:
    file = next(f for f in bag.iterdir() if f.suffix in (".mcap", ".db3"))
    cut(file, share)
    with pytest.raises(ValueError, match="expected a whole bag"), open_recording(bag) as recording:
        for record in recording.records():
            assert record.message is not None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_rosbag1_says_what_to_do(rosbag1: Path, share: float) -> None:
    cut(rosbag1, share)
    with pytest.raises(ValueError, match=r"expected a whole bag.*rosbag reindex"):
        open_recording(rosbag1)


def spoil(file: Path) -> None:
    """Noise for the middle third of a file."""
    whole = file.read_bytes()
    third = len(whole) // 3
    file.write_bytes(whole[:third] + np.random.default_rng(0).bytes(third) + whole[2 * third :])


def noisy(count: int = 60) -> list[Record]:
    """Pictures that compress, but not to nothing."""
    pixels = np.random.default_rng(0).integers(0, 16, (count, 48, 64, 3)).astype(np.uint8)
    return [Record.of("/image", messages.image(rgb, "rgb8", i, "camera"), i) for i, rgb in enumerate(pixels)]


def read_all(bag: Path) -> None:
    with open_recording(bag) as recording:
        for record in recording.records():
            assert record.message is not None


@pytest.mark.parametrize(
    ("plugin", "mode"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
    ],
)
def test_a_rosbag2_with_damaged_bytes_says_what_to_do(
    plugin: StoragePlugin, mode: CompressionMode, tmp_path: Path
) -> None:
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/image", "sensor_msgs/msg/Image", typestore=standard_types())
        for record in noisy():
            writer.write(connection, record.stamp_ns, record.cdr)
    spoil(next(file for file in (tmp_path / "bag").iterdir() if file.suffix != ".yaml"))
    with pytest.raises(ValueError, match="expected a whole bag"):
        read_all(tmp_path / "bag")


@pytest.mark.parametrize("compression", ["LZ4", "BZ2"])
def test_a_rosbag1_with_damaged_bytes_says_what_to_do(compression: str, tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/String"
    writer = Rosbag1Writer(tmp_path / "one.bag")
    writer.set_compression(Rosbag1Writer.CompressionFormat[compression])
    with writer:
        connection = writer.add_connection("/noise", kind, typestore=types)
        for i in range(20):
            noise = np.random.default_rng(i).bytes(3000).hex()
            writer.write(connection, i, types.serialize_ros1(types.types[kind](data=noise), kind))
    spoil(tmp_path / "one.bag")
    with pytest.raises(ValueError, match=r"expected a whole bag.*rosbag reindex"):
        read_all(tmp_path / "one.bag")


def test_a_bug_is_not_called_a_broken_bag(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_recording(bag) as recording:
        record = next(recording.records())
        monkeypatch.setattr(AnyReader, "deserialize", lambda *_: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            _ = record.message


def test_a_bag_whose_file_was_moved_away_is_refused(bag: Path) -> None:
    next(f for f in bag.iterdir() if f.suffix in (".mcap", ".db3")).unlink()
    with pytest.raises(ValueError, match="missing"):
        open_recording(bag)


def test_a_folder_that_lost_its_metadata_is_still_read(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    with open_recording(bag) as recording:
        assert recording.topics["/image"].count == 3


def test_text_that_is_called_a_bag_is_refused(tmp_path: Path) -> None:
    for suffix in (".bag", ".mcap", ".db3"):
        (tmp_path / f"x{suffix}").write_text("hello " * 100)
        with pytest.raises(ValueError, match="expected a whole bag"):
            open_recording(tmp_path / f"x{suffix}")


def test_a_topic_of_two_types_is_that_of_the_more_messages_and_the_others_are_counted(tmp_path: Path) -> None:
    types = standard_types()
    text, number = (types.types[f"std_msgs/msg/{name}"] for name in ("String", "Int8"))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for made in (number(data=1), text(data="a"), text(data="b")):
            kind = made.__msgtype__
            known = [c for c in writer.connections if c.msgtype == kind]
            connection = known[0] if known else writer.add_connection("/x", kind, typestore=types)
            writer.write(connection, 5, types.serialize_cdr(made, kind))
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/x"].msgtype == "std_msgs/msg/String" and recording.topics["/x"].count == 2
        assert [record.message.data for record in recording.records()] == ["a", "b"]
        (note,) = recording.notes
    assert note == "/x is std_msgs/msg/String and also std_msgs/msg/Int8: its 1 messages of that type are left out"


def test_a_rosbag1_without_messages_begins_and_lasts_nowhere(tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    with Rosbag1Writer(tmp_path / "one.bag") as writer:
        writer.add_connection("/x", "std_msgs/msg/String", typestore=types)
    with open_recording(tmp_path / "one.bag") as recording:
        assert (recording.start_ns, recording.end_ns, recording.topics["/x"].count) == (0, 0, 0)


def test_a_bag_that_may_not_be_read_is_not_called_broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_rosbag2(tmp_path / "bag", records())
    (file,) = (tmp_path / "bag").glob("*.mcap")
    whole = Path.open

    def refuse(path: Path, *arguments: object, **more: object) -> object:
        if path.suffix == ".mcap":
            raise PermissionError(13, "Permission denied", str(path))
        return whole(path, *arguments, **more)  # type: ignore[call-overload]

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(PermissionError, match=r"expected permission to read it, got: Permission denied"):
        open_recording(file)


def test_an_empty_bag_has_no_topics(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", [], "mcap")
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics == {} and recording.seconds == 0 and list(recording.records()) == []
    shutil.rmtree(tmp_path / "bag")


@pytest.mark.parametrize(("at", "value"), [(13, 0x40), (16, 0x40), (16, 0xFF)])
def test_a_size_that_no_memory_holds_is_a_broken_bag(at: int, value: int, tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    (file,) = (tmp_path / "bag").glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[at] = value
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"expected a whole bag, got: .*; truncated or corrupt\? `mcap recover`"):
        open_recording(file)


def test_metadata_that_are_too_long_are_refused_unread(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_files, "METADATA_BYTES", 100)
    with pytest.raises(ValueError, match=r"metadata\.yaml: expected at most 100 bytes of metadata, got \d+"):
        open_recording(bag)


def test_times_that_no_clock_has_are_a_broken_bag(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    file, content = tmp_path / "bag/metadata.yaml", (tmp_path / "bag/metadata.yaml").read_text()
    file.write_text(content.replace("nanoseconds_since_epoch: 1000000000", f"nanoseconds_since_epoch: {10**30}"))
    with pytest.raises(ValueError, match=r"expected a whole bag, got: records from 1000.*; move metadata"):
        open_recording(tmp_path / "bag")


@pytest.mark.parametrize(
    ("definition", "got"),
    [
        ("std_msgs/Header header", "without height"),
        ("std_msgs/Header header\nstring height", "with another height"),
    ],
)
def test_messages_whose_definition_in_the_bag_lacks_what_is_read_are_broken(
    definition: str, got: str, tmp_path: Path
) -> None:
    kind, types = "sensor_msgs/msg/Image", get_typestore(Stores.EMPTY)
    parts = (f"{definition}\n{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
             f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n")  # fmt: skip
    types.register(get_types_from_msg(parts, kind))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.write(writer.add_connection("/image", kind, typestore=types), 5, b"\0\1\0\0" + bytes(40))
    with (
        open_recording(tmp_path / "bag") as recording,
        pytest.raises(ValueError, match=rf"as their type defines them, got: .* {got}; the file is whole"),
    ):
        _ = next(recording.records()).message
