# SPDX-License-Identifier: Apache-2.0
"""Stage 3: Frames in, LoopClosures out, and a reason for every closure that was refused.

`registrar` is the facade over `objreg_ros.keyframes`, `objreg_ros.memory` and `objreg_ros.registration`: `track` for
every frame, `search` for every keyframe, `process` for both, with an `outcome` each. A `candidate_search` tries stored
keyframes; what a registered pair comes to is a `closure` or a refusal, or waits for its `confirmation` by others whose
`consistency` with it odometry measures; of places that fit alike `rivalry` says which it is. What is stored, and what
is known of it in memory, is the `recollection`.
`relocalisation` says where the camera is in the map of an earlier session, the folder localisation/ whether it is lost,
`known_objects` where a chair is. Each camera of each robot has a `camera_track`; `origins` numbers the keyframes that
were made elsewhere; `thinning` leaves out what would be said twice; `vetoes` are what a person withdrew. An `exchange`
sends the registrars of other robots a `summary` of each keyframe, and fetches what looks alike. `params` has the
parameters, `diagnostics` what the node reports, `node` is the node.
"""
