"""What the page's script does with the numbers of an animation."""

import numpy as np


def decoded(nodes, numbers):
    """What `studies.report.animation.encoded` wrote, (frames, nodes, 4)."""
    changes = np.array(numbers).reshape(-1, nodes * 4)
    steps = np.concatenate([changes[:1], np.cumsum(changes[1:], axis=0)])
    return np.cumsum(steps, axis=0).reshape(-1, nodes, 4)
