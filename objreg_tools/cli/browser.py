# SPDX-License-Identifier: Apache-2.0
"""The user's browser, where somebody sits before it."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Mapping
from pathlib import Path

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")  # any of them: a browser of the terminal itself is not wanted
ALWAYS = ("darwin", "win32")


def open_page(page: Path, environment: Mapping[str, str] = os.environ) -> bool:
    """Show a page in a browser; False where the output is no terminal, or no display or browser is there."""
    has_display = sys.platform in ALWAYS or any(environment.get(name) for name in DISPLAYS)
    if not (sys.stdout.isatty() and has_display):
        return False
    try:
        return webbrowser.open(page.resolve().as_uri())
    except webbrowser.Error:
        return False
