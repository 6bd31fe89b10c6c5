"""What every command shares: faults in a line, whole files, images, cores, progress."""
