"""Parts shared by all commands: exit codes, streams, options, progress."""
