"""A scene's folder for other programs: photos, cameras, points, and how to use it."""
