# SPDX-License-Identifier: Apache-2.0
"""Whether the camera is where odometry says, or lost: pure functions of keyframes, closures and stamps.

`belief` weighs it as odds, `expectation` compares known objects with what a view shows in their places, `memory` knows
since when an object is known, `contradiction` compares a closure with the tie to its session, `verdict` makes one of
the states of all that, and `localisation` follows a camera with them.
"""
