"""Runs policies without a display, and shows what happened: `python -m fetch_composer.explorer`.

Needs the optional extra `explore`, and is imported by nothing else in the package.
"""
