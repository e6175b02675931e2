# SPDX-License-Identifier: Apache-2.0
"""Where a pose comes from, and the evidence for and against it.

`hypotheses` by independent proposers: the middles of objects, `object_poses` of their shapes with a `fine_search`,
local features, `keypoint_poses` of the views' grey, the `prior` of odometry; `pose_voting` finds those that agree. The
`shortlist` of them goes to `refinement` and gets its `evidence`; `competing_hypotheses` are what else a lone object's
pose could be.
"""
