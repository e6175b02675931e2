# SPDX-License-Identifier: Apache-2.0
"""A download from a server that is not trusted: its addresses, its size, its rate and its time have bounds."""

from __future__ import annotations

import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.client import HTTPMessage
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import IO, Any, BinaryIO, NamedTuple
from urllib.parse import urlsplit

from tqdm import tqdm

from objreg_ros.whole_file import unwritten

SILENCE_S = 30.0  # of a connection
GRACE_S = 30.0  # before the rate counts: for the name, the handshake and the redirects
LEAST_RATE = 10_000  # bytes a second, on average
MOST_S = 3600.0
MOST_BYTES = 1 << 32  # twice what a file of ONNX can be
CHUNK = 1 << 16
AHEAD = 8  # chunks that wait to be written


class Answer(NamedTuple):
    """How the last of the servers answered; ``length`` of what is to come, in bytes, 0 where it gives none."""

    status: int
    length: int


class Redirects(urllib.request.HTTPRedirectHandler):
    """Checks each address before it is asked; other parts of a redirect are not read."""

    def __init__(self, checked: bool) -> None:
        self._checked = checked

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> urllib.request.Request | None:
        """As the base class; ValueError as `require_safe`."""
        require_safe(newurl, self._checked)
        return super().redirect_request(req, fp, code, msg, headers, newurl)

    def http_error_302(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage
    ) -> Any | None:
        """As the base class, which would read all of ``fp``, however long."""
        fp.close()
        return super().http_error_302(req, fp, code, msg, headers)

    http_error_301 = http_error_303 = http_error_307 = http_error_308 = http_error_302


def require_safe(url: str, checked: bool) -> None:
    """ValueError for an address that is not http(s), or for which anybody between could answer, unless ``checked``.

    ``checked`` is whether the checksum of the file is known.
    """
    scheme = urlsplit(url).scheme
    if scheme == "https" or (scheme == "http" and checked):
        return
    if checked:
        raise ValueError(f"model: expected http or https all the way, got {url}")
    raise ValueError(
        f"model: expected https all the way, or --sha256 with the checksum of the file, got {url} without one"
    )


def download(url: str, part: Path, checked: bool) -> None:
    """Append to ``part`` what is missing of ``url``; OSError or HTTPException when the connection fails or is slow.

    ValueError where the address or a redirect is not safe, see `require_safe`, and where the file is too large.
    """
    require_safe(url, checked)
    have = part.stat().st_size if part.is_file() else 0
    request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})
    arriving = _arriving(request, checked)
    try:
        answer = next(arriving)
    except urllib.error.HTTPError as error:
        if error.code != 416 or not have:
            raise
        part.unlink()  # more than there is: the file has changed, or it was complete and somebody else's
        return download(url, part, checked)
    _receive(answer, arriving, part, have if answer.status == 206 else 0)


def _arriving(request: urllib.request.Request, checked: bool) -> Iterator[Any]:
    """The `Answer`, then chunks of bytes; OSError where they come too slowly, whatever the server does.

    A thread of its own reads: each of its reads may last, and a header that drips is a thousand of them.
    """
    arrived: Queue[Any] = Queue(AHEAD)
    Thread(target=_read, args=(request, checked, arrived), daemon=True).start()
    start, size = time.monotonic(), 0
    while (item := _next(arrived, start, size)) is not None:
        if isinstance(item, Exception):
            raise item
        size += len(item) if isinstance(item, bytes) else 0
        yield item


def _read(request: urllib.request.Request, checked: bool, arrived: Queue[Any]) -> None:
    """Put the answer, its chunks and None at their end, or what went wrong."""
    try:
        opener = urllib.request.build_opener(Redirects(checked))
        with opener.open(request, timeout=SILENCE_S) as response:
            arrived.put(Answer(response.status, response.length or 0))
            while chunk := response.read1(CHUNK):
                arrived.put(chunk)
    except Exception as error:
        arrived.put(error)
    else:
        arrived.put(None)


def _next(arrived: Queue[Any], start: float, size: int) -> Any:
    """The next that has arrived after ``size`` bytes since ``start``; OSError where it is too late for it."""
    passed = time.monotonic() - start
    left = min(GRACE_S + size / LEAST_RATE, MOST_S) - passed
    try:
        if left > 0:
            return arrived.get(timeout=left)
    except Empty:
        passed += left
    raise OSError(
        f"expected {LEAST_RATE} bytes a second and all within {MOST_S:.0f} s, got {size} bytes in {passed:.0f} s"
    )


def _receive(answer: Answer, chunks: Iterator[bytes], part: Path, have: int) -> None:
    """Write the chunks behind the first ``have`` bytes of ``part``, with a progress bar."""
    total = have + answer.length if answer.length else None
    bar = tqdm(total=total, initial=have, unit="B", unit_scale=True, desc=part.stem, leave=False, disable=None)
    with bar, part.open("ab" if have else "wb") as file:
        _require_size(part, total or 0)
        for chunk in chunks:
            _require_size(part, file.tell() + len(chunk))
            _keep(file, chunk, part)
            bar.update(len(chunk))
        size = file.tell()
    if total and size < total:
        raise OSError(f"the connection ended after {size - have} of {answer.length} bytes")


def _require_size(part: Path, size: int) -> None:
    """ValueError, and the part is gone, where no model is that large."""
    if size > MOST_BYTES:
        part.unlink()
        raise ValueError(f"{part.stem}: expected a model of at most {MOST_BYTES} bytes, got more; is it one?")


def _keep(file: BinaryIO, chunk: bytes, part: Path) -> None:
    """ValueError, which no other place would mend, where the disk does not take what has come."""
    try:
        file.write(chunk)
        file.flush()
    except OSError as error:
        raise ValueError(str(unwritten(part, error))) from error
