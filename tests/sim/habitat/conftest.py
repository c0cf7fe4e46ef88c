"""Real data of others, which the project does not carry: tests that need it skip where it is absent."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real data: $THINKNAV_TEST_DATA, or shared/data beside the repository."""
    folder = Path(os.environ.get("THINKNAV_TEST_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"there is no {folder}; set THINKNAV_TEST_DATA to the folder of real data (docs/habitat.md)")
    return folder
