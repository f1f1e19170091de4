"""The content-addressed store, artifact schemas, the run folder, exporters and readers of truth files."""
