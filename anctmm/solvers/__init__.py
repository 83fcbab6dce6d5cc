"""Solvers by name, and what each can do."""
