# navfw beside ROS 2, for "navfw ros drive" and "navfw ros sense":
#   docker build -t navfw .
#   docker run --rm --net=host navfw drive --map office --stack landmarks
# The kernels are compiled for the processor that builds; on another one: -v navfw-kernels:/var/cache/navfw,
# and once: docker run --rm -v navfw-kernels:/var/cache/navfw --entrypoint navfw navfw warm
ARG ROS_DISTRO=kilted
FROM ros:${ROS_DISTRO}-ros-base

RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-venv \
    && rm -rf /var/lib/apt/lists/*
ENV NUMBA_CACHE_DIR=/var/cache/navfw PATH=/opt/navfw/bin:$PATH
WORKDIR /src
COPY . .
# the packages of ROS come from the system, all else from wheels
RUN python3 -m venv --system-site-packages /opt/navfw \
    && /opt/navfw/bin/pip install --no-cache-dir ".[record]" \
    && rm -rf /src/* \
    && useradd --create-home robot \
    && install -d -o robot /var/cache/navfw
USER robot
WORKDIR /home/robot
RUN navfw warm --quiet
ENTRYPOINT ["/ros_entrypoint.sh", "navfw", "ros"]
CMD ["--help"]
