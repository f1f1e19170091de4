"""Pictures of a finished recording: the body drawn over the video, the top view, the timeline. Arrays in, pictures out."""
