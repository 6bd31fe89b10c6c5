"""Optical flow from a render to a photo: estimators, blur, flows made elsewhere."""
