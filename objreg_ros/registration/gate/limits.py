# SPDX-License-Identifier: Apache-2.0
"""The limits of all checks, made from the parameters in this one place. The parameters say what each limit is for."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.registration.gate import (
    competing,
    free_space,
    lone_object,
    objects,
    observability,
    overlap,
    surroundings,
    view_score,
)
from objreg_ros.registration.params import RegistrarParams


class Limits(NamedTuple):
    """What every file of the gate needs; a single number where a check has one."""

    translation_m: float
    gravity_deg: float
    objects: objects.Limits
    overlap: overlap.Limits
    free_space: free_space.Limits
    correlation: float
    view_score: view_score.Limits
    surroundings: surroundings.Limits
    competing: competing.Limits
    appearance: lone_object.AppearanceLimits
    lone_object: lone_object.Limits
    observability: observability.Limits
    odometry_sigmas: float


def limits_of(params: RegistrarParams) -> Limits:
    """The limits that a user set."""
    return Limits(
        translation_m=params.max_translation,
        gravity_deg=params.max_gravity_error,
        objects=objects.Limits(params.min_objects_plain, params.min_chains, params.min_likeness_several),
        overlap=_overlap(params),
        free_space=free_space.Limits(params.max_violations, params.max_floating_alone, params.max_floating),
        correlation=params.min_texture,
        view_score=_view_score(params),
        surroundings=_surroundings(params),
        competing=competing.Limits(params.min_objects, params.rival_margin, params.min_margin_alone),
        appearance=_appearance(params),
        lone_object=_lone_object(params),
        observability=_observability(params),
        odometry_sigmas=params.odometry_sigmas,
    )


def _overlap(params: RegistrarParams) -> overlap.Limits:
    return overlap.Limits(params.min_tested, params.min_inliers)


def _view_score(params: RegistrarParams) -> view_score.Limits:
    return view_score.Limits(
        least=params.min_score,
        least_doubtful=params.min_score_doubtful,
        violations=params.max_violations_doubtful,
        firm_margin=params.firm_margin,
        silhouette_weight=params.likeness_weight,
    )


def _surroundings(params: RegistrarParams) -> surroundings.Limits:
    return surroundings.Limits(
        overlap=_overlap(params),
        violations=params.max_violations,
        correlation=params.min_texture,
        correlation_loss=params.max_fall_around,
        share=params.min_surroundings,
    )


def _appearance(params: RegistrarParams) -> lone_object.AppearanceLimits:
    return lone_object.AppearanceLimits(
        silhouette_score=params.min_likeness_alone,
        silhouette_score_with_grey=params.min_likeness_unrivalled,
        correlation=params.min_texture_painted,
        score_margin=params.min_margin_painted,
    )


def _lone_object(params: RegistrarParams) -> lone_object.Limits:
    return lone_object.Limits(
        tested=params.min_tested_alone,
        firmness=params.min_firmness_alone,
        yaw_bonus=params.object_bonus,
        objects=params.min_objects,
        proposers=params.min_chains,
    )


def _observability(params: RegistrarParams) -> observability.Limits:
    return observability.Limits(
        sigma_m=params.max_slack_sigma,
        range_m=params.far_range,
        least_margin=params.rival_margin,
        firm_margin=params.firm_margin,
        uncertain_factor=params.doubt_factor,
        perturbation_m=params.pushes[-1],
    )
