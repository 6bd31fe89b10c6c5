"""The page as a whole: what stands on it, and what hostile or missing files do."""

import html
import html.parser
import json
import urllib.parse

import numpy as np
import pandas as pd
import pytest

import alignerf
from alignerf.cameras import transients
from alignerf.io import images, provenance
from alignerf.page import __main__ as page
from alignerf.page import gallery, pictures
from tests.alignerf.page.conftest import HEIGHT, WIDTH

EXPORT = provenance.export_command()


class Parser(html.parser.HTMLParser):
    """Tags, links and sources of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.sources = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append((tag, attributes))
        if tag == "a":
            self.links.append(attributes["href"])
        if "src" in attributes:
            self.sources.append(attributes["src"])


def data_of(text):
    """What the page's scripts read."""
    return json.loads(text.split('id="data">')[1].split("</script>")[0])


def test_a_page_is_one_file_whose_links_lead_somewhere(render, results, crops):
    text = render(crops=crops, moved=("aligned", results / "moved.npz"))
    found = Parser(text)
    ids = {attributes["id"] for _, attributes in found.tags if "id" in attributes}
    photos = {one["key"] for one in data_of(text)["photos"]}
    for link in found.links:
        if link.startswith("#view="):
            assert urllib.parse.unquote(link.removeprefix("#view=")) in photos
        elif link.startswith("#"):
            assert link[1:] in ids
        else:
            assert (results / urllib.parse.unquote(link)).is_file(), link
    assert found.links
    # Nothing is fetched.
    assert all(source.startswith("data:") for source in found.sources)
    assert not [
        attrs
        for tag, attrs in found.tags
        if tag == "link" and attrs["href"] != "data:,"
    ]


def test_the_verdict_stands_first_then_what_to_do_then_the_pictures(render):
    text = render()
    head, look = text.index("<h1>Aligned.</h1>"), text.index('id="look"')
    assert head < text.index("<li>Nothing.") < look
    assert alignerf.__version__ in text[text.index("<footer>") :]


@pytest.mark.parametrize(
    ("export", "command", "source", "said"),
    [
        ("make export SCENE=x", "", "courtyard", "<code>make run</code>"),
        (
            "snakemake export --cores 2",
            "",
            "photos",
            "<code>snakemake --cores 2</code>",
        ),
        (
            "make export SCENE=x",
            "make judge PHOTOS='a b' SPLAT=x.ply",
            "external_renders",
            "command <code>make judge PHOTOS=&#39;a b&#39; SPLAT=x.ply</code>",
        ),
    ],
)
def test_the_foot_says_what_made_the_page(
    render, results, monkeypatch, export, command, source, said
):
    monkeypatch.setenv(provenance.EXPORT, export)
    monkeypatch.setenv(provenance.COMMAND, command)
    path = results / "poses.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"source": source}))
    text = render()
    assert said in text[text.index("<footer>") : text.index("</footer>")]


def test_a_new_verdict_has_a_command_what_was_tried_and_gauges(render, causes):
    text = render()
    assert "<h1>Misaligned by 2.3 px: poses are off.</h1>" in text
    assert 'data-copy="make photos &lt;x&gt;"' in text
    assert '<tr class="ok">' in text
    assert '<tr class="faulty">' in text
    for shown in (
        "<b>+1.2</b>",
        "2.66 → 0.50 px",
        "<small>no &lt;gain&gt;</small>",
    ):
        assert shown in text
    for level in ("faulty", "ok", "cannot-tell"):
        assert f'<li class="{level}">' in text
    assert "2.2 px <small>fine: up to 0.4</small>" in text
    # One box with the export's command, where that is not what is to be done.
    assert text.count(f'data-copy="{html.escape(EXPORT)}"') == 1


def test_names_and_reasons_are_text_and_never_markup(render):
    text = render()
    assert "<script>alert(1)</script>" not in text
    assert "A &lt; B &amp; C." in text
    found = Parser(text).tags
    # Data, three components, and the page's own script; names add none.
    assert [tag for tag, _ in found].count("script") == 5
    assert "test/&lt;b&gt;&amp;&#39;02" in text


def test_every_photo_is_there_the_worst_first(render):
    text = render()
    order = ["train/05", "test/03", "test/01", "test/<b>&'02", "train/04"]
    data = data_of(text)
    assert [one["key"] for one in data["photos"]] == order
    assert list(data["images"]) == order
    assert [a["value"] for tag, a in Parser(text).tags if tag == "option"] == order
    test, train = data["images"]["test/03"], data["images"]["train/05"]
    assert set(test) == {
        *("photo", "render", "flow", "warped photo"),
        *("render after round 1", "flow after round 1"),
    }
    assert set(train) == {"photo", "render", "flow", "warped photo"}
    assert len(set(test.values())) == len(test)


def test_what_comes_and_goes_is_outlined_and_its_photos_are_named(render, results):
    shown = np.zeros((12, 18), bool)
    shown[4:8, 6:12] = True
    transients.write(results / "transients.npz", {"05": shown})
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told["findings"] = [{"cause": "transients", "photos": ["05", "<b>&'02"]}]
    told["findings"] += [{"cause": "exposure", "photos": []}]
    path.write_text(json.dumps(told))
    text = render()
    data = data_of(text)
    own = {key: one.get(gallery.TRANSIENT) for key, one in data["images"].items()}
    assert [key for key, uri in own.items() if uri] == ["train/05"]
    assert own["train/05"].startswith("data:image")
    assert "05, &lt;b&gt;&amp;&#39;02" in text
    assert "exposure" not in text.partition('id="photos"')[0].partition("Why")[2]


def test_a_line_is_around_what_comes_and_goes_whichever_way_up():
    photo, shown = np.zeros((30, 40, 3), np.uint8), np.zeros((15, 20), bool)
    shown[5:9, 5:12] = True
    for turns in range(4):
        lined = gallery.outlined(np.rot90(photo, -turns), np.rot90(shown, -turns))
        lined = np.rot90(lined, turns).any(axis=-1)
        assert lined[8:20, 8:26].sum() == lined.sum() > 0
        assert not lined[10:17, 10:23].any()


def test_it_opens_with_the_photo_that_a_fix_sharpens_most(render):
    opening = data_of(render())["opening"]
    shown = {"key": "test/03", "left": "render", "right": "render after round 1"}
    assert opening == opening | shown


def test_it_opens_with_the_part_in_which_a_difference_is_seen(render, results, rng):
    """Where one part of one photo was soft; parts lie within the photo."""
    for name in ("01", "03"):
        for k in (0, 1):
            path = results / f"base/round{k}/renders/test/{name}.png"
            noise = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
            if (name, k) == ("01", 1):
                noise[16:, 24:] = rng.integers(0, 256, (8, 12, 3))
            images.write(path, noise)
    opening = data_of(render())["opening"]
    assert opening["key"] == "test/01"
    ends = [opening[axis] + 1 / opening["scale"] for axis in "xy"]
    assert min(opening["x"], opening["y"]) > 0.5
    assert max(ends) <= 1.05


def test_it_opens_with_a_photo_that_fits_into_the_page(render, monkeypatch):
    fitted = pictures.fitted
    monkeypatch.setattr(
        pictures, "fitted", lambda every: {"test/01": fitted(every)["test/01"]}
    )
    assert data_of(render())["opening"]["key"] == "test/01"


@pytest.mark.parametrize(
    ("in_headline", "named", "turned"),
    [
        (False, "base, warped once", False),
        (True, "base, warped once", True),
        (True, "large model, warped once", False),
    ],
)
def test_of_rounds_that_gained_most_the_last_is_the_after(
    render, results, causes, in_headline, named, turned
):
    """Unless the headline tells another fix, which of two models may be the other's."""
    folders = [results / f"base/round1/{kind}/test" for kind in ("renders", "flow")]
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told["tried"][0]["in_headline"] = in_headline
    told["tried"][1] |= {"method": "base", "name": named, "db": 2.0}
    path.write_text(json.dumps(told))
    data = data_of(render(others={"aligned": folders}))
    after = ["render after round 1", "render, aligned"]
    assert data["after"] == after[:: -1 if turned else 1]


def test_the_after_is_that_of_the_method_that_gained_most(render, results, causes):
    folders = [results / f"base/round1/{kind}/test" for kind in ("renders", "flow")]
    data = data_of(render(others={"worse": folders, "aligned": folders, "x": folders}))
    assert data["after"][0] == "render, aligned"
    assert data["opening"]["right"] == "render, aligned"


def test_lengths_beside_photos_are_in_pixels_of_the_photo(render):
    """The fixture's photos are twice as wide as what was trained at."""
    text = render()
    first, second = data_of(text)["photos"][:2]
    assert (first["px"], second["px"]) == (18.0, 6.0)
    assert "18.0 px" in text
    assert "6.0 px from the photo" in second["captions"]["render"]
    assert "held out" in second["captions"]["photo"]
    assert "by base, before any fix" in second["captions"]["render"]
    assert "by base after round 1" in second["captions"]["render after round 1"]


@pytest.mark.parametrize(("overfit_px", "limit"), [(None, "0.5"), (0.4885, "0.98")])
def test_the_legend_has_the_limit_of_the_verdict(render, results, overfit_px, limit):
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told["evidence"]["overfit_px"] = overfit_px
    path.write_text(json.dumps(told))
    text = " ".join(render().split())
    assert f"Pale: under {limit} px, too small to tell" in text


def test_beside_the_curves_it_says_why_the_flow_hardly_falls(render, results):
    (results / "figures").mkdir()
    image = np.zeros((4, 4, 3), np.uint8)
    images.write(results / "figures/curves.png", image)
    text = render()
    after = text[text.index('alt="Misalignment and quality') :]
    assert "hardly falls" in after


def test_the_laboratory_is_folded(render):
    text = render()
    details = text.index('<section id="details">')
    assert details < text.index("<table")
    assert text[details:].count("<details") >= text.count("<table")
    assert "<details open" not in text


def test_a_missing_image_stops_it_by_name_and_leaves_the_old_page(results):
    (results / "index.html").write_text("old")
    (results / "base/round0/renders/test/01.png").unlink()
    rounds = [{"renders": str(results / "base/round0/renders/test")}]
    rounds[0]["flow"] = str(results / "base/round0/flow/test")
    arguments = ["--scene", str(results), "--base", str(results / "base/round0")]
    arguments += ["--rounds", json.dumps(rounds)]
    with pytest.raises((ValueError, OSError), match=r"01\.png"):
        page.main([*arguments, "--out", str(results / "index.html")])
    assert (results / "index.html").read_text() == "old"
    assert not list(results.glob(".index*"))


def test_where_no_photo_stands_out_the_page_is_made_all_the_same(render, results):
    path = results / "tables/views.csv"
    table = pd.read_csv(path, dtype={"view": str}).assign(stands_out=np.nan)
    table.to_csv(path, index=False)
    assert {one["why"] for one in data_of(render())["photos"]} == {""}


def test_a_photo_without_a_flow_comes_first_and_has_no_length(render, results):
    path = results / "tables/views.csv"
    table = pd.read_csv(path, dtype={"view": str})
    table.loc[table["view"] == "01", "flow_px"] = np.nan
    table.to_csv(path, index=False)
    first = data_of(render())["photos"][0]
    assert (first["key"], first["px"], first["level"]) == ("test/01", None, "unknown")


def test_a_flow_without_an_end_is_refused(render, results):
    path = results / "tables/views.csv"
    table = pd.read_csv(path, dtype={"view": str})
    table.loc[0, "flow_px"] = np.inf
    table.to_csv(path, index=False)
    with pytest.raises(ValueError, match=r"views\.csv: .*column flow_px: not numbers"):
        render()


def test_a_photo_may_be_called_na(render, results):
    for folder in results.rglob("*/test"):
        for kept in folder.glob("01.*"):
            kept.rename(kept.with_stem("NA"))
    (results / "images/01.png").rename(results / "images/NA.png")
    for name in ("tables/views.csv", "cameras.npz"):
        path = results / name
        if path.suffix == ".csv":
            path.write_text(path.read_text().replace("01,", "NA,", 1))
        else:
            arrays = dict(np.load(path))
            arrays["names"][0] = "NA"
            np.savez(path, **arrays)
    assert "test/NA" in render()


def test_renders_that_are_judged_have_no_before_and_no_tables(results):
    """Only training views, only views.csv: photo beside render."""
    (results / "tables/misalignment.csv").unlink()
    (results / "decisions.json").unlink()
    path = results / "poses.json"
    judged = {"layout": "named alike", "way": "pinhole", "cameras": "transforms.json"}
    told = json.loads(path.read_text()) | {"external_renders": judged}
    path.write_text(json.dumps(told))
    table = pd.read_csv(results / "tables/views.csv", dtype={"view": str})
    table[table["split"] == "train"].to_csv(results / "tables/views.csv", index=False)
    text = page.render(results, rounds=[], base=results / "base/round0")
    data = data_of(text)
    opening = {"key": "train/05", "left": "photo", "right": "render"}
    assert data["opening"] == data["opening"] | opening
    assert data["after"] == []
    assert "Photo | Render" in text
    assert "Before | After" not in text
    assert "before any fix" not in json.dumps(data)
    assert EXPORT in text
    # Without cameras there is nothing to export.
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told["evidence"]["judged"] = {"cameras": "none"}
    path.write_text(json.dumps(told))
    text = page.render(results, rounds=[], base=results / "base/round0")
    assert EXPORT not in text
    assert "render by your model" in data_of(text)["photos"][0]["captions"]["render"]
    assert "undistorted to the largest image" in text


def test_all_parts_together_leave_the_page_under_15_mb():
    parts = (pictures.MAX_BYTES, pictures.MAX_THUMB_BYTES, gallery.CROPS_BYTES)
    as_text = 4 / 3 * sum(parts)
    # What is left is for tables, figures, arrows and scripts.
    assert as_text < 13.5e6
