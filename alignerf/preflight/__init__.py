"""What a plan costs before it starts, and what is left of it while it runs."""
