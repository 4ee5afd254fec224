# SPDX-License-Identifier: MIT
"""Services that pause, step and pace simulated time."""

import math

import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from nmpc_msgs.srv import (
    SetSpeed,
    SetSpeedRequest,
    SetSpeedResponse,
    StepTime,
    StepTimeRequest,
    StepTimeResponse,
)
from uav_sim.fleet import Fleet
from uav_sim.ros.gate import Gate
from uav_sim.ros.pacer import Pacer
from uav_sim.ros.ports import Ports

PATIENCE = 0.1  # [s] wall time for which the simulating thread sleeps while time is paused
PAUSE_TIMEOUT = 2.0  # [s] wall time until it stands
STEP_TIMEOUT = 60.0  # [s] wall time for the steps of one request


class TimeControl:
    """``uav_sim/pause``, ``uav_sim/step`` and ``uav_sim/set_speed``, for all vehicles together.

    The simulating thread calls ``wait`` before every step and ``done`` after it.
    """

    def __init__(self, fleet: Fleet, speed_factor: float, paused: bool) -> None:
        self._fleet = fleet
        self._gate = Gate(paused)
        self._pacer = Pacer(fleet.step_time, speed_factor)
        self._speed_factor = speed_factor  # as wished; the pacer follows at the next step
        self._stood = paused
        self._lost = 0.0
        ports = Ports()
        ports.service("uav_sim/pause", SetBool, self._on_pause)
        ports.service("uav_sim/step", StepTime, self._on_step)
        ports.service("uav_sim/set_speed", SetSpeed, self._on_set_speed)

    def wait(self) -> bool:
        """Return whether to step now; False after a moment in which time stood still."""
        if not self._gate.take():
            self._stood = True
            if not self._fleet.in_phase:
                return True  # time stands where the clock has been published
            self._gate.stand(PATIENCE)
            return False
        if self._gate.paused:
            return True
        if self._stood or self._speed_factor != self._pacer.speed_factor:
            self._stood = False
            self._pacer.restart(self._speed_factor)
        self._pacer.wait()
        if self._pacer.lost > self._lost:
            self._lost = self._pacer.lost
            rospy.logwarn_throttle(5.0, f"the machine is too slow: {self._lost:.1f} s lost so far")
        return True

    def done(self) -> None:
        """Count a step that has been taken."""
        self._gate.taken()

    def _on_pause(self, request: SetBoolRequest) -> SetBoolResponse:
        self._gate.pause(request.data, PAUSE_TIMEOUT)
        text = f"time {'stands' if request.data else 'passes'}, t = {self._fleet.t:.3f} s"
        rospy.loginfo(text)
        return SetBoolResponse(True, text)

    def _on_step(self, request: StepTimeRequest) -> StepTimeResponse:
        if not self._gate.paused:
            return StepTimeResponse(False, self._fleet.t, "time is not paused")
        done = self._gate.step(request.steps * self._fleet.steps_per_packet, STEP_TIMEOUT)
        text = f"{request.steps} steps" if done else "not all steps were taken"
        return StepTimeResponse(done, self._fleet.t, text)

    def _on_set_speed(self, request: SetSpeedRequest) -> SetSpeedResponse:
        if not math.isfinite(request.speed_factor) or request.speed_factor < 0.0:
            text = f"got {request.speed_factor:g}, expected a finite number not below 0"
            return SetSpeedResponse(False, f"set_speed: speed_factor: {text}")
        self._speed_factor = request.speed_factor
        text = f"speed factor {request.speed_factor:g}"
        rospy.loginfo(text)
        return SetSpeedResponse(True, text)
