# SPDX-License-Identifier: MIT
"""A simulated Matrice 100 behind the interface of dji_sdk."""
