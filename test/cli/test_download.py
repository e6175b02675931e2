# SPDX-License-Identifier: Apache-2.0
"""Downloads from servers that lead astray, drip or never end; they speak TLS, with a certificate made for the test."""

from __future__ import annotations

import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

import pytest

from objreg_tools.cli import download as module
from objreg_tools.cli.commands.fetch_model import ModelSource, fetch
from objreg_tools.cli.download import download

Answering = Callable[[socket.socket], None]
OK = b"HTTP/1.1 200 OK\r\nContent-Type: application/octet-stream\r\n"


class Hostile:
    """A server on a port of its own; how it answers, and how often it was asked."""

    def __init__(self, answer: Answering, tls: ssl.SSLContext | None = None) -> None:
        self._answer, self._tls, self.asked = answer, tls, 0
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def url(self, scheme: str = "http") -> str:
        return f"{scheme}://127.0.0.1:{self.port}/some.onnx"

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                self.asked += 1
                threading.Thread(target=self._talk, args=(connection,), daemon=True).start()

    def _talk(self, connection: socket.socket) -> None:
        with suppress(OSError), ExitStack() as stack:
            talking = stack.enter_context(connection)
            if self._tls is not None:
                talking = stack.enter_context(self._tls.wrap_socket(connection, server_side=True))
            talking.recv(1 << 16)
            self._answer(talking)

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def serve() -> Iterator[Callable[..., Hostile]]:
    with ExitStack() as stack:

        def start(answer: Answering, tls: ssl.SSLContext | None = None) -> Hostile:
            server = Hostile(answer, tls)
            stack.callback(server.close)
            return server

        yield start


@pytest.fixture
def tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ssl.SSLContext:
    """Of a server whose certificate is trusted here."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl, which makes the certificate")
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    words = ["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=127.0.0.1"]
    words += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(["openssl", *words], check=True, capture_output=True)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    return context


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bounds of time, in parts of a second."""
    monkeypatch.setattr(module, "GRACE_S", 0.5)
    monkeypatch.setattr(module, "MOST_S", 2.0)


def send(content: bytes, connection: socket.socket) -> None:
    connection.sendall(OK + b"Content-Length: %d\r\n\r\n" % len(content) + content)


def lead(url: str, connection: socket.socket) -> None:
    connection.sendall(f"HTTP/1.1 302 Found\r\nLocation: {url}\r\nContent-Length: 0\r\n\r\n".encode())


def drip(before: bytes, each: bytes, connection: socket.socket) -> None:
    """Two bytes a second at most, for ever; quicker here, as the bounds are."""
    connection.sendall(before)
    while True:
        connection.sendall(each)
        time.sleep(0.05)


def pour(before: bytes, connection: socket.socket) -> None:
    """Without end, as fast as it goes."""
    connection.sendall(before)
    while True:
        connection.sendall(bytes(1 << 16))


def test_https_all_the_way_arrives(serve: Callable[..., Hostile], tls: ssl.SSLContext, tmp_path: Path) -> None:
    last = serve(partial(send, b"a model"), tls)
    first = serve(partial(lead, last.url("https")), tls)
    download(first.url("https"), tmp_path / "part", checked=False)
    assert (tmp_path / "part").read_bytes() == b"a model"


def test_one_plain_hop_between_two_that_are_encrypted_is_refused_before_it_is_asked(
    serve: Callable[..., Hostile], tls: ssl.SSLContext, tmp_path: Path
) -> None:
    last = serve(partial(send, b"a model"), tls)
    plain = serve(partial(lead, last.url("https")))
    first = serve(partial(lead, plain.url()), tls)
    with pytest.raises(ValueError, match=rf"expected https all the way, or --sha256.*got {plain.url()} without one"):
        download(first.url("https"), tmp_path / "part", checked=False)
    assert (first.asked, plain.asked, last.asked) == (1, 0, 0) and not (tmp_path / "part").exists()
    download(first.url("https"), tmp_path / "part", checked=True)
    assert (tmp_path / "part").read_bytes() == b"a model"


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize("scheme", ["ftp", "file"])
def test_another_protocol_is_never_followed(
    scheme: str, checked: bool, serve: Callable[..., Hostile], tls: ssl.SSLContext, tmp_path: Path
) -> None:
    other = serve(partial(send, b"a model"))
    first = serve(partial(lead, other.url(scheme)), tls)
    with pytest.raises((ValueError, OSError), match=r"all the way|not allowed"):
        download(first.url("https"), tmp_path / "part", checked)
    assert other.asked == 0 and not (tmp_path / "part").exists()


def test_redirects_in_a_circle_end(serve: Callable[..., Hostile], tmp_path: Path) -> None:
    ports: list[str] = []
    server = serve(lambda connection: lead(ports[0], connection))
    ports.append(server.url())
    with pytest.raises(OSError, match="infinite loop"):
        download(server.url(), tmp_path / "part", checked=True)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize(
    "before",
    [
        OK + b"\r\n",
        OK + b"Content-Length: 1000000\r\n\r\n",
        OK + b"Transfer-Encoding: chunked\r\n\r\n5;",
        OK + b"X-Header: ",
        b"HTTP/1.1 302 Found\r\nLocation: ",
        b"",
    ],
    ids=["body", "body of known length", "head of a chunk", "header", "redirect", "nothing"],
)
def test_a_drip_ends_the_attempt_wherever_it_drips(
    before: bytes, serve: Callable[..., Hostile], tmp_path: Path
) -> None:
    server, start = serve(partial(drip, before, b"x")), time.monotonic()
    with pytest.raises(OSError, match=r"expected 10000 bytes a second and all within .* s, got \d+ bytes in"):
        download(server.url(), tmp_path / "part", checked=True)
    assert time.monotonic() - start < 2


@pytest.mark.usefixtures("hasty")
def test_a_handshake_that_never_ends_ends_the_attempt(serve: Callable[..., Hostile], tmp_path: Path) -> None:
    server, start = serve(partial(drip, b"\x16\x03\x03\x40\x00", b"x")), time.monotonic()
    with pytest.raises(OSError, match="expected 10000 bytes a second"):
        download(server.url("https"), tmp_path / "part", checked=True)
    assert time.monotonic() - start < 2


@pytest.mark.usefixtures("hasty")
def test_a_whole_download_has_a_time_however_fast_it_is(serve: Callable[..., Hostile], tmp_path: Path) -> None:
    server, start = serve(partial(drip, OK + b"\r\n", bytes(10_000))), time.monotonic()
    with pytest.raises(OSError, match="all within 2 s"):
        download(server.url(), tmp_path / "part", checked=True)
    assert 1.5 < time.monotonic() - start < 4 and (tmp_path / "part").stat().st_size > 100_000


def test_what_arrived_slowly_stays_for_the_next_time_and_the_next_mirror(
    serve: Callable[..., Hostile], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "GRACE_S", 0.5)
    slow, other = serve(partial(drip, OK + b"\r\n", b"x")), serve(partial(drip, b"", b"y"))
    with pytest.raises(ValueError, match=r"(?s)got .*10000 bytes a second.*10000 bytes a second.*Try again to go on"):
        fetch(ModelSource("some.onnx", (slow.url(), other.url()), "00"), tmp_path / "some.onnx")
    assert other.asked == 1 and set((tmp_path / "some.onnx.part").read_bytes()) == {ord("x")}


@pytest.mark.parametrize("length", [b"", b"Content-Length: 99999999999\r\n", b"Content-Length: abc\r\n"])
def test_a_flood_ends_at_the_size_of_a_model(
    length: bytes, serve: Callable[..., Hostile], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_BYTES", 1_000_000)
    server = serve(partial(pour, OK + length + b"\r\n"))
    with pytest.raises(ValueError, match="expected a model of at most 1000000 bytes, got more"):
        download(server.url(), tmp_path / "part", checked=True)
    assert not (tmp_path / "part").exists()


def test_the_text_of_a_redirect_is_not_read(serve: Callable[..., Hostile], tmp_path: Path) -> None:
    last = serve(partial(send, b"a model"))
    first = serve(partial(pour, f"HTTP/1.1 302 Found\r\nLocation: {last.url()}\r\n\r\n".encode()))
    download(first.url(), tmp_path / "part", checked=True)
    assert (tmp_path / "part").read_bytes() == b"a model"


def test_a_server_that_has_no_such_range_of_nothing_is_no_reason_to_ask_again(
    serve: Callable[..., Hostile], tmp_path: Path
) -> None:
    server = serve(lambda connection: connection.sendall(b"HTTP/1.1 416 No\r\nContent-Length: 0\r\n\r\n"))
    with pytest.raises(OSError, match="416"):
        download(server.url(), tmp_path / "part", checked=True)
    assert server.asked == 1
