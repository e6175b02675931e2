# SPDX-License-Identifier: Apache-2.0
"""Two keyframes in, poses with their evidence out, and a verdict. No store, no ROS.

`align(source, target)` takes one pair from its keyframes to its verdict. The folders are its steps,
and each imports only those before it (`test/test_layers.py`):

kernels     where points land and which is the closest: compiled loops that all others begin with
shapes      one object upon another: silhouettes and their score, symmetry, the upright search
prepare     what is computed once a keyframe
score       how well a pose fits: free space, photometric, object matches, surroundings
refine      refinement of many poses and of one: point to plane, then grey
certainty   how well a pose is known: covariance, degenerate directions, perturbations, gravity
propose     hypotheses, the shortlist of them, their end and their evidence, competing ones
gate        the only place that says yes

`keyframe` is what goes in, `candidate` a pose with its evidence, `result` what comes out with the verdict;
`labels` are the names that a detector confuses, `params` what a user may set, `api` the Protocols of what
may be exchanged. `engine` calls the steps in order; `paper` is the founding method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from objreg_ros.registration.api import Gate, Method
    from objreg_ros.registration.keyframe import Keyframe
    from objreg_ros.registration.params import RegistrationParams
    from objreg_ros.registration.propose.prior import Prior
    from objreg_ros.registration.result import Registration

__all__ = ["align", "gate_of", "method_of"]


def align(
    source: Keyframe,
    target: Keyframe,
    prior: Prior | None = None,
    params: RegistrationParams | None = None,
    method: Method | None = None,
    gate: Gate | None = None,
) -> Registration:
    """Register one pair: from two keyframes to the verdict.

    ``T_target_source`` of what comes back maps points of the source's camera into the target's. ``prior`` is what
    odometry expects, with its deviations (`propose.prior.expect`): a pose starts from it where it is tight, and is
    refused where it disagrees. ``method`` is that of ``params`` where None, ``gate`` is `gate.verdict.judge` with
    the limits of ``params``. Where the answer is no, ``accepted`` is False, and ``reason``, ``detail`` and
    ``evidence`` say why. The same input gives the same answer. The imports are inside: they load the compiled kernels.
    """
    from objreg_ros.registration.candidate import Candidate
    from objreg_ros.registration.certainty.covariance import covariance_of
    from objreg_ros.registration.params import RegistrationParams
    from objreg_ros.registration.result import AcceptedRegistration, RefusedRegistration, evidence_of

    params = params or RegistrationParams()
    method, gate = method or method_of(params), gate or gate_of(params)
    for keyframe in (source, target):
        method.prepare(keyframe)
    start = prior.T_target_source if prior is not None and prior.tight() else None
    candidates = method.propose(source, target, start)  # proposed, aligned and scored, with their certainty
    verdict = gate(candidates, prior)
    if isinstance(verdict, Candidate):
        T, C, evidence = verdict.T_target_source, covariance_of(verdict, params), evidence_of(verdict)
        return AcceptedRegistration(T_target_source=T, covariance=C, evidence=evidence, candidate=verdict)
    (reason, detail), best = verdict, next(iter(candidates), None)
    evidence = {} if best is None else evidence_of(best)
    return RefusedRegistration(reason=reason, detail=detail, evidence=evidence, candidate=best)


def method_of(params: RegistrationParams) -> Method:
    """The method that ``params.method`` names, ready for any number of pairs."""
    from objreg_ros.registration.engine import Engine
    from objreg_ros.registration.paper import PaperEngine

    return PaperEngine(params) if params.method == "paper" else Engine(params)


def gate_of(params: RegistrationParams) -> Gate:
    """Our gate with the limits that ``params`` set."""
    from functools import partial

    from objreg_ros.registration.gate.limits import limits_of
    from objreg_ros.registration.gate.verdict import judge

    return partial(judge, limits=limits_of(params))
