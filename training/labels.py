# SPDX-License-Identifier: Apache-2.0
"""The names of the model's classes, in the order of its outputs: the simulator's nine families."""

from objreg_tools.simulation.world.objects import LABELS

__all__ = ["LABELS"]
