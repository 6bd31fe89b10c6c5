"""A visual vocabulary of the photos themselves, to find photos that look alike.

COLMAP finds photos that look alike by a vocabulary tree. Its own, learnt from photos of
elsewhere, would have to be downloaded; one of the scene's own features serves as well.
"""

from pathlib import Path

import numpy as np
import pycolmap

# Features that the words are learnt from, and their number: a few hundred a word.
MOST_FEATURES, WORDS = 200_000, 1024
# Of a feature, and of what is kept of it within a word: COLMAP's own numbers.
SIFT_DIMENSIONS, SHORT_DIMENSIONS = 128, 64


def build(database):
    """Write a vocabulary of a COLMAP database's features beside it; returns its path.

    The same features give the same words.
    """
    opened = pycolmap.Database.open(database)
    ids = [image.image_id for image in opened.read_all_images()]
    each = max(1, MOST_FEATURES // max(len(ids), 1))
    descriptors = [spread(opened.read_descriptors(i).data, each) for i in ids]
    opened.close()
    descriptors = np.concatenate(descriptors).astype(np.float32)
    features = pycolmap.FeatureDescriptorsFloat(
        pycolmap.FeatureExtractorType.SIFT, descriptors
    )
    index = pycolmap.VisualIndex.create(SIFT_DIMENSIONS, SHORT_DIMENSIONS)
    options = pycolmap.VisualIndex.BuildOptions()
    options.num_visual_words = min(WORDS, max(2, len(descriptors) // 50))
    options.num_threads = 1
    index.build(options, features)
    path = Path(database).with_suffix(".words")
    index.write(path)
    return path


def spread(rows, count):
    """At most `count` of the rows, evenly spaced."""
    if len(rows) <= count:
        return rows
    return rows[np.linspace(0, len(rows) - 1, count).round().astype(int)]
