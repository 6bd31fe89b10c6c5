"""Command lines of every stage, and of `make photos`, `judge` and `export`, spoilt.

The oracle: a spoilt command says in one line what is wrong with it (argparse's usage
counts), or makes the same files as before, or others than those, where it was told so.
It never ends in a traceback, and never changes a file that is none of its outputs.

Every path that a case may give lies inside the case's own folder: who writes there, and
replaces what was there, does no harm.
"""

import os
import re
import shutil
import sys
from typing import NamedTuple

from alignerf.io import owned
from tests import judged_cases
from tools.torture import running, stages

# In place of a value. A path among them leaves the folder by one step at most.
TEXTS = ("", " ", "x", "-", "--", "-x", "--help", "-1", "0", "1", "0.5", "1e400", "nan")
TEXTS += ("inf", "9" * 30, "1_0", "a b", "a\nb", "é", "\udc80", "x" * 5000, "$(x)")
TEXTS += ("{scene}", "{split}", "{", "{}", "[]", "null", '{"x": 1}', "[" * 5000, "~")
TEXTS += ("~nobody/x", ".", "..", "./x/../y", "none/such/file", "a,b", "%s", "@x", "*")
# Of these `prepared` makes files in a case's folder.
PATHS = ("a file", "a folder", "an empty folder", "an empty file", "a dead link")
PATHS += ("a loop", "a pipe", "a file/x", "a text.json", "a text.csv", "a text.npz")
# What stands at the end of a command, where nobody expects it.
MORE = (["x"], ["--"], ["--", "x"], ["--no-such"], ["-h"], ["-x"], ["--config"], [""])
# What is taken with another output, and why that is right.
EXCUSED = {
    # None are given; or those of this folder, which is the home too, by another path.
    ("alignerf.cli.judge", "--cameras ''"),
    ("alignerf.cli.judge", "--cameras '.'"),
    ("alignerf.cli.judge", "--cameras '~'"),
}
# Of a line of ours.
MAX_LETTERS = 1200
NUMBER = re.compile(r"[+-]?(\d[\d_]*\.?\d*|inf|nan)([eE][+-]?\d+)?\Z")


class Command(NamedTuple):
    """A stage's command and outputs, and the finished folder that it is started in."""

    stage: stages.Stage
    base: os.PathLike


class Case(NamedTuple):
    """A command, in words what was done to its arguments, and these.

    option: whose value is another; is_less: whether an option is left out.
    """

    command: Command
    what: str
    words: list
    option: str = ""
    is_less: bool = False

    def __str__(self):
        return f"{self.command.stage.module}, {self.what}"


def commands_of_start(folder):
    """What a user types, in a folder with photos and with renders to judge."""
    shutil.rmtree(folder, ignore_errors=True)
    judged_cases.project(folder, "kept")
    judged_cases.photos(folder / "my photos")
    (folder / "results").mkdir()
    photos = ["my photos", "--only-config", "--cores", "1", "--budget-min", "1"]
    photos += ["--name", "mine", "--background", "black"]
    judge = ["--photos", "photos", "--renders", "renders", "--name", "theirs"]
    judge += ["--cameras", "transforms.json", "--cores", "1", "--only-config"]
    found = []
    for module, words, outputs in (
        ("alignerf.cli", photos, ["results/mine.yaml"]),
        ("alignerf.cli.judge", judge, ["results/theirs.yaml"]),
        # Without a config it always refuses: what it would run takes minutes.
        ("alignerf.cli.export", ["none", "--width", "40", "--cores", "1"], []),
        ("alignerf.show", ["results"], []),
        ("alignerf.config", [], []),
    ):
        stage = stages.Stage([sys.executable, "-m", module, *words], outputs)
        running.run(stage.command, folder)
        found.append(Command(stage, folder))
    return found


def groups_of(words):
    """[[option, *its values]] of a command's arguments; a value alone has no option."""
    groups = []
    for word in words:
        if word.startswith("--") or not groups or not groups[-1][0].startswith("--"):
            groups.append([word])
        else:
            groups[-1].append(word)
    return groups


def cases_of(command):
    """Every way in which the arguments of a command are spoilt."""
    groups = groups_of(command.stage.command[3:])
    values = [value for _, *values in groups for value in values]

    def with_group(place, *instead):
        kept = [*groups[:place], *instead, *groups[place + 1 :]]
        return [word for group in kept for word in group]

    for place, (name, *own) in enumerate(groups):
        is_option = name.startswith("--")
        shown = name if is_option else f"argument {place + 1}"
        if is_option and own:
            words = with_group(place, [name])
            yield Case(command, f"{shown} without a value", words)
            equal = [f"{name}={own[0]}", *own[1:]]
            yield Case(command, f"{shown} by =", with_group(place, equal))
        words = with_group(place)
        yield Case(command, f"without {shown}", words, is_less=True)
        words = with_group(place, [name, *own], [name, *own])
        yield Case(command, f"{shown} twice", words)
        if is_option:
            words = with_group(place, [f"{name}-x", *own])
            yield Case(command, f"{name}-x", words)
        for at in range(len(own)) if is_option else (-1,):
            for text in (*TEXTS, *PATHS, *sorted({*values} - {*own})):
                group = [name, *own]
                group[at + 1] = text
                words = with_group(place, group)
                yield Case(command, f"{shown} {text!r:.60}", words, option=shown)
    for more in MORE:
        words = [*command.stage.command[3:], *more]
        yield Case(command, f"and {more}", words, option="more")


def is_short(case):
    """Whether it ends soon: what `make photos` would run otherwise takes minutes."""
    command = case.command.stage.command
    return "--only-config" not in command or "--only-config" in case.words


def prepare(place):
    """The files of PATHS in a folder."""
    (place / "a file").write_bytes(b"hello\n")
    (place / "a folder").mkdir()
    (place / "a folder" / "of a user.txt").write_text("keep me\n")
    (place / "an empty folder").mkdir()
    (place / "an empty file").touch()
    (place / "a dead link").symlink_to("nowhere")
    (place / "a loop").symlink_to("a loop")
    os.mkfifo(place / "a pipe")
    for kind in ("json", "csv", "npz"):
        (place / f"a text.{kind}").write_text("hello\n")


def attack(case, place):
    """What is wrong with how a spoilt command ends; None where nothing is."""
    stage, base = case.command
    # A step up from where it runs is still the case's own.
    inner = place / "inner"
    copy(base, inner)
    for output in stage.outputs:
        remove(inner / output)
    prepare(inner)
    before = everything(place)
    command = [*stage.command[:3], *case.words]
    variables = running.variables(inner) | {"HOME": str(inner)}
    ended = running.run(command, inner, variables)
    after = everything(place)
    return of_ended(case, ended) or of_files(case, before, after, place)


def copy(base, place):
    """A finished folder by links; what replaces a file leaves the other's as it is."""
    shutil.rmtree(place.parent, ignore_errors=True)
    ignored = shutil.ignore_patterns("checkpoints", ".snakemake*", "*.log")
    shutil.copytree(base, place, ignore=ignored, copy_function=os.link)


def remove(path):
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def everything(folder):
    """{path in it: what tells whether it was replaced} of all files and folders."""
    found = {}
    # Not by pathlib: a path in a path may be longer than a system takes.
    for inner, folders, files in os.walk(folder):
        if ".jax_cache" in folders:
            folders.remove(".jax_cache")
        for name in [*folders, *files]:
            path = os.path.join(inner, name)
            stat = os.lstat(path)
            kept = (stat.st_ino, stat.st_size, stat.st_mtime_ns)
            is_file = os.path.isfile(path) and not os.path.islink(path)
            found[os.path.relpath(path, folder)] = kept if is_file else None
    return found


def of_ended(case, ended):
    """What is wrong with what was said, and with the time and memory that it took."""
    if "Traceback" in ended.output:
        return f"traceback: {ended.output.splitlines()[-1][:200]}"
    if ended.peak_mib > running.MAX_MIB:
        return f"{ended.peak_mib:.0f} MiB"
    if ended.code == 0:
        # A whole training may follow.
        return None
    if ended.code not in (1, 2):
        return f"exit {ended.code}"
    if ended.time_s > running.MAX_S:
        return f"{ended.time_s:.0f} s"
    lines = [line for line in ended.output.splitlines() if "error: " in line]
    if len(lines) != 1:
        return f"{len(lines)} lines of error"
    # Argparse repeats what was typed, of any length.
    is_long = len(lines[0]) > MAX_LETTERS and ended.code == 1
    if is_long or not lines[0].isprintable():
        return f"a line that nobody can read: {lines[0]!r:.80}"
    return None


def of_files(case, before, after, place):
    """What was left behind, changed, or made otherwise than before."""
    own = [f"inner/{path}" for path in case.command.stage.outputs]
    if case.words.count("--help") or case.words.count("-h"):
        own = []
    for name in sorted(after.keys() - before.keys()):
        if is_hidden(name):
            return f"left {name} behind"
    for name, was in before.items():
        if name in after and after[name] == was:
            continue
        if not is_given(name, case.words) and not any(is_in(name, o) for o in own):
            return f"{name} is changed" if name in after else f"{name} is gone"
    return of_outputs(case, place / "inner")


def is_hidden(name):
    """Whether it is a temporary file or folder, or in one; no cache and no mark."""
    name = name.removesuffix(owned.MARK)
    found = (part for part in name.split("/") if part.startswith("."))
    return next(found, None) not in (None, ".jax_cache", ".cache", ".config")


def is_given(name, words):
    """Whether a command was told this very file, or a folder by its name."""
    told = {os.path.normpath(f"inner/{word}") for word in words}
    return any(is_in(name, one) for one in told if one not in ("inner", "."))


def is_in(name, folder):
    return f"{name}/".startswith(f"{folder}/")


def of_outputs(case, inner):
    """An output that is there is as before, unless another value may make another."""
    stage, base = case.command
    if case.is_less or may_differ(case) or (stage.module, case.what) in EXCUSED:
        return None
    for path in stage.outputs:
        made = stages.content(inner, path)
        # An empty folder is none yet.
        if made and made != stages.content(base, path):
            return f"taken, with another {path}"
    return None


def may_differ(case):
    """Whether a value is another of its kind: a number, a file that is right too."""
    if not case.option:
        return False
    known = case.command.stage.command
    shown = [word for word in case.words if word not in known]
    return not shown or all(NUMBER.match(word) and word != "nan" for word in shown)
