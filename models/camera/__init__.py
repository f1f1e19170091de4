"""The camera of one shot (section 3.2), the focal length of the video, and what two shots show of one background."""
