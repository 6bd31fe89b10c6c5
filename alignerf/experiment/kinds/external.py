"""External: another program's renders. They are scored, and nothing is trained."""


def takes(method):
    return bool(method["renders"])


def trainings(experiment, scene, name, once):
    return []


def words(experiment, name):
    return []
