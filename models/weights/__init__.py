"""Shipped weight files: manifest, sha256, licences."""
