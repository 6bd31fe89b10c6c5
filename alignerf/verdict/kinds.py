"""What a verdict.json holds, for those that read one (`io.json_files.read`)."""

from alignerf.io import json_files

STATES = ("aligned", "misaligned", "unclear")
# How sure it is that a cause applies.
LEVELS = ("faulty", "likely", "ok", "cannot tell")
NUMBER, NUMBER_OR_NONE = json_files.NUMBER, json_files.NUMBER_OR_NONE
OrNone = json_files.OrNone
TEXTS = ("cause", "name", "unit", "measured", "allowed", "note", "page", "text")
CAUSE = dict.fromkeys(TEXTS, str) | dict.fromkeys(("value", "limit"), NUMBER_OR_NONE)
CAUSE |= {"more_is_better": bool, "level": json_files.one_of(*LEVELS)}
FIX = dict.fromkeys(("name", "method", "test_set", "matches", "text"), str)
FIX |= dict.fromkeys(("low", "high"), NUMBER_OR_NONE) | {"db": NUMBER}
FIX |= {"seconds": NUMBER, "pays": bool, "notes": [str], "in_headline": bool}
EVIDENCE = {
    "pairs": {"stops": bool},
    "overfit_px": OrNone(NUMBER),
    "train_views": OrNone(NUMBER),
    "judged": OrNone({"cameras": str}),
    "matches": OrNone({"accepted": bool}),
}
VERDICT = {key: [str] for key in ("verdict", "because", "measured")} | {
    "state": json_files.one_of(*STATES),
    "headline": str,
    "do_first": {"text": str, "command": (str, type(None))},
    "causes": [CAUSE],
    "tried": [FIX],
    "findings": OrNone([{"cause": str, "photos": OrNone([str])}]),
    "evidence": EVIDENCE,
}
