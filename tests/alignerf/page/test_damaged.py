"""Whatever a scene's results hold, there is a page, or a line that names the file."""

import json
import random

import pandas as pd
import pytest
import yaml

from alignerf.page import __main__ as page
from tests.alignerf.page import conftest as cases
from tests.damaged_cases import GONE, VALUES, changed, places

CELLS = ["", "x", "nan", "inf", "-1", "1e300", "1e999", "9" * 400, "True", "2.5", GONE]
JSONS = ["poses.json", "judged.json", "preflight.json", "verdict.json"]
JSONS += ["decisions.json", "config.yaml"]
# Of each file; the torture tries all.
CASES = 40


@pytest.fixture
def quickly(results, render, causes, monkeypatch):
    """The page without its pictures, of results with all that it may read."""
    kept = page.template()
    monkeypatch.setattr(page, "template", lambda: kept)
    monkeypatch.setattr(page.gallery, "captions", lambda *_: {})
    monkeypatch.setattr(page.gallery, "arrows", lambda *_: {})
    for name in ("fitted", "thumbs"):
        monkeypatch.setattr(
            page.pictures, name, lambda shown: dict.fromkeys((o.key for o in shown), "")
        )
    monkeypatch.setattr(page.pictures, "data_uri", lambda *_: "")
    cases.write_json(results / "preflight.json", {"said": "about 9 min"})
    poses = json.loads((results / "poses.json").read_text())
    more = {
        "quarter_turns": {"01": 1},
        "of_poses": "poses by x",
        "external_renders": None,
    }
    cases.write_json(results / "poses.json", poses | more)
    return render


def damaged_jsons(folder, name):
    """(path, text) of each damage of one file."""
    path = folder / ("poses.json" if name == "judged.json" else name)
    content = yaml.safe_load(path.read_text())
    if name == "judged.json":
        content |= {"external_renders": {"way": "taken", "layout": "y", "cameras": "z"}}
    write = yaml.safe_dump if path.suffix == ".yaml" else json.dumps
    for at in places(content):
        for value in VALUES:
            if at or value is not GONE:
                yield path, write(changed(content, at, value)), f"{at} {value!r:.20}"


def damaged_tables(folder, name):
    path = folder / "tables" / name
    table = pd.read_csv(path, dtype=str, keep_default_na=False)
    for column in table:
        for cell in CELLS:
            if cell is GONE:
                other = table.drop(columns=column)
            else:
                other = table.copy()
                other.loc[0, column] = cell
            yield path, other.to_csv(index=False), f"{column} {cell!r:.20}"


def attack(render, damages):
    """What is wrong with how the page takes damages."""
    found = []
    for path, text, what in damages:
        whole = path.read_text()
        path.write_text(text)
        try:
            render()
        except (ValueError, OSError) as error:
            # A view of another name has no picture.
            if not any(n in str(error) for n in (path.name, "images/", "renders/")):
                found.append(f"{path.name} {what}: {error}")
        except Exception as error:
            found.append(f"{path.name} {what}: {error!r:.200}")
        path.write_text(whole)
    return found


@pytest.mark.parametrize("name", JSONS)
def test_a_damaged_json_is_named_or_shown(results, quickly, name):
    damages = list(damaged_jsons(results, name))
    chosen = random.Random(0).sample(damages, min(CASES, len(damages)))
    assert attack(quickly, chosen) == []


@pytest.mark.parametrize("name", ["views.csv", "misalignment.csv"])
def test_a_damaged_table_is_named_or_shown(results, quickly, name):
    damages = list(damaged_tables(results, name))
    chosen = random.Random(0).sample(damages, min(CASES, len(damages)))
    assert attack(quickly, chosen) == []


@pytest.mark.parametrize("count", [10**12, -1, 1.5, "1", True, None, 4])
def test_quarter_turns_are_0_to_3(results, quickly, count):
    """10**12 of them would never end."""
    (path,) = results.glob("poses.json")
    content = json.loads(path.read_text())
    cases.write_json(path, content | {"quarter_turns": {"01": count}})
    with pytest.raises(ValueError, match=r"poses\.json: .*quarter_turns\.01 is"):
        quickly()
