"""What README and docs tell people to do is done here, in a folder of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WAIT = """python -c 'import httpx, time
for _ in range(300):
    try: httpx.get("http://127.0.0.1:8765/readyz").raise_for_status(); break
    except httpx.HTTPError: time.sleep(0.1)'"""
MAKE = re.compile(r"^make \w", re.MULTILINE)
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(language: str) -> list[tuple[str, str]]:
    """(page, code) of each block in a language."""
    return [(page.name, code) for page in PAGES for found, code in BLOCK.findall(page.read_text()) if found == language]


def test_make_targets_of_the_readme_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    wanted = {target for page in PAGES for target in re.findall(r"^make (\w+)", page.read_text(), re.MULTILINE)}
    assert {"demo", "test"} <= wanted
    for target in wanted:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.mark.parametrize(("page", "code"), blocks("python"))
def test_python_blocks_run(page: str, code: str, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{page}: {done.stderr}"


@pytest.mark.parametrize(("page", "code"), [block for block in blocks("sh") if not MAKE.search(block[1])])
def test_shell_blocks_run(page: str, code: str, tmp_path: Path) -> None:
    """Commands after a service in the background wait for it, as a person would."""
    script = "set -e\ntrap 'for job in $(jobs -p); do kill $job; done' EXIT\n" + re.sub(r"&\n", f"&\n{WAIT}\n", code)
    env = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    env |= {"THINKNAV_CACHE": str(tmp_path / "cache")}
    command = ["bash", "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{page}: {done.stderr}"


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        for target in re.findall(r"\]\(([^)#]+)\)", prose):
            assert target.startswith("http") or (page.parent / target).exists(), f"{page.name}: {target}"
