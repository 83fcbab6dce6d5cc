"""One run of one case: what comes out, and how far it can be trusted."""
