"""A stand-in for a cluster: what Snakemake's plugin asks of Kubernetes, and no more.

Each job runs here, one after the other, in an empty folder of its own.
"""

import base64
import contextlib
import http.server
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import yaml


class Cluster(http.server.ThreadingHTTPServer):
    """Jobs that were submitted, their pods' specs, and how they ended."""

    def __init__(self, folder, path):
        super().__init__(("127.0.0.1", 0), Handler)
        self.folder, self.path, self.alone = folder, path, threading.Lock()
        self.secret, self.pods, self.codes = {}, {}, {}

    def start(self, job):
        name, pod = job["metadata"]["name"], job["spec"]["template"]["spec"]
        self.pods[name] = pod
        threading.Thread(target=self.execute, args=(name, pod)).start()

    def execute(self, name, pod):
        (container,) = pod["containers"]
        workdir = self.folder / name
        workdir.mkdir()
        keys = {
            one["name"]: self.secret[one["valueFrom"]["secretKeyRef"]["key"]]
            for one in container["env"]
        }
        keys = {key: base64.b64decode(value).decode() for key, value in keys.items()}
        with self.alone, open(self.folder / f"{name}.log", "w") as log:
            done = subprocess.run(
                [*container["command"], *container["args"]],
                cwd=workdir,
                env=keys | {"PATH": self.path, "HOME": str(workdir)},
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        self.codes[name] = done.returncode


class Handler(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self.path.endswith("/jobs"):
            self.server.start(body)
        elif self.path.endswith("/secrets"):
            self.server.secret |= body["data"]
        self.answer({})

    def do_GET(self):
        if found := re.search(r"/jobs/([\w-]+)/status$", self.path):
            code = self.server.codes.get(found[1])
            ended = {None: {}, 0: {"succeeded": 1}}.get(code, {"failed": 1})
            self.answer({"status": ended})
        else:
            self.answer({"items": []})

    def do_DELETE(self):
        self.answer({})

    def answer(self, content):
        text = json.dumps(content).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, *_):
        """Not said."""


@contextlib.contextmanager
def running(folder):
    """A cluster, and the file by which its clients find it."""
    # An image that has all plugins: Snakemake would have each pod install them.
    (folder / "bin").mkdir()
    pip = folder / "bin" / "pip"
    pip.write_text("#!/bin/sh\n")
    pip.chmod(0o755)
    path = [pip.parent, Path(sys.executable).parent, os.environ["PATH"]]
    cluster = Cluster(folder, os.pathsep.join(map(str, path)))
    threading.Thread(target=cluster.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{cluster.server_port}"
    config = {
        "current-context": "here",
        "contexts": [{"name": "here", "context": {"cluster": "here", "user": "me"}}],
        "clusters": [{"name": "here", "cluster": {"server": url}}],
        "users": [{"name": "me", "user": {}}],
    }
    path = folder / "kubeconfig.yaml"
    path.write_text(yaml.safe_dump(config))
    yield cluster, path
    cluster.shutdown()
    cluster.server_close()
