# SPDX-License-Identifier: Apache-2.0
# The command `objreg` and the library, from the locked wheels; ROS 2 comes as wheels too.
#   docker build --file docker/python.Dockerfile --tag objreg .
#   docker run --rm --volume "$PWD:/data" objreg offline /data/my_bag --json /data/out.json
#   docker run --rm --shm-size=1g --volume "$PWD:/data" objreg demo --out /data/demo
# For x86_64, as ROS's wheels are; docker/ros.Dockerfile is for arm64 too.
# The nodes of a demo pass clouds by shared memory, of which Docker's 64 MB are too few; --ipc=host does as well.
FROM python:3.12.11-slim-bookworm AS system
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
# What Open3D's wheels load, as in scripts/bootstrap. Debian keeps one version of each package.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libegl1 libgl1 libgomp1 libusb-1.0-0 libx11-6 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 objreg

# Where one works on the sources: .devcontainer/devcontainer.json opens this, and scripts/bootstrap makes the rest.
FROM system AS development
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends chromium chromium-driver g++ git \
    && rm -rf /var/lib/apt/lists/*
USER 1000

FROM system AS build
WORKDIR /src
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends g++ libc6-dev && rm -rf /var/lib/apt/lists/*
RUN [[ "$(uname -m)" == x86_64 ]] \
    || { echo "expected x86_64, got $(uname -m): ROS has no wheels for it; build docker/ros.Dockerfile" >&2; exit 1; }
COPY requirements/build.lock requirements/python3.12.lock requirements/
RUN python -m venv /opt/objreg \
    && /opt/objreg/bin/pip install --no-cache-dir --require-hashes --requirement requirements/build.lock \
    && /opt/objreg/bin/pip install --no-cache-dir --require-hashes --no-build-isolation --requirement requirements/python3.12.lock
COPY setup.py setup.cfg README.md LICENSE package.xml ./
COPY resource resource
COPY config config
COPY launch launch
COPY models models
COPY objreg_ros objreg_ros
COPY objreg_mapper objreg_mapper
COPY objreg_tools objreg_tools
RUN /opt/objreg/bin/pip install --no-cache-dir --no-deps --no-build-isolation .

FROM system
COPY --from=build /opt/objreg /opt/objreg
ENV PATH=/opt/objreg/bin:$PATH ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
USER 1000
WORKDIR /data
ENTRYPOINT ["objreg"]
CMD ["--help"]
