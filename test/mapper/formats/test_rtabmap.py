# SPDX-License-Identifier: Apache-2.0
"""The numbers that RTAB-Map gets, and the ones that would abort it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint
from objreg_mapper.formats.rtabmap import fill_landmark, fill_link

from .blank import CONSTRAINT, LOCAL_INFORMATION_DIAGONAL, QUARTER_LEFT, blank, numbers

HALF = np.sqrt(0.5)


def test_a_link_is_a_user_closure_with_the_pose_of_to_in_from() -> None:
    link = fill_link(SimpleNamespace(transform=blank()), CONSTRAINT, from_id=12, to_id=97)
    assert (link.from_id, link.to_id, link.type) == (12, 97, 4)
    assert numbers(link.transform) == pytest.approx([1, 2, 3, 0, 0, HALF, HALF])


def test_the_information_is_the_inverse_covariance_translation_first() -> None:
    link = fill_link(SimpleNamespace(transform=blank()), CONSTRAINT, from_id=12, to_id=97)
    information = np.array(link.information).reshape(6, 6)
    np.testing.assert_allclose(information, np.diag(LOCAL_INFORMATION_DIAGONAL), atol=1e-12)


def test_what_would_abort_rtabmap_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected two nodes .* got 5, 5"):
        fill_link(SimpleNamespace(transform=blank()), CONSTRAINT, from_id=5, to_id=5)
    broken = Constraint(QUARTER_LEFT, np.diag([np.nan, 1, 1, 1, 1, 1]))
    with pytest.raises(ValueError, match="positive diagonal"):
        fill_link(SimpleNamespace(transform=blank()), broken, from_id=5, to_id=6)


def test_a_landmark_is_a_point_with_an_id_above_zero() -> None:
    message = SimpleNamespace(pose=SimpleNamespace(pose=blank(), covariance=None))
    fill_landmark(message, 3, np.array([0.1, 0.2, 0.9]), sigma=0.02)
    assert message.id == 3
    assert numbers(message.pose.pose) == pytest.approx([0.1, 0.2, 0.9, 0, 0, 0, 1])
    assert message.pose.covariance[::7] == pytest.approx([0.0004] * 3 + [9999.0] * 3)
    with pytest.raises(ValueError, match="at least 1, got 0"):
        fill_landmark(message, 0, np.zeros(3), sigma=0.02)


@pytest.mark.parametrize("sigma", [0.0, -0.1, np.inf, np.nan])
def test_a_sigma_that_rtabmap_would_replace_by_its_own_is_refused(sigma: float) -> None:
    with pytest.raises(ValueError, match="sigma above 0 m"):
        fill_landmark(SimpleNamespace(), 3, np.zeros(3), sigma)
