# SPDX-License-Identifier: MIT
"""What an M100's flight controller is doing, and what flight_status says of it (doc 2.3)."""

import enum

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
}
