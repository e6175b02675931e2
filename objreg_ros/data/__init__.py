# SPDX-License-Identifier: Apache-2.0
"""The data types that pass between the stages.

images     a camera, its pictures, depth and clouds, and the detections in a picture
frames     what one camera saw at one time: the clouds of objects, the view; IMU and odometry beside it
closures   two keyframes of one place: alignment, loop closure, relocalisation, and the reasons of refusals
closure_id   the id of a closure, which lasts
closure_fields   closures as plain values under the names of their fields, and back
checked    how a data type checks its fields

Every type but `Rejected` checks shape and dtype of its arrays when it is made and raises ValueError with what it
expected and what it got; the arrays are read-only. Points are float32 metres in the camera's optical frame (x right,
y down, z forward), poses float64, time integer nanoseconds, angles radians. A pose ``T_a_b`` maps points of b into a.
A failure is None, a `Rejected` or an exception. It is never a pose.
"""
