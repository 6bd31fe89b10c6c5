"""The cost of a plan before it starts, and the time left while it runs."""
