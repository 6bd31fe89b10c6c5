"""Tables across scenes, or of a sweep."""
