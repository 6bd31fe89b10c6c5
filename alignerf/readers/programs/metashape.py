"""Metashape's cameras, exported as Agisoft XML.

A camera's transform is camera-to-world with OpenCV's axes, in the frame of its chunk;
the chunk's own, into a map, is left out. Cameras of several components share no frame:
the largest is taken. A principal point is counted from the middle, p1 and p2 are
OpenCV's p2 and p1, b1 is added to fx, b2 is a skew. Old exports have fx and fy, and
count the principal point from the corner. Of a fisheye the same numbers bend
the angle from the axis. Formulas: Metashape's manual, appendix D.
"""

import collections
import logging
import math
import xml.parsers.expat
from xml.etree import ElementTree

import numpy as np

from alignerf.io import faults
from alignerf.readers import shots

log = logging.getLogger("alignerf")

NAME = "Metashape"
PATTERNS = ("*.xml",)
MARK = b"<chunk"
MAX_BYTES = 2**28
# By so much a lens may be mistaken at the photo's border.
FIT_PX, SKEW_PX = 0.05, 0.5
UNSUPPORTED = ("p3", "p4")


def read(path):
    root = parsed(path)
    chunks = root.iter("chunk")
    chunk = max(chunks, key=lambda one: len(posed(one)), default=None)
    if chunk is None or not posed(chunk):
        raise ValueError(f"{path}: no camera has a pose: align the photos first")
    sensors = {sensor.get("id"): sensor for sensor in chunk.iter("sensor")}
    parts = collections.Counter(one.get("component_id") for one in posed(chunk))
    (part, count), *others = parts.most_common()
    if others:
        log.warning(
            "%s: %d components, which share no frame: the largest is taken, of %d "
            "cameras",
            *(path, len(parts), count),
        )
    found, lenses = [], {}
    for camera in posed(chunk):
        if camera.get("component_id") != part:
            continue
        name, number = camera.get("label", ""), camera.get("sensor_id")
        where = f"{path}: {faults.name_of(name)}"
        if number not in sensors:
            raise ValueError(f"{where}: no sensor {number}")
        if number not in lenses:
            lenses[number] = lens_of(f"{path}: sensor {number}", sensors[number])
        values = shots.numbers(where, camera.findtext("transform").split(), 16)
        matrix, (lens, size) = values.reshape(4, 4), lenses[number]
        pose = shots.pose(matrix[:3, :3], matrix[:3, 3])
        found.append(shots.Shot(name, lens, pose, size))
    return found


def parsed(path):
    """The root of an XML; ValueError for one that declares anything, as a bomb does."""
    content = faults.content(path, MAX_BYTES)

    def refuse(*_):
        raise ValueError(f"{path}: a DOCTYPE in it: save it without")

    looked = xml.parsers.expat.ParserCreate()
    looked.StartDoctypeDeclHandler = refuse
    try:
        looked.Parse(content, True)
        return ElementTree.fromstring(content)
    except (xml.parsers.expat.ExpatError, ElementTree.ParseError, LookupError) as error:
        raise ValueError(f"{path}: not the XML that it should be: {error}") from None


def posed(chunk):
    """The cameras of a chunk that are used and have a pose."""
    return [
        camera
        for camera in chunk.iter("camera")
        if camera.get("enabled", "true") not in ("0", "false")
        and camera.findtext("transform")
    ]


def lens_of(where, sensor):
    """((camtopix, distortion), (width, height)) of a sensor."""
    found = sensor.findall("calibration")
    adjusted = [one for one in found if one.get("class") == "adjusted"]
    if not found:
        raise ValueError(f"{where}: no calibration: align the photos first")
    calibration = (adjusted or found)[0]
    resolution = calibration.find("resolution")
    if resolution is None:
        resolution = sensor.find("resolution")
    if resolution is None:
        raise ValueError(f"{where}: no resolution")
    sides = [resolution.get(side, "") for side in ("width", "height")]
    size = width, height = (*shots.numbers(f"{where}: resolution", sides, 2).tolist(),)

    def value(name, default=0.0):
        text = calibration.findtext(name)
        return default if text is None else shots.numbers(where, [text], 1)[0]

    focal = value("f", None)
    fx, fy = value("fx", focal), value("fy", focal)
    if fx is None or fy is None or min(fx, fy, width, height) <= 0:
        raise ValueError(f"{where}: no focal length or size")
    kind = calibration.get("type") or sensor.get("type") or "frame"
    if kind not in ("frame", "fisheye"):
        way = ": make cube faces of it first" if kind == "spherical" else ""
        raise ValueError(f"{where}: a sensor of type {faults.shown(kind)}{way}")
    if odd := [name for name in UNSUPPORTED if value(name)]:
        raise ValueError(f"{where}: distortion {odd[0]} is not supported")
    skew_px = abs(value("b2") or value("skew")) * height / 2 / fy
    if skew_px > SKEW_PX:
        raise ValueError(
            f"{where}: its skew b2 is {skew_px:.1f} px at the border: optimize the "
            "cameras without b2, or export undistorted photos"
        )
    ks, (p2, p1) = [value(f"k{i}") for i in (1, 2, 3, 4)], map(value, ("p1", "p2"))
    left, top = (0, 0) if focal is None else (width / 2, height / 2)
    params = [fx + value("b1"), fy, left + value("cx"), top + value("cy")]
    if kind == "fisheye":
        model, params = "THIN_PRISM_FISHEYE", [*params, *ks[:2], p1, p2, *ks[2:], 0, 0]
    else:
        most = math.hypot(width, height) / 2 / min(fx, fy)
        k1, k2, *rest = of_fourth(where, ks, most, fx) if ks[3] else (*ks[:3], 0, 0, 0)
        model, params = "FULL_OPENCV", [*params, k1, k2, p1, p2, *rest]
    return shots.lens(where, model, params), size


def of_fourth(where, ks, most, focal_px):
    """OpenCV's k1 to k6 [6] of k1 to k4: a quotient of polynomials that is the same.

    most: the distance from the axis up to which it is to be. Raises ValueError where it
    is off by more than FIT_PX.
    """
    squares = np.linspace(0, most, 500)[1:, None] ** 2
    wanted = 1 + squares ** [1, 2, 3, 4] @ ks
    powers = squares ** [1, 2, 3]
    unknown = np.concatenate([powers, -wanted[:, None] * powers], axis=1)
    found = np.linalg.lstsq(unknown, wanted - 1)[0]
    made = (1 + powers @ found[:3]) / (1 + powers @ found[3:])
    off_px = np.abs((made - wanted) * np.sqrt(squares[:, 0])).max() * focal_px
    if not off_px < FIT_PX:
        raise ValueError(
            f"{where}: its k4 cannot be undone (off by {off_px:.2g} px): optimize the "
            "cameras without it"
        )
    return found
