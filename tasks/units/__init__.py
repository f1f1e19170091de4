"""One stage on one unit of a video (the video, a scene or a shot): what it reads, its key, how it is computed."""
