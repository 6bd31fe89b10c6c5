"""The photos of a project: those that a json names, or the same made smaller."""

import functools
import os
import re
import sys
from pathlib import Path

from alignerf.files import faults

# Whether names that differ in case alone are those of two files.
TELLS_APART = sys.platform == "linux"
# instant-ngp's synthetic scenes leave the suffix away.
SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
SMALLER = re.compile(r"images_([1-9][0-9]?)")


def least_number(folder):
    """The least n of the folders images_<n>, the largest photos; None without any."""
    found = [SMALLER.fullmatch(path.name) for path in Path(folder).glob("images_*")]
    return min((int(one[1]) for one in found if one), default=None)


class Images:
    """The files beside a json, each folder listed once: there may be 100,000 frames.

    number: photos are those of <folder>_<number>, as `images_4` beside `images`, where
    nerfstudio has made them smaller; None for the folders that the json names.
    """

    def __init__(self, path, number=None):
        self.path, self.folder = path, os.path.abspath(path.parent)
        self.times_smaller = number or 1
        self.suffix = "" if self.times_smaller == 1 else f"_{number}"
        self.listed = functools.cache(self.names_in)

    def find(self, file_path):
        """The image a frame names, or None; ValueError where it lies outside."""
        # By name, not resolved: a link inside the folder is the user's own decision.
        place = os.path.normpath(os.path.join(self.folder, file_path))
        if not place.startswith(self.folder.rstrip(os.sep) + os.sep):
            raise ValueError(
                f"{self.path}: {faults.shown(file_path)} leads out of its folder"
            )
        folder, name = os.path.split(place)
        if self.suffix and folder != self.folder:
            folder += self.suffix
        for suffix in SUFFIXES:
            # Where case or accents do not tell names apart, the disk is asked itself.
            if not TELLS_APART or name + suffix in self.listed(folder):
                image = Path(folder, name + suffix)
                if image.is_file():
                    return image
        return None

    @staticmethod
    def names_in(folder):
        """Names of all that lies in a folder; none where there is no such folder."""
        try:
            return frozenset(os.listdir(folder))
        # A name may be too long, or hold a zero, for any file.
        except (OSError, ValueError):
            return frozenset()
