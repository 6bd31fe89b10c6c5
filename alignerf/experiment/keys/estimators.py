"""Names of the flow's estimators: several sections have a key that takes one."""

from alignerf.io.environment import extensions

EVERY = ("dis_fast", "dis_medium", "dis_fine", "deepflow")
EVERY += tuple(extensions.names("estimators"))
