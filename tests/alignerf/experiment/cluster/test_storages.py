"""results/SCENE, where a storage of Snakemake's keeps its files elsewhere."""

import pytest

from alignerf.experiment.cluster import storages


@pytest.fixture
def places(tmp_path):
    return tmp_path / "copies" / "results", tmp_path / "results"


def link(scenes, copies, results):
    """With `copies` as the folder that Snakemake has for `results`."""
    storages.link(scenes, copies / "{scene}" / "config.yaml", results)


def test_scenes_lead_to_the_copies(places):
    copies, results = places
    for _ in range(2):
        link(["a", "b c"], copies, results)
        (results / "b c" / "facts.json").write_text("{}")
        assert (copies / "b c" / "facts.json").read_text() == "{}"
    # What is in another bucket is not its.
    with pytest.raises(ValueError, match="in another storage"):
        link(["a"], copies.parent / "other", results)


def test_without_a_storage_nothing_is_made(tmp_path):
    link(["a"], tmp_path / "results", tmp_path / "results")
    assert not list(tmp_path.iterdir())


def test_results_on_the_disk_are_left_alone(places):
    copies, results = places
    (results / "a").mkdir(parents=True)
    with pytest.raises(ValueError, match="lies on the disk"):
        link(["a"], copies, results)
    assert not (results / "a").is_symlink()


def test_a_link_that_a_storage_has_left_is_named(tmp_path):
    copies = tmp_path / ".snakemake/storage/s3/bucket/results"
    results = tmp_path / "results"
    link(["a"], copies, results)
    with pytest.raises(ValueError, match="leads into a storage"):
        link(["a"], results, results)
    # Its copies may have been cleaned away.
    (copies / "a").rmdir()
    link(["a"], copies, results)
    assert (results / "a").is_dir()
    (copies / "a").rmdir()
    with pytest.raises(ValueError, match="in another storage"):
        link(["a"], tmp_path / "other", results)
