"""Rounds: each trains on photos that the round before warped, or with its cameras."""

from alignerf.experiment import trainings


def changes(method):
    """What each round after the first changes: `photos` or `cameras`.

    With `rounds: auto`, of all rounds that there may be.
    """
    last = method["rounds"] if method["rounds"] != "auto" else method["most_rounds"]
    if method["changes"] == "cameras_then_photos":
        return ["cameras"] * (last - 1) + ["photos"]
    return [method["changes"]] * last


def moves(method, round):
    """What has changed by a round; None: by the last."""
    return changes(method)[:round]


def from_first(first, method, name, job, once, *, goes_on=False):
    """Round 0 and every round after it; goes_on: from the weights of that before."""
    chain = [first]
    for change in changes(method):
        before = chain[-1]
        training = after(before, f"{name}/round{len(chain)}", job, change)
        if goes_on:
            training = training._replace(initial=before.model)
        chain.append(once(training))
    return chain


def after(before, folder, job, change):
    """The round after a training: on photos that it warped, or with its cameras."""
    if change == "cameras":
        learns = {"cameras": trainings.corrected(before)}
    else:
        warped, valid = f"{before.path}/warped/train", f"{before.path}/flow/train"
        learns = {"photos": warped, "valid": valid, "cameras": before.cameras}
    taken = trainings.from_photos(before.scene, folder, job)
    return taken._replace(after=(before,), flows=(before,), **learns)
