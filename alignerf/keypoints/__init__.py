"""Cameras of COLMAP's model adjusted by keypoints evenly over each view."""
