# SPDX-License-Identifier: MIT
"""The services of dji_sdk's node on an M100 that fly, and what it answers (doc/dji_sdk.md 4)."""

from threading import Lock
from typing import Any

import rospy

from dji_sdk.srv import (
    Activation,
    ActivationResponse,
    DroneArmControl,
    DroneArmControlResponse,
    DroneTaskControl,
    DroneTaskControlResponse,
    QueryDroneVersion,
    QueryDroneVersionResponse,
    SDKControlAuthority,
    SDKControlAuthorityResponse,
    SetLocalPosRef,
    SetLocalPosRefResponse,
)
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.ports import Ports

FIRMWARE = 0x03010A00  # 3.1.10.0, an M100's
_AUTHORITY = {
    0: "the RC's switch is not in F, or the RC is off",
    1: "released",
    2: "obtained",
    3: "refused, obtaining is under way",
    4: "refused, releasing is under way",
    5: "refused, the RC's switch must be in P",
    6: "refused, the RC's switch must be in F",
    0xC9: "refused, intelligent orientation control is on",
}


class FlightServices:
    """Hands requests to the simulator, under its lock; a refusal is a reply, never an error."""

    def __init__(self, sim: SimulatedM100, lock: Lock, ports: Ports) -> None:
        self._sim = sim
        self._lock = lock
        self._prefix = ports.prefix
        for name, service, handler in (
            ("sdk_control_authority", SDKControlAuthority, self._on_authority),
            ("drone_arm_control", DroneArmControl, self._on_arm),
            ("drone_task_control", DroneTaskControl, self._on_task),
            ("set_local_pos_ref", SetLocalPosRef, self._on_reference),
            ("activation", Activation, self._on_activation),
            ("query_drone_version", QueryDroneVersion, self._on_version),
        ):
            ports.service(f"dji_sdk/{name}", service, handler)

    def _on_authority(self, request: Any) -> SDKControlAuthorityResponse:
        with self._lock:
            ack = self._sim.control_authority(bool(request.control_enable))
        word = "obtain" if request.control_enable else "release"
        words = _AUTHORITY.get(ack.ack_data, "refused")
        self._say(f"{word} control authority: {words} (ack {ack.ack_data})")
        return SDKControlAuthorityResponse(*ack)

    def _on_arm(self, request: Any) -> DroneArmControlResponse:
        with self._lock:
            ack = self._sim.arm(bool(request.arm))
            refusal = self._sim.autopilot.refusal
        words = f"refused, {refusal}" if refusal else "done"
        self._say(f"{'start' if request.arm else 'stop'} motors: {words} (ack {ack.ack_data})")
        return DroneArmControlResponse(*ack)

    def _on_task(self, request: Any) -> DroneTaskControlResponse:
        with self._lock:
            ack = self._sim.task(request.task)
            refusal = self._sim.autopilot.refusal
        words = f"refused, {refusal}" if refusal else "started"
        self._say(f"task {request.task}: {words} (ack {ack.ack_data})")
        return DroneTaskControlResponse(*ack)

    def _on_reference(self, request: Any) -> SetLocalPosRefResponse:
        with self._lock:
            result = self._sim.set_local_position_reference()
        self._say(f"local position reference {'set' if result else 'refused and cleared'}")
        return SetLocalPosRefResponse(result)

    def _on_activation(self, request: Any) -> ActivationResponse:
        ack = self._sim.preset.flight_controller.undocumented.activation_ack
        return ActivationResponse(ack == 0, 0, 1, ack)

    def _on_version(self, request: Any) -> QueryDroneVersionResponse:
        return QueryDroneVersionResponse(FIRMWARE, "M100")

    def _say(self, text: str) -> None:
        rospy.loginfo(self._prefix + text)
