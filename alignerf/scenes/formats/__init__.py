"""Files of cameras and photos as programs and apps write them, read into views."""
