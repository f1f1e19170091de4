"""The database of a team: Postgres, where it is installed."""

from collections.abc import Iterator

import pytest
from services import postgres


@pytest.fixture(scope="session")
def postgres_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """What $HUMANMM_DATABASE_URL is set to."""
    pytest.importorskip("pg8000", reason="the extra `team` is not installed")
    with postgres(tmp_path_factory.mktemp("database"), "team") as port:
        yield f"postgresql://prefect@127.0.0.1:{port}/team"
