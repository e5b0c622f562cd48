"""Whoever closes a page while it is sent gets no answer: for the libraries below that is an error of the program, whose
traceback would stand in the terminal."""

from __future__ import annotations

import logging

UNANSWERED = (  # by Starlette, whose middleware waits for an answer; by Engine.IO, which reads a request that has gone
    (RuntimeError, "No response returned."),
    (KeyError, "'REQUEST_METHOD'"),
)


class Unanswered(logging.Filter):
    """Lets all pass but those."""

    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        return (type(error), str(error)) not in UNANSWERED
