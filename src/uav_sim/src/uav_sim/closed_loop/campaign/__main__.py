# SPDX-License-Identifier: MIT
"""``python -m uav_sim.closed_loop.campaign``."""

from uav_sim.closed_loop.campaign.cli import main

if __name__ == "__main__":
    main()
