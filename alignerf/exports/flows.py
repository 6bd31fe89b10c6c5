"""What a round says of a camera: the flow of its view and the depth of its render."""

from pathlib import Path

from alignerf.files import archives
from alignerf.scenes import prepared
from flow.camera import correct
from flow.warping import files


def read(rendered: prepared.Scene, view, flow, depth) -> correct.View:
    """A view's flow to its photo and its depth, from folders of <view>.npz.

    rendered: the scene with the cameras of the renders. view: its index. Raises
    ValueError with the file's name where its size is not the views'.
    """
    name = f"{rendered.names[view]}.npz"
    flow_px, valid = files.read_flow(Path(flow) / name)
    depth_map = archives.read(Path(depth) / name, ["depth"])["depth"]
    size = rendered.height, rendered.width
    for folder, image in ((flow, valid), (depth, depth_map)):
        if image.shape != size:
            raise ValueError(f"{Path(folder) / name}: {image.shape}, not {size} px")
    return correct.View(flow_px, valid, rendered.pixtocams[view], depth_map)
