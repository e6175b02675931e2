# SPDX-License-Identifier: Apache-2.0
"""The surface of one object out of its box, and objects that no box shows."""
