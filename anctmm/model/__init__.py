"""The model: bodies, joints, loads, histories and the graph that they form."""
