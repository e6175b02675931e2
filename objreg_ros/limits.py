# SPDX-License-Identifier: Apache-2.0
"""The largest values that a message, a file or a data type may hold. No robot comes near them.

What is read is held against these before memory is taken for it, so whoever sends more is refused and nothing ends.
"""

from __future__ import annotations

NANOSECONDS = 1_000_000_000  # in a second
LEAST_STAMP_NS = -(2**31) * NANOSECONDS  # builtin_interfaces/Time has seconds of 32 bits
MOST_STAMP_NS = 2**31 * NANOSECONDS - 1

MOST_NAME = 1000  # characters of a frame or of a label
MOST_CLASS_ID = 65533  # class ids have 16 bits; the last two are the support surface's and the unnamed objects'
MOST_LABELS_TEXT = 4_000_000  # characters of the table of labels
MOST_RECORD = 65536  # bytes of one point of a cloud
MOST_FIELDS = 200  # of one point of a cloud
MOST_DETECTIONS = 1000  # boxes of one image
MOST_OBJECTS = 500  # objects of one frame
MOST_EVIDENCE = 1000  # named numbers of one closure
MOST_DETAIL = 10_000  # characters of why something was refused

MOST_SIDE = 65535  # pixels of a picture: a table of detections has 16 bits for it
MOST_PIXELS_OF_PICTURE = 50_000_000  # unless a parameter says otherwise
MOST_PIXELS = 500_000_000  # of a camera, whatever the parameter says
MOST_VIEW_PIXELS = 600_000  # of a reduced view, which has some 20 000
OWN_VIEW_PIXELS = 160_000  # to which a larger view is brought: that of a Full HD camera has 130 000
MOST_OBJECT_POINTS = 1_000_000  # of the objects of one frame, which have some 50 000
MOST_PACKED_KEYFRAME = 1_000_000  # bytes of a keyframe that is sent, which has some 70 000
MOST_UNPACKED_KEYFRAME = 4_000_000  # bytes that it unpacks to: about one for each of its numbers
MOST_SUMMARY = 100_000  # bytes of a keyframe's summary for other robots, which has some 1000
MOST_UNPACKED_SUMMARY = 400_000  # bytes that it unpacks to

LEAST_FOCAL_LENGTH, MOST_FOCAL_LENGTH = 1e-3, 1e6  # px: beyond them rays do not fit into float32
LEAST_RANGE = 1e-3  # m along the optical axis: what is nearer has no place in the picture
MOST_RANGE = 1000.0  # m from a camera: float32 still resolves a tenth of a millimetre there
MOST_DEPTH = 1e5  # m of a depth image: millimetres labelled as metres must pass, so that they can be reported
MOST_NORMAL = 2.0  # of a part of a normal, whose length is about 1
MOST_DENSITY = 1e12  # points per square metre
MOST_DISTANCE = 1e8  # m from the origin of a pose: the earth is smaller
