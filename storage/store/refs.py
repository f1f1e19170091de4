"""A reference to one artifact: small enough to travel between tasks, relative so that a moved store still hits."""

from pydantic import BaseModel, ConfigDict


class Ref(BaseModel):
    """One artifact of a store. `uri` is relative to the store's root."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    stage: str
    unit: str
    key: str
    digest: str
    """Content digest of the decoded result and its files."""

    @property
    def uri(self) -> str:
        return artifact_uri(self.stage, self.key)


def artifact_uri(stage: str, key: str) -> str:
    """Where an artifact lies in any store."""
    return f"artifacts/{stage}/{key[:2]}/{key}"
