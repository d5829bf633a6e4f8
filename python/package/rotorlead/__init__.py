"""Identification, design, diagnosis and simulation of motors with their propellers, as the command `rotorlead` does it."""

from ._native import Error, __version__, design, diagnose, identify, simulate

__all__ = ["Error", "__version__", "design", "diagnose", "identify", "simulate"]
