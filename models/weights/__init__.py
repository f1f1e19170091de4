"""Weight files shipped with the package, each held to the sha256 of its manifest."""
