# SPDX-License-Identifier: Apache-2.0
"""The objects of a run as labels of its pictures: a data set on which a detector is trained."""
