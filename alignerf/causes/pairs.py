"""Renders that are not those of their photos, and photos that lie there twice."""

from alignerf.causes import base
from alignerf.metrics import pairs


def share(e):
    """The share of pairs whose render is not one of the photo."""
    return len(e.pairs.faults) / max(e.pairs.count, 1)


PAIRS = base.Cause(
    name="pairs",
    order=(11, 1, 100),
    label="renders that match their photos",
    unit="wrong",
    value=lambda e: len(e.pairs.faults),
    limit=lambda e: 0,
    decide=lambda e: (share(e), True) if e.pairs.faults else None,
    looked_for=lambda e: e.pairs.count > 0,
    says=lambda e: f"{len(e.pairs.faults) or 'none'} wrong of {e.pairs.count}",
    called="some renders are left out",
    sentence=lambda e, probably: f"Left out: {pairs.sentence(e.pairs)}.",
    advice="",
)
COPIES = base.Cause(
    name="copies",
    order=(18, 8.2, 4.2),
    label="duplicate photos",
    unit="photos",
    value=lambda e: e.copies,
    limit=lambda e: 0,
    decide=lambda e: (e.copies, True) if e.copies else None,
    says=lambda e: f"{e.copies or 'none'} of {e.train_views + e.test_views}",
    called="photos are there twice",
    sentence="{e.copies} photos duplicate another one: a held-out photo that is also "
    "a training photo tests nothing.",
    advice="leave one of each two duplicates out.",
    advice_external="leave one of each two duplicates out, and train again.",
)
CAUSE = [PAIRS, COPIES]
