# SPDX-License-Identifier: Apache-2.0
"""What each reason of a refusal or a drop means, in the words of the report."""

from __future__ import annotations

MEANINGS = {
    "no_candidate": "no stored place has such objects",
    "no_hypothesis": "no pose explains the two moments",
    "not_converged": "too few points find a partner",
    "low_overlap": "too little of the two views is the same, or they like the pose too little",
    "free_space_violated": "something would float where the other view saw free space",
    "texture_disagrees": "the shapes fit, the pictures do not",
    "few_objects_explained": "too few objects lie on each other",
    "chains_disagree": "another pose is as good, or too little independent evidence agrees",
    "gravity_not_kept": "the room would tilt",
    "implausible_motion": "the cameras would be too far apart",
    "odometry_disagrees": "odometry rules it out",
    "slides_along_a_plane": "the data leave a direction open",
    "objects_moved": "more objects have moved than stayed",
    "redundant": "a closure of this revisit was accepted already",
    "over_budget": "time ran out before this place was tried",
    "unreadable": "what the store holds of this place is damaged",
    "neighbours_disagree": "the keyframes around it tell another pose",
    "clock_began_anew": "what was seen before then has stamps of now, and is left out",
}
