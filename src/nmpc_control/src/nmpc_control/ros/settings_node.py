# SPDX-License-Identifier: MIT
"""Node ``nmpc_settings``: puts what everything was set to into the bag.

It publishes ``nmpc/parameters`` (std_msgs/String, latched): as YAML the commit of the workspace
and all ROS parameters of its namespace, again whenever one of them changes.
"""

from typing import Any, Dict

import rospy
import yaml
from std_msgs.msg import String

from nmpc_control.analysis.provenance import commit

_PERIOD = 2.0  # [s] between two looks at the parameters
_OF_ROS = ("roslaunch", "run_id", "robot_description")  # no settings, or too long


def settings(parameters: Dict[str, Any], workspace_commit: str) -> str:
    """Return the text that is published."""
    chosen = {key: value for key, value in parameters.items() if key not in _OF_ROS}
    return yaml.safe_dump({"commit": workspace_commit, "parameters": chosen}, sort_keys=True)


def main() -> None:
    """Entry point of the node."""
    rospy.init_node("nmpc_settings")
    publisher = rospy.Publisher("nmpc/parameters", String, queue_size=1, latch=True)
    workspace_commit = commit() or "not known"
    published = ""
    while not rospy.is_shutdown():
        text = settings(rospy.get_param(rospy.get_namespace()), workspace_commit)
        if text != published:
            publisher.publish(text)
            published = text
        rospy.rostime.wallsleep(_PERIOD)
