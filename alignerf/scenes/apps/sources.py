"""The apps by the name of their source, and what is to be said of their poses."""

from pathlib import Path

from alignerf.scenes.apps import polycam, record3d, scanner3d

# In this order a folder is recognised.
APPS = {"polycam": polycam, "scanner3d": scanner3d, "record3d": record3d}
# Said in the log and in poses.json.
OF_PHONE = "poses of the phone: expect pixels of error"
OF_APP = "poses optimised by Polycam"


def like(folder):
    """The source of the app that a folder is meant to be of, or None."""
    return next((name for name, app in APPS.items() if app.is_like(folder)), None)


def said_of(source, folder):
    """What is said of the poses that an app gives; None of other sources."""
    if source not in APPS:
        return None
    is_optimised = source == "polycam" and polycam.is_optimised(folder)
    return OF_APP if is_optimised else OF_PHONE


def link_photos(source, folder, work_folder):
    """A new folder <work_folder>/taken with a link to each photo of an app's folder.

    COLMAP finds photos there and nothing else, by the names of the views.
    """
    links = Path(work_folder) / "taken"
    links.mkdir()
    for name, path in APPS[source].photos_of(folder).items():
        (links / f"{name}{path.suffix}").symlink_to(path.resolve())
    return links
