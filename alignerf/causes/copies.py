"""Photos lie there twice, so that held-out ones may have been learnt."""

from alignerf.causes import base

CAUSE = base.Cause(
    name="copies",
    order=(18, 8.2, 4.2),
    label="photos that lie there twice",
    unit="photos",
    value=lambda e: e.copies,
    limit=lambda e: 0,
    decide=lambda e: (e.copies, True) if e.copies else None,
    called="photos lie there twice",
    sentence="{e.copies} photos show what another one shows: a held-out photo that was "
    "also learnt from tests nothing.",
    advice="leave one of each two copies out.",
    advice_external="leave one of each two copies out, and train again.",
)
