# SPDX-License-Identifier: Apache-2.0
"""The page of `objreg watch`, for this machine only."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager

from objreg_tools.cli.watching import local_pages
from objreg_tools.cli.watching.local_pages import Answer
from objreg_tools.cli.watching.watched import Watched
from objreg_tools.report.page import environment


def served(watched: Watched, port: int) -> AbstractContextManager[str]:
    """The address of the page, which is there within the block. ``port`` 0 is any; ValueError where it is taken."""
    page = environment().get_template("watch.html.j2").render().encode()

    def pages(path: str, _accept: str) -> Answer | None:
        """The page, what there is to know as JSON, or the last picture."""
        if path == "/":
            return Answer(page, "text/html; charset=utf-8")
        if path == "/state.json":
            return Answer(json.dumps(watched.as_json()).encode(), "application/json")
        if path == "/picture.jpg" and (picture := watched.picture()) is not None:
            return Answer(picture, "image/jpeg")
        return None

    return local_pages.served(pages, port)
