"""Settings that a scene's facts decide, each with its reason."""
