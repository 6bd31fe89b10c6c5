"""Snakemake, and the jobs that it starts, as forks of a process that has imported both.

Most of a plan's time goes into imports, and into reading what our sources import; most
of a small job's into importing JAX. This process does both once; each run is a fork of
it, as alone as one started anew. Of a copy of the project Snakemake and other libraries
alone are kept.

`python -m tests.forks serve SOCKET` answers on a socket: a request is three file
descriptors and a line of JSON, its answer an exit code. What else the file is given are
the words of a command, which it sends to that socket: jobs find it as their `python`.
"""

import json
import os
import socket
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
OURS = ("alignerf", "flow")
# Without profiles/default, which Snakemake says that it uses, and which goes on where a
# job has failed.
PLAIN = ("--workflow-profile", "none")
# What jobs wait for most. No device is looked for before the fork.
LIBRARIES = ("jax", "flax", "optax", "cv2", "pandas", "scipy.ndimage", "pycolmap")
LIBRARIES += ("matplotlib.pyplot", "skimage.metrics", "jinja2")
PYTHON = """#!/bin/sh
exec {python} -IS {file} {socket} "$@"
"""


class Forks:
    """The process; it starts with the first command, in a folder of its own."""

    def __init__(self, folder):
        self.socket, self.python = folder / "socket", folder / "bin" / "python"
        self.process = None

    def start(self):
        import shlex
        import subprocess

        self.python.parent.mkdir()
        words = {"python": sys.executable, "file": __file__, "socket": self.socket}
        quoted = {name: shlex.quote(str(word)) for name, word in words.items()}
        self.python.write_text(PYTHON.format(**quoted))
        self.python.chmod(0o755)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.forks", "serve", str(self.socket)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self.process.stdout.readline()

    def snakemake(self, folder, *arguments, root=ROOT):
        """(exit code, all that is printed) of Snakemake in the folder."""
        words = [*PLAIN, "--directory", folder, "--snakefile", f"{root}/Snakefile"]
        copy = os.path.realpath(root) != ROOT
        variables = {"PYTHONPATH": str(root)} if copy else {}
        variables |= {"VERBOSE": os.environ.get("VERBOSE", "1")}
        return self.run("snakemake", *words, *arguments, variables=variables)

    def run(self, module, *words, variables=None):
        """(exit code, all that is printed) of `python -m module words`."""
        import tempfile

        if self.process is None:
            self.start()
        words = ["-m", module, *map(str, words)]
        environment = os.environ | (variables or {}) | {"FORKED": str(self.python)}
        with tempfile.TemporaryFile("w+") as said, open(os.devnull) as nothing:
            streams = [nothing.fileno(), said.fileno(), said.fileno()]
            code = ask(str(self.socket), words, streams, environment)
            said.seek(0)
            return code, said.read()

    def close(self):
        """End the process; jobs end with their Snakemake."""
        if self.process is not None:
            self.process.communicate()


def ask(path, words, streams=(0, 1, 2), environment=None):
    """The exit code of `python words`, run by the process that listens at the path."""
    request = {"words": words, "folder": os.getcwd()}
    request["environment"] = dict(environment or os.environ)
    with socket.socket(socket.AF_UNIX) as asked:
        asked.connect(path)
        socket.send_fds(asked, [b"\n"], streams)
        asked.sendall(json.dumps(request).encode() + b"\n")
        return int(asked.makefile().readline())


def serve(path):
    """Answer requests until standard input ends."""
    import contextlib
    import functools
    import gc
    import importlib
    import pathlib
    import select

    from snakemake import cli  # noqa: F401

    from alignerf.costs import estimate  # noqa: F401
    from alignerf.experiment import sources

    # Plans of this project look for none of its files, and read none, again.
    sources.file_of = functools.cache(sources.file_of)
    for name in OURS:
        for file in pathlib.Path(ROOT, name).rglob("*.py"):
            list(map(sources.file_of, sources.imports(file)))
    gc.freeze()
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(path)
    listening.listen()
    print("ready", flush=True)
    while listening in select.select([listening, sys.stdin], [], [])[0]:
        asked, _ = listening.accept()
        _, streams, _, _ = socket.recv_fds(asked, 1, 3)
        request = json.loads(asked.makefile().readline())
        if request["words"][:2] != ["-m", "snakemake"]:
            for name in LIBRARIES:
                importlib.import_module(name)
        if os.fork() == 0:
            listening.close()
            if (job := os.fork()) == 0:
                asked.close()
                answer(request, streams)
            code = os.waitstatus_to_exitcode(os.waitpid(job, 0)[1])
            asked.sendall(f"{code}\n".encode())
            os._exit(0)
        asked.close()
        for stream in streams:
            os.close(stream)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass


def answer(request, streams):
    """Run `python -m module` in this fork, which ends with it."""
    import atexit
    import runpy
    import threading
    import traceback

    code = 1
    try:
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
        os.environ.clear()
        os.environ.update(request["environment"])
        os.chdir(request["folder"])
        option, module, *words = request["words"]
        if option != "-m":
            os.execv(sys.executable, [sys.executable, *request["words"]])
        paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        if paths[0] not in ("", ROOT):
            forget()
        sys.path[:0] = [path for path in paths if path and path not in sys.path]
        python = os.environ.pop("FORKED", None)
        if module == "snakemake":
            sys.executable = python
        sys.argv = [module, *words]
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        threading._shutdown()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def forget():
    """Of this project nothing is imported, nor found."""
    for name in [name for name in sys.modules if name.split(".")[0] in OURS]:
        del sys.modules[name]
    sys.path[:] = [path for path in sys.path if path and path != ROOT]


if __name__ == "__main__":
    first, *rest = sys.argv[1:]
    serve(*rest) if first == "serve" else sys.exit(ask(first, rest))
