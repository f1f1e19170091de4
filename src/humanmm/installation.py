"""What a run needs of this machine and its installation, each thing with a cure: what `humanmm doctor` prints."""

import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from humanmm import parts
from humanmm.errors import ConfigError, HumanMMError, WeightsError
from humanmm.machine import available_bytes, expanded, num_processors, nvidia_devices
from humanmm.storage.store.maintenance import in_bytes

MIN_FREE_BYTES = 1 << 30
VARIABLES = ("BLENDER", "CACHE", "DATA", "DATABASE_URL", "LOG", "SERVER_IDLE_S", "STORE")
"""The environment variables that humanmm reads, without HUMANMM_."""
_INSTALL = "install humanmm again: pip install -c constraints.txt humanmm"
_LIBRARIES = (
    "torch", "prefect", "zarr", "numpy", "scipy", "pycolmap", "opencv-python-headless", "av", "ai-edge-litert",
)  # fmt: skip


@dataclass(frozen=True)
class Check:
    """One thing that was checked."""

    name: str
    ok: bool
    found: str
    cure: str
    """What to do if the check fails; else what can be changed about it."""


def checks(store: Path) -> Iterator[Check]:
    """Everything that a run with this store needs."""
    yield from _installation()
    yield from _parts()
    yield from _store(store)
    yield from _machine()
    yield _settings()
    yield _server()


def _installation() -> Iterator[Check]:
    import importlib.metadata
    import platform

    from humanmm.models.weights.shipped import manifest, read_weights

    version = platform.python_version()
    yield Check("python", sys.version_info >= (3, 11), version, "make the environment with Python 3.11 or newer")
    for name in _LIBRARIES:
        try:
            yield Check(name, True, importlib.metadata.version(name), _INSTALL)
        except importlib.metadata.PackageNotFoundError:
            yield Check(name, False, "not installed", _INSTALL)
    try:
        for name in manifest():
            read_weights(name)
        yield Check("weight files", True, f"{len(manifest())} files match their sha256", _INSTALL)
    except WeightsError as error:
        yield Check("weight files", False, str(error), _INSTALL)


def _parts() -> Iterator[Check]:
    """The replaceable parts of other packages (docs/extend.md)."""
    for part in parts.every():
        if part.distribution is None:
            continue
        name, found = f"{part.setting} {part.name}", f"{part.distribution} {part.version}"
        try:
            parts.load(part.setting, part.name)
            yield Check(name, True, found, "")
        except ConfigError as error:
            yield Check(name, False, str(error), f"install {part.distribution} again, or name another part")


def _bucket(location: str) -> Check:
    from humanmm.storage.store.bucket import Bucket

    cure = "set AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION and, for another server, AWS_ENDPOINT_URL"
    try:
        bucket = Bucket(location)
        bucket.write("locks/doctor", b"here")
        refused = bucket.create("locks/doctor", b"twice") is None  # commits and leases rely on it
        bucket.remove(["locks/doctor"])
    except HumanMMError as error:
        return Check("bucket", False, str(error), cure)
    puts = "with conditional puts" if refused else "without conditional puts, on which commits rely"
    return Check("bucket", refused, f"{bucket.url}: writable, {puts}", cure)


def _store(store: Path) -> Iterator[Check]:
    from humanmm.storage.batches.batch_table import open_batches
    from humanmm.storage.store.bucket import is_bucket
    from humanmm.storage.store.files import existing_part, refusal_to_write
    from humanmm.storage.store.store import cache_folder

    location = str(store)
    if is_bucket(location):
        yield _bucket(location)
        store = cache_folder() / "buckets"
    existing = existing_part(expanded(store))
    refusal = refusal_to_write(existing)
    found = f"{store}: {f'not writable ({refusal})' if refusal else 'writable'}"
    yield Check("store", not refusal, found, "name a folder that you may write with --store or $HUMANMM_STORE")
    free = shutil.disk_usage(existing).free
    cure = "`humanmm gc --yes` removes what no run needs (`--with-runs`: more); or name another store"
    yield Check("free disk space", free > MIN_FREE_BYTES, in_bytes(free), cure)
    cure = "move that file away and submit the batches again: the store has what is finished"
    try:
        names = open_batches(location).names()
        yield Check("batches", True, f"{len(names)} in the store", cure)
    except HumanMMError as error:
        yield Check("batches", False, str(error), cure)


def _machine() -> Iterator[Check]:
    cores = num_processors()
    yield Check("processors", True, str(cores), f"`--run.threads {cores}` for one video, `serve --limit` for many")
    available = available_bytes()
    cure = "close other programs, or use `--run.threads 1` and `serve --limit 1`"
    found = "the system does not report it" if available is None else in_bytes(available)
    yield Check("free memory", available is None or available > 2 << 30, found, cure)
    yield Check("accelerators", True, *_accelerators())


def _accelerators() -> tuple[str, str]:
    """What was found, and what can be changed about it."""
    count = nvidia_devices()
    if not count:
        return "0", "no stage needs one"
    import torch

    if not torch.cuda.is_available():
        found = f"{count}, not used: torch {torch.__version__} "
        if torch.version.cuda is None:
            return found + "is not built for CUDA", "to use it, install torch's build for CUDA"
        return found + "sees none of them", "to use it, look at CUDA_VISIBLE_DEVICES and at the driver"
    cure = "`CUDA_VISIBLE_DEVICES=` does without; with `[run.stages.people] gpu = true` a scene waits until one is free"
    return f"{count}: {torch.cuda.get_device_name()} runs the pose networks", cure


def _settings() -> Check:
    named = [name for name in os.environ if name.startswith("HUMANMM_")]
    unknown = [name for name in named if name.removeprefix("HUMANMM_") not in VARIABLES]
    found = f"not known: {', '.join(unknown)}" if unknown else (", ".join(sorted(named)) or "none set")
    known = ", ".join(f"HUMANMM_{name}" for name in VARIABLES)
    return Check("environment variables", not unknown, found, f"it has no effect: the known ones are {known}")


def _server() -> Check:
    import urllib.request

    from humanmm.flows.server.local_server import running_server, server_files, serves_its_user_alone

    own = os.environ.get("PREFECT_API_URL")
    if not own:
        url = running_server(server_files())
        found = url.removesuffix("/api") if url else "no server runs; `humanmm recover` starts one when it needs it"
        if url and not serves_its_user_alone(server_files()):
            cure = "this kernel hides the user of a connection: use a machine of your own, or a server with a password"
            return Check("dashboard", False, f"{found} serves every user of this machine", cure)
        return Check("dashboard", True, found, "`humanmm serve` starts one that stays")
    try:
        with urllib.request.urlopen(f"{own.rstrip('/')}/health", timeout=5) as response:
            ok = response.status == 200
        found = own.removesuffix("/api")
    except (OSError, ValueError) as error:
        ok, found = False, f"{own} does not respond: {error}"
    return Check("dashboard", ok, found, "start that server, or unset PREFECT_API_URL to use a local one")
