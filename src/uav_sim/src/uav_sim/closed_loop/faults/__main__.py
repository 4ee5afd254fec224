# SPDX-License-Identifier: MIT
"""``python -m uav_sim.closed_loop.faults``."""

from uav_sim.closed_loop.faults.cli import main

if __name__ == "__main__":
    main()
