"""Person detector, 2D/3D pose, masks and the tracker."""
