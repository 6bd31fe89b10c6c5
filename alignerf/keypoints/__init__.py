"""Keypoints of COLMAP's tracks aligned by patches of photos, and cameras by them."""
