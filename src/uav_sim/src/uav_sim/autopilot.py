# SPDX-License-Identifier: MIT
"""The M100's flight controller: authority, tasks, acceptance of setpoints, and flight without them.

Follows doc/dji_sdk.md sections 3.5, 4, 5, 9; what that page marks as open is a parameter in
``common.yaml``.
"""

from collections import deque
from typing import Deque, List, Optional

from uav_sim.authority import Ack, ControlAuthority
from uav_sim.auto_flight import AutoFlight
from uav_sim.flight_loops import FlightLoops
from uav_sim.guidance import Guidance
from uav_sim.low_battery import LowBattery
from uav_sim.phase import FLIGHT_STATUS, GOOD_GPS, TASK_TAKE_OFF, TASKS, Phase, task_objection
from uav_sim.plant import Plant
from uav_sim.remote_control import RemoteControl
from uav_sim.setpoint import Horizontal, Receipt, Setpoint, limited

STICK_COMMAND_TIME = 1.0  # [s] sticks held in their lower corners start the motors; assumption
LIFT_OFF_THROTTLE = 0.1  # [1] stick above centre with which the pilot lifts off; assumption
CARRYING = 0.9  # [1] less than this part of the hover thrust does not carry the aircraft


class Autopilot:
    """Flies a plant on its own, after setpoints, or after the pilot's sticks.

    ``refusal`` says why the last request for motors or a task was refused; empty: it was not.
    """

    def __init__(self, plant: Plant, rc: RemoteControl) -> None:
        self.rc = rc
        self.gps_health = 5
        self.refusal = ""
        self._plant = plant
        self._settings = plant.preset.flight_controller
        self._undocumented = self._settings.undocumented
        self.low_battery = LowBattery(self._settings)
        self.control = ControlAuthority(rc, self._undocumented)
        self._events: Deque[str] = deque(maxlen=100)  # for whoever asks, if anybody does
        self._modes: Optional[tuple] = None  # of the setpoint followed last
        self._loops = FlightLoops(plant)
        self._guidance = Guidance(plant, self._loops)
        self._auto = AutoFlight(plant, self._loops)
        self.start(0.0, airborne=False)

    def start(self, t: float, airborne: bool, authority: bool = False) -> None:
        """Take over a plant just placed at ``t`` [s] on the ground, or hovering in the air."""
        x, y, z = self._plant.position
        self._home = (x, y, 0.0 if airborne else z)
        self._t = self._rc_seen = self._corners_since = t
        self.control.held = authority
        self.low_battery.start()
        preset = self._plant.preset
        lift = preset.thrust.acceleration(self._plant.hover_percent)
        self._loops.start(vertical_trim=lift - preset.gravity if airborne else 0.0)
        self._enter(t, Phase.FLYING if airborne else Phase.STANDBY)

    @property
    def flight_status(self) -> int:
        """flight_status of an M100; it is 3 as soon as a take-off leaves the ground (2.3)."""
        if self.phase is Phase.STANDBY and self._plant.motors_on:
            return self._undocumented.idle_flight_status
        if self.phase is Phase.TAKING_OFF and not self._plant.on_ground:
            return 3
        return FLIGHT_STATUS[self.phase]

    @property
    def height(self) -> float:
        """Height above the take-off spot [m], as taken when it took off."""
        return self._plant.position[2] - self._home[2]

    def crash(self, t: float, words: str) -> None:
        """Stop the motors for good, at ``t`` [s]."""
        self._plant.motors_on = False
        self._events.append(f"crashed: {words}; the motors stay off")
        self._enter(t, Phase.CRASHED)

    def take_events(self) -> List[str]:
        """Return in words what has happened since the last call and no topic shows."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def control_authority(self, enable: bool) -> Ack:
        """Obtain or release the control authority."""
        ack = self.control.request(self._t, enable)
        if not self.control.held:
            self._setpoint_time = None
        return ack

    def arm(self, t: float, start: bool) -> Ack:
        """Start or stop the motors on the ground."""
        if not self.control.held:
            ack, self.refusal = 1, "no control authority"
        elif start == self._plant.motors_on:
            ack, self.refusal = 2, f"the motors are {'on' if start else 'off'} already"
        elif self.phase not in (Phase.STANDBY, Phase.LANDED):
            ack, self.refusal = 3, f"the aircraft is {self.phase.value}"
        else:
            ack, self.refusal = 0, ""
            self._plant.motors_on = start
            self._loops.start()
            self._enter(t, Phase.STANDBY)
        return Ack(ack == 0, 1, 5, ack)

    def task(self, t: float, number: int) -> Ack:
        """Start a task; an M100 answers 2 for started and 1 for refused."""
        self.refusal = self._task_objection(number)
        if self.refusal:
            return Ack(False, 1, 1, 1)
        if number == TASK_TAKE_OFF:
            self._plant.motors_on = True
            self._home = self._plant.position
            self._loops.start()
        self._enter(t, TASKS[number])
        return Ack(True, 1, 1, 2)

    def setpoint(self, t: float, setpoint: Setpoint) -> Receipt:
        """Take a setpoint, or ignore it as the real one does: without an answer on the wire."""
        reason = self._objection(setpoint)
        if reason:
            return Receipt(False, reason)
        setpoint, words = limited(setpoint, self._settings.limits, self._plant.preset.tilt_limit)
        if words and not self._settings.clamp:
            return Receipt(False, words)
        if self._setpoint_time is None or setpoint.modes != self._modes:
            self._modes = setpoint.modes
            self._events.append(f"following setpoints: {setpoint.words}")
        self._guidance.accept(setpoint, self._has_position)
        self._setpoint_time = t
        return Receipt(True, words)

    def update(self, t: float) -> None:
        """Command the plant for the step that begins at ``t`` [s]."""
        self._t, rc = t, self.rc
        if rc.connected:
            self._rc_seen = t
        if self.control.update():
            self._events.append(f"control authority lost: the RC's switch is in {rc.mode}")
        if rc.connected and rc.mode != "F":
            self._hand_over(t)
        if self.low_battery.is_low:
            demand = self.low_battery.demand(self.phase, self._has_position)
            if demand:
                self._events.append(demand[1])
                self._enter(t, demand[0])
        if self._setpoint_time is not None:
            silence = t - self._setpoint_time
            if silence > self._settings.cmd_timeout + 1e-9 or not rc.allows_sdk:
                self._setpoint_time = None
                self._events.append(f"no setpoint for {silence:.2f} s: {self._without_setpoint}")
        self._behaviour(self, t)

    @property
    def authority(self) -> bool:
        """Whether the onboard computer holds the control authority."""
        return self.control.held

    @authority.setter
    def authority(self, held: bool) -> None:
        self.control.held = held
        if not held:
            self._setpoint_time = None

    @property
    def _without_setpoint(self) -> str:
        hovers = self._has_position and self._undocumented.silence == "hover"
        return f"{'brake and hover' if hovers else 'level, hold height'}; the sticks are live"

    @property
    def _has_position(self) -> bool:
        return self.gps_health >= GOOD_GPS

    def _objection(self, setpoint: Setpoint) -> str:
        """Return why a setpoint is ignored; empty if it is not."""
        objection = self.control.objection()
        if objection:
            return objection
        armed = self.phase is Phase.STANDBY and self._plant.motors_on
        if self.phase is not Phase.FLYING and (self._settings.setpoints_need_air or not armed):
            return f"the aircraft is {self.phase.value}"
        if setpoint.horizontal is not Horizontal.ANGLE and not self._has_position:
            return f"gps_health is {self.gps_health}, {setpoint.horizontal.name} needs {GOOD_GPS}"
        return ""

    def _task_objection(self, number: int) -> str:
        """Return why a task is refused; empty if it is not."""
        if number not in TASKS:
            return "no such task"
        objection = self.control.objection(self._undocumented.tasks_need_authority)
        state = (self.phase, self._plant.motors_on, self.gps_health)
        return objection or task_objection(number, *state)

    def _hand_over(self, t: float) -> None:
        """End a task that runs while the switch is out of F: the pilot has it (section 5)."""
        forced = self.phase is Phase.LANDING and self.low_battery.lands
        if forced or self.phase not in (*TASKS.values(), Phase.TAKING_OFF):
            return
        self._events.append(f"{self.phase.value} ended: the RC's switch is in {self.rc.mode}")
        if self._plant.on_ground and self.phase is not Phase.LANDING:
            self._plant.motors_on = False
            self._enter(t, Phase.STANDBY)
        else:
            self._enter(t, Phase.FLYING)

    def _enter(self, t: float, phase: Phase) -> None:
        self.phase, self._behaviour = phase, _BEHAVIOUR[phase]
        self._since = t
        self._grounded_since: Optional[float] = None
        self._setpoint_time: Optional[float] = None  # None: no setpoint to follow
        self._loops.release_position()
        self._loops.release_height()

    def _stand(self, t: float) -> None:
        """On the ground: motors off, idle, or after a setpoint where that is allowed."""
        if self._setpoint_time is not None:
            if self._plant.on_ground:
                self._home = self._plant.position
            else:
                self.phase, self._behaviour = Phase.FLYING, Autopilot._fly
            self._plant.command(*self._guidance.follow(self._home[2]))
            return
        self._plant.command(0.0, 0.0, 0.0, 0.0)
        self._obey_pilot(t)
        if self.phase is Phase.LANDED and t - self._since >= self._settings.landed_time:
            self._enter(t, Phase.STANDBY)

    def _obey_pilot(self, t: float) -> None:
        """Start the motors after the pilot's stick command, lift off when he gives throttle."""
        if not self.rc.starts_motors:
            self._corners_since = t
        elif not self._plant.motors_on and t - self._corners_since >= STICK_COMMAND_TIME:
            self._plant.motors_on = True
            self._loops.start()
            self._enter(t, Phase.STANDBY)
        if self._plant.motors_on and self.rc.sticks()[3] > LIFT_OFF_THROTTLE:
            self._home = self._plant.position
            self._enter(t, Phase.FLYING)

    def _spin_up(self, t: float) -> None:
        self._plant.command(0.0, 0.0, 0.0, 0.0)
        if t - self._since >= self._settings.spin_up_time:
            self._enter(t, Phase.TAKING_OFF)

    def _take_off(self, t: float) -> None:
        target = self._home[2] + self._settings.takeoff_height
        self._plant.command(*self._auto.take_off(target, self._has_position))
        if abs(target - self._plant.position[2]) < 0.1 and abs(self._plant.velocity[2]) < 0.2:
            self._enter(t, Phase.FLYING)
            self._loops.take_height(target)

    def _land(self, t: float) -> None:
        command = self._auto.descend(self.height, self._has_position)
        self._plant.command(*command)
        self._stop_if_down(t, command[2])

    def _go_home(self, t: float) -> None:
        if self._auto.is_home(self._home) or not self._has_position:
            self._enter(t, Phase.LANDING)
        else:
            self._plant.command(*self._auto.go_home(self._home))

    def _fly(self, t: float) -> None:
        if t - self._rc_seen > self._settings.rc_lost_time:
            self._events.append(f"no RC for {self._settings.rc_lost_time:g} s: flying home")
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


_BEHAVIOUR = {
    Phase.STANDBY: Autopilot._stand,
    Phase.SPINNING_UP: Autopilot._spin_up,
    Phase.TAKING_OFF: Autopilot._take_off,
    Phase.FLYING: Autopilot._fly,
    Phase.GOING_HOME: Autopilot._go_home,
    Phase.LANDING: Autopilot._land,
    Phase.LANDED: Autopilot._stand,
    Phase.CRASHED: lambda self, _: self._plant.command(0.0, 0.0, 0.0, 0.0),
}
