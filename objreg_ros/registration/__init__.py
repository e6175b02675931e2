# SPDX-License-Identifier: Apache-2.0
"""Two keyframes in, poses with their evidence out, and a verdict. No store, no ROS.

The folders are the steps of one pair, and each imports only those before it (`test/test_layers.py`):

kernels     where points land and which is the closest: compiled loops that all others begin with
shapes      one object upon another: silhouettes and their score, symmetry, the upright search
prepare     what is computed once a keyframe
score       how well a pose fits: free space, photometric, object matches, surroundings
align       refinement of many poses and of one: point to plane, then grey
certainty   how well a pose is known: covariance, degenerate directions, perturbations, gravity
propose     hypotheses, the shortlist of them, their end and their evidence, competing ones
gate        the only place that says yes

`keyframe` and `candidate` are what goes in and comes out, `labels` are the names that a detector confuses, `params`
what a user may set. `engine` calls the steps in order; `paper` is the founding method.
"""
