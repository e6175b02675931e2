# SPDX-License-Identifier: Apache-2.0
"""How well a pose is known.

`covariance` of what is published; `sandwich` (cluster-robust) covariance of surfaces whose depth errs together;
`degeneracy` of what the surfaces leave open; `observability` of a doubtful position by `perturbation` of the pose;
`gravity_update` of its tilt.
"""
