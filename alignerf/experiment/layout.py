"""Where a training's outputs lie: rules name folders, commands what is inside.

Rendering and flow are of the splits that others need, one or both. A rule's outputs
are the same for all trainings, so these are folders with an entry for each split.
"""

import re

# Below a training's folder.
OF_SPLITS = ("renders", "depth", "render", "flow", "warped", "displacement")
# Folders of a training's that are replaced as a whole.
FOLDERS = (*OF_SPLITS, "learnt")
INSIDE = re.compile(
    rf"(results/.+/(?:{'|'.join(OF_SPLITS)}))/(?:train|test)(?:\.\w+)?"
    r"|(results/.+/learnt)/(?:cameras\.npz|photos|valid)"
    r"|(results/[^/]+/images)/.+"
)


def adjusted(scene, name="cameras.npz"):
    """A file of a scene's adjusted cameras, which lie among its images.

    cameras.npz is of all views; train.npz has held-out ones as they came; report.json
    says what adjusting took.
    """
    return f"results/{scene}/images/adjusted/{name}"


def output_of(path):
    """The output of a rule that a path below results/ is, or lies in."""
    inside = INSIDE.fullmatch(path)
    return next(filter(None, inside.groups())) if inside else path


def outputs_of(paths):
    """The outputs of rules for several paths: {name: path}, or a list, each once."""
    if isinstance(paths, dict):
        return {name: output_of(path) for name, path in paths.items()}
    return list(dict.fromkeys(map(output_of, paths)))
