"""Dry runs as forks of a process that has imported Snakemake.

Most of a plan's time goes into imports, and into reading what our sources import. This
process does both once; each plan is a fork of it, as alone as one started anew. Of a
copy of the project Snakemake alone is kept.

Run as `python -m tests.dry_runs`: a request is a line of JSON, its answer an exit code.
"""

import gc
import json
import os
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OURS = ("alignerf", "flow")
# Without profiles/default, which Snakemake says that it uses, and which goes on where a
# job has failed.
PLAIN = ("--workflow-profile", "none")


class Planner:
    """The process; it starts with the first plan."""

    def __init__(self):
        self.process = None

    def plan(self, folder, *arguments, root=ROOT):
        """(exit code, all that is printed) of a dry run in the folder."""
        assert "-n" in arguments
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.dry_runs"],
                cwd=ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        words = [*PLAIN, "--directory", folder, "--snakefile", root / "Snakefile"]
        with tempfile.NamedTemporaryFile("r") as said:
            request = {
                "words": [str(word) for word in (*words, *arguments)],
                "folder": os.getcwd(),
                "environment": dict(os.environ),
                "output": said.name,
                "copy": root != ROOT,
            }
            self.process.stdin.write(json.dumps(request) + "\n")
            self.process.stdin.flush()
            return int(self.process.stdout.readline()), said.read()

    def close(self):
        if self.process is not None:
            self.process.communicate()


def serve():
    """Answer requests until there are no more."""
    from snakemake import cli

    from alignerf.experiment import sources

    # Plans of this project read none of its files again.
    for name in OURS:
        for path in (ROOT / name).rglob("*.py"):
            sources.imports(path)
    gc.freeze()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            answer(json.loads(line), cli)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def answer(request, cli):
    """Run Snakemake in this fork, which ends with it."""
    code = 1
    try:
        output = os.open(request["output"], os.O_WRONLY | os.O_APPEND)
        for stream in (1, 2):
            os.dup2(output, stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.environ.clear()
        os.environ.update(request["environment"])
        os.chdir(request["folder"])
        if request["copy"]:
            forget()
        sys.argv = ["snakemake", *request["words"]]
        cli.main()
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def forget():
    """Of this project nothing is imported, nor found."""
    for name in [name for name in sys.modules if name.split(".")[0] in OURS]:
        del sys.modules[name]
    sys.path[:] = [path for path in sys.path if path and Path(path) != ROOT]


if __name__ == "__main__":
    serve()
