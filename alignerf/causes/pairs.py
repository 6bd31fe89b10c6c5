"""Renders that are not those of their photos, and photos that lie there twice."""

from alignerf.causes import base
from alignerf.metrics import pairs


def find_pairs(e):
    """Pairs whose render is not one of the photo, where any were looked at."""
    if not e.pairs.count:
        return None
    wrong = len(e.pairs.faults)
    found = {"said": pairs.sentence(e.pairs), "advice": pairs.advice(e.pairs)}
    return base.Finding(
        100 * wrong / e.pairs.count,
        0,
        True if wrong else None,
        measured=f"{wrong or 'none'} wrong of {e.pairs.count}",
        photos=tuple(e.pairs.faults),
        **(found if wrong else {}),
    )


def find_copies(e):
    """Photos that show the same as another one."""
    views = e.train_views + e.test_views
    measured = f"{e.copies or 'none'} of {views}"
    return base.Finding(e.copies, 0, True if e.copies else None, measured=measured)


PAIRS = base.Cause(
    name="pairs",
    label="renders that match their photos",
    unit="% wrong",
    find=find_pairs,
    called="some renders are left out",
    sentence="Left out: {said}.",
    advice="look at the renders that are left out, and judge again.",
)
COPIES = base.Cause(
    name="copies",
    label="duplicate photos",
    unit="photos",
    find=find_copies,
    called="photos are there twice",
    sentence="{value} photos duplicate another one{photos}: a held-out photo that is "
    "also a training photo tests nothing.",
    advice="leave one of each two duplicates out.",
    advice_external="leave one of each two duplicates out, and train again.",
)
CAUSE = [PAIRS, COPIES]
