"""The format of encrypted files: AES-256-GCM in blocks, which can be appended and read at any place.

    57 bytes  ``GLVENC1`` and a line feed; ``W`` or ``G`` (below); 16 bytes id of the key; 16 random bytes;
              16 bytes that prove the others with the key
    slots     of 16,384 bytes, the last as long as it is; each begins with u64 place of its first byte in
              the content, then blocks, then zeros where no block fits any more
    blocks    u32 length of the content, its highest bit set in a file's last block; 12 random bytes (nonce);
              the content encrypted; 16 bytes (tag)

All little-endian. Each file has a key of its own, from the named key and its random bytes. A block is bound
to its place in the file and in the content, and to whether it is the last: it cannot be moved within a file
or between files. ``W`` files are written once and end with their last block: what is missing at the end is
noticed. ``G`` files grow, one block for each write, and end where their writer was killed; what follows the
last whole block is damage, as it is in a file that is not encrypted. A nonce is random and not a count: a
block that was cut off may be written again with another content.
"""

from __future__ import annotations

import errno
import hmac
import io
import os
import secrets
import struct
from bisect import bisect_right
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

from glovecal_client.encryption.key_file import KEY_FILE, EncryptionKey, require_cipher
from glovecal_client.errors import BadEncryptionKey, DamagedFile

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM
    from typing_extensions import Buffer  # the client runs on Python 3.10

MAGIC = b"GLVENC1\n"
WHOLE, GROWING = b"W", b"G"
SLOT_BYTES = 16384
_HEAD = struct.Struct("<8sc16s16s16s")
HEADER_BYTES = _HEAD.size
_START, _LENGTH, _PLACE = struct.Struct("<Q"), struct.Struct("<I"), struct.Struct("<QQ?")
_NONCE_BYTES, _TAG_BYTES = 12, 16
OVERHEAD_BYTES = _LENGTH.size + _NONCE_BYTES + _TAG_BYTES
_LAST = 1 << 31
_NO_ROOM = "no room for a block"
_AT_ONCE = 1 << 20
"""Bytes that are written to a file of kind ``W`` together."""


class _File(Protocol):
    """Bytes with places: a file without a buffer, or bytes in memory."""

    def read(self, size: int = -1, /) -> bytes | None: ...
    def write(self, content: Buffer, /) -> int | None: ...
    def seek(self, offset: int, whence: int = 0, /) -> int: ...
    def truncate(self, size: int | None = None, /) -> int: ...
    def close(self) -> None: ...


class _Cipher:
    """Encrypts and decrypts the blocks of one file."""

    def __init__(self, key: EncryptionKey, kind: bytes, salt: bytes) -> None:
        require_cipher()
        from cryptography.exceptions import InvalidTag
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM

        derived = key.derived(MAGIC + kind + salt)
        self._gcm: AESGCM = AESGCM(derived[:32])
        self._wrong: type[Exception] = InvalidTag
        self.kind = kind
        stated = MAGIC + kind + key.id + salt
        self.header: bytes = stated + hmac.digest(derived[32:], stated, "sha256")[:16]

    def blocks(self, content: Buffer, at: int, place: int, *, is_last: bool) -> bytes:
        """``content`` from ``place`` on, for byte ``at`` of the file, with what begins and ends slots."""
        parts: list[bytes] = []
        left = memoryview(content).cast("B")
        while len(left) or is_last:
            in_slot = (at - _HEAD.size) % SLOT_BYTES
            if in_slot == 0:
                parts.append(_START.pack(place))
                at, in_slot = at + _START.size, _START.size
            room = SLOT_BYTES - in_slot - OVERHEAD_BYTES
            if room <= 0:
                parts.append(bytes(SLOT_BYTES - in_slot))
                at += SLOT_BYTES - in_slot
                continue
            part, left = left[:room], left[room:]
            ends = is_last and not len(left)
            nonce = os.urandom(_NONCE_BYTES)
            sealed = self._gcm.encrypt(nonce, part, _PLACE.pack(at, place, ends))
            parts += (_LENGTH.pack(len(part) | (_LAST if ends else 0)), nonce, sealed)
            at, place = at + OVERHEAD_BYTES + len(part), place + len(part)
            if ends:
                break
        return b"".join(parts)

    def content(self, sealed: bytes, begins: int, stops: int, bound_to: bytes) -> bytes | None:
        """Of a block, from its nonce to its tag; None for one that was not written so and there."""
        text = begins + _NONCE_BYTES
        try:
            return self._gcm.decrypt(sealed[begins:text], sealed[text:stops], bound_to)
        except self._wrong:
            return None


def is_encrypted(begins: bytes, key: EncryptionKey | None) -> bool:
    """Whether a file whose first ``HEADER_BYTES`` are these is one of ours, damaged or not.

    With a key that is so too where the magic is damaged, and where the file ends within it; an empty file is
    a plain one.
    """
    if begins.startswith(MAGIC):
        return True
    if key is None:
        return False
    if len(begins) < _HEAD.size:
        return bool(begins) and MAGIC.startswith(begins)
    _, kind, key_id, salt, _ = _HEAD.unpack(begins)
    return key_id == key.id and begins[len(MAGIC) :] == _Cipher(key, kind, salt).header[len(MAGIC) :]


def _read_header(file: _File, key: EncryptionKey | None, name: str) -> _Cipher:
    file.seek(0)
    head = file.read(_HEAD.size) or b""
    if len(head) < _HEAD.size:
        raise DamagedFile(f"{name} is encrypted and damaged: it ends within its header")
    _, kind, key_id, salt, _ = _HEAD.unpack(head)
    if key is None:
        raise BadEncryptionKey(
            f"{name} is encrypted with the key {key_id.hex()[:8]}: name its file in {KEY_FILE}"
        )
    cipher = _Cipher(key, kind, salt)
    if head != cipher.header:
        if key_id != key.id:
            raise BadEncryptionKey(
                f"{name} is encrypted with the key {key_id.hex()[:8]}, and {key.file} holds the key "
                f"{key.id.hex()[:8]}: name the right file in {KEY_FILE}"
            )
        raise DamagedFile(f"{name} is encrypted and its header is damaged")
    return cipher


class DecryptingReader(io.RawIOBase):
    """The content of an encrypted file. What does not fit raises DamagedFile when reading comes to it; all
    that was read before is as it was written."""

    def __init__(self, file: _File, key: EncryptionKey | None, name: str, *, closes: bool = True) -> None:
        """``closes``: ``file`` is closed with it. Raises DamagedFile for a header that was changed, and a
        file of kind ``W`` that is cut; BadEncryptionKey."""
        self.name: str = name
        self._file, self._closes = file, closes
        self._cipher = _read_header(file, key, name)
        self._position = 0
        self._slot = -1
        self._at = _HEAD.size
        """Of the file: where the next block of the slot begins."""
        self._start = self._end = 0
        """Of the content: what is decrypted of the slot."""
        self._content = bytearray()
        self._ends: list[tuple[int, int]] = []
        """After each block of the slot: place in the content, and in the file."""
        self._is_damaged = self._is_complete = False
        if self._cipher.kind == WHOLE:
            self._size()
            if not self._is_complete:
                raise DamagedFile(f"{name} is encrypted and damaged: its end is missing or was changed")

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def fileno(self) -> int:
        raise io.UnsupportedOperation("what lies in the file is encrypted")

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = 0, /) -> int:
        begins = {0: lambda: 0, 1: lambda: self._position, 2: self._size}[whence]()
        if begins + offset < 0:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL), self.name)
        self._position = begins + offset
        return self._position

    def readinto(self, buffer: Any, /) -> int:
        wanted = memoryview(buffer).cast("B")
        if not len(wanted) or not self._reach(self._position):
            return 0
        begins = self._position - self._start
        part = memoryview(self._content)[begins : begins + len(wanted)]
        wanted[: len(part)] = part
        self._position += len(part)
        return len(part)

    def readall(self) -> bytes:
        parts = []
        while self._reach(self._position):
            parts.append(bytes(memoryview(self._content)[self._position - self._start :]))
            self._position = self._end
        return b"".join(parts)

    def close(self) -> None:
        if not self.closed and self._closes:
            self._file.close()
        super().close()

    def boundary(self, place: int) -> int:
        """Where in the file the block ends whose content ends at ``place``. Raises DamagedFile for a place
        within a block."""
        if place == 0:
            return _HEAD.size
        self._reach(place - 1)
        number = bisect_right(self._ends, (place, 0))
        if number == len(self._ends) or self._ends[number][0] != place:
            raise DamagedFile(
                f"{self.name} is encrypted and cannot be cut at byte {place}: no block ends there"
            )
        return self._ends[number][1]

    def end(self) -> tuple[int, int]:
        """Where whole blocks end: in the content, and in the file."""
        place = self._size()
        return place, self._at if self._ends else _HEAD.size

    def _reach(self, place: int) -> bool:
        """Decrypt the slot that holds the byte ``place``; False after the end."""
        if self._slot < 0 or place < self._start or place >= self._end + SLOT_BYTES:
            self._find(place)
        if place < self._start:
            raise DamagedFile(
                f"{self.name} is encrypted and damaged before byte {self._start} of its content"
            )
        while place >= self._end:
            if self._decrypt():
                continue
            if self._is_damaged:
                raise DamagedFile(
                    f"{self.name} is encrypted and damaged after byte {self._end} of its content"
                )
            if not self._load(self._slot + 1, follows=True):
                return False
        return True

    def _find(self, place: int) -> None:
        low, high = 0, max(self._slots() - 1, 0)
        while low < high:
            middle = (low + high + 1) // 2
            if self._slot_start(middle) > place:
                high = middle - 1
            else:
                low = middle
        self._load(low, follows=False)

    def _load(self, number: int, *, follows: bool) -> bool:
        """Begin with a slot; False where there is none."""
        begins = self._pread(_HEAD.size + number * SLOT_BYTES, _START.size)
        if not begins:
            return False
        start = _START.unpack(begins)[0] if len(begins) == _START.size else -1
        if follows and start != self._end:
            raise DamagedFile(f"{self.name} is encrypted and damaged after byte {self._end} of its content")
        self._slot, self._start, self._end = number, max(start, 0), max(start, 0)
        self._at = _HEAD.size + number * SLOT_BYTES + _START.size
        self._content, self._ends = bytearray(), []
        self._is_damaged, self._is_complete = start < 0, False
        return True

    def _decrypt(self) -> bool:
        """What there is of the slot and was not decrypted yet; whether that was something."""
        slot_end = _HEAD.size + (self._slot + 1) * SLOT_BYTES
        if self._slot < 0 or self._is_damaged or slot_end - self._at <= OVERHEAD_BYTES:
            return False
        sealed = self._pread(self._at, slot_end - self._at)
        decrypt, unpack, place_of = self._cipher.content, _LENGTH.unpack_from, _PLACE.pack
        parts, ends, at, end, begins = [], self._ends, self._at, self._end, 0
        while slot_end - at > OVERHEAD_BYTES and begins < len(sealed):
            content, is_last, length, stops = None, False, 0, begins
            if len(sealed) - begins >= OVERHEAD_BYTES and not self._is_complete:
                (length,) = unpack(sealed, begins)
                is_last, length = length >= _LAST, length & ~_LAST
                stops = begins + OVERHEAD_BYTES + length
                if stops <= len(sealed):
                    content = decrypt(sealed, begins + _LENGTH.size, stops, place_of(at, end, is_last))
            if content is None:
                self._is_damaged, self._is_complete = True, False
                break
            parts.append(content)
            begins, at, end = stops, at + OVERHEAD_BYTES + length, end + length
            ends.append((end, at))
            self._is_complete = is_last
        self._content += b"".join(parts)
        self._at, self._end = at, end
        return bool(parts)

    def _size(self) -> int:
        for number in range(self._slots() - 1, -1, -1):
            self._load(number, follows=False)
            while self._decrypt():
                pass
            if self._ends:
                self._is_complete &= self._at == self._length()
                return self._end
        self._slot = -1
        return 0

    def _slots(self) -> int:
        return -(-(self._length() - _HEAD.size) // SLOT_BYTES)

    def _slot_start(self, number: int) -> int:
        """As it is stated: the slot's first block proves it."""
        begins = self._pread(_HEAD.size + number * SLOT_BYTES, _START.size)
        return _START.unpack(begins)[0] if len(begins) == _START.size else 1 << 63

    def _length(self) -> int:
        return self._file.seek(0, os.SEEK_END)

    def _pread(self, at: int, size: int) -> bytes:
        self._file.seek(at)
        return self._file.read(size) or b""


class EncryptingWriter(io.RawIOBase):
    """Writes at the end of an encrypted file: of kind ``G`` a block for each write; of kind ``W`` much at
    once, and the rest when ``finish`` or ``close`` ends it."""

    def __init__(self, file: _File, cipher: _Cipher, place: int, at: int) -> None:
        self._file, self._cipher = file, cipher
        self._place, self._at = place, at
        self._waiting = bytearray()
        self._is_finished = cipher.kind == GROWING

    @classmethod
    def create(cls, file: _File, key: EncryptionKey, kind: bytes) -> EncryptingWriter:
        """Of an empty file. Raises OSError."""
        cipher = _Cipher(key, kind, secrets.token_bytes(16))
        if file.write(cipher.header) != _HEAD.size:
            raise OSError(errno.ENOSPC, _NO_ROOM)
        return cls(file, cipher, 0, _HEAD.size)

    @classmethod
    def resume(cls, file: _File, key: EncryptionKey | None, name: str) -> EncryptingWriter:
        """After the last whole block of a file of kind ``G``. Raises DamagedFile, BadEncryptionKey."""
        reader = DecryptingReader(file, key, name, closes=False)
        cipher, (place, at) = reader._cipher, reader.end()
        if cipher.kind != GROWING or at != reader._length():
            raise DamagedFile(f"{name} is encrypted and does not end with a whole block: it cannot go on")
        return cls(file, cipher, place, at)

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._file.fileno()  # type: ignore[attr-defined]

    def write(self, content: Any, /) -> int:
        size = len(memoryview(content).cast("B"))
        if self._cipher.kind == GROWING:
            self._append(content, is_last=False)
        else:
            self._waiting += content
            if len(self._waiting) >= _AT_ONCE:
                self._append(self._waiting, is_last=False)
                self._waiting.clear()
        return size

    def finish(self) -> None:
        """Write what is left of a file of kind ``W``, and its end."""
        if not self._is_finished:
            self._append(self._waiting, is_last=True)
            self._is_finished = True

    def tell(self) -> int:
        return self._place + len(self._waiting)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """To the end of a file that grows, where it is."""
        if self._cipher.kind == WHOLE or (offset, whence) not in (
            (self.tell(), os.SEEK_SET),
            (0, os.SEEK_CUR),
            (0, os.SEEK_END),
        ):
            raise io.UnsupportedOperation("an encrypted file is written at its end alone")
        return self.tell()

    def truncate(self, size: int | None = None, /) -> int:
        """To where it ends: takes off what a full disk left of a block."""
        if size not in (None, self.tell()):
            raise io.UnsupportedOperation("an encrypted file is not cut while it is written")
        self._file.truncate(self._at)
        return self.tell()

    def close(self) -> None:
        if self.closed:
            return
        try:
            self.finish()
        finally:
            self._is_finished = True
            self._file.close()
            super().close()

    def __exit__(self, *error: Any) -> None:
        if error[0] is not None:
            self._is_finished = True  # its end is missing, and whoever reads it is told
        super().__exit__(*error)

    def _append(self, content: Buffer, *, is_last: bool) -> None:
        blocks = self._cipher.blocks(content, self._at, self._place, is_last=is_last)
        self._file.seek(self._at)
        written = self._file.write(blocks)
        if written != len(blocks):
            with suppress(OSError):
                self._file.truncate(self._at)
            raise OSError(errno.ENOSPC, _NO_ROOM)
        self._at += len(blocks)
        self._place += len(memoryview(content).cast("B"))
