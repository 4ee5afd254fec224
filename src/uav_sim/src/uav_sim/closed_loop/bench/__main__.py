# SPDX-License-Identifier: MIT
"""``python -m uav_sim.closed_loop.bench``."""

from uav_sim.closed_loop.bench.cli import main

if __name__ == "__main__":
    main()
