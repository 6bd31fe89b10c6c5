"""What other programs train and render: their data, their commands, their images."""
