"""The paper's crank mechanism."""
