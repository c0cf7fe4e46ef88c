"""Which package may import which: the arrows of the architecture, held by reading every import there is."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PACKAGES = {
    "thinknav_proto": ROOT / "proto" / "thinknav_proto",
    "thinknav_sim": ROOT / "sim" / "thinknav_sim",
    "thinknav_models": ROOT / "models" / "thinknav_models",
    "thinknav_server": ROOT / "services" / "vlm_server" / "thinknav_server",
    "thinknav_trainer": ROOT / "services" / "trainer" / "thinknav_trainer",
}
MAY_IMPORT = {
    "thinknav_proto": set(),
    "thinknav_sim": set(),
    "thinknav_models": set(),
    "thinknav_server": {"thinknav_proto", "thinknav_models"},
    "thinknav_trainer": {"thinknav_proto", "thinknav_sim", "thinknav_models"},
}
MAY_NOT_LOAD = {
    "thinknav_proto": {"torch", "open3d"},
    "thinknav_sim": {"torch"},
    "thinknav_server": {"open3d", "gymnasium"},
}
# The renderer whose pictures are torch tensors; it imports torch when one is asked for.
EXCEPT = {"sim/thinknav_sim/render/warp_raycasting.py": {"torch"}}


def imports(path: Path) -> set[str]:
    """Top-level packages that a file imports, anywhere in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_follow_the_arrows(package: str) -> None:
    files = sorted(PACKAGES[package].rglob("*.py"))
    assert files
    forbidden = (set(PACKAGES) - {package} - MAY_IMPORT[package]) | MAY_NOT_LOAD.get(package, set())
    if package == "thinknav_sim":
        assert PACKAGES[package] / "render" / "open3d_raycasting.py" in files
    found = {str(path.relative_to(ROOT)): imports(path) & forbidden for path in files}
    wrong = {path: names for path, names in found.items() if names - EXCEPT.get(path, set())}
    assert not wrong


def test_the_simulator_comes_up_without_torch() -> None:
    """Nor do the lazy imports load anything at once."""
    program = (
        "import sys; sys.modules.update(torch=None, warp=None, open3d=None)\n"
        "import thinknav_sim.render, thinknav_sim.vector_env, thinknav_sim.homes"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_test_sees_imports(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text("def f():\n    from thinknav_sim.scene import Scene\n    import torch.nn\n")
    assert imports(file) == {"thinknav_sim", "torch"}


def test_every_package_is_typed_and_shipped() -> None:
    shipped = (ROOT / "pyproject.toml").read_text()
    for folder in PACKAGES.values():
        assert (folder / "py.typed").exists()
        assert f'"{folder.relative_to(ROOT)}"' in shipped
