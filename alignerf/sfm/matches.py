"""Verified matches between views, found in photos of a useful size.

Geometric verification is uncalibrated: no match depends on the input cameras. A tenth
of the tracks is held out of every correction, so that they can judge it.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap
import scipy.sparse
from jaxtyping import Float, Int

from alignerf.colmap import mapping
from alignerf.io import archives
from alignerf.scenes import prepare

# Twice as many features as nearness needs: poses of a hundredth of a degree do.
MAX_FEATURES = 4096
# Up to so many photos all pairs are matched. Of more, each photo meets those that
# follow it by name and those whose cameras see the same: cost grows linearly.
MAX_EXHAUSTIVE, NEAREST = 60, 20
# Cameras that look so far apart see no common surface.
MAX_TURN = np.radians(75)
# Of the tracks, held out of adjustments.
HELD_OUT = 0.1
# Beside a prepared scene's images.
FILE = "images/matches.npz"


class Matches(NamedTuple):
    """Keypoints of each view, which of them match, and which are held out.

    keypoints: [k, 2] of each view, in px of images of width x height, pixel centres at
    +0.5. pairs [p, 2] of view indices; indices: of each pair, [m, 2] into the two
    views' keypoints. draws: [k] of each view, one number between 0 and 1 for each
    track: those under HELD_OUT are held out.
    """

    names: list[str]
    width: int
    height: int
    keypoints: list[Float[np.ndarray, "k 2"]]
    pairs: Int[np.ndarray, "p 2"]
    indices: list[Int[np.ndarray, "m 2"]]
    draws: list[Float[np.ndarray, " k"]]

    def places(self, *, held_out=None):
        """(views [m, 2], xy [m, 2, 2]) of all matches; held_out: of one part alone."""
        views, xy = [np.zeros((0, 2), int)], [np.zeros((0, 2, 2))]
        for pair, index in zip(self.pairs, self.indices, strict=True):
            (i, j), (a, b) = pair, index.T
            kept = slice(None)
            if held_out is not None:
                kept = (self.draws[i][a] < HELD_OUT) == held_out
            ends = np.stack([self.keypoints[i][a], self.keypoints[j][b]], axis=1)[kept]
            views.append(np.broadcast_to(pair, (len(ends), 2)))
            xy.append(ends)
        return np.concatenate(views), np.concatenate(xy)

    def between(self, views):
        """The matches between two of the chosen views [n] bool."""
        kept = np.flatnonzero(views[self.pairs].all(axis=1))
        indices = [self.indices[k] for k in kept]
        return self._replace(pairs=self.pairs[kept], indices=indices)

    def used(self, most):
        """(low, high): the draws of about `most` matches, none of them held out."""
        share = most / max(self.count(), 1)
        return HELD_OUT, min(HELD_OUT + share, 1.0)

    def count(self):
        """The number of matches."""
        return sum(map(len, self.indices))


def find(views: prepare.PosedViews, work, *, max_size_px, seed) -> Matches:
    """The matches of views, by SIFT in photos of at most max_size_px.

    Writes into the folder `work`: matched/<view>.png, and COLMAP's database.
    """
    small = prepare.downscale(
        views, max(1, max(views.width, views.height) / max_size_px)
    )
    folder, masks = Path(work) / "matched", None
    if small.masks is not None:
        masks = Path(work) / "matched_masks"

    size = small.width, small.height
    database, names, pairs = Path(work) / "matched.db", views.names, None

    def write(some):
        now = prepare.select(small, [names.index(name) for name in some])
        prepare.write_photos(folder, now)
        if masks:
            prepare.write_photos(masks, now._replace(photos=now.masks), ".png.png")

    if len(names) > MAX_EXHAUSTIVE:
        pairs = {(i + 1, j + 1) for i, j in neighbours(views.camtoworlds)}
    pycolmap.set_random_seed(seed)
    with mapping.room_for(database):
        write_views(database, names, size)
        mapping.find_matches(
            database,
            folder,
            names,
            max_size_px=max_size_px,
            seed=seed,
            masks=masks,
            most=MAX_FEATURES,
            pairs=pairs,
            write=write,
        )
    ids = {name: i + 1 for i, name in enumerate(names)}
    return read(database, ids, size, seed=seed)


def write_views(database, names, size):
    """COLMAP's database of views; each has its number by name, counted from 1.

    Cameras have no prior focal length, so that verification asks for none.
    """
    with pycolmap.Database.open(database) as file:
        camera = pycolmap.Camera.create_from_model_name(1, "SIMPLE_PINHOLE", 1.0, *size)
        file.write_camera(camera, use_camera_id=True)
        for number, name in enumerate(names, start=1):
            image = pycolmap.Image(name=f"{name}.png", camera_id=1, image_id=number)
            file.write_image(image, use_image_id=True)


def neighbours(camtoworlds, following=mapping.FOLLOWING, nearest=NEAREST):
    """Pairs (i, j), i < j, of views that follow one another or see the same."""
    n = len(camtoworlds)
    found = {(i, j) for i in range(n) for j in range(i + 1, min(n, i + 1 + following))}
    centres, axes = camtoworlds[:, :, 3], camtoworlds[:, :, 2]
    for i in range(n):
        away = np.linalg.norm(centres - centres[i], axis=1)
        away[axes @ axes[i] < np.cos(MAX_TURN)] = np.inf
        away[i] = np.inf
        order = np.argsort(away, kind="stable")[:nearest]
        found |= {(min(i, j), max(i, j)) for j in order[np.isfinite(away[order])]}
    return {(int(i), int(j)) for i, j in found}


def read(database, ids, size, *, seed, to_pixels=None) -> Matches:
    """The verified matches of COLMAP's database.

    ids: {view: image id}. to_pixels: {view: function from keypoints [k, 2] to px of the
    view}, where those of the database are of photos as taken.
    """
    names = sorted(ids)
    index = {ids[name]: i for i, name in enumerate(names)}
    with pycolmap.Database.open(database) as file:
        xy = [file.read_keypoints(ids[name])[:, :2].astype(float) for name in names]
        numbers, found = file.read_two_view_geometries()
    if to_pixels:
        xy = [to_pixels[name](one) for name, one in zip(names, xy, strict=True)]
    pairs, indices = [], []
    for number, one in zip(numbers, found, strict=True):
        ends = pycolmap.pair_id_to_image_pair(number)
        if len(one.inlier_matches) and all(end in index for end in ends):
            pair, matched = [index[end] for end in ends], one.inlier_matches.astype(int)
            backwards = pair[0] > pair[1]
            pairs.append(pair[::-1] if backwards else pair)
            indices.append(matched[:, ::-1] if backwards else matched)
    pairs = np.array(pairs, int).reshape(-1, 2)
    return hold_out(names, size, xy, pairs, indices, seed)


def hold_out(names, size, keypoints, pairs, indices, seed) -> Matches:
    """Matches with a tenth of their tracks held out; keypoints without any go."""
    starts = np.cumsum([0, *map(len, keypoints)])
    ends = [
        index + starts[pair] for pair, index in zip(pairs, indices, strict=True)
    ] or [np.zeros((0, 2), int)]
    first, second = np.concatenate(ends).T
    # SIFT finds one place several times, in several directions: it is one track.
    own, twin = np.concatenate([*map(twins, keypoints, starts)]).T
    edges = np.concatenate([first, own]), np.concatenate([second, twin])
    graph = scipy.sparse.coo_array(
        (np.ones(len(edges[0]), bool), edges), shape=(starts[-1], starts[-1])
    )
    _, track = scipy.sparse.csgraph.connected_components(graph, directed=False)
    drawn = np.random.default_rng([seed, 2]).random(track.max(initial=-1) + 1)
    used = np.zeros(starts[-1], bool)
    used[first] = used[second] = True
    number = np.cumsum(used) - 1
    kept = []
    for i, xy in enumerate(keypoints):
        own = slice(starts[i], starts[i + 1])
        kept.append((xy[used[own]], drawn[track[own]][used[own]]))
    counts = np.cumsum([0, *(len(xy) for xy, _ in kept)])
    return Matches(
        names=list(names),
        width=int(size[0]),
        height=int(size[1]),
        keypoints=[xy for xy, _ in kept],
        pairs=pairs,
        indices=[
            number[index + starts[pair]] - counts[pair]
            for pair, index in zip(pairs, indices, strict=True)
        ],
        draws=[draws for _, draws in kept],
    )


def twins(keypoints, start):
    """Pairs [k, 2] of keypoints at one place in a view, counted from `start`."""
    if not len(keypoints):
        return np.zeros((0, 2), int)
    places = np.round(keypoints, 1)
    _, first, group = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return start + np.stack([np.arange(len(keypoints)), first[group.ravel()]], axis=1)


def write(path, matches: Matches):
    """Write matches.npz."""
    np.savez(
        path,
        names=np.array(matches.names),
        size=np.array([matches.width, matches.height]),
        counts=np.array([len(xy) for xy in matches.keypoints]),
        keypoints=np.concatenate(matches.keypoints).astype(np.float32),
        draws=np.concatenate(matches.draws),
        pairs=matches.pairs,
        pair_counts=np.array([len(index) for index in matches.indices], int),
        indices=np.concatenate([np.zeros((0, 2), int), *matches.indices]).astype(
            np.int32
        ),
    )


KEYS = ("names", "size", "counts", "keypoints", "draws", "pairs", "pair_counts")
KEYS += ("indices",)


def load(path) -> Matches:
    """The Matches of a matches.npz."""
    arrays = archives.read(path, KEYS)
    ends = np.cumsum(arrays["counts"])[:-1]
    pair_ends = np.cumsum(arrays["pair_counts"])[:-1]
    indices = np.split(arrays["indices"].astype(int), pair_ends)
    return Matches(
        names=arrays["names"].tolist(),
        width=int(arrays["size"][0]),
        height=int(arrays["size"][1]),
        keypoints=np.split(arrays["keypoints"].astype(float), ends),
        pairs=arrays["pairs"],
        indices=indices[: len(arrays["pairs"])],
        draws=np.split(arrays["draws"], ends),
    )
