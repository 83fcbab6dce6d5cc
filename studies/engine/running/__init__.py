"""How runs are done: here, by worker processes, or on a cluster; and times by themselves, in turn."""
