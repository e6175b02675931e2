# SPDX-License-Identifier: Apache-2.0
"""Draws docs/pictures/ and writes the reference of reasons into docs/troubleshooting.md.

    python -m docs.draw_reasons [RUN.json …]

The words are those of `objreg_tools/report/run/reasons.py`, the schemes those of `docs/schemes.py`. A RUN is what
`objreg offline REC --json RUN.json` wrote: of each reason that is met in it, the pair that is seen best becomes a
picture. Without a RUN the pictures of pairs stay as they are.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from docs.schemes import DROPS as DROP_SCHEMES
from docs.schemes import SCHEMES
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import UNTRIED
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.opening import open_recording
from objreg_tools.report.run.pictures import Album, overlay
from objreg_tools.report.run.reasons import DROPS, REFUSALS, ReasonText

FOLDER = Path(__file__).parent
PICTURES = FOLDER / "pictures"
PAGE = FOLDER / "troubleshooting.md"
BEGIN, END = "<!-- made by docs/draw_reasons.py -->", "<!-- end of what was made -->"
QUALITY = 75
SYMPTOM = "overtaken"  # the drop that the page has a section of already, of the same name
LEGEND = (
    "In the pictures green is the earlier view and magenta the new one. Three pictures in a row are of a pair in a\n"
    "simulated recording: the earlier one, the new one, and the new one laid over the earlier by the pose that was\n"
    "refused, with the numbers below. Grey is agreement, coloured fringes are not; dark was not seen by both."
)
DETAILS = "pairs.json"  # beside the pictures of pairs: the numbers with which each was refused


def main() -> None:
    """Draw and write."""
    PICTURES.mkdir(exist_ok=True)
    for name, svg in (*SCHEMES.items(), *DROP_SCHEMES.items()):
        (PICTURES / f"{name}.svg").write_text(svg, encoding="utf-8")
    if len(sys.argv) > 1:
        draw_pairs([Path(name) for name in sys.argv[1:]])
    PAGE.write_text(with_reference(PAGE.read_text(encoding="utf-8"), details()), encoding="utf-8")


def draw_pairs(runs: Sequence[Path]) -> None:
    """One picture of a refused pair for each reason that is met, out of the first run that has it."""
    found: dict[str, str] = {}
    for run in runs:
        summary = json.loads(run.read_text(encoding="utf-8"))
        with open_recording(Path(summary["recording"])) as recording:
            album = Album(recording, choose_inputs(recording.topics, {}))
            for reason, detail, rgb in pairs(summary["refusals"], album, found):
                bgr = np.ascontiguousarray(rgb[..., ::-1])
                cv2.imwrite(str(PICTURES / f"{reason}.jpg"), bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                found[reason] = detail
    (PICTURES / DETAILS).write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def pairs(
    refusals: Sequence[Mapping[str, Any]], album: Album, known: Mapping[str, str]
) -> Iterator[tuple[str, str, Array]]:
    """Reason, numbers and picture of the pair with the most pixels in common, for each reason that is not known yet."""
    tried = {row["reason"] for row in refusals} - {reason.value for reason in UNTRIED}
    for reason in sorted(tried - set(known)):
        seen = [
            (row["detail"], rgb)
            for row in refusals
            if row["reason"] == reason and (rgb := side_by_side(row, album)) is not None
        ]
        if seen:
            yield reason, *max(seen, key=lambda pair: common(pair[1]))


def side_by_side(row: Mapping[str, Any], album: Album) -> Array | None:
    """(H, 3 W, 3) RGB: earlier, new, and the new one over the earlier; None without a pose or a picture."""
    target, source = album.at(row["from_ns"]), album.at(row["to_ns"])
    if row.get("T_from_to") is None or target is None or source is None:
        return None
    over = overlay(target, source, np.array(row["T_from_to"], float).reshape(4, 4))
    size = over.shape[1] * 2 // 3, over.shape[0] * 2 // 3
    shown = [cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (target.rgb, source.rgb, over)]
    return np.concatenate(shown, axis=1)


def common(rgb: Array) -> int:
    """How many pixels of the overlay both views saw."""
    return int((rgb[:, 2 * rgb.shape[1] // 3 :].max(axis=2) > 90).sum())


def details() -> dict[str, str]:
    """The numbers with which the pairs of the pictures were refused, by reason."""
    file = PICTURES / DETAILS
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def with_reference(page: str, pictured: Mapping[str, str]) -> str:
    """The page with the reference of reasons made anew between its two marks."""
    before, _, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{PAGE.name}: expected {BEGIN} and {END}, got a page without")
    return f"{before}{BEGIN}\n\n{reference(pictured)}\n{END}{after}"


def reference(pictured: Mapping[str, str]) -> str:
    """Two tables of reasons and a section for each."""
    drops = "".join(
        f"![{what}](pictures/{name}.svg)\n\n"
        for name, what in (("frame", "Where a frame can end"), ("constraint", "Where a constraint can end"))
    )
    return (
        "## Why a pair is refused\n\n"
        f"{table(REFUSALS)}\n"
        f"{LEGEND}\n\n"
        + "".join(section(name, words, scheme(name), pictured.get(name)) for name, words in REFUSALS.items())
        + f"## Why a frame or a constraint is dropped\n\n{table(DROPS)}\n{drops}"
        + "".join(section(name, words, "", None) for name, words in DROPS.items() if name != SYMPTOM)
    )


def table(reasons: Mapping[str, ReasonText]) -> str:
    """A row for each reason, which leads to its section."""
    rows = "".join(f"| [`{name}`](#{name}) | {words.meaning} |\n" for name, words in reasons.items())
    return f"| reason | meaning |\n| --- | --- |\n{rows}"


def scheme(name: str) -> str:
    """The scheme of a refusal."""
    return f"![Scheme of {name}](pictures/{name}.svg)\n\n"


def section(name: str, words: ReasonText, picture: str, detail: str | None) -> str:
    """What a reason means, its picture, what to do and what stands behind it."""
    pair = f"![A pair refused as {name}](pictures/{name}.jpg)\n\n*{detail}*\n\n" if detail is not None else ""
    behind = [f"[`{parameter}`](parameters.md#{parameter.partition('.')[0]})" for parameter in words.parameters]
    behind += [f"`{limit}` in `{file}`" for file, limit in words.limits]
    lines = f" Behind it: {', '.join(behind)}." if behind else ""
    meaning = words.meaning[0].upper() + words.meaning[1:] if words.meaning[0] != "`" else words.meaning
    return f"### `{name}`\n\n{meaning}. {words.remedy}{lines}\n\n{picture}{pair}"


if __name__ == "__main__":
    main()
