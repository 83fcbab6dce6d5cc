"""Settings shared by all tests: hypothesis tries the same examples each time, and no example has a time limit.

`--hypothesis-profile thorough` tries many new ones.
"""

from hypothesis import settings

settings.register_profile("steady", derandomize=True, deadline=None, max_examples=25)
settings.register_profile("thorough", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")
