# SPDX-License-Identifier: Apache-2.0
"""What may be exchanged: the verbs that a proposer, a scorer, a gate and a method of one's own must have.

`Engine(params, propose=…, score=…)` takes a proposer and a scorer; `align`, `Registrar` and `objreg_ros.register` take
a method and a gate. These are Protocols: whatever has the verb will do, and need not inherit anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # so that this file is light: the kernels need a second to load
    from objreg_ros.data.checked import Array
    from objreg_ros.data.closures import Alignment
    from objreg_ros.registration.candidate import Candidate
    from objreg_ros.registration.gate.verdict import Refusal
    from objreg_ros.registration.keyframe import Keyframe
    from objreg_ros.registration.prepare.prepared import Pair, Prepared
    from objreg_ros.registration.propose.prior import Prior
    from objreg_ros.registration.propose.shortlist import Shortlist


class Proposer(Protocol):
    """Where a pose may come from; `propose.shortlist.shortlist` is ours.

    ``T_target_source_prior (4, 4)`` is what odometry expects, or None. An empty shortlist where nothing is proposed.
    """

    def __call__(self, pair: Pair, T_target_source_prior: Array | None) -> Shortlist: ...


class Scorer(Protocol):
    """What is for and against a pose; `propose.evidence.gather` is ours.

    ``proposers`` came to the alignment, the first of them proposed it. A scorer decides nothing.
    """

    def __call__(
        self,
        source: Prepared,
        target: Prepared,
        alignment: Alignment,
        proposers: Iterable[str],
    ) -> Candidate: ...


class Gate(Protocol):
    """Says yes or no; `gate.verdict.judge` is ours.

    ``candidates`` are those of a method, best first, perhaps none; ``prior`` is what odometry expects, or None. The
    accepted candidate comes back, or ``(Reason, detail)``. Called from several threads.
    """

    def __call__(self, candidates: Sequence[Candidate], prior: Prior | None = None) -> Candidate | Refusal: ...


class Method(Protocol):
    """Finds poses between two keyframes; `engine.Engine` and `paper.PaperEngine` are ours.

    Called from several threads. A method decides nothing: the gate does.
    """

    def prepare(self, keyframe: Keyframe) -> object:
        """Compute what is needed of one keyframe, once; called before `propose` with each of the two."""

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target`` with their evidence, best first; empty where there is none.

        ``T_target_source_prior (4, 4)`` is what odometry expects, given where it is tight enough to start from.
        """
        ...
