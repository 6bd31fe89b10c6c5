"""What the keys of a config ask of each other, section by section."""
