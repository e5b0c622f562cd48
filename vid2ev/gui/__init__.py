"""A page in the browser that shows what every parameter does: the extra `gui`."""
