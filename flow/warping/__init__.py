"""What is done with a flow: warps, where they are valid, controls, files, lengths."""
