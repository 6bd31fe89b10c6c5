"""What a config means: settings, jobs and their slices, rows of tables. No JAX here."""
