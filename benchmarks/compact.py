# SPDX-License-Identifier: Apache-2.0
"""What keyframes take when they are packed to be sent, and what that does to their registration.

The keyframes of each recording are packed and unpacked. Its pairs that could close and those that could not are
registered with the keyframes as they were and as they came back.

    python benchmarks/compact.py REC --model MODEL --threshold 0.4 --json compact.json
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from frame_pairs import Pair, Truths, draw_pairs
from pair_figures import Row, summed
from pairs import Ours, fused
from sources import Source, detector_of, read_source

from objreg_ros.memory.compact import MOST_BYTES, pack_keyframe, unpack_keyframe
from objreg_ros.memory.descriptor import describe
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.truth import LOOSE

UNLIMITED = 10**9  # bytes


def sizes(keyframes: Sequence[Keyframe], most_bytes: int) -> tuple[dict[str, Any], list[Keyframe]]:
    """Bytes and milliseconds of packing, and what came back."""
    pack_keyframe(keyframes[0])  # what is loaded at first is loaded before the clock
    packed, back, pack_ms, unpack_ms = [], [], [], []
    for keyframe in keyframes:
        start = time.perf_counter()
        packed.append(pack_keyframe(keyframe, most_bytes))
        middle = time.perf_counter()
        back.append(unpack_keyframe(packed[-1]))
        pack_ms.append(1e3 * (middle - start))
        unpack_ms.append(1e3 * (time.perf_counter() - middle))
    figures = {
        "bytes": _spread([len(item) for item in packed]),
        "bytes_whole": _spread([len(pack_keyframe(keyframe, UNLIMITED)) for keyframe in keyframes]),
        "points_kept": _points(back) / max(1, _points(keyframes)),
        "pack_ms": float(np.median(pack_ms)),
        "unpack_ms": float(np.median(unpack_ms)),
        "descriptor": descriptor_shift(keyframes, back),
    }
    return figures, back


def descriptor_shift(keyframes: Sequence[Keyframe], back: Sequence[Keyframe]) -> float:
    """The median distance of the descriptors of an object before and after."""
    pairs = [pair for a, b in zip(keyframes, back, strict=True) for pair in zip(a.objects, b.objects, strict=True)]
    shifts = [float(np.linalg.norm(describe(a.cloud) - describe(b.cloud))) for a, b in pairs]
    return float(np.median(shifts)) if shifts else 0.0


def compared(pairs: Sequence[Pair], before: Sequence[Row], after: Sequence[Row]) -> dict[str, Any]:
    """Either way's figures, and the errors of the pairs that both ways accept, within the loose bound."""
    both = [
        (a.error, b.error)
        for a, b in zip(before, after, strict=True)
        if a.accepted and b.accepted and a.error is not None and b.error is not None
        if a.within(LOOSE) and b.within(LOOSE)
    ]
    named = ("tried", "could_close", "accepted_recall", "wrong")
    return {
        "as_it_was": {name: summed(pairs, before)[name] for name in named} | _errors([a for a, _ in both]),
        "as_it_came": {name: summed(pairs, after)[name] for name in named} | _errors([b for _, b in both]),
        "both_accept": len(both),
        "verdicts_changed": sum(a.accepted != b.accepted for a, b in zip(before, after, strict=True)),
    }


def measured(source: Source, params: RegistrarParams, wanted: int, seed: int, most_bytes: int) -> dict[str, Any]:
    """The figures of one recording."""
    frames = [frame for frame in source.frames if source.truth.at(frame.stamp_ns) is not None]
    keyframes = [keyframe for keyframe in fused(frames, params) if keyframe.objects]
    out, back = sizes(keyframes, most_bytes)
    poses = [source.truth.at(keyframe.stamp_ns) for keyframe in keyframes]
    truths = Truths(keyframes, [T for T in poses if T is not None], params)
    pairs = draw_pairs(truths, len(keyframes), wanted, seed)
    rows = [[way(pair) for pair in pairs] for way in (Ours(keyframes, params), Ours(back, params))]
    return {"keyframes": len(keyframes), **out, **(compared(pairs, *rows) if pairs else {})}


def line(name: str, found: dict[str, Any]) -> str:
    """One recording in one line."""
    size, whole = ("{median:.0f} {p95:.0f} {most:.0f}".format(**found[key]) for key in ("bytes", "bytes_whole"))
    out = (
        f"{name}: {found['keyframes']} keyframes, bytes median p95 most {size} (whole {whole}), "
        f"points kept {found['points_kept']:.3f}, pack {found['pack_ms']:.0f} ms, unpack {found['unpack_ms']:.0f} ms"
    )
    for way in ("as_it_was", "as_it_came"):
        if way in found:
            out += f"\n  {way}: " + ", ".join(f"{key} {_rounded(value)}" for key, value in found[way].items())
    return out


def _rounded(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _spread(numbers: Sequence[int]) -> dict[str, float]:
    median, p95, most = np.percentile(numbers, [50, 95, 100]).tolist()
    return {"median": median, "p95": p95, "most": most}


def _points(keyframes: Sequence[Keyframe]) -> int:
    return sum(len(item.cloud) for keyframe in keyframes for item in keyframe.objects)


def _errors(errors: Sequence[tuple[float, float]]) -> dict[str, float | None]:
    rotation, translation = np.median(errors, axis=0).tolist() if errors else (None, None)
    return {"rotation_deg": rotation, "translation_cm": translation}


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--model", default="", help="ONNX model; empty: the default one.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option("--wanted", default=200, show_default=True, help="Pairs of each kind.")
@click.option("--most-bytes", default=MOST_BYTES, show_default=True, help="Bytes for whose sake objects are thinned.")
@click.option("--seed", default=1, show_default=True)
def main(
    recordings: tuple[Path, ...],
    json_file: Path | None,
    model: str,
    threshold: float,
    wanted: int,
    most_bytes: int,
    seed: int,
) -> None:
    """Pack the keyframes of RECORDINGS, and register pairs of them before and after."""
    cv2.setNumThreads(1)
    found = {}
    for path in recordings:
        with read_source(path, detector_of(model, threshold), seed) as source:
            found[path.name] = measured(source, RegistrarParams(), wanted, seed, most_bytes)
        click.echo(line(path.name, found[path.name]))
    if json_file is not None:
        json_file.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
