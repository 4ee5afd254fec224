import pytest

from uav_sim.ros.pacer import MAX_LAG, Pacer


class Wall:
    """A clock that only moves when somebody sleeps or works."""

    def __init__(self):
        self.now = 100.0

    def clock(self):
        return self.now

    def work(self, duration):
        self.now += duration


def pacer(wall, speed_factor=1.0):
    return Pacer(0.005, speed_factor, wall.clock, wall.work)


@pytest.mark.parametrize(("speed_factor", "duration"), [(1.0, 5.0), (4.0, 1.25), (0.5, 10.0)])
def test_steps_take_their_time_without_drift(speed_factor, duration):
    wall = Wall()
    steps = pacer(wall, speed_factor)
    for k in range(1000):
        wall.work(0.0001 * (k % 7))
        steps.wait()
    assert wall.now - 100.0 == pytest.approx(duration)
    assert steps.lost == 0.0


def test_a_short_delay_is_caught_up():
    wall = Wall()
    steps = pacer(wall)
    wall.work(0.8 * MAX_LAG)
    for _ in range(100):
        steps.wait()
    assert wall.now - 100.0 == pytest.approx(0.5)


def test_a_long_delay_is_given_up_and_counted():
    wall = Wall()
    steps = pacer(wall)
    wall.work(3.0)
    for _ in range(101):
        steps.wait()
    assert wall.now - 100.0 == pytest.approx(3.0 + 100 * 0.005)
    assert steps.lost == pytest.approx(3.0 - 0.005) and steps.lost > MAX_LAG


def test_speed_factor_0_never_waits():
    wall = Wall()
    steps = pacer(wall, 0.0)
    for _ in range(1000):
        steps.wait()
    assert wall.now == 100.0
