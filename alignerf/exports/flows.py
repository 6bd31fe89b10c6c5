"""What a round says of a camera: the flow of its view and the depth of its render."""

from pathlib import Path

from alignerf.files import archives
from alignerf.scenes import prepared
from flow.camera import correct
from flow.warping import files


def read(loaded: prepared.Scene, view, flow, depth, pixtocams=None) -> correct.View:
    """A view's flow to its photo and its depth, from folders of <view>.npz.

    view: its index. pixtocams [n, 3, 3]: of the renders, where they are not the
    scene's. Raises ValueError with the file's name where its size is not the views'.
    """
    name = f"{loaded.names[view]}.npz"
    flow_px, valid = files.read_flow(Path(flow) / name)
    depth_map = archives.read(Path(depth) / name, ["depth"])["depth"]
    size = loaded.height, loaded.width
    for folder, image in ((flow, valid), (depth, depth_map)):
        if image.shape != size:
            raise ValueError(f"{Path(folder) / name}: {image.shape}, not {size} px")
    pixtocams = loaded.pixtocams if pixtocams is None else pixtocams
    return correct.View(flow_px, valid, pixtocams[view], depth_map)
