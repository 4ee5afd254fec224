# SPDX-License-Identifier: MIT
"""Many simulated flights among drawn obstacles, in parallel: suites, runner, feasibility."""
