from uav_sim.ros.throttle import Throttle


class Clock:
    t = 0.0

    def __call__(self):
        return self.t


def test_every_kind_is_seen_at_once_and_then_once_a_second_with_a_count():
    clock = Clock()
    throttle = Throttle(clock)
    assert throttle.line("setpoint a ignored: 4 axes instead of 5") is not None
    assert throttle.line("setpoint a ignored: axes (0.0, nan) are not finite") is not None
    assert throttle.line("setpoint a ignored: 3 axes instead of 5") is None
    assert throttle.line("setpoint a ignored: axes (-inf, 1e-05) are not finite") is None
    clock.t = 1.0
    line = throttle.line("setpoint a ignored: 2 axes instead of 5")
    assert line == "setpoint a ignored: 2 axes instead of 5 (2 times in the last second)"


def test_what_was_left_out_is_told_after_a_second_and_then_forgotten():
    clock = Clock()
    throttle = Throttle(clock)
    for k in range(1000):
        throttle.line(f"thrust {k} percent is not in 10..100")
    assert throttle.overdue() == []
    clock.t = 1.5
    assert throttle.overdue() == [
        "thrust 999 percent is not in 10..100 (999 times in the last second)"
    ]
    clock.t = 3.0
    assert throttle.overdue() == []
    assert throttle.line("thrust 1 percent is not in 10..100") is not None
