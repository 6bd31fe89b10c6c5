"""How right and how fast the flow estimators are: `python -m tools.flow_benchmark`."""
