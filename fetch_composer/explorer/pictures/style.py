"""Colours shared by plots and contact sheet; they stay apart for the colour-blind."""

PAPER = '#ffffff'
INK = '#1a1f26'
FAINT = '#5c6670'
SUCCESS = '#0072b2'
FAILURE = '#d55e00'
