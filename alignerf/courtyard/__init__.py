"""The embedded scene, ray-traced with photographic textures, and its truth."""

OBJECTS = ("ground", "hedge", "hills", "sky", "wall", "posts", "wires", "plinth")
OBJECTS += ("trunk", "tower", "case", "carton", "tin", "arm")
