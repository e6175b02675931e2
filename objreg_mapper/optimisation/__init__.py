# SPDX-License-Identifier: Apache-2.0
"""From constraints and odometry to poses: which constraints are believed, and the solver."""
