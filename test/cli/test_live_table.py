# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.data.closures import LoopClosure
from objreg_tools.cli.live import Live
from objreg_tools.cli.live_table import lines, require_balance
from objreg_tools.truth import summarise

CLOSURE = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=())
SENT = {"detector": 10, "segmenter": 10, "registrar": 6}


def counters(received: int, published: int, waiting: int = 0, **dropped: int) -> Balance:
    return Balance(received, published, waiting, dropped, {}, {"total": (1.5, 2.5)})


def live(detector: Balance) -> Live:
    nodes = {"detector": detector, "segmenter": counters(9, 6, 1, unmatched=2), "registrar": counters(6, 6)}
    return Live(nodes, {"texture_disagrees": 3}, (CLOSURE,), None)


def test_the_table_states_what_became_of_every_frame_that_was_sent() -> None:
    text = "\n".join(lines(live(counters(10, 8, overtaken=2)), SENT, summarise([(0.5, 1.25)])))
    rows = {line.split()[0]: line.split() for line in text.splitlines()[:4]}
    assert rows["detector"] == ["detector", "10", "10", "8", "0", "2", "overtaken"]
    assert rows["segmenter"][1:5] == ["10", "9", "6", "1"] and "1 lost on the way, 2 unmatched" in text
    assert "constraints: 1" in text and "rejected: 3 texture_disagrees" in text
    assert "true error: 0.50° 1.2 cm median" in text and "1 within 3° and 5 cm" in text


def test_without_truth_no_error_is_claimed() -> None:
    assert "true error: no constraint, or no ground truth" in list(lines(live(counters(10, 10)), SENT, summarise([])))


@pytest.mark.parametrize("detector", [counters(10, 8, overtaken=1), counters(11, 11)])
def test_counters_that_do_not_balance_are_refused(detector: Balance) -> None:
    with pytest.raises(ValueError, match="detector: expected in = out"):
        require_balance(live(detector), SENT)


def test_counters_that_balance_pass() -> None:
    require_balance(live(counters(10, 8, overtaken=2)), SENT)
