"""A bare 50 Hz publisher beside the flight: what this machine does to any such process just now.

Prints the longest gap [ms] of ROS time between two messages when it is interrupted.
"""

import sys

import rospy
from sensor_msgs.msg import Joy


def main() -> None:
    rospy.init_node("bare_stream", anonymous=True)
    publisher = rospy.Publisher("bare_stream", Joy, queue_size=1)
    rate = rospy.Rate(50.0)
    longest, last = 0.0, None
    try:
        while not rospy.is_shutdown():
            now = rospy.Time.now()
            publisher.publish(Joy(axes=[0.0] * 5))
            if last:  # 0 until the first /clock has come
                longest = max(longest, (now - last).to_sec())
            last = now
            rate.sleep()
    except rospy.ROSInterruptException:
        pass
    sys.stdout.write(f"{1e3 * longest:.1f}\n")


if __name__ == "__main__":
    main()
