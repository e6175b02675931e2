# SPDX-License-Identifier: Apache-2.0
"""
    from objreg_ros import Camera, register           # two RGB-D pictures; no ROS, no store

    result = register(rgb_1, depth_1, rgb_2, depth_2, Camera(fx, fy, cx, cy))
    if result.accepted:
        print(result.T_1_2, result.covariance)        # p_1 = T_1_2 @ p_2, metres; (6, 6) in the order of ROS
    else:
        print(result.reason, result.detail, result.evidence)

Object-level loop closure for ROS 2. ``rgb (H, W, 3) uint8`` and, registered to it, ``depth (H, W)`` in float metres or
uint16 millimetres. `register_clouds` takes two coloured clouds, `register_keyframes` two lists of frames, which
`segment` makes; `objreg_ros.registrar.registrar.Registrar` takes in a stream of them and remembers. Own detections, and
a detector, a gate and a method of one's own: `help(objreg_ros.register)` and `objreg_ros.registration.api`.

Three stages, each of which takes what the one before it returns:

    detector/    colour image                -> Detections     (an ONNX model)
    segmenter/   Detections + depth image    -> Frame          (the object and nothing but the object)
    registrar/   Frames                      -> LoopClosures   (propose with objects, decide with context)

Each is a ROS node; `keyframer` and `mapper` are nodes too. `data` holds the types that pass between the stages,
`bridge` converts them to ROS messages and back, and `offline` runs the stages without ROS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from objreg_ros.library import Camera, Registration, register, register_clouds, register_keyframes, segment

__all__ = ["Camera", "Registration", "register", "register_clouds", "register_keyframes", "segment"]


def __getattr__(name: str) -> Any:
    """The public names, loaded when the first of them is asked for: a message needs none of what they load."""
    if name not in __all__:
        raise AttributeError(f"module 'objreg_ros' has no attribute {name!r}")
    from objreg_ros.terminal import progress

    with progress("loading the library"):
        from objreg_ros import library

    return getattr(library, name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
