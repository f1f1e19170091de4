"""The batch table: one row for each video of a batch, and the manifests that batches are submitted from."""
