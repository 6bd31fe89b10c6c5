"""The embedded scene, ray-traced with photographic textures, and its truth."""
