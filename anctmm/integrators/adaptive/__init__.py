"""Steps with a length that an estimate of their error drives: `tolerance` in place of `dt`."""
