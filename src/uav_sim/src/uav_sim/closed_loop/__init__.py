"""Controller, guard and simulated aircraft together: flights without ROS, and the command that flies with it."""
