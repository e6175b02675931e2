# SPDX-License-Identifier: Apache-2.0
"""Photometric agreement: the correlation of the high-passed grey of both views. It is None without grey."""

from __future__ import annotations

from objreg_ros.data import Reason
from objreg_ros.registration.gate.refusal import Refusal

CORRELATED = 0.3  # least correlation of a print that lies upon itself
PLAIN = 0.0  # correlation of a plain table, which has no print; another print in its place correlates less


def check(correlation: float | None, few: bool, least: float) -> Refusal | None:
    """Refuse a pose whose grey correlates by less than ``least``.

    Where the matched objects are not ``few``, `PLAIN` is enough: they stand where they should.
    """
    asked = least if few else min(PLAIN, least)
    if correlation is None or correlation >= asked:
        return None
    return Reason.TEXTURE, f"correlation {correlation:.2f} < {asked:.2f}"


def check_loss(rest: float | None, whole: float | None, most: float) -> Refusal | None:
    """Refuse a pose whose correlation falls by more than ``most`` from the ``whole`` views to a ``rest`` of them."""
    if rest is None or whole is None or whole - rest <= most:
        return None
    return Reason.TEXTURE, f"correlation {rest:.2f} < {whole:.2f} by more than {most:.2f}"
