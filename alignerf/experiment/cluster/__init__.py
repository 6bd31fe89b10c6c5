"""Beyond one machine: what jobs ask for, why they ended, where results are stored."""
