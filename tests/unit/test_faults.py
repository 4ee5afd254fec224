"""Every fault has its effect on what comes out of the aircraft, and the effect ends with it."""

import math

import pytest

from uav_sim.faults.kinds import KINDS
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset

HOVER = (0.0, 0.0, 10.0)
GENERIC, VELOCITY = "generic", "ENUvelocity_yawrate"


@pytest.fixture
def sim():
    aircraft = SimulatedM100(load_preset("dji_hil"))
    aircraft.place(HOVER, authority=True)
    fly(aircraft, 0.5)
    return aircraft


def fly(sim, duration, north=1.0):
    """Send a velocity north at 50 Hz; return the packets."""
    packets = []
    for _ in range(round(duration / 0.02)):
        sim.setpoint(VELOCITY, (0.0, north, 0.0, 0.0))
        packets += sim.run(0.02)
    return packets


def values(packets, topic):
    return [packet.value for packet in packets if packet.topic == topic]


def frozen(sim):
    seen = values(fly(sim, 0.4), "velocity")
    return len(seen) >= 19 and len(set(seen)) == 1


def dropped(sim):
    packets = fly(sim, 0.4)
    return not values(packets, "velocity") and len(values(packets, "attitude")) >= 39


def half_dropped(sim):
    return 5 <= len(values(fly(sim, 0.4), "velocity")) <= 15


def delayed(sim):
    """The fault is 0.3 s: what was flown at first comes now."""
    packets = fly(sim, 0.4, north=3.0)
    return len(values(packets, "velocity")) < 10 and len(values(packets, "attitude")) >= 39


def not_a_number(sim):
    imu = values(fly(sim, 0.1), "imu")[-1]
    return all(math.isnan(v) for part in imu for v in part)


def rc_reads(sim, axis, value):
    return values(fly(sim, 0.1), "rc")[-1][axis] == value


def refused(sim, ack=0):
    sim.control_authority(False)
    reply = sim.control_authority(True)
    sim.step()
    return reply == (False, 1, 0, ack)


def lost_silently(sim):
    answered = sim.control_authority(True).result
    sim.step()
    return answered and not sim.setpoint(GENERIC, (0.0, 0.0, 38.4, 0.0, 43.0)).accepted


def health_reads(sim, value):
    sim.run(0.1)
    return values(sim.run(0.1), "gps_health")[-1] == value


def gps_frozen(sim):
    packets = fly(sim, 0.3, north=3.0)
    refused = not sim.setpoint(VELOCITY, (0.0, 1.0, 0.0, 0.0)).accepted
    return refused and len(set(values(packets, "local_position"))) == 1


def climbs(sim, sign):
    """In open loop at hover thrust for 1 s."""
    before = sim.truth.velocity[2]
    for _ in range(50):
        sim.setpoint(GENERIC, (0.0, 0.0, sim.preset.hover_percent, 0.0, 43.0))
        sim.run(0.02)
    return sign * (sim.truth.velocity[2] - before) > 0.3


def tilts(sim):
    for _ in range(50):
        sim.setpoint(GENERIC, (0.0, 0.0, sim.preset.hover_percent, 0.0, 43.0))
        sim.run(0.02)
    roll, pitch, _ = sim.truth.rpy
    return roll < -0.02 and pitch < -0.02 and sim.truth.rates[2] > 0.05


def blown(sim):
    """East, while 1 m/s north is asked for; the loop lags behind the gust."""
    fly(sim, 0.6)
    return sim.truth.velocity[0] > 0.15


def ignored(sim):
    return not sim.setpoint(VELOCITY, (0.0, 1.0, 0.0, 0.0)).accepted


def dead(sim):
    return not sim.run(0.1) and ignored(sim) and sim.task(6) == (False, 1, 1, 0xFFFF)


def sticks_fly(sim):
    """They are live once the stream of setpoints has ended."""
    sim.run(1.5)
    return sim.truth.velocity[2] > 0.5


MATRIX = [
    ("topic_frozen", {"topic": "velocity"}, frozen),
    ("topic_dropped", {"topic": "velocity"}, dropped),
    ("topic_dropped", {"topic": "velocity", "probability": 0.5}, half_dropped),
    ("topic_delayed", {"topic": "velocity", "delay": 0.3}, delayed),
    ("topic_nan", {"topic": "imu"}, not_a_number),
    ("topic_jump", {"topic": "gps_health", "offset": [-3, 0, 0]}, lambda s: health_reads(s, 2)),
    ("topic_jump", {"topic": "rc", "offset": [0, 0.5, 0]}, lambda s: rc_reads(s, 1, 0.5)),
    ("authority_refused", {"ack": 6}, lambda s: refused(s, 6)),
    ("authority_lost", {}, lost_silently),
    ("authority_taken", {}, lambda s: rc_reads(s, 4, -8000.0)),
    ("authority_taken", {"by": "app"}, lambda s: refused(s, 3)),
    ("rc_off", {}, lambda s: rc_reads(s, 5, 0.0)),
    ("rc_mode", {"mode": "A"}, lambda s: rc_reads(s, 4, 0.0)),
    ("rc_sticks", {"throttle": 0.6}, lambda s: rc_reads(s, 3, 0.6)),
    ("rc_sticks", {"throttle": 0.6}, sticks_fly),
    ("setpoints_ignored", {}, ignored),
    ("gps_lost", {}, gps_frozen),
    ("gps_lost", {"health": 1}, lambda s: health_reads(s, 1)),
    ("battery_low", {"percent": 15}, lambda s: values(fly(s, 0.2), "battery_state")[-1] == 15.0),
    ("battery_empty", {}, lambda s: values(fly(s, 0.2), "battery_state")[-1] == 0.0),
    ("motor_weak", {"motor": "back_left"}, tilts),
    ("thrust_gain", {"factor": 1.1}, lambda s: climbs(s, 1.0)),
    ("mass_change", {"added": 0.3}, lambda s: climbs(s, -1.0)),
    ("wind_gust", {"velocity": [8, 0, 0], "rise": 0.1}, blown),
    ("node_killed", {}, dead),
]


def test_the_matrix_has_every_kind():
    assert {kind for kind, _, _ in MATRIX} == set(KINDS)


@pytest.mark.parametrize(("kind", "parameters", "shows"), MATRIX)
def test_a_fault_shows_and_ends(sim, kind, parameters, shows):
    sim.faults.apply(kind, **parameters)
    assert shows(sim)
    assert [entry.kind for entry in sim.faults.active] == [kind]
    sim.faults.clear(kind)
    recover(sim)
    assert not shows(sim)
    assert sim.faults.active == ()


def recover(sim):
    """As a foreign program would: ask for authority again, and go on."""
    sim.run(0.1)
    sim.place(HOVER, authority=True)
    sim.battery = max(sim.battery, 50.0)
    fly(sim, 0.5)


def test_a_mass_falls_on_top_of_the_payload():
    preset = load_preset("dji_hil", {"payload": 0.7})
    sim = SimulatedM100(preset)
    sim.place((0.0, 0.0, 20.0))
    sim.faults.apply("mass_change", added=0.5)
    carried = preset.thrust.acceleration(sim.plant.hover_percent) * preset.mass / preset.gravity
    assert carried == pytest.approx(preset.mass + 0.7 + 0.5)
