"""Golden answers: what the solver answers to small scenes, read through the public face alone."""
