"""Start the driving node: ros2 launch navfw_ros drive.launch.py map:=plan.yaml robot:=FILE."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

DEFAULTS = {"robot": "default", "map": "empty", "start": "0,0,0", "image": "image"}


def generate_launch_description() -> LaunchDescription:
    """Describe the node with its robot, map and start, and the topic of the camera."""
    values = {name: LaunchConfiguration(name) for name in DEFAULTS}
    words = ["navfw", "ros", "drive"]
    for name in ("robot", "map", "start"):
        words += [f"--{name}", values[name]]
    words += ["--ros-args", "-r", ["image:=", values["image"]]]
    arguments = [DeclareLaunchArgument(name, default_value=text) for name, text in DEFAULTS.items()]
    return LaunchDescription([*arguments, ExecuteProcess(cmd=words, output="screen")])
