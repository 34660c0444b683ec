"""The package navfw_ros for colcon: launch files, parameters and the view of RViz."""

from pathlib import Path

from setuptools import setup

NAME = "navfw_ros"
SHARE = f"share/{NAME}"
LAUNCH = sorted(map(str, Path("launch").glob("*.launch.py")))

setup(
    name=NAME,
    version="0.1.0",
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", LAUNCH),
        (f"{SHARE}/config", ["nav2_costmap.yaml", "slam_toolbox.yaml"]),
        (f"{SHARE}/rviz", ["navfw.rviz"]),
    ],
    install_requires=["setuptools"],
)
