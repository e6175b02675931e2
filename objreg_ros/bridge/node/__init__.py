# SPDX-License-Identifier: Apache-2.0
"""What every node has: parameters, life cycle, logs, the accounting of frames, and the bus inside a process."""
