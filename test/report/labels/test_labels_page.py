# SPDX-License-Identifier: Apache-2.0
"""The page of a data set."""

from __future__ import annotations

from dataclasses import replace

from objreg_tools.report.labels.crops import Crop, Crops
from objreg_tools.report.labels.labels_page import labels_page
from report.labels.scene import square


def test_each_object_has_its_id_its_class_and_its_crops() -> None:
    things = [square(3, "thing"), replace(square(12, "cup"), joined=(20,))]
    crops = {12: Crops(1, 1, [Crop(0, "data:image/webp;base64,AAAA")])}
    page = labels_page("walk <1>", things, {3: "", 12: "mug"}, crops, {"labels": 1234})
    assert "walk &lt;1&gt;" in page and "1,234" in page and page.count("data:image/webp") == 1
    assert "object 12, with 20, found as cup: 1 pictures, 2 keyframes" in page and "left out" in page
    assert page.index("object 12") < page.index("object 3,")  # the one that is labelled most comes first


def test_a_run_without_objects_has_a_page_that_says_so() -> None:
    assert "No picture of this run shows" in labels_page("walk", [], {}, {}, {})
