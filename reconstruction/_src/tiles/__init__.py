"""Scans too large for memory: points streamed into tiles, one surface a tile, seams without steps."""
