# SPDX-License-Identifier: MIT
"""What an M100's flight controller is doing, and what flight_status says of it (doc 2.3)."""

import enum

GOOD_GPS = 3  # velocity and position setpoints, and position hold, need this gps_health (3.4)
TASK_GO_HOME, TASK_TAKE_OFF, TASK_LAND = 1, 4, 6
_MOTORS_ON = "the motors are on already"


class Phase(enum.Enum):
    """What the flight controller is doing."""

    STANDBY = "on the ground"
    SPINNING_UP = "starting the motors"
    TAKING_OFF = "taking off"
    FLYING = "in the air"
    GOING_HOME = "flying home"
    LANDING = "landing"
    LANDED = "just landed"
    CRASHED = "crashed"


# Number of a task -> what it begins with.
TASKS = {
    TASK_GO_HOME: Phase.GOING_HOME,
    TASK_TAKE_OFF: Phase.SPINNING_UP,
    TASK_LAND: Phase.LANDING,
}
FLIGHT_STATUS = {
    Phase.STANDBY: 1,
    Phase.SPINNING_UP: 2,
    Phase.TAKING_OFF: 2,
    Phase.FLYING: 3,
    Phase.GOING_HOME: 3,
    Phase.LANDING: 4,
    Phase.LANDED: 5,
    Phase.CRASHED: 1,
}


def task_objection(number: int, phase: Phase, motors_on: bool, gps_health: int) -> str:
    """Return why a task of ``TASKS`` cannot begin now, whoever asks; empty if it can."""
    elsewhere = f"the aircraft is {phase.value}"
    if number == TASK_TAKE_OFF:
        standing = phase is Phase.STANDBY
        return "" if standing and not motors_on else _MOTORS_ON if standing else elsewhere
    if number == TASK_LAND:
        return "" if phase in (Phase.TAKING_OFF, Phase.FLYING, Phase.GOING_HOME) else elsewhere
    if gps_health < GOOD_GPS:
        return f"gps_health is {gps_health}, needed is {GOOD_GPS}"
    return "" if phase is Phase.FLYING else elsewhere
