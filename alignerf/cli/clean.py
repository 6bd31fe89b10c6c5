"""Delete the results of this program, and no other files: `make clean`.

What it does not know stays, and is said, as do configs (results/NAME.yaml) and results
at which a run is at work.
"""

import functools
import re
from pathlib import Path

from alignerf.cli import configs, workflow
from alignerf.experiment import layout, targets
from alignerf.experiment.checks import results
from alignerf.experiment.tables import shipped
from alignerf.io import faults, owned

# Tables across scenes, and jobs by their logs.
ACROSS = (*shipped.NAMES, "arm", "comparison", "flow_benchmark")
JOBS = (
    *("poses", "facts", "config", "preflight", "train", "render", "align", "overfit"),
    *("correct_poses", "align_test_poses", "control_sets", "draw", "verdict"),
    *("page", r"evaluate\w*", r"decompose(?:_photos)?_(?:train|test)"),
    *(r"(?:\w+/)?collect", r"(?:\w+/)?\w+_table", "export_(?:cameras|photos)"),
)
# Of a training, below results/NAME.
TRAINING = r"(?:(?:[^/]+/)+round\d+|pretrain/[^/]+)/"
ENDS = r"csv|tex|provenance\.json"


def main(argv=None):
    configs.parser("clean", __doc__).parse_args(argv)
    place = Path(layout.RESULTS)
    folders = [*place.glob("*/"), *Path(layout.SPLATS).glob("*/"), Path("site")]
    # What a link leads to is a user's.
    marked = [x for x in folders if owned.is_marked(x) and not x.is_symlink()]
    locks = [one.name[1:].removesuffix(".held") for one in place.glob(".*.held")]
    names, works = {*locks, *(one.name for one in marked)}, False
    for name in sorted(names):
        try:
            with results.held(name):
                for folder in (one for one in marked if one.name == name):
                    tell(folder, owned.remove(folder, is_ours))
        except (ValueError, OSError) as error:
            works = True
            print(f"left: {error}")
    results.remove_empty(Path(layout.SPLATS))
    # A table of ours has its provenance beside it.
    ends = ".provenance.json"
    tables = tuple(one.name.removesuffix(ends) for one in place.glob(f"*{ends}"))
    # These may be what that run writes.
    for path in () if works else [*place.glob("*")]:
        if path.is_symlink():
            continue
        if path.is_file() and is_shared(path.name) and path.name.startswith(tables):
            path.unlink()
        elif path.is_dir() and path.name in results.SHARED:
            inside = functools.partial(is_shared, at=f"{path.name}/")
            tell(path, owned.remove(path, inside))


def tell(folder, left):
    """Say what was not removed."""
    if left:
        print(f"left: {faults.some_names([f'{folder}/{name}' for name in left])}")


def is_ours(name):
    """Whether a file below results/NAME is written by a job, and listed by no mark."""
    return bool(OWN.fullmatch(name))


def is_shared(name, at=""):
    """The same of one below results/`at` that is of no name."""
    return bool(SHARED.fullmatch(at + name))


def below(kind):
    """Names of the files that a class of `layout` has one by one."""
    found = [one.path for one in vars(kind).values() if isinstance(one, layout.Below)]
    return [re.escape(path) for path in found if "." in Path(path).name]


def one_of(names, ends=""):
    return f"(?:{'|'.join(names)})" + (ends and rf"\.(?:{ends})")


OWN = re.compile(
    one_of(
        (
            *below(layout.Scene),
            r"made_by\.json",
            "tables/" + one_of((*targets.tables(known=True), "views"), ENDS),
            "figures/" + one_of(targets.FIGURES, "png"),
            rf"(?:{one_of(ACROSS)}/)?(?:scores|trainings)\.csv",
            TRAINING
            + one_of((*below(layout.Training), r"metrics(?:_aligned_pose)?\.csv")),
            TRAINING
            + r"(?:model\.begun|decomposition(?:_photos)?_(?:train|test)\.csv)",
            TRAINING + r"checkpoints/(?:lock|\w+\.json|\w+-\d+\.msgpack)",
            rf"(?:{TRAINING}|testset/)?logs/" + one_of(JOBS, "log|tsv"),
            r"[^/]+/logs/export_(?:cameras|photos)\.(?:log|tsv)",
        )
    )
)
SHARED = re.compile(
    one_of(
        (
            one_of(ACROSS) + rf"(?:_effects|_ranking)?\.(?:{ENDS}|png)",
            f"logs/{workflow.OURS.pattern}",
            "logs/" + one_of((*ACROSS, "preview"), "log|tsv"),
            r"logs/download_(?:\w+_weights|360_v2/\w+)\.log",
            r"\.jax_cache/[^/]+/(?:.+-(?:cache|atime)|kernels-[^/]+\.so)",
        )
    )
)


if __name__ == "__main__":
    faults.run(main)
