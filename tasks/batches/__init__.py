"""Batches of videos: what to submit, what became of each video, and folders that are watched for new ones."""
