"""Files of a running job in the bucket that a workflow's results lie in.

Snakemake copies what a job has made once it is done; what a killed pod has written is
lost. A path below `.snakemake/storage/s3/BUCKET/KEY` is that of Snakemake's copy of an
object: here such files are copied at once, by the same keys. Other paths are of a disk,
and nothing is done.
"""

import logging
import os
import re
from pathlib import Path

from alignerf.io import owned

log = logging.getLogger("alignerf")

COPY = re.compile(rf"/{re.escape(owned.STORAGE)}/s3/([^/]+)/(.+)")
# What boto3 calls what Snakemake's plugin reads from SNAKEMAKE_STORAGE_S3_*.
OPTIONS = {
    "endpoint_url": "ENDPOINT_URL",
    "region_name": "REGION",
    "aws_access_key_id": "ACCESS_KEY",
    "aws_secret_access_key": "SECRET_KEY",
    "aws_session_token": "TOKEN",
}


def object_of(path):
    """The object in a bucket that a path is the copy of; None of a path on a disk."""
    found = COPY.search(str(Path(path).resolve()))
    if not found:
        return None
    # It comes with the workflow engine's plugin, and is needed for nothing else.
    import boto3

    names = {one: f"SNAKEMAKE_STORAGE_S3_{name}" for one, name in OPTIONS.items()}
    options = {one: os.environ.get(name) for one, name in names.items()}
    return boto3.resource("s3", **options).Object(*found.groups())


def put(written, removed=()):
    """Copy files into the bucket in this order, then remove others there.

    What is not copied is logged: the next time may do, and the job goes on.
    """
    try:
        for path in written:
            if one := object_of(path):
                one.upload_file(str(path))
        for path in removed:
            if one := object_of(path):
                one.delete()
    # The client's errors have no base of their own, and it may not be installed.
    except Exception as error:
        log.warning("%s: not copied into the bucket: %s", written[0], error)


def fetch(folder):
    """Copy a folder's files from the bucket, those last that name others.

    ValueError where it cannot be read: who went on without would overwrite them.
    """
    try:
        if not (there := object_of(folder)):
            return
        start = f"{there.key}/"
        found = there.Bucket().objects.filter(Prefix=start)
        for one in sorted(found, key=lambda one: one.key.endswith(".json")):
            path = Path(folder) / one.key.removeprefix(start)
            path.parent.mkdir(parents=True, exist_ok=True)
            one.Object().download_file(str(path))
    except ImportError as error:
        log.warning("%s: stays on this disk: %s", folder, error)
    except Exception as error:
        raise ValueError(f"{folder}: not read from the bucket: {error}") from error
