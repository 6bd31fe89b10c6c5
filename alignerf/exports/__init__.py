"""A scene's folder for other programs: photos, cameras, points, and how to use it.

`flows` reads what rounds found of cameras; stages that put these right read it too.
"""
