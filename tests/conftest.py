"""Settings shared by all tests: hypothesis tries the same examples each time, and no example has a time limit."""

from hypothesis import settings

settings.register_profile("steady", derandomize=True, deadline=None, max_examples=25)
settings.load_profile("steady")
