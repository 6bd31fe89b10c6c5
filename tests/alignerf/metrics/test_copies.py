"""Photos that lie there twice."""

import cv2
import numpy as np

from alignerf.metrics import copies
from tests import judged_cases

WIDE = judged_cases.picture(3, (400, 120))
PHOTOS = [WIDE[:, 4 * i : 4 * i + 160] for i in range(6)]


HERE = np.eye(4)[:3]


def of(photos, places=None):
    places = np.zeros(len(photos)) if places is None else places
    poses = np.array([HERE] * len(photos)).reshape(-1, 3, 4)
    poses[:, 0, 3] = places
    return copies.of([copies.small(photo) for photo in photos], poses)


def test_a_copy_is_found_also_packed_anew_and_of_another_size():
    packed = cv2.imencode(".jpg", PHOTOS[1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
    again = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    larger = cv2.resize(PHOTOS[2], None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    assert of([*PHOTOS, again, larger]) == [6, 7]


def test_neighbours_of_a_film_and_flat_photos_are_none():
    assert of(PHOTOS) == []
    # In the dark they differ by less.
    assert of([photo // 8 for photo in PHOTOS]) == []
    assert of([np.zeros_like(PHOTOS[0])] * 3) == []
    assert of([]) == of(PHOTOS[:1]) == []
    # A photo that was only made brighter is another photo.
    assert of([PHOTOS[0], cv2.convertScaleAbs(PHOTOS[0], alpha=1.2)]) == []


def test_what_looks_alike_from_two_places_is_no_copy():
    """As on a turntable."""
    assert of([PHOTOS[0]] * 3, [0.0, 0.5, 0.5]) == [2]
