# SPDX-License-Identifier: Apache-2.0
"""The text of findings: where a stream is not what it states. The text is the same in a terminal, a page and a log."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import quaternion_from_rotation
from objreg_ros.plausibility.camera_fit import CameraFit
from objreg_ros.plausibility.finding import Finding
from objreg_ros.plausibility.hand_eye import HandEye

NAME_CAMERA = "name the camera of the picture with --camera fx,fy,cx,cy (segmenter.camera), or mend its driver"


def focal_length(fit: CameraFit) -> Finding:
    """The camera turned, and what it saw moved as under another focal length."""
    return Finding(
        f"by its motion the camera has {fit.focal:.2f} ± {fit.focal * fit.focal_sigma:.2f} times the focal length that "
        "camera_info says",
        "camera_info is of another camera, of another size of picture, or was never calibrated",
        NAME_CAMERA,
        "camera-focal-length",
    )


def principal_point(fit: CameraFit) -> Finding:
    """The camera moved, and what it saw moved as about another principal point."""
    right, down = 100.0 * fit.centre
    sigma = 100.0 * fit.centre_sigma
    return Finding(
        f"by its motion the camera has its principal point {right:.0f} ± {sigma[0]:.0f} % of the width to the right "
        f"and {down:.0f} ± {sigma[1]:.0f} % down of where camera_info says",
        "camera_info is of another camera, or of a picture that was cut out elsewhere",
        NAME_CAMERA,
        "camera-principal-point",
    )


def two_cameras(colour: str, depth: str) -> Finding:
    """Colour and depth that were recorded are of two cameras by their names and frames."""
    kind = "points" if depth.rpartition("/")[2].startswith("points") else "depth/image"
    return Finding(
        f"colour {colour} and depth {depth} are of two cameras",
        "their names or frames say so, and depth of another camera gives wrong objects",
        "record colour and depth of one camera; if these are of one, name both: "
        f"--remap image:={colour} --remap {kind}:={depth}",
        "colour-of-another-camera",
    )


def no_camera(why: str) -> Finding:
    """A camera that cannot be."""
    cause = "camera_info is of another size of picture, or was never calibrated"
    anchor = "camera-principal-point" if "principal" in why else "camera-focal-length"
    return Finding(f"camera_info: {why}", cause, NAME_CAMERA, anchor)


def matrices_disagree(p: Intrinsics, k: Intrinsics, is_p_used: bool) -> Finding:
    """K and P of one camera_info differ where nothing is to be rectified."""
    stated = " and ".join(
        f"{name} has a focal length of {c.fx:.0f} px about {c.cx:.0f}, {c.cy:.0f}" for name, c in (("K", k), ("P", p))
    )
    name = "P" if is_p_used else "K"
    return Finding(
        f"the two matrices of camera_info disagree: {stated}; {name} is used",
        "the driver scaled one of them and left the other, or left its default; there is no distortion to rectify",
        NAME_CAMERA,
        "camera-matrices-disagree",
    )


def cameras_disagree(depth: Intrinsics, colour: Intrinsics) -> Finding:
    """Depth that is registered to colour comes with another camera than colour."""
    stated = f"{depth.fx:.0f} px about {depth.cx:.0f}, {depth.cy:.0f}"
    other = f"{colour.fx:.0f} px about {colour.cx:.0f}, {colour.cy:.0f}"
    return Finding(
        f"depth and colour have one frame and one size, and two cameras: {stated}, and {other} of colour",
        "depth is registered to colour, and its camera_info is still that of the depth camera",
        "name colour's with --remap camera_info:=/its/camera_info, or --camera fx,fy,cx,cy (segmenter.camera)",
        "camera-disagrees",
    )


def depth_scale(fit: HandEye, or_focal: bool = False) -> Finding:
    """The camera moves by other metres than odometry; ``or_focal`` where its focal length is not known apart."""
    factor, sigma = fit.scale, fit.scale * fit.scale_sigma
    focal = ", or the focal length of camera_info is" if or_focal else ""
    return Finding(
        f"the camera moves {factor:.2f} ± {sigma:.2f} times as far by its depth as by odometry",
        f"depth is in steps of {1.0 / factor:.2g} of what it says, or the metres of odometry are wrong" + focal,
        "record depth in mm (16UC1) or in m (32FC1), or name the steps of a folder as depth_scale in camera.yaml; "
        "if depth is right, calibrate the wheels",
        "depth-scale",
    )


def other_colour(share: float) -> Finding:
    """What colour shows does not move as its depth does."""
    return Finding(
        f"colour and depth do not move together in {100 * share:.0f} % of the stream",
        "colour is of another camera than depth, or the two are of different times",
        "name two topics of one camera with --remap image:=/topic and depth/image:=/topic",
        "colour-of-another-camera",
    )


def other_robot(share: float) -> Finding:
    """Odometry turns otherwise than the camera at any time."""
    return Finding(
        f"odometry turns as the camera does in {100 * share:.0f} % of the stream, and at no shift of up to a minute",
        "odometry is of another robot, or of a part that the camera is not fixed to; it is not used",
        "name this robot's with --odometry /topic or --remap odom:=/topic",
        "odometry-of-another-robot",
    )


def other_clock(seconds: float, share: float) -> Finding:
    """Odometry turns as the camera does, but at another time."""
    later = "later" if seconds > 0 else "earlier"
    return Finding(
        f"odometry is stamped {abs(seconds):.2f} s {later} than the camera: so shifted it turns alike in "
        f"{100 * share:.0f} %",
        "their drivers stamp by two clocks, or one of them when a message is sent; it is not used",
        "synchronise the clocks (chrony, use_sim_time for all), and record again",
        "odometry-clock",
    )


def mount_wrong(fit: HandEye, degrees: float) -> Finding:
    """The camera sits otherwise on the body than it is said to."""
    return Finding(
        f"the camera is turned by {degrees:.0f}° on the robot beside what /tf or T_base_camera says",
        "the mount is wrong, or the frame of the camera is not an optical one (z forward); odometry is not used",
        f"see to the transform; measured: T_base_camera: {pasted(fit.T_body_camera)}",
        "mount-wrong",
    )


def mount_unknown(body: str, camera: str, fit: HandEye | None, open_text: str) -> Finding:
    """Nothing says where the camera sits on the body of the odometry."""
    what = f"nothing on /tf_static or /tf says where {camera!r} sits on {body!r}, the body of odometry"
    if fit is None:
        return Finding(
            what,
            "so odometry is not used until the mount is measured; that takes some turns and some metres",
            "publish it (static_transform_publisher), or set T_base_camera of registrar and mapper",
            "mount-unknown",
        )
    found = f"measured from the motion, within {fit.rotation_sigma_deg:.1f}°{open_text}"
    return Finding(what, found, f"keep it: T_base_camera: {pasted(fit.T_body_camera)}", "mount-unknown")


def odometry_gaps(share: float, covered_s: float, of_s: float) -> Finding:
    """Odometry is there for a part of the frames."""
    return Finding(
        f"{100 * share:.0f} % of the frames have odometry: it covers {covered_s:.1f} of the {of_s:.1f} s of the camera",
        "odometry began later, ended earlier or paused, or its stamps are of another clock",
        "record both from beginning to end; registrar.odom_slop widens what is near in time",
        "odometry-gaps",
    )


def pasted(T: Array) -> str:
    """A pose as the parameter has it: ``[x, y, z, qx, qy, qz, qw]``."""
    numbers = [*T[:3, 3], *quaternion_from_rotation(T[:3, :3])]
    return "[" + ", ".join(f"{number + 0.0:.4f}" for number in np.round(numbers, 4)) + "]"
