#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares the tracks of laser_tracker with the simulator's truth while rubbish arrives as scans.

Prints JSON in the last line: errors, names, what was refused, what diagnostics say.
"""

import json
import math
import sys

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import LaserScan

from nmpc_msgs.msg import ObstacleArray

SETTLE, WATCHED = 0.8, 1.5  # [s] after the first track, [s]


class Client:
    def __init__(self):
        rospy.init_node("laser_client")
        self.truth, self.tracks, self.diagnoses = {}, [], {}
        rospy.Subscriber("uav_sim/obstacles", ObstacleArray, self._on_truth, queue_size=10)
        rospy.Subscriber("obstacles", ObstacleArray, self._on_tracks, queue_size=50)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics, queue_size=10)
        self.scans = rospy.Publisher("scan", LaserScan, queue_size=10)

    def _on_truth(self, message):
        self.truth[message.header.stamp.to_nsec()] = message

    def _on_tracks(self, message):
        if any(o.id.startswith("laser_") for o in message.obstacles):
            self.tracks.append(message)

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith("laser_tracker"):
                values = {v.key: v.value for v in status.values}
                self.diagnoses = {"level": status.level, "words": status.message, **values}

    def wait(self, condition, timeout, what):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not condition():
            if rospy.Time.now() > end:
                sys.exit(f"not within {timeout} s: {what}; {self.diagnoses}")
            rospy.sleep(0.02)

    def rubbish(self):
        """Send scans that must not be taken."""
        now = rospy.Time.now()
        empty = LaserScan(angle_increment=0.01, range_max=30.0)
        turned = LaserScan(angle_increment=math.nan, range_max=30.0, ranges=[1.0] * 1081)
        huge = LaserScan(angle_increment=6e-5, range_max=30.0, ranges=[1.0] * 100_000)
        future = LaserScan(angle_max=1.0, angle_increment=0.01, range_max=9.0, ranges=[1.0] * 101)
        for scan in (empty, turned, huge):
            scan.header.stamp = now
            self.scans.publish(scan)
        future.header.stamp = now + rospy.Duration(10.0)
        self.scans.publish(future)

    def watch(self):
        rospy.wait_for_message("uav_sim/obstacles", ObstacleArray, 20.0)
        self.wait(lambda: self.tracks, 20.0, "a track")
        first = self.tracks[0].header.stamp
        begin, end = first + rospy.Duration(SETTLE), first + rospy.Duration(SETTLE + WATCHED)
        while rospy.Time.now() < end:
            self.rubbish()
            rospy.sleep(0.25)
        rows, names, frames = [], set(), set()
        for message in list(self.tracks):
            frames.add(message.header.frame_id)
            if begin < message.header.stamp < end:
                rows += [row for row in [self._compare(message, names)] if row]
        return {
            "position": max(row[0] for row in rows),
            "speed": max(row[1] for row in rows),
            "compared": len(rows),
            "names": sorted(names),
            "frames": sorted(frames),
            "diagnoses": self.diagnoses,
            "growth": max(o.uncertainty_growth for m in self.tracks for o in m.obstacles),
        }

    def _compare(self, message, names):
        """Return the errors (2,) [m], [m/s] of the only track; None if there is no truth."""
        t = message.header.stamp.to_nsec()
        near = min(self.truth, key=lambda stamp: abs(stamp - t))
        if abs(near - t) > 200_000_000:
            return None
        lag = 1e-9 * (t - near)
        (true,) = self.truth[near].obstacles
        (track,) = message.obstacles
        names.add(track.id)
        x, y = true.position.x + lag * true.velocity.x, true.position.y + lag * true.velocity.y
        v, w = true.velocity, track.velocity
        off = math.hypot(track.position.x - x, track.position.y - y)
        return off, math.hypot(w.x - v.x, w.y - v.y)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(Client().watch()) + "\n")
