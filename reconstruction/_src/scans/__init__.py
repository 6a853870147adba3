"""Readings in, clean points out: files, leveling, smoothing, filters, localization."""
