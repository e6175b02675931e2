# SPDX-License-Identifier: Apache-2.0
"""The pictures of a run with its objects as a data set: files, a page to check them, and the names to change."""

from __future__ import annotations

import shutil
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from objreg_ros.data.checked import Array
from objreg_ros.whole_file import write_whole
from objreg_tools.report.labels.crops import Crops
from objreg_tools.report.labels.dataset import YOLO, Dataset, Label
from objreg_tools.report.labels.label_names import class_of, names_text
from objreg_tools.report.labels.labelled_pictures import LEAST_SHARE, labelled_pictures
from objreg_tools.report.labels.labels_page import labels_page
from objreg_tools.report.labels.mapped_objects import MappedObject
from objreg_tools.report.labels.split import TRAIN, VAL, split
from objreg_tools.report.labels.visible_part import VisiblePart
from objreg_tools.report.run.pictures import Album

LEAST_VIEWS = 2  # keyframes: what one alone saw may be a slip of detector or segmenter
PAGE, NAMES = "labels.html", "names.yaml"


@dataclass(frozen=True, slots=True)
class LabelOptions:
    """What is exported: every so many pictures, and of objects with ``names`` by landmark."""

    layout: str = YOLO
    every: int = 1
    least_share: float = LEAST_SHARE
    least_views: int = LEAST_VIEWS
    named_only: bool = False
    names: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written: pictures by part, labels by class, and the file that a trainer reads."""

    pictures: Mapping[str, int]
    labels: Mapping[str, int]
    unlabelled: int
    file: Path


def export_labels(
    folder: Path,
    name: str,
    objects: Sequence[MappedObject],
    poses: Sequence[tuple[int, Array]],
    album: Album,
    options: LabelOptions,
    on_picture: Callable[[], object] = lambda: None,
) -> Exported:
    """Write the data set of a run into ``folder``, new or empty; ``poses`` are (stamp, ``T_map_camera``) by time.

    Pictures that show no object are left out. OSError if there is anything in the folder already or it cannot be
    written: then nothing of the data set remains.
    """
    seen = [one for one in objects if len(one.views) >= options.least_views]
    classes = {one.landmark: class_of(one, options.names, options.named_only) for one in seen}
    poses = poses[:: options.every]
    parts = dict(zip((stamp for stamp, _ in poses), split([stamp for stamp, _ in poses]), strict=True))
    crops: defaultdict[int, Crops] = defaultdict(Crops)
    made = Dataset(folder, options.layout, sorted({name for name in classes.values() if name}))
    pictures: Counter[str] = Counter({TRAIN: 0, VAL: 0})
    labels: Counter[str] = Counter()
    unlabelled = 0
    with all_or_nothing(folder):
        for picture in labelled_pictures(seen, poses, album, options.least_share):
            on_picture()
            shown = [part for part in picture.parts if classes[part.object.landmark]]
            for part in picture.parts:
                crops[part.object.landmark].add(picture.stamp_ns, picture.rgb, part)
            if not shown:
                unlabelled += 1
            elif part_of := parts[picture.stamp_ns]:
                made.add(f"{name}_{picture.stamp_ns}", part_of, picture.rgb, [_label(one, classes) for one in shown])
                pictures[part_of] += 1
                labels.update(classes[one.object.landmark] for one in shown)
        file = made.finish()
        counts = {"pictures that train": pictures[TRAIN], "that validate": pictures[VAL], "labels": labels.total(),
                  "classes": len(made.classes)}  # fmt: skip
        shown_once = [one for one in seen if one.landmark in crops]
        write_whole(folder / PAGE, labels_page(name, shown_once, classes, crops, counts))
        write_whole(folder / NAMES, names_text(shown_once, options.names))
    return Exported(pictures, labels, unlabelled, file)


def _label(part: VisiblePart, classes: Mapping[int, str]) -> Label:
    x_min, y_min, x_max, y_max = part.xyxy
    x, y = part.corner
    mask = part.mask[y_min - y : y_max - y, x_min - x : x_max - x]
    return Label(classes[part.object.landmark], part.object.landmark, part.xyxy, mask)


@contextmanager
def all_or_nothing(folder: Path) -> Iterator[None]:
    """A new or empty folder, which is so again where the block does not come to its end. OSError for any other."""
    if folder.is_dir() and any(folder.iterdir()):
        raise FileExistsError(
            f"{folder}: expected a new or empty folder, got one that holds something; choose another or empty it"
        )
    was_there = folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for path in folder.iterdir():
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        if not was_there:
            folder.rmdir()
        raise
