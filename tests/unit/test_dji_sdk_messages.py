# SPDX-License-Identifier: MIT
"""Types and md5 sums of ``dji_sdk`` are those of DJI's own package, so that real nodes connect.

The sums are not computed from the files under test. They were read in message code that other
people generated from DJI's package, branches 3.3 to 3.8, and published with their workspaces
(files ``devel/share/{common-lisp,gennodejs}/ros/dji_sdk/{msg,srv}/<Type>.{lisp,js}``, each of
which states the sum of its type). One exception: MissionHpResetYaw, computed from the definition
in two published copies of DJI's package (liu978079474/OSDK_ROS, groundmelon/djiros).
"""

import importlib
import shutil
import subprocess
from pathlib import Path

import pytest

MESSAGES = {
    "FCTimeInUTC": "46bad377c3e8bc271c70f3dffa21d6ab",
    "GPSUTC": "034c4baeda26125f91567e2717d1cf5b",
    "Gimbal": "a9476856cbd230f684e89771f23da609",
    "MissionHotpointTask": "5700988132c5f205ad38c15800896e84",
    "MissionWaypoint": "22e006a33239b0dd80a9840e2fb0dd19",
    "MissionWaypointAction": "940a2c85852b1259dcafa1d9b9ce78fd",
    "MissionWaypointTask": "c869e0f592c937d8202723285e6957d0",
    "MobileData": "f43a8e1b362b75baa741461b46adc7e0",
    "PayloadData": "f43a8e1b362b75baa741461b46adc7e0",
    "VOPosition": "6edcbd5875a94886d3601c7c54dba55d",
    "Waypoint": "1d0881fabe75ce713c47829a8aa66d90",
    "WaypointList": "284386e6fe0f355bdea1db93ead90084",
}
SERVICES = {
    "Activation": "f03b0bc279b265c40946c1011df83013",
    "CameraAction": "cffa80c600cf5ffacb2c7279944f208e",
    "DroneArmControl": "0a8071a11c3d6b34ba24869e069f733c",
    "DroneTaskControl": "ab91c4042653ca6868c5907bf22e4741",
    "MFIOConfig": "ad06bda475c7f13453680ee626114de0",
    "MFIOSetValue": "7a1c84fd096204723ecbb1a57b618e28",
    "MissionHpAction": "067ec5f79e77e0b4c0121e09e733b483",
    "MissionHpGetInfo": "8c08f93488e030961f6001dc630fd2c2",
    "MissionHpResetYaw": "f03b0bc279b265c40946c1011df83013",
    "MissionHpUpdateRadius": "a73ee6c10e003f74ced091fcaa0531af",
    "MissionHpUpdateYawRate": "e4b46552667899a74d58ef421a1fe415",
    "MissionHpUpload": "af658341aaed3be3d18e0bcbefcd2cd9",
    "MissionStatus": "76ed0b909c77c6ce98df135419939be9",
    "MissionWpAction": "067ec5f79e77e0b4c0121e09e733b483",
    "MissionWpGetInfo": "412556517acb90aa4c3e713fbb867865",
    "MissionWpGetSpeed": "ca65bba734a79b4a6707341d829f4d5c",
    "MissionWpSetSpeed": "b087da1f6984d35b6029aa78841b05a6",
    "MissionWpUpload": "e18bb47c4399b0ec1e363c0b0e75db0f",
    "QueryDroneVersion": "89b6e8d274e31334cc3a372757607be2",
    "SDKControlAuthority": "ab9a31a36ad499da6a1bb989580360dd",
    "SendMobileData": "1c25dff3462ed6a8f6df1c148c7b6a1e",
    "SendPayloadData": "1c25dff3462ed6a8f6df1c148c7b6a1e",
    "SetHardSync": "11e826f14456b3511264f6a734868e08",
    "SetLocalPosRef": "eb13ac1f1354ccecb7941ee8fa2192e8",
    "SetupCameraStream": "e0732f307563f64841a2e5c6880f32d3",
    "Stereo240pSubscription": "c1205f3b01904555b852bb2bc5881da0",
    "StereoDepthSubscription": "6da41f0fc9c34988dbd56e6a11bddfdf",
    "StereoVGASubscription": "a636307470f5a4e2ecf4fbcb4aeca4ed",
}

TYPES = [("msg", *item) for item in MESSAGES.items()] + [
    ("srv", *item) for item in SERVICES.items()
]


def generated(kind):
    """Return the module with the built classes; without a sourced workspace the tests skip."""
    pytest.importorskip("genpy", reason="no ROS for this interpreter")
    pytest.importorskip("dji_sdk", reason="the workspace is not built, or not sourced")
    return importlib.import_module(f"dji_sdk.{kind}")


@pytest.mark.parametrize(("kind", "name", "md5"), TYPES, ids=[name for _, name, _ in TYPES])
def test_type_and_md5_match_dji(kind, name, md5):
    cls = getattr(generated(kind), name)
    assert cls._type == f"dji_sdk/{name}"
    assert cls._md5sum == md5


@pytest.mark.parametrize(("kind", "known"), [("msg", MESSAGES), ("srv", SERVICES)])
def test_every_definition_has_a_known_sum(kind, known):
    folder = Path(__file__).resolve().parents[2] / "src" / "dji_sdk" / kind
    assert {path.name for path in folder.iterdir()} == {f"{name}.{kind}" for name in known}


def test_constants_that_flights_depend_on():
    srv = generated("srv")
    assert srv.SDKControlAuthorityRequest.REQUEST_CONTROL == 1
    assert srv.SDKControlAuthorityRequest.RELEASE_CONTROL == 0
    assert srv.DroneTaskControlRequest.TASK_GOHOME == 1
    assert srv.DroneTaskControlRequest.TASK_TAKEOFF == 4
    assert srv.DroneTaskControlRequest.TASK_LAND == 6


def test_old_clients_in_cpp_find_their_header_and_its_values():
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    include = Path(__file__).resolve().parents[2] / "src" / "dji_sdk" / "include"
    attitude = "HORIZONTAL_ANGLE | VERTICAL_THRUST | YAW_RATE | HORIZONTAL_BODY | STABLE_ENABLE"
    code = f"""
        #include <dji_sdk/dji_sdk.h>
        using namespace DJISDK;
        static_assert(({attitude}) == 0x2B, "");
        static_assert((HORIZONTAL_VELOCITY | YAW_RATE | STABLE_ENABLE) == 0x49, "");
        static_assert(DJISDK::DroneFirmwareVersion::M100_31 == 50399744, "");
        static_assert(M100_STATUS_IN_AIR == 3 && STATUS_IN_AIR == 2, "");
        static_assert(DisplayMode::MODE_NAVI_SDK_CTRL == 17, "");
    """
    done = subprocess.run(
        [compiler, "-std=c++11", "-x", "c++", "-fsyntax-only", "-I", str(include), "-"],
        input=code,
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
