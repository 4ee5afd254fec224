"""Measures the solver backends on recorded problems, beside the paper's own formulation."""
