# SPDX-License-Identifier: MIT
"""What the M100's serial link brings to dji_sdk: packets at 100 Hz after the link's dead time.

Order, rates, frames, units, signs follow doc/dji_sdk.md section 2; a packet is stamped on receipt.
"""

import math
from collections import deque
from math import cos, sin
from typing import Any, Callable, Deque, List, NamedTuple, Optional, Tuple

from uav_sim.link import TelemetryLink, insert
from uav_sim.plant import Plant, Vector
from uav_sim.preset import GeoPoint
from uav_sim.sensors import Sensors

EARTH_RADIUS = 6378137.0  # [m] of dji_sdk's flat-earth conversion (2.2)
REFERENCE_GPS = 3  # set_local_pos_ref needs a gps_health above this (section 4)

_MEDIUM, _SLOW = 2, 10  # packets from one sending to the next: 50 and 10 Hz
_INERTIAL = 2  # values in a packet that says nothing of positions

Values = List[Tuple[str, Any]]  # topic and value


class Packet(NamedTuple):
    """One message: the topic below ``dji_sdk/``, its stamp and its value."""

    topic: str
    t: float  # [s]
    value: Any  # see Telemetry


class Imu(NamedTuple):
    """Value of ``imu``."""

    orientation: Tuple[float, float, float, float]  # x, y, z, w, body FLU to ENU
    angular_velocity: Vector  # [rad/s] body FLU
    linear_acceleration: Vector  # [m/s^2] specific force, body FLU: +9.8 on z at rest


class Status(NamedTuple):
    """What the flight controller reports beside the plant's state."""

    rc: Tuple[float, ...]  # six axes
    gps_health: int  # 0..5
    height: float  # [m] above take-off
    flight_status: int  # of the M100's enumeration
    battery: float  # [percent] state of charge


def quaternion(roll: float, pitch: float, yaw: float) -> Tuple[float, float, float, float]:
    """Return x, y, z, w of roll, pitch, yaw [rad] about x, y, z."""
    roll, pitch, yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    cc, ss, cs, sc = cr * cp, sr * sp, cr * sp, sr * cp
    return (sc * cy - cs * sy, cs * cy + sc * sy, cc * sy - ss * cy, cc * cy + ss * sy)


def body_rates(rpy: Vector, rpy_rates: Vector) -> Vector:
    """Return the angular velocity (3,) [rad/s] in body axes from Euler angles and their rates."""
    return body_motion(rpy, rpy_rates, (0.0, 0.0, 0.0))[0]


def to_body(rpy: Vector, vector: Vector) -> Vector:
    """Return a world vector (3,) in body axes."""
    return body_motion(rpy, (0.0, 0.0, 0.0), vector)[1]


def body_motion(rpy: Vector, rpy_rates: Vector, vector: Vector) -> Tuple[Vector, Vector]:
    """Return angular velocity (3,) [rad/s] and a world vector (3,), both in body axes."""
    (roll, pitch, yaw), (d_roll, d_pitch, d_yaw), (x, y, z) = rpy, rpy_rates, vector
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    upright = d_yaw * cp
    rates = (d_roll - d_yaw * sp, d_pitch * cr + upright * sr, upright * cr - d_pitch * sr)
    ahead, left = cy * x + sy * y, cy * y - sy * x
    down_tilted = sp * ahead + cp * z
    turned = (cp * ahead - sp * z, cr * left + sr * down_tilted, cr * down_tilted - sr * left)
    return rates, turned


class LocalFrame:
    """dji_sdk's flat earth: positions on earth, and local ones once a reference is set."""

    def __init__(self, home: GeoPoint) -> None:
        self.home = home
        self.reference: Optional[GeoPoint] = None

    def to_earth(self, position: Vector) -> GeoPoint:
        """Return the place of a world position (3,) [m]; ``to_local`` from home inverts it."""
        home = self.home
        latitude = home.latitude + math.degrees(position[1] / EARTH_RADIUS)
        circle = EARTH_RADIUS * math.cos(math.radians(latitude))
        longitude = home.longitude + math.degrees(position[0] / circle)
        return GeoPoint(latitude, longitude, home.altitude + position[2])

    def to_world(self, place: GeoPoint) -> Vector:
        """Return the world position (3,) [m] of a place; inverts ``to_earth``."""
        return _from_origin(place, self.home)

    def to_local(self, place: GeoPoint) -> Vector:
        """Return east, north, up [m] of a place from the reference, as dji_sdk computes them."""
        return _from_origin(place, self.reference)


def _from_origin(place: GeoPoint, origin: GeoPoint) -> Vector:
    circle = EARTH_RADIUS * math.cos(math.radians(place.latitude))
    return (
        math.radians(place.longitude - origin.longitude) * circle,
        math.radians(place.latitude - origin.latitude) * EARTH_RADIUS,
        place.altitude - origin.altitude,
    )


class Telemetry:
    """Samples a plant and delivers packets after the link's dead time.

    Values: ``attitude`` x, y, z, w; ``imu`` Imu; ``velocity`` [m/s], ``local_position`` [m] and
    ``gimbal_angle`` [deg] (3,); ``gps_position`` and ``local_frame_ref`` GeoPoint; ``rc`` six axes;
    ``gps_health``, ``flight_status``; ``height_above_takeoff`` [m]; ``battery_state`` [percent].
    """

    def __init__(self, plant: Plant) -> None:
        self.frame = LocalFrame(plant.preset.home)
        self.sensors: Optional[Sensors] = None  # None: exact
        self.link: Optional[TelemetryLink] = None  # None: nothing but the dead time
        self._plant = plant
        self._delay = plant.preset.delay.telemetry
        self._velocity_z_sign = plant.preset.flight_controller.undocumented.velocity_z_sign
        self._gravity = plant.preset.gravity
        self._scale = plant.preset.gravity_const / plant.preset.gravity
        self._count = 0
        self._pending: Deque[Tuple[float, Values]] = deque()  # when they arrive [s], what
        self._place: Optional[GeoPoint] = None  # newest gps_position and gps_health received
        self._health = 0

    @property
    def origin(self) -> Vector:
        """Where in the world (3,) [m] ``local_position`` truly counts from; without one, 0."""
        if self.frame.reference is None:
            return (0.0, 0.0, 0.0)
        x, y, z = self.frame.to_world(self.frame.reference)
        ex, ey, ez = self.sensors.reference_error if self.sensors is not None else (0.0, 0.0, 0.0)
        return (x - ex, y - ey, z - ez)

    def set_local_position_reference(self, t: float) -> bool:
        """Make the newest GPS position the origin of ``local_position``; a refusal clears it."""
        if self._place is None or self._health <= REFERENCE_GPS:
            self.frame.reference = None
            return False
        self._refer(t, self._place)
        return True

    def refer_to_home(self, t: float) -> None:
        """Make the world's origin that of ``local_position``, whatever has been received."""
        self._refer(t, self.frame.home)

    def sample(self, t: float, status: Callable[[], Status]) -> None:
        """Send the packet of time ``t`` [s]; to be called every 0.01 s.

        Args:
            t: time of sampling [s].
            status: returns what the 50 Hz topics say beside the plant's state; asked only for them.
        """
        count, plant = self._count, self._plant
        self._count += 1
        rpy = plant.rpy
        ax, ay, az = plant.acceleration
        scale, sensors = self._scale, self.sensors
        force = (scale * ax, scale * ay, scale * (az + self._gravity))
        rates, acceleration = body_motion(rpy, plant.rpy_rates, force)
        if sensors is not None:
            rpy, rates, acceleration = sensors.inertial(rpy, rates, acceleration)
        attitude = quaternion(*rpy)
        imu = tuple.__new__(Imu, (attitude, rates, acceleration))  # Imu(...) at half the cost
        values: Values
        if count % _MEDIUM:
            values = [("attitude", attitude), ("imu", imu)]
        else:
            rc, gps_health, height, flight_status, battery = status()
            position, velocity = plant.position, plant.velocity
            if sensors is not None:
                position, velocity, height = sensors.navigation(position, velocity, height)
            place = self.frame.to_earth(position)
            if sensors is not None:
                sensors.reported(place)
            vx, vy, vz = velocity
            heading = math.remainder(90.0 - math.degrees(rpy[2]), 360.0)
            values = [
                ("rc", rc),
                ("attitude", attitude),
                ("imu", imu),
                ("gps_health", gps_health),
                ("gps_position", place),
                ("height_above_takeoff", height),
                ("velocity", (vx, vy, self._velocity_z_sign * vz)),
                ("flight_status", flight_status),
                ("gimbal_angle", (0.0, 0.0, heading)),
            ]
            if count % _SLOW == 0:
                values.insert(-2, ("battery_state", battery))
        received = t + self._delay
        pending = self._pending
        if self.link is None:
            pending.append((received, values))
            return
        newest = pending[-1][0] if pending else received
        for arrival, topic, value in self.link.arrivals(received, values):
            part = (arrival, [(topic, value)])
            if arrival >= newest:
                newest = arrival
                pending.append(part)
            else:
                insert(pending, part)

    def due(self, t: float) -> List[Packet]:
        """Return the packets received until ``t`` [s], oldest first."""
        pending, packets, limit = self._pending, [], t + 1e-9
        make = tuple.__new__  # Packet(...) at half the cost
        while pending and pending[0][0] <= limit:
            received, values = pending.popleft()
            if len(values) != _INERTIAL:
                values = self._noted(values)
            packets += [make(Packet, (topic, received, value)) for topic, value in values]
        return packets

    def _noted(self, values: Values) -> Values:
        """Return received values with the local position, which the node computes on receipt."""
        for k, (topic, value) in enumerate(values, 1):
            if topic == "gps_health":
                self._health = value
            elif topic == "gps_position":
                self._place = value
                # A reference counts from the next packet on.
                if self.frame.reference is not None:
                    values.insert(k, ("local_position", self.frame.to_local(value)))
                break  # the last one of interest
        return values

    def _refer(self, t: float, place: GeoPoint) -> None:
        if self.sensors is not None:
            self.sensors.refer(place)
        self.frame.reference = place
        self._pending.appendleft((t, [("local_frame_ref", place)]))
