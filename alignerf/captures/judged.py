"""Photos beside renders of another program: these are judged, nothing is trained."""

from alignerf.captures import base, posed

# Of the key `judged`: files and folders that are read.
PATHS = ("renders", "cameras", "depth")


class Judged(posed.Posed):
    name = "judged"
    order = 8
    what = "photos beside renders of another program"
    # Renders were seen by the cameras as they are; an export has adjusted ones.
    poses = ("given",)
    keys = ("background", "judged")
    trains = False

    def read(self, scene, scratch):
        from alignerf.scenes.judged import views

        return views.load(scene, scratch)

    def read_given(self, scene):
        from alignerf.scenes.judged import views

        return views.at_full_size(scene)

    def wants_matches(self, scene):
        return bool(keys_of(scene).get("cameras")) and super().wants_matches(scene)

    def splits(self, scene):
        return keys_of(scene).get("splits") or super().splits(scene)

    def can_export(self, scene):
        return bool(keys_of(scene).get("cameras")) and "train" in self.splits(scene)

    def before(self, scene):
        return keys_of(scene).get("before")

    def paths(self, scene):
        read = {f"judged.{key}": keys_of(scene).get(key) for key in PATHS}
        return super().paths(scene) | read

    def faults(self, scene):
        """The pairs stay as they are: nothing of them is made smaller."""
        if not keys_of(scene):
            yield "judged", "goes with source 'judged', and that with it"
        for key, usual in (("downscale", 1), ("zoom", None), ("perturb_px", 0)):
            if scene[key] != usual:
                yield key, "not of renders that are judged"


def keys_of(scene):
    """Those of `judged`."""
    return base.section(scene, "judged")


CAPTURE = Judged()
