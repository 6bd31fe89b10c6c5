"""Photos beside renders of another program: these are judged, nothing is trained."""

from alignerf.captures import posed

# Of the key `judged`: files and folders that are read.
PATHS = ("renders", "cameras", "depth", "before")


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
        return bool(scene["judged"]["cameras"]) and super().wants_matches(scene)

    def paths(self, scene):
        own = scene["judged"] or {}
        return super().paths(scene) | {f"judged.{k}": own.get(k) for k in PATHS}

    def faults(self, scene):
        """The pairs stay as they are: nothing of them is made smaller."""
        if not scene["judged"]:
            yield "judged", "goes with source 'judged', and that with it"
        for key, usual in (("downscale", 1), ("zoom", None), ("perturb_px", 0)):
            if scene[key] != usual:
                yield key, "not of renders that are judged"


CAPTURE = Judged()
