# SPDX-License-Identifier: Apache-2.0
"""Label groups."""

from __future__ import annotations

import pytest

from objreg_ros.registration.labels import LabelGroups


def test_labels_of_one_group_share_its_name_and_others_stand_alone() -> None:
    groups = LabelGroups(("cup mouse", "book cell_phone"))
    assert groups.of("mouse") == groups.of("cup") == "cup"
    assert groups.of("cell phone") == "book"
    assert groups.of("chair") == "chair"


def test_a_label_in_two_groups_is_refused() -> None:
    with pytest.raises(ValueError, match="'cup' in two"):
        LabelGroups(("cup mouse", "bottle cup"))
