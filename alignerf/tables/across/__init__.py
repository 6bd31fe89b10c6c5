"""Tables across scenes, or of a sweep: a command each."""
