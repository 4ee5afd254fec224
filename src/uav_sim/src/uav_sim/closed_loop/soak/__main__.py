# SPDX-License-Identifier: MIT
"""``python -m uav_sim.closed_loop.soak``."""

from uav_sim.closed_loop.soak.cli import main

if __name__ == "__main__":
    main()
