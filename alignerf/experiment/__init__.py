"""What a config means: keys, trainings and their jobs, rows of tables. No JAX here."""
