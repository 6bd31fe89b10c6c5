"""A model."""

from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import model as model_keys


def check_model(model, *place):
    """Its keys go together, and its parameters fit into a machine."""
    for key, reason in model_keys.system_of(model).faults():
        fault(".".join([*place, *([key] if key else [])]), reason)
