# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import http.client
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from objreg_tools.cli.watching.local_pages import HERE, Answer, served


def pages(path: str, accept: str) -> Answer | None:
    return Answer(accept.encode(), "text/plain") if path == "/metrics" else None


@pytest.fixture
def port() -> Iterator[int]:
    with served(pages, 0) as address:
        found = urlsplit(address)
        assert found.hostname == HERE == "127.0.0.1"
        yield found.port or 0


def answer(port: int, path: str, method: str = "GET", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(HERE, port, timeout=60)
    connection.request(method, path, headers=headers)
    return connection.getresponse()


def test_a_page_is_given_what_is_accepted_and_goes_by_its_kind(port: int) -> None:
    response = answer(port, "/metrics?x=1", Accept="text/plain")
    assert response.read() == b"text/plain" and response.headers["Content-Type"] == "text/plain"
    assert response.headers["X-Content-Type-Options"] == "nosniff"


def test_a_page_elsewhere_whose_name_leads_here_gets_nothing(port: int) -> None:
    for name in ("evil.example", f"evil.example:{port}", "", f"{HERE}:1"):
        assert answer(port, "/metrics", Host=name).status == 403
    assert answer(port, "/metrics", Host=f"localhost:{port}").status == 200


@pytest.mark.parametrize(("path", "method", "status"), [("/x", "GET", 404), ("/metrics", "POST", 501)])
def test_there_is_nothing_else(port: int, path: str, method: str, status: int) -> None:
    assert answer(port, path, method).status == status
    assert answer(port, "/favicon.ico").status == 204


def test_a_port_that_is_taken_is_refused_with_what_to_give(port: int) -> None:
    wanted = f"--port: expected a port of {HERE} that is free, got {port}"
    with pytest.raises(ValueError, match=wanted), served(pages, port):
        pass
