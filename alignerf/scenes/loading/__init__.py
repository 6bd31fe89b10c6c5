"""A scene's views by its source, its points, and windows of it."""
