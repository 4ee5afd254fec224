# SPDX-License-Identifier: MIT
"""What dji_sdk's node offers on an M100 beside flying: camera, gimbal, missions, data transfer.

None of it is simulated. Each answers as the node does where there is nothing behind it, and an
upload is refused, because a mission accepted here would never be flown (doc/dji_sdk.md 4).
"""

from typing import Any, Optional, Tuple

import rospy
from geometry_msgs.msg import Vector3Stamped

from dji_sdk import srv
from dji_sdk.msg import Gimbal
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.ports import Ports
from uav_sim.ros.throttle import Throttle

_NOT_IN_F, _NO_AUTHORITY, _NO_MISSION = 0xD0, 0xD1, 0xD3  # of the mission command set
_NOT_PERMITTED = 0xFF02  # of all command sets
_MISSIONS = 3  # command set
# Service -> type and command id, or one id for each action, of what only a mission could answer.
_ACKED = {
    "mission_waypoint_upload": (srv.MissionWpUpload, (0x10,)),
    "mission_waypoint_action": (srv.MissionWpAction, (0x12, 0x12, 0x13, 0x13)),
    "mission_hotpoint_upload": (srv.MissionHpUpload, (0x20,)),
    "mission_hotpoint_action": (srv.MissionHpAction, (0x20, 0x21, 0x22, 0x22)),
    "mission_hotpoint_updateYawRate": (srv.MissionHpUpdateYawRate, (0x23,)),
    "mission_hotpoint_updateRadius": (srv.MissionHpUpdateRadius, (0x24,)),
    "mission_hotpoint_resetYaw": (srv.MissionHpResetYaw, (0x25,)),
}
_CAMERA = ("photo", "start of a video", "end of a video")


class PayloadServices:
    """Services and gimbal topics that exist on the aircraft and move nothing here."""

    def __init__(self, sim: SimulatedM100, ports: Ports) -> None:
        self._sim = sim
        self._throttle = Throttle()
        for name, (service, cmd_ids) in _ACKED.items():
            ports.service(f"dji_sdk/{name}", service, self._acked(name, service, cmd_ids))
        for name, service, handler in (
            ("mission_waypoint_getInfo", srv.MissionWpGetInfo, self._on_waypoint_info),
            ("mission_waypoint_getSpeed", srv.MissionWpGetSpeed, self._on_get_speed),
            ("mission_waypoint_setSpeed", srv.MissionWpSetSpeed, self._on_set_speed),
            ("mission_hotpoint_getInfo", srv.MissionHpGetInfo, self._on_hotpoint_info),
            ("mission_status", srv.MissionStatus, self._on_status),
            ("camera_action", srv.CameraAction, self._on_camera),
            ("send_data_to_mobile", srv.SendMobileData, self._on_mobile_data),
            ("send_data_to_payload", srv.SendPayloadData, self._on_payload_data),
        ):
            ports.service(f"dji_sdk/{name}", service, handler)
        for name, kind in (("gimbal_angle_cmd", Gimbal), ("gimbal_speed_cmd", Vector3Stamped)):
            ports.subscriber(f"dji_sdk/{name}", kind, self._on_gimbal, name)

    def _acked(self, name: str, service: Any, cmd_ids: Tuple[int, ...]) -> Any:
        is_upload = name.endswith("upload")

        def handle(request: Any) -> Any:
            if not self._sim.rc.allows_sdk:
                ack = _NOT_IN_F
            elif not self._sim.autopilot.authority:
                ack = _NO_AUTHORITY
            else:
                ack = _NOT_PERMITTED if is_upload else _NO_MISSION
            why = "missions are not simulated" if is_upload else "no mission was uploaded"
            rospy.logwarn(f"{name} refused: {why} (ack 0x{ack:02X})")
            action = getattr(request, "action", 0)
            cmd_id = cmd_ids[action] if action < len(cmd_ids) else 0
            return service._response_class(False, _MISSIONS, cmd_id, ack)

        return handle

    def _on_waypoint_info(self, request: Any) -> Optional[srv.MissionWpGetInfoResponse]:
        # dji_sdk's own handler fails as a service call where no mission was uploaded.
        rospy.logwarn("mission_waypoint_getInfo: no mission was uploaded, the call fails")
        return None

    def _on_get_speed(self, request: Any) -> srv.MissionWpGetSpeedResponse:
        rospy.logwarn("mission_waypoint_getSpeed: no mission was uploaded")
        return srv.MissionWpGetSpeedResponse(0.0)

    def _on_set_speed(self, request: Any) -> srv.MissionWpSetSpeedResponse:
        rospy.logwarn("mission_waypoint_setSpeed refused: no mission was uploaded")
        return srv.MissionWpSetSpeedResponse(False)

    def _on_hotpoint_info(self, request: Any) -> srv.MissionHpGetInfoResponse:
        rospy.logwarn("mission_hotpoint_getInfo: no mission was uploaded, all fields are 0")
        return srv.MissionHpGetInfoResponse()

    def _on_status(self, request: Any) -> srv.MissionStatusResponse:
        return srv.MissionStatusResponse(0, 0)

    def _on_camera(self, request: Any) -> srv.CameraActionResponse:
        # The node does not wait for the camera, so a known action always succeeds.
        known = request.camera_action < len(_CAMERA)
        words = f"{_CAMERA[request.camera_action]} not simulated" if known else "refused"
        rospy.loginfo(f"camera_action {request.camera_action}: {words}")
        return srv.CameraActionResponse(known)

    def _on_mobile_data(self, request: Any) -> srv.SendMobileDataResponse:
        rospy.loginfo(f"{len(request.data)} bytes to a mobile app that is not there")
        return srv.SendMobileDataResponse(True)

    def _on_payload_data(self, request: Any) -> srv.SendPayloadDataResponse:
        rospy.loginfo(f"{len(request.data)} bytes to a payload that is not there")
        return srv.SendPayloadDataResponse(True)

    def _on_gimbal(self, message: Any, name: str) -> None:
        line = self._throttle.line(f"{name} ignored: no gimbal is simulated")
        if line:
            rospy.logwarn(line)
