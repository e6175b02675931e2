# SPDX-License-Identifier: Apache-2.0
"""The page of `objreg watch` on this machine only: it answers to a browser here, and to no name of another host."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

from objreg_tools.cli.watching.watched import Watched
from objreg_tools.report.page import environment

HERE = "127.0.0.1"
PATIENCE_S = 10.0  # for a request that does not come to its end
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src 'self'; connect-src 'self'"


@contextmanager
def served(watched: Watched, port: int) -> Iterator[str]:
    """The address of the page, which is there within the block. ``port`` 0 is any; ValueError where it is taken."""
    try:
        server = _Server(watched, port)
    except OSError as error:
        raise ValueError(f"--port: expected a port of {HERE} that is free, got {port} ({error.strerror})") from error
    thread = threading.Thread(target=server.serve_forever, name="page", daemon=True)
    thread.start()
    try:
        yield f"http://{HERE}:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, watched: Watched, port: int) -> None:
        super().__init__((HERE, port), _Handler)
        self.watched, self.page = watched, environment().get_template("watch.html.j2").render().encode()
        self.names = {f"{name}:{self.server_address[1]}" for name in (HERE, "localhost")}


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        """The page, what there is to know as JSON, or the last picture."""
        if self.headers.get("Host") not in self.server.names:  # a page elsewhere whose name leads here
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        path = urlsplit(self.path).path
        if path == "/":
            self._answer(self.server.page, "text/html; charset=utf-8")
        elif path == "/state.json":
            self._answer(json.dumps(self.server.watched.as_json()).encode(), "application/json")
        elif path == "/picture.jpg" and (picture := self.server.watched.picture()) is not None:
            self._answer(picture, "image/jpeg")
        elif path == "/favicon.ico":
            self.send_response(HTTPStatus.NO_CONTENT)
            self.end_headers()
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _answer(self, body: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(body))),
            ("Cache-Control", "no-store"),
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
        ):
            self.send_header(name, value)
        self.end_headers()
        try:
            self.wfile.write(body)
        except (BrokenPipeError, ConnectionResetError):  # the browser has gone on
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: one line a second says nothing."""
