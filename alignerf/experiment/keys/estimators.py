"""Names of the flow's estimators: several sections have a key that takes one."""

from alignerf.io.environment import extensions

# What aligns in its loop may use them: they take no longer than the training.
FAST = (
    *("dis_ultrafast", "dis_fast", "dis_medium", "dis_fine", "dis_smooth"),
    *("deepflow", *extensions.names("estimators")),
)
EVERY = (*FAST, "farneback", "tvl1", "simpleflow", "files")
