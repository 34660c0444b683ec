"""Start the simulated robot: ros2 launch navfw_ros sim.launch.py world:=office pace:=0.5."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

DEFAULTS = {"world": "office", "pace": "1.0", "seed": "0"}


def generate_launch_description() -> LaunchDescription:
    """Describe the robot without a mission, with its world, pace and seed."""
    values = {name: LaunchConfiguration(name) for name in DEFAULTS}
    words = ["navfw", "ros", "sim", values["world"], "--pace", values["pace"]]
    words += ["--seed", values["seed"]]
    arguments = [DeclareLaunchArgument(name, default_value=text) for name, text in DEFAULTS.items()]
    return LaunchDescription([*arguments, ExecuteProcess(cmd=words, output="screen")])
