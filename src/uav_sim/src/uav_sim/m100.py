# SPDX-License-Identifier: MIT
"""A simulated M100 as seen through dji_sdk, without ROS: setpoints and requests in, packets out."""

import math
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, TypeVar

import numpy as np

from uav_sim.autopilot import Ack, Autopilot, Phase
from uav_sim.battery import Battery
from uav_sim.body import BodyState
from uav_sim.disturbance import Disturbance
from uav_sim.errors import SetpointError
from uav_sim.faults.engine import NO_RESPONSE, Faults
from uav_sim.laser import Laser
from uav_sim.link import Channel
from uav_sim.plant import Plant, Vector
from uav_sim.preset import PACKET_PERIOD, PlantPreset
from uav_sim.remote_control import RemoteControl
from uav_sim.sensors import Sensors
from uav_sim.setpoint import Receipt, Setpoint, decode
from uav_sim.telemetry import Packet, Status, Telemetry, body_rates
from uav_sim.vicon import Vicon, ViconPose
from uav_sim.wind import Wind
from uav_sim.world import Collision, World

T = TypeVar("T")
DRAIN_PERIOD = 0.1  # [s] the battery is looked after as often as it is reported


class Truth(NamedTuple):
    """True state, without delay; world ENU, body FLU."""

    t: float  # [s]
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    rpy: Vector  # [rad] roll, pitch, yaw in (-pi, pi]
    rates: Vector  # [rad/s] angular velocity in body axes


class SimulatedM100:
    """Plant, flight controller, link and surroundings on one clock; deterministic.

    Begins on the ground at the world's origin with motors off and the RC in F. ``rc`` as well as
    ``wind``, ``thrust_gain`` and ``mass_factor`` of ``plant`` may be changed at any time;
    ``faults`` are begun and ended at any time or by schedule.
    A disturbance draws from streams of its own and belongs to one aircraft.
    """

    def __init__(
        self,
        preset: PlantPreset,
        world: Optional[World] = None,
        disturbance: Optional[Disturbance] = None,
    ) -> None:
        self.preset = preset
        self.t = 0.0  # [s]
        self._battery = Battery(preset.battery)
        self.rc = RemoteControl()
        self.plant = Plant(preset)
        self.autopilot = Autopilot(self.plant, self.rc)
        self.world = world or World((), preset.radius)
        self.disturbance = disturbance
        self.new_poses: List[ViconPose] = []  # received in the last step
        self.late_receipts: List[Receipt] = []  # of setpoints that arrived in the last step
        self.laser: Optional[Laser] = None  # may be set before the first step
        # Obstacles in the frame of local_position; where there is motion capture, in the world's.
        self.senses_locally = disturbance is None or disturbance.vicon is None
        self.new_scan: Optional[np.ndarray] = None  # (n,) [m] taken in the last step
        seed = disturbance.seed if disturbance is not None else 0
        self.faults = Faults(self, f"{seed}/{self.world.name}")
        self._telemetry = Telemetry(self.plant)
        self._steps, self._step = 0, preset.step
        self._rc_values = preset.flight_controller.rc
        self._steps_per_packet = round(PACKET_PERIOD / preset.step)
        self._steps_per_drain = round(DRAIN_PERIOD / preset.step)
        self._wind: Optional[Wind] = None
        self._commands: Optional[Channel] = None
        self._vicon: Optional[Vicon] = None
        self._navigation: Optional[Sensors] = None  # where the flight controller is off its place
        if disturbance is not None:
            self._disturb(disturbance)

    def place(
        self,
        position: Sequence[float],
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        airborne: bool = True,
        authority: bool = False,
    ) -> None:
        """Begin a flight at a position (3,) [m], hovering with motors on or standing on the ground.

        In the air, the world's origin is the local position's reference already. Collisions and
        clearances are counted anew.
        """
        self.plant.place(position, velocity, yaw, airborne)
        self._navigate(self.autopilot.start, self.t, airborne, authority)
        self.world.reset()
        if airborne:
            self._telemetry.refer_to_home(self.t)

    def step(self) -> List[Packet]:
        """Advance by ``preset.step``; return the packets received in it, oldest first."""
        plant = self.plant
        faults = self.faults
        if not faults.rest:
            faults.update(self.t)
        if self._wind is not None and self._steps % self._wind.steps == 0:
            plant.wind = self._wind.advance(plant.position[2], plant.velocity)
        if self._commands is not None:
            arrived = self._commands.receive(self.t)
            self.late_receipts = [self._accept(setpoint) for setpoint in arrived]
        if self._navigation is None:
            self.autopilot.update(self.t)
        else:
            self._navigate(self.autopilot.update, self.t)
        flew = not plant.on_ground
        plant.step()
        self._steps += 1
        self.t = self._steps * self._step
        self.world.observe(self.t, plant.position)
        if flew and plant.on_ground:
            self._touch_down()
        if self._vicon is not None:
            self.new_poses = self._vicon.poses(self.t, plant.position, plant.rpy)
        if self.laser is not None:
            self._scan(self.laser)
        if self._steps % self._steps_per_packet == 0:
            if self._steps % self._steps_per_drain == 0:
                self._drain()
            self._telemetry.sample(self.t, self._status)
        packets = self._telemetry.due(self.t)
        return packets if faults.rest else faults.filter(self.t, packets)

    def run(self, duration: float) -> List[Packet]:
        """Advance by a duration [s]; return all packets received."""
        step, packets = self.step, []
        for _ in range(round(duration / self.preset.step)):
            packets += step()
        return packets

    def setpoint(self, suffix: str, axes: Sequence[float]) -> Receipt:
        """Send axes on the topic ``flight_control_setpoint_<suffix>``; say what became of them."""
        fault = "" if self.faults.rest else self.faults.objection(suffix)
        if fault:
            return Receipt(False, fault)
        try:
            setpoint = decode(suffix, axes)
        except SetpointError as error:
            return Receipt(False, str(error))
        if self._commands is not None:
            self._commands.send(self.t, setpoint)
            return Receipt(True)
        return self._accept(setpoint)

    def control_authority(self, enable: bool) -> Ack:
        """Obtain or release the control authority."""
        return self._reply(1, 0) or self.autopilot.control_authority(enable)

    def arm(self, start: bool) -> Ack:
        """Start or stop the motors on the ground."""
        return self._reply(1, 5) or self.autopilot.arm(self.t, start)

    def task(self, number: int) -> Ack:
        """Start a task: 1 go home, 4 take off, 6 land."""
        return self._reply(1, 1) or self._navigate(self.autopilot.task, self.t, number)

    def set_local_position_reference(self) -> bool:
        """Make the newest GPS position the origin of ``local_position``."""
        return not self.faults.dead and self._telemetry.set_local_position_reference(self.t)

    def restart_driver(self) -> None:
        """Start dji_sdk's node anew: it knows no reference any more."""
        self._telemetry.frame.reference = None

    @property
    def battery(self) -> float:
        """State of charge [percent]."""
        return self._battery.percent

    @battery.setter
    def battery(self, percent: float) -> None:
        self._battery.percent = percent

    @property
    def phase(self) -> Phase:
        """What the flight controller is doing."""
        return self.autopilot.phase

    @property
    def truth(self) -> Truth:
        """True state at ``t``."""
        plant = self.plant
        roll, pitch, yaw = plant.rpy
        rpy = (roll, pitch, math.remainder(yaw, 2.0 * math.pi))
        return Truth(self.t, plant.position, plant.velocity, rpy, body_rates(rpy, plant.rpy_rates))

    @property
    def new_collisions(self) -> List[Collision]:
        """Collisions that began in the last step."""
        return self.world.new_collisions

    @property
    def collisions(self) -> Tuple[Collision, ...]:
        """All collisions since the flight began."""
        return tuple(self.world.collisions)

    @property
    def sensed_obstacles(self) -> List[BodyState]:
        """Obstacles as sensed from the aircraft, in the frame of its ``local_position``.

        They count from the same origin, where that is known, and share its slow error; with
        ``senses_locally`` unset they stay in the world's frame.
        """
        states, disturbance = self.world.states(), self.disturbance
        shift = disturbance.shift if disturbance is not None else None
        dx, dy, dz = shift or (0.0, 0.0, 0.0)
        if self.senses_locally:
            x, y, z = self._telemetry.origin
            dx, dy, dz = dx - x, dy - y, dz - z
        if dx == dy == dz == 0.0:
            return states
        return [
            state._replace(position=(x + dx, y + dy, z + dz))
            for state in states
            for x, y, z in [state.position]
        ]

    @property
    def clearance(self) -> Dict[str, float]:
        """Least distance [m] from hull to each obstacle's surface since the flight began, by id."""
        return self.world.clearance

    def _status(self) -> Status:
        autopilot = self.autopilot
        return Status(
            rc=self.rc.axes(self._rc_values),
            gps_health=autopilot.gps_health,
            height=autopilot.height,
            flight_status=autopilot.flight_status,
            battery=float(math.ceil(self._battery.percent)),
        )

    def _drain(self) -> None:
        """Discharge by the present thrust, and sag."""
        battery, plant = self._battery, self.plant
        if plant.motors_on:
            battery.discharge(plant.thrust_force, DRAIN_PERIOD)
        plant.battery_gain = battery.thrust_gain
        self.autopilot.low_battery.take(battery.percent)

    def _reply(self, cmd_set: int, cmd_id: int) -> Optional[Ack]:
        """Return the reply of a dead node: none; None if it lives."""
        return Ack(False, cmd_set, cmd_id, NO_RESPONSE) if self.faults.dead else None

    def _accept(self, setpoint: Setpoint) -> Receipt:
        if self._navigation is None:
            return self.autopilot.setpoint(self.t, setpoint)
        return self._navigate(self.autopilot.setpoint, self.t, setpoint)

    def _navigate(self, act: Callable[..., T], *args: Any) -> T:
        """Have the flight controller act where it believes to be: GPS and barometer are off."""
        if self._navigation is None:
            return act(*args)
        plant, (ex, ey, ez) = self.plant, self._navigation.belief
        x, y, z = true = plant.position
        plant.position = (x + ex, y + ey, z + ez)
        try:
            return act(*args)
        finally:
            plant.position = true

    def _touch_down(self) -> None:
        """Take note of a crash: too hard, or tilted."""
        plant, touchdown = self.plant, self.preset.touchdown
        speed = math.hypot(*plant.velocity[:2], plant.impact_speed)
        tilt = math.hypot(*plant.rpy[:2])
        if self.phase is not Phase.CRASHED and touchdown.is_crash(speed, tilt):
            self.world.crash(self.t)
            words = f"touch-down at {speed:.1f} m/s, tilted {math.degrees(tilt):.0f} deg"
            self.autopilot.crash(self.t, words)

    def _scan(self, laser: Laser) -> None:
        self.new_scan = None
        if laser.due(self.t):
            plant = self.plant
            self.new_scan = laser.scan(plant.position, plant.rpy, self.world.states())

    def _disturb(self, disturbance: Disturbance) -> None:
        self.plant.thrust_gain = disturbance.thrust_gain
        self.plant.mass_factor = disturbance.mass_factor
        self.autopilot.gps_health = disturbance.parameters.gps_health
        self._telemetry.sensors = disturbance.sensors
        self._telemetry.link = disturbance.telemetry
        self._wind = disturbance.wind(self.preset.step)
        self._commands = disturbance.command
        self._vicon = disturbance.vicon
        self._navigation = disturbance.sensors
