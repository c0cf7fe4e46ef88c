"""docker-compose.yml is read by a compose tool, and names what exists."""

import os
import subprocess
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]

# podman-compose asks for podman's version before it does anything; `config` needs no more of it than that.
PODMAN = '#!/bin/sh\necho "podman version 5.0.0"\n'


def test_compose_file_is_valid_and_its_dockerfiles_exist(tmp_path: Path) -> None:
    podman = tmp_path / "podman"
    podman.write_text(PODMAN)
    podman.chmod(0o755)
    compose = Path(sys.executable).with_name("podman-compose")
    done = subprocess.run(
        [compose, "-f", ROOT / "docker-compose.yml", "config"],
        env=os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    services = yaml.safe_load(done.stdout)["services"]
    assert set(services) == {"planner", "trainer"}
    for name, service in services.items():
        assert (ROOT / service["build"]["dockerfile"]).is_file(), name
    assert services["planner"]["ports"] == ["127.0.0.1:8765:8765"]  # on loopback alone
    assert services["trainer"]["depends_on"] == {"planner": {"condition": "service_healthy"}}


def test_dockerfiles_copy_what_exists() -> None:
    for dockerfile in ROOT.glob("services/*/Dockerfile"):
        copied = [line.split()[1:-1] for line in dockerfile.read_text().splitlines() if line.startswith("COPY ")]
        assert copied
        assert all((ROOT / source).exists() for sources in copied for source in sources)
