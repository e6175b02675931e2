# SPDX-License-Identifier: Apache-2.0
"""What a check answers that refuses a pose."""

from __future__ import annotations

from objreg_ros.data.closures import Reason

Refusal = tuple[Reason, str]
"""The reason, and the numbers behind it: got and expected."""
