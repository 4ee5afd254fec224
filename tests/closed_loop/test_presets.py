"""Weight presets are behaviour: which of them keeps a hexagon's corners, and which rounds them."""

from uav_sim.closed_loop.bench.laps import PRESETS, Lap, lap

SLOW, FAST = 1.5, 3.0  # [m/s] mean speed
HEXAGON, CIRCLE = 0.866, 1.0  # least by greatest distance from the middle


def keeps_the_corners(flown: Lap) -> bool:
    return flown.corner_distance < 0.2 and flown.roundness < HEXAGON + 0.3 * (CIRCLE - HEXAGON)


def rounds_toward_a_circle(flown: Lap) -> bool:
    return flown.corner_distance > 0.7 and flown.roundness > HEXAGON + 0.6 * (CIRCLE - HEXAGON)


def test_position_priority_keeps_the_corners_and_velocity_priority_rounds_them():
    """What the figure shows, and the fast flight as it would be if the presets were swapped."""
    laps = {flight: lap(*flight) for flight in (*PRESETS, ("position_priority", FAST))}
    assert keeps_the_corners(laps["position_priority", SLOW])
    assert rounds_toward_a_circle(laps["velocity_priority", FAST])
    # it is the preset, and not the speed alone
    keeping, rounding = laps["position_priority", FAST], laps["velocity_priority", FAST]
    assert not rounds_toward_a_circle(keeping)
    assert keeping.corner_distance < 0.5 * rounding.corner_distance


def test_the_figure_shows_these_flights():
    assert set(PRESETS) == {("position_priority", SLOW), ("velocity_priority", FAST)}
