"""The transfer-matrix method: transfer equations, Riccati recursion, accelerations, constraints."""
