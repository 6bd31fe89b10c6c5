"""Given: another program's renders. They are scored, and nothing is trained."""


def takes(method):
    """A method with `renders`."""
    return bool(method["renders"])


def trainings(experiment, scene, name, once):
    return []


def moves(method, round):
    return []


def words(experiment, name):
    return []
