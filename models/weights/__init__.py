"""The shipped network weights with their manifest, checksums and licences."""
