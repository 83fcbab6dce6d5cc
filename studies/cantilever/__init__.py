"""Large deflections against exact solutions; a fall under gravity."""
