# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import http.client
import json
import re
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from objreg_tools.cli.watching.local_pages import HERE
from objreg_tools.cli.watching.server import served
from objreg_tools.cli.watching.watched import Watched

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


def answer(port: int, path: str, method: str = "GET", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(HERE, port, timeout=20)
    connection.request(method, path, headers=headers)
    return connection.getresponse()


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


def test_a_page_elsewhere_whose_name_leads_here_gets_nothing(port: int) -> None:
    for name in ("evil.example", f"evil.example:{port}", "", f"{HERE}:1"):
        assert answer(port, "/state.json", Host=name).status == 403
    assert answer(port, "/state.json", Host=f"localhost:{port}").status == 200


@pytest.mark.parametrize(("path", "method"), [("/../../etc/passwd", "GET"), ("/nothing", "GET"), ("/", "POST")])
def test_there_is_nothing_else(port: int, path: str, method: str) -> None:
    assert answer(port, path, method).status in (404, 501)


def test_a_port_that_is_taken_is_refused_with_what_to_give(port: int, watched: Watched) -> None:
    wanted = f"--port: expected a port of {HERE} that is free, got {port}"
    with pytest.raises(ValueError, match=wanted), served(watched, port):
        pass
