"""Controller, guard and simulated aircraft together.

Flights without ROS, and the command that flies with it.
"""
