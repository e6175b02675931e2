# SPDX-License-Identifier: Apache-2.0
"""A depth camera over rooms of objects, with ground truth; it writes ordinary recordings.

Everything is a pure function of seeds. Lengths are metres, the world has z up and the floor at 0, cameras are optical
frames (x right, y down, z forward), ``T_a_b`` maps points of b into a.

    from objreg_tools.simulation.world.scene import random_scene, random_view
    from objreg_tools.simulation.rendering.render import render

    scene = random_scene(seed=7)                          # a furnished, cluttered, lit corner of a room
    image = render(scene, random_view(scene, seed=1), seed=1)     # -> Rendering
    image.rgb (H, W, 3) uint8; image.depth, image.true_depth (H, W) float32 m; image.instance (H, W) uint16
    for o in image.objects:                               # the nine classes; image.seen has the distractors too
        o.label, o.xyxy, o.visibility, o.pixels, o.instance, o.T_camera_object, o.T_world_object, o.symmetry

`render` takes any `Intrinsics` (`camera.CAMERAS` has some by name), the sensors' parameters (`params.DepthParams`,
`params.StereoParams` or `params.TimeOfFlightParams`, `params.ColourParams`, `params.StressParams`; `camera.SENSORS` has
some by name), ``with_colour=False`` for depth alone, and ``threads`` (1 by default; 2 is faster; the images are the
same; safe in forked workers). `rig.Rig` takes pictures of a moving camera with a lens, a lag, a rolling shutter and so
on (`params.RigParams`).

Objects: ``objects.make_object(label, seed) -> ObjectModel`` for the labels in ``objects.LABELS``, and
``distractors.make_distractor(kind, seed)``. A model stands on z = 0, z up, and states its `Symmetry`, whose
``pose_error(T_estimated, T_true) -> (degrees, cm)`` is least over the motions that leave the shape as it is.

Scenes of your own: ``scene.furnished(rng, pieces, room)`` for the room, ``scene.number([(model, T_world_object), ..])``
for the objects, ``scene.place_on(model, T_world_surface, x, y, yaw)`` to stand one on a surface, and
``Scene.with_objects`` to change what stands there. `light.looking` gives a camera pose from eye and target.

Recordings: ``write.simulate(path, scenario, seed, frames)`` (command `objreg simulate`) writes a rosbag2 folder with
``truth/`` in it. ``truth.read_truth(path) -> Truth`` reads that: boxes, masks, poses of camera and objects, symmetries.
``scenarios.make_plan(scenario, seed, frames) -> RecordingPlan`` gives scenes and camera poses without rendering them,
and ``odometry.drifted`` the poses by drifting odometry. ``write.simulate_fleet`` and ``fleet.make_fleet`` do so for
several robots in one world.

| file | what |
| --- | --- |
| `mesh` `texture` `print_design` | solids, natural textures, printed things |
| `model` `objects` `chair` `distractors` `furniture` | what rooms are filled with |
| `scene` | placing it; random rooms and views |
| `raster` `surfaces` `light` `shade` | triangles to depth, instance and light |
| `view` | what a pinhole camera sees before any sensor |
| `depth_sensors` | a depth sensor by its parameters: |
| `noise` `active_stereo` `time_of_flight` `fields` | structured light, stereo, flight, and what they share |
| `camera` `params` | the colour sensor; cameras, sensors and lenses by name; what can be set |
| `render` | all of it for one image |
| `lens` `rig` | cameras as they are built and timed: lens, lag, rolling shutter, blur, misregistration |
| `trajectory` `odometry` `scenarios` | how the camera is carried, what odometry makes of it, and through what |
| `rooms` `visits` `building` `fleet` | what the rooms hold, how tables are visited; three rooms, three robots |
| `write` `truth` | recordings, and the truth beside them |
"""
