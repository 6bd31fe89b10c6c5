"""What every command shares: faults in one line, whole files, archives, progress."""
