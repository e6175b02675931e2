# SPDX-License-Identifier: Apache-2.0
"""What a command looks at of a recording beside a run of it."""
