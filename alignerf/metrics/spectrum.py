"""How much of a photo's detail its render has, octave by octave.

A training that was too short lacks fine octaves and coarse ones; renders of half the
photos' size have all but the last; a blur by wrong poses lies between.
"""

import numpy as np

# Octaves from the finest: 1/4 to 1/2 cycle a pixel is the first.
OCTAVES = 5


def octaves(photo, render):
    """[OCTAVES] amplitude of the render over the photo's, the finest octave first.

    photo, render [h, w, 3] uint8. NaN where a photo has nothing, or no such octave.
    """
    powers = [power(image.mean(axis=-1, dtype=np.float64)) for image in (photo, render)]
    y, x = map(np.fft.fftfreq, photo.shape[:2])
    frequency = np.hypot(y[:, None], x)
    found = np.full(OCTAVES, np.nan)
    for octave in range(OCTAVES):
        high = 0.5 / 2**octave
        chosen = (frequency > high / 2) & (frequency <= high)
        own, other = (one[chosen].sum() for one in powers)
        if own > 0:
            found[octave] = np.sqrt(other / own)
    return found


def power(grey):
    """[h, w] power of a picture whose borders are faded out: they are no detail."""
    fade = np.outer(*map(np.hanning, grey.shape))
    return np.abs(np.fft.fft2((grey - grey.mean()) * fade)) ** 2
