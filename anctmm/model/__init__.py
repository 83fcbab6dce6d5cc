"""What is there: bodies, joints, loads, histories and the graph they make."""
