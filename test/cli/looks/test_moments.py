# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest
from recording.sample_folders import tum_folder

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_tools.cli.looks.moments import KeepsFrames, first_stamp_ns, frame_at, keyframe_of, records_about, stamp_of
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings
from objreg_tools.offline.stages import Stages
from objreg_tools.rehearsal import SeesNothing

START_NS = 5_000_000_000


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [("12.3", START_NS + 12_300_000_000), ("7", START_NS + 7_000_000_000), ("1700000000000000001", 1700000000000000001),
     ("33000000ns", 33_000_000)],
)  # fmt: skip
def test_a_time_is_seconds_since_the_beginning_or_a_stamp(text: str, stamp_ns: int) -> None:
    assert stamp_of(text, START_NS) == stamp_ns


@pytest.mark.parametrize("text", ["soon", "", "ns", "1e400", "nan"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"expected seconds since the beginning as 12\.3, or a stamp in ns"):
        stamp_of(text, START_NS)


def test_only_the_frames_about_the_times_go_through(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum", frames=60)  # ten a second
    with RecordedOptions(read_settings(None, ())).opened(folder) as opened:
        kept, stamps_ns = KeepsFrames(), (5_900_000_000, 100_000_000)
        stages = Stages(SeesNothing(), Segmenter(SegmenterParams()), kept)
        opened.run_through(records_about(opened, stamps_ns), stages, lambda count: None)
        assert first_stamp_ns(opened) == 0
    seconds = [frame.stamp_ns * 1e-9 for frame in kept.frames]
    assert seconds == sorted(seconds) and not [s for s in seconds if 1.7 < s < 4.3] and len(seconds) > 25
    frame = frame_at(kept.frames, 5_830_000_000, 0)
    assert frame.stamp_ns == 5_800_000_000
    for is_fused in (False, True):
        assert keyframe_of(frame, kept.frames, RegistrarParams(), is_fused).stamp_ns == frame.stamp_ns
    with pytest.raises(ValueError, match=r"expected a frame within 1\.5 s of 19\.800 s after the first"):
        frame_at(kept.frames, 20_000_000_000, 200_000_000)
