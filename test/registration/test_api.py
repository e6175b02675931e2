# SPDX-License-Identifier: Apache-2.0
"""The Protocols: what is ours has their verbs, and to know them loads no kernel."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest

from objreg_ros.registration import api
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.paper import PaperEngine
from objreg_ros.registration.propose.evidence import gather
from objreg_ros.registration.propose.shortlist import shortlist


@pytest.mark.parametrize(("protocol", "ours"), [(api.Gate, judge), (api.Proposer, shortlist), (api.Scorer, gather)])
def test_our_function_takes_what_its_protocol_says_in_that_order(protocol: type, ours: object) -> None:
    wanted = list(inspect.signature(protocol.__call__).parameters)[1:]
    taken = inspect.signature(ours).parameters  # type: ignore[arg-type]
    assert list(taken)[: len(wanted)] == wanted
    assert all(more.default is not more.empty for more in list(taken.values())[len(wanted) :])


@pytest.mark.parametrize("method", [Engine, PaperEngine])
@pytest.mark.parametrize("verb", ["prepare", "propose"])
def test_our_methods_have_the_verbs_of_a_method(method: type, verb: str) -> None:
    wanted = inspect.signature(getattr(api.Method, verb)).parameters
    assert list(inspect.signature(getattr(method, verb)).parameters) == list(wanted)


def test_the_protocols_load_no_kernel() -> None:
    code = "import sys, objreg_ros.registration.api; sys.exit('objreg_ros.native' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
