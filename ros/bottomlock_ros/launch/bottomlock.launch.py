"""Starts the node, configures and activates it: `ros2 launch bottomlock_ros bottomlock.launch.py config:=rov.toml`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition


def generate_launch_description() -> LaunchDescription:
    """The node and the two transitions after its start."""
    share = PathJoinSubstitution([FindPackageShare("bottomlock_ros"), "config"])
    node = LifecycleNode(
        package="bottomlock_ros",
        executable="bottomlock_node",
        name="bottomlock",
        namespace="",
        output="screen",
        parameters=[
            LaunchConfiguration("params_file"),
            {"config": LaunchConfiguration("config"), "use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
    )

    def change(transition: int) -> EmitEvent:
        return EmitEvent(
            event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition)
        )

    activate = OnStateTransition(
        target_lifecycle_node=node,
        start_state="configuring",
        goal_state="inactive",
        entities=[change(Transition.TRANSITION_ACTIVATE)],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=PathJoinSubstitution([share, "rov.toml"])),
            DeclareLaunchArgument(
                "params_file", default_value=PathJoinSubstitution([share, "bottomlock.yaml"])
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            node,
            RegisterEventHandler(activate),
            change(Transition.TRANSITION_CONFIGURE),
        ]
    )
