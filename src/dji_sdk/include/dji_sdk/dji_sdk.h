// SPDX-License-Identifier: MIT
// The names that C++ clients of dji_sdk use, with DJI's values; unlike DJI's own header this one
// needs no onboard SDK library. Sources: uav_sim/doc/dji_sdk.md, sections 2.2, 2.3, 3.2 and 4.
#ifndef DJI_SDK_DJI_SDK_H
#define DJI_SDK_DJI_SDK_H

namespace DJISDK {

// Answer of query_drone_version on an M100.
enum DroneFirmwareVersion { M100_31 = 0x03010A00 };

typedef enum AircraftVersion { UNKNOWN, M100, M600, A3, N3, M210 } AircraftVersion;

// Fifth axis of flight_control_setpoint_generic: one of each group, or'ed.
enum FlightControlFlag {
  HORIZONTAL_ANGLE = 0x00,
  HORIZONTAL_VELOCITY = 0x40,
  HORIZONTAL_POSITION = 0x80,
  HORIZONTAL_ANGULAR_RATE = 0xC0,  // not on an M100

  VERTICAL_VELOCITY = 0x00,
  VERTICAL_POSITION = 0x10,
  VERTICAL_THRUST = 0x20,

  YAW_ANGLE = 0x00,
  YAW_RATE = 0x08,

  HORIZONTAL_GROUND = 0x00,
  HORIZONTAL_BODY = 0x02,

  STABLE_DISABLE = 0x00,
  STABLE_ENABLE = 0x01
};

// Values of display_mode, a topic that an M100 does not have.
enum DisplayMode {
  MODE_MANUAL_CTRL = 0,
  MODE_ATTITUDE = 1,
  MODE_P_GPS = 6,
  MODE_HOTPOINT_MODE = 9,
  MODE_ASSISTED_TAKEOFF = 10,
  MODE_AUTO_TAKEOFF = 11,
  MODE_AUTO_LANDING = 12,
  MODE_NAVI_GO_HOME = 15,
  MODE_NAVI_SDK_CTRL = 17,
  MODE_FORCE_AUTO_LANDING = 33,
  MODE_SEARCH_MODE = 40,
  MODE_ENGINE_START = 41
};

// flight_status of newer aircraft.
enum FlightStatus { STATUS_STOPPED = 0, STATUS_ON_GROUND = 1, STATUS_IN_AIR = 2 };

// flight_status of an M100; 2 means something else than above.
enum M100FlightStatus {
  M100_STATUS_ON_GROUND = 1,
  M100_STATUS_TAKINGOFF = 2,
  M100_STATUS_IN_AIR = 3,
  M100_STATUS_LANDING = 4,
  M100_STATUS_FINISHED_LANDING = 5
};

}  // namespace DJISDK

#endif  // DJI_SDK_DJI_SDK_H
