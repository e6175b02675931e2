# SPDX-License-Identifier: Apache-2.0
"""Room 3: Frames in, LoopClosures out, and a reason for every closure that was refused.

The way of a frame, file by file:

======================  ==========================================================================================
the verb                `registrar`: `track` for every frame, `search` for every keyframe, `process` for both
frames to keyframes     `keyframes` (when one ends), `tracking` (motion without odometry), `fusion`, `odometry`,
                        `plumb` (gravity as all of them tell it)
what is remembered      `keyframe`, `sighting`, `landmarks`; in `store` through `codec`, a `store_file` under a `claim`,
                        each row with its `seal`, counted in the `books`; older ones by `renewal`; seen by `survey`,
                        `export`
which to try            `retrieve`, by `likest` objects: `descriptor` and `labels`
poses from chains       `engine` finishes the `shortlist` of the `hypotheses`, fed by `prepared`: `features` and
                        `consensus` on the context, `scene_search` (`shape`, `silhouette`, `shape_search`, `shape_hull`,
                        `shape_icp`, `shape_score`, `worth`, `scrutiny`) on objects; `alternatives` to a lone one's
refinement              `icp` brings many to their basin; `refine` ends a few, with `direct` where there is grey
                        and `contradiction` to say how well the surfaces hold the pose; `liking` compares
                        poses near each other; `levelling` ends with what gravity tells
evidence                `evidence`, of `verify`, `visibility` and `texture` (views, through `projection`),
                        `surroundings` (views without objects), `objects` (explained or moved), `symmetry`,
                        `sliding` and `pushing`
yes or no               `gate`, on a `candidate` with its evidence; then `covariance` and `thinning`
======================  ==========================================================================================

`paper` is the founding method; `warm` compiles every kernel before the first frame; `params` are what a user may
set; `node` is the door.
"""
