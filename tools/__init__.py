"""What measures and documents the program: no part of it, and nothing imports it."""

from alignerf.io.environment import switches

# Before anything imports JAX.
switches.settle()
