# SPDX-License-Identifier: MIT
"""What the guard does in flight needs no master; and how it ends when it is told to."""

import threading
import time

import pytest

pytest.importorskip("dji_sdk", reason="the workspace is not built or not sourced")

import diagnostic_updater
import rosgraph
import rospy
from std_srvs.srv import Trigger

from nmpc_control.ros import departure, diagnostics
from nmpc_control.ros.departure import Departure
from nmpc_control.ros.diagnostics import Diagnostics
from nmpc_control.ros.known_service import KnownService

LIBRARY = diagnostic_updater.Updater
URI = "rosrpc://localhost:4242"


class Updater:
    """Stands in for diagnostic_updater: the real one's way of asking, without a node."""

    def __init__(self):
        self.sent = 0
        self.last_time_period_checked = rospy.Time(0)

    def force_update(self):
        self.sent += 1

    def update(self):
        LIBRARY._check_diagnostic_period(self)

    def setHardwareID(self, _):  # noqa: N802 (the library's name)
        pass


@pytest.fixture
def dead_master(monkeypatch):
    def refuse(*_, **__):
        raise ConnectionRefusedError("no master")

    monkeypatch.setattr(rospy, "get_param_cached", refuse)
    monkeypatch.setattr(rosgraph.Master, "lookupService", refuse)


def test_diagnostics_go_on_once_a_second(monkeypatch, dead_master):
    clock = [100.0]
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(clock[0]))
    monkeypatch.setattr(diagnostics.diagnostic_updater, "Updater", Updater)
    told = Diagnostics("M100")
    for _ in range(100):
        told.update()
        clock[0] += 0.02
    assert told._updater.sent == 2
    with pytest.raises(ConnectionRefusedError):  # twin: the library itself would end each tick
        told._updater.update()


def test_a_service_is_called_where_it_was_found(monkeypatch, dead_master):
    service = KnownService("release", Trigger)
    assert not service.find()
    service.uri = URI
    assert service.find()
    assert service._get_service_uri(Trigger._request_class()) == URI
    with pytest.raises(Exception, match="master"):  # twin: rospy asks before each call
        rospy.ServiceProxy("release", Trigger)._get_service_uri(Trigger._request_class())


def test_a_service_that_has_moved_is_looked_for_again(monkeypatch):
    asked = []

    def call(self, *_):
        asked.append(self.uri)
        if self.uri == URI:
            raise rospy.ServiceException("unable to connect to service: refused")
        return "answer"

    monkeypatch.setattr(KnownService, "__call__", call)
    monkeypatch.setattr(rospy, "wait_for_service", lambda *_: None)
    service = KnownService("release", Trigger)
    service.uri = URI
    assert service.call_within(1.0) == "answer"
    assert asked == [URI, None]


class Services:
    """Authority that is given back when it is asked for the third time."""

    def __init__(self, attempts=3):
        self.left = attempts
        self.may_hold_authority = True

    def release_now(self):
        self.left -= 1
        self.may_hold_authority = self.left > 0
        return not self.may_hold_authority, "release authority: told"


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(departure, "BRAKE_FIRST", 0.01)
    monkeypatch.setattr(departure, "PAUSE", 0.01)
    monkeypatch.setattr(departure.rospy, "logwarn", lambda _: None)


def over(leaving, within):
    deadline = time.monotonic() + within
    while not leaving.is_over and time.monotonic() < deadline:
        time.sleep(0.005)
    return leaving.is_over


def test_the_stream_may_end_only_when_authority_is_given_back(quick):
    services = Services()
    leaving = Departure(services)
    assert not leaving.is_due and not leaving.is_over
    leaving.end()
    leaving.on_signal()
    assert leaving.is_due
    assert over(leaving, 5.0)
    assert services.left == 0


def test_it_is_not_waited_for_for_ever(quick, monkeypatch):
    monkeypatch.setattr(departure, "PATIENCE", 0.2)
    leaving = Departure(Services(attempts=10**9))
    leaving.end()
    leaving.on_signal()
    assert not leaving.is_over
    assert over(leaving, 5.0)


def test_told_twice_it_ends_at_once(quick):
    leaving = Departure(Services(attempts=10**9))
    leaving.on_signal()
    with pytest.raises(KeyboardInterrupt):
        leaving.on_signal()
    assert leaving.is_over


def test_an_end_of_ros_waits_for_the_stream(quick):
    services = Services()
    leaving = Departure(services)
    threading.Timer(0.1, leaving.end).start()
    leaving.on_shutdown()
    assert not services.may_hold_authority
