# SPDX-License-Identifier: Apache-2.0
"""Room 3: Frames in, LoopClosures out, and a reason for every closure that was refused.

`registrar` is the facade over `objreg_ros.keyframes`, `objreg_ros.memory` and `objreg_ros.registration`: `track` for
every frame, `search` for every keyframe, `process` for both, with an `outcome` each. A `candidate_search` tries stored
keyframes; what a registered pair comes to is a `closure` or a refusal, or waits for its `confirmation` by others whose
`consistency` with it odometry tells. `relocalisation` says where the camera is in the map of an earlier session. Each
camera of each robot has a `camera_track`; `origins` numbers the keyframes that were made elsewhere; `thinning` leaves
out what would be said twice; a `recollection` keeps store, index and landmarks in step. Registrars of several robots
`exchange` keyframes by a `summary` of each. `warm` compiles every kernel before the first frame comes; `node` is the
door.
"""
