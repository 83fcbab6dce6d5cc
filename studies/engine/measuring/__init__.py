"""Times: of contestants in turn, on one thread, after a warm-up; and what the benchmark runs."""
