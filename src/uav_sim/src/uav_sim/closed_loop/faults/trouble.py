# SPDX-License-Identifier: MIT
"""What goes wrong between the parts of a closed loop; ``uav_sim.faults`` has the aircraft's side.

One instance acts from ``begin`` until ``end``; a loop asks all that act at every joint.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Sequence

from nmpc_control.controller import Step
from nmpc_control.guard_data import Action
from nmpc_control.obstacle_sighting import Sighting
from uav_sim.telemetry import Packet
from uav_sim.vicon import ViconPose

if TYPE_CHECKING:
    from uav_sim.closed_loop.faults.faulty_loop import FaultyLoop

Solve = Callable[[], Optional[Step]]


@dataclass
class Trouble:
    """One kind of trouble; its fields are the parameters, by default it does nothing."""

    def scenery(self, situation: str, t: float) -> Sequence[Dict[str, Any]]:
        """Return obstacles that the world needs, for a trouble that begins at ``t`` [s]."""
        return ()

    def begin(self, loop: "FaultyLoop") -> None:
        """Begin, at ``loop.t``."""

    def clock(self) -> float:
        """Return by how much [s] the onboard computer's clock is off."""
        return 0.0

    def hear(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Return what becomes of the packets received at ``t`` [s]; called every step."""
        return packets

    def capture(self, poses: List[ViconPose]) -> List[ViconPose]:
        """Return what becomes of the poses of motion capture; called every step."""
        return poses

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Return what becomes of a list of obstacles; None: it does not come."""
        return sightings

    def crowd(self, t: float) -> Optional[List[Sighting]]:
        """Return what another sender says of obstacles at ``t`` [s]; None: there is none."""
        return None

    def solve(self, t: float, solve: Solve) -> Optional[Step]:
        """Return what comes of a control step at ``t`` [s]; may raise."""
        return solve()

    def deliver(self, t: float, steps: List[Step]) -> List[Step]:
        """Return the plans that reach the guard at ``t`` [s], of those sent; called every step."""
        return steps

    def runs(self, t: float) -> bool:
        """Return whether the guard's process runs at ``t`` [s]."""
        return True

    def before_judgement(self) -> None:
        """Act within the guard's tick; may raise."""

    def refuses(self, action: Action) -> bool:
        """Return whether dji_sdk refuses a call."""
        return False

    def call_time(self, action: Action) -> float:
        """Return for how long [s] a call of dji_sdk blocks."""
        return 0.0
