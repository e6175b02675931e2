# SPDX-License-Identifier: Apache-2.0
"""The process around the nodes: signals, the DDS profile, shared memory, and the bus inside a process."""
