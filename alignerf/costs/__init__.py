"""What a scene's trainings take, estimated before the first one starts."""
