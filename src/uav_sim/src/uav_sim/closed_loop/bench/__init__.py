"""Measures the solver backends on problems recorded from closed loops, beside the paper's own formulation."""
