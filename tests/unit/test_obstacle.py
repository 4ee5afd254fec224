"""What a scenario may say about obstacles, and where they then are."""

import pytest

from uav_sim.body import make_body
from uav_sim.errors import ConfigError
from uav_sim.motion import Appear, Chase, Circle, Line, Spline
from uav_sim.obstacle import load_obstacles

BALL = {"id": "ball", "position": [1.0, 2.0, 3.0], "radius": 0.5}
CIRCLE = {"type": "circle", "center": [0.0, 0.0], "speed": 1.0}
LINE = {"type": "line", "distance": 4.0, "end": "bounce"}
SPLINE = {"type": "spline", "points": [[2, 2, 3], [2, 5, 3]], "speed": 1.0, "end": "loop"}
CHASE = {"type": "chase", "speed": 2.0, "acceleration": 1.0}


def load(**changes):
    return load_obstacles([{**BALL, **changes}], "mine.yaml")[0]


def test_without_motion_it_stands_or_goes_straight():
    assert load().path == Line((1.0, 2.0, 3.0))
    assert load(velocity=[1, 0, 0]).path.position(2.0) == (3.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"motion": CIRCLE}, Circle((1.0, 2.0, 3.0), (0.0, 0.0), 1.0)),
        ({"motion": LINE, "velocity": [1, 0, 0]}, Line((1, 2, 3), (1, 0, 0), 4.0, "bounce")),
        ({"motion": SPLINE}, Spline(((1, 2, 3), (2, 2, 3), (2, 5, 3)), 1.0, "loop")),
        ({"motion": CHASE}, Chase(2.0, 1.0)),
    ],
)
def test_motions(changes, path):
    assert load(**changes).path == path


def test_appearance():
    assert load().appear is None
    assert load(appear={"at": 5.0}).appear == Appear(at=5.0)
    assert load(appear={"within": 3.0}).appear == Appear(within=3.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motion": "circle"}, r"obstacles\[0\].motion: got 'circle'"),
        ({"motion": {"type": "jump"}}, "motion.type: got 'jump', expected one of line, circle"),
        ({"motion": {"type": ["line"]}}, "motion.type"),
        ({"motion": {**CIRCLE, "radius": 1.0}}, "motion.radius: got 1.0, expected one of"),
        ({"motion": {"type": "circle", "speed": 1.0}}, "motion.center: got None"),
        ({"motion": {**CIRCLE, "center": [1.0, 2.0]}}, "a point beside the position"),
        ({"motion": {**CIRCLE, "speed": float("inf")}}, "motion.speed: got inf"),
        ({"motion": CIRCLE, "velocity": [1, 0, 0]}, "velocity: got .* no velocity with circle"),
        ({"motion": LINE}, "a velocity beside it that is not zero"),
        ({"motion": {**LINE, "distance": 0.0}, "velocity": [1, 0, 0]}, "motion.distance"),
        ({"motion": {**LINE, "end": "loop"}, "velocity": [1, 0, 0]}, "one of stop, bounce"),
        ({"motion": {**SPLINE, "points": []}}, "motion.points"),
        ({"motion": {**SPLINE, "points": [[1, 2, 3]]}}, r"points\[0\].* apart from the last"),
        ({"motion": {**SPLINE, "points": [[2, 2, 3], [1, 2, 3]]}}, "apart from the position"),
        ({"motion": {**CHASE, "acceleration": 0.0}}, "motion.acceleration: got 0.0"),
        ({"appear": 5.0}, "appear: got 5.0"),
        ({"appear": {}}, "appear: got {}"),
        ({"appear": {"after": 1.0}}, "appear.after: got 1.0, expected one of at, within"),
        ({"appear": {"at": -1.0}}, "appear.at: got -1.0"),
    ],
)
def test_a_wrong_motion_is_named(changes, words):
    with pytest.raises(ConfigError, match=words):
        load(**changes)


def test_a_path_begins_when_its_obstacle_appears():
    body = make_body(load(velocity=[1, 0, 0], appear={"at": 2.0}))
    far = [(99.0, 0.0, 0.0)]
    body.advance(1.5, far, far)
    assert body.state is None and not body.is_there
    body.advance(2.5, far, far)
    assert body.state.position == (1.5, 2.0, 3.0)
    assert body.state.velocity == (1.0, 0.0, 0.0)
    body.reset()
    assert body.state is None


def test_an_obstacle_appears_before_an_aircraft_that_comes_near():
    body = make_body(load(appear={"within": 3.0, "at": 10.0}))
    for t, x, there in ((0.1, 9.0, False), (0.2, 4.6, False), (0.3, 4.4, True), (0.4, 9.0, True)):
        body.advance(t, [(x, 2.0, 3.0)], [(x, 2.0, 3.0)])
        assert body.is_there is there


def test_a_chase_begins_at_rest_when_it_appears():
    body = make_body(load(motion=CHASE, appear={"at": 1.0}))
    aircraft = [(9.0, 2.0, 3.0)]
    for k in range(1, 500):
        body.advance(0.01 * k, aircraft, aircraft)
        if k == 100:
            assert body.state.velocity == (0.0, 0.0, 0.0)
        elif k == 200:
            assert body.state.velocity == pytest.approx((1.0, 0.0, 0.0), abs=0.02)
    assert body.state.position[0] > 5.0
