"""Start one camera as a sensor: ros2 launch navfw_ros sense.launch.py robot:=FILE image:=TOPIC."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

DEFAULTS = {"robot": "default", "image": "image", "use_sim_time": "false", "publish_tf": "false"}


def generate_launch_description() -> LaunchDescription:
    """Describe the node with its robot, the topic of the camera, and its parameters."""
    values = {name: LaunchConfiguration(name) for name in DEFAULTS}
    words = ["navfw", "ros", "sense", "--robot", values["robot"], "--ros-args"]
    words += ["-r", ["image:=", values["image"]]]
    for name in ("use_sim_time", "publish_tf"):
        words += ["-p", [f"{name}:=", values[name]]]
    arguments = [DeclareLaunchArgument(name, default_value=text) for name, text in DEFAULTS.items()]
    return LaunchDescription([*arguments, ExecuteProcess(cmd=words, output="screen")])
