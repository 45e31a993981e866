"""Every error a caller of the client can meet, drawn along the question the caller asks.

    ClientError
    ├── BadName             a site, glove, subject or option cannot be used as written
    ├── WireError           a message is not what its format says; throw it away
    ├── DeviceError         a capture device cannot do what was asked
    │   ├── UnknownDevice   no device of that name is installed
    │   ├── BadOption       a device was given an option it cannot use
    │   ├── DeviceLost      the device was there and is gone (unplugged); open it again
    │   └── DeviceFinished  the device has no more to give (the end of a replayed file)
    ├── DamagedLog          a recording cannot be read at all (a damaged tail is repaired instead)
    ├── DamagedFile         an encrypted file was changed, or cut at its end (also an OSError)
    ├── BadEncryptionKey    the key of encrypted files cannot be used, or is another's (also an OSError)
    ├── CaptureRefused      capture must not start (another publisher has the glove)
    ├── NoAnswer            nobody answered a query; the sentence says what was asked
    │   ├── NotAdmitted     a site does not let this computer in; the sentence says why
    │   └── QueryRefused    somebody answered, with an error instead of data
    └── ServiceError        the service answered a REST call with a problem (status, title, detail)

Messages name the thing, the value and what would be right.
"""

from __future__ import annotations


class ClientError(Exception):
    """Base of all errors raised on purpose by the client."""


class BadName(ClientError, ValueError):
    """A site, glove, subject or other name cannot be used as written."""


class WireError(ClientError, ValueError):
    """A message is not what its format says; nothing of it was used."""


class DeviceError(ClientError):
    """A capture device cannot do what was asked."""


class UnknownDevice(DeviceError):
    """No capture device of that name is installed."""


class BadOption(DeviceError, ValueError):
    """A device was given an argument or option that it cannot use."""


class DeviceLost(DeviceError):
    """The device was there and is gone, as when its cable is pulled; close and open to bring it back."""


class DeviceFinished(DeviceError):
    """The device has no more to give, as at the end of a replayed file; capture stops cleanly.

    ``is_early``: the file ends in the middle, or is damaged from there on.
    """

    def __init__(self, message: str, *, is_early: bool = False) -> None:
        super().__init__(message)
        self.is_early = is_early


class DamagedLog(ClientError):
    """A recording cannot be read at all; a damaged tail alone is cut off instead."""


class DamagedFile(ClientError, OSError):
    """An encrypted file is not as it was written from some place on; what comes before it is."""


class BadEncryptionKey(ClientError, OSError):
    """The key of encrypted files is missing, unusable, or not the one they were encrypted with."""


class CaptureRefused(ClientError):
    """Capture must not start, for example because another publisher already has the glove."""


class NoAnswer(ClientError):
    """Nobody answered a query, or the answer was empty."""


class NotAdmitted(NoAnswer):
    """A site does not let this computer in: its certificate is expired, of another site, or revoked."""


class QueryRefused(NoAnswer):
    """Somebody answered a query with an error: asking again soon will not help."""


class ServiceError(ClientError):
    """The service answered a REST call with a problem (RFC 9457): ``status``, ``title``, ``detail``."""

    def __init__(self, status: int, title: str, detail: str = "") -> None:
        super().__init__(f"{title} ({status}): {detail}" if detail else f"{title} ({status})")
        self.status = status
        self.title = title
        self.detail = detail


def reason_of(error: BaseException) -> str:
    """What a person can be told of an error: our own sentence, or the operating system's words for what it
    refused. Of anything else only the kind; its text is for the log and for the traceback."""
    if isinstance(error, ClientError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"an unforeseen {type(error).__name__}"
