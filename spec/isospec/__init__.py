"""The machine-readable half of the specification: constants and shapes of the container, names of syntax elements."""
