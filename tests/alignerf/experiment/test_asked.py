"""What words of a command line ask for, and the table that a run ends with."""

import pytest

from alignerf.experiment import asked, plan, targets

TABLE1 = [
    *("off", "off_x4", "off_seed2", "off_seed2_x4"),
    *("turned", "turned_x4", "turned_seed2", "turned_seed2_x4"),
]


@pytest.fixture
def by_name(demo, experiment_of):
    """A config that runs, and beside it shipped ones of other scenes."""
    courtyard = demo["scenes"]["courtyard"]
    crop = {"crop": {"of": "whole", "count": 1}}
    arm = {"courtyard": {"place": "object"}}

    def of(*names, **more):
        scenes = {name: courtyard | more.get(name, {}) for name in names}
        keys = {k: v for k, v in more.items() if k not in names}
        return experiment_of(demo | {"scenes": scenes} | keys)

    vary = {"seeds": [0, 2], "lengths": [1, 4]}
    return {
        "": experiment_of(demo),
        "table1": of("off", "turned", vary=vary),
        "table2": of("whole", "crop", crop=crop),
        "figures": of("arm", arm=arm),
    }


@pytest.fixture
def of_words(by_name):
    def make(*words):
        return asked.Asked.of(plan.Experiments(by_name), list(words))

    return make


def test_a_scene_narrows_its_table_with_all_seeds_and_lengths(of_words):
    found = of_words("table1", "turned")
    assert found.narrowed == {"table1": TABLE1[4:]}
    assert found.scenes == TABLE1[4:]
    # It is no page that is asked for.
    assert found.of_scene("turned") == []
    assert of_words("table1", "turned_seed2_x4").scenes == ["turned_seed2_x4"]
    # Of a table without one all are made.
    found = of_words("table1", "table2", "crop")
    assert found.narrowed == {"table2": ["crop"]}
    assert {*found.scenes} == {*TABLE1, "whole", "crop"}


def test_a_scene_narrows_a_table_of_its_crops(of_words):
    assert "crop" in of_words("table2", "whole").narrowed["table2"]


def test_a_shipped_target_beside_a_users_config_is_told(by_name):
    alone = plan.Experiments({"": by_name[""]})
    for word in ("table2", "figures", "paper"):
        with pytest.raises(ValueError, match=f"{word}: is of the shipped configs"):
            asked.Asked.of(alone, [word]).check(["table1", "figures", "paper"])
    asked.Asked.of(alone, ["table1"]).check(["table1"])


def test_the_figures_are_of_the_scene_of_table_1_that_is_asked_for(of_words):
    for words, drawn in (((), "off"), (("turned_x4",), "turned_x4")):
        found = of_words("figures", *words)
        first, *_ = targets.of_figures(found.experiments, found.narrowed)
        assert first == f"results/{drawn}/figures/flow.png"
        assert {*found.scenes} == {"arm", drawn}


@pytest.mark.parametrize(
    ("words", "scenes"),
    [
        ([], ["courtyard"]),
        (["all"], ["courtyard"]),
        (["off"], ["off"]),
        # By its crops a scene is judged.
        (["whole"], ["whole", "crop"]),
        (["crop"], ["whole", "crop"]),
        (["results/off_x4/poses.json"], ["off_x4"]),
        (["table2", "comparison"], ["whole", "crop", "courtyard"]),
        (["paper"], [*TABLE1, "whole", "crop", "arm"]),
    ],
    ids=str,
)
def test_a_run_writes_the_folders_of_what_is_asked_for(of_words, words, scenes):
    assert {*of_words(*words).scenes} == {*scenes}


def test_a_job_may_write_any_folder(by_name):
    """It is told what to make, and knows no words; at the paper's size either."""
    del by_name[""]
    found = asked.Asked.of(plan.Experiments(by_name), None)
    assert found.scenes == [*TABLE1, "whole", "crop", "arm"]


def test_a_scene_that_no_asked_table_has_is_named(of_words):
    of_words("off")
    with pytest.raises(ValueError, match=r"^crop: no scene of table1; theirs: off, "):
        of_words("table1", "crop")
    with pytest.raises(ValueError, match=r"^courtyard: no scene of table1, table2; "):
        of_words("table1", "table2", "courtyard")


def test_the_papers_size_needs_a_table_that_has_one(by_name, of_words):
    del by_name[""]
    assert of_words("table1").tables == ["table1"]
    with pytest.raises(ValueError, match="which the demo has not: name a table"):
        targets.of_run(of_words().experiments)
    with pytest.raises(ValueError, match="only scenes of a config are exported"):
        targets.of_exports(of_words("export").experiments)
    with pytest.raises(ValueError, match="small: false: tradeoff has no full size"):
        of_words("tradeoff")


def test_a_word_that_means_nothing_is_named_with_the_nearest(of_words, tmp_path):
    rules = ["table1", "comparison"]
    of_words("off", "table1", "results/x/y.png", str(tmp_path)).check(rules)
    for word, hint in (("comparisn", "; perhaps 'comparison'"), ("zzz", "")):
        reason = f"^{word}: no such scene or target{hint}. Scenes of this config: court"
        with pytest.raises(ValueError, match=reason):
            of_words(word).check(rules)


HEAD = "group,scene,method,warping,test_set,psnr_db,ssim,lpips_vgg,total_time_s,params,"
TABLE = """published,source
1x,all,large,none,standard,21.234,0.5601,0.3,600,1234567,mip-NeRF,
1x,all,large,none,warped,22.5,0.61,0.2,600,1234567,mip-NeRF,
1x,all,"mip-NeRF, published",none,standard,20,0.5,,3600,,mip-NeRF,arXiv
1x,all,"mip-NeRF, published",none,warped,21.5,0.5,,3600,,mip-NeRF,arXiv
1x,all,large,once,standard,21,0.5,,90,,mip-NeRF,
1x,yard,large,none,standard,1,0.1,0.1,60,1,mip-NeRF,
"""
SHOWN = """
{}: standard / warped test set
                     PSNR         SSIM        LPIPS   min     params  paper's PSNR
large         21.23/22.50  0.560/0.610  0.300/0.200  10.0  1,234,567   20.00/21.50
large, warped once  21.00  0.500                      1.5
"""
ENDS = "SSIM", "0.610"
LONGER = "4x,all,large,none,standard,25,0.7,,6000,7,mip-NeRF,\n"


def shown(folder, text):
    path = folder / "table1.csv"
    path.write_text(HEAD + text)
    return asked.of_table(path), path


def test_a_table_on_a_terminal_has_the_papers_numbers_beside_ours(tmp_path):
    lines, path = shown(tmp_path, TABLE)
    expected = SHOWN.format(path).splitlines()
    assert [line.split() for line in lines] == [line.split() for line in expected]
    # Columns end below each other.
    ends = [
        line.index(text) + len(text)
        for line, text in zip(lines[2:4], ENDS, strict=True)
    ]
    assert ends[0] == ends[1]
    # Rows of several lengths begin with theirs; what is printed for one is its own.
    lines, _ = shown(tmp_path, TABLE + LONGER)
    assert [line.split()[0] for line in lines[3:]] == ["1x", "1x", "4x"]
    assert lines[-1].split()[1:] == ["large", "25.00", "0.700", "100.0", "7"]


def test_without_a_table_nothing_is_said_of_it(of_words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert asked.of_table("results/table1.csv") == []
    assert shown(tmp_path, "published,source\n")[0] == []
    assert of_words("table1").last_words("make export") == []
    assert of_words().last_words("make export") == []
    # A table of other columns.
    path = tmp_path / "arm.csv"
    path.write_text("method,still_db\nnerf,20\n")
    assert asked.of_table(path) == []
