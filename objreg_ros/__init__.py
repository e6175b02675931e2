# SPDX-License-Identifier: Apache-2.0
"""Object-level loop closure for ROS 2. Three rooms in a row, one door between each:

detector/    colour image                -> Detections     (MobileNet-SSD, ONNX Runtime)
segmenter/   Detections + depth image    -> Frame          (the object and nothing but the object)
registrar/   Frames                      -> LoopClosures   (propose with objects, decide with context)
data.py holds the words that pass between them; bridge/ is the border to ROS; offline.py drives them without it.
"""
