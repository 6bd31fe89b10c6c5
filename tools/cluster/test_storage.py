"""Results in a bucket: on a machine alone, and from pods that share nothing."""

import re
import shutil
import subprocess
import typing
import urllib.request
from pathlib import Path

import pytest
import yaml

from tests import job_cases
from tools.cluster import kubernetes_api
from tools.torture import chains

WHY = "not installed: pip install snakemake-storage-plugin-s3 'moto[server]'"
pytest.importorskip("snakemake_storage_plugin_s3", reason=WHY)
moto_server = pytest.importorskip("moto.server", reason=WHY)
boto3 = pytest.importorskip("boto3", reason=WHY)

BUCKET, PREFIX = "alignerf", "some/where"
STORAGE = ("--default-storage-provider", "s3")
STORAGE += ("--default-storage-prefix", f"s3://{BUCKET}/{PREFIX}")
CONFIG = yaml.safe_load(chains.CONFIG)
CONFIG["methods"] = {"plain": {"model": "base", "rounds": 0}}
DECISIONS = "results/tiny/decisions.json"
FACTS = "results/tiny/facts.json"


class Bucket(typing.NamedTuple):
    """A bucket of a local server, and what a run needs to find it."""

    service: typing.Any
    variables: dict

    def contents(self):
        """{key below the prefix: bytes}."""
        return {
            one.key.removeprefix(f"{PREFIX}/"): one.get()["Body"].read()
            for one in self.service.Bucket(BUCKET).objects.all()
        }


@pytest.fixture
def bucket():
    server = moto_server.ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    server.start()
    url = "http://{}:{}".format(*server.get_host_and_port())
    # Servers of one process hold the same buckets.
    urllib.request.urlopen(f"{url}/moto-api/reset", data=b"").close()
    keys = {"aws_access_key_id": "any", "aws_secret_access_key": "any"}
    service = boto3.resource("s3", endpoint_url=url, region_name="us-east-1", **keys)
    variables = {"ENDPOINT_URL": url, "ACCESS_KEY": "any", "SECRET_KEY": "any"}
    yield Bucket(
        service, {f"SNAKEMAKE_STORAGE_S3_{key}": variables[key] for key in variables}
    )
    server.stop()


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump(CONFIG, sort_keys=False))
    return path


def test_a_bucket_gets_what_a_disk_gets(tmp_path, config, bucket, snakemake):
    options = ("--configfile", config, "--cores", "2", DECISIONS)
    disk, empty, other = (tmp_path / name for name in ("disk", "empty", "other"))
    code, output = snakemake(disk, *options)
    assert code == 0, output
    code, output = snakemake(empty, *options, *STORAGE, more=bucket.variables)
    assert code == 0, output
    found = bucket.contents()
    for path in ("cameras.npz", "facts.json", "decisions.json", "images/view_000.png"):
        name = f"results/tiny/{path}"
        assert found[name] == (disk / name).read_bytes(), path
    assert "results/tiny/logs/poses.log" in found
    # What is done is known wherever the bucket is.
    code, output = snakemake(other, *options, *STORAGE, "-n", more=bucket.variables)
    assert code == 0, output
    assert "Nothing to be done" in output


def test_results_on_the_disk_are_not_mixed_with_a_bucket(
    tmp_path, config, bucket, snakemake
):
    (tmp_path / "results" / "tiny").mkdir(parents=True)
    options = ("--configfile", config, "-n", DECISIONS)
    code, output = snakemake(tmp_path, *options, *STORAGE, more=bucket.variables)
    assert code == 1
    assert output.startswith(
        "error: results/tiny: lies on the disk, or in another storage"
    )
    assert len(output.splitlines()) == 1


@pytest.fixture
def profile(root, tmp_path):
    """The profile as somebody fills it in."""
    pytest.importorskip(
        "snakemake_executor_plugin_kubernetes",
        reason="not installed: pip install snakemake-executor-plugin-kubernetes",
    )
    found = (root / "profiles/kubernetes/config.yaml").read_text()
    (tmp_path / "profile").mkdir()
    path = tmp_path / "profile" / "config.yaml"
    path.write_text(found.replace("YOUR-BUCKET/alignerf", f"{BUCKET}/{PREFIX}"))
    return "--workflow-profile", path.parent


def test_the_profile_of_kubernetes_plans_the_demo(
    tmp_path, root, profile, bucket, snakemake
):
    demo = root / "workflow/config/demo.yaml"
    options = (*profile, "--configfile", demo, "-n")
    code, output = snakemake(tmp_path, *options, more=bucket.variables)
    assert code == 0, output
    assert f"s3://{BUCKET}/{PREFIX}/results/courtyard/index.html" in output
    assert re.search(r"^train +\d+$", output, re.MULTILINE)
    assert (
        "gpu=1"
        in re.search(r"^rule train:.*?resources: (.*?)$", output, re.M | re.S)[1]
    )


def test_pods_share_nothing(tmp_path, root, config, profile, bucket, snakemake):
    project = tmp_path / "project"
    for name in ("alignerf", "flow", "workflow", "results/published"):
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / name, project / name, ignore=skipped)
    for name in ("Snakefile", "environment.yml", "requirements.lock"):
        shutil.copy(root / name, project / name)
    config = shutil.copy(config, project)
    # Pods get what git knows of.
    for command in (["init", "--quiet"], ["add", "."]):
        subprocess.run(["git", *command], cwd=project, check=True)
    (tmp_path / "pods").mkdir()
    with kubernetes_api.running(tmp_path / "pods") as (cluster, kubeconfig):
        code, output = snakemake(
            *(project, FACTS, *profile, "--configfile", config),
            *("--seconds-between-status-checks", "1"),
            *("--set-resources", "poses:gpu=1"),
            root=project,
            more=bucket.variables | {"KUBECONFIG": str(kubeconfig)},
        )
    logs = [path.read_text() for path in (tmp_path / "pods").glob("*.log")]
    assert code == 0, "\n".join([output, *logs])
    assert FACTS in bucket.contents()
    asked = [
        pod["containers"][0]["resources"]["requests"] for pod in cluster.pods.values()
    ]
    assert any(one.get("nvidia.com/gpu") == "1" for one in asked)


def test_a_training_whose_pod_is_killed_goes_on_in_another(
    tmp_path, bucket, monkeypatch, caplog
):
    """Bit for bit, from what the first one has copied into the bucket."""
    for name, value in bucket.variables.items():
        monkeypatch.setenv(name, value)
    bucket.service.create_bucket(Bucket=BUCKET)
    (tmp_path / "scene").mkdir()
    scene = job_cases.make_scene(tmp_path / "scene")
    wanted = job_cases.run(scene, tmp_path / "whole")
    at = f".snakemake/storage/s3/{BUCKET}/{PREFIX}/results/tiny/plain/round0"
    with monkeypatch.context() as patched:
        job_cases.kill_after_save(patched, 8)
        with pytest.raises(job_cases.Killed):
            job_cases.run(scene, tmp_path / "pod" / at)
    names = {Path(key).name for key in bucket.contents()}
    assert names == {"manifest.json", "state-4.msgpack", "state-8.msgpack"}
    caplog.set_level("INFO", "alignerf")
    assert job_cases.run(scene, tmp_path / "other" / at) == wanted
    assert f"resuming at step 8 of {job_cases.STEPS}" in caplog.text
    monkeypatch.setenv("SNAKEMAKE_STORAGE_S3_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(ValueError, match="checkpoints: not read from the bucket: "):
        job_cases.run(scene, tmp_path / "third" / at)
