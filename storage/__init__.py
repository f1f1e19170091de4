"""What is on a disk or in a bucket: the store, batches, run folders, readers of foreign files, report pages."""
