"""Integrators: steps in time, error control and outputs."""
