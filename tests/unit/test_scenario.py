# SPDX-License-Identifier: MIT
"""Scenarios: the paper's thirteen, and every way in which a hand-written file can be wrong."""

from pathlib import Path
from typing import Callable

import numpy as np
import pytest
import yaml

from nmpc_control.config import config_directory
from nmpc_control.errors import ConfigError
from nmpc_control.scenario import list_scenarios, load_scenario, scenario_from_waypoints

PAPER = (
    "circle_xy go_to_point hexagon hover line_xy long_spline multi_obstacle one_obstacle rectangle "
    "sinusoidal spline step_xyz step_z"
).split()
TEMPLATE = config_directory() / "scenario_template.yaml"


def test_the_papers_thirteen_are_there() -> None:
    assert set(PAPER) <= set(list_scenarios())


@pytest.mark.parametrize("name", PAPER)
def test_a_scenario_can_be_flown_after_take_off(name: str) -> None:
    scenario = load_scenario(name)
    path = scenario.trajectory
    sample = path.sample(np.linspace(0.0, path.duration, 1000))
    low, high = scenario.room
    assert scenario.name == name
    assert scenario.description
    assert sample.position[:, 2].min() >= 1.0 - 1e-9
    assert (sample.position >= low).all() and (sample.position <= high).all()
    assert (scenario.spawn >= low).all() and (scenario.spawn <= high).all()
    assert np.allclose(scenario.initial_position, scenario.start)
    for obstacle in scenario.obstacles:
        assert obstacle.distance(scenario.end) > 1.0
        assert ((obstacle.position > low) & (obstacle.position < high)).all()


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_own_numbers_are_a_variant(name: str) -> None:
    scenario = load_scenario(name, variant="paper")
    assert scenario.variant == "paper"
    first = {"long_spline": [18, 5, 8], "multi_obstacle": [18, 5, 8]}.get(name, [0, 0, 0])
    assert scenario.initial_position.tolist() == first


def test_hexagon_has_its_corners_and_speed() -> None:
    scenario = load_scenario("hexagon")
    path = scenario.trajectory
    angles = np.radians([0, 60, 120, 180, 240, 300, 360])
    corners = np.stack([6.2 * np.cos(angles), 6.2 * np.sin(angles), 2.0 + 0 * angles], axis=1)
    assert np.allclose(path.sample(np.arange(7) * path.duration / 6).position, corners)
    assert scenario.speed == pytest.approx(1.5)


def test_the_simulation_table_flies_the_small_hexagon_from_the_origin() -> None:
    scenario = load_scenario("hexagon", variant="paper")
    assert scenario.trajectory.duration == 27.5
    assert scenario.trajectory.length == pytest.approx(6 * 1.2)
    # The paper's maximum deviation is the initial distance to the first corner.
    assert np.linalg.norm(scenario.start - scenario.initial_position) == pytest.approx(
        2.33, abs=0.005
    )


@pytest.mark.parametrize("variant", [None, "paper"])
def test_multi_obstacle_is_the_long_spline_with_three_spheres(variant: str) -> None:
    scenario, bare = load_scenario("multi_obstacle", variant), load_scenario("long_spline")
    assert scenario.trajectory.duration == 28.57
    assert scenario.trajectory.length == pytest.approx(39.1, abs=0.05)
    s = np.linspace(0.0, 1.0, 101)
    assert np.allclose(scenario.trajectory.curve(s), bare.trajectory.curve(s))
    assert [o.size.tolist() for o in scenario.obstacles] == [[0.5], [0.6], [1.2]]
    way = scenario.trajectory.curve(np.linspace(0, 1, 5001))
    for obstacle in scenario.obstacles:
        assert obstacle.distance(way).min() < 0.0


def test_long_spline_starts_at_four_metres_per_second_as_the_papers() -> None:
    path = load_scenario("long_spline").trajectory
    assert np.linalg.norm(path.sample(0.0).velocity) == pytest.approx(4.2, abs=0.05)


def test_one_obstacle_sits_on_the_spline() -> None:
    scenario = load_scenario("one_obstacle")
    assert scenario.obstacles[0].position.tolist() == [4.0, -2.0, 2.8]
    assert scenario.obstacles[0].distance(scenario.trajectory.curve([0.5])) == pytest.approx(
        0.2 - 0.75
    )


def test_the_template_is_valid_and_so_are_the_types_in_its_comments(tmp_path: Path) -> None:
    for variant in (None, "fast", "smooth"):
        load_scenario(str(TEMPLATE), variant=variant)
    lines = [
        line[2:].split("}")[0] + "}"
        for line in TEMPLATE.read_text().splitlines()
        if "  {type:" in line
    ]
    assert len(lines) == 7
    for line in lines:
        reference = yaml.safe_load(line)
        pace = {"duration": 20.0} if reference["type"] in ("hold", "step") else {"speed": 1.0}
        file = tmp_path / "mine.yaml"
        file.write_text(yaml.safe_dump({"reference": reference, **pace}))
        assert load_scenario(str(file)).name == "mine"


def test_speed_and_duration_can_be_given_by_the_caller() -> None:
    assert load_scenario("hexagon", speed=3.1).trajectory.duration == pytest.approx(12.0)
    assert load_scenario("hexagon", duration=40.0).trajectory.duration == 40.0
    assert load_scenario("multi_obstacle", speed=1.65).speed == pytest.approx(1.65)


def test_variants_join_mappings_and_replace_the_pace(tmp_path: Path) -> None:
    file = tmp_path / "mine.yml"
    file.write_text(
        "speed: 1.0\nreference: {type: circle, center: [0, 0, 2], radius: 3}\n"
        "variants:\n  small: {duration: 10, reference: {radius: 1}}\n"
        "  straight: {reference: {type: line, start: [0, 0, 2], end: [5, 0, 2]}}\n"
    )
    assert load_scenario(str(file), "small").trajectory.length == pytest.approx(2 * np.pi)
    assert load_scenario(str(file), "small").trajectory.duration == 10.0
    assert load_scenario(str(file), "straight").end.tolist() == [5.0, 0.0, 2.0]


def test_waypoints_of_an_operator_become_a_scenario() -> None:
    scenario = scenario_from_waypoints(np.array([[0.0, 0, 2], [4, 0, 2]]))
    assert scenario.speed == pytest.approx(0.35)
    assert scenario.end.tolist() == [4.0, 0.0, 2.0]
    with pytest.raises(ConfigError, match="two points"):
        scenario_from_waypoints(np.array([[0.0, 0, 2]]))
    with pytest.raises(ConfigError, match="speed"):
        scenario_from_waypoints(np.array([[0.0, 0, 2], [4, 0, 2]]), speed=-1.0)


GOOD = {
    "speed": 1.0,
    "reference": {"type": "waypoints", "points": [[0, 0, 2], [4, 0, 3], [8, 2, 2], [9, 5, 2]]},
    "obstacles": [{"id": "ball", "position": [4, 3, 3], "radius": 0.5}],
}


def spoilt(**changes: object) -> dict:
    """Return the good file with some keys changed."""
    return {key: value for key, value in {**GOOD, **changes}.items() if value != "absent"}


def reference(**changes: object) -> dict:
    """Return the good file with some keys of its reference changed."""
    return spoilt(reference={**GOOD["reference"], **changes})


def obstacle(**changes: object) -> dict:
    """Return the good file with some keys of its obstacle changed."""
    return spoilt(obstacles=[{**GOOD["obstacles"][0], **changes}])


NAN, INF = float("nan"), float("inf")
BALL = GOOD["obstacles"][0]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (spoilt(reference="absent"), "reference: got None"),
        (spoilt(reference=[1, 2]), "reference: got [1, 2]"),
        (spoilt(speeed=1.0), "speeed: got 1.0, expected one of the keys"),
        (spoilt(speed="absent"), "speed: got None, expected a speed or a duration"),
        (spoilt(duration=5.0), "not both"),
        (spoilt(speed=-1.0), "speed: got -1.0"),
        (spoilt(speed=NAN), "speed: got nan"),
        (spoilt(speed="fast"), "speed: got 'fast'"),
        (spoilt(speed=True), "speed: got True"),
        (spoilt(speed="absent", duration=INF), "duration: got inf"),
        (spoilt(name="../evil"), "name: got '../evil'"),
        (spoilt(description=3), "description: got 3"),
        (spoilt(weights="heavy"), "weights: got 'heavy', expected one of indoor, outdoor"),
        (spoilt(yaw=NAN), "yaw: got nan"),
        (spoilt(yaw="north"), "yaw: got 'north'"),
        (spoilt(yaw=[0, 1]), "yaw: got [0.0, 1.0], expected one number per point, 4"),
        (spoilt(yaw=[0, 1, 2, "x"]), "yaw[3]: got 'x'"),
        (spoilt(spawn=[0, 0]), "spawn: got [0, 0], expected a list of 3 numbers"),
        (spoilt(initial_position=[0, 0, NAN]), "initial_position[2]: got nan"),
        (reference(type="spiral"), "reference.type: got 'spiral', expected one of hold"),
        (reference(type=["hold"]), "reference.type: got ['hold']"),
        (reference(radius=1.0), "reference.radius: got 1.0"),
        (
            reference(points=[[0, 0, 2]]),
            "reference.points: got [[0, 0, 2]], expected a list of two points",
        ),
        (reference(points="here"), "reference.points: got 'here'"),
        (reference(points=[[0, 0, 2], [1, 0]]), "reference.points[1]: got [1, 0]"),
        (reference(points=[[0, 0, 2], [1, 0, NAN]]), "reference.points[1]: got [1, 0, nan]"),
        (reference(points=[[0, 0, 2], [1, 0, "2"]]), "reference.points[1]"),
        (reference(points=[[0, 0, 2], [1, 0, 2]], degree=3), "reference.degree: got 3"),
        (reference(points=[[0, 0, 2], [0, 0, 2], [1, 0, 2], [2, 0, 2]]), "reference.points[1]"),
        (reference(degree=0), "reference.degree: got 0"),
        (reference(degree=2.0), "reference.degree: got 2.0"),
        (reference(knots="even"), "reference.knots: got 'even'"),
        (reference(knots=[0, 1]), "reference.knots: got [0, 1], expected 8 numbers"),
        (reference(knots=3), "reference.knots: got 3"),
        (reference(method="guess"), "reference.method: got 'guess'"),
        (reference(method="fit"), "reference.control_points: got None"),
        (reference(control_points=4), "reference.control_points: got 4, expected this key only"),
        (reference(ends="loose"), "reference.ends: got 'loose'"),
        (reference(timing="slow"), "reference.timing: got 'slow'"),
        (reference(closed="yes"), "reference.closed: got 'yes'"),
        ({**reference(closed=True), "yaw": [0, 1, 2, 3]}, "where the curve is closed"),
        (
            spoilt(reference={"type": "circle", "center": [0, 0, 2], "radius": -3}),
            "reference.radius: got -3",
        ),
        (spoilt(reference={"type": "circle", "center": [0, 0, 2]}), "reference.radius: got None"),
        (
            spoilt(reference={"type": "circle", "center": [0, 0, 2], "radius": 1}, yaw=[0]),
            "yaw: got [0]",
        ),
        (
            spoilt(reference={"type": "hold", "position": [0, 0, 2]}),
            "speed: got 1.0, expected a duration",
        ),
        (
            spoilt(
                reference={"type": "step", "start": [0, 0, 2], "end": [1, 0, 2], "time": 9.0},
                speed="absent",
                duration=5.0,
            ),
            "reference.time: got 9.0",
        ),
        (spoilt(obstacles="none"), "obstacles: got 'none'"),
        (spoilt(obstacles=["ball"]), "obstacles[0]: got 'ball'"),
        (spoilt(obstacles=[BALL, BALL]), "obstacles[1].id: got 'ball'"),
        (obstacle(radius=-0.5), "obstacles[0].radius: got -0.5"),
        (obstacle(radius=NAN), "obstacles[0].radius: got nan"),
        (obstacle(shape="cone"), "obstacles[0].shape: got 'cone'"),
        (obstacle(shape="cylinder"), "obstacles[0].height: got None"),
        (obstacle(colour="red"), "obstacles[0].colour: got 'red'"),
        (obstacle(id=7), "obstacles[0].id: got 7"),
        (obstacle(position=[4, 3]), "obstacles[0].position: got [4, 3]"),
        (obstacle(position=[0.9, 0, 2]), "obstacles.ball: got '0.40 m', expected 0.5 m or more"),
        (obstacle(position=[9, 5, 2]), "to the end [9.0, 5.0, 2.0]"),
        ({**GOOD, "initial_position": [4, 3, 3]}, "to the initial_position"),
        (spoilt(room={"min": [-1, -1, 0]}), "room.max: got None"),
        (spoilt(room={"min": [-1, -1, 0], "max": [20, -1, 9]}), "room.max: got [20.0, -1.0, 9.0]"),
        (
            spoilt(room={"min": [-1, -1, 0], "max": [8, 9, 9]}),
            "expected a box that holds the whole reference",
        ),
        (spoilt(variants=[1]), "variants: got [1]"),
        (spoilt(variants={"a": 1}), "variants: got {'a': 1}"),
    ],
)
def test_a_wrong_file_is_one_line_with_file_key_value_and_expectation(
    data: dict, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigError) as caught:
        load_scenario(str(file))
    assert str(caught.value).startswith("mine.yaml: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_good_file_is_good(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(GOOD))
    assert load_scenario(str(file)).name == "mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected a mapping"),
        ("- 1\n", "expected a mapping"),
        ("speed: [1\n", "expected valid YAML"),
        ("speed: 1\nspeed: 2\n", "given twice"),
        ("\ttabs: 1\n", "expected valid YAML"),
        ("speed: !!python/object:os.system 1\n", "expected valid YAML"),
    ],
)
def test_text_that_is_no_mapping_is_one_line(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_scenario(str(file))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: load_scenario("hexagone"),
            "got 'hexagone', expected a path to a .yaml file, or one of circle_xy",
        ),
        (lambda: load_scenario(""), "got ''"),
        (lambda: load_scenario(".."), "got '..'"),
        (lambda: load_scenario("no/such/file.yaml"), "a readable file"),
        (lambda: load_scenario("no/such/file"), "a readable file"),
        (lambda: load_scenario("a/\0.yaml"), "expected a path"),
        (lambda: load_scenario("hexagon", variant="huge"), "got 'huge', expected one of paper"),
        (lambda: load_scenario("hexagon", speed=1.0, duration=2.0), "not both"),
        (lambda: load_scenario("hexagon", speed=0.0), "speed: got 0.0"),
        (lambda: load_scenario("hover", speed=1.0), "expected a duration instead"),
    ],
)
def test_a_wrong_call_is_one_line(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        call()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_larger_hull_needs_more_room_at_the_start(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(obstacle(position=[-1.5, 0, 2])))
    load_scenario(str(file))
    with pytest.raises(ConfigError, match=r"1\.2 m or more"):
        load_scenario(str(file), vehicle_radius=1.2)
