# SPDX-License-Identifier: Apache-2.0
"""Pages for this machine only: it answers to a browser or a scraper here, and to no name of another host."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple
from urllib.parse import urlsplit

HERE = "127.0.0.1"
PATIENCE_S = 10.0  # for a request that does not come to its end
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src 'self'; connect-src 'self'"


class Answer(NamedTuple):
    """What a page is, and the Content-Type that it goes by."""

    body: bytes
    kind: str


Pages = Callable[[str, str], Answer | None]  # the path, and the request's Accept; None: there is no such page


@contextmanager
def served(pages: Pages, port: int) -> Iterator[str]:
    """The address of the pages, which are there within the block. ``port`` 0 is any; ValueError where it is taken."""
    try:
        server = _Server(pages, port)
    except OSError as error:
        raise ValueError(f"--port: expected a port of {HERE} that is free, got {port} ({error.strerror})") from error
    thread = threading.Thread(target=server.serve_forever, name="pages", daemon=True)
    thread.start()
    try:
        yield f"http://{HERE}:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, pages: Pages, port: int) -> None:
        super().__init__((HERE, port), _Handler)
        self.pages = pages
        self.names = {f"{name}:{self.server_address[1]}" for name in (HERE, "localhost")}


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        """A page, if there is one of this path."""
        if self.headers.get("Host") not in self.server.names:  # a page elsewhere whose name leads here
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        path = urlsplit(self.path).path
        if path == "/favicon.ico":
            self.send_response(HTTPStatus.NO_CONTENT)
            self.end_headers()
        elif (answer := self.server.pages(path, self.headers.get("Accept", ""))) is not None:
            self._answer(answer)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _answer(self, answer: Answer) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in (
            ("Content-Type", answer.kind),
            ("Content-Length", str(len(answer.body))),
            ("Cache-Control", "no-store"),
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
        ):
            self.send_header(name, value)
        self.end_headers()
        try:
            self.wfile.write(answer.body)
        except (BrokenPipeError, ConnectionResetError):  # the browser has gone on
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: one line a second says nothing."""
