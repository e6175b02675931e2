# SPDX-License-Identifier: Apache-2.0
"""Records the golden results anew, or checks that the code still gives them to the last digit.

    python test/golden/record.py                     what changed is printed, and the files are written
    python test/golden/record.py --check loop moved  nothing is written; exit 1 where a digit differs
    python test/golden/record.py --detect            the models look again, too

The numbers are those of one machine: check on the one that recorded. Elsewhere test/test_golden.py compares with
tolerances.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from tqdm import tqdm

TEST = Path(__file__).resolve().parents[1]
if __name__ == "__main__":
    sys.path[:0] = [str(TEST.parent), str(TEST)]

from golden import files, runs  # noqa: E402
from golden.comparison import differences  # noqa: E402

from objreg_ros import share  # noqa: E402
from objreg_ros.detector.detector import Detector  # noqa: E402
from objreg_ros.detector.params import DetectorParams  # noqa: E402
from objreg_tools.cli.looks.moments import Remembering  # noqa: E402

SHARED = Path(os.environ.get("OBJREG_SHARED", TEST.parents[1] / "shared"))
COCO, COCO_THRESHOLD = "models/ssd_mobilenet_v1_coco_int8.onnx", 0.4
MOST_LINES = 20  # of what changed in a recording


def main(arguments: Sequence[str] | None = None) -> int:
    """Record or check the recordings that are asked for; 1 where ``--check`` finds a difference, else 0."""
    asked = _parser().parse_args(arguments)
    changed = False
    for name in asked.names or runs.SOURCES:
        source = runs.SOURCES[name]
        if isinstance(source, runs.Real) and not (asked.shared / "data").is_dir():
            print(f"{name}: left out, no recordings at {asked.shared}")
            continue
        changed |= _renew(name, source, asked)
    return int(changed and asked.check)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", type=_known, metavar="NAME", help=f"of {', '.join(runs.SOURCES)}; else all")
    parser.add_argument("--check", action="store_true", help="compare to the last digit and write nothing")
    parser.add_argument("--detect", action="store_true", help="let the models look again, not the stored detections")
    parser.add_argument("--shared", type=Path, default=SHARED, help="the folder that holds data/ and models/")
    return parser


def _known(name: str) -> str:
    if name not in runs.SOURCES:
        raise argparse.ArgumentTypeError(f"expected one of {', '.join(runs.SOURCES)}, got {name!r}")
    return name


def _renew(name: str, source: runs.Source, asked: argparse.Namespace) -> bool:
    """Run one recording, say what changed, and write it unless it is only checked; whether anything changed."""
    before = files.read(name) if files.path_of(name).exists() else None
    now = _recorded(name, source, before, asked)
    if before is None:
        found = ["nothing was recorded before"]
    else:
        found = differences(before.results, now.results, exact=True)
        found += [] if files.text_of(before) == files.text_of(now) else ["the detections or the file's text changed"]
    counts = {kind: len(now.results[kind]) for kind in ("constraints", "refusals")}
    print(f"{name}: {counts['constraints']} constraints, {counts['refusals']} refusals, {len(found)} differences")
    for line in found[:MOST_LINES]:
        print(f"  {line}")
    if len(found) > MOST_LINES:
        print(f"  and {len(found) - MOST_LINES} more")
    if not asked.check:
        files.path_of(name).write_text(files.text_of(now), encoding="utf-8")
    return bool(found)


def _recorded(name: str, source: runs.Source, before: files.Golden | None, asked: argparse.Namespace) -> files.Golden:
    """What the recording gives now, with the detections that were stored unless the models are to look again."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        bar = stack.enter_context(tqdm(total=source.frames, unit="frame", desc=name, disable=None, leave=False))
        if isinstance(source, runs.Real):
            path = asked.shared / "data" / source.folder
        else:
            path = runs.simulated(source, folder / name)
        fresh = before is None or asked.detect
        detector = Remembering(_model(source, asked.shared) if fresh else runs.Stored(before.detections))
        run = runs.run(path, detector, source.frames, lambda done: bar.update(done - bar.n))
        return files.Golden(detector.seen, runs.results(run))


def _model(source: runs.Source, shared: Path) -> Detector:
    """The model that saw the recording: the COCO model where it is real, the embedded one where it is simulated."""
    if isinstance(source, runs.Real):
        return Detector(DetectorParams(threshold=COCO_THRESHOLD), shared / COCO)
    return Detector.of(DetectorParams(model=share.EMBEDDED), share.model)


if __name__ == "__main__":
    sys.exit(main())
