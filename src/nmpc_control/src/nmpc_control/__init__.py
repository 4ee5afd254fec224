"""Non-linear model predictive control for the DJI Matrice 100."""
