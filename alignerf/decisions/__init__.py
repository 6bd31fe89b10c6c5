"""What a scene requires: settings that its facts decide, each with its reason."""
