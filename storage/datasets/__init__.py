"""Official folders of other people's data sets, as their owners hand them out: arrays in our axes and units out."""
