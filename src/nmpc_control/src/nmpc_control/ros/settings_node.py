# SPDX-License-Identifier: MIT
"""Node ``nmpc_settings``: puts what everything was set to into the bag.

It publishes ``nmpc/parameters`` (std_msgs/String, latched): as YAML the commit of the workspace,
all ROS parameters of its namespace and the YAML files that its nodes read, again whenever a
parameter changes.
"""

import re
from pathlib import Path
from typing import Any, Dict, List

import rospy
import yaml
from std_msgs.msg import String

from nmpc_control.analysis.provenance import commit
from nmpc_control.config import config_directory, load_yaml
from nmpc_control.errors import ConfigError

_PERIOD = 2.0  # [s] between two looks at the parameters
_OF_ROS = ("roslaunch", "run_id", "robot_description")  # no settings, or too long
_ALWAYS = ("controller.yaml", "guard.yaml", "sources.yaml", "obstacles.yaml")
_CHOSEN = {"vehicle": "vehicles", "profile": "profiles", "weights": "weights"}


def files(parameters: Dict[str, Any], directory: Path) -> Dict[str, Any]:
    """Return the content of the YAML files in use, by name; of what cannot be read, the reason."""
    names: List[str] = list(_ALWAYS)
    for node in parameters.values():
        for key, folder in _CHOSEN.items():
            name = node.get(key) if isinstance(node, dict) else None
            if isinstance(name, str) and re.fullmatch(r"\w+", name):
                names.append(f"{folder}/{name}.yaml")
    found: Dict[str, Any] = {}
    for name in names:
        try:
            found[name] = load_yaml(directory / name)
        except ConfigError as error:
            found[name] = str(error)
    return found


def settings(parameters: Dict[str, Any], workspace_commit: str) -> str:
    """Return the text that is published."""
    chosen = {key: value for key, value in parameters.items() if key not in _OF_ROS}
    data = {"commit": workspace_commit, "parameters": chosen}
    data["files"] = files(chosen, config_directory())
    return yaml.safe_dump(data, sort_keys=True)


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
