"""A touch-down that breaks the aircraft is a collision, and nothing flies after it."""

import math

import pytest

from uav_sim.m100 import SimulatedM100
from uav_sim.phase import Phase
from uav_sim.preset import load_preset
from uav_sim.world import GROUND, World

PRESET = load_preset("dji_hil")


def falling(height=20.0, axes=(0.0, 0.0, 10.0, 0.0, 43.0), sim=None):
    """Return an aircraft after 8 s of too little thrust."""
    sim = sim or SimulatedM100(PRESET)
    sim.place((0.0, 0.0, height), authority=True)
    for _ in range(400):
        sim.setpoint("generic", axes)
        sim.run(0.02)
    return sim


def test_a_fall_is_a_collision_with_the_ground():
    sim = SimulatedM100(PRESET)
    sim.place((0.0, 0.0, 20.0), authority=True)
    while not sim.new_collisions:
        sim.setpoint("generic", (0.0, 0.0, 10.0, 0.0, 43.0))
        sim.step()
        assert sim.t < 10.0
    (crash,) = sim.new_collisions
    assert (crash.id, crash.t, crash.clearance) == (GROUND, sim.t, 0.0)
    assert sim.plant.on_ground and sim.plant.impact_speed > 5.0
    assert sim.phase is Phase.CRASHED and not sim.plant.motors_on
    assert "touch-down at" in " ".join(sim.autopilot.take_events())
    sim.step()
    assert sim.new_collisions == [] and sim.collisions == (crash,)


def test_nothing_starts_the_motors_after_a_crash():
    sim = falling()
    assert sim.control_authority(True).result, "the link lives"
    assert not sim.task(4).result and not sim.task(6).result and not sim.task(1).result
    assert sim.arm(True).ack_data == 3 and "crashed" in sim.autopilot.refusal
    assert "crashed" in sim.setpoint("generic", (0.0, 0.0, 60.0, 0.0, 43.0)).text
    sim.rc.mode = "P"
    sim.rc.roll, sim.rc.pitch, sim.rc.yaw, sim.rc.throttle = 1.0, -1.0, -1.0, -1.0
    sim.run(3.0)
    sim.rc.throttle = 1.0
    sim.run(2.0)
    assert sim.truth.position[2] == 0.0 and not sim.plant.motors_on
    assert [c.id for c in sim.collisions] == [GROUND], "one crash"
    assert sim.autopilot.flight_status == 1


def test_an_aircraft_placed_anew_flies_again():
    sim = falling()
    sim.place((0.0, 0.0, 0.0), airborne=False)
    assert sim.collisions == () and sim.phase is Phase.STANDBY
    sim.control_authority(True)
    assert sim.task(4).result
    sim.run(8.0)
    assert sim.truth.position[2] == pytest.approx(1.2, abs=0.1)


@pytest.mark.parametrize(
    ("velocity", "tilt", "crashes"),
    [
        ((0.0, 0.0, -1.8), 0.0, False),
        ((0.0, 0.0, -2.4), 0.0, True),
        ((2.4, 0.0, -0.3), 0.0, True),
        ((0.0, 0.0, -0.3), 0.3, False),
        ((0.0, 0.0, -0.3), 0.4, True),
    ],
)
def test_speed_and_tilt_decide(velocity, tilt, crashes):
    sim = SimulatedM100(PRESET)
    sim.place((0.0, 0.0, 1e-4), velocity)
    sim.plant.set_motion(velocity, (tilt, 0.0, 0.0), (0.0, 0.0, 0.0))
    sim.step()
    assert sim.plant.on_ground
    assert bool(sim.collisions) is crashes and (sim.phase is Phase.CRASHED) is crashes


@pytest.mark.parametrize("wind", [0.0, 10.0])
def test_a_landing_by_task_is_none(wind):
    sim = SimulatedM100(PRESET)
    sim.place((0.0, 0.0, 5.0), authority=True)
    sim.plant.wind = (wind, 0.0, 0.0)
    sim.run(5.0)
    assert sim.task(6).result
    sim.run(20.0)
    assert sim.phase is Phase.STANDBY and sim.collisions == ()


def test_a_crash_counts_beside_obstacles():
    """The ground is no obstacle: it has no clearance, but it is a collision among the others."""
    post = {"id": "post", "shape": "cylinder", "position": [3.0, 0.0, 1.0], "radius": 0.4}
    post["height"] = 2.0
    sim = falling(sim=SimulatedM100(PRESET, World.from_list([post], PRESET.radius)))
    assert [c.id for c in sim.collisions] == [GROUND]
    assert set(sim.clearance) == {"post"} and math.isfinite(sim.clearance["post"])
