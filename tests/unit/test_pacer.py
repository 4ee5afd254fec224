import time
from threading import Thread, Timer

import pytest

from uav_sim.ros.gate import Gate
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


def test_a_new_speed_counts_from_now_on():
    wall = Wall()
    steps = pacer(wall)
    for _ in range(100):
        steps.wait()
    wall.work(20.0)
    steps.restart(2.0)
    for _ in range(100):
        steps.wait()
    assert wall.now - 100.0 == pytest.approx(0.5 + 20.0 + 0.25)
    assert steps.lost == 0.0


class Simulator(Thread):
    """Takes steps as the node does, until it is told to end."""

    def __init__(self, gate):
        super().__init__()
        self.gate, self.steps, self.ended = gate, 0, False

    def run(self):
        while not self.ended:
            if self.gate.take():
                self.steps += 1
                self.gate.taken()
                time.sleep(0.0001)
            else:
                self.gate.stand(0.01)


@pytest.fixture
def simulator():
    thread = Simulator(Gate(paused=True))
    thread.start()
    yield thread
    thread.ended = True
    thread.join()


def test_steps_are_taken_one_by_one_while_paused(simulator):
    assert simulator.steps == 0
    for count in (1, 7):
        before = simulator.steps
        assert simulator.gate.step(count, timeout=5.0)
        assert simulator.steps == before + count


def test_time_passes_again_after_a_pause_and_is_not_stepped_then(simulator):
    simulator.gate.pause(False)
    assert not simulator.gate.step(3, timeout=1.0)
    deadline = time.monotonic() + 5.0
    while simulator.steps < 10 and time.monotonic() < deadline:
        time.sleep(0.001)
    assert simulator.steps >= 10
    simulator.gate.pause(True)
    time.sleep(0.02)
    stood = simulator.steps
    time.sleep(0.05)
    assert simulator.steps == stood


def test_a_pause_that_ends_while_steps_are_awaited_is_told():
    gate = Gate(paused=True)
    Timer(0.05, gate.pause, [False]).start()
    assert not gate.step(5, timeout=5.0)
