# SPDX-License-Identifier: Apache-2.0
"""Parameters that the release before this one had. Each is refused with the name of the constant that took its place.

One who needs another value changes the constant, or brings a gate of their own (`api.Gate`). This file goes with the
next release.
"""

from __future__ import annotations

CONSTANT_OF = {
    "keyframes/fusion.py": {
        "object_voxel": "OBJECT_VOXEL_M",
        "context_radius": "CONTEXT_RADIUS_M",
        "context_voxel": "CONTEXT_VOXEL_M",
    },
    "keyframes/own_size.py": {"object_points": "OBJECT_POINTS"},
    "keyframes/keyframer.py": {
        "keyframe_min_objects": "LEAST_OBJECTS",
        "keyframe_frames": "MOST_FRAMES",
        "gravity_metres": "GRAVITY_PATH_M",
        "gravity_degrees": "GRAVITY_TURN_DEG",
    },
    "memory/landmarks.py": {
        "landmark_radius": "RADIUS_M",
    },
    "registrar/node.py": {
        "patience": "PATIENCE_S",
        "waiting_keyframes": "WAITING_KEYFRAMES",
        "waiting_megabytes": "WAITING_BYTES",
    },
    "registration/certainty/covariance.py": {
        "covariance_disliked": "SCALE_GROWTH",
        "covariance_rmse": "REFERENCE_RMSE_M",
        "covariance_floor_translation": "LEAST_SIGMA_M",
        "covariance_floor_rotation": "LEAST_SIGMA_DEG",
        "slack_translation": "DEGENERATE_SIGMA_M",
        "slack_rotation": "DEGENERATE_SIGMA_DEG",
    },
    "registration/gate/gravity.py": {
        "max_gravity_error": "SIGMAS",
    },
    "registration/certainty/observability.py": {
        "pushes": "PERTURBATIONS_M",
        "doubtful_sigma": "DOUBTFUL_SIGMA_M",
        "search_step": "SEARCH_STEP_M",
        "search_steps": "SEARCH_STEPS",
        "search_turns": "SEARCH_TURNS_DEG",
        "searched": "SEARCHED",
        "steadying_texture": "HOLDING_CORRELATION",
        "steadying_push": "HOLDING_PERTURBATION_M",
    },
    "registration/certainty/sandwich.py": {
        "covariance_patch": "PATCH_M",
    },
    "registration/engine.py": {
        "holding_likeness": "HOLDING_SILHOUETTE_SCORE",
    },
    "registration/gate/competing.py": {
        "min_margin_alone": "LEAST_MARGIN",
    },
    "registration/gate/free_space.py": {
        "max_floating": "Limits.certain",
        "max_floating_alone": "Limits.certain",
        "max_violations": "Limits.violations",
    },
    "registration/gate/kinds.py": dict.fromkeys(
        (
            *("min_tested_alone", "min_firmness_alone", "min_chains"),
            *("min_likeness_alone", "min_likeness_unrivalled", "min_texture_painted", "min_margin_painted"),
            *("min_likeness_several", "doubt_factor", "firm_margin", "max_slack_sigma", "far_range", "min_tested"),
            *("min_inliers", "min_texture", "min_score_doubtful", "max_violations_doubtful"),
        ),
        "KINDS",
    ),
    "registration/gate/objects.py": {
        "min_objects": "SEVERAL",
    },
    "registration/gate/odometry.py": {
        "odometry_sigmas": "SIGMAS",
    },
    "registration/gate/surroundings.py": {
        "min_surroundings": "Limits.score",
        "max_fall_around": "Limits.correlation_loss",
    },
    "registration/kernels/same_pose.py": {
        "agreement_rotation": "AGREEING",
        "agreement_translation": "AGREEING",
    },
    "registration/paper.py": {
        "paper_distance": "PAIR_DISTANCE_M",
        "paper_iterations": "ITERATIONS",
        "paper_tolerance": "TOLERANCE_M",
    },
    "registration/prepare/prepared.py": {
        "feature_voxel": "FEATURE_VOXEL_M",
        "feature_radius": "FEATURE_RADIUS_M",
        "feature_points": "FEATURE_POINTS",
        "shape_points": "SHAPE_POINTS",
        "scene_points": "SCENE_POINTS",
        "surface_voxel": "SURFACE_VOXEL_M",
        "thing_voxel": "OBJECT_VOXEL_M",
        "thing_points": "OBJECT_POINTS",
        "grid_cell": "GRID_CELL_M",
        "grid_reach": "GRID_REACH_M",
    },
    "registration/prepare/views.py": {
        "detail_sigma": "DETAIL_SIGMA_PX",
    },
    "registration/propose/competing_hypotheses.py": {
        "turns_around": "TURNS_DEG",
        "searched_around": "REFINED",
    },
    "registration/propose/evidence.py": {
        "finished_margin": "FINISHED_MARGIN",
        "object_bonus": "OBJECT_BONUS",
        "likeness_reach": "NEARBY_M",
        "min_objects_plain": "MANY_MATCHES",
        "rival_margin": "CONSIDERED_MARGIN",
    },
    "registration/propose/fine_search.py": {
        "scrutinised": "SEARCHED",
        "scrutiny_steps": "SIMPLEX_EVALUATIONS",
    },
    "registration/propose/hypotheses.py": {
        "feature_matches": "FEATURE_MATCHES",
        "centroid_tolerance": "CENTROID_TOLERANCE_M",
        "seeds_per_chain": "HYPOTHESES_PER_PROPOSER",
        "yaw_steps": "YAW_STEPS",
        "seeds_per_object_chain": "HYPOTHESES_PER_OBJECT",
    },
    "registration/propose/object_poses.py": {
        "scene_seeds": "CENTROID_POSES",
        "drawn": "ALIGNED",
        "drawing_points": "ALIGNED_POINTS",
        "drawing_rounds": "ALIGNED_ITERATIONS",
        "drawing_reach": "ALIGNED_REACH_M",
        "scrutiny_worth": "FINE_SEARCH_BELOW",
    },
    "registration/propose/prior.py": {
        "prior_translation": "TIGHT_TRANSLATION_M",
        "prior_rotation": "TIGHT_ROTATION_DEG",
    },
    "registration/propose/refinement.py": {
        "grey_rounds": "PHOTOMETRIC_ROUNDS",
        "slack_share": "DEGENERATE_SHARE",
        "holding_texture": "HOLDING_CORRELATION",
    },
    "registration/propose/shortlist.py": {
        "refined_per_chain": "REFINED_PER_PROPOSER",
        "finished": "FINISHED",
        "first_look": "FIRST_LOOK",
        "near_per_chain": "LOOKED_AT_AGAIN",
        "quick_points": "BASIN_POINTS",
    },
    "registration/refine/batch_icp.py": {
        "reaches": "REACHES_M",
        "iterations": "ITERATIONS",
        "min_points": "LEAST_PAIRS",
    },
    "registration/refine/photometric_icp.py": {
        "grey_sigma": "GREY_SIGMA",
        "shape_sigma": "SURFACE_SIGMA_M",
    },
    "registration/score/comparison.py": {
        "likeness_weight": "SILHOUETTE_WEIGHT",
        "telling_grey": "TELLING_GREY",
    },
    "registration/score/object_matches.py": {
        "explained_distance": "MATCHED_DISTANCE_M",
        "explained_share": "MATCHED_SHARE",
    },
    "registration/score/total_score.py": {
        "upright_likeness": "SILHOUETTE_WEIGHT_UPRIGHT",
        "upright_violations": "VIOLATION_WEIGHT_UPRIGHT",
        "climb_points": "CLIMB_POINTS",
        "climb_turns": "CLIMB_TURNS_DEG",
    },
    "registration/score/view_score.py": {
        "quick_sample": "RANKING_POINTS",
        "grey_points": "PHOTOMETRIC_POINTS",
        "min_score": "LEAST_SCORE",
    },
    "registration/shapes/silhouette_score.py": {
        "shape_violations": "VIOLATION_WEIGHT",
        "shape_hidden": "OCCLUSION_WEIGHT",
        "shape_residual": "RESIDUAL_WEIGHT",
        "shape_grey": "GREY_WEIGHT",
        "shape_grey_expected": "GREY_NEUTRAL",
        "shape_grey_noise": "GREY_NOISE",
    },
    "registration/shapes/symmetry.py": {
        "symmetry_share": "TURN_SHARE",
        "symmetry_violations": "TURN_VIOLATIONS",
    },
    "registration/shapes/upright_search.py": {
        "glance_yaws": "COARSE_YAWS",
        "glance": "COARSE_POINTS",
        "shape_yaws": "YAWS",
        "shape_offset": "DEPTH_SHARE",
        "shape_glance": "RANKING_POINTS",
        "shape_kept": "REFINED",
        "shape_climbed": "CLIMBED",
        "shape_margin": "SCORE_MARGIN",
        "shape_rounds": "CLIMB_ROUNDS",
    },
    "sensor.py": {
        "gravity_noise": "MANY_VIEWS_DEG",
        "depth_noise": "DEPTH_NOISE_M",
        "depth_noise_growth": "DEPTH_NOISE_GROWTH",
        "depth_warp": "DEPTH_WARP",
        "depth_tolerance": "DEPTH_TOLERANCE_M",
        "depth_tolerance_growth": "DEPTH_TOLERANCE_GROWTH",
    },
}
"""By the file below `objreg_ros/`: the name of a parameter, and that of the constant."""

DROPPED = {
    name: f"it is fixed now: {constant} in objreg_ros/{file}"
    for file, constants in CONSTANT_OF.items()
    for name, constant in constants.items()
}
"""What to say of each."""
