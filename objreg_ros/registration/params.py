# SPDX-License-Identifier: Apache-2.0
"""The parameters of the registrar."""

from __future__ import annotations

import math
from dataclasses import dataclass

from objreg_ros.geometry import Array, mounting
from objreg_ros.params import Params, param


@dataclass(frozen=True)
class RegistrarParams(Params):
    """Everything that a user may set in this room."""

    method: str = param(
        "objreg", "how keyframes are registered; paper is the founding point-to-point ICP", choices=("objreg", "paper")
    )
    seed: int = param(0, "seed of what a registration draws at random", ge=0)

    store: str = param("", "the SQLite file that remembers; empty: memory only, forgotten at the end")
    max_views: int = param(8, "views of one object that are kept, the most diverse", ge=1)
    max_keyframes: int = param(20000, "most keyframes that are kept; the oldest go first", ge=1)
    landmark_radius: float = param(0.10, "an object seen again within this is the same one", "m", ge=0.0)

    # What becomes a keyframe, and what it keeps.
    keyframe_translation: float = param(0.15, "motion that ends a keyframe", "m", ge=0.0)
    keyframe_rotation: float = param(8.0, "rotation that ends a keyframe", "deg", ge=0.0, le=180.0)
    keyframe_seconds: float = param(1.0, "longest time that a keyframe spans", "s", ge=0.0)
    max_speed: float = param(5.0, "odometry that leaps faster than this has begun anew: another session", "m/s", ge=0.1)
    keyframe_min_objects: int = param(1, "least number of objects of a keyframe", ge=1)
    keyframe_frames: int = param(4, "most frames that are fused into one keyframe", ge=1, le=30)
    object_voxel: float = param(0.004, "edge of a voxel when sightings of an object are fused", "m", ge=0.001, le=0.05)
    object_points: int = param(2000, "most points of an object that are kept", ge=100)
    context_radius: float = param(1.0, "how far around an object the context reaches", "m", ge=0.1)
    context_voxel: float = param(0.03, "edge of a voxel of the context", "m", ge=0.005, le=0.2)
    gravity_metres: float = param(
        2.0, "path over which odometry carries what earlier views told of gravity", "m", ge=0.01
    )
    gravity_degrees: float = param(
        120.0, "turn over which odometry carries what earlier views told of gravity", "deg", ge=0.1
    )
    gravity_noise: float = param(0.5, "standard deviation of gravity carried over such a way or turn", "deg", ge=0.01)
    context_range: float = param(4.0, "context farther from the camera is left out", "m", ge=0.5)

    # Which stored keyframes a new one is compared with.
    label_groups: tuple[str, ...] = param(
        ("cup mouse bottle", "book remote cell_phone", "tv laptop"),
        "labels that detectors confuse: one group an item, spaces between (an underscore for a space in a name)",
    )
    min_gap: float = param(2.0, "least time between the two moments of a constraint", "s", ge=0.0)
    odometry_radius: float = param(
        1.0, "stored objects of the session that odometry puts farther away are not tried", "m", ge=0.0
    )
    odometry_translation_noise: float = param(
        0.03, "standard deviation of odometry's position over no distance", "m", ge=0.0
    )
    odometry_rotation_noise: float = param(
        1.0, "standard deviation of odometry's rotation over no distance", "deg", ge=0.0
    )
    odometry_drift: float = param(
        0.1, "growth of the deviation of odometry's position with each metre of path", "m/m", ge=0.0
    )
    odometry_rotation_drift: float = param(
        0.05, "growth of the deviation of odometry's rotation with each degree turned", "deg/deg", ge=0.0
    )
    prior_translation: float = param(0.20, "odometry whose position is less certain proposes no pose", "m", ge=0.0)
    prior_rotation: float = param(6.0, "odometry whose rotation is less certain proposes no pose", "deg", ge=0.0)
    thin_seconds: float = param(1.0, "two closures are one if both their ends are nearer than this", "s", ge=0.0)
    closures: int = param(2, "accepted closures of one keyframe that end its search", ge=1)
    threads: int = param(2, "stored keyframes that are tried at once", ge=1, le=16)
    candidates: int = param(4, "stored keyframes that are tried for each new one, best first", ge=1, le=100)

    # How a pose is found and looked at.
    feature_voxel: float = param(0.07, "distance of the points that carry a local feature", "m", ge=0.01, le=0.2)
    feature_radius: float = param(0.35, "how far a local feature looks", "m", ge=0.03, le=1.0)
    feature_points: int = param(800, "most points that are matched by their local features", ge=10)
    feature_matches: int = param(900, "most matches of local features that are considered", ge=10)
    centroid_tolerance: float = param(0.12, "how far the middle of one object may differ between views", "m", ge=0.01)
    seeds_per_chain: int = param(120, "hypotheses that each chain proposes", ge=1)
    yaw_steps: int = param(36, "yaw angles that are tried for one object upon another", ge=4, le=360)
    glance_yaws: int = param(12, "yaw angles that one object is laid upon another with at a glance", ge=1, le=360)
    glance: int = param(100, "points a side by which poses of one object upon another are ranked at a glance", ge=20)
    seeds_per_object_chain: int = param(60, "hypotheses that the chain of single objects proposes", ge=1)
    shape_points: int = param(400, "most points of an object that are laid upon another", ge=30)
    scene_points: int = param(
        800, "most points of all objects of a keyframe together that are laid upon another's", ge=30
    )
    shape_yaws: int = param(16, "yaw angles that one object is laid upon another with", ge=1, le=360)
    shape_offset: float = param(
        0.1, "how much deeper the middle of an object is taken to lie than what is seen of it, in its widths", ge=0.0
    )
    shape_glance: int = param(
        100, "points a side by which poses of objects are ranked before the best are refined", ge=20
    )
    shape_kept: int = param(4, "poses of objects that are refined", ge=1)
    shape_climbed: int = param(2, "best poses of objects, from which the score is climbed to its maximum", ge=1)
    shape_margin: float = param(
        0.5, "score or worth below the best at which a pose of objects is neither climbed nor drawn to the room", ge=0.0
    )
    shape_rounds: int = param(8, "most rounds of the climb of an object's pose", ge=0)
    scene_seeds: int = param(8, "poses that the middles of the objects propose for all together", ge=0)
    drawn: int = param(2, "best upright poses that are drawn to where the room fits", ge=1)
    drawing_points: int = param(300, "points of everything seen by which a pose is drawn to where the room fits", ge=20)
    drawing_rounds: int = param(10, "most iterations in which a pose is drawn to where the room fits", ge=0)
    drawing_reach: float = param(
        0.06, "a pose stays as it was if drawing it to the room moves the objects farther", "m", ge=0.0
    )
    upright_likeness: float = param(1.0, "what likeness adds to V when upright poses of objects are compared", ge=0.0)
    upright_violations: float = param(
        5.0, "weight of seen free space, beyond its weight in V, when upright poses are compared", ge=0.0
    )
    climb_points: int = param(120, "points a side, of objects and of views, by which an upright pose is climbed", ge=20)
    climb_turns: tuple[float, ...] = param(
        (3.0, 6.0, 10.0, 15.0, 20.0, 25.0),
        "turns about the objects, either way, with which the climb of an upright pose may begin",
        "deg",
    )
    scrutiny_worth: float = param(
        1.0, "worth below which the best pose of an object alone is looked at more closely; -3: never", ge=-3.0
    )
    scrutinised: int = param(2, "best poses of an object that are looked at more closely, and climbed then", ge=1)
    scrutiny_steps: int = param(32, "poses that a closer climb may look at", ge=4)
    shape_violations: float = param(
        12.0, "weight of an object's points in seen free space, in the score of its pose", ge=0.0
    )
    shape_hidden: float = param(
        0.6, "weight of an object's points behind what was seen, in the score of its pose", ge=0.0
    )
    shape_residual: float = param(
        1.2, "weight of squared distances from what was seen, in the score of an object's pose", ge=0.0
    )
    shape_grey: float = param(3.0, "weight of the grey's correlation in the score of an object's pose", ge=0.0)
    shape_grey_expected: float = param(0.3, "correlation of grey that says nothing", ge=-1.0, le=1.0)
    shape_grey_noise: float = param(12.0, "standard deviation of grey that is noise", ge=0.1)
    surface_voxel: float = param(0.03, "distance of the points of a surface that others are aligned to", "m", ge=0.005)
    thing_voxel: float = param(0.012, "distance of the points of objects, which are aligned too", "m", ge=0.002)
    thing_points: int = param(400, "most points of the objects that are aligned", ge=0)
    grid_cell: float = param(0.05, "cell of the grid that knows the closest point", "m", ge=0.01, le=0.2)
    grid_reach: float = param(0.20, "how far from a surface its grid reaches", "m", ge=0.02)
    refined_per_chain: int = param(5, "hypotheses of each chain that are refined to the end", ge=1)
    finished: int = param(3, "hypotheses of all chains that grey finishes and the gate sees", ge=1)
    first_look: tuple[int, ...] = param(
        (150, 5, 150), "points, iterations and views' points a side of a first look", ge=1, counts=(3,)
    )
    near_per_chain: int = param(24, "hypotheses of each chain that are looked at again", ge=1)
    finished_margin: float = param(0.5, "worth below the best at which a hypothesis is not finished", ge=0.0)
    quick_sample: int = param(500, "points a side that rank the hypotheses", ge=50)
    quick_points: int = param(500, "points that bring a hypothesis to its basin", ge=50)
    reaches: tuple[float, ...] = param(
        (0.2, 0.1, 0.06), "distance of a pair at first, in the basin, at the end", "m", ge=0.001, counts=(3,)
    )
    iterations: int = param(15, "most iterations of one round of refinement", ge=1)
    min_points: int = param(60, "least number of paired points that hold a pose", ge=6)
    grey_points: int = param(2500, "points a side whose grey ends a refinement", ge=100)
    grey_sigma: float = param(0.7, "difference of the high-passed grey that counts little, in its deviations", ge=0.01)
    grey_rounds: int = param(3, "most times that grey finishes a pose, coarse to fine", ge=1)
    shape_sigma: float = param(0.03, "distance from a surface that weighs as much", "m", ge=0.001)
    depth_noise: float = param(0.0012, "standard deviation of depth at 0.4 m", "m", ge=1e-5)
    depth_noise_growth: float = param(
        0.0019, "growth of the deviation of depth with the square of the depth beyond 0.4 m", "1/m", ge=0.0
    )
    slack_share: float = param(
        0.01, "a direction that a smaller share of the surface resists is free to slide", ge=0.0, le=0.3
    )
    pushes: tuple[float, ...] = param(
        (0.05, 0.1, 0.15),
        "how far a pose is pushed along a free direction; what the views like less is held there",
        "m",
        ge=0.001,
        counts=(1, 2, 3, 4, 5),
    )
    depth_warp: float = param(
        0.005, "error of depth that a patch of surface shares, as a share of its distance", ge=0.0, le=0.1
    )
    doubtful_sigma: float = param(
        0.006, "a position that is known less well than this is pushed as far as the last of the pushes", "m", ge=0.0
    )
    search_step: float = param(
        0.05,
        "step of the search for a better place about a doubtful position, in the plane where it may err, and for other "
        "poses about a lone object's",
        "m",
        ge=0.01,
    )
    search_steps: int = param(
        4,
        "steps each way of these searches; 0: none about a doubtful position, turns alone about a lone object",
        ge=0,
        le=10,
    )
    search_turns: tuple[float, ...] = param(
        (5.0,), "turns about the objects, each way, from which grey finishes a doubtful pose too", "deg"
    )
    turns_around: tuple[float, ...] = param(
        (5.0, 10.0, 15.0),
        "turns about a lone object, each way, of the grid in which other poses that views like are looked for, beside "
        "no turn; its shifts are those of search_step",
        "deg",
    )
    searched_around: int = param(
        4, "best starts about a lone object's pose that are finished; 0: no search there", ge=0
    )
    searched: int = param(2, "best places of the search about a doubtful position that grey finishes", ge=1)
    steadying_texture: float = param(
        0.5, "correlation of grey from which on a position is held as far as pushes are resisted", ge=0.0, le=1.0
    )
    steadying_push: float = param(
        0.06, "longest push until the views like a pose less at which grey still steadies a position", "m", ge=0.0
    )
    holding_texture: float = param(
        0.45, "correlation of grey from which on it holds what shape lets slide", ge=0.0, le=1.0
    )
    holding_likeness: float = param(
        0.3, "likeness of an object from which on it holds what shape lets slide", ge=-1.0, le=1.0
    )
    symmetry_share: float = param(
        0.16, "an object has no yaw if a smaller share of its surface resists a turn", ge=0.0, le=1.0
    )
    symmetry_violations: float = param(
        0.14,
        "an object has a yaw after all if so much of it, turned about its axis, is where its camera saw through",
        ge=0.0,
        le=1.0,
    )
    depth_tolerance: float = param(0.02, "depths this close agree, at the camera", "m", ge=0.001)
    depth_tolerance_growth: float = param(
        0.006, "growth of the tolerance of depth with the square of depth", "1/m", ge=0.0
    )
    detail_sigma: float = param(3.0, "blur that the high pass of grey takes away", "px", ge=0.5)
    agreement_rotation: float = param(5.0, "chains agree within this rotation", "deg", ge=0.0)
    agreement_translation: float = param(0.15, "chains agree within this distance", "m", ge=0.0)
    object_bonus: float = param(
        0.25,
        "what an explained object adds to V when candidates are ranked, and a lone one that tells its yaw where a pose "
        "must be firm (see min_firmness_alone)",
        ge=0.0,
    )
    likeness_weight: float = param(
        0.5,
        "what the likeness of explained objects adds to V; at most, where poses near each other are compared",
        ge=0.0,
    )
    likeness_reach: float = param(
        0.06, "how far along each axis an object may stand where it looks most alike, to tell what it is", "m", ge=0.0
    )
    telling_grey: float = param(
        1000.0,
        "n r / (1 - r^2), of n points (2 grey_points at most) whose grey correlates by r, beyond which objects have "
        "less say in where exactly a pose is",
        ge=0.0,
    )
    explained_distance: float = param(0.06, "an object is explained when its two middles are this close", "m", ge=0.0)
    explained_share: float = param(
        0.28,
        "share of its extent that an object's middle may be farther, since a large thing is never seen whole",
        ge=0.0,
    )

    # The founding method.
    paper_distance: float = param(
        0.10, "pairs of points farther apart are rejected by the founding method", "m", ge=0.001
    )
    paper_iterations: int = param(100, "most iterations of the founding method", ge=1)
    paper_tolerance: float = param(
        1e-6, "change of the root mean square distance that ends the iterations of the founding method", "m", ge=0.0
    )

    # What decides a closure.
    min_tested: int = param(600, "least number of pixels that both views must see", ge=1)
    min_tested_alone: int = param(
        2000,
        "least number of pixels that both views must see for a lone object's pose that fewer than min_chains proposed",
        ge=1,
    )
    min_inliers: float = param(0.35, "least share of tested pixels whose depth agrees", ge=0.0, le=1.0)
    max_violations: float = param(0.07, "largest share of tested pixels in seen free space", ge=0.0, le=1.0)
    max_floating: float = param(
        0.015,
        "largest share of tested pixels far in seen free space, where fewer than min_objects_plain are explained",
        ge=0.0,
        le=1.0,
    )
    max_floating_alone: float = param(
        0.012,
        "largest share of tested pixels far in seen free space, where a single object is explained or several look "
        "otherwise",
        ge=0.0,
        le=1.0,
    )
    min_texture: float = param(0.3, "least correlation of the high-passed grey, where there is grey", ge=-1.0, le=1.0)
    min_score: float = param(0.10, "least verification score V", ge=-3.0, le=2.0)
    min_score_doubtful: float = param(
        0.40,
        "the most that is asked of V, with what likeness adds, where a pose is doubtful: where more than "
        "max_violations_doubtful floats (see firm_margin), or a lone object's that fewer than min_chains proposed was "
        "not pushed",
        ge=-3.0,
        le=2.0,
    )
    min_firmness_alone: float = param(
        1.0,
        "least V, together with what it falls by over a push, of a lone object's pose that fewer than min_chains "
        "proposed; one that is known within doubtful_sigma is not pushed, and needs no more than min_score_doubtful",
        ge=-3.0,
    )
    min_surroundings: float = param(
        0.15,
        "least share of what both views see that is not of a lone object that fewer than min_chains proposed and that "
        "fills much of either: what moved and fills the view agrees with itself",
        ge=0.0,
        le=1.0,
    )
    max_violations_doubtful: float = param(
        0.02, "share of tested pixels in seen free space for which V need not make up", ge=0.0, le=1.0
    )
    max_fall_around: float = param(
        0.25,
        "most by which the grey may correlate less without the one or two objects that a pose is of, where they fill "
        "much of a view: what moved carries its print along",
        ge=0.0,
    )
    doubt_factor: float = param(
        1.5,
        "how many times as much V must fall over a push where several objects look otherwise (see "
        "min_likeness_several), or fewer than min_chains brought fewer than min_objects_plain together",
        ge=1.0,
    )
    firm_margin: float = param(
        0.4,
        "fall of V over a push from which on views hold a pose however badly surfaces know it; where something floats, "
        "the least V is min_score and what the fall lacks of this",
        ge=0.0,
    )
    rival_margin: float = param(
        0.1,
        "a candidate this much below the best in V is not considered, over a push V must fall by as much at least, and "
        "so much more than another possible pose must that of several objects be worth",
        ge=0.0,
    )
    min_chains: int = param(2, "chains that must agree on a lone object's pose for it not to be doubtful", ge=1)
    min_objects: int = param(2, "explained objects that need no more evidence than the views; a lone one does", ge=1)
    min_objects_plain: int = param(
        3,
        "explained objects that make up for grey that does not correlate, as on a plain table, and for what floats",
        ge=1,
    )
    min_likeness_alone: float = param(0.1, "least likeness of a lone object where grey is missing", ge=-1.0, le=1.0)
    min_margin_alone: float = param(
        0.2, "least worth of a lone object's pose above that of any other that may be, if all hidden agreed", ge=0.0
    )
    min_likeness_unrivalled: float = param(
        -0.2,
        "least likeness of a lone object where there is grey, unless that confirms the pose (see min_margin_painted)",
        ge=-1.0,
        le=1.0,
    )
    min_likeness_several: float = param(
        0.0, "least likeness of several objects, below which they look otherwise", ge=-1.0, le=1.0
    )
    min_texture_painted: float = param(
        0.5,
        "least correlation of grey that confirms a pose where the lone object does not, or tells no yaw",
        ge=-1.0,
        le=1.0,
    )
    min_margin_painted: float = param(
        0.45, "least worth above that of any other pose where grey, but not the lone object, confirms it", ge=0.0
    )
    max_gravity_error: float = param(3.5, "largest angle between the gravities", "deg", ge=0.0, le=180.0)
    max_translation: float = param(5.0, "largest distance between the two cameras", "m", ge=0.0)
    max_slack_sigma: float = param(
        0.03, "standard deviation of a position beyond which the views must resist a push more", "m", ge=0.001
    )
    far_range: float = param(
        2.5,
        "mean distance of both cameras from the middle of what is seen beyond which views must resist a push more, by "
        "its square: from afar a turn and a shift look alike",
        "m",
        ge=0.1,
    )
    odometry_sigmas: float = param(4.0, "largest distance from odometry in its standard deviations", ge=0.0)

    # How wrong an accepted pose may be; config/covariance.yaml says how these were calibrated.
    covariance_scale: float = param(
        0.45, "factor of the covariance of a registration liked by 1 and with an rmse of covariance_rmse", ge=0.0
    )
    covariance_disliked: float = param(
        2.4, "growth of the logarithm of covariance_scale for each 1 that the views like a pose less", ge=0.0, le=10.0
    )
    covariance_rmse: float = param(
        0.0065, "rmse of the residuals at which covariance_scale holds; it grows in proportion", "m", ge=1e-4
    )
    covariance_patch: float = param(0.8, "edge of a patch of surface whose points err together", "m", ge=0.01)
    covariance_calibration: float = param(
        0.035, "error of a motion, as a share of it, by a camera that is not quite as its calibration says", ge=0.0
    )
    covariance_floor_translation: float = param(0.001, "least standard deviation of each axis", "m", ge=1e-4)
    covariance_floor_rotation: float = param(0.025, "least standard deviation of each axis", "deg", ge=1e-3)
    slack_translation: float = param(0.5, "standard deviation along a free direction of translation", "m", ge=0.0)
    slack_rotation: float = param(60.0, "standard deviation about a free axis", "deg", ge=0.0)


@dataclass(frozen=True)
class RegistrarNodeParams(Params):
    """How the registrar's node brings its inputs together."""

    odom_slop: float = param(
        0.02,
        "largest distance in time between a frame and its odometry, unless two within seven times it enclose the frame",
        "s",
        ge=0.0,
    )
    T_base_camera: tuple[float, ...] = param(
        (), "the camera's optical frame on the odometry's body: x y z qx qy qz qw; empty: the odometry is the camera's"
    )
    search_seconds: float = param(0.0, "longest search for one keyframe; 0: as long as it takes", "s", ge=0.0)
    patience: float = param(
        1.0,
        "how long a newer keyframe waits before the search in hand is cut short, where some were overtaken of late",
        "s",
        ge=0.0,
    )
    waiting_keyframes: int = param(
        8, "most keyframes that wait for a search; no frame is followed while so many do", ge=1
    )
    waiting_megabytes: int = param(200, "most memory of the keyframes that wait for a search", "MB", ge=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        mounting(self.T_base_camera)

    @property
    def mounting(self) -> Array | None:
        """``T_base_camera`` as a (4, 4) pose, None where none is set."""
        return mounting(self.T_base_camera)

    @property
    def limit(self) -> float:
        """The longest search in seconds, infinity if there is no limit."""
        return self.search_seconds or math.inf
