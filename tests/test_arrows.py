"""Which package may import which: the arrows of the architecture, held by reading every import there is."""

import ast
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
    wrong = {str(path.relative_to(ROOT)): imports(path) & forbidden for path in files if imports(path) & forbidden}
    assert not wrong


def test_the_test_sees_imports(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text("def f():\n    from thinknav_sim.scene import Scene\n    import torch.nn\n")
    assert imports(file) == {"thinknav_sim", "torch"}


def test_every_package_is_typed_and_shipped() -> None:
    shipped = (ROOT / "pyproject.toml").read_text()
    for folder in PACKAGES.values():
        assert (folder / "py.typed").exists()
        assert f'"{folder.relative_to(ROOT)}"' in shipped
