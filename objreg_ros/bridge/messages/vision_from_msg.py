# SPDX-License-Identifier: Apache-2.0
"""What other detectors say, as `Detections`: boxes as vision_msgs, and pictures of masks.

Reads attributes only, so messages of whatever library fit. A message that breaks its contract raises ValueError with
what was expected and what came.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_ros.bridge.messages.pictures import instance_numbers
from objreg_ros.data.frames import UNNAMED
from objreg_ros.data.images import Detections

Array = NDArray[Any]


def label_info(message: Any) -> dict[int, str]:
    """The names of the numbers of a vision_msgs/LabelInfo."""
    if len(message.class_map) > limits.MOST_CLASS_ID:
        raise ValueError(f"label_info: expected at most {limits.MOST_CLASS_ID} classes, got {len(message.class_map)}")
    return {int(one.class_id): from_msg.checked_label(one.class_name) for one in message.class_map}


def detections(
    message: Any,
    names: Mapping[int, str],
    image_hw: tuple[int, int],
    most_pixels: int = limits.MOST_PIXELS_OF_PICTURE,
) -> Detections:
    """What another detector found in a picture: its boxes, or an Image of masks, which has a size of its own."""
    if not hasattr(message, "encoding"):
        return boxes(message, names, image_hw)
    return instances(instance_numbers(message, most_pixels), names, **headers.when_and_where(message))


def picture_hw(image: Any, camera_info: Any) -> tuple[int, int] | None:
    """Height and width of the picture that boxes are in, raw or decoded, else of its camera; None where neither is.

    A compressed picture counts as none.
    """
    if hasattr(image, "rgb"):
        return image.rgb.shape[:2]
    if hasattr(image, "encoding"):
        return int(image.height), int(image.width)
    if camera_info is None:
        return None
    camera = camera_from_msg.intrinsics(camera_info)
    return camera.height, camera.width


def boxes(message: Any, names: Mapping[int, str], image_hw: tuple[int, int]) -> Detections:
    """A vision_msgs/Detection2DArray of a picture of height and width ``image_hw``, best first, clipped to it.

    The hypothesis with the best score counts. Its class is a name, or a number that ``names`` may have a name for; what
    has no class is called `UNNAMED`. Of a box that is turned the upright one around it is taken.
    """
    if len(message.detections) > limits.MOST_DETECTIONS:
        raise ValueError(f"detections: expected at most {limits.MOST_DETECTIONS} boxes, got {len(message.detections)}")
    height, width = image_hw
    found = sorted((_box(one, names) for one in message.detections), key=lambda one: -one[1])
    xyxy = np.array([box for box, *_ in found], np.float64).reshape(-1, 4)
    return Detections(
        xyxy=np.clip(xyxy, 0.0, [width, height, width, height]).astype(np.float32),
        score=np.array([score for _, score, *_ in found], np.float32),
        label=tuple(label for _, _, label, _ in found),
        ids=tuple(name for *_, name in found),
        image_hw=image_hw,
        **headers.when_and_where(message),
    )


Box = tuple[tuple[float, float, float, float], float, str, str]  # xyxy px, score, label, id


def _box(detection: Any, names: Mapping[int, str]) -> Box:
    score, label = _best(detection.results, names)
    return _xyxy(detection.bbox), score, label, from_msg.checked_label(getattr(detection, "id", ""))


def _best(results: Any, names: Mapping[int, str]) -> tuple[float, str]:
    """The score and the label of the hypothesis with the best score; nothing is known of a box without any."""
    if not results:
        return 0.0, UNNAMED
    hypotheses = (getattr(result, "hypothesis", result) for result in results)  # vision_msgs before 3 had it in one
    best = max(hypotheses, key=lambda hypothesis: hypothesis.score)
    score = float(best.score)
    if not 0.0 <= score <= 1.0:
        raise ValueError(f"detections: expected scores of 0 to 1, got {score}")
    class_id = best.class_id if hasattr(best, "class_id") else str(best.id)
    return score, _named(from_msg.checked_label(class_id), names)


def _named(class_id: str, names: Mapping[int, str]) -> str:
    number = int(class_id) if class_id.isdecimal() and len(class_id) <= len(str(limits.MOST_CLASS_ID)) else -1
    return names.get(number, class_id or UNNAMED)


def _xyxy(bbox: Any) -> tuple[float, float, float, float]:
    middle = getattr(bbox.center, "position", bbox.center)  # vision_msgs before 4 had a plain Pose2D
    numbers = x, y, theta, size_x, size_y = middle.x, middle.y, bbox.center.theta, bbox.size_x, bbox.size_y
    if not all(map(math.isfinite, numbers)) or min(size_x, size_y) < 0:
        raise ValueError(f"detections: expected a finite box with a size not below 0, got x y theta w h {numbers}")
    cosine, sine = abs(math.cos(theta)), abs(math.sin(theta))
    w, h = (size_x * cosine + size_y * sine) / 2, (size_x * sine + size_y * cosine) / 2
    return x - w, y - h, x + w, y + h


def instances(numbers: Array, names: Mapping[int, str], stamp_ns: int, frame_id: str) -> Detections:
    """The box and the mask of every instance in ``numbers (H, W) uint16``, 0 for none.

    An instance without a name is `UNNAMED`: its number gives no class. A mask has no score of its own, so 1 is taken.
    """
    from scipy.ndimage import find_objects  # 28 MB, that a node without masks is spared

    places = {number: place for number, place in enumerate(find_objects(numbers), start=1) if place is not None}
    if len(places) > limits.MOST_DETECTIONS:
        raise ValueError(f"masks: expected at most {limits.MOST_DETECTIONS} instances, got {len(places)}")
    corners = [(x.start, y.start, x.stop, y.stop) for y, x in places.values()]
    place_of = np.zeros(max(places, default=0) + 1, np.uint16)
    place_of[list(places)] = np.arange(1, len(places) + 1)
    return Detections(
        xyxy=np.array(corners, np.float32).reshape(-1, 4),
        score=np.ones(len(places), np.float32),
        label=tuple(names.get(number, UNNAMED) for number in places),
        ids=tuple(map(str, places)),
        image_hw=numbers.shape,
        stamp_ns=stamp_ns,
        frame_id=frame_id,
        instances=place_of[numbers],
    )
