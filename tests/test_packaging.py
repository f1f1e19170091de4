"""The wheel holds the whole tree, and what is installed from it alone recovers a clip without any network."""

import json
import os
import shutil
import socket
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
PACKAGES = ("flows", "tasks", "models", "storage")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this tree, built without asking anybody for anything."""
    folder, tree = tmp_path_factory.mktemp("wheel"), tmp_path_factory.mktemp("checkout") / "humanmm"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("src", *PACKAGES):  # a copy: building leaves files behind, and would take up those of a build before
        shutil.copytree(ROOT / name, tree / name, symlinks=True, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE", "NOTICE"):
        shutil.copy(ROOT / name, tree)
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(tree)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "Missing dependencies" in done.stdout + done.stderr:
        pytest.skip("setuptools of this environment is too old to build with")
    assert done.returncode == 0, done.stdout + done.stderr
    (found,) = folder.glob("*.whl")
    return found


def test_every_module_and_weight_file_is_in_the_wheel(wheel: Path) -> None:
    assert wheel.stat().st_size < 70e6
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("humanmm/")}
    sources = {f"humanmm/{path.relative_to(ROOT)}" for name in PACKAGES for path in (ROOT / name).rglob("*.py")}
    sources |= {str(path.relative_to(ROOT / "src")) for path in (ROOT / "src/humanmm").glob("*.py")}
    sources |= {str(path.relative_to(ROOT / "src")) for path in (ROOT / "src/humanmm/cli").glob("*.py")}
    weights = json.loads((ROOT / "models/weights/manifest.json").read_text())
    assert sources <= inside, sorted(sources - inside)
    assert not [name for name in inside if name.endswith(".py") and name not in sources], "nothing else"
    assert {f"humanmm/models/weights/{entry['name']}" for entry in weights["files"]} <= inside
    templates = {path.name for path in (ROOT / "storage/pages/templates").iterdir()}
    assert {f"humanmm/storage/pages/templates/{name}" for name in templates} <= inside
    scripts = {path.name for path in (ROOT / "storage/view/page").iterdir()}
    assert {f"humanmm/storage/view/page/{name}" for name in scripts} <= inside


def test_what_is_installed_from_the_wheel_recovers_a_clip_and_talks_to_loopback_alone(
    wheel: Path, tmp_path: Path
) -> None:
    place, audit = tmp_path / "installed", tmp_path / "sockets"
    install = [sys.executable, "-m", "pip", "install", "--no-index", "--no-deps", "--target", str(place), str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    (place / "sitecustomize.py").write_text(
        "import os, sys\n"
        "def hook(event, arguments):\n"
        "    if event in ('socket.connect', 'socket.getaddrinfo', 'socket.sendto'):\n"
        "        with open(os.environ['AUDIT'], 'a') as file:\n"
        "            print(event, arguments, file=file)\n"
        "sys.addaudithook(hook)\n"
    )
    environment = {
        **os.environ, "PYTHONPATH": str(place), "AUDIT": str(audit), "HUMANMM_CACHE": str(tmp_path / "cache"),
        "HUMANMM_STORE": str(tmp_path / "store"), "HUMANMM_SERVER_IDLE_S": "1", "HTTPS_PROXY": "http://192.0.2.1:1",
    }  # fmt: skip
    command = [sys.executable, "-m", "humanmm.cli", "recover", str(CLIP), "--out", "run"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "run\n"), done.stderr
    where = [sys.executable, "-c", "import humanmm.tasks; print(humanmm.tasks.__file__)"]
    said = subprocess.run(where, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert said.startswith(str(place)), "it ran from the wheel, not from the tree"
    netlink = f"family={int(socket.AF_NETLINK)}"  # the server asks the kernel whose connection it is
    own = ("127.0.0.1", "'localhost'", "AF_UNIX", netlink)
    assert [line for line in audit.read_text().splitlines() if not any(name in line for name in own)] == []
