"""Plans of exports: what they need, and what a width makes anew."""

import re

import yaml

METHODS = {
    "plain": {"model": "base"},
    "warped": {"model": "base", "rounds": 1},
    "aligned": {"model": "base", "align": {}},
}


def plan(tmp_path, dry_run, config, *more):
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    # A target before --configfile, as the last lines of a run print it.
    words = ("-n", "-p", "export", "--configfile", path, *more)
    code, output = dry_run(tmp_path, *words)
    assert code == 0, output
    return {
        where: words
        for words, where in re.findall(
            r"python -m alignerf\.export (.*) --out \S+?/\S+?/(\w+/export/\w+) ", output
        )
    }


def test_exports_read_photos_once_more_and_fit_held_out_cameras(
    tmp_path, demo, dry_run
):
    demo["methods"] = METHODS
    found = plan(tmp_path, dry_run, demo)
    assert set(found) == {
        f"{method}/export/{what}"
        for method in ("warped", "aligned")
        for what in ("cameras", "photos")
    }
    for where, words in found.items():
        assert '"source": "courtyard"' in words
        assert "--width" not in words
        # Cameras that have not moved need no fit.
        assert ("--fit-held-out" in words) == where.startswith("aligned")
        assert ("--if-pays" in words) == where.startswith("aligned")
        assert ("--warped" in words) == where.endswith("photos")
    here = "results/courtyard/aligned/round0"
    assert f"--fit-held-out {here}/flow/test {here}/depth/test" in " ".join(
        found.values()
    )


def test_a_width_is_a_key_and_an_option(tmp_path, demo, dry_run):
    demo["methods"] = METHODS
    by_option = plan(tmp_path, dry_run, demo, "--config", "export_width_px=160")
    by_key = plan(tmp_path, dry_run, demo | {"export_width_px": 160})
    assert by_option == by_key
    assert all("--width 160" in words for words in by_key.values())


def test_without_the_fair_test_set_nothing_is_fitted(tmp_path, demo, dry_run):
    demo |= {"methods": METHODS, "aligned_pose": False}
    found = plan(tmp_path, dry_run, demo)
    assert found
    assert not any("--fit-held-out" in words for words in found)
