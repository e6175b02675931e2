# SPDX-License-Identifier: Apache-2.0
"""Someone has odd recordings. Each command says what is wrong and what to do, and what it says to do gets on."""

from __future__ import annotations

from pathlib import Path

from .folders import ODD_COLOUR, SPARE_DEPTH, bag_of, tum_of
from .walk import Walk

FEW = ("--max-frames", "3")
CAMERA = "262.5,262.5,159.5,119.5"


def colour_under_an_odd_name(folder: Path, room: Path) -> None:
    """Its name is given with --remap, and the run that is advised next has it too."""
    bag_of(room, folder / "bag", names={"/image": ODD_COLOUR})
    someone = Walk(folder)
    stuck = someone.type("inspect", "bag", ends=3)
    assert "the graph cannot run: expected a colour image" in stuck.text and ODD_COLOUR in stuck.text
    assert stuck.advises("--remap input:=/topic") and stuck.leads_to() == {"waits-for-a-topic"}
    refused = someone.type("offline", "bag", ends=1)
    assert "expected a colour image" in refused.text and "--remap" in refused.text
    inspected = someone.type("inspect", "bag", f"--remap=image:={ODD_COLOUR}")
    assert f"--remap=image:={ODD_COLOUR}" in inspected.command()


def no_camera_info(folder: Path, room: Path) -> None:
    """The camera is given with --camera, and the run that is advised next has it too."""
    bag_of(room, folder / "bag", without={"/camera_info"})
    someone = Walk(folder)
    stuck = someone.type("inspect", "bag", ends=3)
    assert stuck.advises("--camera fx,fy,cx,cy") and stuck.leads_to() == {"no-camera-info"}
    inspected = someone.type("inspect", "bag", "--camera", CAMERA)
    run = someone.follow(inspected, *FEW)
    assert run.text.count("3 frames") and run.advice()


def wrong_depth_scale(folder: Path, room: Path) -> None:
    """The steps of depth are written into camera.yaml, as was advised."""
    tum_of(room, folder / "mine", frames=6, depth_scale=1000, stated_scale=200)
    someone = Walk(folder)
    odd = someone.type("inspect", "mine")
    assert "depth begins at" in odd.text and "depth-scale" in odd.leads_to()
    assert odd.advises("depth_scale in camera.yaml")
    camera = folder / "mine/camera.yaml"
    camera.write_text(camera.read_text().replace("depth_scale: 200", "depth_scale: 1000"))
    right = someone.type("inspect", "mine")
    assert not right.leads_to() and right.command()[0] == "offline"


def garbage_in_place_of_depth(folder: Path, room: Path) -> None:
    """The run says that nothing got through and to look; another topic gets on."""
    bag_of(room, folder / "bag", garbage={"/depth/image"}, twice={"/depth/image": SPARE_DEPTH})
    someone = Walk(folder)
    empty = someone.type("offline", "bag", *FEW, ends=3)
    assert "no frame got through" in empty.text and "no-frame-got-through" in empty.leads_to()
    assert empty.advises("objreg inspect") and empty.advises("--remap")
    seen = someone.type("inspect", "bag", ends=3)
    assert "! depth: " in seen.text and SPARE_DEPTH in seen.text
    inspected = someone.type("inspect", "bag", f"--remap=depth:={SPARE_DEPTH}")
    assert "! depth: " not in inspected.text
    run = someone.follow(inspected, *FEW)
    assert run.text.count("3 frames") and run.advice()
