"""The devices of a process, which share the rays of a training's step."""
