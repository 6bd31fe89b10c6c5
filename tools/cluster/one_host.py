"""A Slurm cluster on this host.

Sets up munged, slurmctld and a slurmd for each of some nodes in a folder of its own,
and takes all down again. /etc/slurm leads to that folder meanwhile: Snakemake's plugin
hides SLURM_CONF from its jobs' srun. So a host that has a cluster is left alone. From
the distribution's packages: `apt-get install slurmctld slurmd slurm-client munge`.
Memory is held by control groups where root may make them, else by Slurm's own
accounting.
"""

import contextlib
import os
import platform
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

SYSTEM = Path("/etc/slurm")
FILES = ("slurm.conf", "cgroup.conf", "gres.conf")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sinfo", "sbatch", "scontrol")
# They lie where only root's search path leads.
PLACES = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
CONF = """\
ClusterName=one_host
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType={proctrack}
TaskPlugin={task}
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams={gather}
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=1,batch_sched_delay=0
GresTypes=gpu
MpiDefault=none
# Nodes may be said to be larger than this host.
SlurmdParameters=config_overrides
# Nodes that die are given up soon, and jobs of more than their time ended soon.
SlurmdTimeout=10
KillWait=2
OverTimeLimit=0
MinJobAge=600
ReturnToService=2
{nodes}
PartitionName=main Nodes={names} Default=YES MaxTime=600 State=UP
"""
NODE = (
    "NodeName={name} NodeHostname=localhost NodeAddr=127.0.0.1 Port={port} "
    "CPUs={cpus} RealMemory={memory_mb} Gres=gpu:{gpus} State=UNKNOWN"
)
CGROUP = """\
CgroupPlugin={plugin}
ConstrainRAMSpace=yes
ConstrainSwapSpace=yes
ConstrainCores=no
"""


class Cluster:
    """A running cluster: `environ` for its commands, `nodes` by name."""

    def __init__(self, folder, environ, nodes):
        self.folder, self.environ, self.nodes = folder, environ, nodes

    def says(self, *command):
        """What a command of Slurm's writes."""
        return subprocess.run(
            command, env=self.environ, text=True, check=True, capture_output=True
        ).stdout

    def kill_node(self, name):
        """Let a node die with all that runs on it."""
        slurmd = int((self.folder / f"slurmd-{name}.pid").read_text())
        for pid in [slurmd, *steps_of(self.folder, name)]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def start_node(self, name):
        """Let a node that died come back."""
        call("slurmd", "-N", name, env=self.environ)
        wait_for(self.nodes, self.environ)


def steps_of(folder, name):
    """Process ids of a node's steps, and of what they run."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            environ = (process / "environ").read_bytes()
            command = (process / "cmdline").read_bytes()
            runs = f"SLURMD_NODENAME={name}\0".encode() in environ
            starts = f"{folder}/slurm.conf\0".encode() in environ
            if starts and (runs or b"slurmstepd" in command):
                found.append(int(process.name))
    return found


def missing():
    """Why there can be no cluster here; nothing where there can."""
    gone = [name for name in PROGRAMS if shutil.which(name, path=PLACES) is None]
    if gone:
        wanted = "apt-get install slurmctld slurmd slurm-client munge"
        return f"no {', '.join(gone)}: {wanted}"
    if any((SYSTEM / name).exists() for name in FILES):
        return f"{SYSTEM}: this host has a cluster already"
    if not os.access(SYSTEM.parent, os.W_OK):
        return f"{SYSTEM}: not to be written by this user"
    return ""


@contextlib.contextmanager
def cluster(*, nodes=2, cpus=8, memory_mb=12000, gpus=2):
    """A cluster of `nodes` nodes n1, n2, ... of that size each, until the end."""
    folder = Path(tempfile.mkdtemp(prefix="slurm-"))
    environ = os.environ | {"SLURM_CONF": f"{folder}/slurm.conf", "PATH": PLACES}
    names = [f"n{number}" for number in range(1, nodes + 1)]
    try:
        configure(folder, names, cpus=cpus, memory_mb=memory_mb, gpus=gpus)
        SYSTEM.mkdir(exist_ok=True)
        for file in FILES:
            (SYSTEM / file).symlink_to(folder / file)
        start(folder, names, environ)
        yield Cluster(folder, environ, names)
    finally:
        stop(folder, environ)
        for file in FILES:
            if (SYSTEM / file).is_symlink():
                (SYSTEM / file).unlink()
        shutil.rmtree(folder, ignore_errors=True)


def configure(folder, names, *, cpus, memory_mb, gpus):
    """Write slurm.conf, cgroup.conf, gres.conf and munge's key."""
    ports = free_ports(len(names) + 1)
    lines = [
        NODE.format(name=name, port=port, cpus=cpus, memory_mb=memory_mb, gpus=gpus)
        for name, port in zip(names, ports[1:], strict=True)
    ]
    held = groups()
    conf = CONF.format(
        host=platform.node().split(".")[0],
        port=ports[0],
        user=Path.home().owner() if os.getuid() else "root",
        folder=folder,
        proctrack="proctrack/cgroup" if held else "proctrack/linuxproc",
        task="task/cgroup" if held else "task/none",
        gather="NoOverMemoryKill" if held else "OverMemoryKill",
        nodes="\n".join(lines),
        names=",".join(names),
    )
    (folder / "slurm.conf").write_text(conf)
    (folder / "cgroup.conf").write_text(CGROUP.format(plugin=held or "cgroup/v1"))
    # Stand-ins: devices that are there on every machine, so that jobs are told numbers.
    files = ["/dev/null", "/dev/zero", "/dev/full", "/dev/random"][:gpus]
    gres = "".join(f"Name=gpu File={file}\n" for file in files)
    (folder / "gres.conf").write_text(gres)
    (folder / "munge.key").write_bytes(os.urandom(1024))
    (folder / "munge.key").chmod(0o600)
    (folder / "state").mkdir()
    folder.chmod(0o755)


def groups():
    """Slurm's plugin for control groups, where this process may make some."""
    if os.getuid() == 0 and os.access("/sys/fs/cgroup/memory/cgroup.procs", os.W_OK):
        return "cgroup/v1"
    return None


def free_ports(count):
    """Ports that nobody listens at."""
    with contextlib.ExitStack() as stack:
        found = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in found:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in found]


def start(folder, names, environ):
    """Start the daemons, and wait until all nodes are there."""
    munge = {
        name: f"{folder}/munge.{name}"
        for name in ("key", "socket", "pid", "log", "seed")
    }
    call(
        *("munged", "--force", f"--key-file={munge['key']}"),
        *(f"--socket={munge['socket']}", f"--pid-file={munge['pid']}"),
        *(f"--log-file={munge['log']}", f"--seed-file={munge['seed']}"),
        env=environ,
    )
    call("slurmctld", "-c", env=environ)
    for name in names:
        call("slurmd", "-N", name, env=environ)
    wait_for(names, environ)


def wait_for(names, environ):
    """Until all nodes are idle; RuntimeError where they are not within a minute."""
    until = time.monotonic() + 60
    while True:
        states = subprocess.run(
            ["sinfo", "--noheader", "--Node", "--format=%T"],
            env=environ,
            capture_output=True,
            text=True,
        )
        if states.stdout.split() == ["idle"] * len(names):
            return
        if time.monotonic() > until:
            raise RuntimeError(f"the nodes do not come up: {states}")
        time.sleep(0.5)


def call(*command, env):
    done = subprocess.run(command, env=env, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stdout}{done.stderr}")


def stop(folder, environ):
    """End what `start` has started, by its process ids."""
    # Jobs first: what a dead slurmd leaves behind nobody ends.
    subprocess.run(["scancel", "--user=root"], env=environ, capture_output=True)
    waiting = ["squeue", "--noheader", "--states=R,CG"]
    for _ in range(20):
        if not subprocess.run(waiting, env=environ, capture_output=True).stdout:
            break
        time.sleep(1)
    subprocess.run(["scontrol", "shutdown"], env=environ, capture_output=True)
    time.sleep(1)
    for path in sorted(folder.glob("*.pid")):
        with contextlib.suppress(OSError, ValueError):
            os.kill(int(path.read_text()), signal.SIGTERM)
