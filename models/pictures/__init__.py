"""Pictures of a finished recording: the body over the video, the top view, the timeline. Arrays in, pictures out."""
