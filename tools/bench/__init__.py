"""The bench: ours and what a user would pick instead, side by side on a folder of arrays (``python tools/bench``)."""
