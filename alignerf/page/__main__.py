"""The page of a scene: `python -m alignerf.page`, results/SCENE/index.html.

Verdict, images under a slider, every photo, tables, decisions and costs in one file
that needs no network.
"""

import argparse
import base64
from pathlib import Path

import jinja2
import numpy as np

from alignerf.experiment.tables import json_rows, rows
from alignerf.files import atomic, csv_files, faults, provenance
from alignerf.page import contents, decided, pictures
from alignerf.verdict import views

HERE = Path(__file__).resolve().parent


def main(argv=None):
    args = parse(argv)
    renders = json_rows.read(rows.Renders, args.rounds, least=0)
    page = render(
        args.scene,
        rounds=[(r.renders, r.flow) for r in renders if r.method is None],
        others={r.method: (r.renders, r.flow) for r in renders if r.method is not None},
        base=args.base,
    )
    with atomic.replace_file(args.out) as path:
        path.write_text(page, encoding="utf-8")
    print(f"page     {args.out} ({len(page) / 1e6:.1f} MB)")


def render(folder, *, rounds, base, others=None):
    """The page's HTML of a scene's folder of results.

    rounds: (renders, flow), folders of the reference's test views round by round;
    others: {method: its (renders, flow)}; base: folder of the reference's round 0, with
    renders of training views too, if there are any.
    """
    folder, base = Path(folder), Path(base)
    told = contents.verdict(folder)
    limit_px = pictures.limit_of(told["evidence"])
    shown = shown_views(folder, rounds, others or {}, base, limit_px)
    images = pictures.fitted(shown)
    decisions, taken = decided.decisions(folder)
    return template().render(
        scene=folder.resolve().name,
        verdict=told,
        facts=contents.facts(folder),
        views=[one for one in shown if f"{one.split}/{one.view}" in images],
        images=images,
        layers=pictures.layer_names(shown),
        wheel=pictures.data_uri(pictures.wheel(limit_px)),
        full_px=pictures.FULL_PX,
        limit_px=limit_px,
        size_of="renders" if told["evidence"].get("judged") else "training size",
        tables=contents.tables(folder),
        figures=figures(folder),
        decisions=decisions,
        decisions_taken=taken,
        costs=contents.costs(folder),
        downloads=contents.downloads(folder),
        export_command=provenance.export_command(),
    )


def shown_views(folder, rounds, others, base, limit_px):
    """`pictures.Shown` of each view on the page."""
    path = folder / "tables" / "views.csv"
    table = csv_files.read(path, columns=views.COLUMNS)
    # Empty where a view does not, which is read as a number where none does.
    reasons = [why if isinstance(why, str) else "" for why in table["stands_out"]]
    table["stands_out"] = np.array(reasons, object)
    scored = [
        views.View(**row) for row in table[list(views.COLUMNS)].to_dict("records")
    ]
    turns = contents.quarter_turns(folder)
    truth = folder / "truth" / "oracle"
    of_split = {}
    if rounds:
        of_split["test"] = pictures.Source(
            "test",
            rounds,
            base / "warped" / "test",
            truth if truth.is_dir() else None,
            others,
        )
    if (base / "renders" / "train").is_dir():
        first = [(base / "renders" / "train", base / "flow" / "train")]
        of_split["train"] = pictures.Source("train", first, base / "warped" / "train")
    chosen = pictures.choose(scored)
    for row in chosen:
        if row.split not in of_split:
            fault = f"view {row.view!r:.60}: no renders of split {row.split!r:.60}"
            raise ValueError(f"{path}: {fault}")
    return [
        pictures.Shown(
            row.view,
            row.split,
            note_on(row),
            pictures.layers_of(
                row.view,
                of_split[row.split],
                folder / "images",
                limit_px,
                turns.get(row.view, 0),
            ),
        )
        for row in chosen
    ]


def note_on(view):
    """A view's numbers in words."""
    learnt = "held out" if view.split == "test" else "learnt from"
    apart = f"{view.flow_px:.2f} px of the training size apart before any repair"
    parts = [f"{learnt}: {apart}, {view.psnr_db:.1f} dB"]
    return "; ".join([*parts, view.stands_out] if view.stands_out else parts)


def figures(folder):
    """(title, note, data URI) of the figures that the page repeats."""
    uris = []
    for name, (title, note) in contents.FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        if path.is_file():
            text = base64.b64encode(path.read_bytes()).decode()
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
    return environment.get_template("template.html")


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.page", description=__doc__)
    parser.add_argument("--scene", type=Path, required=True, help="results/SCENE")
    parser.add_argument("--rounds", required=True, help="JSON: renders, flow folders")
    parser.add_argument("--base", type=Path, required=True, help="reference's round 0")
    parser.add_argument("--out", type=Path, required=True, help="index.html, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
