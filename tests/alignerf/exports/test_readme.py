"""What README.txt says."""

import json
import shutil

import numpy as np

from alignerf.exports import readme, written
from tests import export_cases as cases


def test_the_readme_has_commands_files_and_what_is_held_out(made, views, tmp_path):
    out = cases.exported(made, tmp_path)
    text = (out / "README.txt").read_text()
    for command in (
        "ns-train splatfacto --data .",
        "ns-train nerfacto --data .",
        "python examples/simple_trainer.py default --data_dir",
        "--data_factor 1",
        "python train.py -s PATH_OF_THIS_FOLDER --eval",
        "colmap gui --import_path sparse/0 --image_path images",
        "colmap model_analyzer --path sparse/0",
    ):
        assert command in text
    test = [n for n, s in zip(views.names, views.split, strict=True) if s == "test"]
    assert f"Held out: {', '.join(test)}" in text
    # Every third of eight; the programs' own way is every eighth.
    assert "NOT those that are held out" in text
    listed = (out / "sparse/0/test.txt").read_text().splitlines()
    assert listed == [f"{name}.png" for name in test]
    assert max(map(len, text.splitlines())) <= 110
    for path in set(out.iterdir()) - {out / "README.txt"}:
        assert path.name in text


def test_the_readme_says_why_cameras_are_as_given(made, moved, tmp_path):
    verdict = tmp_path / "verdict.json"
    gains = [{"method": "aligned", "pays": False}]
    verdict.write_text(json.dumps({"verdict": ["Aligned."], "gains": gains}))
    more = ("--cameras", moved, "--if-pays", verdict, "aligned")
    out = cases.exported(made, tmp_path, *more)
    text = (out / "README.txt").read_text()
    assert "as given, not corrected: aligned did not show in this run" in text
    assert "So are those of held-out photos." in text


def test_the_readme_claims_no_camera_that_was_not_moved(made, tmp_path):
    """Cameras that went through a training come back with other last digits."""
    arrays = dict(np.load(made / "cameras.npz"))
    arrays["camtoworlds"] = arrays["camtoworlds"] * (1 + 1e-9)
    np.savez(tmp_path / "same.npz", **arrays)
    out = cases.exported(made, tmp_path, "--cameras", tmp_path / "same.npz")
    text = " ".join((out / "README.txt").read_text().split())
    assert "as given: this run looked at them, and moved none." in text
    assert "corrected by this run" not in text


def test_the_readme_knows_what_other_programs_take(views):
    """Their order is that of the files, and a principal point may be off the middle."""
    names = ["a", "a-1", *"bcdefgh"]
    assert "those that are\nheld out" in readme.of_their_split(names, ["a-1", "h"])
    assert "NOT" in readme.of_their_split(names, ["a", "h"])
    arrays = written.arrays_of(views)
    assert readme.of_middle(arrays) == ""
    arrays["pixtocams"] = arrays["pixtocams"].copy()
    lens = np.linalg.inv(arrays["pixtocams"][0])
    lens[0, 2] += 7.2
    arrays["pixtocams"][0] = np.linalg.inv(lens)
    assert "up to\n7.2 px" in readme.of_middle(arrays)


def test_the_readme_names_the_photos_that_are_not_there(made, tmp_path):
    scene = tmp_path / "scene"
    shutil.copytree(made, scene)
    poses = json.loads((scene / "poses.json").read_text()) | {"left_out": ["b", "a"]}
    (scene / "poses.json").write_text(json.dumps(poses))
    text = (cases.exported(scene, tmp_path) / "README.txt").read_text()
    assert "\nLeft out of the capture's photos (2): a, b.\n" in text
    many = readme.of_left_out([f"{number:03d}" for number in range(60)])
    assert many.split()[-3:] == ["and", "10", "more."]
    assert readme.of_left_out([]) == ""
