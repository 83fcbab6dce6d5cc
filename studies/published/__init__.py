"""Published problems with numbers: what is confirmed, contradicted, or cannot be compared."""
