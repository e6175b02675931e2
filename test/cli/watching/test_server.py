# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import re
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from objreg_tools.cli.watching.local_pages import HERE
from objreg_tools.cli.watching.server import served
from objreg_tools.cli.watching.watched import Watched

from .test_local_pages import answer
from .test_watched import picture


@pytest.fixture
def watched() -> Watched:
    return Watched()


@pytest.fixture
def port(watched: Watched) -> Iterator[int]:
    with served(watched, 0) as address:
        found = urlsplit(address)
        assert found.hostname == HERE == "127.0.0.1"
        yield found.port or 0


def test_the_page_loads_nothing_from_elsewhere_and_may_not(port: int) -> None:
    response = answer(port, "/")
    text = response.read().decode()
    assert response.status == 200 and not re.search(r"(?:src|href)=|url\(", text.replace('find("sight").src =', ""))
    assert "default-src 'none'" in response.headers["Content-Security-Policy"]


def test_the_state_and_the_picture_are_what_is_watched(port: int, watched: Watched) -> None:
    assert answer(port, "/picture.jpg").status == 404
    watched.see(picture(7))
    assert json.load(answer(port, "/state.json"))["picture"] == "7"
    response = answer(port, "/picture.jpg?7")
    assert response.headers["Content-Type"] == "image/jpeg" and response.read()[:2] == b"\xff\xd8"


@pytest.mark.parametrize(("path", "method"), [("/../../etc/passwd", "GET"), ("/nothing", "GET"), ("/", "POST")])
def test_there_is_nothing_else(port: int, path: str, method: str) -> None:
    assert answer(port, path, method).status in (404, 501)
