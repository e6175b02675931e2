# SPDX-License-Identifier: Apache-2.0
"""Fetching of models from a web server of our own."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import onnx
import pytest
from click.testing import CliRunner

from objreg_ros import share
from objreg_tools.cli import download
from objreg_tools.cli.commands import fetch_model
from objreg_tools.cli.commands.fetch_model import ModelSource, checksum, command, fetch, find_source


class Server(ThreadingHTTPServer):
    """Serves ``content`` under any path; remembers what ranges were asked for; may break off or know no ranges."""

    daemon_threads = True
    content = b""
    breaks_after: int | None = None
    knows_ranges = True
    status = 200

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.asked: list[str | None] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/models/some.onnx"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        wanted = self.headers.get("Range")
        self.server.asked.append(wanted)
        first = int(wanted.split("=")[1].rstrip("-")) if wanted and self.server.knows_ranges else 0
        if first and first >= len(self.server.content):
            self.send_error(416)
            return
        if self.server.status != 200:
            self.send_error(self.server.status)
            return
        body = self.server.content[first:]
        self.send_response(206 if first else 200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body[: self.server.breaks_after])

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def server() -> Iterator[Server]:
    one = Server()
    thread = threading.Thread(target=one.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield one
    one.shutdown()
    thread.join()
    one.server_close()


@pytest.fixture
def content(tmp_path: Path, server: Server) -> bytes:
    """A model of some 100 kB, which the server has."""
    floats = onnx.TensorProto.FLOAT
    ports = [onnx.helper.make_tensor_value_info(name, floats, [25000]) for name in ("x", "y")]
    weights = onnx.numpy_helper.from_array(np.arange(25000, dtype=np.float32), "weights")
    nodes = [onnx.helper.make_node("Add", ["x", "weights"], ["y"])]
    graph = onnx.helper.make_graph(nodes, "tiny", ports[:1], ports[1:], [weights])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    server.content = model.SerializeToString()
    return server.content


def source(server: Server, content: bytes, folder: Path) -> ModelSource:
    reference = folder / "reference"
    reference.write_bytes(content)
    return ModelSource("some.onnx", (server.url,), checksum(reference))


def test_a_model_arrives_whole(server: Server, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "deep" / "some.onnx"
    fetch(source(server, content, tmp_path), path)
    assert path.read_bytes() == content
    assert list(path.parent.iterdir()) == [path]


def test_an_interrupted_download_goes_on_where_it_stopped(server: Server, content: bytes, tmp_path: Path) -> None:
    path, one = tmp_path / "some.onnx", source(server, content, tmp_path)
    server.breaks_after = 70_000
    with pytest.raises(ValueError, match=r"connection ended after 70000 of .*Try again to go on"):
        fetch(one, path)
    assert not path.exists()
    server.breaks_after = None
    fetch(one, path)
    assert path.read_bytes() == content
    assert server.asked == [None, "bytes=70000-"]


def test_a_server_without_ranges_sends_it_all_again(server: Server, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "some.onnx"
    (tmp_path / "some.onnx.part").write_bytes(content[:500])
    server.knows_ranges = False
    fetch(source(server, content, tmp_path), path)
    assert path.read_bytes() == content


def test_a_leftover_longer_than_the_file_is_thrown_away(server: Server, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "some.onnx"
    (tmp_path / "some.onnx.part").write_bytes(content + b"more")
    fetch(source(server, content, tmp_path), path)
    assert path.read_bytes() == content


def test_a_wrong_checksum_is_refused_and_nothing_is_left(server: Server, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "some.onnx"
    with pytest.raises(ValueError, match=r"expected SHA-256 0000, got [0-9a-f]{64}; it was removed"):
        fetch(ModelSource("some.onnx", (server.url,), "0000"), path)
    assert list(tmp_path.iterdir()) == []


def test_a_web_page_is_no_model(server: Server, tmp_path: Path) -> None:
    server.content = b"<html>Please log in</html>"
    with pytest.raises(ValueError, match="expected an ONNX file"):
        fetch(ModelSource("some.onnx", (server.url,), sha256(server.content).hexdigest()), tmp_path / "some.onnx")
    assert list(tmp_path.iterdir()) == []


def test_the_next_mirror_is_tried_when_one_fails(server: Server, content: bytes, tmp_path: Path) -> None:
    one = source(server, content, tmp_path)
    dead = "http://127.0.0.1:9/some.onnx"
    fetch(ModelSource(one.file, (dead, *one.urls), one.sha256), tmp_path / "some.onnx")
    assert (tmp_path / "some.onnx").read_bytes() == content


def test_offline_the_error_says_what_was_tried_and_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "some.onnx"
    with pytest.raises(ValueError, match=r"127\.0\.0\.1:9.*refused.*Are you online\?.*HTTPS_PROXY.*put it at"):
        fetch(ModelSource("some.onnx", ("https://127.0.0.1:9/some.onnx",)), path)
    with pytest.raises(
        ValueError, match=r"put it at .*some\.onnx and run this again, which adds its labels\. Try again"
    ):
        fetch(ModelSource("some.onnx", ("https://127.0.0.1:9/some.onnx",), labels="models/coco.txt"), path)


def test_a_missing_page_is_named_with_its_status(server: Server, tmp_path: Path) -> None:
    server.status = 404
    with pytest.raises(ValueError, match=r"some\.onnx: Not Found"):
        fetch(ModelSource("some.onnx", (server.url,), "00"), tmp_path / "some.onnx")


@pytest.mark.parametrize("what", ["unheard-of", "ftp://host/a.onnx", "https://host/page.html", "file:///etc/a.onnx"])
def test_what_is_neither_a_name_nor_a_url_is_refused(what: str) -> None:
    with pytest.raises(ValueError, match=r"expected ssd-mobilenet-v1, .* URL of an \.onnx file, got"):
        find_source(what)


def test_the_command_puts_the_model_where_the_detector_looks_for_it(
    server: Server, content: bytes, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    words = [server.url, "--sha256", source(server, content, tmp_path).sha256]
    first = CliRunner().invoke(command, words)
    assert first.exit_code == 0 and "--model some.onnx" in first.output
    assert share.model("some.onnx").read_bytes() == content
    again = CliRunner().invoke(command, words)
    assert "already there" in again.output and len(server.asked) == 1


def test_a_named_model_brings_its_labels(
    server: Server, content: bytes, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = source(server, content, tmp_path)
    named = ModelSource(one.file, one.urls, one.sha256, "models/coco.txt")
    monkeypatch.setitem(fetch_model.MODELS, "ssd-mobilenet-v1", named)
    result = CliRunner().invoke(command, ["--folder", str(tmp_path / "here")])
    assert result.exit_code == 0, result.output
    lines = (tmp_path / "here" / "some.txt").read_text().splitlines()
    assert lines[:2] == ["???", "person"] and len(lines) == 91


def test_plain_http_is_taken_with_a_checksum_only() -> None:
    url = "http://host/a.onnx"
    with pytest.raises(
        ValueError, match=r"expected https, or --sha256 with the checksum .*, got 'http://host/a\.onnx'"
    ):
        find_source(url)
    assert find_source(url, "AB").sha256 == "ab" and find_source("https://host/a.onnx").sha256 == ""


def test_an_address_that_leads_on_to_plain_http_is_refused_without_a_checksum(
    server: Server, content: bytes, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"expected https all the way, or --sha256.*got http://127"):
        fetch(ModelSource("some.onnx", (server.url,)), tmp_path / "some.onnx")
    assert list(tmp_path.iterdir()) == []


def test_the_checksum_that_was_found_is_said_where_none_was_asked_for(
    server: Server, content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(download, "require_safe", lambda *_: None)
    fetch(ModelSource("some.onnx", (server.url,)), tmp_path / "some.onnx")
    assert f"SHA-256 {checksum(tmp_path / 'some.onnx')}" in capsys.readouterr().out


def test_a_download_without_end_is_ended(
    server: Server, content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(download, "MOST_BYTES", 70_000)
    with pytest.raises(ValueError, match=r"some\.onnx: expected a model of at most 70000 bytes, got more"):
        fetch(source(server, content, tmp_path), tmp_path / "some.onnx")
    assert [file.name for file in tmp_path.iterdir()] == ["reference"]
