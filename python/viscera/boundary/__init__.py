"""Boundary conditions: loads, supports, springs, and bonds between surfaces."""
