"""Several aircraft in one world: each is an obstacle to the others, on one clock."""

import math

import pytest

from uav_sim.errors import ConfigError
from uav_sim.faults.schedule import load_faults
from uav_sim.fleet import FleetSettings, VehicleEntry, load_vehicles, make_fleet, one_vehicle
from uav_sim.obstacle import load_obstacles
from uav_sim.scene import Scene

BALL = {"id": "ball", "shape": "sphere", "radius": 1.0, "position": [0, 20, 5]}


def fleet(*spawns, obstacles=(), **settings):
    entries = [VehicleEntry(f"dji{i + 1}", spawn) for i, spawn in enumerate(spawns)]
    scene = Scene(load_obstacles(list(obstacles), "test"))
    return make_fleet(entries, FleetSettings(**settings), scene, "test")


def test_each_sees_the_obstacles_and_the_others_with_hull_and_velocity():
    both = fleet((0.0, 0.0, 5.0), (4.0, 0.0, 5.0), obstacles=[BALL])
    both.vehicles["dji2"].place((4.0, 0.0, 5.0), velocity=(0.0, 3.0, 0.0))
    both.step()
    both.step()
    states = {s.obstacle.id: s for s in both.vehicles["dji1"].world.states()}
    assert set(states) == {"ball", "dji2"}
    assert states["dji2"].obstacle.size == (0.5,)
    assert states["dji2"].position == both.vehicles["dji2"].truth.position
    assert states["dji2"].velocity == pytest.approx((0.0, 3.0, 0.0), abs=0.05)
    assert {s.obstacle.id for s in both.vehicles["dji2"].world.states()} == {"ball", "dji1"}


def test_a_meeting_is_recorded_by_both_at_the_time_of_contact():
    """Head-on at 12 m/s each, 0.3 m beside each other; until then drag hardly matters."""
    both = fleet((-3.0, 0.0, 50.0), (3.0, 0.3, 50.0))
    first, second = both.vehicles.values()
    first.place((-3.0, 0.0, 50.0), velocity=(12.0, 0.0, 0.0))
    second.place((3.0, 0.3, 50.0), velocity=(-12.0, 0.0, 0.0))
    for _ in range(100):
        both.step()
    (mine,), (theirs,) = first.collisions, second.collisions
    assert (mine.id, theirs.id) == ("dji2", "dji1")
    assert mine.t == pytest.approx(theirs.t) and mine.clearance == pytest.approx(theirs.clearance)
    touch = (6.0 - math.sqrt(1.0 - 0.3**2)) / 24.0
    assert touch <= mine.t <= touch + 0.02
    assert first.clearance["dji2"] == pytest.approx(0.3 - 1.0, abs=0.02)


def test_one_that_took_off_elsewhere_senses_the_others_from_there():
    """As its local_position counts from where it stood, so do the places of the others."""
    both = fleet((0.0, 0.0, 0.0), (40.0, -30.0, 0.0), disturbance="outdoor", seed=5)
    second = both.vehicles["dji2"]
    for _ in range(100):
        both.step()
    assert [s.position for s in second.world.states()] == [pytest.approx((0.0, 0.0, 0.0))]
    assert second.set_local_position_reference()
    packets = [p for _ in range(200) for p in both.step()["dji2"]]
    own = [p.value for p in packets if p.topic == "local_position"][-1]
    (other,) = second.sensed_obstacles
    seen = [b - a for a, b in zip(own, other.position)]
    assert seen == pytest.approx([-40.0, 30.0, 0.0], abs=0.3), "but for the noise of one sample"
    second.senses_locally = False
    (other,) = second.sensed_obstacles
    assert other.position == pytest.approx((0.0, 0.0, 0.0), abs=3.0)


def test_they_share_one_clock_and_move_on_their_own():
    both = fleet((0.0, 0.0, 5.0), (4.0, 0.0, 5.0))
    first, second = both.vehicles.values()
    first.control_authority(True)
    for _ in range(200):
        first.setpoint("ENUvelocity_yawrate", (0.0, 2.0, 0.0, 0.0))
        received = both.step()
    assert both.t == first.t == second.t == pytest.approx(1.0)
    assert set(received) == {"dji1", "dji2"}
    assert first.truth.position[1] > 0.5 and abs(second.truth.position[1]) < 1e-6


def test_the_same_wind_blows_for_all_but_sensors_err_on_their_own():
    both = fleet((0.0, 0.0, 50.0), (40.0, 0.0, 50.0), disturbance="outdoor", seed=3)
    first, second = both.vehicles.values()
    packets = [both.step() for _ in range(100)]
    assert first.plant.wind == pytest.approx(second.plant.wind, abs=0.3)
    assert math.hypot(*first.plant.wind[:2]) > 1.0
    own = [
        [p.value for received in packets for p in received[name] if p.topic == "attitude"]
        for name in both.vehicles
    ]
    assert own[0] != own[1]


def test_faults_befall_the_vehicle_they_name_or_all():
    both = fleet((0.0, 0.0, 5.0), (4.0, 0.0, 5.0))
    lines = load_faults(
        [{"fault": "rc_off", "vehicle": "dji2"}, {"fault": "gps_lost", "start": 1.0}], "file"
    )
    both.schedule(lines)
    first, second = both.vehicles.values()
    assert first.rc.connected and not second.rc.connected
    assert [len(v.faults.pending) for v in (first, second)] == [1, 1]
    with pytest.raises(ConfigError, match="vehicle: got 'dji3', expected one of dji1, dji2"):
        both.schedule(load_faults([{"fault": "rc_off", "vehicle": "dji3"}], "file"))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([], "got [], expected a list of mappings"),
        ([{"spawn": [0, 0, 0]}], "vehicles[0].name: got None, expected a value"),
        ([{"name": "a"}, {"name": "a"}], "vehicles[1].name: got 'a', expected letters"),
        ([{"name": "1/b"}], "vehicles[0].name: got '1/b'"),
        ([{"name": "a", "spawn": [0, 0, -1]}], "vehicles[0].spawn[2]: got -1"),
        ([{"name": "a", "wheels": 4}], "vehicles[0].wheels: got 4, expected one of name"),
    ],
)
def test_a_wrong_list_is_refused_in_words(data, words):
    with pytest.raises(ConfigError) as error:
        load_vehicles(data, "test")
    assert words in str(error.value)


def test_vehicles_in_each_other_or_named_like_an_obstacle_are_refused():
    with pytest.raises(ConfigError, match=r"vehicles\[1\].spawn: .* a place off dji1"):
        fleet((0.0, 0.0, 5.0), (0.9, 0.0, 5.0))
    with pytest.raises(ConfigError, match="a name that no obstacle has"):
        fleet((0.0, 0.0, 5.0), obstacles=[{**BALL, "id": "dji1"}])
    with pytest.raises(ConfigError, match="a height not below the ground"):
        one_vehicle([0.0, 0.0, -1.0], "test")
