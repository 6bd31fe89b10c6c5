"""What the environment tells a command, and what it may not."""
