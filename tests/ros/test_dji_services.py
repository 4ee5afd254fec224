# SPDX-License-Identifier: MIT
"""Orders to dji_sdk: one after the other, repeated when refused, overtaken by newer ones."""

import threading

import pytest

pytest.importorskip("dji_sdk", reason="the workspace is not built or not sourced")

from nmpc_control.guard_data import Action
from nmpc_control.ros import dji_services
from nmpc_control.ros.dji_services import ATTEMPTS, DjiServices

START = [Action.OBTAIN_AUTHORITY, Action.TAKE_OFF]
PATIENCE = 10.0  # [s]


class Aircraft:
    """Stands in for dji_sdk: notes the calls, refuses or blocks as told."""

    def __init__(self, monkeypatch):
        self.calls, self.authority, self.failures = [], [], []
        self.refused = set()
        self.done = threading.Semaphore(0)
        self.gate = threading.Event()
        self.gate.set()
        monkeypatch.setattr(dji_services.DjiServices, "_call", lambda _, action: self._call(action))
        monkeypatch.setattr(dji_services, "PAUSE", 0.01)
        self.landings = []
        self.services = DjiServices(
            self.authority.append, self._fail, lambda: self.landings.append(self.done.release())
        )

    def _call(self, action):
        self.calls.append(action)
        self.done.release()
        assert self.gate.wait(PATIENCE)
        return action not in self.refused, f"{action.value}: told"

    def _fail(self, sentence):
        self.failures.append(sentence)
        self.done.release()

    def wait(self, count):
        for _ in range(count):
            assert self.done.acquire(timeout=PATIENCE)


@pytest.fixture
def aircraft(monkeypatch):
    return Aircraft(monkeypatch)


def test_authority_comes_before_the_take_off(aircraft):
    aircraft.services.order(START)
    aircraft.wait(2)
    assert aircraft.calls == START
    assert aircraft.authority == [True]


def test_no_take_off_without_authority(aircraft):
    aircraft.refused = {Action.OBTAIN_AUTHORITY}
    aircraft.services.order(START)
    aircraft.wait(ATTEMPTS + 1)
    assert aircraft.calls == [Action.OBTAIN_AUTHORITY] * ATTEMPTS
    assert aircraft.failures == ["obtain authority: told"]
    assert aircraft.authority == []


def test_a_release_overtakes_what_waits_and_nothing_is_obtained_after_it(aircraft):
    aircraft.gate.clear()
    aircraft.services.order(START)
    aircraft.wait(1)  # the call blocks
    aircraft.services.order([Action.RELEASE_AUTHORITY])
    aircraft.gate.set()
    aircraft.wait(1)
    assert aircraft.calls == [Action.OBTAIN_AUTHORITY, Action.RELEASE_AUTHORITY]
    assert True not in aircraft.authority


def test_a_reference_does_not_overtake(aircraft):
    aircraft.gate.clear()
    aircraft.services.order(START)
    aircraft.services.order([Action.SET_REFERENCE])
    aircraft.gate.set()
    aircraft.wait(3)
    assert aircraft.calls == [*START, Action.SET_REFERENCE]


def test_what_is_no_service_call_is_left_to_the_node(aircraft):
    aircraft.services.order([Action.HOLD])
    aircraft.services.order([Action.LAND])
    aircraft.wait(1)
    assert aircraft.calls == [Action.LAND]


@pytest.mark.parametrize("is_refused", [False, True])
def test_a_landing_that_was_granted_is_told(aircraft, is_refused):
    aircraft.refused = {Action.LAND} if is_refused else set()
    aircraft.services.order([Action.LAND])
    aircraft.wait(ATTEMPTS + 1 if is_refused else 2)
    assert len(aircraft.landings) == (0 if is_refused else 1)


def test_at_shutdown_the_release_waits_for_nobody(aircraft):
    aircraft.gate.clear()
    aircraft.services.order(START)
    aircraft.wait(1)
    threading.Timer(0.1, aircraft.gate.set).start()
    assert aircraft.services.release_now() == (True, "release authority: told")
    assert aircraft.calls[-1] is Action.RELEASE_AUTHORITY
    assert Action.TAKE_OFF not in aircraft.calls
