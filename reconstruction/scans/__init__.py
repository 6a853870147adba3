"""Readings in, clean points out: files, levelling, smoothing, filters, localisation."""
