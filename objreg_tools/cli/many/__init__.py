# SPDX-License-Identifier: Apache-2.0
"""Many recordings, and many settings of their parameters, over workers."""
