"""What measures and documents the program: no part of it, and nothing imports it."""
