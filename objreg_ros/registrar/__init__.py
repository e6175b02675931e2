# SPDX-License-Identifier: Apache-2.0
"""Room 3: Frames in, LoopClosures out, and a reason for every closure that was refused."""
