# SPDX-License-Identifier: MIT
"""The M100's flight controller: authority, tasks, acceptance of setpoints, and flight without them.

Follows doc/dji_sdk.md sections 3.5, 4, 5, 9; what that page marks as open is a parameter in
``common.yaml``.
"""

import enum
import math
from typing import NamedTuple, Optional, Tuple

from uav_sim.flight_loops import FlightLoops
from uav_sim.guidance import Guidance
from uav_sim.plant import Plant
from uav_sim.remote_control import RemoteControl
from uav_sim.setpoint import Horizontal, Setpoint, limited

GOOD_GPS = 3  # velocity and position setpoints, and position hold, need this gps_health (3.4)
HOME_RADIUS = 0.5  # [m]
CARRYING = 0.9  # [1] less than this part of the hover thrust does not carry the aircraft
TASK_GO_HOME, TASK_TAKE_OFF, TASK_LAND = 1, 4, 6


class Phase(enum.Enum):
    """What the flight controller is doing."""

    STANDBY = "on the ground"
    SPINNING_UP = "starting the motors"
    TAKING_OFF = "taking off"
    FLYING = "in the air"
    GOING_HOME = "flying home"
    LANDING = "landing"
    LANDED = "just landed"


_FLIGHT_STATUS = {
    Phase.STANDBY: 1,
    Phase.SPINNING_UP: 2,
    Phase.TAKING_OFF: 2,
    Phase.FLYING: 3,
    Phase.GOING_HOME: 3,
    Phase.LANDING: 4,
    Phase.LANDED: 5,
}


class Ack(NamedTuple):
    """Reply to a command, field by field as dji_sdk's services give it."""

    result: bool
    cmd_set: int
    cmd_id: int
    ack_data: int


class Receipt(NamedTuple):
    """What became of a setpoint; ``text`` says why it was ignored, or what was limited."""

    accepted: bool
    text: str = ""


class Autopilot:
    """Flies a plant on its own, after setpoints, or after the pilot's sticks."""

    def __init__(self, plant: Plant, rc: RemoteControl) -> None:
        self.rc = rc
        self.gps_health = 5
        self._plant = plant
        self._settings = plant.preset.flight_controller
        self._loops = FlightLoops(plant)
        self._guidance = Guidance(plant, self._loops)
        self.start(0.0, airborne=False)

    def start(self, t: float, airborne: bool, authority: bool = False) -> None:
        """Take over a plant just placed at ``t`` [s] on the ground, or hovering in the air."""
        x, y, z = self._plant.position
        self._home = (x, y, 0.0 if airborne else z)
        self._rc_seen = t
        self.authority = authority
        preset = self._plant.preset
        lift = preset.thrust.acceleration(self._plant.hover_percent)
        self._loops.start(vertical_trim=lift - preset.gravity if airborne else 0.0)
        self._enter(t, Phase.FLYING if airborne else Phase.STANDBY)

    @property
    def flight_status(self) -> int:
        """flight_status of an M100; it is 3 as soon as a take-off leaves the ground (2.3)."""
        if self.phase is Phase.TAKING_OFF and not self._plant.on_ground:
            return 3
        return _FLIGHT_STATUS[self.phase]

    @property
    def height(self) -> float:
        """Height above the take-off spot [m]."""
        return self._plant.position[2] - self._home[2]

    def control_authority(self, enable: bool) -> Ack:
        """Obtain or release the control authority."""
        if not enable:
            self.authority = False
            self._setpoint_time = None
            return Ack(True, 1, 0, 1)
        if not self.rc.allows_sdk:
            return Ack(False, 1, 0, 0)
        self.authority = True
        return Ack(True, 1, 0, 2)

    def arm(self, t: float, start: bool) -> Ack:
        """Start or stop the motors on the ground."""
        if not self.authority:
            return Ack(False, 1, 5, 1)
        if not start and self.phase not in (Phase.STANDBY, Phase.LANDED):
            return Ack(False, 1, 5, 3)
        if start == self._plant.motors_on:
            return Ack(False, 1, 5, 2)
        self._plant.motors_on = start
        self._loops.start()
        self._enter(t, Phase.STANDBY)
        return Ack(True, 1, 5, 0)

    def task(self, t: float, number: int) -> Ack:
        """Start a task; an M100 answers 2 for started and 1 for refused."""
        phase = self.phase
        allowed = self.authority and self.rc.allows_sdk
        aloft = phase in (Phase.TAKING_OFF, Phase.FLYING, Phase.GOING_HOME)
        ready = phase is Phase.STANDBY and not self._plant.motors_on
        if number == TASK_TAKE_OFF and allowed and ready:
            self._plant.motors_on = True
            self._home = self._plant.position
            self._loops.start()
            self._enter(t, Phase.SPINNING_UP)
        elif number == TASK_LAND and allowed and aloft:
            self._enter(t, Phase.LANDING)
        elif number == TASK_GO_HOME and allowed and phase is Phase.FLYING and self._has_position:
            self._enter(t, Phase.GOING_HOME)
        else:
            return Ack(False, 1, 1, 1)
        return Ack(True, 1, 1, 2)

    def setpoint(self, t: float, setpoint: Setpoint) -> Receipt:
        """Take a setpoint, or ignore it as the real one does: without an answer on the wire."""
        reason = self._objection(setpoint)
        if reason:
            return Receipt(False, reason)
        setpoint, words = limited(setpoint, self._settings.limits, self._plant.preset.tilt_limit)
        if words and not self._settings.clamp:
            return Receipt(False, words)
        self._guidance.accept(setpoint)
        self._setpoint_time = t
        return Receipt(True, words)

    def update(self, t: float) -> None:
        """Command the plant for the step that begins at ``t`` [s]."""
        rc = self.rc
        if rc.connected:
            self._rc_seen = t
            # Leaving F ends SDK control, and coming back does not restore it (section 5).
            self.authority = self.authority and rc.mode == "F"
        if self._setpoint_time is not None:
            age = t - self._setpoint_time
            if age > self._settings.cmd_timeout + 1e-9 or not rc.allows_sdk:
                self._setpoint_time = None
        _BEHAVIOUR[self.phase](self, t)

    @property
    def _has_position(self) -> bool:
        return self.gps_health >= GOOD_GPS

    def _objection(self, setpoint: Setpoint) -> str:
        """Return why a setpoint is ignored; empty if it is not."""
        if not self.rc.allows_sdk:
            return f"the RC is in {self.rc.mode}" if self.rc.connected else "the RC is off"
        if not self.authority:
            return "no control authority"
        armed = self.phase is Phase.STANDBY and self._plant.motors_on
        if self.phase is not Phase.FLYING and (self._settings.setpoints_need_air or not armed):
            return f"the aircraft is {self.phase.value}"
        if setpoint.horizontal is not Horizontal.ANGLE and not self._has_position:
            return f"gps_health is {self.gps_health}, {setpoint.horizontal.name} needs {GOOD_GPS}"
        return ""

    def _enter(self, t: float, phase: Phase) -> None:
        self.phase = phase
        self._since = t
        self._grounded_since: Optional[float] = None
        self._setpoint_time: Optional[float] = None  # None: no setpoint to follow
        self._loops.release_position()
        self._loops.release_height()

    def _stand(self, t: float) -> None:
        """On the ground: motors off, idle, or after a setpoint where that is allowed."""
        if self._setpoint_time is not None:
            self._plant.command(*self._guidance.follow(self._home[2]))
            if not self._plant.on_ground:
                self._home = (*self._plant.position[:2], 0.0)
                self.phase = Phase.FLYING
            return
        self._plant.command(0.0, 0.0, 0.0, 0.0)
        if self.phase is Phase.LANDED and t - self._since >= self._settings.landed_time:
            self._enter(t, Phase.STANDBY)

    def _spin_up(self, t: float) -> None:
        self._plant.command(0.0, 0.0, 0.0, 0.0)
        if t - self._since >= self._settings.spin_up_time:
            self._enter(t, Phase.TAKING_OFF)

    def _take_off(self, t: float) -> None:
        target = self._home[2] + self._settings.takeoff_height
        percent = self._loops.height(target, self._settings.takeoff_speed)
        self._plant.command(*self._hold_or_level(), percent, 0.0)
        if abs(target - self._plant.position[2]) < 0.1 and abs(self._plant.velocity[2]) < 0.2:
            self._enter(t, Phase.FLYING)
            self._loops.take_height(target)

    def _land(self, t: float) -> None:
        settings = self._settings
        speed = self.height / settings.descent_time_constant
        speed = min(max(speed, settings.landing_speed), settings.descent_speed)
        percent = self._loops.climb(-speed)
        self._plant.command(*self._hold_or_level(), percent, 0.0)
        self._stop_if_down(t, percent)

    def _go_home(self, t: float) -> None:
        settings, (x, y, _) = self._settings, self._plant.position
        arrived = math.hypot(x - self._home[0], y - self._home[1]) < HOME_RADIUS
        if arrived or not self._has_position:
            self._enter(t, Phase.LANDING)
            return
        if self.height < settings.go_home_height - 1.0:
            height = self._home[2] + settings.go_home_height
            percent = self._loops.height(height, settings.limits.vertical_velocity)
            tilt = self._loops.hold()
        else:
            percent = self._loops.hold_height()
            tilt = self._loops.position(*self._home[:2], speed=settings.limits.horizontal_velocity)
        self._plant.command(*tilt, percent, 0.0)

    def _fly(self, t: float) -> None:
        if t - self._rc_seen > self._settings.rc_lost_time:
            self._enter(t, Phase.GOING_HOME)
            return
        if self._setpoint_time is not None:
            command = self._guidance.follow(self._home[2])
        else:
            command = self._guidance.follow_sticks(self.rc, self._has_position)
        self._plant.command(*command)
        self._stop_if_down(t, command[2])

    def _stop_if_down(self, t: float, percent: float) -> None:
        """Stop the motors once the aircraft has stood on the ground with little thrust."""
        if not self._plant.on_ground or percent > CARRYING * self._plant.preset.hover_percent:
            self._grounded_since = None
        elif self._grounded_since is None:
            self._grounded_since = t
        elif t - self._grounded_since >= self._settings.touchdown_time:
            self._plant.motors_on = False
            self._enter(t, Phase.LANDED)

    def _hold_or_level(self) -> Tuple[float, float]:
        """Return roll and pitch [rad] that hold the position, or level without one."""
        return self._loops.hold() if self._has_position else (0.0, 0.0)


_BEHAVIOUR = {
    Phase.STANDBY: Autopilot._stand,
    Phase.SPINNING_UP: Autopilot._spin_up,
    Phase.TAKING_OFF: Autopilot._take_off,
    Phase.FLYING: Autopilot._fly,
    Phase.GOING_HOME: Autopilot._go_home,
    Phase.LANDING: Autopilot._land,
    Phase.LANDED: Autopilot._stand,
}
