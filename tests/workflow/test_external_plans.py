"""Plans with another program's trainings beside ours."""

import re

CONFIG = """
scenes:
  tiny: { source: courtyard, poses: truth, courtyard: { views: 12 } }
methods:
  ours: { rounds: 1 }
  theirs:
    rounds: 2
    changes: cameras
    external: { train: 'x {data}', render: 'x {renders}', gpu: 3, mem_mb: 1234 }
  finished: { external: { renders: "of {scene}" } }
"""


def test_each_is_trained_by_its_own_program(tmp_path, dry_run):
    (tmp_path / "of tiny").mkdir()
    (tmp_path / "c.yaml").write_text(CONFIG)
    words = ("--configfile", tmp_path / "c.yaml", "--cores", "4", "-n", "-p")
    code, output = dry_run(tmp_path, *words, "--resources", "gpu=4", "--", "tiny")
    assert code == 0, output
    stats = output.split("Job stats:")[1].split("\n\n")[0]
    counts = dict(re.findall(r"^(\w+) +(\d+)$", stats, re.MULTILINE))
    assert counts["train"] == counts["render"] == "6"
    # Ours are scored by moved cameras, too.
    assert counts["evaluate"] == str(2 * 2 + 4)
    for job in re.findall(r"^rule (?:train|render):\n(?:    .*\n)+", output, re.M):
        theirs = "training=theirs/" in job
        assert ("mem_mb=1234" in job, "gpu=3" in job) == (theirs, theirs)
    # Renders that our model makes by moved cameras.
    assert counts["align_test_poses"] == "2"
    for module, count in (("external.train", 4), ("external.render", 4), ("train", 2)):
        assert len(re.findall(rf"python -m alignerf\.{module} ", output)) == count
