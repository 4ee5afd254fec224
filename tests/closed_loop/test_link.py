# SPDX-License-Identifier: MIT
"""A controller on the ground: the guard's ladder covers the link, and a skewed clock is named."""

import numpy as np
import pytest

from nmpc_control.mode_inputs import Mode, Request
from nmpc_control.scenario import load_scenario
from uav_sim.closed_loop.link import Channel, LinkQuality
from uav_sim.closed_loop.link_table import LINKS, linked, table
from uav_sim.closed_loop.loop import NoFlightError, fly

WIFI = LinkQuality(delay=0.005, jitter=0.005)


def arrivals(quality, count=2000):
    """Return when [s] packets sent every 0.01 s arrive, in the order in which they do."""
    channel = Channel(quality, np.random.default_rng(1))
    for k in range(count):
        channel.send(0.01 * k, k)
    came, t = [], 0.0
    while len(came) < count:
        came += [(t, k) for k in channel.receive(t)]
        t += 0.001
    assert [k for _, k in came] == list(range(count))
    return np.array([at - 0.01 * k for at, k in came])


def test_everything_arrives_in_order_and_late():
    ways = arrivals(LinkQuality(delay=0.02, jitter=0.01))
    assert ways.min() >= 0.02 - 1e-9
    assert np.mean(ways) > 0.03


def test_what_is_lost_holds_up_what_comes_after_it():
    ways = arrivals(LinkQuality(delay=0.02, loss=0.01))
    assert np.median(ways) == pytest.approx(0.02, abs=0.002)
    assert 0.1 < np.mean(ways > 0.1) * 10 < 2.0  # ten packets behind each that was lost
    assert ways.max() >= 0.22


def hovering(link, tolerance=None):
    """Return the loop hovering over a link; raises NoFlightError."""
    loop = linked(load_scenario("hover"), link, tolerance=tolerance)
    loop.aircraft.place(np.array([0.0, 0.0, 3.0]), yaw=0.0)
    while loop.guard.mode is not Mode.HOVERING:
        loop.inbox.request = Request.START
        loop.step()
        if loop.t > 8.0:
            raise NoFlightError(loop.log.outputs[-1][1].reason)
    return loop


def run(loop, seconds):
    """Return the modes of some seconds in their order, and the last reason."""
    end, since = loop.t + seconds, len(loop.log.outputs)
    while loop.t < end:
        loop.step()
    outputs = [output for _, output in loop.log.outputs[since:]]
    modes = [o.mode for i, o in enumerate(outputs) if i == 0 or o.mode is not outputs[i - 1].mode]
    return modes, outputs[-1].reason


def test_a_link_that_is_cut_ends_in_a_brake_and_comes_back():
    loop = hovering(WIFI)
    loop.cut(is_up=False)
    modes, reason = run(loop, 1.2)
    assert modes == [Mode.HOVERING, Mode.BRAKING]
    assert "the plan is 0.5" in reason
    loop.cut(is_up=True)
    assert run(loop, 3.0)[0][-1] is Mode.HOVERING
    assert abs(loop.guard.link.offset) < 0.02, "an outage is no skew"


@pytest.mark.parametrize(
    ("skew", "words"), [(0.3, "ahead of the guard's"), (-0.3, "behind the guard's")]
)
def test_nothing_starts_on_a_skewed_clock(skew, words):
    with pytest.raises(NoFlightError, match=f"the controller's clock is 0.3. s {words}"):
        hovering(LinkQuality(delay=0.005, jitter=0.005, skew=skew))


def test_without_the_check_it_would():
    """Twin: a clock that is behind passes every other check of the plans."""
    assert hovering(LinkQuality(delay=0.005, skew=-0.3), tolerance=10.0).guard.mode is Mode.HOVERING


def test_a_link_too_slow_for_the_state_is_named():
    with pytest.raises(NoFlightError, match="old by the controller's clock"):
        hovering(LinkQuality(delay=0.25))


@pytest.mark.long
def test_over_a_good_link_it_flies_as_without_one():
    scenario = load_scenario("hexagon")
    loop = linked(scenario, WIFI)
    fly(scenario, loop)
    assert loop.controller.itinerary.outcome.arrived
    assert all(output.mode is not Mode.BRAKING for _, output in loop.log.outputs[-500:])


def test_the_table_has_a_line_for_each_link():
    rows = [{**vars(link), "arrived": False, "reason": "not"} for link in LINKS]
    assert len(table(rows).splitlines()) == 2 + len(LINKS)
