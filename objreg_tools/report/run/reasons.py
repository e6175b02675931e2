# SPDX-License-Identifier: Apache-2.0
"""What each reason of a refusal or a drop means, what to do, and which parameter or limit stands behind it.

The report, the terminal and docs/troubleshooting.md take their texts from here.
"""

from __future__ import annotations

from typing import NamedTuple

GATE = "registration/gate"


class ReasonText(NamedTuple):
    """What a person needs to know of a reason.

    ``parameters`` are ``node.name``, as `--set` takes them. ``limits`` are pairs of a file below ``objreg_ros/`` and
    the name of a constant in it, which no user sets.
    """

    meaning: str
    remedy: str
    parameters: tuple[str, ...] = ()
    limits: tuple[tuple[str, str], ...] = ()


REFUSALS = {
    "no_candidate": ReasonText(
        "no stored place has such objects",
        "Nothing is wrong on the first pass. On a revisit, check that the detector gives the objects the same label "
        "both times. Put labels that it confuses into one group. With odometry, places that it puts too far away "
        "are not tried: set its drift.",
        ("registrar.label_groups", "registrar.odometry_radius", "registrar.odometry_drift", "registrar.min_gap"),
    ),
    "no_hypothesis": ReasonText(
        "no pose explains the two keyframes",
        "Too few points were seen, or no proposer found a pose. Look at more of the room, and trust depth farther "
        "where the sensor allows it.",
        ("segmenter.z_max", "registrar.context_range"),
        (("registration/refine/batch_icp.py", "LEAST_PAIRS"),),
    ),
    "not_converged": ReasonText(
        "too few points find a partner",
        "The two views share next to no surface. Let the camera see more of what stands around the objects.",
        ("segmenter.z_max", "registrar.context_range"),
        (("registration/refine/batch_icp.py", "LEAST_PAIRS"),),
    ),
    "low_overlap": ReasonText(
        "the two views have too little in common, or the view score of the pose is too low",
        "Come back along a similar view, or look at the place longer. Where one object fills the picture, step back: "
        "what is around it must agree too.",
        ("registrar.least_odds", "registrar.confirm_seconds"),
        ((f"{GATE}/surroundings.py", "LIMITS"),),
    ),
    "free_space_violated": ReasonText(
        "something would float where the other view saw free space",
        "The pose is false, or depth is. If all are refused for this, check that depth is registered to colour, that "
        "both have the same time, and the scale of depth.",
        ("segmenter.slop", "segmenter.rectified", "segmenter.camera", "registrar.least_odds"),
        ((f"{GATE}/free_space.py", "LIMITS"),),
    ),
    "texture_disagrees": ReasonText(
        "the shapes fit, the pictures do not",
        "Two places look alike in shape, or one picture is blurred or its light has changed. Check that colour belongs "
        "to depth. Go slower where the picture is blurred.",
        ("segmenter.slop", "segmenter.colour", "registrar.least_odds"),
        ((f"{GATE}/surroundings.py", "LIMITS"),),
    ),
    "few_objects_matched": ReasonText(
        "too few objects lie on each other",
        "A pose needs a matched object with a name, or three without. Let the detector find more: lower its threshold, "
        "or take a model that knows what stands there.",
        ("detector.model", "detector.threshold", "segmenter.unnamed", "registrar.least_odds"),
        ((f"{GATE}/objects.py", "LEAST_UNNAMED"),),
    ),
    "proposers_disagree": ReasonText(
        "another pose is as good, or too little independent evidence agrees",
        "A lone or symmetric object fits in more than one way. See a second object in the same view, or come closer to "
        "the side that distinguishes front from back.",
        ("registrar.least_odds", "registrar.confirm_seconds"),
        ((f"{GATE}/competing.py", "LEAST_MARGIN"),),
    ),
    "gravity_not_kept": ReasonText(
        "the room would tilt",
        "The pose is false, or gravity is. If many are refused for this, set how the camera is turned and how the IMU "
        "is mounted.",
        ("segmenter.roll", "segmenter.up_tilt", "segmenter.T_camera_imu", "segmenter.level_odom"),
        ((f"{GATE}/gravity.py", "SIGMAS"),),
    ),
    "implausible_motion": ReasonText(
        "the cameras would be too far apart",
        "Two views of one place are nearer. Raise the limit only in a hall.",
        ("registrar.max_translation",),
        ((f"{GATE}/odometry.py", "FAR_M"),),
    ),
    "odometry_disagrees": ReasonText(
        "odometry rules it out",
        "If odometry is worse than its stated drift, raise the drift. Check where the camera sits on the body that "
        "odometry describes.",
        (
            "registrar.odometry_drift",
            "registrar.odometry_rotation_drift",
            "registrar.odometry_translation_noise",
            "registrar.odometry_rotation_noise",
            "registrar.T_base_camera",
        ),
        ((f"{GATE}/odometry.py", "SIGMAS"),),
    ),
    "slides_along_a_plane": ReasonText(
        "the data leave a direction open",
        "A bare wall or table holds no place along itself. Let a second surface, a corner or another object into the "
        "view, and come nearer: depth far away is coarse.",
        ("registrar.least_odds", "registrar.confirm_seconds"),
        (("registration/propose/refinement.py", "DEGENERATE_SHARE"),),
    ),
    "objects_moved": ReasonText(
        "more objects have moved than stayed",
        "Nothing is known of a place that was rearranged. If nothing moved, the pose is false. People and other "
        "movers are better not detected.",
        ("detector.ignore",),
        ((f"{GATE}/objects.py", "check_moved"),),
    ),
    "redundant": ReasonText(
        "a closure of this revisit was accepted already",
        "Nothing is wrong. For more constraints of one revisit, thin them less.",
        ("registrar.thin_seconds", "registrar.closures"),
    ),
    "over_budget": ReasonText(
        "time ran out before this place was tried",
        "The computer is too slow for the stream. Play it slower or losslessly, give the search more threads or time, "
        "or let keyframes come more seldom.",
        (
            "registrar.search_seconds",
            "registrar.threads",
            "registrar.candidates",
            "registrar.keyframe_translation",
            "registrar.keyframe_rotation",
        ),
    ),
    "unreadable": ReasonText(
        "the stored data of this place is damaged",
        "The other keyframes of the store go on. `objreg export STORE FOLDER` names what is damaged and saves the "
        "rest. Look for a full or failing disk.",
        ("registrar.store",),
    ),
    "neighbours_disagree": ReasonText(
        "the keyframes around it support another pose",
        "The pose is false, or odometry slipped there. If right ones are refused for this, look at the odometry "
        "between the keyframes.",
        ("registrar.confirm_seconds",),
        (("registrar/confirmation.py", "OPPOSED_SHARE"),),
    ),
    "vetoed": ReasonText(
        "a person withdrew this constraint, or a neighbouring one whose pose agrees",
        "Nothing is wrong. `objreg veto STORE ID --undo`, or `~/veto` with `undo`, lets it hold again.",
        (),
        (("registrar/consistency.py", "REACH_M"),),
    ),
    "places_alike": ReasonText(
        "another place of the map fits as well",
        "Equal places are distinguished by what differs in them. Go on until something that differs is in sight.",
        ("registrar.odometry_drift",),
        (("registrar/rivalry.py", "LEAST_LEAD"), ("registration/score/differing_parts.py", "OTHER")),
    ),
    "camera_implausible": ReasonText(
        "the camera, or the scale of its depth, differs from what the stream states",
        "The detail gives the measured and the stated value. Correct camera_info, or set the camera.",
        ("segmenter.camera",),
        (("plausibility/offset.py", "SHARE"), ("plausibility/stream_monitor.py", "SIGMAS")),
    ),
    "clock_began_anew": ReasonText(
        "data from before the restart has stamps of the present, and is left out",
        "A bag was played again into the same store, or a simulation was started anew. Take another store, or put "
        "this one aside by `~/reset` (`allow_remote_reset`).",
        ("registrar.store",),
    ),
}
"""By the value of `Reason`."""

MEANINGS = {name: text.meaning for name, text in REFUSALS.items()}

DROPS = {
    "overtaken": ReasonText(
        "a newer frame came before the node took this one",
        "The node is slower than the stream. A few such frames do no harm. To keep all frames, play slower or "
        "losslessly (`objreg replay --rate 0.5`, `--lossless`); on a robot lower the rate or give more threads.",
        ("detector.max_rate", "detector.threads", "registrar.threads"),
    ),
    "malformed": ReasonText(
        "the message breaks its contract; the reason ends with the name of the input",
        "The log states what was expected and what came. `objreg inspect` reports it for a recording.",
        ("segmenter.rectified", "segmenter.camera", "detector.max_megapixels"),
    ),
    "bug": ReasonText(
        "the computation raised an unexpected exception; the reason ends with the name of the exception",
        "Please report it with the traceback in the log.",
    ),
    "refused": ReasonText(
        "the frame cannot be computed or stored",
        "The log states why. For a store, check the free space and the permissions of its folder.",
        ("registrar.store",),
    ),
    "unmatched": ReasonText(
        "its time has passed and no partner came",
        "Colour and depth, or a frame and its detections, have stamps too far apart, or one of them is lost. The log "
        "says which is lacking.",
        ("segmenter.slop",),
    ),
    "queue_full": ReasonText(
        "it waited for a partner until the queue was full",
        "The partner is slow or silent: see whether its node runs, and what that node's log says.",
        ("detector.max_rate",),
        (("bridge/streams/sync.py", "PATIENCE_NS"), ("bridge/streams/sync.py", "MOST_BYTES")),
    ),
    "late": ReasonText(
        "one of its stream with a later stamp was there before it",
        "The stream is out of order, or two publishers share its topic: `ros2 topic info -v` of ros2cli names them. A "
        "few do no harm.",
    ),
    "time_jump": ReasonText(
        "time jumped back and left it in the future",
        "A bag was looped or a simulation began anew. Nothing is wrong if that was meant.",
        limits=(("data/frames.py", "JUMP_NS"),),
    ),
    "odd_stamp": ReasonText(
        "its stamp leapt far away, and the next one's did not",
        "The driver stamped one message wrongly. It is left out and the rest goes on.",
    ),
    "surplus": ReasonText(
        "its picture came sooner than the pace allows",
        "Nothing is wrong: so many pictures a second are enough. 0 looks at all of them.",
        ("detector.max_rate",),
    ),
    "disabled": ReasonText("`~/enable` is false", "Call `~/enable` with true."),
    "inactive": ReasonText(
        "the managed node was not active as it came",
        "Activate it, with ros2cli by `ros2 lifecycle set /detector activate`, or set `autostart`.",
        ("detector.autostart",),
    ),
    "reset": ReasonText("`~/reset` came while it waited", "Nothing is wrong."),
    "known": ReasonText(
        "a keyframe of a robot was received before", "Nothing is wrong: after a break all that is kept is sent."
    ),
    "same_camera": ReasonText(
        "two cameras of a robot have one frame",
        "A constraint would not identify the camera of its keyframe. Give each camera of a robot its own frame.",
    ),
    "two_clocks": ReasonText(
        "a constraint ties two runs of one clock",
        "A bag was looped. Build objreg_msgs, whose closures name their sessions, or begin with a new store and map.",
        ("mapper.input",),
    ),
    "unknown_robot": ReasonText(
        "a constraint is of a robot that the mapper does not follow",
        "Name the robot among the mapper's `robots`, by the namespace of its registrar.",
        ("mapper.robots",),
    ),
    "retracted": ReasonText("the constraint was withdrawn while it waited", "Nothing is wrong."),
    "odometry_gap": ReasonText(
        "one of the constraint's keyframes lies in a gap of the odometry",
        "See why odometry was silent then, and whether its messages are lost.",
    ),
    "before_odometry": ReasonText(
        "the odometry begins after the constraint's first keyframe",
        "Start odometry before the registrar, or the mapper with `resume` and the same days as the store.",
        ("mapper.resume",),
    ),
    "odometry_leap": ReasonText(
        "the odometry began anew while the constraint waited for it, and a new file with it",
        "See why odometry leapt.",
    ),
    "implausible": ReasonText(
        "the constraint is farther than odometry and the mapper's stretch allow",
        "If odometry is right, the constraint is false. If odometry comes too short, raise the stretch.",
        ("mapper.max_stretch",),
    ),
}
"""By the name in `/diagnostics` and on `finished`, without what stands behind it."""
