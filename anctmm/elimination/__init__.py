"""Block-sparse L D Lᵀ over all nodes and multipliers: the Riccati recursion of ANC–TMM, in any topology."""
