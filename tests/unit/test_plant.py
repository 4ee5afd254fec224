import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from uav_sim.errors import ConfigError
from uav_sim.plant import Plant
from uav_sim.preset import Drag, FirstOrder, SecondOrder, load_preset, preset_names
from uav_sim.response import DeadTime, make_response

FLIGHT = Path(__file__).parents[3] / "shared" / "data" / "m100exp03.bag"


def airborne(
    name="dji_hil", position=(0.0, 0.0, 100.0), velocity=(0.0, 0.0, 0.0), yaw=0.0, **changes
):
    plant = Plant(dataclasses.replace(load_preset(name), **changes))
    plant.place(position, velocity, yaw)
    return plant


def run(plant, duration):
    for _ in range(round(duration / plant.preset.step)):
        plant.step()


@pytest.mark.parametrize(
    ("name", "percent"), [("dji_hil", 38.35), ("eth", 29.93), ("paper", 37.37)]
)
def test_hover_thrust_of_each_preset_holds_height(name, percent):
    plant = airborne(name)
    assert plant.hover_percent == pytest.approx(percent, abs=0.01)
    run(plant, 10.0)
    assert plant.position == pytest.approx((0.0, 0.0, 100.0), abs=1e-9)


def test_free_fall_without_drag():
    plant = airborne(drag=Drag("world", 0.0, 0.0, 0.0))
    plant.motors_on = False
    run(plant, 2.0)
    assert plant.position[2] == pytest.approx(100.0 - 0.5 * 9.81 * 2.0**2, abs=1e-9)
    assert plant.velocity[2] == pytest.approx(-9.81 * 2.0)


def test_thrust_percent_is_affine_after_its_dead_time():
    plant = airborne(drag=Drag("world", 0.0, 0.0, 0.0))
    plant.command(0.0, 0.0, 60.0, 0.0)
    run(plant, 0.095)
    assert plant.velocity[2] == pytest.approx(0.0, abs=1e-12)
    run(plant, 1.0)
    assert plant.velocity[2] == pytest.approx(0.1732 * 60.0 + 3.167 - 9.81)


def test_thrust_gain_and_mass_scale_acceleration():
    plant = airborne("paper", drag=Drag("world", 0.0, 0.0, 0.0))
    plant.thrust_gain, plant.mass_factor = 0.9, 1.2
    run(plant, 1.0)
    assert plant.velocity[2] == pytest.approx(9.81 * (0.9 / 1.2 - 1.0))


def test_payload_weighs_on_the_same_thrust():
    plant = airborne("paper", payload=0.5)
    assert plant.hover_percent == pytest.approx(load_preset("paper").hover_percent * 3.395 / 2.895)
    run(plant, 1.0)
    assert plant.velocity[2] == pytest.approx(0.0, abs=1e-9)


def test_rotors_lag_behind_their_command():
    plant = airborne("eth", drag=Drag("world", 0.0, 0.0, 0.0))
    plant.command(0.0, 0.0, plant.hover_percent + 1.0, 0.0)
    run(plant, 1.0)
    # a first-order lag costs its time constant of the added acceleration
    assert plant.velocity[2] == pytest.approx(0.46748 * (1.0 - 0.05), rel=0.06)
    sooner = airborne("eth", drag=Drag("world", 0.0, 0.0, 0.0), rotor_time_constant=0.0)
    sooner.command(0.0, 0.0, sooner.hover_percent + 1.0, 0.0)
    run(sooner, 1.0)
    assert sooner.velocity[2] == pytest.approx(0.46748)


def test_ground_effect_is_off_by_default_and_that_of_cheeseman_and_bennett():
    effect = load_preset("dji_hil").ground_effect
    assert effect.strength == 0.0 and effect.gain(0.0) == 1.0
    single = dataclasses.replace(effect, strength=1.0)
    radius = single.rotor_radius
    low_rotor = dataclasses.replace(single, rotor_height=0.01)
    assert low_rotor.gain(radius - 0.01) == pytest.approx(16.0 / 15.0), "one radius up"
    z = 0.5
    expected = 1.0 / (1.0 - (radius / (4.0 * (z + single.rotor_height))) ** 2)
    assert single.gain(z) == pytest.approx(expected)
    low = airborne(
        position=(0.0, 0.0, 0.1), ground_effect=dataclasses.replace(effect, strength=2.0)
    )
    high = airborne(ground_effect=dataclasses.replace(effect, strength=2.0))
    run(low, 0.5)
    run(high, 0.5)
    assert low.velocity[2] > 0.05 and high.velocity[2] == pytest.approx(0.0, abs=1e-4)


def test_motion_can_be_given_while_commands_stay_under_way():
    plant = airborne()
    plant.command(0.2, 0.0, plant.hover_percent, 0.0)
    run(plant, 0.05)
    plant.set_motion((1.0, 2.0, 3.0), (0.1, -0.1, 0.5), (0.0, 0.0, 0.0))
    assert plant.velocity == (1.0, 2.0, 3.0) and plant.rpy == (0.1, -0.1, 0.5)
    before = plant.position
    run(plant, 0.5)
    assert plant.position[0] > before[0] and plant.rpy[0] == pytest.approx(0.2066, abs=0.02)


@pytest.mark.parametrize(("yaw", "rate"), [(0.0, 0.138), (math.pi / 2, 0.125)])
def test_speed_decays_by_drag_along_the_heading(yaw, rate):
    plant = airborne(velocity=(5.0, 0.0, 0.0), yaw=yaw)
    run(plant, 3.0)
    assert plant.velocity[0] == pytest.approx(5.0 * math.exp(-rate * 3.0), rel=1e-6)
    assert plant.velocity[1] == pytest.approx(0.0, abs=1e-9)


def test_wind_carries_a_level_aircraft_along():
    plant = airborne("paper")
    plant.wind = (3.0, -2.0, 0.0)
    run(plant, 100.0)
    assert plant.velocity == pytest.approx((3.0, -2.0, 0.0), abs=1e-3)


def test_attitude_answers_exactly_after_its_dead_time():
    plant = airborne()
    plant.command(0.2, -0.1, plant.hover_percent, 0.0)
    run(plant, 0.060)
    assert plant.rpy == (0.0, 0.0, 0.0)
    plant.step()
    assert plant.rpy[0] > 0.0 > plant.rpy[1]


def test_second_order_overshoot_and_static_gain():
    plant = airborne()
    plant.command(0.1, 0.0, plant.hover_percent, 0.0)
    peak = 0.0
    for _ in range(1000):
        plant.step()
        peak = max(peak, plant.rpy[0])
    zeta = 0.778
    overshoot = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    assert peak / 0.1033 - 1.0 == pytest.approx(overshoot, rel=0.01)
    assert plant.rpy[0] == pytest.approx(0.1033)


@pytest.mark.parametrize("zeta", [0.5, 1.0, 2.0])
def test_second_order_step_response_solves_its_equation(zeta):
    omega, step, t = 7.0, 0.005, 0.5
    response = make_response(SecondOrder(1.0, omega, zeta), step)
    for _ in range(round(t / step)):
        response.advance(1.0)
    transition = expm(np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]) * t)
    expected = np.array([1.0, 0.0]) - transition[:, 0]
    assert [response.value, response.rate] == pytest.approx(list(expected), abs=1e-12)


def test_first_order_reaches_its_share_after_one_time_constant():
    response = make_response(FirstOrder(1.1, 0.25), 0.005)
    for _ in range(50):
        response.advance(1.0)
    assert response.value == pytest.approx(1.1 * (1.0 - math.exp(-1.0)))
    assert response.rate == pytest.approx(1.1 / 0.25 * math.exp(-1.0))


@pytest.mark.parametrize(
    ("delay", "expected"), [(0.0, [1, 1]), (0.01, [0, 0, 1]), (0.0075, [0, 0.5, 1])]
)
def test_dead_time_by_whole_and_half_steps(delay, expected):
    line = DeadTime(delay, 0.005)
    assert [line.push(1.0) for _ in expected] == pytest.approx(expected)


def test_tilt_is_limited_as_a_vector():
    plant = airborne()
    plant.command(0.6, -0.6, plant.hover_percent, 0.0)
    run(plant, 3.0)
    limit = 1.033 * 0.605 / math.sqrt(2.0)
    assert plant.rpy[:2] == pytest.approx((limit, -limit), abs=1e-6)


def test_each_angle_is_limited_before_the_vector_is():
    plant = airborne()
    plant.command(0.9, -0.3, plant.hover_percent, 0.0)
    run(plant, 3.0)
    scale = 1.033 * 0.605 / math.hypot(0.611, 0.3)
    assert plant.rpy[:2] == pytest.approx((scale * 0.611, scale * -0.3), abs=1e-6)


def test_signs_of_tilt_and_yaw_rate():
    right, ahead, left_turn = airborne(), airborne(), airborne()
    right.command(0.1, 0.0, right.hover_percent, 0.0)
    ahead.command(0.0, 0.1, ahead.hover_percent, 0.0)
    left_turn.command(0.0, 0.0, left_turn.hover_percent, 0.5)
    for plant in (right, ahead, left_turn):
        run(plant, 1.0)
    assert right.velocity[1] < -0.5 and right.velocity[0] == pytest.approx(0.0, abs=1e-12)
    assert ahead.velocity[0] > 0.5 and ahead.velocity[1] == pytest.approx(0.0, abs=1e-12)
    assert left_turn.rpy[2] > 0.3


def test_nose_down_facing_north_flies_north():
    plant = airborne(yaw=math.pi / 2)
    plant.command(0.0, 0.1, plant.hover_percent, 0.0)
    run(plant, 1.0)
    assert plant.velocity[1] > 0.5 and plant.velocity[0] == pytest.approx(0.0, abs=1e-12)


def test_a_fall_ends_on_the_ground():
    plant = airborne(position=(0.0, 0.0, 1.0), drag=Drag("world", 0.0, 0.0, 0.0))
    plant.motors_on = False
    run(plant, 1.0)
    assert plant.on_ground and plant.position[2] == 0.0
    assert plant.impact_speed == pytest.approx(math.sqrt(2.0 * 9.81), abs=0.05)
    assert plant.velocity == (0.0, 0.0, 0.0)


def test_friction_stops_a_sliding_aircraft():
    plant = airborne(position=(0.0, 0.0, 0.0), velocity=(2.0, 0.0, 0.0))
    plant.motors_on = False
    run(plant, 2.0)
    assert plant.velocity == (0.0, 0.0, 0.0)
    assert plant.position[0] == pytest.approx(2.0**2 / (2.0 * 0.6 * 9.81), rel=0.01)


def test_on_the_ground_tilt_and_yaw_commands_move_nothing():
    plant = Plant(load_preset("dji_hil"))
    plant.motors_on = True
    plant.command(0.3, 0.3, 20.0, 1.0)
    run(plant, 2.0)
    assert plant.position == (0.0, 0.0, 0.0) and plant.rpy == (0.0, 0.0, 0.0)


def test_unknown_preset_is_named():
    with pytest.raises(ConfigError, match="'m600'.*dji_hil, eth, paper"):
        load_preset("m600")
    assert preset_names() == ["dji_hil", "eth", "paper"]


def test_recorded_attitude_commands_reproduce_the_recorded_attitude():
    if not FLIGHT.is_file():
        pytest.skip(f"no recorded flight at {FLIGHT}")
    commands, recorded = read_flight(FLIGHT)
    preset = load_preset("dji_hil")
    plant, now, next_command = airborne(), 3.0, 0
    lag, measured, simulated = preset.delay.telemetry, [], []
    for t, roll, pitch in recorded:
        while now + lag < t - 1e-9:
            while next_command < len(commands) and commands[next_command][0] <= now:
                _, roll_ref, pitch_ref = commands[next_command]
                plant.command(roll_ref, pitch_ref, plant.hover_percent, 0.0)
                next_command += 1
            plant.step()
            plant.position = (0.0, 0.0, 100.0)
            now += preset.step
        if 5.0 < t < 74.0:
            measured.append((roll, pitch))
            simulated.append(plant.rpy[:2])
    for axis in (0, 1):
        assert fit([m[axis] for m in measured], [s[axis] for s in simulated]) >= 93.0


def fit(measured, simulated):
    mean = sum(measured) / len(measured)
    error = math.dist(measured, simulated)
    return 100.0 * (1.0 - error / math.dist(measured, [mean] * len(measured)))


def read_flight(path):
    """Return commands and recorded attitudes, each (t, roll, pitch), t [s] from the start."""
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    commands, attitudes = [], []
    with rosbag1.Reader(path) as reader:
        for connection in reader.connections:
            if connection.msgtype not in store.types:
                definition = getattr(connection.msgdef, "data", connection.msgdef)
                types = typesys.get_types_from_msg(definition, connection.msgtype)
                store.register({k: v for k, v in types.items() if k not in store.types})
        for connection, _, raw in reader.messages():
            message = store.deserialize_ros1(raw, connection.msgtype)
            t = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            if connection.topic == "/dji_sdk/imu":
                q = message.orientation
                roll = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2))
                attitudes.append((t, roll, math.asin(2 * (q.w * q.y - q.z * q.x))))
            elif connection.topic.startswith("/raven/command"):
                commands.append((t, message.roll, message.pitch))
    start = attitudes[0][0]
    return [[(t - start, *rest) for t, *rest in rows] for rows in (commands, attitudes)]
