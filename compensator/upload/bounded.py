"""Answers no larger than asked for, whoever reads them: HTTPX reads the body of a digest challenge by itself, to its end.

Imported where a session opens, since HTTPX takes long to load.
"""

from __future__ import annotations

from collections.abc import Iterator

import httpx

from compensator.upload.answers import Lost

# The HTTPX extension of a request that names its bound [bytes].
MOST = "most_bytes"


class Bounded(httpx.BaseTransport):
    """A transport whose answers raise Lost where they are packed, or go on after the bytes that the request's `MOST` names."""

    def __init__(self, transport: httpx.BaseTransport) -> None:
        self._transport = transport

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """Raises Lost."""
        answer = self._transport.handle_request(request)
        assert isinstance(answer.stream, httpx.SyncByteStream)
        if answer.headers.get("Content-Encoding", "identity").lower() != "identity":
            answer.stream.close()
            raise Lost("an answer in an encoding that was not asked for")
        answer.stream = _Counted(answer.stream, request.extensions[MOST])
        return answer

    def close(self) -> None:
        self._transport.close()


class _Counted(httpx.SyncByteStream):
    def __init__(self, stream: httpx.SyncByteStream, most: int) -> None:
        self._stream, self._most = stream, most

    def __iter__(self) -> Iterator[bytes]:
        read = 0
        for part in self._stream:
            read += len(part)
            if read > self._most:
                raise Lost(f"an answer of over {self._most} bytes")
            yield part

    def close(self) -> None:
        self._stream.close()
