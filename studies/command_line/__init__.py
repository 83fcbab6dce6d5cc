"""What every command shares: how it ends, its streams, its options, its progress."""
