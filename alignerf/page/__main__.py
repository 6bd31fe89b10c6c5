"""The page of a scene: `python -m alignerf.page`, results/SCENE/index.html.

Verdict, images before and after, every photo, cameras, tables and costs in one file
that needs no network.
"""

import base64
import os
from pathlib import Path
from urllib.parse import quote

import jinja2

from alignerf.experiment.tables import rows
from alignerf.io import atomic, faults, provenance
from alignerf.page import contents, gallery, matched, pictures, rig, told

HERE = Path(__file__).resolve().parent
# Where a page may lead to: beside the sources, not of another package.
DOCS = provenance.ROOT / "docs" if provenance.PIPELINE == provenance.ROOT else None


OPTIONS = {
    "scene": ("results/SCENE", Path),
    "rounds": "JSON: renders, flow folders",
    "base": ("reference's round 0", Path),
    "[crops]": "a training's folder, of crops",
    "[crops-corrected]": "the same by cameras corrected",
    "[crops-by]": "the method that has put them right",
    "[moved]": "cameras.npz, corrected",
    "[moved-by]": "what has put them right",
    "out": "index.html, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    renders = rows.read(rows.Renders, args.rounds)
    page = render(
        args.scene,
        rounds=[(r.renders, r.flow) for r in renders if r.method is None],
        others={r.method: (r.renders, r.flow) for r in renders if r.method is not None},
        base=args.base,
        crops=(args.crops, args.crops_corrected, args.crops_by),
        moved=(args.moved_by, args.moved),
    )
    with atomic.replace_file(args.out) as path:
        path.write_text(page, encoding="utf-8")
    print(f"page     {args.out} ({len(page) / 1e6:.1f} MB)")


NOTHING = (None, None, None)


def render(folder, *, rounds, base, others=None, crops=NOTHING, moved=NOTHING[:2]):
    """The page's HTML of a scene's folder of results.

    rounds: (renders, flow), folders of the reference's test views round by round;
    others: {method: its (renders, flow)}; base: folder of the reference's round 0, with
    renders of training views too, if there are any. crops: of
    `gallery.crops`. moved: who put cameras right, and their cameras.npz.
    """
    folder, base = Path(folder), Path(base)
    scene, verdict = faults.resolved(folder).name, told.read(folder)
    facts, export = contents.facts(folder), provenance.export_command()
    # Corrected cameras lie in the export of what moved them.
    by = base.parent.name if moved[0] == "flow" else moved[0]
    place = f"results/{scene}/{by}/export/cameras" if moved[1] else None
    seen = verdict["evidence"]
    judged = seen.get("judged")
    alone = judged and (judged["cameras"] == "none" or not seen.get("train_views"))
    if seen["pairs"]["stops"] or alone:
        # What is taken from pairs that are none helps nobody.
        export = None
    limit_px = pictures.limit_of(seen)
    decisions, taken = contents.decisions(folder)
    return template().render(
        scene=scene,
        verdict=verdict,
        facts=facts,
        summary=told.summary(scene, verdict, facts, export),
        wheel=pictures.data_uri(gallery.wheel(limit_px)),
        tables=contents.tables(folder, gallery.scale(folder)),
        origin=contents.origin(folder),
        docs=DOCS and quote(os.path.relpath(DOCS, folder)),
        figures=figures(folder),
        decisions=decisions,
        decisions_taken=taken,
        costs=contents.costs(folder),
        downloads=contents.downloads(folder),
        export_command=export,
        trainers=told.trainers(place) if export and place else {},
        **shown(folder, rounds, others or {}, base, limit_px, verdict, crops, moved),
    )


def shown(folder, rounds, others, base, limit_px, verdict, crops, moved):
    """What the page shows of the photos, and what its scripts read."""
    photo_px, turns = gallery.scale(folder), contents.quarter_turns(folder)
    tried = verdict["tried"]
    names, reference = told.names(tried), base.parent.name
    own = names.get(reference, reference).partition(", ")[0]
    # Of two baselines the names say which.
    of_one = not own.endswith(" model")
    others = {names.get(method, method): one for method, one in others.items()}
    crops = (*crops[:2], names.get(crops[2], crops[2]))
    tried = [one | {"method": names.get(one["method"], one["method"])} for one in tried]
    judged = verdict["evidence"].get("judged")
    whose = reference if of_one else f"the {own}"
    whose = "your model" if judged else whose
    every = gallery.shown(folder, rounds, others, base, limit_px, whose)
    entries = gallery.entries(every, limit_px, photo_px)
    rounds_of = names.get(reference, reference)
    after = gallery.afters(every, tried, rounds_of, of_one_model=of_one)
    images = pictures.fitted(every)
    there = [one for one in every if one.key in images]
    data = {
        "photos": entries,
        "images": images,
        "layers": list(dict.fromkeys(name for one in every for name in one.layers)),
        "after": after,
        "opening": gallery.opening(there, after) if there else None,
        "crops": gallery.crops(*crops, every),
        "rig": rig.told(folder, turns, moved[1]),
    }
    return {
        "photos": entries,
        "thumbs": pictures.thumbs(every),
        "strip": gallery.strip(entries, limit_px * photo_px),
        "limit_px": limit_px,
        "photo_px": photo_px,
        "some": gallery.SOME,
        "full_px": gallery.FULL_PX,
        "matched": matched.told(folder, turns, moved[1], images),
        "moved_by": names.get(moved[0], moved[0]),
        "size_of": "renders" if judged else "training size",
        "data": data,
    }


def figures(folder):
    """(title, note, data URI) of the figures that the page repeats."""
    uris = []
    for name, (title, note) in contents.FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        if path.is_file():
            text = base64.b64encode(faults.content(path)).decode()
            uris.append((title, note, f"data:image/png;base64,{text}"))
    return uris


def template():
    """The page's template; all that comes from data is escaped."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # As they are, the worst photo first; sorted by name they would not be.
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False, "allow_nan": False}
    return environment.get_template("template.html")


if __name__ == "__main__":
    faults.run(main)
