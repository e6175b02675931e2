# SPDX-License-Identifier: Apache-2.0
# Both packages in a colcon workspace on ROS 2 Jazzy, installed as README's "On your robot" says.
#   docker build --file docker/ros.Dockerfile --tag objreg-ros .
#   docker run --rm --network host --ipc host objreg-ros
#   docker run --rm --network host --ipc host objreg-ros ros2 launch objreg_ros objreg.launch.py image:=/camera/image
# --ipc=host shares the host's shared memory with its nodes. Without it say --shm-size=1g: Docker's 64 MB are too few.
FROM ros:jazzy-ros-base-noble
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
ENV PIP_BREAK_SYSTEM_PACKAGES=1 PIP_NO_CACHE_DIR=1
WORKDIR /ws
COPY . src/objreg_ros
# Ubuntu keeps one version of each package; pip's are those of requirements/robot.lock, by their hashes.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-pip \
    && rosdep update --rosdistro jazzy \
    && rosdep install --rosdistro jazzy --from-paths src src/objreg_ros/objreg_msgs --ignore-src \
        --skip-keys "python3-onnxruntime-pip python3-open3d-pip python3-rosbags-pip" \
        --dependency-types exec --dependency-types build --dependency-types buildtool --default-yes \
    && python3 -m pip install --require-hashes --no-deps --requirement src/objreg_ros/requirements/robot.lock \
    && rm -rf /var/lib/apt/lists/* ~/.ros
RUN . /opt/ros/jazzy/setup.bash \
    && colcon build --base-paths src src/objreg_ros/objreg_msgs \
    && rm -rf build log
# The image's own user, ubuntu.
USER 1000
ENTRYPOINT ["/bin/bash", "-c", ". /opt/ros/jazzy/setup.bash && . /ws/install/setup.bash && exec \"$@\"", "ros"]
CMD ["ros2", "launch", "objreg_ros", "objreg.launch.py"]
