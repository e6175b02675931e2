# SPDX-License-Identifier: Apache-2.0
"""Recordings in, reports out: the command `objreg`, the simulator, and what drives the stages without ROS.

    cli/          the command `objreg`, one file a subcommand
    recording/    rosbag1, rosbag2 and folders of pictures in, rosbag2 out
    offline       recorded frames through the stages; `rehearsal` without detector and registrar; `truth` the true error
    report/       pages of runs, stores and batches, and exports
    simulation/   a depth camera over rooms of objects, with ground truth
    graph         all nodes in one process; `workers` spreads work over processes and machines

A robot needs none of it: `objreg_ros` imports neither this package nor `objreg_mapper`.
"""
