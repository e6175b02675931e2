# SPDX-License-Identifier: Apache-2.0
"""What registrars and keyframers send each other, under attack: packed keyframes, summaries, requests, deliveries.

A hostile peer knows all that an honest one said. It forges, floods and damages; its checksums are right. What an
honest peer says before or after that must still be of use: nobody silences another. A newcomer that comes after more
invented names than a registrar knows others waits for a place; that limit (docs/robots.md) is not attacked.
"""

from __future__ import annotations

import json
import lzma
import random
import struct
import zlib
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from attacked_messages import SECOND, drawn_frame
from edits import edited_text
from mutation import flipped
from trials import Attempt, Target, WrongAnswerError

from objreg_ros import limits
from objreg_ros.memory.compact import KEYFRAME as PACKED_KEYFRAME
from objreg_ros.memory.compact import pack_keyframe, unpack_keyframe
from objreg_ros.memory.envelope import FILTERS, FORMAT, PREFIX
from objreg_ros.registrar import summary as messages
from objreg_ros.registrar.exchange import Exchange
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.summary import Name, Request, pack_request

SUMMARY, REQUEST, DELIVERY = (kind.mark for kind in (messages.SUMMARY, messages.REQUEST, messages.DELIVERY))
BOMB = 64 << 20  # bytes that unpack from some thousand
FLOOD = 1100  # messages: more than wait
FLOODED = 0.02  # of the trials: each takes seconds
OURS, HONEST = "ours", "honest"
MOST_TURNS = 4  # of answers until an honest asker has its keyframe, however many the others ask for
Packer = Callable[[bytes], bytes]
Unpacker = Callable[[bytes], bytes]


class Kind(NamedTuple):
    """How a kind of message is sealed."""

    magic: bytes
    pack: Packer
    unpack: Unpacker


def _lzma(body: bytes) -> bytes:
    return lzma.compress(body, lzma.FORMAT_RAW, filters=FILTERS)


def _unlzma(data: bytes) -> bytes:
    return lzma.decompress(data, lzma.FORMAT_RAW, filters=FILTERS)


def _deflated(body: bytes) -> bytes:
    return zlib.compress(body, 6)


KEYFRAME = Kind(PACKED_KEYFRAME.mark, _lzma, _unlzma)
KINDS = {what: Kind(what, _deflated, zlib.decompress) for what in (SUMMARY, REQUEST, DELIVERY)}


def sealed(kind: Kind, body: bytes, size: int | None = None, packed: bytes | None = None) -> bytes:
    """A body under a right checksum; ``size`` and ``packed`` where they are to be lies."""
    packed = kind.pack(body) if packed is None else packed
    length = struct.pack("<I", (len(body) if size is None else size) % 2**32)
    return PREFIX.pack(kind.magic, FORMAT, zlib.crc32(length + packed), *struct.unpack("<I", length)) + packed


def forged(draw: random.Random, kind: Kind, good: bytes, bomb: bytes) -> bytes:
    """A message that is almost the good one: damaged, or false with a right checksum."""
    how, body = draw.random(), kind.unpack(good[PREFIX.size :])
    head, _, rest = body.partition(b"\n")
    if how < 0.1:
        return flipped(draw, good)
    if how < 0.2:
        return sealed(kind, body, packed=flipped(draw, good[PREFIX.size :]))
    if how < 0.25:
        return sealed(kind, body, size=draw.choice((0, 1, len(body) - 1, len(body) + 1, 1 << 30, 2**32 - 1)))
    if how < 0.28:
        return sealed(kind, body, draw.choice((len(body), limits.MOST_UNPACKED_KEYFRAME, BOMB)), bomb)
    if how < 0.5:
        return sealed(kind, head + b"\n" + flipped(draw, rest))
    if how < 0.6:
        return sealed(kind, head + b"\n" + draw.choice((rest[: len(rest) // 2], rest + rest, b"", bytes(len(rest)))))
    return sealed(kind, edited_text(draw, json.loads(head)).encode("utf-8", "surrogateescape") + b"\n" + rest)


# ------------------------------------------------------------------------------------------------------------ keyframes


def keyframe_attempt(_: Path) -> Attempt:
    """A packed keyframe as the registrar reads it, and as it would send it on."""
    good = pack_keyframe(Side(HONEST).keyframe())
    bomb = _lzma(bytes(BOMB))

    def attempt(draw: random.Random) -> None:
        require_sound(unpack_keyframe(forged(draw, KEYFRAME, good, bomb)))

    return attempt


def require_sound(keyframe: Any) -> None:
    """WrongAnswerError unless a keyframe that was let in has numbers, is of our own size, and can be sent on."""
    arrays = [keyframe.context.xyz, keyframe.context.normals, *(item.cloud.xyz for item in keyframe.objects)]
    if not all(np.isfinite(array).all() for array in arrays):
        raise WrongAnswerError("a point of a keyframe is no number")
    if keyframe.view.xyz[..., 0].size > limits.OWN_VIEW_PIXELS:
        raise WrongAnswerError(f"a view of {keyframe.view.xyz.shape} pixels came in")
    try:
        unpack_keyframe(pack_keyframe(keyframe))
    except ValueError as error:
        raise WrongAnswerError(f"a keyframe that came in cannot be sent on: {error}") from error


# ------------------------------------------------------------------------------------------------------------- exchange


class Nothing:
    """A method that finds no pose: the exchange is attacked, not the search."""

    def prepare(self, keyframe: Any) -> None:
        """Nothing to make ready."""

    def propose(self, source: Any, target: Any, T_target_source_prior: Any = None) -> tuple[()]:
        """No pose."""
        return ()


class Side:
    """A registrar that has seen the drawn place twice, and what it says of that."""

    def __init__(self, run: str) -> None:
        self.run, self.registrar = run, Registrar(RegistrarParams(threads=1), method=Nothing())
        exchange = self.exchange()
        self.summaries = [exchange.announce(outcome) or b"" for outcome in self._seen()]
        for number in (1, 2):
            exchange.note(pack_request(Request(Name(run, number), 1.0)), 0.0)
        self.deliveries = [exchange.answer(k) or b"" for k in range(2)]

    def _seen(self) -> Iterable[Any]:
        for k in range(2):
            self.registrar.track(drawn_frame((1 + 10 * k) * SECOND, 4))
            (window,) = self.registrar.end_windows()
            yield self.registrar.search(window)

    def keyframe(self) -> Any:
        """The first that it stores."""
        return self.registrar.moment(1)[0]

    def exchange(self) -> Exchange:
        """One that knows of nobody yet."""
        return Exchange(self.registrar, self.run, run=self.run)


def exchange_attempt(what: bytes, _: Path, make: Callable[[Side], Any] = Side.exchange) -> Attempt:
    """Hostile messages of one kind to a registrar, and an honest peer's before or after them."""
    ours, honest = Side(OURS), Side(HONEST)
    goods: list[bytes] = {
        SUMMARY: [*honest.summaries, *ours.summaries],
        DELIVERY: [*honest.deliveries, *ours.deliveries],
        REQUEST: [pack_request(Request(Name(OURS, k), 9.0, HONEST)) for k in (1, 2)],
    }[what]
    kind, bomb = KINDS[what], _deflated(bytes(BOMB))

    def attempt(draw: random.Random) -> None:
        known_first = draw.random() < 0.5
        if draw.random() < FLOODED:
            many = draw.random() < 0.5
            hostile = list(flood(draw, kind, draw.choice(goods), many))
            known_first = known_first or many
        else:
            hostile = [forged(draw, kind, draw.choice(goods), bomb) for _ in range(draw.randint(1, 6))]
        require_honest_served(make(ours), honest, what, hostile, known_first)

    return attempt


def flood(draw: random.Random, kind: Kind, good: bytes, many: bool) -> Iterable[bytes]:
    """Very many messages that are well formed: of one run or of ``many``, with numbers that rise or leap."""
    head, _, rest = kind.unpack(good[PREFIX.size :]).partition(b"\n")
    said, step = json.loads(head), draw.choice((1, 1000, 1 << 40))
    for k in range(FLOOD):
        named = {"run": f"hostile {k if many else 0}"} if kind.magic != REQUEST else {"asker": f"hostile {k}"}
        number = 1 if kind.magic == REQUEST else 1 + k * step
        text = json.dumps({**said, **named, "keyframe": number}, separators=(",", ":"))
        yield sealed(kind, text.encode() + b"\n" + rest)


def require_honest_served(exchange: Any, honest: Side, what: bytes, hostile: Iterable[bytes], first: bool) -> None:
    """WrongAnswerError unless an honest peer has what it asked for, and is asked for what it has, all the same."""
    requests = list(_ask(exchange, honest)) if first else []
    for packed in hostile:
        _receive(exchange, what, packed)
    if not first:
        requests = list(_ask(exchange, honest))
    if not all(requests):
        raise WrongAnswerError("an honest summary is not asked for")
    for packed in honest.deliveries:
        try:
            if not exchange.awaits(packed) or exchange.receive_delivery(packed) is None:
                raise WrongAnswerError("an honest keyframe that was asked for is not taken")
        except ValueError as error:
            raise WrongAnswerError(f"an honest keyframe is refused: {error}") from error
    exchange.note(pack_request(Request(Name(OURS, 2), 1.0, HONEST)), 1.0)
    answers = [exchange.answer(2.0 + k) for k in range(MOST_TURNS)]
    if exchange.run == OURS and not any(answer is not None and _number(answer) == 2 for answer in answers):
        raise WrongAnswerError(f"an honest request is not answered within {MOST_TURNS} turns")


def _ask(exchange: Any, honest: Side) -> Iterable[bytes | None]:
    """The requests for an honest peer's keyframes."""
    for summary in honest.summaries:
        exchange.sender(summary)
        yield exchange.receive_summary(summary, 0.5)


def _receive(exchange: Any, what: bytes, packed: bytes) -> None:
    """As a node does; what is refused is counted there."""
    try:
        if what == SUMMARY:
            exchange.sender(packed)
            exchange.receive_summary(packed, 0.5)
        elif what == REQUEST:
            exchange.note(packed, 0.5)
        elif exchange.awaits(packed):
            exchange.receive_delivery(packed)
    except ValueError:
        return


def _number(delivery: bytes) -> int:
    head = zlib.decompress(delivery[PREFIX.size :]).partition(b"\n")[0]
    return int(json.loads(head)["keyframe"])


TARGETS = [
    Target("keyframe", keyframe_attempt, 1.5),
    Target("summary", partial(exchange_attempt, SUMMARY)),
    Target("request", partial(exchange_attempt, REQUEST)),
    Target("delivery", partial(exchange_attempt, DELIVERY)),
]
